"""tightloop runs in containers, for any user, without a home, and with little shared memory, or says what to do."""

from __future__ import annotations

import itertools
import json
import os
import re
import resource
import signal
import subprocess
import sys
from pathlib import Path

import pytest

import tightloop as tl
from containers import STRANGER, contained, namespaces

# What a first program does: it steps, keeps the state, and draws. It prints one line of JSON.
FIRST = """
import json, os, sys
import tightloop as tl
scene = tl.Scene(dt=1 / 240, substeps=2)
scene.add_urdf(tl.assets.CARTPOLE, name="cart")
try:
    with tl.launch(scene, worlds=64) as sim:
        for _ in range(3):
            frame = sim.step()
        snapshot = sim.snapshot()
        sim.restore(snapshot)
        assert sim.forward().joint_q.tobytes() == frame.joint_q.tobytes()
        assert tl.attach(sim.name).worlds == 64
        said = {"step": int(frame.step.min()), "size": sim.picture(size=(64, 48)).size}
except tl.TightloopError as error:
    said = {"kind": type(error).__name__, "message": str(error)}
said |= {"pid": os.getpid(), "user": os.geteuid(), "left": os.listdir("/dev/shm") if os.path.isdir("/dev/shm") else []}
print(json.dumps(said))
"""
# Fields of 4096 arms that do not fit into 64 MB.
MANY = """
import json, os
import tightloop as tl
scene = tl.Scene()
scene.add_urdf(tl.assets.FR3, name="arm").joint_q = [0, 0, 0, -2.4, 0, 2.4, 0.8, 0.04, 0.04]
try:
    tl.launch(scene, worlds=4096, fields=("joint_q", "mass_matrix", "body_jacobian"))
except tl.ResourceError as error:
    print(error)
with tl.launch(scene, worlds=4096) as sim:
    assert sim.step().joint_q.shape == (4096, 9)
print(json.dumps(os.listdir("/dev/shm")))
"""
# Another program fills shared memory while a simulation runs.
FILLED = """
import os
import tightloop as tl
scene = tl.Scene(dt=1 / 240, substeps=2)
scene.add_urdf(tl.assets.CARTPOLE, name="cart")
with tl.launch(scene, worlds=1024) as sim:
    sim.step()
    with open("/dev/shm/other", "wb") as other:
        free = os.statvfs("/dev/shm").f_bavail * os.statvfs("/dev/shm").f_frsize
        os.posix_fallocate(other.fileno(), 0, free)
    for _ in range(20):
        frame = sim.step()
    try:
        tl.launch(scene, worlds=1024)
    except tl.ResourceError as error:
        print(error)
    try:
        sim.snapshot()
    except tl.SnapshotError as error:
        print(error)
    os.unlink("/dev/shm/other")
    sim.snapshot()
    assert int(sim.step().step.min()) == 22
"""
# Process 1 starts the client, as a shell or `docker run --init` does, and kills it.
KILLED = """
import os, signal, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdout=subprocess.PIPE, text=True)
daemon = int(child.stdout.readline())
child.kill()
child.wait()
for _ in range(300):
    state = open(f"/proc/{daemon}/stat").read().rpartition(")")[2].split()[0]
    if state == "Z" and not os.listdir("/dev/shm"):
        print("ended")
        break
    time.sleep(0.01)
"""
CLIENT = """
import time
import tightloop as tl
scene = tl.Scene()
scene.add_urdf(tl.assets.CARTPOLE, name="cart")
sim = tl.launch(scene, worlds=8)
sim.step()
print(sim.pid, flush=True)
time.sleep(60)
"""


def printed(process: subprocess.CompletedProcess[str]) -> str:
    assert process.returncode == 0, process.stderr
    return process.stdout


def first_program(environment: dict[str, str], **options: object) -> dict[str, object]:
    """Run the first program with nothing else in its environment."""
    known = {name: os.environ[name] for name in ("PATH", "PYTHONPATH", "TIGHTLOOP_ROOT") if name in os.environ}
    process = subprocess.run(
        [sys.executable, "-c", FIRST],
        env=known | environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        **options,  # type: ignore[call-overload]
    )
    assert not process.stderr
    return json.loads(printed(process))


