"""What a policy of a rollout sees, and what its action drives.

A term is a part of the observation. Its values are ``scale * (values - minus)``, clipped to ``low`` and ``high``. The
daemon computes terms in the precision of the run, and the policy takes them in single precision.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from numbers import Integral, Real
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

#: The largest number in single precision.
_MOST = float(np.finfo(np.float32).max)
#: Functions of values.
FUNCTIONS = ("sin", "cos")


@dataclass(frozen=True, kw_only=True)
class Term:
    """A part of the observation; the base class of all of them.

    Attributes:
        minus: Subtracted from the values, for all or for each.
        scale: Factor of the rest, likewise.
        low: Lower bound of the result, likewise.
        high: Upper bound, likewise.
        history: Frames that the policy sees of this term, the oldest first: the present one and those before it. Before
            the first frame there are copies of it.
    """

    kind: ClassVar[str]
    minus: ArrayLike = 0.0
    scale: ArrayLike = 1.0
    low: ArrayLike = -np.inf
    high: ArrayLike = np.inf
    history: int = 1

    def __post_init__(self) -> None:
        what = type(self).__name__
        checks.integer(f"{what}: history", self.history, error=ArgumentError)
        for name in ("minus", "scale", "low", "high"):
            _numbers(f"{what}: {name}", getattr(self, name), finite=name in ("minus", "scale"))

    def size(self, info: Mapping[str, Any]) -> int | None:
        """Return the number of values, without history; None if the term does not know."""
        return None


@checked_calls
@dataclass(frozen=True)
class Values(Term):
    """Columns of a field of frames, such as ``Values("joint_q", of=["dog/FL_hip"])``.

    Attributes:
        field: Name of the field, which the launch must name.
        of: Names of what has the values, in this order: joints, links, sites, actuators, or a robot for all of its
            values. None for the whole field. If the scene has one robot, it may have another name here.
        columns: Columns of these values to take, in this order; None for all.
        axes_of: Link or floating robot in whose axes the values are seen, as vectors of three. None for world axes.
        function: ``"sin"`` or ``"cos"`` of the values after ``minus`` and ``scale``; None for the values.
    """

    kind: ClassVar[str] = "values"
    field: str
    of: str | Sequence[str] | None = None
    columns: Sequence[int] | range | None = None
    axes_of: str | None = None
    function: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.text("Values: field", self.field, error=ArgumentError)
        _names("Values: of", self.of)
        if self.columns is not None:
            _integers("Values: columns", self.columns)
        if self.axes_of is not None:
            checks.text("Values: axes_of", self.axes_of, error=ArgumentError)
        if self.function is not None and self.function not in FUNCTIONS:
            raise ArgumentError(
                f"Values: function is {self.function!r:.80}; {suggestion(str(self.function), FUNCTIONS)}"
            )


@checked_calls
@dataclass(frozen=True)
class Gravity(Term):
    """Direction of gravity in the axes of a link or of a floating robot: (0, 0, -1) where it is upright.

    Attributes:
        of: Name of the link or robot.
    """

    kind: ClassVar[str] = "gravity"
    of: str

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.text("Gravity: of", self.of, error=ArgumentError)


@checked_calls
@dataclass(frozen=True)
class Input(Term):
    """Values that the caller of a rollout gives as ``inputs``, such as a velocity command.

    Attributes:
        name: Key in ``inputs``.
        width: Number of values.
    """

    kind: ClassVar[str] = "input"
    name: str
    width: int

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.text("Input: name", self.name, error=ArgumentError)
        checks.integer("Input: width", self.width, error=ArgumentError)


@checked_calls
@dataclass(frozen=True)
class LastAction(Term):
    """The action of the frame before, within its bounds; 0 before the first frame."""

    kind: ClassVar[str] = "last_action"


@checked_calls
@dataclass(frozen=True)
class Clock(Term):
    """Sine and cosine of a phase, which begins at 0 and grows by 2π ``hz`` per second.

    Attributes:
        hz: Turns per second [Hz].
        runs_with: Name of an input; the phase is 0 while all values of it are. None for a clock that always runs.
    """

    kind: ClassVar[str] = "clock"
    hz: float
    runs_with: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.number("Clock: hz", self.hz, error=ArgumentError)
        if self.runs_with is not None:
            checks.text("Clock: runs_with", self.runs_with, error=ArgumentError)


@checked_calls
@dataclass(frozen=True, kw_only=True)
class Drive:
    """What values of the action drive: ``offset + scale * action``, clipped to ``low`` and ``high``.

    Attributes:
        command: Name of the command, such as ``"joint_target_q"``.
        of: Names of the joints, actuators or links, in the order of the values; see `Values.of`.
        scale: Effect of an action of 1, for all or for each.
        offset: Command at an action of 0, likewise.
        low: Lower bound of the command, likewise.
        high: Upper bound, likewise.
        values: Value of the action for each; None for the next ones, after those of the drives before it.
        followers: Joints that follow one of these: name, leader, multiplier and offset.
    """

    command: str
    of: str | Sequence[str] | None = None
    scale: ArrayLike = 1.0
    offset: ArrayLike = 0.0
    low: ArrayLike = -np.inf
    high: ArrayLike = np.inf
    values: Sequence[int] | None = None
    followers: Sequence[tuple[str, str, float, float]] = ()

    def __post_init__(self) -> None:
        checks.text("Drive: command", self.command, error=ArgumentError)
        _names("Drive: of", self.of)
        for name in ("scale", "offset", "low", "high"):
            _numbers(f"Drive: {name}", getattr(self, name), finite=name in ("scale", "offset"))
        if self.values is not None:
            _integers("Drive: values", self.values)
        if isinstance(self.followers, str) or not isinstance(self.followers, Sequence):
            raise ArgumentError(f"Drive: followers is {self.followers!r:.80}; give (name, leader, multiplier, offset)s")
        for follower in self.followers:
            if isinstance(follower, str) or not isinstance(follower, Sequence) or len(follower) != 4:
                raise ArgumentError(f"Drive: followers has {follower!r:.80}; give (name, leader, multiplier, offset)")
            for name in follower[:2]:
                checks.text("Drive: name of a follower or leader", name, error=ArgumentError)
            for number in follower[2:]:
                if not isinstance(number, Real):
                    raise ArgumentError(f"Drive: followers has {follower!r:.80}; give numbers after the names")
                _numbers("Drive: multiplier or offset of a follower", number, finite=True)


KINDS: dict[str, type[Term]] = {kind.kind: kind for kind in (Values, Gravity, Input, LastAction, Clock)}


def to_text(parts: Sequence[Term | Drive]) -> str:
    """Return terms or drives as JSON, for the metadata of a policy's file."""
    return json.dumps([_plain(part) for part in parts], separators=(",", ":"))


