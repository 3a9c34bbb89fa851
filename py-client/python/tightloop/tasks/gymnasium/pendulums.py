"""gymnasium's InvertedPendulum-v5 and InvertedDoublePendulum-v5: a cart balances one pole or two.

| task | observation | size |
|---|---|---|
| InvertedPendulum | ``qpos``, ``qvel`` | 2, 2 |
| InvertedDoublePendulum | x, sines and cosines of the angles | 1, 2, 2 |
| | ``qvel`` and the constraint force on the cart, within ±10 | 3, 1 |

The action is the force on the cart: 100 N per unit within ±3 for one pole, 500 N within ±1 for two.

InvertedPendulum gets 1 per step until the pole leans by more than 0.2 rad. InvertedDoublePendulum gets 10 until its tip
is below 1 m, less what the tip is off and how fast the joints are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.gymnasium.base import GymnasiumTask, normal

_LEANING = 0.2  # [rad]
_LOWEST = 1.0  # of the tip [m]
_MOST = 10.0  # of velocities and forces that are observed


class InvertedPendulum(GymnasiumTask):
    """Balance a pole. The arguments are those of gymnasium's ``InvertedPendulum-v5``."""

    fields = ("qpos", "qvel")
    step_infos = ("reward_survive",)

    def __init__(
        self,
        xml_file: str = "inverted_pendulum.xml",
        frame_skip: int = 2,
        default_camera_config: Mapping[str, Any] | None = None,
        reset_noise_scale: float = 0.01,
        **kwargs: Any,
    ) -> None:
        super().__init__(xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs})
        self._noise = reset_noise_scale
        self.initial_draws = self._model.nq + self._model.nv  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        return self.parts(("positions", self._model.nq, "m, rad"), ("velocities", self._model.nv, "m/s, rad/s"))

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        return worlds.qpos, worlds.qvel

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise."""
        noise = self.spread(draws, self._noise)
        return self.around_start(noise[:, : self._model.nq], noise[:, self._model.nq :])

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return the reward."""
        survive = 1.0 * self._stands(xp, worlds)
        return {"reward": survive, "reward_survive": survive}

    def _stands(self, xp: Namespace, worlds: Worlds) -> Array:
        return xp.abs(worlds.qpos[:, 1]) <= _LEANING

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Which worlds lean too far."""
        return ~self._stands(xp, worlds)


class InvertedDoublePendulum(GymnasiumTask):
    """Balance two poles. The arguments are those of gymnasium's ``InvertedDoublePendulum-v5``."""

    fields = ("qpos", "qvel", "site_xpos", "qfrc_constraint")
    launch_options = {"outputs_at": "last_substep"}  # noqa: RUF012
    step_infos = ("reward_survive", "distance_penalty", "velocity_penalty")

    def __init__(
        self,
        xml_file: str = "inverted_double_pendulum.xml",
        frame_skip: int = 5,
        default_camera_config: Mapping[str, Any] | None = None,
        healthy_reward: float = 10.0,
        reset_noise_scale: float = 0.1,
        **kwargs: Any,
    ) -> None:
        super().__init__(xml_file, frame_skip, {"default_camera_config": default_camera_config, **kwargs})
        self._healthy, self._noise = healthy_reward, reset_noise_scale
        self.initial_draws = self._model.nq + 2 * self._model.nv  # pyright: ignore[reportAttributeAccessIssue]

    def observed(self) -> Sequence[Observed]:
        """The table above."""
        angles = self._model.nq - 1
        return self.parts(
            ("place", 1, "m"),
            ("sines", angles, "–"),
            ("cosines", angles, "–"),
            ("velocities", self._model.nv, "m/s, rad/s"),
            ("constraint force", 1, "N"),
        )

    def observe(self, xp: Namespace, worlds: Worlds) -> Sequence[Array]:
        """The table above."""
        place, angles = worlds.qpos[:, 0], worlds.qpos[:, 1:]
        velocities = xp.clip(worlds.qvel, -_MOST, _MOST)
        return place, xp.sin(angles), xp.cos(angles), velocities, worlds.memory["force"]

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Uniform noise of the positions, normal noise of the velocities."""
        nq = self._model.nq
        return self.around_start(self.spread(draws[:, :nq], self._noise), normal(draws[:, nq:], self._noise))

    def remember(self, xp: Namespace, worlds: Worlds, memory: Mapping[str, Array] | None) -> Mapping[str, Array]:
        """Return force, height, reward and infos of a step."""
        x, height = worlds.site_xpos[:, 0, 0], worlds.site_xpos[:, 0, 2]
        away, first, second = height - 2.0, worlds.qvel[:, 1], worlds.qvel[:, 2]
        distance = -(0.01 * (x * x) + away * away)
        velocity = -(1e-3 * (first * first) + 5e-3 * (second * second))
        survive = self._healthy * (height > _LOWEST)
        return {
            "height": height,
            "force": xp.clip(worlds.qfrc_constraint[:, 0], -_MOST, _MOST),
            "reward": survive + distance + velocity,
            "reward_survive": survive,
            "distance_penalty": distance,
            "velocity_penalty": velocity,
        }

    def terminated(self, xp: Namespace, worlds: Worlds) -> Array:
        """Where the tip is too low."""
        return worlds.memory["height"] <= _LOWEST
