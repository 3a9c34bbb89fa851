"""The worlds of a simulation in mjlab: from MuJoCo-Warp's memory to a daemon, and back."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop._core import Frame
from tightloop.adapters.mjlab.model_fields import ModelFields
from tightloop.arrays.frames import FAULTED
from tightloop.mujoco.batch.hidden_state import refuse_hidden_state
from tightloop.mujoco.batch.joints import JointMap
from tightloop.scene.scene import Scene
from tightloop.sim.command_arrays import called
from tightloop.sim.launching import launch
from tightloop.sim.sim import Sim

Array = NDArray[Any]
Mask = NDArray[np.bool_]

#: Name of the model in the scene.
MODEL = "model"
#: Fields that mjlab writes: the state, what acts on it, and what is only kept.
_STATE = ("qpos", "qvel", "act")
_COMMANDS = ("ctrl", "mocap_pos", "mocap_quat", "eq_active")
_FORCES = ("qfrc_applied", "xfrc_applied")
_KEPT = ("time", "qacc_warmstart")
#: Fields that steps and evaluations fill.
FILLED = (
    "xpos xquat xmat xipos ximat cvel subtree_com site_xpos site_xmat geom_xpos geom_xmat sensordata qacc "
    "ten_length ten_velocity actuator_force actuator_length actuator_velocity "
    "qfrc_actuator qfrc_constraint qfrc_bias qfrc_passive"
).split()
#: Fields that MuJoCo-Warp's kinematics fill in `Simulation.forward`.
LIT = ("cam_xpos", "cam_xmat", "light_xpos", "light_xdir")
#: Of these, what every frame has, so that a first read in a reward sees the same step as a later one.
_AT_ONCE = (
    "xpos xquat xipos cvel subtree_com site_xpos site_xmat geom_xpos geom_xmat sensordata qacc actuator_force"
).split()
#: More geoms than this are in the frames only once their poses were asked for.
_GEOMS_MAX = 128


class Worlds:
    """A simulation that starts with its first use, and starts again when fields or parameters are added.

    Args:
        model: The model.
        data: MuJoCo-Warp's data in the memory of the CPU.
        count: Number of worlds.
        fields: Fields of the model that differ between worlds.

    Attributes:
        touched: Names of the fields that mjlab has read.
    """

    def __init__(self, model: Any, data: Any, count: int, fields: ModelFields) -> None:
        refuse_hidden_state(model, "mjlab on tightloop")
        self._model, self._data, self._count, self._fields = model, data, count, fields
        self._scene = Scene.from_mujoco(model, name=MODEL)
        self._joints = JointMap(model)
        self._sim: Sim | None = None
        self._launched_with: tuple[frozenset[str], frozenset[str]] = (frozenset(), frozenset())
        self._frame: Frame | None = None
        names = (*_STATE, *_COMMANDS, *_FORCES, *_KEPT, *FILLED)
        self._arrays: dict[str, Array] = {name: getattr(data, name).numpy() for name in names if hasattr(data, name)}
        # MuJoCo-Warp lets worlds share what does not differ at the start
        shared = [name for name, array in self._arrays.items() if len(array) != count]
        assert not shared, f"fields without a row per world: {shared}"
        self._start = {name: np.array(self._arrays[name][0]) for name in (*_STATE, *_COMMANDS)}
        self._start["qpos"] = np.asarray(model.qpos0, np.float32)
        self._start["qvel"][:], self._start["ctrl"][:], self._start["act"][:] = 0.0, 0.0, 0.0
        self._wanted = {name for name in _AT_ONCE if self._arrays[name].size}
        if model.ngeom > _GEOMS_MAX:
            self._wanted -= {"geom_xpos", "geom_xmat"}
        self._params: set[str] = set()
        self._held: dict[str, Array] = {}
        # worlds that are faulted, and those whose start is to be written even if they hold it already
        self._faulted, self._reset = np.zeros(count, bool), np.zeros(count, bool)
        # worlds with a state of mjlab's that is not finite
        self._lost = np.zeros(count, bool)
        self._sent: dict[str, Array] = {}
        self._varied: dict[str, Array] | None = None
        self.touched: set[str] = set()

    def touch(self, name: str) -> None:
        """Note that mjlab reads a field, which steps bring from now on.

        Raises:
            AttributeError: tightloop does not fill it.
        """
        if name in self.touched:
            return
        value = getattr(self._data, name)
        is_field = hasattr(value, "__dict__") and not isinstance(value, int | float | bool)
        known = name in self._arrays or name in LIT
        if is_field and not known and getattr(value, "size", 1) != 0:
            offered = ", ".join(sorted({*_STATE, *_COMMANDS, *_FORCES, *_KEPT, *FILLED, *LIT}))
            raise AttributeError(f"sim.data.{name}: tightloop does not fill this field in mjlab; there are {offered}")
        self.touched.add(name)
        if name in FILLED and self._arrays[name].size and name not in self._wanted:
            self._wanted.add(name)
            if self._sim is not None:
                self._launched()
                if self._frame is None:  # parameters were added, too, so that states are written again
                    self.forward()
                else:  # the others keep the values of the last call
                    self._copy(self._frame, name)
        elif name in FILLED and self._frame is not None:
            self._copy(self._frame, name)

    def step(self) -> None:
        """Advance all worlds by a time step with what mjlab wrote."""
        sim, changed = self._prepared()
        if changed.any():
            self._write(sim, changed, {})
        commands = {name: self._hold(name) for name in self._new_commands()} | self._new_forces()
        self._frame = None
        self._frame = sim.step(**commands)
        self._arrays["time"] += np.float32(self._model.opt.timestep)
        self._fill()

    def forward(self) -> None:
        """Evaluate the touched fields at the state and commands that mjlab wrote; ``qfrc_applied`` waits for a step."""
        sim, changed = self._prepared()
        commands = self._new_commands()
        if changed.any():
            # a write has one mask: what else changed is written apart, and evaluates once more
            own = [name for name, rows in commands.items() if not (rows & ~changed).any()]
            self._write(sim, changed, {name: self._hold(name) for name in own})
            commands = {name: rows for name, rows in commands.items() if name not in own}
        held = {name: self._hold(name) for name in commands}
        if held or self._frame is None or not changed.any():
            self._frame = None
            self._frame = sim.write(**held) if held else sim.forward()
        self._fill()

    def reset(self, ids: Any) -> None:
        """Put the state, commands and forces of worlds to those of the model; the next call brings them over."""
        rows = np.asarray(ids) if not isinstance(ids, slice) else ids
        for name, start in self._start.items():
            self._arrays[name][rows] = start
        if (references := self._fields.references()) is not None:
            self._arrays["qpos"][rows] = references[rows]
        for name in (*_FORCES, *_KEPT, "qacc", "sensordata"):
            self._arrays[name][rows] = 0.0
        self._reset[rows] = True

    def cast(self, sensor: Any) -> None:
        """Let the rays of a sensor of mjlab meet the geoms at the state of the newest frame."""
        self._wanted.add("body_q")
        sim = self._launched()
        if self._frame is None or not hasattr(self._frame, "body_q"):
            self.forward()
        groups = sensor.cfg.include_geom_groups
        chosen = None if groups is None else np.isin(np.arange(6), groups).astype(np.uint8)
        hits = sim.rays(
            sensor._ray_pnt.numpy(),
            sensor._ray_vec.numpy(),
            geomgroup=chosen,
            bodyexclude=np.broadcast_to(sensor._ray_bodyexclude.numpy(), sensor._ray_dist.shape),
            frame=self._frame,
        )
        sensor._ray_dist.numpy()[:] = hits.dist
        sensor._ray_geomid.numpy()[:] = hits.geomid
        sensor._ray_normal.numpy()[:] = hits.normal

    def bring(self) -> None:
        """Put the fields of the newest frame to mjlab's memory again, which MuJoCo-Warp's kinematics wrote over."""
        if self._frame is not None:
            for name in self.touched.intersection(FILLED):
                self._copy(self._frame, name)

    def close(self) -> None:
        """End the simulation. Another call starts it again, from what mjlab's memory holds."""
        self._frame = None
        if self._sim is not None:
            self._sim.close()
            self._sim, self._launched_with = None, (frozenset(), frozenset())

    def _launched(self) -> Sim:
        """The simulation with all fields and parameters that are wanted."""
        fields = frozenset(self._wanted | {"qpos", "qvel"} | ({"act"} if self._model.na else set()))
        params = frozenset(self._params | set(self._fields.params()))
        if self._sim is not None and (fields, params) == self._launched_with:
            return self._sim
        old, kept = self._sim, None
        if old is not None:
            kept = old.snapshot() if params == self._launched_with[1] else None
            self.close()
            self._sim = None
        self._sim = sim = launch(
            self._scene,
            worlds=self._count,
            fields=sorted(fields),
            params=sorted(params),
            device="cpu",
            outputs_at="last_substep",
            # as MuJoCo-Warp, which bounds nothing
            bounds={"joint_q": math.inf, "joint_qd": math.inf},
            on_nan="freeze",
            watch_worlds=1,
        )
        self._launched_with = (fields, params)
        if kept is not None:
            self._frame = sim.restore(kept.with_model(sim.info["model_hash"]))
        else:
            self._frame, self._held, self._sent, self._varied = None, {}, {}, None
            self._faulted[:] = False
        return sim

    def _prepared(self) -> tuple[Sim, Mask]:
        """The simulation with the parameters that mjlab wrote, and the worlds whose states it wrote.

        Of these, worlds that are faulted take writes again.
        """
        if self._arrays["xfrc_applied"].any():
            self._params.add("body_f")
        sim = self._launched()
        changed = self._reset.copy()
        for name in _STATE:
            changed |= self._differs(name)
        self._lost[:] = False
        if changed.any():
            # a write refuses such a state, which stays in mjlab's memory alone; NaN always differs
            finite = [np.isfinite(self._arrays[name][changed]).all(axis=1) for name in _STATE]
            self._lost[changed] = ~np.logical_and.reduce(finite)
            changed &= ~self._lost
        forces = self._arrays["xfrc_applied"]
        if "body_f" in self._params and not np.isfinite(forces).all():
            # a parameter refuses what is not finite, which makes the state so in mjlab's memory
            self._lost |= ~np.isfinite(forces).reshape(self._count, -1).all(axis=1)
            forces = np.where(np.isfinite(forces), forces, 0.0)
        frozen = changed & self._faulted
        if frozen.any():
            self._frame = None
            sim.reset(mask=frozen)
            self._faulted &= ~frozen
            # a reset also sets what worlds hold, so all of it is sent again
            self._sent.pop("body_f", None)
            for name in (*_COMMANDS, "qfrc_applied"):
                self._held.pop(name, None)
        varied = self._fields.values(sim.shape_names)
        if varied is not self._varied:
            for name, values in varied.items():
                self._send(sim, name, values)
            self._varied = varied
        if "body_f" in self._params:
            self._send(sim, "body_f", forces)
        return sim, changed

    def _differs(self, name: str) -> Mask:
        """Worlds in which a field is not what they hold. NaN is no value that a world holds."""
        array, held = self._arrays[name].reshape(self._count, -1), self._held.get(name)
        if held is None:
            return np.ones(self._count, bool)
        return (array != held.reshape(array.shape)).any(axis=1)

    def _hold(self, name: str) -> Array:
        """Return a copy of a field, which the worlds hold from the next call on."""
        self._held[name] = self._arrays[name].copy()
        return self._held[name]

    def _send(self, sim: Sim, name: str, values: Array) -> None:
        flat, sent = values.reshape(self._count, -1), self._sent.get(name)
        changed = np.ones(self._count, bool) if sent is None else (flat != sent).any(axis=1)
        if changed.any():
            self._frame = None
            sim.params.write(mask=changed, **{name: values})
            self._sent[name] = flat.copy()

    def _write(self, sim: Sim, changed: Mask, commands: dict[str, Array]) -> None:
        """Write states of a mask of worlds, and commands that changed in no others."""
        qpos, qvel = (self._arrays[name][changed].astype(np.float64) for name in ("qpos", "qvel"))
        parts = {"joint_q": self._joints.positions(qpos), "joint_qd": self._joints.velocities(qpos, qvel)}
        if self._model.na:
            parts["act"] = self._arrays["act"][changed].astype(np.float64)
        whole = {}
        for name, values in parts.items():
            whole[name] = np.zeros((self._count, values.shape[1]))
            whole[name][changed] = values
        self._frame = None
        # states are of MuJoCo's order, which warnings of quaternions in another order would not fit
        self._frame = called(sim, sim._client.write, whole | commands, changed, True)
        for name in _STATE:
            self._hold(name)
        self._reset &= ~changed

    def _new_commands(self) -> dict[str, Mask]:
        """Commands that differ from what the worlds hold, with the worlds in which they do."""
        differs = {name: self._differs(name) for name in _COMMANDS if self._arrays[name].size}
        return {name: rows for name, rows in differs.items() if rows.any()}

    def _new_forces(self) -> dict[str, Array]:
        """``joint_f``, if ``qfrc_applied`` changed or turns: that of a free joint does with its body."""
        force, held = self._arrays["qfrc_applied"], self._held.get("qfrc_applied")
        acts = force.any()
        if held is None and not acts:
            return {}
        if held is not None and np.array_equal(force, held) and not (acts and self._joints.has_free):
            return {}
        held = self._hold("qfrc_applied").astype(np.float64)
        qpos = self._arrays["qpos"].astype(np.float64)
        qpos[self._lost] = self._start["qpos"]
        return {"joint_f": self._joints.forces(qpos, held)}

    def _fill(self) -> None:
        """Bring a frame to mjlab's memory."""
        frame = self._frame
        assert frame is not None
        self._faulted = (frame.status & FAULTED) != 0
        for name in (*_STATE, *self.touched.intersection(FILLED)):
            self._copy(frame, name)
        self._arrays["qpos"][self._lost] = self._arrays["qvel"][self._lost] = np.nan
        for name in _STATE:
            np.copyto(self._held[name], self._arrays[name])

    def _copy(self, frame: Frame, name: str) -> None:
        to = self._arrays[name]
        if to.size:
            np.copyto(to, getattr(frame, name).reshape(to.shape))
        if name == "qacc":
            # mjlab's NaN guard and its terminations look there; the state stays the last good one
            to[self._faulted | self._lost] = np.nan
