"""A process reports each mistake once, however many launches, environments and worlds have it."""

from __future__ import annotations

import subprocess
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

import tightloop as tl
from tightloop.checks import advice
from tightloop.env import Observed
from tightloop.tasks.cartpole import CartPoleBalance


@contextmanager
def counted() -> Iterator[list[str]]:
    """The texts of all warnings, also of those that Python would show once a line."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield texts
    texts += [str(warning.message) for warning in caught]


def slow(dt: float = 0.1) -> tl.Scene:
    scene = tl.Scene(dt=dt, substeps=1)
    scene.add_cube()
    return scene


def test_several_launches_of_one_mistake_tell_of_it_once_and_of_another_again():
    with counted() as texts:
        tl.launch(slow(), worlds=1).close()
        for _ in range(2):
            tl.launch(slow(), worlds=2).close()
        tl.launch(slow(0.2), worlds=1).close()
    assert [text.split(" s.")[0] for text in texts] == ["dt is 0.1", "dt is 0.2"]


def test_other_numbers_of_one_mistake_in_a_running_simulation_are_the_same_mistake():
    gravity = np.full((4, 3), [0, 0, -9.81])
    scene = tl.Scene()
    scene.add_ground()
    scene.add_cube(pos=(0, 0, 1))
    with counted() as texts:
        for world in range(3):
            with tl.launch(scene, worlds=4, params=("gravity",)) as sim:
                values = gravity.copy()
                values[world, 2] = 9.81
                sim.params.gravity = values
    assert len(texts) == 1 and "points up" in texts[0]


def test_environments_with_the_same_mistake_tell_of_it_once(envs):
    class Narrow(CartPoleBalance):
        def observed(self):
            *others, last = super().observed()
            return [*others, Observed(last.name, 5.0, 5.5, size=last.size)]

    with counted() as texts:
        for seed in range(3):
            made = envs(Narrow, 2)
            made.reset(seed=seed)
            for _ in range(70):
                made.step(made.action_space.sample())
    assert len(texts) == 1 and "beyond its bounds" in texts[0]


def test_a_fault_is_reported_once_for_each_line_that_meets_it():
    def scene() -> tl.Scene:
        made = tl.Scene(gravity=(0, 0, 0))
        made.add_cube()
        return made

    def push(spun: int) -> np.ndarray:
        force = np.zeros((4, 6))
        force[spun, 3:] = 300.0
        return force

    with counted() as texts:
        for world in range(3):
            with tl.launch(scene(), worlds=4) as sim:
                sim.step(joint_f=push(world))
        with tl.launch(scene(), worlds=4) as sim:
            sim.step(joint_f=push(3))
    assert len(texts) == 2 and all("1 world of 4 faulted" in text for text in texts)


def test_a_warning_that_is_an_error_is_one_each_time():
    for _ in range(2):
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            with pytest.raises(tl.TightloopWarning, match="said"):
                advice.warn("said")


def test_a_warning_that_was_ignored_is_reported_where_it_is_not():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        advice.warn("hidden")
    with counted() as texts:
        advice.warn("hidden")
        advice.warn("hidden")
    assert texts == ["hidden"]


def test_a_program_prints_a_mistake_once(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        "import tightloop as tl\n"
        "scene = tl.Scene(dt=0.1, substeps=1)\n"
        "scene.add_cube()\n"
        "tl.launch(scene, worlds=1).close()\n"
        "tl.launch(scene, worlds=1).close()\n"
    )
    done = subprocess.run([sys.executable, str(program)], capture_output=True, text=True, check=True)
    assert done.stderr.count("dt is 0.1 s") == 1, done.stderr
