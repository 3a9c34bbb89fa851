"""mjlab's `Simulation` on tightloop's worlds."""

from __future__ import annotations

from typing import Any

from tightloop.adapters.environment import library
from tightloop.adapters.mjlab.bridges import DataBridge, ModelBridge
from tightloop.adapters.mjlab.model_fields import ModelFields
from tightloop.adapters.mjlab.worlds import LIT, Worlds
from tightloop.errors import ArgumentError

simulations: Any = library("mjlab.sim.sim", install="mjlab")
warp_model: Any = library("mujoco_warp", install="mujoco-warp")
torch: Any = library("torch", install="torch")


class Simulation(simulations.Simulation):
    """Many worlds of a model behind the interface of ``mjlab.sim.Simulation``, simulated by tightloop on the CPU.

    MuJoCo-Warp's structures stay the memory of all fields, so that tensors that mjlab took stay valid. `step` and
    `forward` bring what was written there to the worlds, and put their results there. MuJoCo-Warp simulates nothing; it
    draws cameras.

    Attributes:
        worlds: The simulation of tightloop.
    """

    def __init__(self, num_envs: int, cfg: Any, model: Any = None, device: str = "cuda:0", **kwargs: Any) -> None:
        # before Warp looks for the device
        if torch.device(device).type != "cpu":
            raise ArgumentError(
                f"device {device}: mjlab's tensors are in the memory of the CPU with tightloop; use device='cpu', "
                "or set CUDA_VISIBLE_DEVICES='' for mjlab's scripts"
            )
        super().__init__(num_envs, cfg, model, device, **kwargs)

    def _init_with_variants(self, spec: Any, variant_info: Any) -> None:
        names = ", ".join(name.rstrip("/") for name, _ in variant_info)
        raise ArgumentError(
            f"variants of {names}: tightloop has one mesh per geom in all worlds; give the entity one variant"
        )

    def _finish_init(self) -> None:
        # contacts and rows of MuJoCo-Warp stay empty, so they get no memory
        room = self.cfg.nconmax, self.cfg.njmax
        self.cfg.nconmax, self.cfg.njmax = max(self._mj_data.ncon, 1), max(self._mj_data.nefc, 1)
        try:
            super()._finish_init()
        finally:
            self.cfg.nconmax, self.cfg.njmax = room
        self._fields = ModelFields(self._mj_model, self.num_envs)
        self.worlds = Worlds(self._mj_model, self._wp_data, self.num_envs, self._fields)
        self._data_bridge = DataBridge(self._wp_data, self.worlds)
        self._model_bridge = ModelBridge(self._wp_model, self.num_envs, self._fields)

    @property
    def wp_data(self) -> Any:
        """MuJoCo-Warp's data, with its kinematics at the present positions, until the next call also for `data`."""
        self._place()
        return self._wp_data

    def expand_model_fields(self, fields: tuple[str, ...]) -> None:
        """Give model fields a value per world; see ``mjlab.sim.Simulation``.

        Raises:
            ValueError: The model has no such field.
            ArgumentError: The field is of assets, which all worlds share.
        """
        acting = tuple(name for name in fields if self._fields.acts(name))
        for name in acting:
            self._fields.expand(name)
        self._expanded_fields.update(acting)
        super().expand_model_fields(tuple(name for name in fields if name not in acting))

    def recompute_constants(self, level: Any) -> None:
        """Compute constants again that derive from expanded fields; see ``mjlab.sim.Simulation``."""
        self._fields.recompute()

    def forward(self) -> None:
        """Evaluate all fields at the present state, commands and parameters. Raises as `step` does."""
        self._model_bridge.check()
        self.worlds.forward()
        if self.worlds.touched.intersection(LIT):
            self._place()
            self.worlds.bring()

    def step(self) -> None:
        """Advance all worlds by a time step. As with MuJoCo, derived fields then lag by that step.

        Raises:
            ArgumentError: A field of the model was written that has one value for all worlds, or that cannot differ.
        """
        self._model_bridge.check()
        with self.nan_guard.watch(self.data):
            self.worlds.step()

    def reset(self, env_ids: Any = None) -> None:
        """Put worlds into the state of the model; see ``mjlab.sim.Simulation``."""
        self.worlds.reset(slice(None) if env_ids is None else env_ids)

    def close(self) -> None:
        """End the simulation. It also ends with the process."""
        self.worlds.close()

    def _place(self) -> None:
        warp_model.kinematics(self._wp_model, self._wp_data)
        warp_model.com_pos(self._wp_model, self._wp_data)
        warp_model.camlight(self._wp_model, self._wp_data)

    def _sense_kernel(self) -> None:
        context = self._sensor_context
        assert context is not None
        if context.has_cameras:
            self._place()
            warp_model.refit_bvh(self._wp_model, self._wp_data, context.render_context)
            warp_model.render(self._wp_model, self._wp_data, context.render_context)
            context.unpack_rgb()
            self.worlds.bring()
        for sensor in context.raycast_sensors:
            self.worlds.cast(sensor)
