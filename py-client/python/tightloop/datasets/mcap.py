"""MCAP files with messages that Foxglove shows: joint states, transforms of links, images, and arrays of numbers.

Each world has topics of its own, such as ``/world_0/joint_states``. Messages are JSON. Their time counts from the
beginning of the recording.
"""

from __future__ import annotations

import base64
import contextlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.datasets import libraries
from tightloop.datasets.choices import Layout
from tightloop.datasets.images import camera_name, image_kind
from tightloop.datasets.mcap_schemas import SCHEMAS
from tightloop.datasets.reading import Episode
from tightloop.datasets.timed import observed
from tightloop.datasets.writers import part_of, put_in_place, remove, writing

# Messages of a chunk, uncompressed [bytes].
_CHUNK = 4 << 20
_ENCODINGS = {"rgb": ("rgb8", 3), "depth": ("32FC1", 4), "segmentation": ("32FC1", 4)}

Message = dict[str, Any]


class McapWriter:
    """Writes episodes as messages of topics per world.

    Args:
        out: The file.
        chosen: What the episodes have in common.
        task: What the robot does, in words.
    """

    def __init__(self, out: Path, chosen: Layout, task: str) -> None:
        library: Any = libraries.load("mcap.writer")
        self._out, self._layout = out, chosen
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._sequences: dict[int, int] = {}
        self._joints = _joints(chosen)
        with writing(out):
            self._file = part_of(out).open("xb")
            self._writer = library.Writer(self._file, chunk_size=_CHUNK)
            self._writer.start(profile="", library="tightloop")
            about = {"task": task, "fps": repr(chosen.fps), "scene": chosen.info["scene"]}
            self._writer.add_metadata("tightloop", about)

    def add(self, episode: Episode) -> None:
        """Add the messages of an episode."""
        seconds, fields = observed(episode, self._layout)
        at = np.rint(seconds * 1e9).astype(np.int64)
        topic = f"/world_{episode.world}"
        with writing(self._out):
            about = {"index": episode.index, "world": episode.world, "steps": episode.steps, "ends": episode.ends}
            self._put(f"{topic}/episode", "tightloop.Episode", at[:1], iter([about]), {})
            for name, schema, messages, metadata in self._topics(fields):
                self._put(f"{topic}/{name}", schema, at, messages, metadata)
            names = {"names": json.dumps(self._layout.action_names)}
            self._put(f"{topic}/action", "tightloop.Values", at, _values(episode.actions), names)
            # a step's reward is there once it is done
            self._put(f"{topic}/reward", "tightloop.Values", at[1:], _values(episode.rewards), {})

    def commit(self) -> None:
        """Let the unfinished file have all episodes so far."""
        with writing(self._out):
            self._writer.flush()
            self._file.flush()

    def close(self) -> None:
        """Finish the file, and give it its name."""
        with writing(self._out):
            self._writer.finish()
            self._file.close()
            put_in_place(self._out)

    def discard(self) -> None:
        """End without a file, and remove the unfinished one."""
        with contextlib.suppress(OSError):
            self._file.close()
        remove(part_of(self._out))

    def _topics(
        self, fields: Mapping[str, NDArray[Any]]
    ) -> Iterator[tuple[str, str, Iterator[Message], dict[str, str]]]:
        """Return the topics of observations: name, schema, messages and metadata."""
        if self._joints and "joint_q" in fields:
            yield "joint_states", "sensor_msgs/msg/JointState", self._joint_states(fields), {}
        for field, values in fields.items():
            columns = self._layout.columns[field]
            if kind := image_kind(field):
                yield f"{kind}/{camera_name(field)}", "foxglove.RawImage", _images(kind, field, values), {}
            elif field == "body_q":
                yield "transforms", "foxglove.FrameTransforms", _transforms(columns, values), {}
            else:
                names = {"names": json.dumps(columns), "shape": json.dumps(values.shape[1:])}
                yield field, "tightloop.Values", _values(values), names

    def _joint_states(self, fields: Mapping[str, NDArray[Any]]) -> Iterator[Message]:
        names = list(self._joints)
        coords, dofs = np.asarray([*self._joints.values()]).T
        positions = fields["joint_q"][:, coords]
        velocities = fields["joint_qd"][:, dofs] if "joint_qd" in fields else np.zeros((len(positions), 0))
        for position, velocity in zip(positions.tolist(), velocities.tolist(), strict=True):
            yield {"name": names, "position": position, "velocity": velocity, "effort": []}

    def _put(
        self, topic: str, schema: str, at: NDArray[np.int64], messages: Iterator[Message], metadata: dict[str, str]
    ) -> None:
        channel = self._channel(topic, schema, metadata)
        stamped = schema not in ("sensor_msgs/msg/JointState", "foxglove.FrameTransforms")
        for time, message in zip(at.tolist(), messages, strict=False):
            seconds, nanoseconds = divmod(time, 10**9)
            if stamped:
                message["timestamp"] = {"sec": seconds, "nsec": nanoseconds}
            elif schema == "foxglove.FrameTransforms":
                for transform in message["transforms"]:
                    transform["timestamp"] = {"sec": seconds, "nsec": nanoseconds}
            else:
                message["header"] = {"stamp": {"sec": seconds, "nanosec": nanoseconds}, "frame_id": "world"}
            sequence = self._sequences[channel] = self._sequences.get(channel, -1) + 1
            data = json.dumps(message, separators=(",", ":")).encode()
            self._writer.add_message(channel, log_time=time, publish_time=time, sequence=sequence, data=data)

    def _channel(self, topic: str, schema: str, metadata: dict[str, str]) -> int:
        if schema not in self._schemas:
            data = json.dumps(SCHEMAS[schema]).encode()
            self._schemas[schema] = self._writer.register_schema(name=schema, encoding="jsonschema", data=data)
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(
                topic=topic, message_encoding="json", schema_id=self._schemas[schema], metadata=metadata
            )
        return self._channels[topic]


def _joints(chosen: Layout) -> dict[str, tuple[int, int]]:
    """Return the joints of one coordinate by name, each with its coordinate and its dof."""
    coords, dofs = chosen.columns["joint_q"], chosen.columns["joint_qd"]
    return {name: (coords.index(name), dofs.index(name)) for name in coords if name in dofs and coords.count(name) == 1}


def _values(values: NDArray[Any]) -> Iterator[Message]:
    for row in values.reshape(len(values), -1).tolist():
        yield {"values": row}


def _transforms(bodies: tuple[str, ...], values: NDArray[Any]) -> Iterator[Message]:
    for poses in values.tolist():
        yield {
            "transforms": [
                {
                    "parent_frame_id": "world",
                    "child_frame_id": body,
                    "translation": dict(zip("xyz", pose[:3], strict=True)),
                    "rotation": dict(zip("xyzw", pose[3:], strict=True)),
                }
                for body, pose in zip(bodies, poses, strict=True)
            ]
        }


def _images(kind: str, field: str, values: NDArray[Any]) -> Iterator[Message]:
    encoding, pixel = _ENCODINGS[kind]
    # Foxglove has no images of 32-bit integers; labels are whole numbers that float32 has
    pixels = values if kind == "rgb" else values.astype("<f4")
    for image in pixels:
        yield {
            "frame_id": camera_name(field),
            "width": image.shape[1],
            "height": image.shape[0],
            "encoding": encoding,
            "step": image.shape[1] * pixel,
            "data": base64.b64encode(image.tobytes()).decode(),
        }
