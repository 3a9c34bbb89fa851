"""Calls of tightloop in a program of JAX: through XLA's foreign function interface, or by a callback without it."""

from __future__ import annotations

import functools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from tightloop import _core
from tightloop.adapters.environment import library
from tightloop.adapters.jax.refusals import guarded
from tightloop.checks import advice
from tightloop.errors import ArgumentError, MissingLibrary

jax = library("jax", install="jax")
experimental = library("jax.experimental", install="jax")

#: Ways to call: XLA's foreign functions without Python, or a callback of Python.
WAYS = ("ffi", "io_callback")
#: The name under which XLA knows the call.
_TARGET = "tightloop"
#: Platforms of XLA on which the call is an error.
_ELSEWHERE = ("CUDA", "ROCM")


class Result(NamedTuple):
    """Name, shape and type of what a call returns."""

    name: str
    shape: tuple[int, ...]
    dtype: np.dtype[Any]


class Program:
    """Calls in programs of JAX; each takes the token of the call before, and returns the next one.

    Attributes:
        via: ``"ffi"`` or ``"io_callback"``.
    """

    def __init__(self, via: str | None) -> None:
        self.via = way(via)

    def call(
        self, name: str, inputs: Sequence[str], results: Sequence[Result], token: Any, *operands: Any
    ) -> tuple[Any, list[Any]]:
        """Add a call to the program that JAX traces. Outside of a program, make it.

        Args:
            name: What is called.
            inputs: Names of the operands, without a mask.
            results: What it returns.
            token: The token.
            *operands: Arrays of types that the call takes.

        Raises:
            ArgumentError: JAX differentiates or batches the call.
        """
        token, *arrays = _made(self.via, name, " ".join(inputs), tuple(results), token, *operands)
        return token, arrays


def traces() -> bool:
    """Return whether JAX traces a program."""
    return isinstance(jax.numpy.zeros(()), jax.core.Tracer)


def token_of(number: int, calls: int) -> Any:
    """Return a token as an array of JAX: the number of what is called, and its calls so far."""
    return jax.numpy.asarray(np.array([number, calls], np.uint32))


def token_as_given(token: Any, name: str, begin: str) -> Any:
    """Return a token as calls take it.

    Args:
        token: The token.
        name: What the caller calls it.
        begin: The function that returns the first one.

    Raises:
        ArgumentError: It is none.
    """
    if getattr(token, "shape", None) != (2,) or getattr(token, "dtype", None) != np.uint32:
        raise ArgumentError(f"{name} is {token!r:.80}; give what `{begin}` or the last call returned first")
    return token


def way(via: str | None) -> str:
    """Return how programs call: as asked for, or through XLA's foreign functions where they work.

    Warns:
        TightloopWarning: They do not.

    Raises:
        ArgumentError: There is no such way.
        MissingLibrary: This JAX has no foreign functions, and they were asked for.
    """
    if via not in (None, *WAYS):
        raise ArgumentError(f"via is {via!r}; give {' or '.join(map(repr, WAYS))}, or leave it out")
    problem = None if via == "io_callback" else _interface_problem()
    if problem is None:
        return via or "ffi"
    if via == "ffi":
        raise MissingLibrary(f"{problem}; pip install -U jax, or give via='io_callback'")
    advice.warn(f"{problem}: programs call by io_callback, which costs some 100 us per step; pip install -U jax")
    return "io_callback"


@functools.cache
def _interface_problem() -> str | None:
    """Register the call with XLA; returns why that is not possible, or None."""
    here = f"JAX {jax.__version__}"
    if not hasattr(jax, "ffi"):
        return f"{here} has no jax.ffi, which came with 0.5"
    try:
        cpu, elsewhere = _core.xla_handlers(*_version_of_interface())
        jax.ffi.register_ffi_target(_TARGET, jax.ffi.pycapsule(cpu), platform="cpu")
        for platform in _ELSEWHERE:
            jax.ffi.register_ffi_target(_TARGET, jax.ffi.pycapsule(elsewhere), platform=platform)
    except Exception as problem:  # XLA's refusal has a class of its own
        return f"{here} does not take foreign functions of tightloop ({problem})"
    return None


def _version_of_interface() -> tuple[int, int]:
    """Read the version of XLA's interface from its header, which jaxlib carries."""
    text = Path(jax.ffi.include_dir(), "xla/ffi/api/c_api.h").read_text(encoding="utf-8")
    numbers = dict(re.findall(r"#define XLA_FFI_API_(MAJOR|MINOR) (\d+)", text))
    return int(numbers["MAJOR"]), int(numbers["MINOR"])


# compiled once where it is called outside of programs, and part of the caller's program elsewhere
@functools.partial(jax.jit, static_argnums=(0, 1, 2, 3), inline=True)
def _made(via: str, name: str, inputs: str, results: tuple[Result, ...], *operands: Any) -> list[Any]:
    fields = " ".join(result.name for result in results)
    structs = [_TOKEN, *(jax.ShapeDtypeStruct(result.shape, result.dtype) for result in results)]
    taken = [guarded(operand) for operand in operands]
    if via == "ffi":
        made = jax.ffi.ffi_call(_TARGET, structs, has_side_effect=True)
        return made(*taken, call=name, inputs=inputs, fields=fields)
    call = functools.partial(_call_back, name, inputs, fields, structs)
    # the token orders it: those of JAX's own order would hand an error on to each later program
    return experimental.io_callback(call, structs, *taken, ordered=False)


def _call_back(name: str, inputs: str, fields: str, structs: Sequence[Any], *operands: Any) -> list[Any]:
    """Make a call as XLA's foreign function does, with arrays of NumPy."""
    outputs = [np.empty(struct.shape, struct.dtype) for struct in structs]
    written = [output.view(np.uint8) if output.dtype == np.bool_ else output for output in outputs]
    _core.xla_call(name, inputs, fields, [np.ascontiguousarray(operand) for operand in operands], written)
    return outputs


_TOKEN = jax.ShapeDtypeStruct((2,), np.uint32)
