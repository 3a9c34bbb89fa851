"""A recording of a real daemon for tests of datasets, beside what its client saw; and episodes with made-up images."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from conftest import PENDULUM
from tightloop.datasets.choices import Layout, layout
from tightloop.datasets.reading import Episode, episodes

WORLDS = 3
#: Steps of each episode of the run; all worlds are reset together.
LENGTHS = (5, 7, 4)
FIELDS = ("joint_q", "joint_qd", "body_q", "kinetic_energy")
SHAPE = (4, 6)


@dataclass(frozen=True)
class Run:
    """A recording.

    Attributes:
        path: The file.
        seen: Fields of each episode as the client saw them, ``(steps + 1, worlds, …)``.
        sent: Torques of each episode as the client sent them, ``(steps, worlds, dofs)``.
        period: Time between two control frames [s].
    """

    path: Path
    seen: list[dict[str, NDArray[Any]]]
    sent: list[NDArray[np.float32]]
    period: float


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Run]:
    """Three worlds that are reset twice, with torques that differ from world to world and step to step."""
    folder = tmp_path_factory.mktemp("recorded")
    urdf = folder / "pendulum.urdf"
    urdf.write_text(PENDULUM)
    scene = tl.Scene(dt=1 / 600, substeps=10)
    scene.add_urdf(urdf, name="arm")
    rng = np.random.default_rng(3)
    seen, sent = [], []
    path = folder / "swing.tlrec"
    with tl.launch(scene, worlds=WORLDS, fields=FIELDS) as sim, sim.record(path):
        for steps in LENGTHS:
            frames = [copied(sim.reset())]
            torques = rng.uniform(-3, 3, (steps, WORLDS, 2)).astype(np.float32)
            frames += [copied(sim.step(joint_f=torque)) for torque in torques]
            seen.append({name: np.stack([frame[name] for frame in frames]) for name in FIELDS})
            sent.append(torques)
    yield Run(path, seen, sent, 1 / 60)


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """An HDF5 file, whose items have no common type."""
    with h5py.File(path) as file:
        yield file


def copied(frame: tl.Frame) -> dict[str, NDArray[Any]]:
    return {name: np.array(getattr(frame, name)) for name in FIELDS}


def with_images(run: Run) -> tuple[Layout, list[Episode]]:
    """The episodes of a run with images of a camera that the recording does not have."""
    fields = ("wrist_rgb", "wrist_depth", "wrist_segmentation")
    chosen = layout(run.path, fields=("joint_q",), action=None, joints=None, worlds=None, fps=None)
    chosen = dataclasses.replace(
        chosen, fields=("joint_q", *fields), columns={**chosen.columns, **dict.fromkeys(fields, ())}
    )
    made = []
    for episode in episodes(run.path, fields=["joint_q"]):
        images = made_images(episode.steps + 1, episode.index)
        before = {field: values[:-1] for field, values in images.items()}
        after = {field: values[1:] for field, values in images.items()}
        made.append(
            dataclasses.replace(
                episode,
                observations={**episode.observations, **before},
                next_observations={**episode.next_observations, **after},
            )
        )
    return chosen, made


def made_images(count: int, seed: int) -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(seed)
    return {
        "wrist_rgb": rng.integers(0, 256, (count, *SHAPE, 3), np.uint8),
        "wrist_depth": rng.uniform(0, 5, (count, *SHAPE)).astype(np.float32),
        "wrist_segmentation": rng.integers(-1, 40, (count, *SHAPE), np.int32),
    }
