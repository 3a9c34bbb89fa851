"""A simulation in programs of JAX."""

from __future__ import annotations

import functools
from collections import namedtuple
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tightloop.adapters.environment import library
from tightloop.adapters.jax.programs import Program, Result, token_as_given, token_of, traces
from tightloop.adapters.jax.seeds import seeds_of_key, shown, whole_seeds
from tightloop.arrays.frames import unknown_field
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, CommandRefused
from tightloop.sim.command_rows import COMMANDS
from tightloop.sim.sim import Sim

jax = library("jax", install="jax")
jnp = library("jax.numpy", install="jax")

#: Numbers of each type of a field's description, in NumPy's words.
_TYPES = {"f32": "f4", "f64": "f8", "i32": "i4", "u32": "u4", "u64": "u8", "u8": "u1"}


@checked_calls
class JaxSim:
    """A simulation whose steps are part of programs of JAX, under ``jax.jit``, ``lax.scan``, ``lax.cond`` and the like.

    The worlds stay in the daemon, so these functions are not pure. Each takes a token and returns the next one, which
    puts the calls in order. A token that was used before is an error.

    Errors inside of a program are JAX's ``jax.errors.JaxRuntimeError``. Its text has the name of tightloop's exception
    and its message, such as ``DaemonLost: daemon "cart" (pid 7) is gone …``.

    Attributes:
        sim: The simulation. `close` it as always.
        fields: Fields that each call returns.
        via: How programs call: ``"ffi"``, or ``"io_callback"``.
    """

    def __init__(self, sim: Sim, fields: Sequence[str] = ("joint_q", "joint_qd"), *, via: str | None = None) -> None:
        """Make the functions of a simulation.

        Args:
            sim: The simulation, of `launch` or `attach`. Its worlds are the first axis of all arrays.
            fields: Fields that each call returns, out of those of the launch. Each is copied once per call.
            via: ``"ffi"`` calls through XLA's foreign functions, without Python. ``"io_callback"`` calls back into
                Python, which costs some 100 µs more. If left out, the first where this JAX has it.

        Raises:
            UnknownField: Frames of this simulation do not carry a field.
            ArgumentError: An argument is not valid, or a field has 64 bits and JAX has not.
            SimClosed: The simulation was closed.
            MissingLibrary: ``via="ffi"``, and this JAX has no foreign functions.
        """
        if not isinstance(sim, Sim):
            raise ArgumentError(f"JaxSim: sim is {type(sim).__name__}; give a tightloop.Sim, of launch or attach")
        if isinstance(fields, str) or not all(isinstance(name, str) for name in fields):
            raise ArgumentError(f"JaxSim: fields is {fields!r:.80}; give names of fields, such as ('joint_q',)")
        sim._client.xla_token()  # raises SimClosed
        self.sim, self.fields = sim, tuple(dict.fromkeys(fields))
        self._program = Program(via)
        self.via = self._program.via
        known = {field["name"]: field for field in sim.info["fields"]}
        for name in self.fields:
            if name not in known:
                raise unknown_field(name, list(sim.fields), list(known))
        self._results = [_result(known[name]) for name in self.fields]

    def token(self) -> Any:
        """Return the present token, uint32, shape ``(2,)``.

        Call it outside of programs: before the first one, and after a program that failed.

        Raises:
            SimClosed: The simulation was closed.
            ArgumentError: JAX traces a program, which would keep this token for all of its runs.
        """
        if traces():
            raise ArgumentError("token() was called inside of a program; call it before, and give it as an argument")
        return token_of(*self.sim._client.xla_token())

    def step(
        self,
        token: Any,
        *,
        joint_f: Any = None,
        joint_target_q: Any = None,
        joint_target_qd: Any = None,
        ctrl: Any = None,
        mocap_pos: Any = None,
        mocap_quat: Any = None,
        eq_active: Any = None,
        body_f: Any = None,
    ) -> tuple[Any, Any]:
        """Advance every world by one control frame. A command that is left out keeps its last value.

        Args:
            token: The token.
            joint_f: As in `Sim.step`, but an array for the whole scene: ``(worlds, dofs)`` or ``(dofs,)``.
            joint_target_q: Likewise.
            joint_target_qd: Likewise.
            ctrl: Likewise, ``(worlds, actuators)`` or ``(actuators,)``.
            mocap_pos: Likewise, ``(worlds, mocaps, 3)`` or ``(mocaps, 3)``.
            mocap_quat: Likewise, ``(worlds, mocaps, 4)`` or ``(mocaps, 4)``.
            eq_active: Likewise, ``(worlds, equalities)`` or ``(equalities,)``.
            body_f: Likewise, ``(worlds, bodies, 6)`` or ``(bodies, 6)``.

        Returns:
            The next token, and a named tuple of `fields`, worlds first.

        Raises:
            CommandRefused: A command has a wrong shape or type, or the scene does not have it.
            ConstantParameter: ``body_f`` is given, and ``launch(params=("body_f",))`` was not.
            ArgumentError: The token is none, or JAX differentiates or batches the step.
        """
        given = {
            "joint_f": joint_f,
            "joint_target_q": joint_target_q,
            "joint_target_qd": joint_target_qd,
            "ctrl": ctrl,
            "mocap_pos": mocap_pos,
            "mocap_quat": mocap_quat,
            "eq_active": eq_active,
            "body_f": body_f,
        }
        return self._call("step", token, given)

    def reset(
        self, token: Any, *, mask: Any = None, seed: Any = None, joint_q: Any = None, joint_qd: Any = None
    ) -> tuple[Any, Any]:
        """Reset worlds to the scene's start, with new draws, as `Sim.reset` does.

        Args:
            token: The token.
            mask: Worlds to reset, bool, shape ``(worlds,)``; all if left out.
            seed: New seeds of these worlds: a key of ``jax.random``, or whole numbers from 0 to 2**32 - 1, one or
                ``(worlds,)``. JAX's arrays of them are cut to 32 bits. With two worlds an array of two is two seeds.
            joint_q: Joint positions instead of the scene's, ``(worlds, coords)`` or ``(coords,)``.
            joint_qd: Joint velocities, likewise.

        Returns:
            As `step`, at the new state. Raises as `step` does.
        """
        given = {} if seed is None else {"seed": self._seeds(seed)}
        return self._call("reset", token, {**given, "joint_q": joint_q, "joint_qd": joint_qd}, self._mask(mask))

    def write(
        self,
        token: Any,
        *,
        joint_q: Any = None,
        joint_qd: Any = None,
        act: Any = None,
        ctrl: Any = None,
        mocap_pos: Any = None,
        mocap_quat: Any = None,
        eq_active: Any = None,
        mask: Any = None,
    ) -> tuple[Any, Any]:
        """Set joint positions and velocities, and what else `Sim.write` sets, in the worlds of a mask.

        Args:
            token: The token.
            joint_q: As in `Sim.write`, but an array for the whole scene: ``(worlds, coords)`` or ``(coords,)``.
            joint_qd: Likewise, ``(worlds, dofs)`` or ``(dofs,)``.
            act: Likewise.
            ctrl: Likewise.
            mocap_pos: Likewise.
            mocap_quat: Likewise.
            eq_active: Likewise.
            mask: Worlds to write, bool, shape ``(worlds,)``; all if left out.

        Returns:
            As `step`, at the new state. Raises as `step` does.
        """
        given = {
            "joint_q": joint_q,
            "joint_qd": joint_qd,
            "act": act,
            "ctrl": ctrl,
            "mocap_pos": mocap_pos,
            "mocap_quat": mocap_quat,
            "eq_active": eq_active,
        }
        return self._call("write", token, given, self._mask(mask))

    def forward(self, token: Any) -> tuple[Any, Any]:
        """Return the fields at the present state and commands, without a step. Raises as `step` does."""
        return self._call("forward", token, {})

    def _call(self, name: str, token: Any, given: Mapping[str, Any], *mask: Any) -> tuple[Any, Any]:
        for result in self._results:
            _check_bits(result)
        inputs = {key: value for key, value in given.items() if value is not None}
        arrays = [value if key == "seed" else self._columns(key, value) for key, value in inputs.items()]
        token, made = self._program.call(
            name, [*inputs], self._results, token_as_given(token, "token", "token()"), *mask, *arrays
        )
        return token, _kind_of(self.fields)(*made)

    def _columns(self, name: str, value: Any) -> Any:
        """Return a command as the client takes it, ``(worlds, columns)``."""
        layout, row = self.sim._client.layout(name), COMMANDS.get(name)
        if layout is None and row is not None and row.is_param:
            self.sim.params.ready_columns(name, value)  # raises ConstantParameter
        if layout is None or not layout[1]:
            raise CommandRefused(f"{name}: no model of this scene has any; leave it out")
        _, columns, parts, _ = layout
        array = _array(name, value, self.sim.precision, is_switch=row is not None and row.is_switch)
        shape = (columns,) if parts == 1 else (columns // parts, parts)
        worlds = self.sim.worlds
        if array.shape not in ((worlds, *shape), shape):
            expected = f"expected shape {(worlds, *shape)}, or {shape} for all worlds"
            raise CommandRefused(f"{name}: {expected}; got {array.shape}")
        return jnp.broadcast_to(array, (worlds, *shape)).reshape(worlds, columns)

    def _mask(self, mask: Any) -> Any:
        worlds = self.sim.worlds
        if mask is None:
            return jnp.ones(worlds, bool)
        array = jnp.asarray(mask)
        if array.dtype != bool or array.shape != (worlds,):
            problem = f"mask: got {array.dtype} of shape {array.shape}"
            raise CommandRefused(f"{problem}; give an array with True for the worlds meant, bool, shape ({worlds},)")
        return array

    def _seeds(self, seed: Any) -> Any:
        worlds = self.sim.worlds
        if getattr(seed, "shape", None) != (worlds,):
            drawn = seeds_of_key(seed, worlds)
            if drawn is not None:
                return drawn
        seeds = whole_seeds(seed)
        if seeds is None or seeds.shape not in ((), (worlds,)):
            cure = f"give a key of jax.random, or whole numbers from 0 to 2**32 - 1: one, or shape ({worlds},)"
            raise CommandRefused(f"reset: seed is {shown(seed)}; {cure}")
        return seeds.reshape(-1)

    def __repr__(self) -> str:
        return f"JaxSim({self.sim!r}, fields={self.fields!r}, via={self.via!r})"


def views(frame: Any, fields: Sequence[str] = ("joint_q", "joint_qd")) -> Any:
    """Return fields of a frame as arrays of JAX in the memory that the daemon wrote: nothing is copied.

    It is for frames of `Sim.step` and the like, outside of programs. The arrays hold the frame, which stays unchanged
    until you drop them.

    Args:
        frame: A frame.
        fields: Names of the fields.

    Returns:
        A named tuple of the arrays, worlds first.

    Raises:
        UnknownField: The frame does not carry a field.
        ArgumentError: A field has 64 bits, and JAX has not.
    """
    names = tuple(dict.fromkeys(fields))
    arrays = [np.asarray(getattr(frame, name)) for name in names]
    for name, array in zip(names, arrays, strict=True):
        _check_bits(Result(name, array.shape, array.dtype))
    cpu = jax.devices("cpu")[0]
    return _kind_of(names)(*(jax.device_put(array, cpu) for array in arrays))


def _result(field: Mapping[str, Any]) -> Result:
    result = Result(field["name"], tuple(field["shape"]), np.dtype(_TYPES[field["dtype"]]))
    _check_bits(result)
    return result


def _check_bits(result: Result) -> None:
    """Refuse 64 bits where JAX cuts them off."""
    if jax.dtypes.canonicalize_dtype(result.dtype) != result.dtype:
        raise ArgumentError(
            f"`{result.name}` is {result.dtype}, which JAX cuts to 32 bits: call "
            'jax.config.update("jax_enable_x64", True) first, or leave the field out. With launch(precision="f32") all '
            "fields but `time` and `step` have 32 bits"
        )


def _array(name: str, value: Any, precision: str, *, is_switch: bool) -> Any:
    """Return a command as an array of JAX, of float32 or float64."""
    if isinstance(value, Mapping):
        raise CommandRefused(f"{name} is a dict; in JAX give an array in the order of the names, such as sim.dof_names")
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError, OverflowError):
        raise CommandRefused(f"{name} is {value!r:.80}; give an array of real numbers") from None
    is_real = jnp.issubdtype(array.dtype, jnp.floating) or jnp.issubdtype(array.dtype, jnp.integer)
    if not is_real and not (is_switch and array.dtype == bool):
        raise CommandRefused(f"{name}: dtype {array.dtype} is not a real number; give float32 or float64")
    if array.dtype in (np.float32, np.float64):
        return array
    return array.astype(jnp.float64 if precision == "f64" else jnp.float32)


@functools.cache
def _kind_of(fields: tuple[str, ...]) -> Any:
    """Return the type of what calls return: the same one for the same fields, so that JAX compiles once."""
    return namedtuple("Fields", fields)
