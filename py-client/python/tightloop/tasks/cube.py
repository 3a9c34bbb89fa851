"""A cube on the ground before the arm, and whether the fingers hold it.

Contacts are those of a time step of 5 ms: their time constant of 10 ms is the shortest that is stable with it. A grasp of
30 N then presses the pads 0.8 mm into the cube, where the default of 20 ms has 2.5 mm. At 100 Hz, which the sources of
the tasks have, a scripted grasp holds the cube in 40% of the worlds, at 200 Hz in all: so these tasks make twice as many
substeps, half as long.
"""

from __future__ import annotations

from collections.abc import Sequence

import tightloop as tl
from tightloop.env.names import Names
from tightloop.env.task import Array, Namespace
from tightloop.shapes import Surface
from tightloop.tasks import franka

#: Half the edge [m].
HALF = 0.02
#: Physics step [s].
DT = 1 / 200
#: How everything touches, but for friction.
SURFACE: Surface = {"ke": 1e4, "kd": 200.0}
#: Friction of cube and ground; and of the arm, which counts where it touches them [–].
MU, MU_ARM = 0.3, 1.15
#: The contact sensors: the cube's force on each finger.
TOUCH = ("touch_left", "touch_right")
#: Least force on each finger that holds [N], and the square of the cosine of the largest angle to its way (85°).
FORCE, COS_SQUARED = 0.5, 0.0871557**2


def scene(
    *, substeps: int, start: list[float], driven: bool, base: Sequence[float], cube: Sequence[float]
) -> tuple[tl.Scene, tl.Robot]:
    """An arm and a cube on the ground, and the contact sensors of the fingers.

    Args:
        substeps: Physics steps a control step.
        start: Where the arm's joints start [rad or m].
        driven: Whether its drives hold their targets.
        base: Where it stands [m].
        cube: Where the cube stands, x and y [m].
    """
    made = tl.Scene(dt=DT, substeps=substeps)
    # MuJoCo's own panda has 10; at 1000 a step takes 1.6 times as long, and a held cube slips no less
    made.solver(impratio=10.0)
    arm = franka.add_arm(made, start, driven=driven, pos=tuple(base), mu=MU_ARM, **SURFACE)
    made.add_ground(mu=MU, **SURFACE)
    body = made.add_body(name="cube", pos=(*cube, HALF))
    made.add_box(body=body, half_extents=(HALF, HALF, HALF), density=1000.0, mu=MU, **SURFACE)
    for name, finger in zip(TOUCH, ("fr3_leftfinger", "fr3_rightfinger"), strict=True):
        made.add_contact_sensor(of=arm.link(finger), against=body, name=name)
    return made, arm


class Places:
    """Where arm and cube are in the arrays.

    Attributes:
        tcp: Place of the tcp in ``site_q``.
        pos: Columns of the cube's position in ``joint_q``.
        pose: Columns of its position and orientation.
        touch: Places of the sensors in ``contact_sensor``, left and right.
    """

    def __init__(self, names: Names) -> None:
        first = names.coords["cube"].start
        self.tcp = names.site(franka.TCP)
        self.pos, self.pose = slice(first, first + 3), slice(first, first + 7)
        self.touch = [names.contact_sensor(name) for name in TOUCH]


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
    way = 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)
    return _pressed(left, way, 1.0) & _pressed(right, way, -1.0)


def _pressed(force: Array, way: Sequence[Array], sign: float) -> Array:
    fx, fy, fz = (force[:, axis] for axis in range(3))
    along = sign * (fx * way[0] + fy * way[1] + fz * way[2])
    square = fx * fx + fy * fy + fz * fz
    return (square >= FORCE**2) & (along > 0.0) & (along * along >= COS_SQUARED * square)