@pytest.mark.parametrize("user", [0, STRANGER])
def test_a_container_with_a_read_only_root_and_64_mb_runs_the_first_program(tmp_path, user):
    said = json.loads(printed(contained(tmp_path, ["-c", FIRST], user=user)))
    assert said == {"step": 3, "size": [64, 48], "pid": 1, "user": user, "left": []}


def test_64_mb_hold_4096_arms_and_a_launch_that_needs_more_says_how_much(tmp_path):
    refused, left = printed(contained(tmp_path, ["-c", MANY])).splitlines()
    assert re.match(r"/dev/shm has 67\d{6} bytes free and \d{9} are needed \(4096 worlds", refused), refused
    assert "fewer fields" in refused and "--shm-size" in refused
    assert json.loads(left) == []


def test_a_simulation_steps_on_when_another_program_fills_shared_memory(tmp_path):
    launch, snapshot = printed(contained(tmp_path, ["-c", FILLED])).splitlines()
    assert re.match(r"/dev/shm/\S+ has \d+ bytes free and \d+ are needed", launch), launch
    assert snapshot.startswith("snapshot: no room") and "df -h /dev/shm" in snapshot


def test_a_client_that_is_killed_in_a_container_leaves_no_daemon(tmp_path):
    # the daemon's new parent is process 1, which knows nothing of it
    assert printed(contained(tmp_path, ["-c", KILLED, CLIENT])).split() == ["ended"]


@pytest.mark.parametrize(
    ("shm", "user"),
    [("none", 0), ("size=64m,ro", 0), ("none", STRANGER), ("size=64m,mode=755", STRANGER)],
    ids=["absent", "read-only", "absent for another user", "for root only"],
)
@pytest.mark.parametrize("root", [None, "/tmp/root"])
def test_without_shared_memory_that_can_be_written_the_error_says_what_to_mount(tmp_path, shm, user, root):
    environment = {"TIGHTLOOP_ROOT": root} if root else {}
    said = json.loads(printed(contained(tmp_path, ["-c", FIRST], shm=shm, user=user, environment=environment)))
    assert said["kind"] == "LaunchError" and "mount -t tmpfs -o mode=1777 tmpfs /dev/shm" in said["message"], said


def test_without_proc_the_error_says_to_mount_it(tmp_path):
    said = json.loads(printed(contained(tmp_path, ["-c", FIRST], proc=False)))
    assert said["kind"] == "LaunchError" and "mount -t proc proc /proc" in said["message"], said


def test_a_runtime_folder_of_somebody_else_is_named_with_the_cure(tmp_path):
    # `sudo -u` and `su` keep the variable of the user who calls them
    environment = {"XDG_RUNTIME_DIR": "/run/user/0"}
    said = json.loads(printed(contained(tmp_path, ["-c", FIRST], user=STRANGER, environment=environment)))
    assert said["kind"] == "LaunchError" and "/run/user/0/tightloop" in said["message"], said
    assert "set TIGHTLOOP_ROOT" in said["message"]


@pytest.mark.parametrize(
    "environment",
    [{}, {"HOME": ""}, {"HOME": "/nonexistent"}, {"HOME": "/proc"}, {"TMPDIR": "/nonexistent"}],
    ids=["no HOME", "empty HOME", "missing HOME", "read-only HOME", "missing TMPDIR"],
)
def test_the_first_program_needs_no_home_and_no_temporary_folder(environment):
    assert first_program(environment)["step"] == 3


def test_the_first_program_runs_where_its_working_folder_is_gone(tmp_path):
    folder = tmp_path / "gone"
    folder.mkdir()
    assert first_program({}, cwd=folder, preexec_fn=folder.rmdir)["step"] == 3


@pytest.mark.parametrize("closed", [(0,), (2,), (0, 2)], ids=["stdin", "stderr", "stdin and stderr"])
def test_the_first_program_runs_with_closed_streams_as_a_service_has(closed):
    assert first_program({}, preexec_fn=lambda: [os.close(stream) for stream in closed])["step"] == 3


