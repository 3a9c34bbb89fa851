"""HDF5 files of exports, read back by h5py as robomimic reads them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import recorded_run
from recorded_run import LENGTHS, WORLDS, opened

from tightloop.datasets import episodes, export
from tightloop.datasets.hdf5 import Hdf5Writer

run = recorded_run.run


def test_a_file_has_robomimics_layout_and_the_episodes(run, tmp_path):
    out = tmp_path / "demos.hdf5"
    made = export(run.path, out, to="hdf5", fields=["joint_q", "body_q"], task="swing")
    assert (made.path, made.episodes, made.steps, made.notes) == (out, 9, sum(LENGTHS) * WORLDS, ())
    assert [path.name for path in tmp_path.iterdir()] == ["demos.hdf5"]
    with opened(out) as file:
        data = file["data"]
        assert data.attrs["total"] == made.steps
        about = json.loads(data.attrs["env_args"])
        assert about["env_name"] == "swing" and about["env_kwargs"]["fps"] == 60 and about["type"] == 2
        assert set(data) == {f"demo_{index}" for index in range(9)}
        for each in episodes(run.path, fields=["joint_q", "body_q"]):
            demo = data[f"demo_{each.index}"]
            assert set(demo) == {"actions", "states", "rewards", "dones", "obs", "next_obs"}
            assert demo.attrs["num_samples"] == each.steps and demo.attrs["world"] == each.world
            np.testing.assert_array_equal(demo["actions"], each.actions)
            np.testing.assert_array_equal(demo["states"], each.states)
            np.testing.assert_array_equal(demo["dones"], [0] * (each.steps - 1) + [1])
            np.testing.assert_array_equal(demo["rewards"], np.zeros(each.steps))
            for field in ("joint_q", "body_q"):
                np.testing.assert_array_equal(demo["obs"][field], each.observations[field])
                np.testing.assert_array_equal(demo["next_obs"][field], each.next_observations[field])
            assert list(demo["obs/joint_q"].attrs["names"]) == ["arm/shoulder", "arm/elbow"]
            assert list(demo["actions"].attrs["names"]) == ["arm/shoulder", "arm/elbow"]


def test_images_are_named_and_shaped_as_robomimic_expects_them(run, tmp_path):
    chosen, made = recorded_run.with_images(run)
    writer = Hdf5Writer(tmp_path / "demos.h5", chosen, "look")
    for each in made:
        writer.add(each)
    writer.close()
    with opened(tmp_path / "demos.h5") as file:
        for each in made:
            obs = file[f"data/demo_{each.index}/obs"]
            assert set(obs) == {"joint_q", "wrist_image", "wrist_depth", "wrist_segmentation"}
            np.testing.assert_array_equal(obs["wrist_image"], each.observations["wrist_rgb"])
            np.testing.assert_array_equal(obs["wrist_depth"][..., 0], each.observations["wrist_depth"])
            np.testing.assert_array_equal(obs["wrist_segmentation"][..., 0], each.observations["wrist_segmentation"])
            assert obs["wrist_image"].dtype == np.uint8 and obs["wrist_depth"].shape == (each.steps, 4, 6, 1)


def test_rewards_and_dones_come_from_functions_or_arrays(run, tmp_path):
    def upright(episode):
        return -np.abs(episode.next_observations["joint_q"][:, 0])

    kept = [np.arange(steps) == 1 for steps in LENGTHS]
    export(run.path, tmp_path / "demos.hdf5", to="hdf5", worlds=1, rewards=upright, dones=kept)
    with opened(tmp_path / "demos.hdf5") as file:
        for each, dones in zip(episodes(run.path, worlds=1), kept, strict=True):
            demo = file[f"data/demo_{each.index}"]
            np.testing.assert_array_equal(demo["rewards"], upright(each))
            np.testing.assert_array_equal(demo["dones"], dones)


def test_a_commit_shows_all_episodes_so_far_while_the_file_is_written_on(run, tmp_path):
    chosen, made = recorded_run.with_images(run)
    out = tmp_path / "demos.hdf5"
    writer = Hdf5Writer(out, chosen, "look")
    part = tmp_path / "demos.part.hdf5"
    for count, each in enumerate(made, start=1):
        writer.add(each)
        writer.commit()
        assert not out.exists()
        with opened(part) as file:
            assert len(file["data"]) == count
            last = file[f"data/demo_{each.index}/obs/wrist_image"][:]
        np.testing.assert_array_equal(last, each.observations["wrist_rgb"])
    writer.close()
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    with opened(out) as file:
        assert len(file["data"]) == len(made)


def test_an_error_leaves_no_file(run, tmp_path: Path):
    def broken(episode):
        if episode.index == 4:
            raise RuntimeError("no reward")
        return np.zeros(episode.steps)

    try:
        export(run.path, tmp_path / "demos.hdf5", to="hdf5", rewards=broken)
    except RuntimeError as problem:
        assert str(problem) == "no reward"
    assert not list(tmp_path.iterdir())
