"""Rerun recordings of exports, read back by rerun's own library."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as arrow
import recorded_run
from recorded_run import LENGTHS, WORLDS
from rerun.chunk import RrdReader

from tightloop.datasets import episodes, export
from tightloop.datasets.rerun import RerunWriter

run = recorded_run.run


def read(path: Path) -> dict[str, dict[str, list[Any]]]:
    """Columns by entity and name, in the order of the file; times are nanoseconds."""
    columns: dict[str, dict[str, list[Any]]] = defaultdict(lambda: defaultdict(list))
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name, values in zip(batch.schema.names, batch.columns, strict=True):
            numbers = values.cast(arrow.int64()) if arrow.types.is_duration(values.type) else values
            columns[chunk.entity_path.strip("/")][name] += numbers.to_pylist()
    return columns


def test_entities_have_the_values_and_times_of_the_recording(run, tmp_path):
    out = tmp_path / "run.rrd"
    made = export(run.path, out, to="rerun", fields=["joint_q", "body_q", "kinetic_energy"], task="swing")
    assert made.episodes == 9 and [path.name for path in tmp_path.iterdir()] == ["run.rrd"]
    columns = read(out)
    for world in range(WORLDS):
        ones = [each for each in episodes(run.path, fields=["joint_q", "body_q"], worlds=[world])]
        positions = columns[f"world_{world}/joint_q"]
        numbers = [0] * (LENGTHS[0] + 1) + [1] * (LENGTHS[1] + 1) + [2] * (LENGTHS[2] + 1)
        assert [each // WORLDS for each in positions["episode"]] == numbers
        expected = [
            row for each in ones for row in (*each.observations["joint_q"], each.next_observations["joint_q"][-1])
        ]
        np.testing.assert_array_equal(positions["Scalars:scalars"], np.array(expected, np.float64))
        times = [each.begin + np.append(each.times, each.steps * run.period) for each in ones]
        np.testing.assert_allclose(np.array(positions["time"]) / 1e9, np.concatenate(times), atol=2e-9)
        actions = columns[f"world_{world}/action"]["Scalars:scalars"]
        np.testing.assert_array_equal(actions, np.concatenate([each.actions for each in ones]))
        places = columns[f"world_{world}/body_q/arm/lower"]["Transform3D:translation"]
        poses = [
            row[2, :3] for each in ones for row in (*each.observations["body_q"], each.next_observations["body_q"][-1])
        ]
        np.testing.assert_array_equal(np.array(places)[:, 0], poses)
        assert len(columns[f"world_{world}/kinetic_energy"]["time"]) == sum(LENGTHS) + len(LENGTHS)


def test_images_are_images_of_their_kind(run, tmp_path):
    chosen, made = recorded_run.with_images(run)
    writer = RerunWriter(tmp_path / "run.rrd", chosen, "look")
    for each in made:
        writer.add(each)
    writer.close()
    columns = read(tmp_path / "run.rrd")
    for kind, archetype, dtype in (
        ("rgb", "Image", "u1"),
        ("depth", "DepthImage", "<f4"),
        ("segmentation", "SegmentationImage", "<i4"),
    ):
        buffers = columns[f"world_0/{kind}/wrist"][f"{archetype}:buffer"]
        field = f"wrist_{kind}"
        expected = [
            image
            for each in made
            if each.world == 0
            for image in (*each.observations[field], each.next_observations[field][-1])
        ]
        for (buffer,), image in zip(buffers, expected, strict=True):
            read_back = np.array(buffer, np.uint8).view(dtype).reshape(image.shape)
            np.testing.assert_array_equal(read_back, image)
