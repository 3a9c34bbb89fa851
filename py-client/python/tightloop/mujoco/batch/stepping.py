"""Steps, resets and evaluations of a batch: what MuJoCo does around the physics, and the fields it leaves behind.

After ``mj_step``, the fields that a step computes belong to the state before its last substep, with the controls of
the step. A frame of tightloop belongs to one state. So a batch takes these fields from the frame before the last
substep. If the call has one substep, that is the frame at its start, whose worlds must hold the new controls first.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop._core import Frame
from tightloop.arrays.frames import FAULTED
from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.bindings import Bindings
from tightloop.mujoco.batch.engine import Engine
from tightloop.mujoco.batch.expansions import Expansions
from tightloop.mujoco.batch.fields import Fields
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco
from tightloop.mujoco.batch.selection import Selection

Array = NDArray[Any]

#: Largest value of a state before MuJoCo calls it unstable: mjMAXVAL.
_VALUE_MAX = 1e10
#: Parts of the state that must be finite, beside positions, velocities and controls.
_FINITE = ("act", "qfrc_applied", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat")
#: Bit of ``status``: contacts did not fit.
_LEFT_OUT = 4
_WARN = mujoco.mjtWarning


class Stepping:
    """Runs the calls of a batch.

    Args:
        model: The model.
        fields: Its fields.
        layout: Its state.
        bindings: Rows and live arrays.
        engine: The simulation underneath.
        forward: Whether fields are current after a step.
    """

    def __init__(
        self,
        model: Any,
        fields: Fields,
        layout: StateLayout,
        bindings: Bindings,
        engine: Engine,
        *,
        expansions: Expansions,
        forward: bool,
    ) -> None:
        self._expansions = expansions
        self._model, self._fields, self._layout = model, fields, layout
        self._bindings, self._engine, self._forward = bindings, engine, forward
        self._names: list[str] = []
        # whether fields follow what worlds hold beside positions and velocities: controls and forces, or mocap bodies
        self._depends = bool(model.nmocap)
        reset = int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        self._resets = not model.opt.disableflags & reset
        self._clocks = _clocks(model)
        # how often a step reads the controls
        self._evaluations = 4 if model.opt.integrator == int(mujoco.mjtIntegrator.mjINT_RK4) else 1

    @property
    def _lags(self) -> bool:
        """Whether fields are of the state before the last substep."""
        return bool(self._names) and not self._forward

    def add(self, name: str) -> None:
        """Fill a bound field from now on, from the simulation's field of that name."""
        self._names.append(name)
        accelerates = self._fields.accelerates(name)
        self._depends |= accelerates
        # `hold` checks the controls that it sets
        self._engine.require(fields=(name, "ctrl") if accelerates else (name,))

    def plan(self, nstep: int, *, has_history: bool) -> int:
        """Return the frames of a call that steps."""
        in_between = has_history or self._lags or self._engine.forces_turn
        return nstep * self._engine.plan(1) if in_between else self._engine.plan(nstep)

    def prepare_step(self, chosen: Selection, params: dict[str, Array]) -> None:
        """Bring everything that was written, but controls and forces, to the simulation, for `step`."""
        self._begin(chosen, params, resets=self._resets)

    def step(self, chosen: Selection, frames: int, nstep: int, history: Array | None) -> None:
        """Advance simulations that `prepare_step` has prepared; see `Batch.step`."""
        rows, ids, mask = self._bindings.rows, chosen.ids, chosen.mask
        self._check_controls(chosen, times=nstep * self._evaluations)
        if self._lags and nstep == 1:
            self._evaluate(chosen)
        if len(chosen) < len(rows):
            self._engine.park(mask)
        frame: Frame | None = None
        for substep in range(frames):
            frame = None  # a client holds few frames
            frame = self._engine.step(mask)
            for _ in range(nstep // frames):
                # a sum, as MuJoCo's
                rows[ids, 0] += self._model.opt.timestep
            if history is not None or self._engine.forces_turn:
                self._take(frame, ids)
            if history is not None:
                history[:, substep] = rows[ids]
            if self._lags and substep == nstep - 2:
                frame = None
                self._evaluate(chosen)
        assert frame is not None
        self._take(frame, ids)
        self._count(frame, chosen)
        frame = None
        if self._forward:
            self._evaluate(chosen)
        self._bindings.settle(ids)

    def prepare(self, chosen: Selection, params: dict[str, Array]) -> None:
        """Bring everything that was written, but controls and forces, to the simulation, for `finish`."""
        self._begin(chosen, params, resets=False)

    def prepare_reset(self, chosen: Selection, params: dict[str, Array], keyframe: int) -> None:
        """Reset the rows of simulations, and bring them to the simulation, for `finish`; see `Batch.reset`."""
        start = self._starts(chosen.indices, keyframe)
        bindings, ids = self._bindings, chosen.ids
        bindings.collect_fields(ids)
        rows, last = bindings.rows[ids], bindings.last[ids]
        # NaN is no other value than NaN
        written = (rows != last) & ~(np.isnan(rows) & np.isnan(last))
        bindings.rows[ids] = np.where(written, rows, start)
        bindings.warnings[ids] = 0
        # a reset clears the warm start, too
        self._engine.mark_stale(ids)
        self.prepare(chosen, params)

    def finish(self, chosen: Selection) -> None:
        """Fill bound fields at the state that was prepared."""
        self._check_controls(chosen)
        self._evaluate(chosen)
        self._bindings.settle(chosen.ids)

    def _begin(self, chosen: Selection, params: dict[str, Array], *, resets: bool) -> None:
        """Bring everything that was written to the simulation, except controls and forces."""
        bindings, layout = self._bindings, self._layout
        bindings.collect(chosen.ids)
        rows = bindings.rows[chosen.ids]
        for name, warning in (("qpos", _WARN.mjWARN_BADQPOS), ("qvel", _WARN.mjWARN_BADQVEL)):
            values = np.abs(rows[:, layout.at(name)])
            # `not <=` is true for NaN
            if values.size and not values.max() <= _VALUE_MAX:
                sims = chosen.indices[~(values <= _VALUE_MAX).all(axis=1)]
                if not resets:
                    raise ArgumentError(f"sim {sims[0]}: {name} is NaN, infinite or huge; write another value")
                self._restart(sims, int(warning))
                rows = bindings.rows[chosen.ids]
        for name in _FINITE:
            with np.errstate(over="ignore"):
                finite = np.isfinite(rows[:, layout.at(name)].astype(self._engine.dtype))
            if not finite.all():
                sim = chosen.indices[int(finite.all(axis=1).argmin())]
                raise ArgumentError(f"sim {sim}: {name} is NaN or infinite; write another value")
        if rows[:, layout.at("xfrc_applied")].any():
            self._engine.require(params=("body_f",))
        if "body_f" in self._engine.params:
            params = params | {"body_f": layout.view(bindings.rows, "xfrc_applied")}
        self._engine.sync(chosen.mask, params)

    def _check_controls(self, chosen: Selection, times: int = 1) -> None:
        """MuJoCo takes all controls of a simulation for 0 if one of them is bad, and counts that at each reading.

        Their rows keep what was written.
        """
        columns = self._layout.at("ctrl")
        ctrl = self._bindings.rows[chosen.ids, columns]
        self._engine.silenced[self._engine.worlds(chosen.ids)] = False
        if ctrl.size and not np.abs(ctrl).max() <= _VALUE_MAX:
            sims = chosen.indices[~(np.abs(ctrl) <= _VALUE_MAX).all(axis=1)]
            self._engine.silenced[self._engine.worlds(sims)] = True
            self._bindings.warnings[sims, int(_WARN.mjWARN_BADCTRL), 1] += times

    def _starts(self, sims: Array, keyframe: int = -1) -> Array:
        """Return rows after a reset, ``(size,)`` or ``(n, size)``; the start has the ``qpos0`` of each."""
        row = self._layout.start(keyframe)
        if keyframe >= 0 or "qpos0" not in self._expansions.names:
            return row
        rows = np.tile(row, (len(sims), 1))
        rows[:, self._layout.at("qpos")] = self._expansions.of("qpos0")[sims]
        return rows

    def _restart(self, sims: Array, warning: int) -> None:
        """Reset simulations that are unstable, as MuJoCo does, and count the warning."""
        self._bindings.rows[sims] = self._starts(sims)
        self._bindings.warnings[sims] = 0
        self._bindings.warnings[sims, warning, 1] += 1
        self._engine.mark_stale(sims)

    def _evaluate(self, chosen: Selection) -> None:
        """Fill bound fields at the state of the newest frame, with the controls and forces of the rows."""
        if not self._names:
            return
        frame = self._engine.hold(chosen.mask) if self._depends else self._engine.frame
        assert frame is not None
        self._publish(frame, chosen.ids)

    def _publish(self, frame: Frame, ids: Any) -> None:
        derived = self._bindings.derived
        for name in self._names:
            values = _array(frame, name)[self._engine.worlds(ids)]
            derived[name][ids] = values.reshape(len(values), *derived[name].shape[1:])
            if name == "sensordata":
                # the simulation's clock counts from its own reset
                for column, cutoff in self._clocks:
                    derived[name][ids, column] = np.clip(self._bindings.rows[ids, 0], -cutoff, cutoff)

    def _take(self, frame: Frame, ids: Any) -> None:
        """Bring the state of a frame into the rows."""
        rows, layout = self._bindings.rows, self._layout
        worlds = self._engine.worlds(ids)
        rows[ids, layout.at("qpos")] = frame.qpos[worlds]
        rows[ids, layout.at("qvel")] = frame.qvel[worlds]
        if self._model.na:
            rows[ids, layout.at("act")] = _array(frame, "act")[worlds]

    def _count(self, frame: Frame, chosen: Selection) -> None:
        """Count the simulation's warnings as MuJoCo's; a faulted world starts again."""
        status = frame.status
        if not status.any():
            return
        mask = self._engine.per_world(chosen.mask)
        full = self._engine.sims(np.flatnonzero(mask & ((status & _LEFT_OUT) != 0)))
        self._bindings.warnings[full, int(_WARN.mjWARN_CONTACTFULL), 1] += 1
        faulted = self._engine.sims(np.flatnonzero(mask & ((status & FAULTED) != 0)))
        if len(faulted):
            self._restart(faulted, int(_WARN.mjWARN_BADQACC))


def _clocks(model: Any) -> list[tuple[int, float]]:
    """Column and cutoff of the clock sensors that are on."""
    if model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_SENSOR):
        return []
    clocks = np.flatnonzero(np.asarray(model.sensor_type) == int(mujoco.mjtSensor.mjSENS_CLOCK))
    # a cutoff of 0 is none
    return [(int(model.sensor_adr[clock]), float(model.sensor_cutoff[clock]) or np.inf) for clock in clocks]


def _array(frame: Frame, name: str) -> Array:
    """A field that stubs of `Frame` need not know."""
    return getattr(frame, name)
