"""The simulation under a batch: its launch, and the way of states, controls and parameters into it.

The rows of a batch are the truth. A world of the simulation is in one of three conditions:

- current: it holds its row as the last call left it, and goes on with the solver's last accelerations;
- stale: it holds something else, and its row is written before it runs;
- parked: a step of other worlds has moved it, and a snapshot has its record, which comes back before it runs.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop._core import Frame
from tightloop.arrays.frames import FAULTED
from tightloop.errors import CommandRefused
from tightloop.mujoco.batch.bindings import Bindings
from tightloop.mujoco.batch.joints import JointMap
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.scene.scene import Scene
from tightloop.sim.command_arrays import called
from tightloop.sim.launching import launch
from tightloop.sim.sim import Sim
from tightloop.sim.snapshot import Snapshot

Array = NDArray[Any]
Mask = NDArray[np.bool_]

#: Parts of a row that a world holds until they are set again.
_HELD = ("ctrl", "eq_active", "mocap_pos", "mocap_quat")
#: Name of the model in the scene.
MODEL = "model"
#: A world in a message of a simulation.
_WORLD = re.compile(r"\b(worlds? )(\d+)")
#: Most substeps of a frame.
_SUBSTEPS_MAX = 100
#: Fields that simulations of this release have; filled by the first launch.
_known_fields: set[str] = set()


class Engine:
    """Launches the simulation when it is needed, and again when fields or parameters are added.

    Args:
        model: The model.
        layout: Its state.
        bindings: The rows.
        options: ``threads``, ``precision`` and ``device`` of the launch.
        sims: Simulations that have a world here, ascending; all if left out.

    Attributes:
        scene: The scene with the model alone.
        frame: The newest frame, or None before the first one of a launch.
        params: Names of the parameters that vary.
        substeps: Steps of a frame of the simulation.
        dtype: Of its precision.
        members: The simulations that have a world here, ascending; None for all.
        silenced: Worlds whose controls count as 0, ``(worlds,)``.
    """

    def __init__(
        self, model: Any, layout: StateLayout, bindings: Bindings, options: dict[str, Any], sims: Array | None = None
    ) -> None:
        self.scene = Scene.from_mujoco(model, name=MODEL)
        self._layout, self._bindings, self._options = layout, bindings, options
        self._joints = JointMap(model)
        self.members = sims
        self._worlds, self._nv = len(bindings.rows if sims is None else sims), model.nv
        self._fields = {"qpos", "qvel"} | ({"act"} if model.na else set())
        self.params: set[str] = set()
        self._sim: Sim | None = None
        self._launched_with = (0, 0, 0)
        self._snapshot: Snapshot | None = None
        self._stale, self._parked = np.ones(self._worlds, bool), np.zeros(self._worlds, bool)
        # what the worlds hold: controls, equalities and mocap bodies as in a row, and joint forces
        self._held_at = {name: layout.at(name) for name in _HELD if layout.at(name).start < layout.at(name).stop}
        self._held: dict[str, Array] = {}
        self._force = np.zeros((self._worlds, self._nv))
        self._sent: dict[str, Array] = {}
        # columns of a row that a write of the state sets: positions to warm start
        self._motion = slice(layout.at("qpos").start, layout.at("qacc_warmstart").stop)
        self.frame: Frame | None = None
        self.substeps = 1
        self.dtype = np.dtype(np.float64 if options["precision"] == "f64" else np.float32)
        self._common = 0
        self.silenced = np.zeros(self._worlds, bool)

    @property
    def sim(self) -> Sim:
        """The simulation, launched with all that is required."""
        sim = self._sim
        # a launch changes none of these, so this is cheap
        if sim is None or (len(self._fields), len(self.params), self.substeps) != self._launched_with:
            sim = self._launched()
        return sim

    @property
    def known_fields(self) -> set[str]:
        """Names of the fields that simulations of this release have."""
        if not _known_fields:
            _known_fields.update(field["name"] for field in self.sim.info["known_fields"])
        return _known_fields

    @property
    def _rows(self) -> Array:
        """The rows of the worlds."""
        return self.per_world(self._bindings.rows)

    def require(self, *, fields: Iterable[str] = (), params: Iterable[str] = ()) -> None:
        """Let the next access of `sim` have fields and varying parameters."""
        self._fields.update(fields)
        self.params.update(params)

    def plan(self, steps: int) -> int:
        """Choose the steps of a frame for calls that need frames after this many steps; return the frames of a call.

        It is the greatest common divisor of all calls, so that a simulation is launched again a few times at most.
        """
        self._common = math.gcd(self._common, steps)
        most = min(self._common, _SUBSTEPS_MAX)
        self.substeps = next(count for count in range(most, 0, -1) if self._common % count == 0)
        return steps // self.substeps

    def close(self) -> None:
        """End the simulation."""
        self.frame = None
        if self._sim is not None:
            self._sim.close()

    def _launched(self) -> Sim:
        old, kept = self._sim, None
        if old is not None:
            kept = old.snapshot()
            self.close()
            # if the launch fails, the next call tries again, from the rows
            self._sim = None
        varied = self._launched_with[1]
        self.scene.substeps = self.substeps
        self._sim = sim = launch(
            self.scene,
            worlds=self._worlds,
            fields=sorted(self._fields),
            params=sorted(self.params),
            watch_worlds=1,
            # MuJoCo's own check of a state follows each step
            bounds={"joint_q": math.inf, "joint_qd": math.inf},
            **self._options,
        )
        self._launched_with = (len(self._fields), len(self.params), self.substeps)
        # a snapshot fits where the same parameters vary
        if kept is not None and varied == len(self.params):
            self.frame = sim.restore(kept.with_model(sim.info["model_hash"]))
            self._snapshot = self._snapshot and self._snapshot.with_model(sim.info["model_hash"])
        else:
            self._stale[:], self._parked[:], self._sent = True, False, {}
            self._let_go(np.ones(self._worlds, bool))
        return sim

    def _let_go(self, mask: Mask) -> None:
        """Note that worlds hold what they start with."""
        start = self._layout.start(-1)
        for name, at in self._held_at.items():
            self._held.setdefault(name, np.zeros((self._worlds, at.stop - at.start)))[mask] = start[at]
        self._force[mask] = 0.0

    def per_world(self, values: Array) -> Array:
        """Return the values of the worlds, of those of all simulations, ``(num_sims, ...)``."""
        return values if self.members is None else values[self.members]

    def worlds(self, ids: Any) -> Any:
        """Return the worlds of simulations, which are indices, or a slice of all."""
        return ids if self.members is None or isinstance(ids, slice) else np.searchsorted(self.members, ids)

    def sims(self, worlds: Array) -> Array:
        """Return the simulations of worlds."""
        return worlds if self.members is None else self.members[worlds]

    def has(self, ids: Array) -> Mask:
        """Return which simulations have a world here."""
        return np.ones(len(ids), bool) if self.members is None else np.isin(ids, self.members)

    def mark_stale(self, ids: Any) -> None:
        """Let the rows of simulations be written before they run."""
        worlds = self.worlds(ids)
        self._stale[worlds] = True
        self._parked[worlds] = False

    def dismiss(self, ids: Array) -> None:
        """Put the worlds of simulations back to their start, without forces: they run elsewhere now."""
        self.mark_stale(ids)
        if self._sim is None:
            return
        gone = np.zeros(self._worlds, bool)
        gone[self.worlds(ids)] = True
        self._rest(gone)

    def _rest(self, mask: Mask) -> None:
        """Reset worlds, which then hold what they start with, and have no forces."""
        self.frame = self.sim.reset(mask=mask)
        self._let_go(mask)
        if "body_f" in self._sent:
            self._sent["body_f"][mask] = 0.0

    def sync(self, mask: Mask, params: dict[str, Array]) -> Frame:
        """Bring rows and parameters of the simulations of a mask into their worlds; return a frame of it.

        Args:
            mask: The simulations, ``(num_sims,)``.
            params: Parameters by name, ``(num_sims, ...)``; other rows than those of the mask do not matter.
        """
        sim, mask = self.sim, self.per_world(mask)
        back = self._parked & mask
        if back.any() and self._snapshot is not None:
            self.frame = sim.restore(self._snapshot, worlds=back)
            self._parked &= ~mask
        for name, values in params.items():
            self._send(name, self.per_world(values), mask)
        rows, last = (self.per_world(array[:, self._motion]) for array in (self._bindings.rows, self._bindings.last))
        changed = mask if self._bindings.is_bound("state") else mask & (self._stale | (rows != last).any(axis=1))
        if changed.any():
            self._revive(changed)
            self.frame = self._write(changed)
        self._stale &= ~mask
        if self.frame is None:
            self.frame = sim.forward()
        return self.frame

    def _send(self, name: str, values: Array, mask: Mask) -> None:
        flat = values.reshape(self._worlds, -1)
        sent = self._sent.get(name)
        if sent is None:
            sent = self._sent[name] = np.full(flat.shape, np.nan)
        changed = mask & (flat != sent).any(axis=1)
        if changed.any():
            safe = np.where(changed[:, None], flat, flat[changed][:1])
            try:
                self.frame = self.sim.params.write(mask=changed, **{name: safe.reshape(values.shape)})
            except CommandRefused as error:
                raise CommandRefused(self._by_simulation(str(error))) from error
            sent[changed] = flat[changed]

    def _by_simulation(self, message: str) -> str:
        """A message that counts worlds, with simulations in their place."""
        return _WORLD.sub(lambda world: f"{world[1]}{self.sims(np.array([int(world[2])]))[0]}", message)

    def _revive(self, changed: Mask) -> None:
        """A faulted world takes no writes."""
        if self.frame is None:
            return
        frozen = changed & ((self.frame.status & FAULTED) != 0)
        if frozen.any():
            self._rest(frozen)

    def _write(self, changed: Mask) -> Frame:
        rows = self._rows[changed]
        qpos, qvel = rows[:, self._layout.at("qpos")], rows[:, self._layout.at("qvel")]
        parts = {"joint_q": self._joints.positions(qpos), "joint_qd": self._joints.velocities(qpos, qvel)}
        act = rows[:, self._layout.at("act")]
        if act.size:
            parts["act"] = act
        if changed.all():
            return self._write_states(parts)
        whole = {}
        for name, values in parts.items():
            whole[name] = np.zeros((self._worlds, values.shape[1]))
            whole[name][changed] = values
        return self._write_states(whole, changed)

    def _write_states(self, parts: dict[str, Array], mask: Mask | None = None) -> Frame:
        """Write states of MuJoCo's order, which the warnings of quaternions in another order would not fit."""
        return called(self.sim, self.sim._client.write, parts, mask, True)

    def _commands(self, mask: Mask) -> tuple[dict[str, Array], Array]:
        """What worlds shall hold, by name, and joint forces: of the rows in the mask, elsewhere what they hold."""
        rows = self._rows
        held = {name: np.where(mask[:, None], rows[:, at], self._held[name]) for name, at in self._held_at.items()}
        if self.silenced.any() and "ctrl" in held:
            held["ctrl"][mask & self.silenced] = 0.0
        if "eq_active" in held:  # as MuJoCo, which keeps a bool of each
            held["eq_active"] = held["eq_active"] != 0.0
        force = self._force
        # other rows may hold anything until their next call
        applied = np.where(mask[:, None], rows[:, self._layout.at("qfrc_applied")], 0.0)
        if applied.any() or force.any():
            turned = self._joints.forces(rows[:, self._layout.at("qpos")], applied)
            force = np.where(mask[:, None], turned, force)
        return held, force

    def park(self, mask: Mask) -> None:
        """Keep the worlds outside a mask of simulations, which the steps of the others are going to move."""
        mask = self.per_world(mask)
        others = ~mask & ~self._parked & ~self._stale
        if not others.any():
            return
        if self._bindings.is_bound("state"):
            self._stale |= others
            return
        taken = self.sim.snapshot()
        if self._snapshot is not None and self._parked.any():
            taken = taken.with_worlds(self._snapshot, self._parked)
        self._snapshot = taken
        self._parked |= others

    def hold(self, mask: Mask) -> Frame:
        """Let the worlds of a mask of simulations hold what their rows have besides the state, without a step."""
        mask = self.per_world(mask)
        held, force = self._commands(mask)
        pushed = (force != self._force).any(axis=1)
        if pushed.any():
            taken = self.sim.snapshot()
            numbers = taken.numbers.copy()
            # a record begins with three arrays of dofs, the third is joint_f
            numbers[pushed, 2 * self._nv : 3 * self._nv] = force[pushed]
            self.frame = self.sim.restore(taken.with_numbers(numbers), worlds=pushed)
            self._force = force
        changed = self._changed(held)
        if changed:
            self.frame = self.sim.write(**changed)
            self._held = held
        assert self.frame is not None
        return self.frame

    def _changed(self, held: dict[str, Array]) -> dict[str, Array]:
        """What differs from what the worlds hold."""
        return {name: values for name, values in held.items() if not np.array_equal(values, self._held[name])}

    def step(self, mask: Mask) -> Frame:
        """Step all worlds, those of a mask of simulations with what their rows have besides the state."""
        mask = self.per_world(mask)
        held, force = self._commands(mask)
        commands = self._changed(held)
        if not np.array_equal(force, self._force):
            commands["joint_f"] = force
        self.frame = None
        self.frame = self.sim.step(**commands)
        self._held, self._force = held, force
        return self.frame

    @property
    def forces_turn(self) -> bool:
        """Whether joint forces must be sent before each step: those of free joints depend on the positions."""
        return self._joints.has_free and bool(self._rows[:, self._layout.at("qfrc_applied")].any())
