"""HDF5 files in the layout of robomimic: ``data/demo_0/actions``, ``obs/…``, ``states`` and so on."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from tightloop.datasets import libraries
from tightloop.datasets.choices import Layout
from tightloop.datasets.images import camera_name, image_kind
from tightloop.datasets.reading import Episode
from tightloop.datasets.twin_file import TwinFile
from tightloop.datasets.writers import part_of, put_in_place, remove, writing

# What robomimic calls environments with the interface of gym.
_ENV_TYPE = 2
# Images compress well; a higher level takes longer and gains little.
_GZIP_LEVEL = 1


class Hdf5Writer:
    """Writes episodes as demonstrations of robomimic.

    Args:
        out: The file.
        chosen: What the episodes have in common.
        task: What the robot does, in words.
    """

    def __init__(self, out: Path, chosen: Layout, task: str) -> None:
        h5py = libraries.load("h5py")
        self._out, self._layout, self._total = out, chosen, 0
        with writing(out):
            self._twin = TwinFile(part_of(out))
            self._file: Any = h5py.File(self._twin, "w")
        self._data = self._file.create_group("data")
        self._data.attrs["total"] = 0
        self._data.attrs["env_args"] = json.dumps(
            {
                "env_name": task,
                "type": _ENV_TYPE,
                "env_kwargs": {"fps": chosen.fps, "scene": chosen.info["scene"]},
            }
        )

    def add(self, episode: Episode) -> None:
        """Add an episode as the next demonstration."""
        with writing(self._out):
            demo = self._data.create_group(f"demo_{episode.index}")
            demo.attrs["num_samples"] = episode.steps
            demo.attrs["world"] = episode.world
            demo.attrs["begin"] = episode.begin
            demo.attrs["ends"] = episode.ends
            actions = demo.create_dataset("actions", data=episode.actions)
            actions.attrs["names"] = list(self._layout.action_names)
            demo.create_dataset("states", data=episode.states)
            demo.create_dataset("rewards", data=episode.rewards)
            demo.create_dataset("dones", data=episode.dones.astype("int64"))
            self._observations(demo.create_group("obs"), episode.observations)
            self._observations(demo.create_group("next_obs"), episode.next_observations)
            self._total += episode.steps
            self._data.attrs["total"] = self._total

    def commit(self) -> None:
        """Let the unfinished file have all episodes so far."""
        with writing(self._out):
            self._file.flush()
            self._twin.commit()

    def close(self) -> None:
        """Finish the file, and give it its name."""
        with writing(self._out):
            self._file.close()
            self._twin.commit()
            self._twin.close()
            put_in_place(self._out)

    def discard(self) -> None:
        """End without a file, and remove the unfinished one."""
        # a full disk, which is why it ends, is reported once
        with contextlib.suppress(OSError, RuntimeError):
            self._file.close()
        self._twin.close()
        remove(part_of(self._out))

    def _observations(self, group: Any, observations: Mapping[str, NDArray[Any]]) -> None:
        for field, values in observations.items():
            name, array = field, values
            options: dict[str, Any] = {}
            if kind := image_kind(field):
                name = f"{camera_name(field)}_{'image' if kind == 'rgb' else kind}"
                # robomimic expects an axis of channels
                array = values if kind == "rgb" else values[..., None]
                options = {"chunks": (1, *array.shape[1:]), "compression": "gzip", "compression_opts": _GZIP_LEVEL}
            dataset = group.create_dataset(name, data=array, **options)
            if columns := self._layout.columns[field]:
                dataset.attrs["names"] = list(columns)
