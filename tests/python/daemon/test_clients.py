"""Clients in C and Rust: their examples run against a daemon, and every mistake of a caller in C has a status."""

from __future__ import annotations

import fcntl
import json
import os
import re
import shlex
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest

import tightloop as tl
from conftest import REPOSITORY

RELEASE = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "release"
EXAMPLE = REPOSITORY / "examples/c_client/client.c"
MISTAKES = REPOSITORY / "tests/python/daemon/c_client/mistakes.c"
ALLOCATIONS = REPOSITORY / "tests/python/daemon/c_client/allocations.c"
STRICT = ["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]


def built(name: str) -> Path:
    """A program or library of the workspace."""
    path = RELEASE / name
    if not path.exists():
        cure = "cargo build --release --workspace --lib --example rust_client"
        pytest.fail(f"there is no {path}; run `{cure}`, as `make test` does")
    return path


def command_of_the_example(program: Path) -> list[str]:
    """The compile command in the head of the example in C, for another place of the program and of the library."""
    head = re.search(r"^ \* (cc .*?[^\\])$", EXAMPLE.read_text(), re.MULTILINE | re.DOTALL)
    assert head is not None
    line = re.sub(r"\\\n \* +", "", head[1])
    for written, here in ((" -o client ", f" -o {program} "), ("$PWD/target/release", "target/release")):
        assert line.count(written) == 1
        line = line.replace(written, here)
    return shlex.split(line.replace("target/release", str(RELEASE)))


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The examples, by what they are written in and linked to."""
    folder, library = tmp_path_factory.mktemp("clients"), built("libtightloop_client.so")
    shared, static = folder / "shared", folder / "static"
    command = command_of_the_example(shared)
    subprocess.run([*command, *STRICT], cwd=REPOSITORY, check=True)
    alone = [word for word in command if word != "-ltightloop_client" and not word.startswith("-Wl,")]
    alone = [*alone[: alone.index("-o")], "-o", str(static), *alone[alone.index("-o") + 2 :]]
    subprocess.run([*alone, *STRICT, str(library.with_suffix(".a")), "-lm"], cwd=REPOSITORY, check=True)
    return {"C": shared, "C, static": static, "Rust": built("examples/rust_client")}


def run(program: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    command = [str(program), *arguments]
    environment = os.environ | variables
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60, check=False)


def numbers(pattern: str, text: str) -> list[float]:
    found = re.search(pattern, text)
    assert found is not None, text
    return [float(number) for number in re.findall(r"[-+]?\d+\.\d+", found[1])]


@pytest.mark.parametrize("name", ["C", "C, static", "Rust"])
def test_an_example_damps_the_joints_as_python_does(name, programs, pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        frame = sim.reset()
        for _ in range(40):
            frame = sim.step(joint_f=np.float32(-0.1) * frame.joint_qd)
        expected = frame.joint_q[0].copy()
        frame = None
        sim.release()
        done = run(programs[name], sim.name, "40", "400")
    assert done.returncode == 0, done.stderr
    assert f"{sim.name}: 2 worlds of 2 dofs" in done.stdout
    # four places are printed
    assert np.abs(numbers(r"joint_q of world 0: ?(.*)", done.stdout) - expected).max() < 0.51e-4
    assert np.abs(expected - [0.3, -0.2]).max() > 1e-2
    p50, p99, largest = numbers(r"round trip: (.*)", done.stdout)
    assert 0 < p50 <= p99 <= largest


def compiled(source: Path, folder: Path, *options: str) -> Path:
    """A program in C that is linked to the client."""
    library, program = built("libtightloop_client.so"), folder / source.stem
    command = ["cc", "-g", *STRICT, f"-I{REPOSITORY}/sim-daemon/client-c/include", str(source), "-o", str(program)]
    command += [f"-L{library.parent}", "-ltightloop_client", f"-Wl,-rpath,{library.parent}", *options]
    subprocess.run(command, check=True)
    return program


def test_a_step_in_c_takes_memory_only_for_the_loan_of_the_transport(pendulum, tmp_path):
    program = compiled(ALLOCATIONS, tmp_path, "-rdynamic")
    with tl.launch(pendulum, worlds=1) as sim:
        sim.release()
        done = run(program, sim.name)
    # a step of the client in Rust has this one, too
    assert (done.returncode, done.stdout, done.stderr) == (0, "1\n", "")


def test_a_step_in_c_holds_up_no_other_thread_and_no_forked_child(pendulum, tmp_path):
    program = compiled(REPOSITORY / "tests/python/daemon/c_client/threads.c", tmp_path, "-pthread")
    with tl.launch(pendulum, worlds=3) as sim:
        sim.release()
        try:
            done = run(program, sim.name, str(sim.pid))
        finally:
            os.kill(sim.pid, signal.SIGCONT)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def test_a_frame_in_c_says_when_the_next_one_is_due(pendulum, tmp_path):
    pendulum.dt, pendulum.substeps = 1e-3, 1
    program = compiled(REPOSITORY / "benches/daemon/realtime.c", tmp_path)
    with tl.launch(pendulum, worlds=1, realtime=1.0) as sim:
        sim.release()
        done = run(program, sim.name, "1")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    # lateness is from the time that a frame said: seconds if it were another clock
    assert said["frames"] == 1000
    assert 0 <= said["p50"] < 1e5


def test_every_mistake_in_c_has_a_status_and_a_sentence(pendulum, tmp_path):
    program = compiled(MISTAKES, tmp_path, "-lpthread")
    with tl.launch(pendulum, worlds=3) as sim:
        sim.release()
        done = run(program, sim.name, str(sim.pid))
        assert (done.returncode, done.stdout, done.stderr) == (0, "0 wrong\n", "")


@pytest.mark.parametrize("name", ["C", "Rust"])
def test_another_version_of_the_protocol_is_refused_by_name(name, programs, root, unique):
    daemon = unique()
    lock = root / f"{daemon}.lock"
    lock.write_text("tightloop 99 4711 00000000000000aa\n")
    with lock.open() as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        done = run(programs[name], daemon)
    lock.unlink()
    assert done.returncode == 1
    assert re.search(
        rf'daemon "{daemon}" speaks protocol version 99, this client speaks \d+; use the same', done.stderr
    )
