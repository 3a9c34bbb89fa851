"""A Franka arm grasps a cube that only a depth camera at its hand sees, and takes it to a place in the air.

Scene, rewards and success are those of `tightloop.tasks.pick_cube`. So are actions, but targets stay within 0.1 rad of
the joints, as in ManiSkill: an arm that leans on the ground comes up at once. The observation has what ManiSkill 3
leaves to ``PickCube-v1`` in its visual modes, and an image of 64 by 64 pixels instead of the cube's pose. The camera is
7 cm before the hand's axis and looks past the fingers; it sees 80°, and of the arm its collision shapes.

| place | observation | range | unit |
|---|---|---|---|
| 0–8 | joint positions, fingers last | ±6; fingers ±0.1 | rad, m |
| 9–17 | joint velocities | ±10 | rad/s, m/s |
| 18 | whether the fingers hold the cube | 0 or 1 | – |
| 19–25 | pose of the tcp | ±2; ±1 | m, – |
| 26–28 | goal of the cube | x, y ±0.1, z 0.02–0.32 | m |
| 29–4124 | depth of each pixel, row by row from the upper left; 0 where nothing is within 1 m | 0–1 | m |

The privileged observation, which a critic may see in training, is that of ``FrankaPickCube`` without the
cube's orientation.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import tightloop as tl
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.pick_cube import FrankaPickCube

SIZE = 64  # of the image [pixels]
FAR = 1.0  # [m]
FOV = 1.4  # [rad]
#: Where the camera is, and where it looks, in the frame of the hand: z points to the finger tips [m].
PLACE, TARGET = (0.07, 0.0, 0.02), (0.03, 0.0, 0.2)
#: Parts of the observation of `FrankaPickCube` before those that tell of the cube's pose.
_SHARED = 6
#: The part that is the cube's orientation. From images it is known but for quarter turns.
_ORIENTATION = 7


class FrankaPickCubeDepth(FrankaPickCube):
    """Pick a cube by a depth camera. ``control`` is one of `tightloop.tasks.franka.CONTROLS`."""

    fields = (*FrankaPickCube.fields, "wrist_depth")
    lead = 0.1

    def scene(self) -> tl.Scene:
        """That of `FrankaPickCube`, and a camera at the hand."""
        scene = super().scene()
        size = {"width": SIZE, "height": SIZE, "fov": FOV}
        scene.add_camera(
            body="arm/fr3_hand", pos=PLACE, target=TARGET, **size, far=FAR, sees="collisions", name="wrist"
        )
        return scene

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return [*super().observed()[:_SHARED], Observed("depth", 0.0, FAR, unit="m", shape=(SIZE, SIZE))]

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Joints, grasp, tcp, goal, image."""
        return (*super().observe(xp, worlds)[:_SHARED], worlds.wrist_depth)

    def privileged_observed(self) -> Sequence[Observed]:
        """The table of `FrankaPickCube` without the cube's orientation."""
        return _without_orientation(super().observed())

    def privileged_observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """What `FrankaPickCube` observes, without the cube's orientation."""
        return _without_orientation(super().observe(xp, worlds))


def _without_orientation(parts: Sequence[Any]) -> list[Any]:
    return [*parts[:_ORIENTATION], *parts[_ORIENTATION + 1 :]]
