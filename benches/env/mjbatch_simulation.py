"""mjlab's `Simulation` on PyPI's mjbatch, a side of benches/env/mjlab_tasks.py: MuJoCo C on a pool of threads.

MuJoCo-Warp's arrays are put over the arrays of mjbatch, in single precision as mjlab has them, so nothing is copied in
Python. mjbatch copies each bound field after each call, so a field is bound when mjlab first reads it.
"""

from __future__ import annotations

import os
from typing import Any

import mjlab.sim.sim  # pyright: ignore[reportMissingImports]
import numpy as np
import warp  # pyright: ignore[reportMissingImports]
from mjbatch import Batch  # pyright: ignore[reportMissingImports]
from mjlab.sim.sim_data import WarpBridge  # pyright: ignore[reportMissingImports]

#: Fields that mjlab writes, and fields that steps fill.
INPUTS = tuple("qpos qvel act ctrl xfrc_applied qfrc_applied mocap_pos mocap_quat eq_active".split())
OUTPUTS = (
    "xpos xquat xmat xipos ximat cvel subtree_com site_xpos site_xmat geom_xpos geom_xmat sensordata qacc "
    "actuator_force actuator_length actuator_velocity qfrc_actuator qfrc_constraint qfrc_bias qfrc_passive time"
).split()


def shared(array: Any, old: Any) -> Any:
    """Return an array of Warp with the type and shape of another one, in the memory of an array of mjbatch."""
    return warp.array(array.reshape(old.numpy().shape), dtype=old.dtype, device="cpu", copy=False)


class Fields(WarpBridge):
    """Fields of all worlds as tensors. The first read of a field binds it."""

    def __init__(self, data: Any, batch: Batch) -> None:
        super().__init__(data)
        object.__setattr__(self, "_batch", batch)

    def __getattr__(self, name: str) -> Any:
        if name not in self._wrapped_cache and not name.startswith("_"):
            value = getattr(self._struct, name)
            if name in (*INPUTS, *OUTPUTS) and value.size:
                dtype = np.float32 if value.dtype is not warp.bool else None
                setattr(self._struct, name, shared(self._batch.bind(name, dtype), value))
                if name in OUTPUTS:
                    # a call fills it
                    self._batch.forward()
            elif isinstance(value, warp.array) and value.size:
                raise AttributeError(f"sim.data.{name}: the side of mjbatch does not fill it")
        return super().__getattr__(name)


class Simulation(mjlab.sim.sim.Simulation):
    """Many worlds of a model behind the interface of ``mjlab.sim.Simulation``, simulated by mjbatch."""

    def _finish_init(self) -> None:
        # contacts and rows of MuJoCo-Warp stay empty
        self.cfg.nconmax, self.cfg.njmax = max(self._mj_data.ncon, 1), max(self._mj_data.nefc, 1)
        super()._finish_init()
        self.batch = Batch(self._mj_model, self.num_envs, num_threads=len(os.sched_getaffinity(0)))
        self._data_bridge = Fields(self._wp_data, self.batch)

    def expand_model_fields(self, fields: tuple[str, ...]) -> None:
        """Give model fields a value per world."""
        super().expand_model_fields(fields)
        for name in fields:
            old = getattr(self._wp_model, name)
            dtype = np.float32 if getattr(self._mj_model, name).dtype == np.float64 else None
            setattr(self._wp_model, name, shared(self.batch.expand(name, dtype), old))
        self._model_bridge.clear_cache()

    def recompute_constants(self, level: Any) -> None:
        """Compute constants again that derive from expanded fields."""
        self.batch.set_const()

    def forward(self) -> None:
        """Evaluate all bound fields at the present state and commands."""
        self.batch.forward()

    def step(self) -> None:
        """Advance all worlds by a time step."""
        self.batch.step()

    def reset(self, env_ids: Any = None) -> None:
        """Put worlds into the state of the model."""
        self.batch.reset(None if env_ids is None else np.sort(np.asarray(env_ids)))


def install() -> None:
    """Let mjlab simulate with mjbatch. Call it before other modules of mjlab are imported."""
    import mjlab.sim  # pyright: ignore[reportMissingImports]

    mjlab.sim.Simulation = mjlab.sim.sim.Simulation = Simulation
