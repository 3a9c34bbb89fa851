"""The arm of the manipulation tasks: a Franka Research 3 with its hand, on the ground, facing +x."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import tightloop as tl
from tightloop.assets import FR3
from tightloop.checks.arguments import Vector
from tightloop.env.controls import Control, EndEffectorDelta, Gripper, JointDelta, JointTarget, JointTorque
from tightloop.env.observed import Observed
from tightloop.errors import ArgumentError
from tightloop.planning.policy_terms import Values
from tightloop.scene.shapes import ORIGIN, Surface

if TYPE_CHECKING:
    # typing has it from Python 3.11 on, the package runs on 3.10
    from typing_extensions import Unpack

URDF = FR3
#: The arm's dofs, and the fingers'.
ARM = [f"arm/fr3_joint{number}" for number in range(1, 8)]
FINGERS = ["arm/fr3_finger_joint1", "arm/fr3_finger_joint2"]
#: Frame between the finger tips; its z axis points away from the hand.
TCP = "tcp"
#: What `controls` knows.
CONTROLS = ("joint_target", "joint_delta", "end_effector_delta", "torque")
#: Torques of an action of 1, beside what holds the arm [N·m]: an eighth of what the drives can.
_TORQUE = [87 / 8] * 4 + [12 / 8] * 3


def add_arm(
    scene: tl.Scene, start: list[float], *, driven: bool = True, pos: Vector = ORIGIN, **surface: Unpack[Surface]
) -> tl.Robot:
    """Add the arm and the site ``tcp``.

    Args:
        scene: The scene.
        start: Where its nine joints start [rad or m].
        driven: Whether the arm's drives hold their targets; without, it follows torques.
        pos: Where its base stands [m].
        **surface: How it touches, as `tightloop.Surface` has it.
    """
    arm = scene.add_urdf(URDF, name="arm", pos=pos, **surface)
    arm.joint_q = start
    ke, kd = (1000.0, 100.0) if driven else (0.0, 0.0)
    arm.joint_target_ke = [ke] * 7 + [1000.0] * 2
    arm.joint_target_kd = [kd] * 7 + [100.0] * 2
    arm.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
    scene.add_site(body=arm.link("fr3_hand_tcp"), name=TCP)
    return arm


def controls(
    name: str, *, scale: float, gripper: Gripper | None = None, limit: float = 1.0, lead: float | None = None
) -> list[Control]:
    """What an action does to the arm: seven numbers (``end_effector_delta``: six), and one for the gripper if given.

    Args:
        name: One of `CONTROLS`.
        scale: Of ``joint_target``: how far from the start [rad]; of ``joint_delta``: how far a step [rad].
        gripper: The control of the fingers.
        limit: How large an action of ``joint_target`` may be; of the others 1.
        lead: How far a target of ``joint_delta`` may be from its joint [rad]; any distance if left out.

    Raises:
        ArgumentError: There is no such control.
    """
    arms = {
        "joint_target": lambda: JointTarget(ARM, scale, limit=limit),
        "joint_delta": lambda: JointDelta(ARM, scale, lead=lead),
        "end_effector_delta": lambda: EndEffectorDelta(TCP, ARM, pos_scale=0.05, rot_scale=0.1),
        "torque": lambda: JointTorque(ARM, _TORQUE, hold=True),
    }
    if name not in arms:
        raise ArgumentError(f"control is {name!r}; give one of {', '.join(CONTROLS)}")
    return [arms[name](), *([] if gripper is None else [gripper])]


def gripper(*, binary: bool = False) -> Gripper:
    """One number for the fingers: open at 1; at -1 they press with 30 N on a cube of 4 cm, 10 N on each other.

    Args:
        binary: Whether there is nothing in between.
    """
    return Gripper(FINGERS, low=-0.01, high=0.04, binary=binary)


def joints_observed(start: Sequence[float] | None = None) -> list[Observed]:
    """Return the observed positions and velocities of the nine joints.

    Args:
        start: Positions that are subtracted [rad, m]; None where the task says nothing of its sources.
    """
    reach = [6.0] * 7 + [0.1] * 2
    turned = None if start is None else Values("joint_q", of="arm", minus=start)
    moving = None if start is None else Values("joint_qd", of="arm")
    return [
        Observed("joint positions", [-end for end in reach], reach, 9, "rad, m", source=turned),
        Observed("joint velocities", -10, 10, 9, "rad/s, m/s", source=moving),
    ]
