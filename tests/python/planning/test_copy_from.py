"""One world of a simulation copied into all worlds of another: across daemons, processes and observers."""

from __future__ import annotations

import subprocess
import sys
import time

import numpy as np
import pytest

import tightloop as tl

WORLDS = 37
FIELDS = ("joint_q", "joint_qd", "joint_f")


@pytest.fixture
def plant(pendulum):
    """Three worlds, each on a way of its own."""
    with tl.launch(pendulum, worlds=3, fields=FIELDS) as sim:
        for frame in range(5):
            sim.step(joint_f=np.array([[0.1, 0.0], [0.0, 0.2], [-0.3, 0.1]]) * (frame + 1))
        yield sim


@pytest.fixture
def plan(pendulum):
    with tl.launch(pendulum, worlds=WORLDS, fields=FIELDS) as sim:
        yield sim


def assert_copies(frame: tl.Frame, of: tl.Frame | tl.FrameCopy, world: int) -> None:
    for name in (*FIELDS, "time", "step", "status"):
        expected = np.repeat(getattr(of, name)[world : world + 1], len(frame.status), axis=0)
        assert np.array_equal(getattr(frame, name), expected), name


@pytest.mark.parametrize("world", [0, 2])
def test_all_worlds_continue_with_the_bits_of_the_copied_one(plant, plan, world):
    assert_copies(plan.copy_from(plant, world), plant.forward(), world)
    for _ in range(6):
        # the copy holds the commands, too
        plant.step()
        plan.step()
    ahead = plant.step()
    assert_copies(plan.step(), ahead, world)
    assert not np.array_equal(ahead.joint_q[0], ahead.joint_q[2])


def test_only_the_worlds_of_the_mask_are_copied(plant, plan):
    before = plan.step(joint_f=np.ones(2)).copy()
    mask = np.arange(WORLDS) % 2 == 1
    frame = plan.copy_from(plant, 1, mask=mask)
    assert np.array_equal(frame.joint_q[mask], np.repeat(plant.forward().joint_q[1:2], mask.sum(), axis=0))
    assert np.array_equal(frame.joint_q[~mask], before.joint_q[~mask])
    with pytest.raises(tl.CommandRefused, match="copy_from: mask: expected shape"):
        plan.copy_from(plant, mask=mask[:3])


def test_snapshots_and_frames_of_observers_are_copied(plant, plan):
    held, snapshot = plant.forward().copy(), plant.snapshot()
    assert_copies(plan.copy_from(snapshot, 1), held, 1)
    seen = plant.latest(1.0)
    assert seen is not None and seen.step[0] <= held.step[0]
    assert_copies(plan.copy_from(seen.copy(), 2), seen, 2)
    assert_copies(plan.copy_from(seen, 1), seen, 1)


def test_a_simulation_that_another_process_controls_is_copied_by_its_latest_frame(plan, pendulum, unique, tmp_path):
    name = unique()
    with tl.launch(pendulum, worlds=2, fields=FIELDS, name=name) as plant:
        plant.release()
        # takes control, and holds it until its input ends
        program = f"import tightloop as tl; sim = tl.attach({name!r}); sim.step(joint_f=[0.5, 0.1]); print(1); input()"
        other = subprocess.Popen(
            [sys.executable, "-c", program + "; sim.step()"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        try:
            assert other.stdout is not None and other.stdout.readline() == "1\n"
            before = plan.forward().copy()
            with pytest.raises(tl.LeaseHeld, match=rf"copy_from: `{name}`.*latest\(\)"):
                plan.copy_from(plant)
            assert np.array_equal(plan.forward().joint_q, before.joint_q)
            frame = latest(plant, step=1)
            assert_copies(plan.copy_from(frame, 1), frame.copy(), 1)
        finally:
            other.communicate("\n", timeout=20)
        assert other.returncode == 0


def latest(sim: tl.Sim, step: int) -> tl.Frame:
    """The observer's frame of a step, which comes within a second."""
    end = time.monotonic() + 10.0
    while time.monotonic() < end:
        frame = sim.latest(1.0)
        if frame is not None and frame.step[0] >= step:
            return frame
    raise AssertionError("no observer's frame in 10 s")


def test_a_planner_copies_by_name_from_another_process(plant, pendulum, unique):
    name = unique()
    with tl.launch(pendulum, worlds=1, fields=FIELDS, name=name) as robot:
        robot.step(joint_f=np.array([0.4, 0.0]))
        expected = robot.forward().joint_q[0].tolist()
        robot.release()
        program = (
            "import sys, tightloop as tl\n"
            f"scene = tl.Scene.from_toml({robot.info['scene']!r}, {robot.info['scene_folder']!r})\n"
            "with tl.launch(scene, worlds=5, fields=('joint_q',)) as plan:\n"
            f"    print(plan.copy_from(tl.attach({name!r})).joint_q.tolist())"
        )
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert done.stdout == f"{[expected] * 5}\n"


def test_what_does_not_fit_is_refused_with_both_names_and_no_world_changes(plant, plan, pendulum):
    before = plan.step(joint_f=np.ones(2)).copy()

    def refused(error: type[Exception], match: str, source: object = plant, **arguments: object) -> None:
        with pytest.raises(error, match=match):
            plan.copy_from(source, **arguments)  # pyright: ignore[reportArgumentType]
        assert np.array_equal(plan.forward().joint_q, before.joint_q)

    refused(tl.ArgumentError, r"world is 3; the source has worlds 0 to 2", world=3)
    refused(tl.ArgumentError, r"world is -1", world=-1)
    refused(tl.ArgumentError, r"world is 0\.5", world=0.5)
    refused(tl.ArgumentError, r"source is str; give a Sim", "plant")
    refused(tl.ArgumentError, r"frame without `state`; give one of `Sim.latest`", plant.forward())
    with tl.launch(pendulum, worlds=1, precision="f64") as other:
        refused(tl.SnapshotError, rf"`{other.name}` is f64, `{plan.name}` f32; launch both", other)
        refused(tl.SnapshotError, "64 bits", other.snapshot())
    with tl.launch(pendulum, worlds=1, params=("gravity",)) as other:
        refused(tl.SnapshotError, rf"`{other.name}` and `{plan.name}`: gravity varies in one", other)
    pendulum.substeps = 3
    with tl.launch(pendulum, worlds=1) as other:
        refused(tl.SnapshotError, rf"`{other.name}` and `{plan.name}` have other models; .*substeps", other)
    plan.send()
    with pytest.raises(tl.CommandRefused):
        plan.copy_from(plant)
    plan.recv()
    plan.copy_from(plant)


def test_a_faulted_world_is_copied_as_faulted(plant, plan):
    blow = np.zeros((3, 2))
    blow[1] = np.finfo(np.float32).max / 10
    assert plant.step(joint_f=blow).status.tolist() == [0, 1, 0]
    assert (plan.copy_from(plant, 1).status == 1).all()
    assert not plan.copy_from(plant, 0).status.any()
