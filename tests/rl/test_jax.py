"""Simulations and environments in programs of JAX: the bits of a Python loop, and errors in place of wrong results."""

from __future__ import annotations

import gc
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

import tightloop as tl
from tightloop import _core
from tightloop.adapters.jax import JaxSim, programs, views
from tightloop.assets import ANT, CARTPOLE

STEPS, WORLDS = 10_000, 5
WAYS = pytest.mark.parametrize("via", programs.WAYS)


def cart() -> tl.Scene:
    scene = tl.Scene(dt=1 / 200, substeps=2)
    scene.add_urdf(CARTPOLE, name="cart")
    scene.randomize(joint_q={"cart": tl.Uniform(-0.1, 0.1)})
    return scene


def launch(scene: tl.Scene | None = None, worlds: int = WORLDS, **options: Any) -> tl.Sim:
    return tl.launch(scene or cart(), worlds=worlds, threads=1, **options)


@pytest.fixture
def sim() -> Iterator[tl.Sim]:
    with launch() as sim:
        yield sim


def forces(steps: int, worlds: int = WORLDS, dofs: int = 2, seed: int = 0) -> Any:
    return np.random.default_rng(seed).uniform(-3, 3, (steps, worlds, dofs)).astype(np.float32)


def steps_of(made: JaxSim) -> Any:
    """A program that steps through forces."""
    return jax.jit(lambda token, given: lax.scan(lambda t, f: made.step(t, joint_f=f), token, given))


def loop(sim: tl.Sim, given: Any) -> tuple[Any, Any]:
    frames = [(frame.joint_q.copy(), frame.joint_qd.copy()) for frame in (sim.step(joint_f=f) for f in given)]
    return tuple(np.stack(part) for part in zip(*frames, strict=True))  # type: ignore[return-value]


def failed(call: Any) -> str:
    """What a program that fails says."""
    with pytest.raises(jax.errors.JaxRuntimeError) as raised:
        jax.block_until_ready(call())
    return str(raised.value)


def test_ten_thousand_steps_of_a_scan_have_the_bits_of_a_python_loop(sim):
    given = forces(STEPS)
    sim.reset(seed=7)
    joint_q, joint_qd = loop(sim, given)
    program = steps_of(JaxSim(sim))
    for _ in range(2):
        sim.reset(seed=7)
        _, frames = program(JaxSim(sim).token(), given)
        assert np.array_equal(frames.joint_q, joint_q) and np.array_equal(frames.joint_qd, joint_qd)
        jax.clear_caches()  # and compiled again


@WAYS
def test_contacts_resets_and_writes_in_a_scan_have_the_bits_of_a_python_loop(via):
    scene = tl.Scene(dt=1 / 200, substeps=2)
    scene.add_urdf(ANT, name="ant", floating=True, pos=(0, 0, 0.6))
    scene.add_ground()
    scene.randomize(joint_q={"ant": tl.Uniform(-0.05, 0.05)})
    steps, generator = 600, np.random.default_rng(1)
    with launch(scene, fields=("joint_q", "joint_qd", "body_q")) as sim:
        made = JaxSim(sim, ("joint_q", "body_q", "status"), via=via)
        given = forces(steps, dofs=len(sim.dof_names))
        masks = generator.random((steps, WORLDS)) < 0.01
        speeds = generator.uniform(-1, 1, (steps, len(sim.dof_names))).astype(np.float32)
        expected = []
        sim.reset(seed=1)
        for force, mask, speed in zip(given, masks, speeds, strict=True):
            sim.step(joint_f=force)
            sim.reset(mask=mask)
            expected.append(sim.write(joint_qd=speed, mask=mask).copy())

        def step(token, now):
            force, mask, speed = now
            token, _ = made.step(token, joint_f=force)
            token, _ = made.reset(token, mask=mask)
            return made.write(token, joint_qd=speed, mask=mask)

        sim.reset(seed=1)
        token, frames = jax.jit(lambda token, now: lax.scan(step, token, now))(made.token(), (given, masks, speeds))
        assert int(token[1]) == 3 * steps and masks.any(axis=0).all()
        for name in made.fields:
            assert np.array_equal(getattr(frames, name), np.stack([getattr(frame, name) for frame in expected])), name


