"""gymnasium's Humanoid-v5 and HumanoidStandup-v5: a humanoid runs along x, or stands up.

| place | observation | unit |
|---|---|---|
| 0–21 | ``qpos`` without x and y | m, rad |
| 22–44 | ``qvel`` | m/s, rad/s |
| 45–174 | ``cinert`` of the 13 bodies | kg·m², kg·m, kg |
| 175–252 | ``cvel`` of the bodies | rad/s, m/s |
| 253–269 | ``qfrc_actuator`` of the joints | N·m |
| 270–347 | ``cfrc_ext`` of the bodies | N·m, N |

| action | range | what 1 means |
|---|---|---|
| 0–16 | ±0.4 | a torque of 25 to 300 N·m |

Humanoid gets 1.25 times the velocity of its centre of mass along x, and 5 while its torso is between 1 m and 2 m above
the ground, where its episode ends. HumanoidStandup gets the height of its torso divided by the time step, and 1. Both
lose a share of ``|action|²`` and of ``|cfrc_ext|²``.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.errors import ArgumentError
from tightloop.tasks.gymnasium.base import GymnasiumTask, speed, squared, vector

#: Degrees of freedom of the free joint.
_FREE = 6


class _Humanoid(GymnasiumTask):
    """What both share: observation, noise at the start, costs."""

    launch_options = {"outputs_at": "last_substep"}  # noqa: RUF012

    def __init__(
        self,
        model: tuple[str, int, Mapping[str, Any]],
        costs: tuple[float, float, tuple[float, float]],
        noise: float,
        shown: tuple[bool, bool, bool, bool, bool],
    ) -> None:
        super().__init__(*model)
        self._ctrl, self._contact, cost_range = costs
        self._contact_range = vector(cost_range, "the range of the contact cost")
        self._noise = noise
        excludes, *rest = shown
        self._first = 2 if excludes else 0
        # gymnasium takes nothing but True
        self._shows = [flag is True for flag in rest]
        self._tendons = _tendons(self._model)
        self.initial_draws = self._model.nq + self._model.nv  # pyright: ignore[reportAttributeAccessIssue]
        names = ("cinert", "cvel", "qfrc_actuator")
        own = [name for name, shows in zip(names, self._shows, strict=False) if shows]
        more = ("actuator_length", "actuator_velocity", "subtree_com")
        self.fields = ("qpos", "qvel", *own, "cfrc_ext", *more)  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        bodies, dofs = self._model.nbody - 1, self._model.nv
        inertias, velocities, actuators, forces = self._shows
        return self.parts(
            ("positions", self._model.nq - self._first, "m, rad"),
            ("velocities", dofs, "m/s, rad/s"),
            ("inertias", 10 * bodies * inertias, "kg·m², kg·m, kg"),
            ("body velocities", 6 * bodies * velocities, "rad/s, m/s"),
            ("actuator forces", (dofs - _FREE) * actuators, "N·m"),
            ("contact forces", 6 * bodies * forces, "N·m, N"),
        )

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        memory = worlds.memory
        lagging = [("cinert", 10), ("cvel", 6), ("qfrc_actuator", _FREE), ("cfrc_ext", 6)]
        own = [memory[name][:, first:] for (name, first), shows in zip(lagging, self._shows, strict=True) if shows]
        return (worlds.qpos[:, self._first :], worlds.qvel, *own)

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise."""
        noise = self.spread(draws, self._noise)
        return self.around_start(noise[:, : self._model.nq], noise[:, self._model.nq :])

    def lagging(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> dict[str, Array]:
        """Return what both remember: outputs of the last substep, costs, and infos."""
        worlds_count = len(worlds.qpos)
        forces = xp.reshape(worlds.cfrc_ext, (worlds_count, -1))
        if memory is None:  # gymnasium computes them in a step only
            forces = 0.0 * forces
        low, high = self._contact_range
        contact = xp.clip(self._contact * squared(xp, forces), low, high)
        named = {
            "cfrc_ext": forces,
            "contact": contact,
            "ctrl": self._ctrl * squared(xp, worlds.action),
            "x_position": worlds.qpos[:, 0],
            "y_position": worlds.qpos[:, 1],
            "tendon_length": worlds.actuator_length @ self._tendons.astype(worlds.qpos.dtype),
            "tendon_velocity": worlds.actuator_velocity @ self._tendons.astype(worlds.qpos.dtype),
        }
        for name, shows in zip(("cinert", "cvel", "qfrc_actuator"), self._shows, strict=False):
            if shows:
                named[name] = xp.reshape(getattr(worlds, name), (worlds_count, -1))
        return named


class Humanoid(_Humanoid):
    """Run along x. The arguments are those of gymnasium's ``Humanoid-v5``."""

    step_infos = (
        "x_position",
        "y_position",
        "tendon_length",
        "tendon_velocity",
        "distance_from_origin",
        "x_velocity",
        "y_velocity",
        "reward_survive",
        "reward_forward",
        "reward_ctrl",
        "reward_contact",
    )
    start_infos = ("x_position", "y_position", "tendon_length", "tendon_velocity", "distance_from_origin")

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "humanoid.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        forward_reward_weight: float = 1.25,
        ctrl_cost_weight: float = 0.1,
        contact_cost_weight: float = 5e-7,
        contact_cost_range: tuple[float, float] = (-np.inf, 10.0),
        healthy_reward: float = 5.0,
        terminate_when_unhealthy: bool = True,
        healthy_z_range: tuple[float, float] = (1.0, 2.0),
        reset_noise_scale: float = 1e-2,
        exclude_current_positions_from_observation: bool = True,
        include_cinert_in_observation: bool = True,
        include_cvel_in_observation: bool = True,
        include_qfrc_actuator_in_observation: bool = True,
        include_cfrc_ext_in_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (ctrl_cost_weight, contact_cost_weight, contact_cost_range),
            reset_noise_scale,
            (
                exclude_current_positions_from_observation,
                include_cinert_in_observation,
                include_cvel_in_observation,
                include_qfrc_actuator_in_observation,
                include_cfrc_ext_in_observation,
            ),
        )
        self._forward, self._healthy = forward_reward_weight, healthy_reward
        self._terminates = terminate_when_unhealthy
        self._heights = vector(healthy_z_range, "healthy_z_range")

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return outputs of the last substep, place, reward and infos of a step."""
        named = self.lagging(xp, worlds, memory)
        # the world's subtree is all of the model
        place = worlds.subtree_com[:, 0, :2]
        velocity = speed(place, memory, "place", self.dt)
        forward = self._forward * velocity[:, 0]
        survive = self._healthy * self._is_healthy(worlds)
        return named | {
            "place": place,
            "reward": forward + survive - (named["ctrl"] + named["contact"]),
            "distance_from_origin": xp.sqrt(squared(xp, worlds.qpos[:, :2])),
            "x_velocity": velocity[:, 0],
            "y_velocity": velocity[:, 1],
            "reward_survive": survive,
            "reward_forward": forward,
            "reward_ctrl": -named["ctrl"],
            "reward_contact": -named["contact"],
        }

    def _is_healthy(self, worlds: Worlds) -> Array:
        height, (low, high) = worlds.qpos[:, 2], self._heights
        return (low < height) & (height < high)

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array | None:
        """Which worlds are not healthy."""
        return ~self._is_healthy(worlds) if self._terminates else None


class HumanoidStandup(_Humanoid):
    """Stand up. The arguments are those of gymnasium's ``HumanoidStandup-v5``."""

    step_infos = (
        "x_position",
        "y_position",
        "z_distance_from_origin",
        "tendon_length",
        "tendon_velocity",
        "reward_linup",
        "reward_quadctrl",
        "reward_impact",
    )
    start_infos = ("x_position", "y_position", "z_distance_from_origin", "tendon_length", "tendon_velocity")

    def __init__(  # noqa: PLR0917, gymnasium has these arguments in this order
        self,
        xml_file: str = "humanoidstandup.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        uph_cost_weight: float = 1,
        ctrl_cost_weight: float = 0.1,
        impact_cost_weight: float = 0.5e-6,
        impact_cost_range: tuple[float, float] = (-np.inf, 10.0),
        reset_noise_scale: float = 1e-2,
        exclude_current_positions_from_observation: bool = True,
        include_cinert_in_observation: bool = True,
        include_cvel_in_observation: bool = True,
        include_qfrc_actuator_in_observation: bool = True,
        include_cfrc_ext_in_observation: bool = True,
        **kwargs: Any,
    ) -> None:
        del uph_cost_weight  # which gymnasium's reward does not have either
        super().__init__(
            (xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs}),
            (ctrl_cost_weight, impact_cost_weight, impact_cost_range),
            reset_noise_scale,
            (
                exclude_current_positions_from_observation,
                include_cinert_in_observation,
                include_cvel_in_observation,
                include_qfrc_actuator_in_observation,
                include_cfrc_ext_in_observation,
            ),
        )

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return outputs of the last substep, reward and infos of a step."""
        named = self.lagging(xp, worlds, memory)
        height = worlds.qpos[:, 2]
        up = height * (1.0 / self._model.opt.timestep)
        return named | {
            "reward": up - named["ctrl"] - named["contact"] + 1.0,
            "z_distance_from_origin": height - float(self._model.qpos0[2]),
            "reward_linup": up,
            "reward_quadctrl": -named["ctrl"],
            "reward_impact": -named["contact"],
        }


def _tendons(model: Any) -> NDArray[np.float64]:
    """Return what takes lengths of actuators to those of tendons, shape ``(actuators, tendons)``.

    Raises:
        ArgumentError: A tendon is not a sum of joints that each have an actuator.
    """
    from tightloop.mujoco.batch.library import mujoco

    of_joints = np.asarray(model.actuator_trntype) == int(mujoco.mjtTrn.mjTRN_JOINT)
    takes = np.zeros((model.nu, model.ntendon))
    for tendon in range(model.ntendon):
        first = model.tendon_adr[tendon]
        for wrap in range(first, first + model.tendon_num[tendon]):
            joint = model.wrap_objid[wrap]
            moving = np.flatnonzero(of_joints & (model.actuator_trnid[:, 0] == joint))
            if model.wrap_type[wrap] != int(mujoco.mjtWrap.mjWRAP_JOINT) or not len(moving):
                name = model.tendon(tendon).name
                raise ArgumentError(f"tendon {name!r}: its length is in infos only if each joint of it has an actuator")
            takes[moving[0], tendon] += model.wrap_prm[wrap] / model.actuator_gear[moving[0], 0]
    return takes
