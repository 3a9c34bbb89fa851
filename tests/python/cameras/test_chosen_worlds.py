"""Cameras that see some worlds alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop import _core
from tightloop.view.source import Live

WORLDS = 6


def scene_seen_in(worlds: Any, every: int = 1) -> tl.Scene:
    """A ball that falls from elsewhere in each world, below a camera of these worlds and another one of all."""
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_ground()
    scene.add_body(name="ball", pos=(0, 0, 1))
    scene.add_sphere(body="ball", radius=0.2)
    scene.randomize(body_q={"ball": {"x": tl.Uniform(-0.3, 0.3)}})
    above = {"pos": (0, 0, 3), "target": (0, 0, 0), "width": 16, "height": 8}
    scene.add_camera(**above, worlds=worlds, every=every, depth_noise=(0.01, 0.0), name="eye")
    scene.add_camera(**above, name="other")
    return scene


FIELDS = ("joint_q", "eye_depth", "eye_segmentation", "eye_rgb", "other_depth")


def images(frame: Any) -> list[np.ndarray[Any, Any]]:
    return [frame.eye_depth.copy(), frame.eye_segmentation.copy(), frame.eye_rgb.copy()]


def shown(worlds: Any, every: int = 1, **options: Any) -> list[list[np.ndarray[Any, Any]]]:
    mask = np.array([False, True, True, False, False, True])
    with tl.launch(scene_seen_in(worlds, every), worlds=WORLDS, fields=FIELDS, **options) as sim:
        frames = [images(sim.reset(seed=np.arange(WORLDS))), *(images(sim.step()) for _ in range(5))]
        assert sim.forward().other_depth.any(axis=(1, 2)).all()
        return [*frames, images(sim.reset(mask=mask)), images(sim.step())]


@pytest.mark.parametrize("chosen", [[4, 1, 4], range(2), [5]])
@pytest.mark.parametrize("every", [1, 2])
def test_chosen_worlds_have_their_images_and_the_others_zeros(chosen: Any, every: int) -> None:
    is_chosen = np.isin(np.arange(WORLDS), chosen)
    everywhere = shown(None, every)
    for threads in (1, 2):
        for some, whole in zip(shown(chosen, every, threads=threads), everywhere, strict=True):
            for ours, expected in zip(some, whole, strict=True):
                assert ours[is_chosen].tobytes() == expected[is_chosen].tobytes()
                assert not ours[~is_chosen].any() and expected[~is_chosen].any()


def test_numbers_of_worlds_go_on_through_groups(tmp_path: Path) -> None:
    file = tmp_path / "second.tlrec"
    everywhere = shown(None)[0]
    with tl.launch(scene_seen_in((1, 4)), worlds=WORLDS, groups=2, threads=2, fields=FIELDS) as groups:
        seeds = np.arange(WORLDS)
        frames = [images(group.reset(seed=seeds[3 * k : 3 * k + 3])) for k, group in enumerate(groups)]
        with groups[1].record(file):
            groups[1].step()
    for plane in range(3):
        whole = np.concatenate([frame[plane] for frame in frames])
        assert [world for world in range(WORLDS) if whole[world].any()] == [1, 4]
        assert whole[[1, 4]].tobytes() == everywhere[plane][[1, 4]].tobytes()
    subprocess.run([sys.executable, "-m", "tightloop", "replay", file], check=True)


def test_a_world_that_is_not_there_is_named() -> None:
    with pytest.raises(tl.ArgumentError, match=r"eye_rgb.*sees world 6, and the last world is 5; give it other"):
        tl.launch(scene_seen_in((2, 6)), worlds=WORLDS, fields=("joint_q", "eye_rgb"))
    # without a field of its images
    with tl.launch(scene_seen_in((2, 6)), worlds=WORLDS, fields=("joint_q",)) as sim:
        sim.reset()


def test_a_recording_is_replayed_and_those_who_look_see_all_worlds(tmp_path: Path) -> None:
    file = tmp_path / "run.tlrec"
    with tl.launch(scene_seen_in((1,)), worlds=2, watch_worlds=2, fields=FIELDS) as sim, sim.record(file):
        sim.reset(seed=3)
        frame = sim.step()
        live = Live(sim.name, fields=("eye_depth",))
        try:
            seen = live.poll(10.0)
            assert seen is not None and seen.eye_depth[1].tobytes() == frame.eye_depth[1].tobytes()
            assert seen.eye_depth[0].any() and not frame.eye_depth[0].any()
        finally:
            live.close()
    subprocess.run([sys.executable, "-m", "tightloop", "replay", file], check=True)
    played = _core.Playback(str(file), 2, ["joint_q", "eye_depth"])
    shown = []
    while (arrays := played.next()) is not None:
        shown.append(arrays["eye_depth"])
    assert (
        shown[-1][1].tobytes() == seen.eye_depth[1].tobytes() and shown[-1][0].tobytes() == seen.eye_depth[0].tobytes()
    )