def test_files_of_a_simulation_stay_on_a_file_system_of_their_own(tmp_path):
    # /dev/shm as another file system than tmpfs, as a pod of Kubernetes with an `emptyDir` has: here the disk's
    mount = f'mount --bind "{tmp_path}" /dev/shm && exec "$@"'
    environment = {name: value for name, value in os.environ.items() if name != "TIGHTLOOP_ROOT"}
    process = subprocess.run(
        [*namespaces(), "bash", "-euc", mount, "bash", sys.executable, "-c", FIRST],
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert json.loads(printed(process))["step"] == 3
    assert not list(tmp_path.iterdir())


def test_a_python_that_cannot_be_started_again_is_an_error_of_ours(pendulum, tmp_path, monkeypatch):
    for executable in (tmp_path / "absent", tmp_path):
        monkeypatch.setattr(sys, "executable", str(executable))
        with pytest.raises(tl.LaunchError, match=rf"{executable}.*tightloop serve"):
            tl.launch(pendulum, worlds=1)


@pytest.mark.parametrize(
    ("limit", "most"),
    [(resource.RLIMIT_STACK, 512 << 10), (resource.RLIMIT_MEMLOCK, 0)],
    ids=["stack", "locked memory"],
)
def test_the_first_program_runs_within_the_limits_of_a_service(limit, most):
    hard = resource.getrlimit(limit)[1]
    assert first_program({}, preexec_fn=lambda: resource.setrlimit(limit, (most, hard)))["step"] == 3


def test_the_command_line_serves_a_container_without_home(tmp_path):
    program = f"""
import os, signal, subprocess, sys, time
import tightloop as tl
scene = tl.Scene()
scene.add_urdf(tl.assets.CARTPOLE, name="cart")
scene.save("/tmp/scene.toml")
serve = [sys.executable, "-m", "tightloop", "serve", "/tmp/scene.toml", "--worlds=4", "--name=box"]
daemon = subprocess.Popen(serve, stdout=subprocess.PIPE, text=True)
daemon.stdout.readline()
with tl.attach("box") as sim:
    print(int(sim.step().step[0]))
daemon.send_signal({int(signal.SIGTERM)})
print(daemon.wait(), os.listdir("/dev/shm"))
"""
    assert printed(contained(tmp_path, ["-c", program], user=STRANGER)).split("\n") == ["1", "0 []", ""]


@pytest.mark.parametrize("root", ["/proc/self", "/proc"])
def test_a_root_that_takes_no_file_is_named_with_the_cure(pendulum, monkeypatch, root):
    monkeypatch.setenv("TIGHTLOOP_ROOT", root)
    with pytest.raises(tl.LaunchError, match=r'folder "/proc.*no file can be made in it; set TIGHTLOOP_ROOT'):
        tl.launch(pendulum, worlds=1)


def test_a_lack_of_address_space_is_named_with_the_cure(pendulum, tmp_path):
    pendulum.save(tmp_path / "scene.toml")
    serve = [sys.executable, "-m", "tightloop", "serve", str(tmp_path / "scene.toml"), "--worlds", "100000"]
    limit = 300 << 20
    process = subprocess.run(
        serve,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (limit, limit)),
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
    )
    assert process.returncode == 1
    assert re.search(r"no more memory.*ulimit -v unlimited.*fewer worlds", process.stderr), process.stderr


def test_a_snapshot_for_which_no_file_can_be_opened_reports_it(pendulum):
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        lowest = os.dup(0)
        os.close(lowest)
        resource.setrlimit(resource.RLIMIT_NOFILE, (lowest, hard))
        try:
            with pytest.raises(tl.SnapshotError, match=r"Too many open files.*ulimit -n") as refused:
                sim.snapshot()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
        assert "df -h" not in str(refused.value)
        assert sim.snapshot().worlds == 1


def test_a_snapshot_for_which_the_daemon_can_open_no_file_reports_it(pendulum):
    with tl.launch(pendulum, worlds=1) as sim:
        sim.step()
        used = {int(file.name) for file in Path(f"/proc/{sim.pid}/fd").iterdir()}
        lowest = next(number for number in itertools.count() if number not in used)
        resource.prlimit(sim.pid, resource.RLIMIT_NOFILE, (lowest, lowest))
        with pytest.raises(tl.SnapshotError, match=r"Too many open files.*ulimit -n") as refused:
            sim.snapshot()
        assert "df -h" not in str(refused.value)
