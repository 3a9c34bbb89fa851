"""Statistics of a LeRobot dataset: of each episode, and of all of them together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Quantiles by name.
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
# Colours of so many images per episode are enough for a mean.
_IMAGES_MAX = 100

Stats = dict[str, NDArray[Any]]


def stats_of_episode(arrays: Mapping[str, NDArray[Any]]) -> dict[str, Stats]:
    """Return the statistics of the arrays of an episode, by feature.

    Colours have one value per channel, of shape ``(3, 1, 1)``, in [0, 1]. Arrays of several axes have one value, and
    all others one per column. ``count`` is the number of steps, or of images.
    """
    return {name: _image_stats(values) if _is_image(name) else _stats(values) for name, values in arrays.items()}


def merge(old: Mapping[str, Stats], new: Mapping[str, Stats]) -> dict[str, Stats]:
    """Return the statistics of two sets of episodes together.

    Quantiles are means of those of both, weighted by their counts, as LeRobot merges them.
    """
    return {name: _merged(old[name], new[name]) if name in old else new[name] for name in new}


def _is_image(name: str) -> bool:
    return name.startswith("observation.images.")


def _image_stats(images: NDArray[np.uint8]) -> Stats:
    some = images[np.linspace(0, len(images) - 1, min(len(images), _IMAGES_MAX)).astype(int)]
    made = _stats(some.reshape(-1, images.shape[-1]) / np.float32(255))
    made = {key: value.reshape(-1, 1, 1) for key, value in made.items()}
    return made | {"count": np.array([len(some)])}


def _stats(values: NDArray[Any]) -> Stats:
    count = len(values)
    rows = values.astype(np.float64)
    # a column per value; of images and matrices, all together
    rows = rows.reshape(count, -1) if rows.ndim <= 2 else rows.reshape(-1, 1)
    made = {
        "min": rows.min(axis=0),
        "max": rows.max(axis=0),
        "mean": rows.mean(axis=0),
        "std": rows.std(axis=0),
    }
    made |= dict(zip(QUANTILES, np.quantile(rows, [*QUANTILES.values()], axis=0), strict=True))
    if values.ndim > 2:
        made = {key: value.reshape((1,) * (values.ndim - 1)) for key, value in made.items()}
    return made | {"count": np.array([count])}


def _merged(old: Stats, new: Stats) -> Stats:
    before, more = old["count"], new["count"]
    weight = more / (before + more)
    change = new["mean"] - old["mean"]
    # variances around the common mean (Chan, Golub and LeVeque 1979)
    variance = old["std"] ** 2 * (1 - weight) + new["std"] ** 2 * weight + change**2 * weight * (1 - weight)
    made = {
        "min": np.minimum(old["min"], new["min"]),
        "max": np.maximum(old["max"], new["max"]),
        "mean": old["mean"] + change * weight,
        "std": np.sqrt(variance),
    }
    made |= {name: old[name] + (new[name] - old[name]) * weight for name in QUANTILES}
    return made | {"count": before + more}
