"""Features of a LeRobot dataset: what each column is called, its type and its shape."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets.choices import Layout
from tightloop.datasets.images import camera_name, image_kind
from tightloop.datasets.reading import Episode

#: Fields that together are ``observation.state``.
STATE = ("joint_q", "joint_qd", "joint_q_measured", "joint_qd_measured", "qpos", "qvel", "act")
#: Features of every dataset, besides those of the robot.
COUNTERS = {
    "timestamp": np.dtype(np.float32),
    "frame_index": np.dtype(np.int64),
    "episode_index": np.dtype(np.int64),
    "index": np.dtype(np.int64),
    "task_index": np.dtype(np.int64),
}

Features = dict[str, dict[str, Any]]


def arrays_of_episode(episode: Episode, chosen: Layout) -> dict[str, NDArray[Any]]:
    """Return the arrays of an episode by the names of their features, steps first.

    Floats become float32, as policies expect them.
    """
    state = [field for field in chosen.fields if field in STATE]
    arrays: dict[str, NDArray[Any]] = {}
    if state:
        arrays["observation.state"] = np.concatenate([episode.observations[field] for field in state], axis=1)
    for field in chosen.fields:
        if field not in state:
            arrays[feature_name(field)] = episode.observations[field]
    arrays |= {"action": episode.actions, "next.reward": episode.rewards, "next.done": episode.dones}
    return {name: _single(values) for name, values in arrays.items()}


def feature_name(field: str) -> str:
    """Return the name of the feature of a field."""
    match image_kind(field):
        case None:
            return f"observation.{field}"
        case "rgb":
            return f"observation.images.{camera_name(field)}"
        case kind:
            return f"observation.{kind}.{camera_name(field)}"


def features(arrays: Mapping[str, NDArray[Any]], chosen: Layout) -> Features:
    """Return the features of a dataset, as its ``meta/info.json`` has them."""
    state = [field for field in chosen.fields if field in STATE]
    names: dict[str, list[str]] = {"action": list(chosen.action_names)}
    # positions and velocities of a joint have the same name
    names["observation.state"] = [f"{name}.{field}" for field in state for name in chosen.columns[field]]
    names |= {feature_name(field): list(columns) for field, columns in chosen.columns.items() if field not in state}
    made: Features = {}
    for name, values in arrays.items():
        if name.startswith("observation.images."):
            made[name] = {
                "dtype": "image",
                "shape": list(values.shape[1:]),
                "names": ["height", "width", "channels"],
            }
            continue
        shape = list(values.shape[1:]) or [1]
        known = names.get(name, [])
        fits = len(shape) == 1 and len(known) == shape[0]
        made[name] = {"dtype": values.dtype.name, "shape": shape, "names": known if fits else None}
    made |= {name: {"dtype": dtype.name, "shape": [1], "names": None} for name, dtype in COUNTERS.items()}
    return made


def _single(values: NDArray[Any]) -> NDArray[Any]:
    if values.dtype == np.float64:
        values = values.astype(np.float32)
    # a number per step has no axis, as its feature
    return values[:, 0] if values.ndim == 2 and values.shape[1] == 1 else values
