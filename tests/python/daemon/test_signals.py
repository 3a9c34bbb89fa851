"""Signal handlers that use the simulation that they interrupt, and threads that wait for each other."""

from __future__ import annotations

import subprocess
import sys

import pytest

# The daemon is stopped, so that the outer call waits; it goes on when the handler is done
SCRIPT = """
import os, signal, threading, time
import tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_urdf({urdf!r}, name="arm")
sim = tl.launch(scene, worlds=4, params=("gravity",))
kept = sim.snapshot()
raised = []
def handler(*_):
    try:
        raised.append(type({inner}).__name__)
    except tl.TightloopError as error:
        raised.append(type(error).__name__)
    finally:
        proceed()
def proceed():
    os.kill(sim.pid, signal.SIGCONT)
signal.signal(signal.SIGALRM, handler)
os.kill(sim.pid, signal.SIGSTOP)
signal.setitimer(signal.ITIMER_REAL, 0.3)
try:
    raised.append(type({outer}).__name__)
except tl.TightloopError as error:
    raised.append(type(error).__name__)
{after}
print(*raised, flush=True)
"""
REFUSED = "CallInProgress"


def said(code: str, seconds: float = 30.0) -> str:
    """Return what a program prints, which must end by itself."""
    process = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=seconds, check=False)
    assert process.returncode == 0, process.stderr
    return process.stdout.strip()


@pytest.mark.parametrize(
    "outer", ["sim.step()", "sim.snapshot()", "sim.restore(kept)", "sim.reset()", "sim.params.gravity"]
)
@pytest.mark.parametrize("inner", ["sim.step()", "sim.snapshot()", "sim.params.gravity", "sim.send()"])
def test_a_call_from_a_handler_inside_a_call_is_refused_and_both_go_on(pendulum_urdf, outer, inner):
    code = SCRIPT.format(
        urdf=str(pendulum_urdf), inner=inner, outer=outer, after="raised.append(type(sim.step()).__name__)"
    )
    words = {"sim.step()": "Frame", "sim.snapshot()": "Snapshot", "sim.restore(kept)": "Frame", "sim.reset()": "Frame"}
    assert said(code) == f"{REFUSED} {words.get(outer, 'PropertyArray')} Frame"


def test_a_handler_may_ask_who_is_in_control_and_observe(pendulum_urdf):
    inner = "(sim.latest(), threading.Timer(0.2, os.kill, (sim.pid, signal.SIGCONT)).start(), sim.controller())"
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner=inner, outer="sim.step()", after="")
    assert said(code) == "tuple Frame"


def test_a_handler_inside_a_question_to_the_daemon_may_not_ask_another(pendulum_urdf):
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner="sim.controller()", outer="sim.controller()", after="")
    assert said(code) == f"{REFUSED} int"


def test_control_that_a_handler_releases_goes_when_the_call_returns(pendulum_urdf):
    after = "raised.append(str(sim.controller())); sim.step(); raised.append(str(sim.controller() == os.getpid()))"
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner="sim.release()", outer="sim.step()", after=after)
    assert said(code) == "NoneType Frame None True"


def test_a_handler_may_close_the_simulation_that_it_interrupts(pendulum_urdf):
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner="sim.close()", outer="sim.step()", after="")
    # the daemon is gone by then
    assert said(code.replace("        proceed()", "        pass")) == "NoneType SimClosed"


def test_a_handler_that_raises_ends_the_call(pendulum_urdf):
    # as a handler of SIGTERM does that cleans up and exits
    inner = "(sim.close(), exit(0))"
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner=inner, outer="sim.step()", after="raised.append('went on')")
    assert said(code.replace("        proceed()", "        pass")) == ""


def test_ctrl_c_reaches_a_thread_that_waits_behind_another(pendulum_urdf):
    outer = """wait(threading.Thread(target=sim.step))"""
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner="interrupt()", outer=outer, after="raised.append(str(in_time))")
    helpers = """
def interrupt():
    raise KeyboardInterrupt
def wait(first):
    global in_time
    first.start()
    time.sleep(0.1)
    try:
        sim.step()
    except KeyboardInterrupt:
        in_time = first.is_alive()
    proceed()
    first.join()
"""
    code = code.replace("raised = []", "raised = []" + helpers).replace("        proceed()", "        pass")
    assert said(code) == "NoneType True"


def test_a_release_inside_a_call_that_is_interrupted_is_no_release_of_a_later_one(pendulum_urdf):
    after = "sim.step(); raised.append(str(sim.controller() == os.getpid()))"
    code = SCRIPT.format(urdf=str(pendulum_urdf), inner="(sim.release(), interrupt())", outer="wait()", after=after)
    helpers = """
def interrupt():
    raise KeyboardInterrupt
def wait():
    try:
        sim.step()
    except KeyboardInterrupt:
        return None
sim.release()
"""
    assert said(code.replace("raised = []", "raised = []" + helpers)) == "NoneType True"
