"""`tightloop export`: what it prints and writes, and what it says of wrong choices."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import recorded_run
from recorded_run import LENGTHS, WORLDS, opened

import tightloop as tl
from tightloop import datasets
from tightloop.datasets import episodes, export

run = recorded_run.run


def command(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, "-m", "tightloop", "export", *map(str, arguments)]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(("to", "name"), [("hdf5", "a.h5"), ("lerobot", "a"), ("mcap", "a.mcap"), ("rerun", "a.rrd")])
def test_each_format_is_written(run, tmp_path, to, name):
    done = command(run.path, tmp_path / name, "--to", to)
    assert done.returncode == 0 and not done.stderr, done.stderr
    assert done.stdout == f"{tmp_path / name}: 9 episodes, {sum(LENGTHS) * WORLDS} steps\n"
    assert (tmp_path / name).exists()


def test_choices_are_those_of_the_function(run, tmp_path):
    out = tmp_path / "demos.hdf5"
    chosen = ["--fields", "body_q", "--action", "joint_f", "--joints", "arm/el*", "--worlds", "0,2", "--fps", "30"]
    done = command(run.path, out, "--to", "hdf5", *chosen, "--min-steps", "5", "--task", "swing")
    assert done.returncode == 0, done.stderr
    choices: dict[str, Any] = {"fields": ["body_q"], "joints": ["arm/el*"], "worlds": [0, 2], "fps": 30, "min_steps": 5}
    with opened(out) as file:
        made = list(episodes(run.path, **choices))
        assert len(made) == len(file["data"]) == 4
        for each in made:
            demo = file[f"data/demo_{each.index}"]
            np.testing.assert_array_equal(demo["obs/body_q"], each.observations["body_q"])
            np.testing.assert_array_equal(demo["actions"], each.actions)
            assert each.actions.shape[1] == 1


def test_wrong_usage_ends_with_2(run, tmp_path):
    done = command(run.path, tmp_path / "a.h5")
    assert done.returncode == 2 and "--to" in done.stderr
    done = command(run.path, tmp_path / "a.h5", "--to", "hdf5", "--worlds", "3-1")
    assert done.returncode == 2 and "'3-1' are no worlds; give them as 0-7,12" in done.stderr


@pytest.mark.parametrize(
    ("choices", "error", "said"),
    [
        ({"to": "hdf"}, tl.ArgumentError, r"to is 'hdf'; did you mean .*hdf5"),
        ({"fields": ["joint_qq"]}, tl.UnknownField, r"fields has 'joint_qq'; did you mean .*joint_q"),
        ({"fields": ["wrist_rgb"]}, tl.UnknownField, r"fields has 'wrist_rgb'; there are"),
        ({"fields": []}, tl.ArgumentError, r"fields is empty; give at least one name"),
        ({"fields": "joint_q"}, tl.ArgumentError, r"fields is 'joint_q'; give a list of names"),
        ({"worlds": [1, 3]}, tl.ArgumentError, r"worlds has 3, and there are 3 in the recording, from 0 on"),
        ({"worlds": 4}, tl.ArgumentError, r"worlds has 3, and there are 3"),
        ({"worlds": []}, tl.ArgumentError, r"worlds is empty"),
        ({"worlds": 1.5}, tl.ArgumentError, r"worlds is 1\.5; give how many, or a list of them"),
        ({"worlds": "ab"}, tl.ArgumentError, r"an entry of worlds is 'a'; give a whole number"),
        ({"worlds": [-1]}, tl.ArgumentError, r"an entry of worlds is -1; it must be at least 0"),
        ({"task": 3}, tl.ArgumentError, r"task is 3; give a string"),
        ({"action": 3}, tl.ArgumentError, r"action is 3; give a list of names"),
        ({"min_steps": 0}, tl.ArgumentError, r"min_steps is 0; it must be at least 1"),
        ({"rewards": 3}, tl.ArgumentError, r"rewards is 3; give a function, or an array for each episode"),
        ({"action": "joint_q"}, tl.ArgumentError, r"action has 'joint_q', which is no command; .*joint_f"),
        ({"joints": ["wrist"]}, tl.ArgumentError, r"joints has 'wrist', which the action has not; .*arm/shoulder"),
        (
            {"fps": 25},
            tl.ArgumentError,
            r"fps is 25, of which the control rate, 60, is no multiple; give one such as 20",
        ),
        ({"fps": 0}, tl.ArgumentError, r"fps is 0.* must be above 0|fps"),
        ({"min_steps": 100}, tl.ArgumentError, r"has no episode of 100 or more steps; nothing is written"),
        ({"rewards": lambda _: [0.0]}, tl.ArgumentError, r"rewards of episode 0 has shape \(1,\); give \(5,\)"),
        ({"dones": [[True] * 5]}, tl.ArgumentError, r"dones has 1 arrays, and there are more episodes"),
    ],
)
def test_a_wrong_choice_is_named_with_the_cure(run, tmp_path, choices, error, said):
    with pytest.raises(error, match=said):
        export(run.path, tmp_path / "a.h5", **({"to": "hdf5"} | choices))
    assert not list(tmp_path.iterdir())


def test_a_wrong_place_is_named_with_the_cure(run, tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    with pytest.raises(tl.ArgumentError, match=r"there, which is there already; remove it, or give another name"):
        export(run.path, there, to="lerobot")
    with pytest.raises(
        tl.ArgumentError, match=r"out is 'a\.txt'; give a file of format 'hdf5' a name in \.hdf5 or \.h5"
    ):
        export(run.path, tmp_path / "a.txt", to="hdf5")
    with pytest.raises(tl.ArgumentError, match=r"there is no folder .*nowhere; make it first"):
        export(run.path, tmp_path / "nowhere/a.mcap", to="mcap")
    done = command(tmp_path / "none.tlrec", tmp_path / "a.rrd", "--to", "rerun")
    assert done.returncode == 1 and "none.tlrec: cannot be read" in done.stderr
    (tmp_path / "text.tlrec").write_text("no recording")
    with pytest.raises(tl.RecordingError, match=r"text\.tlrec"):
        export(tmp_path / "text.tlrec", tmp_path / "a.rrd", to="rerun")


def test_a_missing_library_is_named_with_its_extra(run, tmp_path, monkeypatch):
    for to, name, module in (
        ("hdf5", "a.h5", "h5py"),
        ("lerobot", "a", "pyarrow"),
        ("mcap", "a.mcap", "mcap.writer"),
        ("rerun", "a.rrd", "rerun"),
    ):
        with monkeypatch.context() as patch:
            patch.setitem(sys.modules, module, None)
            with pytest.raises(tl.MissingLibrary, match=rf"export needs `{module}`: run `pip install .*\[data\]"):
                export(run.path, tmp_path / name, to=to)
    assert not list(tmp_path.iterdir())


def test_a_recording_without_commands_asks_for_the_action(run, tmp_path):
    scene = tl.Scene()
    scene.add_urdf(run.path.parent / "pendulum.urdf", name="arm")
    path = tmp_path / "still.tlrec"
    with tl.launch(scene, worlds=1) as sim, sim.record(path):
        sim.step()
    with pytest.raises(tl.ArgumentError, match=r"no client sent a command .* name the action, one of joint_f"):
        export(path, tmp_path / "a.h5", to="hdf5")
    assert export(path, tmp_path / "a.h5", to="hdf5", action="joint_f").steps == 1


def test_an_unknown_name_of_the_module_is_answered_with_the_nearest():
    with pytest.raises(tl.UnknownAttribute, match=r"no attribute `exports`; did you mean .*export"):
        _ = datasets.exports
    assert dir(datasets) == ["Episode", "Export", "episodes", "export"]
