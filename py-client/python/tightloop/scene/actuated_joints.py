"""Which joints get position actuators, and with which gains."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.errors import SceneError


def chosen(subject: str, joints: str | Sequence[str], names: Sequence[str], named_only: Collection[str]) -> list[str]:
    """Return the joints that names and patterns mean, in the order of the model.

    Args:
        subject: What has the joints, for messages.
        joints: Names, or regular expressions for whole names.
        names: Joints that may have an actuator.
        named_only: Those of them that patterns leave out.

    Raises:
        SceneError: A pattern is none, or matches nothing.
    """
    what = f"{subject}: add_position_actuators: joints"
    patterns = [joints] if isinstance(joints, str) else joints
    is_list = isinstance(patterns, Sequence) and len(patterns) > 0
    if not is_list or not all(isinstance(pattern, str) for pattern in patterns):
        raise SceneError(f"{what} is {joints!r:.80}; give names or regular expressions")
    found: set[str] = set()
    for pattern in patterns:
        try:
            matching = [name for name in names if name not in named_only and re.fullmatch(pattern, name)]
        except re.error as problem:
            raise SceneError(f"{what}: {pattern!r} is no pattern ({problem}); give names or patterns") from None
        own = [pattern] if pattern in names else matching
        if not own:
            cure = suggestion(pattern, names) if names else "it has no joint that could have one"
            raise SceneError(f"{what}: {pattern!r} matches no joint that may have an actuator; {cure}")
        found.update(own)
    return [name for name in names if name in found]


def gains(
    subject: str, stiffness: float, damping: float, effort_limit: float | None
) -> tuple[float, float, float | None]:
    """Check stiffness, damping and effort limit.

    Raises:
        SceneError: One of them is no number, or is too small.
    """
    what = f"{subject}: add_position_actuators"
    limit = effort_limit
    if limit is not None:
        limit = checks.number(f"{what}: effort_limit", limit, above=0.0, infinite=True)
    return (
        checks.number(f"{what}: stiffness", stiffness, above=0.0),
        checks.number(f"{what}: damping", damping, least=0.0),
        limit,
    )
