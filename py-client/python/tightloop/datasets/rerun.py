"""Rerun recordings: entities per world, such as ``world_0/joint_q``, on a timeline in seconds and one of episodes."""

from __future__ import annotations

import secrets
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets import libraries
from tightloop.datasets.choices import Layout
from tightloop.datasets.images import camera_name, image_kind
from tightloop.datasets.reading import Episode
from tightloop.datasets.timed import observed
from tightloop.datasets.twin_file import TwinFile
from tightloop.datasets.writers import part_of, remove, writing
from tightloop.errors import OutputError

_COPIED_AT_ONCE = 1 << 24


class RerunWriter:
    """Writes episodes as columns of entities per world.

    Args:
        out: The file.
        chosen: What the episodes have in common.
        task: What the robot does, in words.
    """

    def __init__(self, out: Path, chosen: Layout, task: str) -> None:
        self._rerun = rerun = libraries.load("rerun")
        self._out, self._layout = out, chosen
        self._named: set[str] = set()
        # Rerun opens no file that ends within a message, so others see copies of it after whole ones
        self._growing = out.with_name(f".tightloop-{secrets.token_hex(8)}{out.suffix}")
        self._copied = 0
        with writing(out):
            self._part = TwinFile(part_of(out))
            # rerun's own errors name no cause
            self._growing.touch(exist_ok=False)
            self._stream: Any = rerun.RecordingStream("tightloop")
            self._stream.save(self._growing)
            self._stream.send_recording_name(task)

    def add(self, episode: Episode) -> None:
        """Add an episode to the timelines."""
        seconds, fields = observed(episode, self._layout)
        world = f"world_{episode.world}"
        for field, values in fields.items():
            self._field(f"{world}/{field}", field, values, seconds, episode.index)
        names = self._layout.action_names
        self._numbers(f"{world}/action", names, episode.actions, seconds[:-1], episode.index)
        # a step's reward is there once it is done
        self._numbers(f"{world}/reward", (), episode.rewards, seconds[1:], episode.index)

    def commit(self) -> None:
        """Let the unfinished file have all episodes so far."""
        with writing(self._out):
            self._flush()
            with self._growing.open("rb") as file:
                file.seek(self._copied)
                while data := file.read(_COPIED_AT_ONCE):
                    self._copied += self._part.write(data)
            self._part.commit()

    def close(self) -> None:
        """Finish the file, and give it its name."""
        with writing(self._out):
            self._flush()
            self._stream.disconnect()
            self._growing.rename(self._out)
            self._part.close()
            remove(part_of(self._out))

    def discard(self) -> None:
        """End without a file, and remove the unfinished one."""
        self._stream.disconnect()
        self._part.close()
        remove(self._growing)
        remove(part_of(self._out))

    def _flush(self) -> None:
        try:
            self._stream.flush()
        except RuntimeError as problem:
            # of a full disk; Rerun's log has the reason
            raise OutputError(f"{self._out}: cannot be written: {problem}") from problem

    def _field(self, entity: str, field: str, values: NDArray[Any], seconds: NDArray[np.float64], episode: int) -> None:
        columns = self._layout.columns[field]
        kind = image_kind(field)
        if kind is not None:
            self._images(f"{entity.partition('/')[0]}/{kind}/{camera_name(field)}", kind, values, seconds, episode)
        elif field == "body_q":
            for place, body in enumerate(columns):
                poses = values[:, place]
                transforms = self._rerun.Transform3D.columns(translation=poses[:, :3], quaternion=poses[:, 3:])
                self._send(f"{entity}/{body}", seconds, episode, transforms)
        else:
            self._numbers(entity, columns, values, seconds, episode)

    def _numbers(
        self, entity: str, names: tuple[str, ...], values: NDArray[Any], seconds: NDArray[np.float64], episode: int
    ) -> None:
        rows = values.reshape(len(values), -1)
        if not rows.size:
            return
        if len(names) == rows.shape[1] and entity not in self._named:
            self._named.add(entity)
            self._stream.log(entity, self._rerun.SeriesLines(names=list(names)), static=True)
        self._send(entity, seconds, episode, self._rerun.Scalars.columns(scalars=rows.astype(np.float64)))

    def _images(self, entity: str, kind: str, values: NDArray[Any], seconds: NDArray[np.float64], episode: int) -> None:
        rerun = self._rerun
        archetype, dtype, channel = {
            "rgb": (rerun.Image, "u1", rerun.ChannelDatatype.U8),
            "depth": (rerun.DepthImage, "<f4", rerun.ChannelDatatype.F32),
            "segmentation": (rerun.SegmentationImage, "<i4", rerun.ChannelDatatype.I32),
        }[kind]
        colours = rerun.ColorModel.RGB if kind == "rgb" else None
        height, width = values.shape[1:3]
        image = rerun.components.ImageFormat(width=width, height=height, channel_datatype=channel, color_model=colours)
        buffers = [np.ascontiguousarray(each, dtype).tobytes() for each in values]
        self._send(entity, seconds, episode, archetype.columns(buffer=buffers, format=[image] * len(buffers)))

    def _send(self, entity: str, seconds: NDArray[np.float64], episode: int, columns: Any) -> None:
        column = self._rerun.TimeColumn
        times = [column("time", duration=seconds), column("episode", sequence=np.full(len(seconds), episode))]
        self._stream.send_columns(entity, indexes=times, columns=columns)
