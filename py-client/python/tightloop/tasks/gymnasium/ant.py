"""gymnasium's Ant-v5: a four-legged robot runs along x.

| place | observation | unit |
|---|---|---|
| 0–12 | ``qpos`` without x and y | m, rad |
| 13–26 | ``qvel`` | m/s, rad/s |
| 27–104 | ``cfrc_ext`` of the 13 bodies, clipped to ±1 | N·m, N |

| action | range | what 1 means |
|---|---|---|
| 0–7 | ±1 | a torque of 150 N·m at hips and ankles |

The reward is the velocity along x, plus 1 while healthy, less ``0.5 |action|²`` and ``5e-4 |cfrc_ext|²``. An episode
ends when the torso is not between 0.2 m and 1 m above the ground.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.gymnasium.base import GymnasiumTask, normal, speed, squared, vector


class Ant(GymnasiumTask):
    """Run along x. The arguments are those of gymnasium's ``Ant-v5``."""

    fields = ("qpos", "qvel", "xpos", "cfrc_ext")
    launch_options = {"outputs_at": "last_substep"}  # noqa: RUF012
    step_infos = (
        "x_position",
        "y_position",
        "distance_from_origin",
        "x_velocity",
        "y_velocity",
        "reward_forward",
        "reward_ctrl",
        "reward_contact",
        "reward_survive",
    )
    start_infos = ("x_position", "y_position", "distance_from_origin")

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "ant.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1,
        ctrl_cost_weight: float = 0.5,
        contact_cost_weight: float = 5e-4,
        healthy_reward: float = 1.0,
        main_body: int | str = 1,
        terminate_when_unhealthy: bool = True,
        healthy_z_range: tuple[float, float] = (0.2, 1.0),
        contact_force_range: tuple[float, float] = (-1.0, 1.0),
        reset_noise_scale: float = 0.1,
        exclude_current_positions_from_observation: bool = True,
        include_cfrc_ext_in_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs})
        self._forward, self._ctrl, self._contact = forward_reward_weight, ctrl_cost_weight, contact_cost_weight
        self._healthy, self._terminates = healthy_reward, terminate_when_unhealthy
        self._heights = vector(healthy_z_range, "healthy_z_range")
        self._forces = vector(contact_force_range, "contact_force_range")
        self._noise = reset_noise_scale
        self._first = 2 if exclude_current_positions_from_observation else 0
        self._shows_forces = include_cfrc_ext_in_observation
        self._body = self.body(main_body)
        self.initial_draws = self._model.nq + 2 * self._model.nv  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        forces = 6 * (self._model.nbody - 1) * self._shows_forces
        return self.parts(
            ("positions", self._model.nq - self._first, "m, rad"),
            ("velocities", self._model.nv, "m/s, rad/s"),
            ("forces", forces, "N·m, N"),
        )

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise of the positions, normal noise of the velocities."""
        nq = self._model.nq
        return self.around_start(self.spread(draws[:, :nq], self._noise), normal(draws[:, nq:], self._noise))

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return place, forces, reward and infos of a step."""
        place, position = worlds.xpos[:, self._body, :2], worlds.qpos[:, :2]
        velocity = speed(place, memory, "place", self.dt)
        forces = xp.clip(xp.reshape(worlds.cfrc_ext, (len(place), -1)), *self._forces)
        if memory is None:  # gymnasium computes them in a step only
            forces = 0.0 * forces
        forward = self._forward * velocity[:, 0]
        ctrl = -self._ctrl * squared(xp, worlds.action)
        contact = -self._contact * squared(xp, forces)
        survive = self._healthy * self._is_healthy(xp, worlds)
        return {
            "place": place,
            "forces": forces,
            "reward": forward + survive + ctrl + contact,
            "x_position": position[:, 0],
            "y_position": position[:, 1],
            "distance_from_origin": xp.sqrt(squared(xp, position)),
            "x_velocity": velocity[:, 0],
            "y_velocity": velocity[:, 1],
            "reward_forward": forward,
            "reward_ctrl": ctrl,
            "reward_contact": contact,
            "reward_survive": survive,
        }

    def _is_healthy(self, xp: Namespace, worlds: Worlds) -> Array:
        height, (low, high) = worlds.qpos[:, 2], self._heights
        # a world that is not finite is faulted, which ends its episode
        return (low <= height) & (height <= high)

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        own = (worlds.qpos[:, self._first :], worlds.qvel)
        return (*own, worlds.memory["forces"][:, 6:]) if self._shows_forces else own

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Which worlds are not healthy."""
        return ~self._is_healthy(xp, worlds) if self._terminates else None
