"""Worlds in groups: the bits of all together, each in lock-step by itself, and one daemon from start to end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from processes import alive, left_of, started, stems_of, wait_until

EACH, GROUPS = 7, 3
WORLDS = EACH * GROUPS
COMMAND = [sys.executable, "-m", "tightloop"]
FIELDS = ("joint_q", "joint_qd", "joint_q_measured", "joint_qdd")


@pytest.fixture
def drawn(pendulum: tl.Scene) -> tl.Scene:
    """Start, mass and noise of each world are of its own."""
    pendulum.command_delay_max = 8
    pendulum.randomize(
        joint_q={"arm": tl.Uniform(-0.5, 0.5)},
        params={
            "body_mass_scale": {"arm/lower": tl.Uniform(0.5, 2.0)},
            "joint_q_noise": {"arm": tl.Uniform(0.01, 0.1)},
            "joint_f_noise": {"arm": tl.Uniform(0.1, 0.2)},
            "command_delay": tl.Uniform(0, 8),
        },
    )
    return pendulum


def own(array: Any, group: int) -> Any:
    """The rows of a group."""
    return np.asarray(array)[group * EACH : (group + 1) * EACH]


def assert_same(frame: Any, whole: Any, group: int) -> None:
    for name in (*FIELDS, "time", "step", "status"):
        assert getattr(frame, name).tobytes() == own(getattr(whole, name), group).tobytes(), (group, name)


def begin(sim: tl.Sim, round_: int, mask: Any, seeds: Any) -> tl.Frame:
    """Worlds as they are, or after a reset of each kind."""
    if round_ == 0:
        return sim.forward()
    if round_ == 1:
        return sim.reset(mask=mask)
    return sim.reset(seed=seeds) if round_ == 2 else sim.reset(mask=~mask, seed=5)


@pytest.mark.parametrize(("device", "precision"), [("cpu", "f32"), ("cpu", "f64"), ("gpu", "f32")])
def test_each_world_does_what_it_does_without_groups(drawn, device, precision):
    rng = np.random.default_rng(1)
    made: dict[str, Any] = {"worlds": WORLDS, "device": device, "precision": precision, "fields": FIELDS}
    with tl.launch(drawn, **made) as whole, tl.launch(drawn, groups=GROUPS, **made) as groups:
        assert all(sim.device.startswith(device) for sim in groups)
        for round_ in range(4):
            mask, seeds = rng.random(WORLDS) > 0.5, rng.integers(0, 2**63, WORLDS)
            expected = begin(whole, round_, mask, seeds).copy()
            for group, sim in enumerate(groups):
                assert_same(begin(sim, round_, own(mask, group), own(seeds, group)), expected, group)
            assert len(np.unique(expected.joint_q[:, 0])) == WORLDS, "each world starts elsewhere"
            for _ in range(5):
                tau = rng.normal(size=(WORLDS, 2))
                expected = whole.step(joint_f=tau)
                for group, sim in enumerate(groups):
                    sim.send(joint_f=own(tau, group))
                for group, sim in enumerate(groups):
                    assert_same(sim.recv(), expected, group)
        for group, sim in enumerate(groups):
            assert sim.params.body_mass_scale.tobytes() == own(whole.params.body_mass_scale, group).tobytes()


def test_while_one_group_is_in_a_step_another_does_what_it_is_asked(pendulum):
    with tl.launch(pendulum, worlds=8, groups=2) as groups:
        first, second = groups
        first.send(joint_f=[0.5, 0.0])
        for n in range(20):
            assert second.step(joint_f=[-0.5, 0.0]).step.tolist() == [n + 1] * 4
        kept = second.snapshot()
        second.reset()
        second.restore(kept)
        with pytest.raises(tl.CommandRefused, match="call recv first"):
            first.forward()
        assert first.recv().step.tolist() == [1] * 4
        for n in range(50):
            for sim in groups:
                sim.send()
            # in either order
            frames = [sim.recv().step[0] for sim in (groups if n % 2 else reversed(groups))]
            assert sorted(frames) == [n + 2, n + 21]


def test_groups_are_a_sequence_that_tells_what_it_is(pendulum, unique):
    name = unique()
    with tl.launch(pendulum, worlds=6, groups=3, name=name) as groups:
        assert (len(groups), groups.worlds, groups.name) == (3, 6, name)
        assert [sim.name for sim in groups] == [f"{name}.{group}" for group in range(3)]
        assert groups[-1] is groups[2] and groups[1:] == (groups[1], groups[2])
        with pytest.raises(IndexError):
            _ = groups[3]
        assert {sim.pid for sim in groups} == {groups.pid}
        told = [(sim.worlds, sim.info["groups"], sim.info["group"], sim.info["first_world"]) for sim in groups]
        assert told == [(2, 3, 0, 0), (2, 3, 1, 2), (2, 3, 2, 4)]
        assert repr(groups) == f"Groups({name!r}, groups=3, worlds=6, pid={groups.pid})"
    with tl.launch(pendulum, worlds=2, groups=1, name=name) as groups:
        assert len(groups) == 1 and groups[0].name == name and groups[0].info["groups"] == 1
        assert isinstance(tl.attach(name), tl.Sim)
    with tl.launch(pendulum, worlds=2) as sim:
        assert isinstance(sim, tl.Sim) and (sim.info["groups"], sim.info["first_world"]) == (1, 0)


@pytest.mark.parametrize(
    ("groups", "worlds", "told"),
    [
        (0, 4, "launch: groups is 0"),
        (-1, 4, "launch: groups is -1"),
        (1.5, 4, r"launch: groups is 1\.5"),
        (3, 4, 'groups "3": 4 worlds cannot be shared out evenly'),
        (5, 4, 'groups "5": each has at least one world, and there are 4'),
        (100, 200, 'groups "100": ask for 1 to 64'),
    ],
)
def test_groups_that_cannot_be_are_refused_by_name(pendulum, root, groups, worlds, told):
    with pytest.raises(tl.ArgumentError, match=told):
        tl.launch(pendulum, worlds=worlds, groups=groups)
    assert not list(root.iterdir())


def test_the_name_of_a_group_is_no_name_of_a_daemon(pendulum):
    with pytest.raises(tl.ArgumentError, match="that of a group"):
        tl.launch(pendulum, worlds=1, name="franka.0")


def test_memory_counts_all_groups(pendulum):
    # one of two groups might fit, into twice the memory of this machine
    each = Path("/proc/meminfo").read_text().split("MemAvailable:")[1].split()[0]
    worlds = int(each) * 1024 // 1500
    with pytest.raises(tl.ResourceError, match=rf"{2 * worlds} worlds"):
        tl.launch(pendulum, worlds=2 * worlds, groups=2)


def test_what_is_attached_are_the_groups_or_one_of_them(drawn, unique):
    name = unique()
    with tl.launch(drawn, worlds=WORLDS, groups=GROUPS, name=name, fields=FIELDS) as groups:
        joined = tl.attach(name)
        assert isinstance(joined, tl.Groups) and len(joined) == GROUPS and joined.pid == groups.pid
        with pytest.raises(tl.LeaseHeld, match=str(os.getpid())):
            joined[1].step()
        # the lease is of a group: the others keep theirs
        groups[1].close()
        assert joined[1].step().step.tolist() == [1] * EACH
        assert groups[0].step().step.tolist() == [1] * EACH
        alone = tl.attach(f"{name}.2")
        assert isinstance(alone, tl.Sim) and (alone.worlds, alone.info["first_world"]) == (EACH, 2 * EACH)
        alone.close()
        joined.close()
        for missing in (f"{name}.3", f"{name}.x", f"{name}.00"):
            with pytest.raises(tl.TightloopError, match=r"no daemon named|not allowed"):
                tl.attach(missing)
        with pytest.raises(tl.UnknownDaemon, match=rf"running: {name}; ") as raised:
            tl.attach("nobody")
        assert f"{name}.0" not in str(raised.value)


def test_a_daemon_with_groups_is_one_line_of_the_list_and_one_stop(drawn, tmp_path, root, unique):
    file = tmp_path / "scene.toml"
    drawn.save(file)
    for stopped in (lambda name: name, lambda name: f"{name}.1"):
        name = unique()
        serve = [*COMMAND, "serve", str(file), "--worlds=6", "--groups=2", f"--name={name}"]
        with started(serve, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None and process.stderr is not None
            line = process.stdout.readline()
            assert f'"name":"{name}"' in line and '"groups":2' in line and '"worlds":6' in line
            assert "6 worlds in 2 groups" in process.stderr.readline()
            stems = stems_of(process.pid)
            taken = subprocess.run(serve, capture_output=True, text=True, check=False)
            assert "already running" in taken.stdout and str(process.pid) in taken.stdout
            listed = subprocess.run([*COMMAND, "list", "--names"], capture_output=True, text=True, check=True)
            assert [line for line in listed.stdout.splitlines() if name in line] == [name]
            recorded = subprocess.run(
                [*COMMAND, "record", name, str(tmp_path / "no")], capture_output=True, text=True, check=False
            )
            assert recorded.returncode == 1 and f"one of {name}.0 to {name}.1" in recorded.stderr
            subprocess.run([*COMMAND, "stop", stopped(name)], check=True, timeout=30)
            # nothing is left as soon as that returns
            assert left_of(stems) == [] and not any(name in path.name for path in root.iterdir())
            assert process.wait(5) == 0


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_the_end_of_the_process_is_reported_by_every_group_and_leaves_nothing(pendulum, root, how):
    with tl.launch(pendulum, worlds=4, groups=2) as groups:
        stems = stems_of(groups.pid)
        for sim in groups:
            sim.step()
        os.kill(groups.pid, how)
        assert wait_until(lambda: not alive(groups.pid), 2)
        for sim in groups:
            with pytest.raises(tl.DaemonLost, match=str(groups.pid)):
                sim.step()
    assert left_of(stems) == [] and not list(root.iterdir())


def test_the_daemon_ends_with_the_last_of_its_groups(pendulum):
    first, second = tl.launch(pendulum, worlds=4, groups=2)
    pid = first.pid
    first.close()
    assert second.step().step[0] == 1
    second.close()
    second.close()
    assert not alive(pid)


def test_a_killed_client_of_one_group_leaves_the_other_alone(pendulum):
    with tl.launch(pendulum, worlds=4, groups=2) as groups:
        first, second = groups
        second.close()
        code = (
            f"import tightloop as tl, os, signal; sim = tl.attach({second.name!r}); sim.step(); sim.send();"
            "os.kill(os.getpid(), signal.SIGKILL)"
        )
        first.send()
        subprocess.run([sys.executable, "-c", code], check=False)
        assert first.recv().step[0] == 1
        again = tl.attach(second.name)

        def stepped() -> bool:
            try:
                return again.step().step[0] in (2, 3)
            except tl.LeaseHeld:
                return False

        assert wait_until(stepped, 2.0), "its lease is free again"
        assert first.step().step[0] == 2
        again.close()


def test_a_launcher_that_is_killed_takes_the_daemon_along(pendulum_urdf, root):
    code = (
        "import tightloop as tl, os, signal, sys\n"
        "scene = tl.Scene(dt=1 / 480, substeps=4)\n"
        f"scene.add_urdf({str(pendulum_urdf)!r}, name='arm')\n"
        "groups = tl.launch(scene, worlds=4, groups=2)\n"
        "print(groups.pid, flush=True)\n"
        "sys.stdin.readline()\n"
        "os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    command = [sys.executable, "-c", code]
    with started(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as caller:
        assert caller.stdout is not None
        pid = int(caller.stdout.readline())
        stems = stems_of(pid)
        caller.communicate("\n", timeout=20)
    assert wait_until(lambda: not alive(pid), 1.0), "the daemon notices within a second"
    assert wait_until(lambda: not left_of(stems) and not list(root.iterdir()), 1.0)


def test_bad_input_of_one_group_is_refused_in_its_own_numbers(pendulum, tmp_path):
    log = tmp_path / "news.log"
    with tl.launch(pendulum, worlds=4, groups=2, bounds={"joint_qd": 1e3}, log=log) as groups:
        first, second = groups
        with pytest.raises(tl.CommandRefused, match=r"joint_f. is NaN in world 1 for .arm/elbow"):
            second.step(joint_f=[[0.0, 0.0], [0.0, np.nan]])
        with pytest.raises(tl.CommandRefused, match=r"\(2,"):
            second.step(joint_f=np.zeros((4, 2)))
        second.step(joint_f=[[0.0, 0.0], [1e5, 0.0]])
        assert second.forward().status.tolist() == [0, 8]
        assert first.step().status.tolist() == [0, 0]
    news = log.read_text().splitlines()
    assert len([line for line in news if line.startswith("group 1: frozen: 1 world ")]) == 1, news
    assert not any(line.startswith("group 0:") for line in news)


@pytest.mark.parametrize("device", ["cpu", "gpu"])
def test_a_recording_of_one_group_replays(drawn, tmp_path, device):
    out = tmp_path / "run.tlrec"
    rng = np.random.default_rng(2)
    with tl.launch(drawn, worlds=WORLDS, groups=GROUPS, fields=FIELDS, device=device) as groups:
        sim = groups[2]
        command = [*COMMAND, "record", sim.name, str(out), "--frames", "60"]
        recorder = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert recorder.stderr is not None and "recording" in recorder.stderr.readline()
        for frame in range(60):
            groups[0].send()
            if frame % 20 == 10:
                sim.reset(mask=rng.random(EACH) > 0.5)
            else:
                sim.step(joint_f=rng.normal(size=(EACH, 2)))
            groups[0].recv()
        said, news = recorder.communicate(timeout=60)
        assert recorder.returncode == 0, said + news
    replayed = subprocess.run([*COMMAND, "replay", str(out)], capture_output=True, text=True, timeout=120, check=False)
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr
    assert f"60 frames of {EACH} worlds are equal" in replayed.stdout


def test_all_groups_share_the_threads_that_are_asked_for(pendulum):
    def threads(pid: int) -> int:
        tasks = Path(f"/proc/{pid}/task").iterdir()
        return sum(task.joinpath("comm").read_text().startswith("step-") for task in tasks)

    # a thread takes its name when it begins
    for asked in (3, 1):
        with tl.launch(pendulum, worlds=256, groups=2, threads=asked) as groups:
            assert [sim.threads for sim in groups] == [asked, asked]
            for sim in groups:
                sim.step()
            assert wait_until(lambda pid=groups.pid, asked=asked: threads(pid) == asked, 2.0), threads(groups.pid)


LIMITED = """
import resource, sys, tightloop as tl
resource.setrlimit(resource.RLIMIT_NOFILE, (int(sys.argv[2]), int(sys.argv[3])))
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf(sys.argv[1], name="arm")
with tl.launch(scene, worlds=32, groups=32) as groups:
    frames = [sim.step() for sim in groups]
    print(len(frames))
