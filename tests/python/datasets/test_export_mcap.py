"""MCAP files of exports, read back by mcap's reader."""

from __future__ import annotations

import base64
import json
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded_run
from mcap.reader import make_reader
from recorded_run import LENGTHS, WORLDS

from tightloop.datasets import episodes, export
from tightloop.datasets.mcap import McapWriter

run = recorded_run.run

Messages = dict[str, list[tuple[int, dict[str, Any]]]]


def read(path: Path) -> tuple[Messages, dict[str, str]]:
    """Messages with their times [ns], and names of schemas, by topic."""
    messages: Messages = defaultdict(list)
    schemas = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file, validate_crcs=True).iter_messages(log_time_order=False):
            assert schema is not None and channel.message_encoding == "json" and schema.encoding == "jsonschema"
            messages[channel.topic].append((message.log_time, json.loads(message.data)))
            schemas[channel.topic] = schema.name
    return messages, schemas


def test_topics_have_the_schemas_that_foxglove_knows(run, tmp_path):
    out = tmp_path / "run.mcap"
    made = export(run.path, out, to="mcap", fields=["joint_q", "joint_qd", "body_q"], worlds=[1])
    assert made.episodes == 3 and [path.name for path in tmp_path.iterdir()] == ["run.mcap"]
    _, schemas = read(out)
    assert schemas == {
        "/world_1/joint_states": "sensor_msgs/msg/JointState",
        "/world_1/transforms": "foxglove.FrameTransforms",
        "/world_1/joint_q": "tightloop.Values",
        "/world_1/joint_qd": "tightloop.Values",
        "/world_1/action": "tightloop.Values",
        "/world_1/reward": "tightloop.Values",
        "/world_1/episode": "tightloop.Episode",
    }


def test_messages_have_the_values_and_times_of_the_recording(run, tmp_path):
    fields = ["joint_q", "joint_qd", "body_q"]
    export(run.path, tmp_path / "run.mcap", to="mcap", fields=fields)
    messages, _ = read(tmp_path / "run.mcap")
    assert len(messages["/world_0/action"]) == sum(LENGTHS)
    # with the state behind the last step of each episode
    assert len(messages["/world_2/joint_states"]) == sum(LENGTHS) + len(LENGTHS)
    for topic, all_of_topic in messages.items():
        for time, message in all_of_topic:
            stamp = message.get("timestamp") or message.get("header", {}).get("stamp")
            if topic.endswith("transforms"):
                assert all(
                    each["timestamp"] == {"sec": time // 10**9, "nsec": time % 10**9} for each in message["transforms"]
                )
            else:
                assert list(stamp.values()) == [time // 10**9, time % 10**9]
    for each in episodes(run.path, fields=fields):
        first = sum(LENGTHS[: each.index // WORLDS])
        topic = f"/world_{each.world}"
        for step in range(each.steps):
            time, message = messages[f"{topic}/action"][first + step]
            assert time == round((each.begin + each.times[step]) * 1e9)
            assert message["values"] == each.actions[step].tolist()
            # one more message for each episode before
            time, joints = messages[f"{topic}/joint_states"][first + each.index // WORLDS + step]
            assert joints["name"] == ["arm/shoulder", "arm/elbow"]
            assert joints["position"] == each.observations["joint_q"][step].tolist()
            assert joints["velocity"] == each.observations["joint_qd"][step].tolist()
            _, frames = messages[f"{topic}/transforms"][first + each.index // WORLDS + step]
            poses = [[*one["translation"].values(), *one["rotation"].values()] for one in frames["transforms"]]
            assert poses == each.observations["body_q"][step].tolist()
            assert [one["child_frame_id"] for one in frames["transforms"]] == ["arm/base", "arm/upper", "arm/lower"]


def test_images_are_foxgloves(run, tmp_path):
    chosen, made = recorded_run.with_images(run)
    writer = McapWriter(tmp_path / "run.mcap", chosen, "look")
    for each in made:
        writer.add(each)
        writer.commit()
    writer.close()
    messages, schemas = read(tmp_path / "run.mcap")
    for kind, encoding, dtype in (("rgb", "rgb8", "u1"), ("depth", "32FC1", "<f4"), ("segmentation", "32FC1", "<f4")):
        assert schemas[f"/world_0/{kind}/wrist"] == "foxglove.RawImage"
        images = [message for _, message in messages[f"/world_0/{kind}/wrist"]]
        before = [image for each in made if each.world == 0 for image in each.observations[f"wrist_{kind}"]]
        # without those behind last steps
        ends = np.cumsum(np.array(LENGTHS) + 1) - 1
        images = [image for place, image in enumerate(images) if place not in ends]
        for image, pixels in zip(images, before, strict=True):
            assert (image["width"], image["height"], image["encoding"]) == (6, 4, encoding)
            data = np.frombuffer(base64.b64decode(image["data"]), dtype)
            np.testing.assert_array_equal(data.reshape(pixels.shape), pixels)
            assert image["step"] * 4 == data.nbytes


@pytest.mark.parametrize("dofs", ["joint_q", "kinetic_energy"])
def test_a_field_alone_is_enough(run, tmp_path, dofs):
    export(run.path, tmp_path / "run.mcap", to="mcap", fields=[dofs], worlds=1)
    messages, _ = read(tmp_path / "run.mcap")
    assert ("/world_0/joint_states" in messages) == (dofs == "joint_q")
    assert len(messages[f"/world_0/{dofs}"][0][1]["values"]) == (2 if dofs == "joint_q" else 1)
