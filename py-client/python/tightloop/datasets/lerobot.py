"""LeRobot datasets, version 3.0: Parquet files of steps and of episodes, with descriptions in JSON.

A commit writes one file of steps and one of episodes, each under a hidden name first. ``meta/info.json`` is replaced
last, so that it counts only what is there.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets import lerobot_stats, libraries
from tightloop.datasets.choices import Layout
from tightloop.datasets.images import png
from tightloop.datasets.lerobot_features import COUNTERS, Features, arrays_of_episode, features
from tightloop.datasets.reading import Episode
from tightloop.datasets.writers import part_of, put_in_place, remove, writing

_VERSION = "v3.0"
_FILES_PER_CHUNK = 1000
_DATA_PATH = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
_EPISODES_PATH = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
# An unfinished file; readers look for all that end with .parquet.
_HIDDEN = ".unfinished"


class LeRobotWriter:
    """Writes episodes as a LeRobot dataset.

    Args:
        out: The folder.
        chosen: What the episodes have in common.
        task: What the robot does, in words.
    """

    def __init__(self, out: Path, chosen: Layout, task: str) -> None:
        self._arrow = libraries.load("pyarrow")
        self._parquet = libraries.load("pyarrow.parquet")
        self._out, self._folder, self._layout = out, part_of(out), chosen
        self._features: Features = {}
        self._stats: dict[str, lerobot_stats.Stats] = {}
        # tables of steps and rows of episodes since the last commit; files, episodes and steps so far
        self._tables: list[Any] = []
        self._rows: list[dict[str, Any]] = []
        self._files = self._episodes = self._steps = 0
        self._task = task
        with writing(out):
            (self._folder / "meta").mkdir(parents=True)
            self._whole("meta/tasks.parquet", lambda path: self._parquet.write_table(self._tasks(), path))

    def add(self, episode: Episode) -> None:
        """Add an episode."""
        arrays = arrays_of_episode(episode, self._layout)
        self._features = self._features or features(arrays, self._layout)
        count = episode.steps
        counters = {
            "timestamp": (np.arange(count) / self._layout.fps).astype(np.float32),
            "frame_index": np.arange(count),
            "episode_index": np.full(count, self._episodes),
            "index": np.arange(self._steps, self._steps + count),
            "task_index": np.zeros(count, np.int64),
        }
        columns = {name: self._column(name, values) for name, values in (arrays | counters).items()}
        self._tables.append(self._arrow.table(columns))
        stats = lerobot_stats.stats_of_episode(arrays | counters)
        self._stats = lerobot_stats.merge(self._stats, stats)
        chunk, file = divmod(self._files, _FILES_PER_CHUNK)
        self._rows.append(
            {
                "episode_index": self._episodes,
                "tasks": [self._task],
                "length": count,
                "data/chunk_index": chunk,
                "data/file_index": file,
                "dataset_from_index": self._steps,
                "dataset_to_index": self._steps + count,
                "meta/episodes/chunk_index": chunk,
                "meta/episodes/file_index": file,
                "world": episode.world,
            }
            | {f"stats/{name}/{key}": value.tolist() for name, each in stats.items() for key, value in each.items()}
        )
        self._episodes += 1
        self._steps += count

    def commit(self) -> None:
        """Let the unfinished folder have all episodes so far."""
        if not self._tables:
            return
        chunk, file = divmod(self._files, _FILES_PER_CHUNK)
        steps, episodes = self._arrow.concat_tables(self._tables), self._arrow.Table.from_pylist(self._rows)
        with writing(self._out):
            for pattern, table in ((_DATA_PATH, steps), (_EPISODES_PATH, episodes)):
                place = pattern.format(chunk_index=chunk, file_index=file)
                self._whole(place, lambda path, table=table: self._parquet.write_table(table, path))
            stats = {name: {key: value.tolist() for key, value in each.items()} for name, each in self._stats.items()}
            self._whole("meta/stats.json", lambda path: path.write_text(json.dumps(stats, indent=4)))
            self._whole("meta/info.json", lambda path: path.write_text(json.dumps(self._info(), indent=4)))
        self._tables, self._rows = [], []
        self._files += 1

    def close(self) -> None:
        """Finish the folder, and give it its name."""
        self.commit()
        with writing(self._out):
            put_in_place(self._out)

    def discard(self) -> None:
        """End without a folder, and remove the unfinished one."""
        remove(self._folder)

    def _whole(self, name: str, write: Callable[[Path], object]) -> None:
        """Write a file of the folder, which appears as a whole."""
        place = self._folder / name
        place.parent.mkdir(parents=True, exist_ok=True)
        hidden = place.with_name(place.name + _HIDDEN)
        write(hidden)
        hidden.replace(place)

    def _column(self, name: str, values: NDArray[Any]) -> Any:
        """Return an array of Arrow: numbers, lists of them, or images as PNG files."""
        arrow = self._arrow
        if name not in COUNTERS and self._features[name]["dtype"] == "image":
            images = [{"bytes": png(image), "path": None} for image in values]
            return arrow.array(images, type=arrow.struct({"bytes": arrow.binary(), "path": arrow.string()}))
        column = arrow.array(np.ascontiguousarray(values).reshape(-1))
        # the innermost axis first; a matrix is a list of lists, as LeRobot reads it
        for axis, size in enumerate(values.shape[:0:-1]):
            if values.ndim == 2 and axis == 0:
                column = arrow.FixedSizeListArray.from_arrays(column, size)
            else:
                offsets = np.arange(0, len(column) + 1, size, dtype=np.int32)
                column = arrow.ListArray.from_arrays(offsets, column)
        return column

    def _tasks(self) -> Any:
        """Return the table of tasks, which pandas reads with their names as its index."""
        column = {"metadata": None, "field_name": "task_index", "name": "task_index"}
        index = {"metadata": None, "field_name": "__index_level_0__", "name": None}
        about = {
            "index_columns": ["__index_level_0__"],
            "column_indexes": [],
            "columns": [
                column | {"pandas_type": "int64", "numpy_type": "int64"},
                index | {"pandas_type": "unicode", "numpy_type": "object"},
            ],
            "creator": {"library": "pyarrow", "version": self._arrow.__version__},
            "pandas_version": "2.0.0",
        }
        table = self._arrow.table({"task_index": np.zeros(1, np.int64), "__index_level_0__": [self._task]})
        return table.replace_schema_metadata({"pandas": json.dumps(about)})

    def _info(self) -> dict[str, Any]:
        robots = [robot["name"] for robot in self._layout.info["robots"]]
        return {
            "codebase_version": _VERSION,
            "robot_type": ", ".join(robots) or None,
            "total_episodes": self._episodes,
            "total_frames": self._steps,
            "total_tasks": 1,
            "chunks_size": _FILES_PER_CHUNK,
            "data_files_size_in_mb": 100,
            "video_files_size_in_mb": 200,
            "fps": self._layout.fps,
            "splits": {"train": f"0:{self._episodes}"},
            "data_path": _DATA_PATH,
            "video_path": None,
            "features": self._features,
        }
