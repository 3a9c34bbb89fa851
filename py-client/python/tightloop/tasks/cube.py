"""A cube on the ground before the arm, and whether the fingers hold it.

Contacts are those of a time step of 5 ms: their time constant of 10 ms is the shortest that is stable with it. A grasp
of 30 N then presses the pads 0.8 mm into the cube, where the default of 20 ms has 2.5 mm. At 100 Hz, which the sources
of the tasks have, a scripted grasp holds the cube in 40% of the worlds, at 200 Hz in all: so these tasks make twice as
many substeps, half as long.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.env.task import Array, Observed, Task
from tightloop.tasks import franka

#: Half the edge [m].
HALF = 0.02
#: Physics step [s].
DT = 1 / 200
#: Stiffness [1/s²] and damping [1/s] of all contacts.
KE, KD = 1e4, 200.0
#: Friction of cube and ground; and of the arm, which counts where it touches them [–].
MU, MU_ARM = 0.3, 1.15
#: How far from the start an action of ``joint_target`` goes [rad]: with 1 rad the hand comes to a quarter of the places
#: where `tightloop.tasks.lift` has its cube, with 1.25 rad to 99%.
TARGETS = 1.5
#: The contact sensors: the cube's force on each finger.
TOUCH = ("touch_left", "touch_right")
#: Least force on each finger that holds [N], and the square of the cosine of the largest angle to its way (85°).
FORCE, COS_SQUARED = 0.5, 0.0871557**2


class CubeTask(Task):
    """What tasks with an arm and a cube have in common. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    substeps: ClassVar[int]
    start: ClassVar[list[float]]  # of the joints [rad, m]
    base: ClassVar[tuple[float, float, float]]  # where the arm stands [m]
    place: ClassVar[tuple[float, float]]  # where the cube stands, x and y [m]
    noise: ClassVar[tl.Normal | None] = None  # of the arm's joints at the start [rad]
    spread: ClassVar[Mapping[str, tl.Uniform]]  # of the cube about its place, as `Scene.randomize` has it
    binary_gripper: ClassVar[bool] = False

    def __init__(self, control: str) -> None:
        self._control = control
        scale = TARGETS if control == "joint_target" else 0.1
        self._arm_controls = franka.controls(control, scale=scale, gripper=franka.gripper(binary=self.binary_gripper))

    def scene(self) -> tl.Scene:
        """Arm and cube on the ground, and contact sensors of the fingers."""
        scene = tl.Scene(dt=DT, substeps=self.substeps)
        # MuJoCo's own panda has 10; at 1000 a step takes 1.6 times as long, and a held cube slips no less
        scene.solver(impratio=10.0)
        driven = self._control != "torque"
        arm = franka.add_arm(scene, self.start, driven=driven, pos=self.base, mu=MU_ARM, ke=KE, kd=KD)
        scene.add_ground(mu=MU, ke=KE, kd=KD)
        body = scene.add_body(name="cube", pos=(*self.place, HALF))
        scene.add_box(body=body, half_extents=(HALF, HALF, HALF), density=1000.0, mu=MU, ke=KE, kd=KD)
        for name, finger in zip(TOUCH, ("fr3_leftfinger", "fr3_rightfinger"), strict=True):
            scene.add_contact_sensor(of=arm.link(finger), against=body, name=name)
        if self.noise is not None:
            scene.randomize(joint_q=dict.fromkeys(franka.ARM, self.noise))
        scene.randomize(body_q={"cube": self.spread})
        return scene

    def controls(self) -> Sequence[Control]:
        """The arm and its fingers."""
        return self._arm_controls

    def bind(self, names: Names) -> None:
        """Look up tcp, cube and sensors."""
        first = names.coords["cube"].start
        self._tcp = names.site(franka.TCP)
        self._pos, self._quat = slice(first, first + 3), slice(first + 3, first + 7)
        self._touch = [names.contact_sensor(name) for name in TOUCH]


def joints_observed() -> list[Observed]:
    """Positions and velocities of the nine joints."""
    reach = [6.0] * 7 + [0.1] * 2
    return [
        Observed("joint positions", [-end for end in reach], reach, 9, "rad, m"),
        Observed("joint velocities", -10, 10, 9, "rad/s, m/s"),
    ]


def grasped(quats: Array, left: Array, right: Array) -> Array:
    """Whether the fingers hold the cube: at least 0.5 N on both, within 85° of the way in which each opens.

    Args:
        quats: Orientation of the hand (x, y, z, w), shape ``(worlds, 4)``. Its y axis is the left finger's way.
        left: Force on the left finger [N], shape ``(worlds, 3)``.
        right: Force on the right finger.

    Returns:
        bool, shape ``(worlds,)``.
    """
    x, y, z, w = (quats[:, part] for part in range(4))
    way = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    return _pressed(left, way, 1.0) & _pressed(right, way, -1.0)


def _pressed(force: Array, way: Sequence[Array], sign: float) -> Array:
    fx, fy, fz = (force[:, axis] for axis in range(3))
    along = sign * (fx * way[0] + fy * way[1] + fz * way[2])
    square = fx * fx + fy * fy + fz * fz
    return (square >= FORCE**2) & (along > 0.0) & (along * along >= COS_SQUARED * square)