def test_seeds_of_a_reset_are_those_of_sim_reset(sim):
    made = JaxSim(sim)
    token, frame = jax.jit(lambda token, seed: made.reset(token, seed=seed))(made.token(), jnp.arange(5) + 40)
    assert np.array_equal(frame.joint_q, sim.reset(seed=[40, 41, 42, 43, 44]).joint_q)
    _, frame = made.reset(token, seed=9, joint_qd=[1.0, 2.0])
    expected = sim.reset(seed=9, joint_qd=[1.0, 2.0])
    assert np.array_equal(frame.joint_q, expected.joint_q) and np.array_equal(frame.joint_qd, expected.joint_qd)


@pytest.mark.parametrize("x64", [False, True])
def test_seeds_are_whole_numbers_below_2_to_the_32_or_a_key(sim, x64):
    made = JaxSim(sim)
    reset = jax.jit(lambda token, seed: made.reset(token, seed=seed))
    with jax.enable_x64(x64):
        for wrong in (-1, 2**32, 2**70, np.int64(2**32), np.array([0, 1, 2, 3, 2**32]), 1.5, True, [1, 2], jnp.ones(5)):
            with pytest.raises(
                tl.CommandRefused, match=r"seed is .*; give a key of jax\.random, or whole numbers from 0"
            ):
                made.reset(made.token(), seed=wrong)
        _, frame = made.reset(made.token(), seed=2**32 - 1)
        assert np.array_equal(frame.joint_q, sim.reset(seed=2**32 - 1).joint_q)
        for key in (jax.random.key(3), jax.random.PRNGKey(3)):
            drawn = np.asarray(jax.random.bits(key, (WORLDS,), np.uint32))
            expected = sim.reset(seed=drawn).joint_q.copy()
            for call in (made.reset, reset):
                assert np.array_equal(call(made.token(), seed=key)[1].joint_q, expected)
        with pytest.raises(tl.CommandRefused, match=r"seed is of key<fry> and shape \(5,\)"):
            made.reset(made.token(), seed=jax.random.split(jax.random.key(0), WORLDS))


def test_double_precision_has_the_bits_of_a_python_loop_and_needs_x64():
    given = forces(200).astype(np.float64) / 3
    with launch(precision="f64") as sim:
        with pytest.raises(tl.ArgumentError, match=r"`joint_q` is float64.*jax_enable_x64"):
            JaxSim(sim)
        with jax.enable_x64(True):
            sim.reset(seed=7)
            joint_q, _ = loop(sim, given)
            sim.reset(seed=7)
            made = JaxSim(sim)
            _, frames = steps_of(made)(made.token(), given)
            assert frames.joint_q.dtype == np.float64 and np.array_equal(frames.joint_q, joint_q)


def test_a_step_whose_results_nobody_uses_is_made_and_one_in_a_branch_only_there(sim):
    made = JaxSim(sim, ())
    jax.block_until_ready(jax.jit(lambda token: (made.step(token), 0)[1])(made.token()))
    assert sim.forward().step.tolist() == [1] * WORLDS
    branch = jax.jit(lambda token, is_on: lax.cond(is_on, lambda t: made.step(t)[0], lambda t: t, token))
    token = branch(made.token(), False)
    assert sim.forward().step.tolist() == [1] * WORLDS
    jax.block_until_ready(branch(token, True))
    assert sim.forward().step.tolist() == [2] * WORLDS


def test_equal_steps_are_not_merged(sim):
    made = JaxSim(sim)

    def twice(token, force):
        token, first = made.step(token, joint_f=force)
        token, second = made.step(token, joint_f=force)
        return first.joint_q, second.joint_q

    sim.reset(seed=2)
    found = jax.jit(twice)(made.token(), forces(1)[0])
    sim.reset(seed=2)
    joint_q, _ = loop(sim, np.repeat(forces(1), 2, axis=0))
    assert np.array_equal(found, joint_q)


