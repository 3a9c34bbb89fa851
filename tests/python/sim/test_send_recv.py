"""A step in two halves: the same bits, no other command in between, and nothing left however it ends."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import tightloop as tl
from processes import alive, wait_until


def same(frame, expected):
    for name in expected.fields:
        assert getattr(frame, name).tobytes() == getattr(expected, name).tobytes(), name


def test_halves_of_steps_have_the_bits_of_whole_ones(lesson, torques, targets):
    params = ("body_f",)
    with (
        tl.launch(lesson(driven=True), worlds=5, params=params) as halves,
        tl.launch(lesson(driven=True), worlds=5, params=params) as whole,
    ):
        push = np.zeros((5, len(whole.body_names), 6))
        for n in range(40):
            push[:, -1, 2] = np.arange(5) * (n % 3)
            commands = {
                "joint_f": {"arm": torques(n)},
                "joint_target_q": np.tile(targets(n), (5, 1)),
                "joint_target_qd": np.zeros(9) if n % 2 else None,
                "body_f": push,
            }
            halves.send(**commands)
            expected = whole.step(**commands)
            same(halves.recv(), expected)
        halves.send()
        same(halves.recv(), whole.step())


def test_what_was_sent_may_be_overwritten_at_once(pendulum):
    with tl.launch(pendulum, worlds=3) as halves, tl.launch(pendulum, worlds=3) as whole:
        for n in range(20):
            tau = np.full((3, 2), 0.1 * n, np.float32)
            expected = whole.step(joint_f=tau)
            halves.send(joint_f=tau)
            tau[:] = np.nan
            same(halves.recv(), expected)


def test_two_simulations_step_at_once(pendulum):
    with tl.launch(pendulum, worlds=4) as left, tl.launch(pendulum, worlds=4) as right:
        # If the first had to end before the second began, this would not return
        os.kill(left.pid, signal.SIGSTOP)
        left.send(joint_f=[0.5, 0.0])
        for n in range(10):
            right.send(joint_f=[-0.5, 0.0])
            assert right.recv().step.tolist() == [n + 1] * 4
        os.kill(left.pid, signal.SIGCONT)
        assert left.recv().step.tolist() == [1] * 4
        for n in range(50):
            left.send(joint_f=[0.5, 0.0])
            right.send(joint_f=[-0.5, 0.0])
            assert (left.recv().step[0], right.recv().step[0]) == (n + 2, n + 11)


def test_while_a_step_is_in_flight_everything_else_is_refused_with_the_cure(pendulum):
    with tl.launch(pendulum, worlds=2, params=("joint_damping",)) as sim:
        kept = sim.snapshot()
        others = [
            sim.send,
            sim.step,
            sim.reset,
            lambda: sim.write(joint_q=[1.0, 1.0]),
            sim.forward,
            sim.snapshot,
            lambda: sim.restore(kept),
            lambda: sim.params.joint_damping,
            lambda: sim.params.write(joint_damping=5.0),
        ]
        expected = sim.step(joint_f=[0.2, 0.1]).copy()
        sim.restore(kept)
        sim.send(joint_f=[0.2, 0.1])
        for other in others:
            with pytest.raises(tl.CommandRefused, match="call recv first"):
                other()
        frame = sim.recv()
        assert np.array_equal(frame.joint_q, expected.joint_q) and frame.step.tolist() == [1, 1]
        assert not sim.params.joint_damping.any()


def test_recv_without_send_says_what_to_call(pendulum):
    with tl.launch(pendulum, worlds=1) as sim:
        for _ in range(2):
            with pytest.raises(tl.CommandRefused, match="call send first"):
                sim.recv()
            sim.step()
        sim.send()
        sim.recv()
        with pytest.raises(tl.CommandRefused, match="call send first"):
            sim.recv()


def test_wrong_arrays_are_refused_by_send_and_wrong_numbers_by_recv(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        for wrong in (np.zeros((2, 3)), np.zeros((2, 2), bool), {"leg": np.zeros(2)}):
            with pytest.raises(tl.CommandRefused, match="joint_f"):
                sim.send(joint_f=wrong)
        with pytest.raises(tl.CommandRefused, match="call send first"):
            sim.recv()
        sim.send(joint_f=[[0.0, 0.0], [0.0, np.nan]])
        with pytest.raises(tl.CommandRefused, match=r"joint_f. is NaN in world 1 for .arm/elbow"):
            sim.recv()
        assert sim.step().step.tolist() == [1, 1]


def test_ctrl_c_ends_a_recv_that_may_be_called_again(pendulum):
    # a shell that runs the tests in the background has it ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)
    with tl.launch(pendulum, worlds=2) as sim:
        os.kill(sim.pid, signal.SIGSTOP)
        try:
            sim.send(joint_f=[0.1, 0.1])
            threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
            with pytest.raises(KeyboardInterrupt):
                sim.recv()
            with pytest.raises(tl.CommandRefused, match="call recv first"):
                sim.step()
        finally:
            os.kill(sim.pid, signal.SIGCONT)
        assert sim.recv().step.tolist() == [1, 1]
        assert sim.step().step.tolist() == [2, 2]


def test_other_python_threads_run_while_recv_waits(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        os.kill(sim.pid, signal.SIGSTOP)
        sim.send()
        threading.Timer(0.2, os.kill, (sim.pid, signal.SIGCONT)).start()
        counted = 0
        waiting = threading.Thread(target=sim.recv)
        waiting.start()
        while waiting.is_alive():
            counted += 1
        waiting.join()
        assert counted > 1000


def test_a_daemon_that_is_killed_in_between_is_reported_within_a_second(pendulum):
    with tl.launch(pendulum, worlds=2) as sim:
        os.kill(sim.pid, signal.SIGSTOP)
        sim.send()
        os.kill(sim.pid, signal.SIGKILL)
        began = time.monotonic()
        for call in (sim.recv, sim.recv, sim.step, sim.send):
            with pytest.raises(tl.DaemonLost, match=str(sim.pid)):
                call()
        assert time.monotonic() - began < 1.0


@pytest.mark.parametrize("end", ["close", "drop"])
def test_a_simulation_ends_with_a_step_in_flight(pendulum, end):
    sim = tl.launch(pendulum, worlds=64)
    pid = sim.pid
    sim.send()
    if end == "close":
        sim.close()
        for call in (sim.recv, sim.send):
            with pytest.raises(tl.SimClosed):
                call()
    del sim
    assert wait_until(lambda: not alive(pid), 1.0)


KILLED = """
import os, signal, sys
import tightloop as tl
sim = tl.attach(sys.argv[1])
sim.step()
sim.send()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_client_that_is_killed_in_between_leaves_a_daemon_that_serves_the_next(pendulum, unique):
    with tl.launch(pendulum, worlds=8, name=unique()) as sim:
        sim._client.close()  # gives the lease back; the daemon stays
        for _ in range(5):
            killed = subprocess.run([sys.executable, "-c", KILLED, sim.name], check=False)
            assert killed.returncode == -signal.SIGKILL
            following = tl.attach(sim.name)
            assert wait_until(lambda following=following: stepped(following), 5.0)
            following.reset()
            following.send()
            assert following.recv().step.tolist() == [1] * 8
            following.close()


def stepped(sim: tl.Sim) -> bool:
    """Whether the lease of the killed client has come to this one."""
    try:
        sim.step()
    except tl.LeaseHeld:
        return False
    return True
