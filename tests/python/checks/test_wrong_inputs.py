"""Wrong values for every argument and property of the public Python API: each is refused, by name and with a cure.

`public_calls.py` lists the callables with the kinds of their arguments, and `wrong_values.py` the values by kind. A
test compares that list with the package.
"""

from __future__ import annotations

import contextlib
import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sample_meshes
from public_calls import CALLS, LEFT, SETTERS
from wrong_values import KINDS

import tightloop as tl
from conftest import URDF
from tightloop import datasets, env, view

# What a message says about the way out
CURE = re.compile(
    r"\b(give|use|choose|must|expected|there (is|are)|at least|at most|leave|make|add|set|call|did you mean|name|known|"
    r"start|install|return|mend|only|needs?|cannot be|list|say|reset|in the order|without|wrong|stay|convert|send|"
    r"running)\b"
)
#: Arguments that messages call otherwise, and how.
SAID = {
    ("Scene.add_cube", "name"): r"body name",
    ("launch", "device"): r"device|adapter|gpu|GPU",
    ("launch", "on_fault"): "on.fault",
    ("launch", "on_nan"): "on.nan",
    ("launch", "outputs_at"): "outputs.at",
    ("launch", "params"): "parameter|params",
    ("Scene.load", "path"): "path|/nowhere",
    ("Sim.view", "worlds"): r"worlds",
    ("Scene.from_toml", "text"): r"scene|text|dt",
    ("Sim.latest", "timeout"): "timeout",
    ("Snapshot.from_bytes", "data"): "snapshot",
}

CASES = [
    (name, argument, place)
    for name, call in CALLS.items()
    for argument, kind in call.kinds.items()
    for place in range(len(KINDS[kind]))
]
SETTINGS = [
    (name, prop, place)
    for name, (_, kinds) in SETTERS.items()
    for prop, kind in kinds.items()
    for place in range(len(KINDS[kind]))
]


def scene() -> tl.Scene:
    made = tl.Scene(substeps=1)
    made.add_urdf(URDF, name="arm")
    made.add_cube(pos=(0.5, 0.5, 0.5))
    return made


@pytest.fixture(scope="module")
def world(tmp_path_factory) -> Iterator[Any]:
    """What callables need: a scene, a simulation of two worlds, an environment, a snapshot, a picture."""
    from tightloop.view.parts import parts

    with (
        tl.launch(scene(), worlds=2, params=("gravity", "shape_mu", "body_f")) as sim,
        contextlib.closing(env.VectorEnv("CartPoleBalance", 2)) as envs,
        contextlib.closing(env.Env("CartPoleBalance")) as single,
    ):
        sim.step()
        folder = tmp_path_factory.mktemp("films")
        with sim.record(folder / "run.tlrec"):
            sim.step(joint_f=np.zeros(15))
        envs.reset(seed=1)
        single.reset(seed=1)
        info, snapshot, frame = sim.info, sim.snapshot(), sim.forward().copy()
        picture = view.Picture(parts(info["scene"], info["scene_folder"], info["body_names"]), 64, 64)

        def send(**commands: Any) -> None:
            # a wrong number is reported by `recv`
            sim.send(**commands)
            sim.recv()

        def restore(**given: Any) -> Any:
            every: dict[str, Any] = {"snapshot": snapshot, **given}
            return sim.restore(**every)

        def render(**given: Any) -> Any:
            return picture.render(frame, **given)

        yield SimpleNamespace(
            scene=scene,
            sim=sim,
            send=send,
            restore=restore,
            envs=envs,
            single=single,
            snapshot=snapshot,
            order=(arm := scene().robots["arm"]).order(arm.dof_names[::-1]),
            dynamics=tl.Dynamics(scene()),
            ik=tl.ik(scene(), tl.Reach("arm/fr3_hand")),
            picture=SimpleNamespace(render=render, anew=picture.anew),
            own={"Sim.send": sim.send, "Sim.restore": sim.restore, "Picture.render": picture.render},
            folder=folder,
            recording=folder / "run.tlrec",
            mesh=sample_meshes.stl(tmp_path_factory.mktemp("meshes") / "box.stl"),
        )


def right(name: str, world: Any) -> dict[str, Any]:
    """The arguments of a call that are right."""
    given = dict(CALLS[name].right)
    if name == "Film":
        given |= {"out": world.folder / "film.png", "sim": world.sim}
    if name == "Sim.copy_from":
        given["source"] = world.snapshot
    if name == "linearize":
        given["sim"] = world.sim
    if name == "Scene.add_mesh":
        given["path"] = world.mesh
    if name in ("episodes", "export"):
        given["recording"] = world.recording
    if name == "export":
        given["out"] = world.folder / "demos.hdf5"
    if name == "film":
        given |= {"out": world.folder / "film.png", "source": world.sim, "seconds": 0.01}
    return given


