"""A cube on the ground before the arm, and whether the fingers hold it.

The sources of the tasks make steps of 10 ms. Here the fingers, which close with 0.34 m/s, would then go as far as 11 mm
into the cube before its contacts stop them, and squeeze it out in 40% of the worlds, where a policy by hand grasps it
at 200 Hz in all. So these tasks make twice as many substeps, half as long. The time constant of contacts is the
shortest that is stable with them, 10 ms: a grasp of 30 N presses each pad 0.7 mm into the cube (3 mm for a moment,
while it closes), with the default of 20 ms 2.5 mm.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import ClassVar

import tightloop as tl
from tightloop.env.controls import Control
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace, Task
from tightloop.tasks import franka

#: Half the edge [m].
HALF = 0.02
#: Physics step [s].
DT = 1 / 200
#: Stiffness [1/s²] and damping [1/s] of all contacts.
KE, KD = 1e4, 200.0
#: Friction of cube and ground; and of the arm, which counts where it touches them [–].
MU, MU_ARM = 0.3, 1.15
#: Of actions of ``joint_target``, that is 1.5 rad from the start: with 1 rad the hand comes to a quarter of the places
#: where `tightloop.tasks.lift` has its cube, with 1.25 rad to 99%.
LIMIT = 3.0
#: The contact sensors: the cube's force on each finger.
TOUCH = ("touch_left", "touch_right")
#: Least force on each finger that holds [N].
FORCE = 0.5
#: Square of half the cosine of 85°, the largest angle between that force and the way in which the finger opens.
LEAST = (0.5 * math.cos(math.radians(85.0))) ** 2


class CubeTask(Task):
    """What tasks with an arm and a cube have in common. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    substeps: ClassVar[int]
    start: ClassVar[list[float]]  # of the joints [rad, m]
    base: ClassVar[tuple[float, float, float]]  # where the arm stands [m]
    place: ClassVar[tuple[float, float]]  # where the cube stands, x and y [m]
    noise: ClassVar[tl.Normal | None] = None  # of the arm's joints at the start [rad]
    spread: ClassVar[Mapping[str, tl.Uniform]]  # of the cube about its place, as `Scene.randomize` has it
    binary_gripper: ClassVar[bool] = False
    #: How far a target of ``joint_delta`` may be from its joint [rad]; any distance if None.
    lead: ClassVar[float | None] = None

    def __init__(self, control: str) -> None:
        self._control = control
        scale = 0.5 if control == "joint_target" else 0.1
        gripper = franka.gripper(binary=self.binary_gripper)
        self._arm_controls = franka.controls(control, scale=scale, limit=LIMIT, gripper=gripper, lead=self.lead)

    def scene(self) -> tl.Scene:
        """Arm and cube on the ground, and contact sensors of the fingers."""
        scene = tl.Scene(dt=DT, substeps=self.substeps)
        # a held cube creeps by 0.2 mm in 5 s; by nothing at 1000, where a step takes 1.6 times as long
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


def grasped(xp: Namespace, quats: Array, left: Array, right: Array) -> Array:
    """Whether the fingers hold the cube: at least 0.5 N on both, within 85° of the way in which each opens.

    Args:
        xp: The namespace.
        quats: Orientation of the hand (x, y, z, w), shape ``(worlds, 4)``. Its y axis is the left finger's way.
        left: Force on the left finger [N], shape ``(worlds, 3)``.
        right: Force on the right finger.

    Returns:
        bool, shape ``(worlds,)``.
    """
    x, y, z, w = (quats[:, part] for part in range(4))
    # half the hand's y axis in world axes
    way = x * y - w * z, 0.5 - (x * x + z * z), y * z + w * x
    (left_along, left_square), (right_along, right_square) = _along(left, way), _along(right, way)
    # f·y ≥ |f| cos 85°, squared with its sign
    pressed = (left_along * abs(left_along) >= LEAST * left_square) & (
        right_along * abs(right_along) <= -LEAST * right_square
    )
    return pressed & (xp.minimum(left_square, right_square) >= FORCE**2)


def _along(force: Array, way: Sequence[Array]) -> tuple[Array, Array]:
    """Product of a force with a direction, and its square."""
    x, y, z = (force[:, axis] for axis in range(3))
    return x * way[0] + y * way[1] + z * way[2], x * x + y * y + z * z