"""


def with_limit(urdf: Path, soft: int, hard: int) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", LIMITED, str(urdf), str(soft), str(hard)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_soft_limit_of_open_files_is_raised_for_many_groups(pendulum_urdf):
    done = with_limit(pendulum_urdf, 256, 4096)
    assert done.stdout == "32\n", done.stderr


def test_a_hard_limit_of_open_files_is_named_with_the_cure(pendulum_urdf):
    done = with_limit(pendulum_urdf, 128, 128)
    assert "ResourceError" in done.stderr, done.stderr
    assert "may have 128 open" in done.stderr and "ulimit -n" in done.stderr, done.stderr


def test_a_list_says_who_uses_which_daemon(pendulum, unique):
    name = unique()
    with tl.launch(pendulum, worlds=6, groups=2, name=name) as groups, tl.attach(f"{name}.1") as observer:
        observer.latest(0.5)
        groups[0].step()
        line = [*COMMAND, "list"]
        [row] = [
            row
            for row in json.loads(subprocess.run([*line, "--json"], capture_output=True, text=True, check=True).stdout)
            if row["name"] == name
        ]
        assert (row["worlds"], row["groups"], row["pid"]) == (6, 2, groups.pid)
        assert row["controllers"] == [os.getpid()] * 2 and row["observers"] == 1
        assert row["steps_per_s"] == 0 and 0 < row["age_s"] < 600 and row["device"].startswith("cpu")
        stop = threading.Event()

        def run() -> None:
            while not stop.is_set():
                groups[0].step()

        stepping = threading.Thread(target=run)
        stepping.start()
        try:
            table = subprocess.run(line, capture_output=True, text=True, check=True).stdout.splitlines()
        finally:
            stop.set()
            stepping.join()
        head, *rows = table
        assert head.split()[:4] == ["NAME", "WORLDS", "GROUPS", "PID"]
        [mine] = [row.split() for row in rows if row.startswith(name)]
        assert mine[6] != "0", "it counts steps"
