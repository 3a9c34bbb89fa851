"""Datasets with images of cameras, which a replay draws."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np

import tightloop as tl
from tightloop.datasets import export


def balls() -> tl.Scene:
    scene = tl.Scene(dt=0.002, substeps=5)
    scene.add_ground()
    scene.add_body(name="ball", pos=(0, 0, 1))
    scene.add_sphere(body="ball", radius=0.2)
    scene.randomize(body_q={"ball": {"x": tl.Uniform(-0.3, 0.3)}})
    return scene


def test_a_replay_draws_the_cameras_of_the_scene_and_of_another_one(tmp_path: Path) -> None:
    scene = balls()
    own = scene.add_camera(pos=(0, -3, 0.5), target=(0, 0, 0.5), width=16, height=12, name="side")
    recording = tmp_path / "run.tlrec"
    with tl.launch(scene, worlds=3, fields=("joint_q", own.depth)) as sim, sim.record(recording):
        shown = [sim.reset(seed=2).side_depth.copy()]
        shown += [sim.step(joint_f=np.zeros(6)).side_depth.copy() for _ in range(5)]
    other = tl.Scene()
    above = other.add_camera(pos=(0, 0, 4), target=(0, 0, 0), width=40, height=32, name="above")
    out = tmp_path / "seen.hdf5"
    export(
        recording,
        out,
        to="hdf5",
        fields=("joint_q", own.depth, own.rgb, above.segmentation),
        action="joint_f",
        joints=["ball/*"],
        cameras=other,
    )
    with h5py.File(out) as file:
        for world in range(3):
            seen: Any = file[f"data/demo_{world}/obs"]
            depths = np.asarray(seen["side_depth"])
            np.testing.assert_array_equal(depths.reshape(5, 12, 16), np.stack(shown)[:5, world])
            assert np.asarray(seen["side_image"]).shape == (5, 12, 16, 3)
            labels = np.asarray(seen["above_segmentation"]).reshape(5, 32, 40)
            assert {0, 1} == set(np.unique(labels))  # the ball, and the ground