def terms_of(what: str, text: str) -> list[Term]:
    """Return the terms of such a text.

    Raises:
        ArgumentError: It is no such text.
    """
    return [_made(what, KINDS.get(str(entry.pop("kind", None))), entry) for entry in _entries(what, text)]


def drives_of(what: str, text: str) -> list[Drive]:
    """Return the drives of such a text.

    Raises:
        ArgumentError: It is no such text.
    """
    return [_made(what, Drive, entry) for entry in _entries(what, text)]


def _plain(part: Term | Drive) -> dict[str, Any]:
    plain: dict[str, Any] = {"kind": part.kind} if isinstance(part, Term) else {}
    for field in fields(part):
        value = getattr(part, field.name)
        if value is field.default or (isinstance(value, float) and value == field.default):
            continue
        plain[field.name] = _listed(value)
    return plain


def _listed(value: Any) -> Any:
    """Return what JSON has; infinities as text."""
    if isinstance(value, np.ndarray):
        # a value of float32 has no more digits than it needs
        return _listed([float(str(number)) for number in value.ravel()] if value.ndim else float(str(value)))
    if isinstance(value, str | int | None):
        return value
    if isinstance(value, float | np.number):
        return str(value) if np.isinf(value) else float(str(value))
    return [_listed(entry) for entry in value]


def _entries(what: str, text: str) -> list[dict[str, Any]]:
    try:
        entries = json.loads(text)
    except RecursionError:
        raise ArgumentError(f"{what} is nested too deeply; write it by tightloop.env.policy_metadata") from None
    except ValueError as problem:
        raise ArgumentError(f"{what} is no JSON: {problem}; write it by tightloop.env.policy_metadata") from None
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise ArgumentError(f"{what} is no list of objects; write it by tightloop.env.policy_metadata")
    return entries


def _made(what: str, kind: Any, entry: dict[str, Any]) -> Any:
    if kind is None:
        raise ArgumentError(f"{what} has a term of another kind; the kinds are {', '.join(KINDS)}")

    def numbers(value: Any) -> Any:
        if isinstance(value, list):
            return [numbers(part) for part in value]
        return float(value) if value in ("inf", "-inf") else value

    try:
        return kind(**{name: numbers(value) for name, value in entry.items()})
    except RecursionError:
        raise ArgumentError(f"{what} is nested too deeply; write it by tightloop.env.policy_metadata") from None
    except ArgumentError as problem:
        raise ArgumentError(f"{what}: {problem}") from None
    except TypeError as problem:
        cure = "write it by tightloop.env.policy_metadata"
        raise ArgumentError(f"{what} has {entry!r:.80}: {problem}; {cure}") from None


def _numbers(what: str, value: Any, *, finite: bool) -> NDArray[np.float64]:
    try:
        numbers = np.asarray(value, np.float64)
    except (TypeError, ValueError, OverflowError):
        numbers = np.full((), np.nan)
    if (np.isfinite(numbers) & (np.abs(numbers) > _MOST)).any():
        raise ArgumentError(f"{what} is {value!r:.80}; give numbers of single precision, at most {_MOST:.4g}")
    if numbers.ndim > 1 or np.isnan(numbers).any() or (finite and np.isinf(numbers).any()):
        raise ArgumentError(f"{what} is {value!r:.80}; give a {'finite ' * finite}number, or one for each value")
    return numbers


def _names(what: str, value: Any) -> None:
    if value is None or isinstance(value, str):
        return
    if not isinstance(value, Sequence) or not all(isinstance(name, str) for name in value):
        raise ArgumentError(f"{what} is {value!r:.80}; give a name, or a list of names")


def _integers(what: str, value: Any) -> None:
    entries = value.tolist() if isinstance(value, np.ndarray) else value
    is_list = isinstance(entries, Sequence) and not isinstance(entries, str)
    if not is_list or not all(isinstance(entry, Integral) and not isinstance(entry, bool) for entry in entries):
        raise ArgumentError(f"{what} is {value!r:.80}; give a list of whole numbers")
