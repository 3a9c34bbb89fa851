"""A policy as NumPy evaluates it: what `examples/ppo.py` trains, without any library of learning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.files import named as named_files

#: Most bytes of a policy.
_FILE_MAX = 1 << 30
_CLIP = 10.0  # of normalised observations, as in training


class Policy:
    """Two hidden layers with ELU after a normaliser of observations; the most likely action.

    Args:
        path: An ``.npz`` file with ``mean`` and ``scale`` of the observations, and ``weight`` and ``bias`` of each
            layer, numbered from 0.
    """

    def __init__(self, path: Path) -> None:
        with (
            named_files.opened("a policy", Path(path), ArgumentError, limit=_FILE_MAX) as file,
            np.load(file, allow_pickle=False) as arrays,
        ):
            self._mean, self._scale = arrays["mean"], arrays["scale"]
            layers = sum(name.startswith("weight") for name in arrays)
            self._layers = [(arrays[f"weight{layer}"], arrays[f"bias{layer}"]) for layer in range(layers)]

    def __call__(self, obs: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions, shape ``(worlds, actions)``, for observations of shape ``(worlds, size)``."""
        size = len(self._mean)
        if np.ndim(obs) != 2 or np.shape(obs)[1] != size:
            raise ArgumentError(f"policy: obs has shape {np.shape(obs)}; give (worlds, {size}), as the task observes")
        x = np.clip((obs - self._mean) / self._scale, -_CLIP, _CLIP)
        for place, (weight, bias) in enumerate(self._layers):
            if place:
                x = np.where(x > 0, x, np.expm1(np.minimum(x, 0)))
            # not by BLAS: on busy cores its threads wait for each other a hundred times as long as this takes
            x = np.einsum("wi,oi->wo", x, weight) + bias
        return x
