"""gymnasium's HalfCheetah-v5, Hopper-v5, Walker2d-v5 and Swimmer-v5: robots in a plane move along x.

| task | observation | action |
|---|---|---|
| HalfCheetah | ``qpos`` without x (8), ``qvel`` (9) | 6 torques |
| Hopper | ``qpos`` without x (5), ``qvel`` (6) within ±10 | 3 torques |
| Walker2d | ``qpos`` without x (8), ``qvel`` (9) within ±10 | 6 torques |
| Swimmer | ``qpos`` without x and y (3), ``qvel`` (5) | 2 torques |

The reward is the velocity along x less a share of ``|action|²``. Hopper and Walker2d get 1 more while healthy, and
their episodes end when they are not: too low, or tilted too far.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.gymnasium.base import GymnasiumTask, normal, speed, squared, vector

#: Bound of the velocities that Hopper and Walker2d observe [m/s or rad/s].
_FASTEST = 10.0


class _Runner(GymnasiumTask):
    """What they share: noise at the start, observation, and the reward of the velocity along x."""

    fields = ("qpos", "qvel")
    _plane = 1  # coordinates that are places
    _normal = False  # whether the noise of velocities is normal
    _clips = False  # whether velocities are clipped

    def __init__(
        self, model: tuple[str, int, Mapping[str, Any]], weights: tuple[float, float], noise: float, excludes: bool
    ) -> None:
        super().__init__(*model)
        self._forward, self._ctrl = weights
        self._noise = noise
        self._first = self._plane if excludes else 0
        draws = self._model.nq + (2 if self._normal else 1) * self._model.nv
        self.initial_draws = draws  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        positions = self._model.nq - self._first
        return self.parts(("positions", positions, "m, rad"), ("velocities", self._model.nv, "m/s, rad/s"))

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        velocities = xp.clip(worlds.qvel, -_FASTEST, _FASTEST) if self._clips else worlds.qvel
        return worlds.qpos[:, self._first :], velocities

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise of the positions; uniform or normal noise of the velocities."""
        nq = self._model.nq
        velocities = (normal if self._normal else self.spread)(draws[:, nq:], self._noise)
        return self.around_start(self.spread(draws[:, :nq], self._noise), velocities)

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return place, reward and infos of a step."""
        place = worlds.qpos[:, : self._plane]
        velocity = speed(place, memory, "place", self.dt)
        forward = self._forward * velocity[:, 0]
        ctrl = -self._ctrl * squared(xp, worlds.action)
        named = {
            "place": place,
            "reward": forward + ctrl,
            "x_position": place[:, 0],
            "x_velocity": velocity[:, 0],
            "reward_forward": forward,
            "reward_ctrl": ctrl,
        }
        if self._plane == 2:
            named |= {
                "y_position": place[:, 1],
                "y_velocity": velocity[:, 1],
                "distance_from_origin": xp.sqrt(squared(xp, place)),
            }
        return named


class HalfCheetah(_Runner):
    """Run along x. The arguments are those of gymnasium's ``HalfCheetah-v5``."""

    step_infos = ("x_position", "x_velocity", "reward_forward", "reward_ctrl")
    start_infos = ("x_position",)
    _normal = True

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "half_cheetah.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1.0,
        ctrl_cost_weight: float = 0.1,
        reset_noise_scale: float = 0.1,
        exclude_current_positions_from_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (forward_reward_weight, ctrl_cost_weight),
            reset_noise_scale,
            exclude_current_positions_from_observation,
        )


class Swimmer(_Runner):
    """Swim along x. The arguments are those of gymnasium's ``Swimmer-v5``."""

    step_infos = (
        "x_position",
        "y_position",
        "distance_from_origin",
        "x_velocity",
        "y_velocity",
        "reward_forward",
        "reward_ctrl",
    )
    start_infos = ("x_position", "y_position", "distance_from_origin")
    _plane = 2

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "swimmer.xml",
        frame_skip: int = 4,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1.0,
        ctrl_cost_weight: float = 1e-4,
        reset_noise_scale: float = 0.1,
        exclude_current_positions_from_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (forward_reward_weight, ctrl_cost_weight),
            reset_noise_scale,
            exclude_current_positions_from_observation,
        )


class _Healthy(_Runner):
    """What Hopper and Walker2d share: they must not fall."""

    step_infos = (
        "x_position",
        "z_distance_from_origin",
        "x_velocity",
        "reward_forward",
        "reward_ctrl",
        "reward_survive",
    )
    start_infos = ("x_position", "z_distance_from_origin")
    _clips = True
    _healthy: float
    _terminates: bool
    _heights: tuple[float, float]
    _angles: tuple[float, float]
    _states: tuple[float, float] | None = None

    def _is_healthy(self, xp: Namespace, worlds: Worlds) -> Array:
        height, angle = worlds.qpos[:, 1], worlds.qpos[:, 2]
        healthy = (self._heights[0] < height) & (height < self._heights[1])
        healthy = healthy & (self._angles[0] < angle) & (angle < self._angles[1])
        if self._states is not None:
            low, high = self._states
            for values in (worlds.qpos[:, 2:], worlds.qvel):
                healthy = healthy & xp.all((low < values) & (values < high), axis=1)
        return healthy

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return place, reward and infos of a step."""
        named = dict(super().remember(xp, worlds, memory))
        survive = self._healthy * self._is_healthy(xp, worlds)
        named["reward"] = named["reward"] + survive
        named["reward_survive"] = survive
        named["z_distance_from_origin"] = worlds.qpos[:, 1] - float(self._model.qpos0[1])
        return named

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Which worlds are not healthy."""
        return ~self._is_healthy(xp, worlds) if self._terminates else None


class Hopper(_Healthy):
    """Hop along x. The arguments are those of gymnasium's ``Hopper-v5``."""

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "hopper.xml",
        frame_skip: int = 4,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1.0,
        ctrl_cost_weight: float = 1e-3,
        healthy_reward: float = 1.0,
        terminate_when_unhealthy: bool = True,
        healthy_state_range: tuple[float, float] = (-100.0, 100.0),
        healthy_z_range: tuple[float, float] = (0.7, float("inf")),
        healthy_angle_range: tuple[float, float] = (-0.2, 0.2),
        reset_noise_scale: float = 5e-3,
        exclude_current_positions_from_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (forward_reward_weight, ctrl_cost_weight),
            reset_noise_scale,
            exclude_current_positions_from_observation,
        )
        self._healthy, self._terminates = healthy_reward, terminate_when_unhealthy
        self._states = vector(healthy_state_range, "healthy_state_range")
        self._heights = vector(healthy_z_range, "healthy_z_range")
        self._angles = vector(healthy_angle_range, "healthy_angle_range")


class Walker2d(_Healthy):
    """Walk along x. The arguments are those of gymnasium's ``Walker2d-v5``."""

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "walker2d_v5.xml",
        frame_skip: int = 4,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1.0,
        ctrl_cost_weight: float = 1e-3,
        healthy_reward: float = 1.0,
        terminate_when_unhealthy: bool = True,
        healthy_z_range: tuple[float, float] = (0.8, 2.0),
        healthy_angle_range: tuple[float, float] = (-1.0, 1.0),
        reset_noise_scale: float = 5e-3,
        exclude_current_positions_from_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (forward_reward_weight, ctrl_cost_weight),
            reset_noise_scale,
            exclude_current_positions_from_observation,
        )
        self._healthy, self._terminates = healthy_reward, terminate_when_unhealthy
        self._heights = vector(healthy_z_range, "healthy_z_range")
        self._angles = vector(healthy_angle_range, "healthy_angle_range")