def refused(what: str, call: Callable[[], Any], culprit: str) -> None:
    """A call raises an error of ours, whose message has the culprit and a cure."""
    try:
        result = call()
    except tl.TightloopError as problem:
        said = str(problem)
        assert re.search(rf"(?<![A-Za-z])({culprit})(?![A-Za-z])", said), f"{what}: no culprit in: {said}"
        assert CURE.search(said), f"{what}: no cure in: {said}"
        assert len(said) < 2000, f"{what}: {said}"
        return
    except BaseException as problem:
        pytest.fail(f"{what}: {type(problem).__name__}: {problem}")
    with contextlib.suppress(AttributeError):
        result.close()
    pytest.fail(f"{what} is accepted")


@pytest.mark.parametrize("name", CALLS)
def test_wrong_arguments_are_refused_by_name_and_with_a_cure(name, world):
    wrong = []
    for argument, kind in CALLS[name].kinds.items():
        for value in KINDS[kind]:
            given = right(name, world) | {argument: value}
            culprit = SAID.get((name, argument), argument) + ("|/nowhere" if "/nowhere" in str(value) else "")
            what = f"{name}({argument}={value!r:.60})"
            try:
                refused(what, lambda given=given: CALLS[name].make(world)(**given), culprit)
            except pytest.fail.Exception as found:
                wrong.append(str(found))
            except AssertionError as found:
                wrong.append(str(found).partition("\n")[0])
    assert not wrong, "\n" + "\n".join(wrong)


@pytest.mark.parametrize("name", SETTERS)
def test_wrong_values_of_properties_are_refused_and_change_nothing(name, world):
    wrong = []
    for prop, kind in SETTERS[name][1].items():
        for value in KINDS[kind]:
            owner = SETTERS[name][0](world)
            before = np.array(getattr(owner, prop), dtype=object)
            what = f"{name}.{prop} = {value!r:.60}"
            try:
                refused(what, lambda owner=owner, prop=prop, value=value: setattr(owner, prop, value), prop)
                after = np.array(getattr(owner, prop), dtype=object)
                assert np.array_equal(before, after), f"{what} changed it to {after}"
            except pytest.fail.Exception as found:
                wrong.append(str(found))
            except AssertionError as found:
                wrong.append(str(found).partition("\n")[0])
    assert not wrong, "\n" + "\n".join(wrong)


def test_there_are_a_thousand_cases():
    assert len(CASES) + len(SETTINGS) >= 1000


def test_every_public_callable_is_tried():
    """Every public name, every method with arguments, every argument and every property that can be set."""
    missing = []
    for module in (tl, env, view, datasets):
        for name in module.__all__:
            thing = getattr(module, name)
            if name.startswith("_") or (isinstance(thing, type) and issubclass(thing, Exception)):
                continue
            if name not in LEFT:
                missing += untried(name, thing)
            if isinstance(thing, type) and thing.__module__.startswith("tightloop") and name not in ("Names", "Task"):
                missing += untried_members(name, thing)
    assert not missing, missing


#: Methods for the package's own use, which take what other parts of it make.
OWN = (
    "bind",
    "file_values",
    "apply",
    "close_extras",
    "of_daemon",
    "with_numbers",
    "with_worlds",
    "with_model",
    "of_worlds",
    "in_double",
    "rows",
    "add",
    "jac",
)


def untried(name: str, thing: Callable[..., Any]) -> list[str]:
    if name not in CALLS:
        return [name]
    call = CALLS[name]
    known = {
        *call.kinds,
        *call.left,
        *right(name, SimpleNamespace(folder=Path(), sim=None, snapshot=None, mesh=Path(), recording=Path())),
    }
    taken = inspect.signature(thing).parameters.values()
    plain = [argument for argument in taken if argument.kind not in (argument.VAR_KEYWORD, argument.VAR_POSITIONAL)]
    return [f"{name}({argument.name})" for argument in plain if argument.name not in ("self", *known)]


def untried_members(name: str, thing: type) -> list[str]:
    missing = []
    for member in dir(thing):
        value = inspect.getattr_static(thing, member)
        owner = next(base for base in thing.__mro__ if member in vars(base))
        if member.startswith("_") or member in OWN or not owner.__module__.startswith("tightloop."):
            continue
        if hasattr(type(value), "__set__") and getattr(value, "fset", value) is not None:
            if hasattr(value, "fset") or "robot_properties" in type(value).__module__:
                tried = SETTERS.get(name, (None, {}))[1]
                missing += [] if member in tried else [f"{name}.{member} ="]
        elif callable(getattr(thing, member)) and inspect.signature(getattr(thing, member)).parameters.keys() - {
            "self"
        }:
            missing += untried(f"{name}.{member}", getattr(thing, member))
    return missing
