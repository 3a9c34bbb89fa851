"""A quadruped follows velocity commands on rough ground, slopes, stairs and blocks; see `tightloop.tasks.velocity`.

The ground is one field of tiles (`tightloop.terrain.mixed`): a column for each kind, a row for each level of
difficulty. An episode starts in the middle of a tile. A robot that walked most of the commanded way, and away
from the start, begins its next episode a level higher; one that fell or hardly moved begins it a level lower. After the
hardest level it begins anywhere.

| place | observation | range | unit |
|---|---|---|---|
| 0–49 | those of `QuadrupedVelocityFlat` | | |
| 50–140 | depth of the ground below the trunk, less that on level ground; 13 rays along it times 7 across | ±1 | m |

Actions, ends and ``velocity_error`` are those of `QuadrupedVelocityFlat`; heights count from the ground below. At the
edge of the field an episode is truncated. Feet that swing have to clear the highest ground within 8 cm. Rays are 10 cm
apart. The command changes every ten seconds, and 6 of 10 commands are to go straight on. ``infos`` has the level
of each world's episode, ``level``, and the most distance from its start, ``farthest`` [m].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

import tightloop as tl
from tightloop import terrain
from tightloop.checks import arguments as checks
from tightloop.env.mirror import Mirror
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.errors import ArgumentError
from tightloop.tasks.geometry import squares
from tightloop.tasks.legged import ByJoint
from tightloop.tasks.quadruped import QuadrupedVelocityFlat
from tightloop.tasks.velocity import CONTROL_DT, STILL

if TYPE_CHECKING:
    from tightloop.mujoco.scene_models import Model

KINDS = ("rough", "slopes", "slopes", "stairs", "stairs", "steps")
#: The size of the hardest level of each kind; see `tightloop.terrain`.
HARDEST = {"flat": 0.0, "rough": 0.08, "slopes": 0.5, "stairs": 0.15, "steps": 0.15, "stones": 0.3}
LEVELS = 10
TILE, CELL, BORDER = 8.0, 0.05, 6.0  # [m]
PLACE_DRAWS = 3
RAYS, SPACING = (13, 7), 0.1  # [–, m]
FOOT_RAYS, FOOT_AROUND = (3, 3), 0.16  # under a foot [–, m]
EDGE = 0.5  # an episode ends this far from the edge of the field [m]
LEAST_LIFT = 1e-3  # of a foot that swings; the sine of a half turn is not quite 0 [m]
AROUND = 0.5  # robots start this far about the middle of a tile, at most [m]
STRAIGHT = 0.6  # share of the commands without a turn
FAR = 0.4 * TILE  # a robot that went up a level was this far from its start [m]


class QuadrupedVelocityRough(QuadrupedVelocityFlat):
    """Follow velocity commands on rough ground.

    Args:
        pushes: As of `QuadrupedVelocityFlat`.
        kinds: Kinds of ground, of `tightloop.terrain.KINDS`.
        level: Level of all episodes; None for levels that follow what each robot can do.
        first_levels: Number of levels, from the easiest, that the first episodes are spread over.
        model: As of `QuadrupedVelocityFlat`, with those below.
        standing: Positions of joints when it stands.
        stiffness: Gains of the drives.
        damping: Likewise.
        scale: Effect of an action of 1.
    """

    fields = (*QuadrupedVelocityFlat.fields, "height_scan")
    levels = LEVELS
    goal_draws = 5
    goal_steps = 500
    initial_draws = PLACE_DRAWS  # before what the robot draws
    swing = 0.08
    reward_weights: Mapping[str, float] = {
        **QuadrupedVelocityFlat.reward_weights,
        "bounce": -0.25 * CONTROL_DT,
        "tilt": -0.5 * CONTROL_DT,
        "pose": -0.05 * CONTROL_DT,
        "fall": -2.0,
    }

    def __init__(
        self,
        pushes: float | None = None,
        kinds: Sequence[str] = KINDS,
        level: int | None = None,
        first_levels: int = 5,
        *,
        model: Model | None = None,
        standing: Mapping[str, float] | None = None,
        stiffness: ByJoint | None = None,
        damping: ByJoint | None = None,
        scale: ByJoint | None = None,
    ) -> None:
        super().__init__(pushes, model=model, standing=standing, stiffness=stiffness, damping=damping, scale=scale)
        self._ground = terrain.mixed(kinds, levels=LEVELS, tile=TILE, cell=CELL, border=BORDER, hardest=HARDEST)
        self._level = None if level is None else checks.integer("level", level, least=0, error=ArgumentError)
        if self._level is not None and self._level >= LEVELS:
            raise ArgumentError(f"level is {level}; give one of 0 to {LEVELS - 1}")
        self.first_levels = first_levels

    def add_ground(self, scene: tl.Scene) -> None:
        """Add the field to the scene."""
        self._ground.add_to(scene)

    def scene(self) -> tl.Scene:
        """The robot on the field, with rays below its trunk and its feet."""
        scene = super().scene()
        size = tuple((count - 1) * SPACING for count in RAYS)
        scans = [scene.add_height_scan(body=self.robot.body, size=size, shape=RAYS)]
        for link, place in self.robot.feet.values():
            around = (FOOT_AROUND, FOOT_AROUND)
            scans.append(
                scene.add_height_scan(body=f"{self.robot.name}/{link}", pos=place, size=around, shape=FOOT_RAYS)
            )
        self._rays = [scan.rays for scan in scans]
        return scene

    def observed(self) -> Sequence[Observed]:
        """The table of the module."""
        return [*super().observed(), Observed("ground", -1, 1, RAYS[0] * RAYS[1], "m")]

    def bind(self, names: Names) -> None:
        """Look up joints, feet and rays."""
        super().bind(names)
        grid, *feet = self._rays
        self._grid, self._below = grid, grid.start + (grid.stop - grid.start) // 2
        self._under_feet = slice(feet[0].start, feet[-1].stop)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Return the next command: ahead, left, turn; or to stand."""
        moves = draws[:, 3] >= STILL
        turns = moves & (draws[:, 4] >= STRAIGHT)
        signed, most = 2.0 * draws - 1.0, self.command_max
        return xp.stack(
            [most[0] * signed[:, 0] * moves, most[1] * signed[:, 1] * moves, most[2] * signed[:, 2] * turns], 1
        )

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Return places near the middle of a tile of the world's level."""
        kind = (draws[:, 2] * len(self._ground.kinds)).astype(int)
        level = self._levels(np, worlds)
        start = super().initial_state(xp, worlds, draws[:, PLACE_DRAWS:])
        joint_q = np.array(start["joint_q"] if start else worlds.joint_q)
        joint_q[:, :2] = self._ground.starts[level, kind, :2] + AROUND * (2.0 * draws[:, :2] - 1.0)
        joint_q[:, 2] += self._ground.starts[level, kind, 2]
        return {"joint_q": joint_q}

    def next_level(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return levels by how far robots walked."""
        own = worlds.memory
        fell = self.terminated(xp, worlds)
        up = ~fell & (own["walked"] > 0.7 * own["told"]) & (own["farthest"] > FAR)
        # an episode that was cut short tells little
        down = fell | ((own["told"] > FAR) & (own["walked"] < 0.4 * own["told"]))
        level = np.maximum(worlds.level + up - (down & ~up), 0)
        # digits of a place that no one chose
        anywhere = (np.abs(worlds.joint_q[:, 0]) * 997.0 % 1.0 * LEVELS).astype(level.dtype)
        return np.where(level >= LEVELS, np.minimum(anywhere, LEVELS - 1), level)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return what flat ground needs, and how far a robot walked, had to walk, and was from its start [m]."""
        own = super().remember(xp, worlds, memory)
        command, place = worlds.goal[:, :2], worlds.joint_q[:, :2]
        speed = xp.sqrt(squares(xp, command))
        along = xp.vecdot(command, own["velocity"][:, :2]) / xp.maximum(speed, 0.0 * speed + 0.1)
        if memory is None:
            return {**own, "start": place, "walked": 0.0 * speed, "told": 0.0 * speed, "farthest": 0.0 * speed}
        way = place - memory["start"]
        return {
            **own,
            "start": memory["start"],
            "walked": memory["walked"] + along * CONTROL_DT,
            "told": memory["told"] + speed * CONTROL_DT,
            "farthest": xp.maximum(memory["farthest"], xp.sqrt(squares(xp, way))),
        }

    def foot_heights(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return how high the soles are above the ground [m], shape ``(worlds, feet)``."""
        return self._soles(xp, worlds)[:, :, FOOT_RAYS[0] * FOOT_RAYS[1] // 2]

    def gait_errors(self, xp: Namespace, worlds: Worlds, lift: Array) -> Array:
        """Return how high standing feet are, and how much swinging ones lack above the highest ground around them [m].

        A foot that swings over the edge of a step may so be as high as it has to.
        """
        soles = self._soles(xp, worlds)
        lacking = xp.maximum(lift - xp.min(soles, axis=2), 0.0 * lift)
        return xp.where(lift > LEAST_LIFT, lacking, soles[:, :, FOOT_RAYS[0] * FOOT_RAYS[1] // 2])

    def _soles(self, xp: Namespace, worlds: Worlds) -> Array:
        """Heights of soles above the ground under and around them [m], shape ``(worlds, feet, rays)``."""
        heights = worlds.height_scan[:, self._under_feet] - self.robot.radius
        return xp.reshape(heights, (len(heights), len(self.robot.feet), -1))

    def base_height(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return how high the trunk is above the ground [m], shape ``(worlds,)``."""
        return worlds.height_scan[:, self._below]

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """Return the parts of the table of the module."""
        return *super().observe(xp, worlds), worlds.height_scan[:, self._grid] - self.robot.height

    def truncated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Return which robots come to the edge of the field."""
        edges = [0.5 * length - EDGE for length in self._ground.size]
        place = abs(worlds.joint_q[:, :2])
        return (place[:, 0] > edges[0]) | (place[:, 1] > edges[1])

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """Return those of flat ground, ``level``, and ``farthest``, the most distance from the start [m]."""
        return {**super().metrics(xp, worlds), "level": self._levels(xp, worlds), "farthest": worlds.memory["farthest"]}

    def _levels(self, xp: Namespace, worlds: Worlds) -> Array:
        """Levels of difficulty that worlds are at."""
        last = 0 * worlds.level + (LEVELS - 1 if self._level is None else self._level)
        return xp.minimum(worlds.level, last) if self._level is None else last

    def mirrored(self) -> Mirror | None:
        """Return left and right exchanged."""
        mirror = super().mirrored()
        if mirror is None:
            return None
        columns, rows = RAYS
        order = [row * columns + column for row in reversed(range(rows)) for column in range(columns)]
        return Mirror({**mirror.observed, "ground": (order, [1] * len(order))}, mirror.action)
