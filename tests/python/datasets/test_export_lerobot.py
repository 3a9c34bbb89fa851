"""LeRobot datasets of exports: files by pyarrow, and all of it by LeRobot's own library where that is installed."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
import recorded_run
from PIL import Image
from pyarrow import parquet
from recorded_run import LENGTHS, WORLDS

from tightloop.datasets import episodes, export
from tightloop.datasets.lerobot import LeRobotWriter
from tightloop.datasets.lerobot_features import arrays_of_episode
from tightloop.datasets.lerobot_stats import QUANTILES, merge, stats_of_episode

run = recorded_run.run
STEPS = sum(LENGTHS) * WORLDS


@pytest.fixture
def dataset(run, tmp_path) -> Path:
    out = tmp_path / "swing"
    export(
        run.path, out, to="lerobot", fields=["joint_q", "joint_qd", "kinetic_energy", "body_q"], task="swing the arm"
    )
    return out


@pytest.fixture
def with_images(run, tmp_path) -> Path:
    chosen, made = recorded_run.with_images(run)
    writer = LeRobotWriter(tmp_path / "looks", chosen, "look")
    for place, each in enumerate(made):
        writer.add(each)
        # several files of each kind
        if place % 4 == 3:
            writer.commit()
    writer.close()
    return tmp_path / "looks"


def test_a_folder_has_the_files_of_version_3(dataset, tmp_path):
    assert [path.name for path in tmp_path.iterdir()] == ["swing"]
    files = sorted(str(path.relative_to(dataset)) for path in dataset.rglob("*") if path.is_file())
    assert files == [
        "data/chunk-000/file-000.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
    ]
    info = json.loads((dataset / "meta/info.json").read_text())
    assert info["codebase_version"] == "v3.0" and info["robot_type"] == "arm" and info["fps"] == 60
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (9, STEPS, 1)
    assert info["splits"] == {"train": "0:9"}
    state = info["features"]["observation.state"]
    assert state["dtype"] == "float32" and state["shape"] == [4]
    assert state["names"] == [
        "arm/shoulder.joint_q",
        "arm/elbow.joint_q",
        "arm/shoulder.joint_qd",
        "arm/elbow.joint_qd",
    ]
    assert info["features"]["action"] == {"dtype": "float32", "shape": [2], "names": ["arm/shoulder", "arm/elbow"]}
    assert info["features"]["observation.body_q"]["shape"] == [3, 7]


def test_steps_and_episodes_are_those_of_the_recording(run, dataset):
    steps = parquet.read_table(dataset / "data/chunk-000/file-000.parquet").to_pydict()
    rows = parquet.read_table(dataset / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert steps["index"] == list(range(STEPS))
    for each, row in zip(episodes(run.path, fields=["joint_q", "joint_qd"]), rows, strict=True):
        first, end = row["dataset_from_index"], row["dataset_to_index"]
        assert (row["episode_index"], row["length"], end - first) == (each.index, each.steps, each.steps)
        assert row["tasks"] == ["swing the arm"] and row["world"] == each.world
        state = np.concatenate([each.observations["joint_q"], each.observations["joint_qd"]], axis=1)
        np.testing.assert_array_equal(np.float32(steps["observation.state"][first:end]), state)
        np.testing.assert_array_equal(np.float32(steps["action"][first:end]), each.actions)
        np.testing.assert_array_equal(steps["next.done"][first:end], each.dones)
        np.testing.assert_array_equal(steps["frame_index"][first:end], np.arange(each.steps))
        np.testing.assert_allclose(steps["timestamp"][first:end], each.times, rtol=1e-6)


def test_statistics_are_those_of_all_steps(dataset):
    stats = json.loads((dataset / "meta/stats.json").read_text())
    steps = parquet.read_table(dataset / "data/chunk-000/file-000.parquet").to_pydict()
    for name in ("observation.state", "action", "observation.kinetic_energy"):
        rows = np.float64(steps[name]).reshape(STEPS, -1)
        for key, expected in (
            ("min", rows.min(0)),
            ("max", rows.max(0)),
            ("mean", rows.mean(0)),
            ("std", rows.std(0)),
        ):
            np.testing.assert_allclose(stats[name][key], expected, rtol=1e-9, atol=1e-12)
        assert stats[name]["count"] == [STEPS]
        assert np.shape(stats[name]["q50"]) == (rows.shape[1],)


def test_statistics_of_images_are_per_channel():
    images = recorded_run.made_images(6, 1)
    stats = stats_of_episode(
        {"observation.images.wrist": images["wrist_rgb"], "observation.depth.wrist": images["wrist_depth"]}
    )
    colours = stats["observation.images.wrist"]
    np.testing.assert_allclose(colours["mean"][:, 0, 0], images["wrist_rgb"].mean((0, 1, 2)) / 255, rtol=1e-6)
    assert colours["std"].shape == (3, 1, 1) and list(colours["count"]) == [6]
    depths = stats["observation.depth.wrist"]
    assert depths["max"].shape == (1, 1) and depths["max"][0, 0] == images["wrist_depth"].max()
    assert set(QUANTILES) < set(depths)
    assert merge(stats, stats)["observation.images.wrist"]["count"] == [12]


def test_images_are_png_files_of_the_same_colours(run, with_images):
    files = sorted((with_images / "data").rglob("*.parquet"))
    assert len(files) == 3
    steps = [row for file in files for row in parquet.read_table(file).to_pylist()]
    _, made = recorded_run.with_images(run)
    images = np.concatenate([each.observations["wrist_rgb"] for each in made])
    depths = np.concatenate([each.observations["wrist_depth"] for each in made])
    for row, image, depth in zip(steps, images, depths, strict=True):
        with Image.open(io.BytesIO(row["observation.images.wrist"]["bytes"])) as read:
            np.testing.assert_array_equal(np.asarray(read), image)
        np.testing.assert_array_equal(np.float32(row["observation.depth.wrist"]), depth)


def test_lerobots_own_library_reads_the_steps(run, dataset):
    library = pytest.importorskip(
        "lerobot.datasets.lerobot_dataset", reason="lerobot is not installed: `make test-lerobot` does"
    )
    read = library.LeRobotDataset("tightloop/swing", root=dataset)
    assert (read.num_episodes, read.num_frames, read.fps) == (9, STEPS, 60)
    assert read.meta.stats["action"]["mean"].shape == (2,)
    for each in episodes(run.path, fields=["joint_q", "joint_qd", "kinetic_energy", "body_q"]):
        first = read.meta.episodes[each.index]["dataset_from_index"]
        for step in range(each.steps):
            item = read[first + step]
            assert item["task"] == "swing the arm"
            np.testing.assert_array_equal(item["action"].numpy(), each.actions[step])
            np.testing.assert_array_equal(item["observation.state"][:2].numpy(), each.observations["joint_q"][step])
            np.testing.assert_array_equal(item["observation.body_q"].numpy(), each.observations["body_q"][step])
            assert item["observation.kinetic_energy"].item() == each.observations["kinetic_energy"][step]
            assert bool(item["next.done"]) == each.dones[step]


def test_lerobots_own_library_reads_images_and_windows_of_steps(run, with_images):
    library = pytest.importorskip(
        "lerobot.datasets.lerobot_dataset", reason="lerobot is not installed: `make test-lerobot` does"
    )
    chosen, made = recorded_run.with_images(run)
    read = library.LeRobotDataset(
        "tightloop/looks", root=with_images, delta_timestamps={"action": [0, 1 / 60], "observation.images.wrist": [0]}
    )
    assert read.meta.camera_keys == ["observation.images.wrist"]
    places = iter(range(len(read)))
    for each in made:
        for step in range(each.steps):
            item = read[next(places)]
            pixels = item["observation.images.wrist"][0].numpy().transpose(1, 2, 0) * 255
            np.testing.assert_allclose(pixels, each.observations["wrist_rgb"][step], atol=1e-3)
            np.testing.assert_array_equal(
                item["observation.depth.wrist"].numpy(), each.observations["wrist_depth"][step]
            )
            following = min(step + 1, each.steps - 1)
            np.testing.assert_array_equal(item["action"][1].numpy(), each.actions[following])
            assert bool(item["action_is_pad"][1]) == (step == each.steps - 1)
    assert next(places, None) is None
    assert set(arrays_of_episode(made[0], chosen)) < set(read.features)
