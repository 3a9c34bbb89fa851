"""What JAX cannot do with a step of the daemon: gradients and batching, refused by name."""

from __future__ import annotations

from typing import Any

from tightloop.adapters.environment import library
from tightloop.errors import ArgumentError

jax = library("jax", install="jax")
batching = library("jax.custom_batching", install="jax")


def guarded(operand: Any) -> Any:
    """Return an operand of a call; JAX's transformations of it are errors.

    The call itself cannot have rules for them, since JAX refuses those of functions with effects. The rules stand in
    front of it, and leave nothing in the compiled program.
    """
    if jax.numpy.issubdtype(operand.dtype, jax.numpy.floating):
        operand = _differentiated(operand)  # first: JAX's gradient of a batching rule hides this one's error
    return _batched(operand)


@jax.custom_jvp
def _differentiated(operand: Any) -> Any:
    return operand


@_differentiated.defjvp
def _refuse_gradient(primals: Any, tangents: Any) -> Any:
    raise ArgumentError(
        "a step of tightloop has no gradient in JAX, since a daemon makes it: tightloop.linearize(sim) returns the "
        "Jacobians of a step, and jax.lax.stop_gradient(commands) keeps commands out of a gradient"
    )


@batching.custom_vmap
def _batched(operand: Any) -> Any:
    return operand


@_batched.def_vmap
def _refuse_batch(axis_size: int, in_batched: Any, operand: Any) -> Any:
    raise ArgumentError(
        "jax.vmap does not go over a step of tightloop: its worlds are the batch, and one call steps all of them. "
        "Launch as many worlds as you want rows, and give arrays with the worlds first"
    )
