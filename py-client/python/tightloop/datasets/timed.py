"""Observations of an episode in time, for formats that show runs instead of steps."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets.choices import Layout
from tightloop.datasets.reading import Episode


def observed(episode: Episode, chosen: Layout) -> tuple[NDArray[np.float64], dict[str, NDArray[Any]]]:
    """Return all observations, the last one included, with their times since the recording's beginning.

    Args:
        episode: The episode.
        chosen: What the episodes have in common.

    Returns:
        Times [s], ``(steps + 1,)``, and fields, ``(steps + 1, …)``.
    """
    seconds = episode.begin + np.arange(episode.steps + 1, dtype=np.float64) * (chosen.every * chosen.period)
    fields = {
        field: np.concatenate([values, episode.next_observations[field][-1:]])
        for field, values in episode.observations.items()
    }
    return seconds, fields