def test_two_simulations_in_one_program_do_not_disturb_each_other(sim):
    with launch(worlds=3) as other:
        one, two = JaxSim(sim), JaxSim(other)
        given = forces(300), forces(300, 3, seed=1)

        def step(tokens, now):
            first, frame = one.step(tokens[0], joint_f=now[0])
            # one of the two steps on what the other has become
            second, after = two.step(tokens[1], joint_f=now[1] + frame.joint_q[:3])
            return (first, second), (frame.joint_q, after.joint_q)

        for each in (sim, other):
            each.reset(seed=4)
        _, found = jax.jit(lambda t, g: lax.scan(step, t, g))((one.token(), two.token()), given)
        for each in (sim, other):
            each.reset(seed=4)
        expected, _ = loop(sim, given[0])
        after, _ = loop(other, given[1] + expected[:, :3])
        assert np.array_equal(found[0], expected) and np.array_equal(found[1], after)


def test_a_program_runs_another_simulation_of_the_same_shapes_without_a_new_trace(sim):
    made, traces = JaxSim(sim), []

    def traced(token, given):
        traces.append(1)
        return lax.scan(lambda t, f: made.step(t, joint_f=f), token, given)

    program, given = jax.jit(traced), forces(50)
    sim.reset(seed=3)
    _, frames = program(made.token(), given)
    with launch() as other:
        other.reset(seed=3)
        _, again = program(JaxSim(other).token(), given)
    assert len(traces) == 1 and np.array_equal(frames.joint_q, again.joint_q)
    with launch(worlds=WORLDS + 1) as larger:
        said = failed(lambda: program(JaxSim(larger).token(), given))
    assert f"the simulation has {WORLDS + 1} worlds, and the program gives {WORLDS} rows" in said


