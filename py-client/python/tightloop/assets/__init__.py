"""Files that come with tightloop: robots, and small trained policies.

>>> scene = tl.Scene()
>>> arm = scene.add_urdf(tightloop.assets.FR3, name="arm")
>>> policy = tightloop.assets.policy("FrankaReach")
"""

from __future__ import annotations

from pathlib import Path

from tightloop.assets.policy import Policy
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError

__all__ = ["ANT", "CARTPOLE", "FR3", "HUMANOID", "POLICIES", "QUADRUPED", "Policy", "policy"]

_FOLDER = Path(__file__).parent
#: URDF of a Franka FR3 with its hand; ``fr3/README.md`` beside it says where it is from.
FR3 = _FOLDER / "fr3/fr3_franka_hand.urdf"
#: URDF of a cart with a pole.
CARTPOLE = _FOLDER / "cartpole.urdf"
#: URDF of a quadruped with 12 joints.
QUADRUPED = _FOLDER / "quadruped.urdf"
#: URDF of a humanoid with 23 joints.
HUMANOID = _FOLDER / "humanoid.urdf"
#: URDF of an ant: a ball with four legs of two joints.
ANT = _FOLDER / "ant.urdf"
#: Files of the trained policies, by task.
POLICIES = {file.stem: file for file in sorted((_FOLDER / "policies").glob("*.npz"))}


@checked_calls
def policy(task: str) -> Policy:
    """Return a trained policy of a task; ``examples/trained/README.md`` says what it reaches.

    Args:
        task: Name of the task, one of `POLICIES`.

    Raises:
        ArgumentError: There is no policy for the task.
    """
    if task not in POLICIES:
        raise ArgumentError(f"policy: task is {task!r}; {suggestion(str(task), POLICIES)}")
    return Policy(POLICIES[task])
