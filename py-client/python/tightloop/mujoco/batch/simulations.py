"""Many simulations of one MuJoCo model behind the interface of PyPI's ``mjbatch.Batch``."""

from __future__ import annotations

import copy
import operator
import os
import threading
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError
from tightloop.mujoco.batch.bindings import Bindings
from tightloop.mujoco.batch.constants import set_const
from tightloop.mujoco.batch.expansions import Expansions
from tightloop.mujoco.batch.fields import Fields
from tightloop.mujoco.batch.layout import StateLayout
from tightloop.mujoco.batch.library import mujoco
from tightloop.mujoco.batch.queries import SEEN, Queries
from tightloop.mujoco.batch.selection import Selection
from tightloop.mujoco.batch.variants import Variants
from tightloop.mujoco.batch.views import NamedViews
from tightloop.sim.sim import Sim

Array = NDArray[Any]


@checked_calls
class Batch(NamedViews):
    """Many simulations of one MuJoCo model, read and written through live arrays.

    The interface is that of ``mjbatch.Batch`` 0.1.4. The page "Coming from MuJoCo" lists what differs. Calls are
    serialized. ``with Batch(...) as batch`` or `close` ends the simulation underneath.

    Args:
        model: The model, which is copied; later changes to it have no effect.
        num_sims: Number of simulations, at least 1.
        num_threads: Largest number of threads; all cores for 0.
        forward: Whether fields that a step computes belong to the new state, instead of lagging one substep behind as
            after ``mj_step``.
        precision: ``"f32"`` or ``"f64"``, the precision of the physics. Arrays are float64 with both.
        device: Device of the physics, as in `tightloop.launch`.

    Attributes:
        model: The model that was given, for names and sizes.
        num_sims: Number of simulations.
        num_threads: Largest number of threads.
        nstate: Numbers in a row of ``bind("state")``.

    Raises:
        ArgumentError: An argument is not valid, the model enables sleep, or has delays of actuators or plastic springs.
        SceneError: The model has parts that tightloop does not support; the message names them.
    """

    def __init__(
        self,
        model: Any,
        num_sims: int,
        num_threads: int = 0,
        forward: bool = False,
        *,
        precision: str = "f32",
        device: str = "cpu",
    ) -> None:
        if not isinstance(model, mujoco.MjModel):
            raise ArgumentError(f"Batch: model is {type(model).__name__}; give an mujoco.MjModel")
        num_sims, num_threads = _integer("num_sims", num_sims), _integer("num_threads", num_threads)
        if num_sims < 1:
            raise ArgumentError(f"num_sims must be >= 1; got {num_sims}")
        if num_threads < 0:
            raise ArgumentError(f"num_threads must be >= 0; got {num_threads}")
        if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_SLEEP):
            raise ArgumentError("Batch: the model enables sleep, which has no place in the state; disable it")
        self.model = model
        self.num_sims = num_sims
        self.num_threads = min(num_threads or os.cpu_count() or 1, self.num_sims)
        self._own = copy.copy(model)
        self._layout = StateLayout(self._own)
        self.nstate = self._layout.size
        self._fields = Fields(self._own, self._layout)
        self._bindings = Bindings(self._fields, self._layout, self._layout.start(-1), self.num_sims)
        self._expansions = Expansions(self._own, self.num_sims)
        options = {"threads": self.num_threads, "precision": precision, "device": device}
        self._variants = Variants(
            self._own, self._bindings, self._fields, self._expansions, options, forward=bool(forward)
        )
        self._engine = self._variants.base.engine
        self._queries = Queries(
            self._own, self._layout, self._engine.scene, self.num_threads, expansions=self._expansions
        )
        self._lock = threading.RLock()

    @property
    def sim(self) -> Sim:
        """The simulation underneath, of the given model.

        It is launched at its first use, and again after new `bind` and `expand` calls. A call of the batch writes only
        what changed in the batch's arrays, so do not step or write it yourself.
        """
        with self._lock:
            return self._engine.sim

    def close(self) -> None:
        """End the simulations underneath. Arrays stay valid."""
        self._variants.close()

    def __enter__(self) -> Batch:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def bind(self, name: str, dtype: DTypeLike | None = None) -> Array:
        """Return the live array of a field of ``MjData``, ``(num_sims, ...)``; each call returns the same array.

        Parts of the state may be written, or all of it as ``"state"``. A write takes effect at the simulation's next
        call, also in the other arrays. Of an element that was written in both, that of the part counts. In float32 only
        changed elements count. Every other field is filled by each call, for the simulations of that call.

        ``"state"`` has rows ``(num_sims, nstate)`` in the order of ``mjSTATE_INTEGRATION``. Once it is bound, every
        call starts from the rows alone, so that equal rows have equal futures bit for bit. The solver then starts cold
        in each call.

        Args:
            name: The field, ``"state"`` or ``"warning"``.
            dtype: The field's own dtype, or float32 for real fields.

        Raises:
            ArgumentError: There is no such field, tightloop does not compute it, or it has another dtype.
        """
        with self._lock:
            if name == "state":
                return self._bindings.get(name, dtype)
            if name not in self._fields:
                if name in self._expansions:
                    raise ArgumentError(f'{name} is a field of the model; use expand("{name}")')
                raise ArgumentError(f"{name} is not a field of MjData")
            if not self._fields.is_state(name) and not self._bindings.is_bound(name):
                # a model without such elements has an empty field
                empty = self._fields.is_empty(name)
                if not empty:
                    self._fields.check(name, self._engine.known_fields)
                array = self._bindings.get(name, dtype)
                if not empty:
                    self._variants.add(name)
                return array
            return self._bindings.get(name, dtype)

    def expand(self, name: str, dtype: DTypeLike | None = None) -> Array:
        """Return values of a field of ``MjModel`` or ``MjOption`` for each simulation, ``(num_sims, ...)``.

        ``gravity``, ``qpos0``, ``jnt_range``, ``dof_armature``, ``dof_damping``, ``dof_frictionloss``,
        ``dof_invweight0``, ``body_mass``, ``body_inertia``, ``body_ipos``, ``body_gravcomp``, ``body_invweight0``,
        ``geom_friction``, ``geom_solref``, ``geom_solimp``, ``pair_friction``, ``actuator_gainprm``,
        ``actuator_biasprm`` and ``actuator_forcerange`` act from the next call on, as parameters of the simulations.
        Any other value, such as a ``timestep`` or a ``geom_size``, gets a model of its own, which is compiled at the
        next call and shared by the simulations with the same values. A batch has at most 64 models. Integers that say
        how the model is built cannot differ. Fields for pictures, and what else `set_const` computes, have no effect on
        the motion.

        Args:
            name: The field.
            dtype: The field's own dtype, or float32 for real fields.

        Raises:
            ArgumentError: There is no such field, or it is of assets.
        """
        with self._lock:
            if name not in self._expansions:
                if name in self._fields:
                    raise ArgumentError(f'{name} is a field of MjData; use bind("{name}")')
                raise ArgumentError(f"{name} is not a field of MjModel")
            array = self._expansions.get(name, dtype)
            self._engine.require(params=self._expansions.params())
            return array

    def step(self, ids: ArrayLike | None = None, nstep: int = 1, history: Array | None = None) -> None:
        """Advance simulations by ``nstep`` steps.

        The others keep their state. If they were current, the batch takes a snapshot first and restores from it later.

        Args:
            ids: Simulations: sorted unique indices, a bool mask ``(num_sims,)``, or all if left out.
            nstep: Number of steps, at least 1.
            history: Filled with the row of each simulation after every step, float64, shape ``(len(ids), nstep,
                nstate)``, contiguous.

        Raises:
            ArgumentError: An argument, or a value in an array of the batch, is not valid; nothing was stepped.
            RuntimeError: The model of a simulation does not run; the message names the first one. The others are done.
            DaemonLost: The daemon underneath went away.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            nstep = _integer("nstep", nstep)
            if nstep < 1:
                raise ArgumentError(f"nstep must be >= 1; got {nstep}")
            if history is not None:
                _check_history(history, (len(chosen), nstep, self.nstate))
            if len(chosen):
                self._variants.step(chosen, nstep, history)

    def forward(self, ids: ArrayLike | None = None) -> None:
        """Fill all bound fields at the current state and controls, as ``mj_forward`` does.

        Args:
            ids: As in `step`.

        Raises:
            ArgumentError: As `step`.
            RuntimeError: As `step`.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            if len(chosen):
                self._variants.forward(chosen)

    def reset(self, ids: ArrayLike | None = None, keyframe: int = -1) -> None:
        """Reset simulations to the model's start or a keyframe, then fill all bound fields.

        Parts of the state that were written since the last call keep what was written. What was written into
        ``"state"`` is lost, as in mjbatch.

        Args:
            ids: As in `step`.
            keyframe: Index of a keyframe of the model, or -1 for its start.

        Raises:
            ArgumentError: There is no such keyframe; or as `step`.
            RuntimeError: As `step`.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            keyframe = _integer("keyframe", keyframe)
            if not -1 <= keyframe < self._own.nkey:
                raise ArgumentError(f"keyframe {keyframe} is out of range; the model has {self._own.nkey}")
            if len(chosen):
                self._variants.reset(chosen, keyframe)

    def set_const(self, ids: ArrayLike | None = None) -> None:
        """Compute the constants of expanded fields as ``mj_setConst`` does, and expand those that changed.

        Contacts and limits of hinges and slides then have the softness of each simulation. Equalities, dry friction,
        tendons and limits of balls keep that of the model, which a warning reports. MuJoCo runs once per simulation.

        Args:
            ids: As in `step`.

        Raises:
            ArgumentError: A simulation is to sleep.
            RuntimeError: MuJoCo refuses the values of a simulation; the message names the first one.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            self._expansions.check_sleep(chosen.indices)
            set_const(self._own, self._expansions, chosen.indices, self.num_sims)
            self._engine.require(params=self._expansions.params())

    def rays(  # noqa: PLR0917, mjbatch has these arguments in this order
        self,
        pnt: Array,
        vec: Array,
        dist: Array,
        geomid: Array | None = None,
        normal: Array | None = None,
        geomgroup: Array | None = None,
        flg_static: bool = True,
        bodyexclude: Array | None = None,
        ids: ArrayLike | None = None,
    ) -> None:
        """Intersect rays with the geoms of each simulation, as ``mj_ray`` does. No simulation and no field changes.

        MuJoCo places the geoms of each simulation on one thread; the rays of all run on `num_threads`. Where geoms are
        SDFs, or expanded fields make them other geoms than the model's, MuJoCo computes the rays one by one.

        Args:
            pnt: Origins in the world [m], ``(num_sims, nray, 3)``, float64 or float32 as all real arrays here.
            vec: Directions, same shape.
            dist: Filled with distances in units of ``vec``, ``(num_sims, nray)``; -1 where nothing is hit.
            geomid: Filled with the geoms, int32, ``(num_sims, nray)``; -1 where nothing is hit.
            normal: Filled with normals, ``(num_sims, nray, 3)``; 0 where nothing is hit.
            geomgroup: Groups of geoms that count, uint8, ``(6,)``; all if left out.
            flg_static: Whether geoms of static bodies count.
            bodyexclude: Body that each ray ignores, int32, ``(nray,)``; -1 for none.
            ids: As in `step`.

        Raises:
            ArgumentError: A shape or dtype is wrong, a value is not finite, a direction has length 0, or a simulation
                differs from the model in an integer that says how it is built.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            self._expansions.check_structure(chosen.indices, SEEN)
            rows = self._bindings.pending(chosen.ids)
            filled, options = (dist, geomid, normal), (geomgroup, flg_static, bodyexclude)
            self._queries.rays(rows, chosen.indices, self.num_sims, given=(pnt, vec), filled=filled, options=options)

    def jac(
        self, jacp: Array | None, jacr: Array | None, point: Array, body: Array, ids: ArrayLike | None = None
    ) -> None:
        """Fill the Jacobians of one point per simulation, as ``mj_jac`` does. No simulation and no field changes.

        Args:
            jacp: Filled with the Jacobian of the position, ``(num_sims, 3, nv)``, or None.
            jacr: Filled with that of the rotation, same shape, or None.
            point: Points in the world [m], ``(num_sims, 3)``, float64 or float32 as the Jacobians.
            body: Body that each point moves with, int32, ``(num_sims,)``.
            ids: As in `step`.

        Raises:
            ArgumentError: A shape or dtype is wrong, or a simulation differs from the model in an integer that says how
                it is built.
        """
        with self._lock:
            chosen = Selection(ids, self.num_sims)
            self._expansions.check_structure(chosen.indices, SEEN)
            rows = self._bindings.pending(chosen.ids)
            self._queries.jac(rows, chosen.indices, self.num_sims, (jacp, jacr), (point, body))


def _integer(name: str, value: Any) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise ArgumentError(f"{name} must be an integer; got {value!r}") from None


def _check_history(history: Array, shape: tuple[int, ...]) -> None:
    if not isinstance(history, np.ndarray) or history.dtype != np.float64:
        raise ArgumentError("history must be a float64 array")
    if history.shape != shape:
        raise ArgumentError(f"history must have shape (sims, nstep, nstate), {shape}; got {history.shape}")
    if not (history.flags.c_contiguous and history.flags.writeable):
        raise ArgumentError("history must be contiguous and writeable")
