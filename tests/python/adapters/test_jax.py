"""Steps in programs of JAX, as far as they run without it; tests/rl has the others."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop import _core
from tightloop.assets import CARTPOLE

WORLDS = 3


@pytest.fixture
def sim() -> Any:
    scene = tl.Scene(dt=1 / 200, substeps=2)
    scene.add_urdf(CARTPOLE, name="cart")
    with tl.launch(scene, worlds=WORLDS, threads=1) as made:
        yield made


def token(sim: tl.Sim) -> Any:
    return np.array(sim._client.xla_token(), np.uint32)


def call(name: str, inputs: str, *operands: Any, fields: str = "joint_q", width: int = 2) -> list[Any]:
    outputs = [np.zeros(2, np.uint32), np.zeros((WORLDS, width), np.float32)]
    _core.xla_call(name, inputs, fields, list(operands), outputs)
    return outputs


def test_a_call_is_that_of_the_simulation_and_counts(sim: tl.Sim) -> None:
    force = np.linspace(-1, 1, 2 * WORLDS, dtype=np.float32).reshape(WORLDS, 2)
    after, joint_q = call("step", "joint_f", token(sim), force)
    assert after.tolist() == [token(sim)[0], 1] and np.array_equal(joint_q, sim.forward().joint_q)
    sim.reset()
    assert np.array_equal(sim.step(joint_f=force).joint_q, joint_q)
    mask = np.array([True, False, True])
    after, there = call("reset", "joint_q", after, mask, force)
    assert np.array_equal(there, np.where(mask[:, None], force, joint_q)) and after[1] == 2


@pytest.mark.parametrize(
    ("given", "error", "said"),
    [
        (lambda t, f: call("step", "", t * np.uint32(0)), tl.CommandRefused, "is of nothing in this process"),
        (lambda t, f: call("step", "", t + np.uint32(1000)), tl.CommandRefused, "is of nothing in this process"),
        (lambda t, f: call("step", "", t + np.array([0, 1], np.uint32)), tl.CommandRefused, "was used before"),
        (lambda t, f: call("step", "joint_f", t, f[:2]), tl.CommandRefused, "3 worlds, and the program gives 2 rows"),
        (lambda t, f: call("step", "joint_f", t, f * np.nan), tl.CommandRefused, "`joint_f` is NaN in world 0"),
        (lambda t, f: call("step", "ctrl", t, f), tl.CommandRefused, '"ctrl" cannot be commanded'),
        (lambda t, f: call("step", "", t, fields="body_qd"), tl.UnknownField, "frames carry no field"),
        (lambda t, f: call("step", "", t, width=3), tl.CommandRefused, r"joint_q is .*, and the program was made for"),
        (lambda t, f: call("step", "joint_f", t), tl.TightloopError, "the call lacks `joint_f`"),
        (lambda t, f: call("leap", "", t), tl.TightloopError, "there is no call `leap`"),
        (lambda t, f: call("step", "", f), tl.TightloopError, "`token` is"),
        (lambda t, f: call("step", "joint_f", t, f.astype(np.int16)), TypeError, "int16"),
    ],
)
def test_what_does_not_fit_is_an_error(
    sim: tl.Sim, given: Callable[[Any, Any], Any], error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        given(token(sim), np.zeros((WORLDS, 2), np.float32))


def test_a_closed_simulation_is_an_error(sim: tl.Sim) -> None:
    last = token(sim)
    sim.close()
    with pytest.raises(tl.SimClosed, match="was closed or dropped"):
        call("step", "", last)


def test_a_function_is_called_with_copies_and_its_errors_pass_through() -> None:
    seen = []

    def function(name: str, arrays: list[Any]) -> list[Any]:
        seen.append((name, arrays))
        if name == "fail":
            raise tl.CommandRefused("no")
        return [2 * arrays[0]] if name == "step" else []

    number = _core.xla_function(function, "the function")
    given = np.ones((WORLDS, 2), np.float32)
    after, doubled = call("step", "x", np.array([number, 0], np.uint32), given)
    assert np.array_equal(doubled, 2 * given) and seen[0][0] == "step" and after.tolist() == [number, 1]
    assert seen[0][1][0] is not given
    for name, said in (("fail", "no"), ("none", "the function returned 0 arrays for 1")):
        with pytest.raises(tl.TightloopError, match=said):
            call(name, "x", after, given)


def test_an_unknown_major_version_of_the_interface_is_refused() -> None:
    assert len(set(_core.xla_handlers(0, 3))) == 2
    with pytest.raises(ValueError, match=r"version 1\.0 of XLA's interface is not known"):
        _core.xla_handlers(1, 0)


def test_without_jax_the_error_says_how_to_install_it() -> None:
    code = "import sys; sys.modules['jax'] = None; import tightloop.adapters.jax"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert "MissingLibrary: there is no module `jax`: pip install 'jax'" in done.stderr
