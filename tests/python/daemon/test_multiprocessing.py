"""Simulations in child processes, of each start method, and in threads."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from processes import alive, wait_until

METHODS = ("fork", "spawn", "forkserver")

# Each worker has a simulation of its own, for the whole of its life: what a data collector does.
POOL = """
import multiprocessing, os, sys
import tightloop as tl

def begin():
    global sim
    scene = tl.Scene(dt=1 / 240, substeps=2)
    scene.add_urdf(tl.assets.CARTPOLE, name="cart")
    sim = tl.launch(scene, worlds=4)

def episode(force):
    sim.reset(seed=0)
    for _ in range(20):
        frame = sim.step(joint_f=[force, 0.0])
    return sim.pid, os.getpid(), frame.joint_q.tobytes().hex()

if __name__ == "__main__":
    begin()
    here = {force: episode(force) for force in (1.0, 2.0, 3.0)}
    context = multiprocessing.get_context(sys.argv[1])
    with context.Pool(2, initializer=begin) as pool:
        there = pool.map(episode, [1.0, 2.0, 3.0] * 4, chunksize=1)
        daemons = {pid for pid, *_ in there}
        assert len(daemons) == len({worker for _, worker, _ in there}) and sim.pid not in daemons
        assert [bits for *_, bits in there] == [here[force][2] for force in (1.0, 2.0, 3.0)] * 4
    print(*daemons)
    assert sim.step().step[0] == 21
"""
# A child gets a simulation, its frame and a name.
GIVEN = """
import multiprocessing, sys
import tightloop as tl

def child(name, frame, queue):
    with tl.attach(name) as sim:
        queue.put((sim.worlds, frame.joint_q.tolist()))

if __name__ == "__main__":
    context = multiprocessing.get_context(sys.argv[1])
    scene = tl.Scene(dt=1 / 240, substeps=2)
    scene.add_urdf(tl.assets.CARTPOLE, name="cart")
    with tl.launch(scene, worlds=4) as sim:
        frame, queue = sim.step(), context.Queue()
        for wrong in (sim, frame):
            try:
                context.Process(target=print, args=(wrong,)).start()
            except tl.TightloopError as error:
                print(error)
        process = context.Process(target=child, args=(sim.name, frame.copy(), queue))
        process.start()
        assert queue.get(timeout=20) == (4, frame.joint_q.tolist())
        process.join()
        assert process.exitcode == 0 and sim.step().step[0] == 2
"""
# A child inherits a simulation that a thread of its parent is stepping.
INHERITED = """
import json, os, sys, threading, warnings
import tightloop as tl

warnings.simplefilter("ignore", DeprecationWarning)
scene = tl.Scene(dt=1 / 240, substeps=2)
scene.add_urdf(tl.assets.CARTPOLE, name="cart")
sim = tl.launch(scene, worlds=64, frames_held=8)
kept = sim.step()
stop = threading.Event()

def run():
    while not stop.is_set():
        sim.step()

thread = threading.Thread(target=run)
thread.start()
said = []
for use in sys.argv[1:] * 3:
    read, write = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            exec(use)
            answer = "done"
        except BaseException as error:
            answer = f"{type(error).__name__}: {error}"
        os.write(write, answer.encode())
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as answer:
        said.append((use, answer.read()))
    os.waitpid(pid, 0)
stop.set()
thread.join()
assert sim.step().step[0] > 2
print(json.dumps(said))
"""
# gymnasium's own vector of processes, each with an environment of one world.
GYMNASIUM = """
import sys
import gymnasium
import numpy as np
import tightloop.env

if __name__ == "__main__":
    make = lambda: gymnasium.make("tightloop/CartPoleBalance-v0")
    envs = gymnasium.vector.AsyncVectorEnv([make, make], context=sys.argv[1])
    obs, _ = envs.reset(seed=[3, 3])
    for _ in range(5):
        obs, *_ = envs.step(np.zeros(envs.action_space.shape, np.float32))
    assert np.array_equal(obs[0], obs[1]) and np.isfinite(obs).all()
    envs.close()
"""


def run(program: str, folder: Path, *arguments: str) -> str:
    """Run a program from a file, as children of `spawn` need it; return what it printed."""
    path = folder / "program.py"
    path.write_text(program)
    command = [sys.executable, str(path), *arguments]
    process = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    assert process.returncode == 0 and not process.stderr, process.stderr
    return process.stdout


@pytest.mark.parametrize("method", METHODS)
def test_workers_of_a_pool_simulate_the_same_bits_and_take_their_daemons_with_them(tmp_path, method):
    daemons = [int(pid) for pid in run(POOL, tmp_path, method).split()]
    assert daemons and wait_until(lambda: not any(map(alive, daemons)), 2.0)


@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_a_child_gets_a_name_and_a_copy_and_not_the_simulation_itself(tmp_path, method):
    of_sim, of_frame = run(GIVEN, tmp_path, method).splitlines()
    assert "tightloop.attach(" in of_sim and "frame.copy()" in of_frame


def test_a_forked_child_of_a_stepping_process_gets_an_error_at_once_and_can_start_its_own(tmp_path):
    refused = ["sim.step()", "sim.reset()", "sim.forward()", "sim.snapshot()", "sim.write(joint_q=0.0)"]
    allowed = ["kept.joint_q.sum()", "kept.copy()", "sim.close()", "tl.attach(sim.name)", "tl.launch(scene, worlds=2)"]
    said = json.loads(run(INHERITED, tmp_path, *refused, *allowed))
    for use, answer in said:
        assert answer.startswith("LeaseHeld: ") if use in refused else answer == "done", (use, answer)


@pytest.mark.parametrize("method", ["fork", "spawn"])
def test_gymnasiums_vector_of_processes_runs_environments(tmp_path, method):
    run(GYMNASIUM, tmp_path, method)


def test_threads_launch_and_step_simulations_of_their_own(pendulum):
    begin = threading.Barrier(4)

    def simulate(worlds: int) -> np.ndarray:
        begin.wait()
        with tl.launch(pendulum, worlds=worlds, threads=1) as sim:
            return [sim.step().joint_q.copy() for _ in range(50)][-1]

    with ThreadPoolExecutor(4) as pool:
        results = list(pool.map(simulate, (1, 2, 3, 4)))
    assert all(np.array_equal(result[0], results[0][0]) for result in results)


def test_a_simulation_outlives_the_thread_that_launched_it(pendulum):
    def in_a_thread(work: Callable[[], Any]) -> Any:
        with ThreadPoolExecutor(1) as pool:
            return pool.submit(work).result()

    sim = in_a_thread(lambda: tl.launch(pendulum, worlds=2))
    assert in_a_thread(sim.step).step[0] == 1
    assert sim.step().step[0] == 2
    in_a_thread(sim.close)
    assert wait_until(lambda: not alive(sim.pid), 1.0)
