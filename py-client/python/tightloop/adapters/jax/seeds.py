"""Seeds of worlds in programs of JAX: whole numbers of 32 bits, and keys of ``jax.random``."""

from __future__ import annotations

from typing import Any

import numpy as np

from tightloop.adapters.environment import library

jax = library("jax", install="jax")
jnp = library("jax.numpy", install="jax")


def seeds_of_key(seed: Any, count: int) -> Any:
    """Draw seeds, uint32, shape ``(count,)``, if the seed is a key of ``jax.random``; else return None."""
    dtype, shape = getattr(seed, "dtype", None), getattr(seed, "shape", None)
    is_key = dtype is not None and jnp.issubdtype(dtype, jax.dtypes.prng_key) and shape == ()
    if is_key or (dtype == np.uint32 and shape == (2,)):
        return jax.random.bits(seed, (count,), np.uint32)
    return None


def whole_seeds(seed: Any) -> Any:
    """Return seeds as an array of JAX, uint32; None if they are not whole numbers from 0 to 2**32 - 1.

    Arrays of JAX are cut to 32 bits, since their values may be known only when the program runs.
    """
    try:
        if not isinstance(seed, jax.Array) and any(isinstance(one, jax.Array) for one in jax.tree.leaves(seed)):
            seed = jnp.asarray(seed)
        if isinstance(seed, jax.Array):
            return seed.astype(np.uint32) if jnp.issubdtype(seed.dtype, jnp.integer) else None
        given = np.asarray(seed)
    except (TypeError, ValueError, OverflowError):
        return None
    # Python's integers of more than 64 bits are objects here
    if given.dtype.kind not in "iu" or given.size == 0 or given.min() < 0 or given.max() >= 2**32:
        return None
    return jnp.asarray(given.astype(np.uint32))


def shown(seed: Any) -> str:
    """Return type and shape of an array, and anything else as it is, for messages."""
    shape = getattr(seed, "shape", ())
    return f"of {seed.dtype} and shape {shape}" if shape or isinstance(seed, jax.Array) else f"{seed!r:.80}"
