"""gymnasium's Reacher-v5 and Pusher-v5: arms that reach a target, or push an object there.

| task | observation | size |
|---|---|---|
| Reacher | cosines and sines of the joints | 2, 2 |
| | target, joint velocities, fingertip less target | 2, 2, 2 |
| Pusher | ``qpos`` and ``qvel`` of the arm | 7, 7 |
| | its tip, object, goal | 3, 3, 3 |

Reacher takes 2 torques within ±1, Pusher 7 within ±2.

The rewards are negative distances, less a share of ``|action|²``. Episodes end by time alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.gymnasium.base import GymnasiumTask, squared

_ARM = 7  # joints of Pusher's arm
_TARGET = 2  # joints of Reacher's target
_JOINT_NOISE, _SPEED_NOISE = 0.1, 0.005  # [rad], [rad/s]
_REACH = 0.2  # Reacher's targets are in a circle of this radius [m]
_APART = 0.17  # Pusher's object begins farther from its goal [m]
#: Places for Pusher's object that are tried: all are too near the goal once in 10¹⁰ episodes.
_TRIES = 24


class Reacher(GymnasiumTask):
    """Reach a target in a plane. The arguments are those of gymnasium's ``Reacher-v5``."""

    fields = ("qpos", "qvel", "xpos")
    launch_options = {"outputs_at": "last_substep"}  # noqa: RUF012
    max_episode_steps = 50
    step_infos = ("reward_dist", "reward_ctrl")

    def __init__(
        self,
        xml_file: str = "reacher.xml",
        frame_skip: int = 2,
        default_camera_config: Mapping[str, Any] | None = None,
        reward_dist_weight: float = 1,
        reward_control_weight: float = 1,
        **kwargs: Any,
    ) -> None:
        super().__init__(xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs})
        self._distance, self._control = reward_dist_weight, reward_control_weight
        self._tip, self._target = self.body("fingertip"), self.body("target")
        self.initial_draws = self._model.nq + self._model.nv  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return self.parts(
            ("cosines", 2, "–"),
            ("sines", 2, "–"),
            ("target", self._model.nq - 2, "m"),
            ("velocities", 2, "rad/s"),
            ("fingertip less target", 2, "m"),
        )

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        joints = worlds.qpos[:, :2]
        apart = worlds.memory["apart"][:, :2]
        return xp.cos(joints), xp.sin(joints), worlds.qpos[:, 2:], worlds.qvel[:, :2], apart

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise of the joints; the target anywhere in its circle."""
        nq = self._model.nq
        positions = self.spread(draws[:, :nq], _JOINT_NOISE)
        uniform = np.asarray(draws[:, nq - _TARGET : nq], np.float64)
        radius, angle = _REACH * np.sqrt(uniform[:, 0]), 2.0 * np.pi * uniform[:, 1]
        target = np.stack([radius * np.cos(angle), radius * np.sin(angle)], 1)
        positions[:, -_TARGET:] = target - self._model.qpos0[-_TARGET:]
        velocities = self.spread(draws[:, nq:], _SPEED_NOISE)
        velocities[:, -_TARGET:] = 0.0
        return self.around_start(positions, velocities)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return the way to the target, reward and infos of a step."""
        apart = worlds.xpos[:, self._tip] - worlds.xpos[:, self._target]
        distance = -self._distance * xp.sqrt(squared(xp, apart))
        control = -self._control * squared(xp, worlds.action)
        return {"apart": apart, "reward": distance + control, "reward_dist": distance, "reward_ctrl": control}


class Pusher(GymnasiumTask):
    """Push an object to a goal. The arguments are those of gymnasium's ``Pusher-v5``."""

    fields = ("qpos", "qvel", "xpos")
    launch_options = {"outputs_at": "last_substep"}  # noqa: RUF012
    max_episode_steps = 100
    step_infos = ("reward_dist", "reward_ctrl", "reward_near")

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "pusher_v5.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        reward_near_weight: float = 0.5,
        reward_dist_weight: float = 1,
        reward_control_weight: float = 0.1,
        **kwargs: Any,
    ) -> None:
        super().__init__(xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs})
        self._near, self._distance, self._control = reward_near_weight, reward_dist_weight, reward_control_weight
        self._bodies = [self.body(name) for name in ("tips_arm", "object", "goal")]
        self.initial_draws = self._model.nv + 2 * _TRIES  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return self.parts(
            ("positions", _ARM, "rad"),
            ("velocities", _ARM, "rad/s"),
            ("tip", 3, "m"),
            ("object", 3, "m"),
            ("goal", 3, "m"),
        )

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        memory = worlds.memory
        return worlds.qpos[:, :_ARM], worlds.qvel[:, :_ARM], memory["tip"], memory["object"], memory["goal"]

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """The object anywhere in a box, but not near the goal; uniform noise of the arm's velocities."""
        nv = self._model.nv
        tries = np.asarray(draws[:, nv:], np.float64).reshape(-1, _TRIES, 2)
        places = np.stack([-0.3 * tries[:, :, 0], 0.4 * tries[:, :, 1] - 0.2], 2)
        far = np.hypot(places[:, :, 0], places[:, :, 1]) > _APART
        # the first that is far enough
        place = places[np.arange(len(places)), np.argmax(far, axis=1)]
        positions = np.zeros((len(places), self._model.nq))
        positions[:, -4:-2] = place - self._model.qpos0[-4:-2]
        positions[:, -2:] = -self._model.qpos0[-2:]
        velocities = self.spread(draws[:, :nv], _SPEED_NOISE)
        velocities[:, -4:] = 0.0
        return self.around_start(positions, velocities)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return places, reward and infos of a step."""
        tip, thing, goal = (worlds.xpos[:, body] for body in self._bodies)
        near = -self._near * xp.sqrt(squared(xp, thing - tip))
        distance = -self._distance * xp.sqrt(squared(xp, thing - goal))
        control = -self._control * squared(xp, worlds.action)
        return {
            "tip": tip,
            "object": thing,
            "goal": goal,
            "reward": distance + control + near,
            "reward_dist": distance,
            "reward_ctrl": control,
            "reward_near": near,
        }