@WAYS
def test_a_killed_daemon_is_an_error_within_a_second_and_a_new_one_goes_on(via):
    sim = launch()
    made = JaxSim(sim, via=via)
    program = jax.jit(lambda token: lax.fori_loop(0, 10**8, lambda _, t: made.step(t)[0], token))
    killed = []

    def kill():
        time.sleep(0.5)
        killed.append(time.monotonic())
        os.kill(sim.pid, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    said = failed(lambda: program(made.token()))
    took = time.monotonic() - killed[0]
    thread.join()
    assert "DaemonLost: daemon" in said and f"(pid {sim.pid}) is gone and its state is lost; launch a new one" in said
    # a client looks for the daemon every 50 ms; the rest is for a busy machine
    assert took < 1.0
    sim.close()
    with launch() as other:
        new = JaxSim(other, via=via)
        assert new.forward(new.token())[1].joint_q.shape == (WORLDS, 2)


def test_a_token_that_a_program_would_keep_is_refused(sim):
    made = JaxSim(sim)
    with pytest.raises(tl.ArgumentError, match=r"token\(\) was called inside of a program; call it before"):
        jax.jit(lambda: made.forward(made.token()))()
    with pytest.raises(tl.ArgumentError, match=r"token is .*; give what `token\(\)` or the last call"):
        made.forward(jnp.zeros(3))


@WAYS
def test_closing_the_simulation_ends_a_program(via):
    sim = launch()
    made = JaxSim(sim, via=via)
    program = jax.jit(lambda token: lax.fori_loop(0, 10**8, lambda _, t: made.step(t)[0], token))
    thread = threading.Timer(0.3, sim.close)
    thread.start()
    assert f"SimClosed: simulation `{sim.name}` was closed" in failed(lambda: program(made.token()))
    thread.join()
    for call in (made.token, lambda: JaxSim(sim)):
        with pytest.raises(tl.SimClosed):
            call()


def test_a_compiled_program_whose_simulation_was_dropped_is_an_error():
    sim = launch()
    made = JaxSim(sim)
    token, given = made.token(), forces(2)
    program = steps_of(made).lower(token, given).compile()
    del sim, made
    gc.collect()
    assert "was closed or dropped; launch or attach again" in failed(lambda: program(token, given))


@WAYS
def test_a_token_is_used_once(sim, via):
    made = JaxSim(sim, via=via)
    old = made.token()
    made.step(made.step(old)[0])
    said = failed(lambda: made.step(old))
    assert f"the token of call 0 of simulation `{sim.name}` was used before: the worlds are at call 2" in said
    assert sim.forward().step.tolist() == [2] * WORLDS
    made.step(made.token())
    assert "is of nothing in this process" in failed(lambda: made.step(jnp.array([12345, 0], jnp.uint32)))
    with pytest.raises(tl.ArgumentError, match="token is"):
        made.step(0)


@WAYS
def test_what_the_daemon_refuses_is_an_error_and_the_worlds_stay(sim, via):
    made, given = JaxSim(sim, via=via), forces(8)
    given[5, 3, 1] = np.nan
    program = steps_of(made)
    said = failed(lambda: program(made.token(), given))
    assert "CommandRefused: `joint_f` is NaN in world 3 for `cart/hinge`; nothing was written" in said
    assert sim.forward().step.tolist() == [5] * WORLDS
    program(made.token(), forces(8))  # and goes on
    sim.send()
    assert "CommandRefused: a step was sent and its frame was not received; call recv first" in failed(
        lambda: made.step(made.token())
    )
    sim.recv()


def test_frames_that_are_held_are_an_error():
    with launch(frames_held=1) as sim:
        made, frame = JaxSim(sim), sim.step()
        assert "FramesHeld: 1 frames are held" in failed(lambda: made.step(made.token()))
        del frame
        made.step(made.token())


@WAYS
@pytest.mark.parametrize("wrap", [lambda f: f, jax.jit], ids=["plain", "jit"])
def test_gradients_and_vmap_are_refused_by_name(sim, via, wrap):
    made, given = JaxSim(sim, via=via), jnp.asarray(forces(3))
    run = wrap(steps_of(made))
    before, token = sim.forward().step.tolist(), made.token()
    for change in (jax.grad, jax.value_and_grad, jax.jacfwd, jax.jacrev, jax.hessian):
        with pytest.raises(tl.ArgumentError, match=r"no gradient in JAX.*tightloop\.linearize"):
            change(lambda g: run(token, g)[1].joint_q.sum())(given)
    for change in (jax.vmap, lambda f: jax.jit(jax.vmap(f))):
        with pytest.raises(tl.ArgumentError, match=r"vmap does not go over a step.*its worlds are the batch"):
            change(lambda g: run(token, g)[1].joint_q)(given[None])
        with pytest.raises(tl.ArgumentError, match="its worlds are the batch"):
            change(lambda mask: made.reset(token, mask=mask)[1])(jnp.ones((2, WORLDS), bool))
    assert sim.forward().step.tolist() == before
    # with its commands kept out of the gradient, a step may be part of a loss
    loss = jax.grad(lambda w: (w * run(token, lax.stop_gradient(w * given))[1].joint_q).sum())
    assert np.isfinite(loss(1.0))


def test_commands_and_masks_that_do_not_fit_are_refused_by_name(sim):
    made = JaxSim(sim)
    for given, said in (
        ({"joint_f": jnp.ones((5, 3))}, r"joint_f: expected shape \(5, 2\), or \(2,\) for all worlds; got \(5, 3\)"),
        ({"joint_f": {"cart/slide": 1.0}}, r"joint_f is a dict; in JAX give an array in the order of the names"),
        ({"joint_f": jnp.ones((5, 2), bool)}, "dtype bool is not a real number"),
        ({"joint_f": "left"}, "joint_f is 'left'"),
        ({"joint_f": [[1.0, 2.0], [3.0]]}, r"joint_f is \[\[1.0, 2.0\], \[3.0\]\]; give an array of real numbers"),
        ({"ctrl": jnp.ones(1)}, "ctrl: no model of this scene has any; leave it out"),
    ):
        with pytest.raises(tl.CommandRefused, match=said):
            made.step(made.token(), **given)
    for mask in (jnp.ones(5), jnp.ones(4, bool)):
        with pytest.raises(tl.CommandRefused, match=r"mask: got .* bool, shape \(5,\)"):
            made.reset(made.token(), mask=mask)
    with pytest.raises(tl.ConstantParameter, match=r'name it at launch: params=\("body_f",\)'):
        jax.jit(lambda token, push: made.step(token, body_f=push))(made.token(), jnp.zeros((len(sim.body_names), 6)))
    with pytest.raises(tl.UnknownField, match="body_qd"):
        JaxSim(sim, ("body_qd",))
    with pytest.raises(tl.SignatureError, match="joint_targets"):
        made.step(made.token(), joint_targets=0)
    for wrong in (lambda: JaxSim(cart()), lambda: JaxSim(sim, "joint_q"), lambda: JaxSim(sim, via="gpu")):
        with pytest.raises(tl.ArgumentError):
            wrong()


def test_commands_for_all_worlds_of_other_types_and_of_bodies_are_those_of_sim_step():
    with launch(params=("body_f",)) as sim:
        made, push = JaxSim(sim), np.zeros((len(sim.body_names), 6), np.float32)
        push[-1, 0] = 2.0
        given = [{"joint_f": np.array([1, 0])}, {"joint_f": jnp.ones((5, 2), jnp.bfloat16)}, {"body_f": push}]
        sim.reset(seed=1)
        found, token = [], made.token()
        for commands in given:
            token, frame = made.step(token, **commands)
            found.append(np.asarray(frame.joint_q))
        sim.reset(seed=1)
        for commands, joint_q in zip(given, found, strict=True):
            plain = {name: np.asarray(value).astype(np.float32) for name, value in commands.items()}
            assert np.array_equal(sim.step(**plain).joint_q, joint_q)


def test_views_are_the_memory_of_the_frame(sim):
    frame = sim.step()
    seen = views(frame, ("joint_q", "joint_qd", "status"))
    for name in seen._fields:
        assert getattr(seen, name).unsafe_buffer_pointer() == getattr(frame, name).ctypes.data, name
    kept = frame.joint_q.copy()
    del frame
    for _ in range(10):
        sim.step(joint_f=[1.0, 0.0])
    assert np.array_equal(seen.joint_q, kept)
    with pytest.raises(tl.ArgumentError, match="`step` is uint64"):
        views(sim.step(), ("step",))


SEVERAL = """
import sys, jax, jax.numpy as jnp, tightloop as tl
sys.path[:0] = [sys.argv[1]]
from test_jax import launch
from tightloop.adapters.jax import JaxSim
with launch() as sim:
    made = JaxSim(sim)
    try:
        jax.block_until_ready(jax.pmap(lambda token: made.step(token))(jnp.stack([made.token()] * 2)))
    except Exception as error:
        print(len(jax.devices()), error)
    print("steps", int(sim.forward().step[0]))
"""


def test_a_program_on_several_devices_is_an_error():
    flags = os.environ | {"XLA_FLAGS": "--xla_force_host_platform_device_count=2"}
    command = [sys.executable, "-c", SEVERAL, str(Path(__file__).parent)]
    done = subprocess.run(command, env=flags, capture_output=True, text=True, timeout=60, check=False)
    assert "was used before" in done.stdout and "Run the program on one device" in done.stdout, done.stderr
    assert done.stdout.startswith("2 ") and "steps 1" in done.stdout


def test_a_program_on_a_gpu_is_an_error():
    # the handler of other devices, under another name on the CPU
    _, elsewhere = _core.xla_handlers(*programs._version_of_interface())
    jax.ffi.register_ffi_target("tightloop_elsewhere", jax.ffi.pycapsule(elsewhere), platform="cpu")
    call = jax.ffi.ffi_call("tightloop_elsewhere", jax.ShapeDtypeStruct((2,), np.uint32), has_side_effect=True)
    said = failed(lambda: call(jnp.zeros(2, jnp.uint32), call="step", inputs="", fields=""))
    assert "GpuMemoryError: the program runs on a GPU" in said and "JAX_PLATFORMS=cpu" in said


def test_without_foreign_functions_there_is_a_warning_and_a_callback_steps(sim, monkeypatch):
    monkeypatch.setattr(programs, "_interface_problem", lambda: "JAX 0.4 has no jax.ffi")
    with pytest.warns(tl.TightloopWarning, match=r"JAX 0\.4 has no jax\.ffi.*io_callback.*pip install -U jax"):
        made = JaxSim(sim)
    assert made.via == "io_callback"
    made.step(made.token())
    with pytest.raises(tl.MissingLibrary, match=r"no jax\.ffi; pip install -U jax"):
        JaxSim(sim, via="ffi")
