"""Calls with arguments that do not exist, too many or too few: each is refused with its name and what the call takes.

The callables are those of `public_calls.py`, which `test_wrong_inputs.py` compares with the package.
"""

# the calls are wrong on purpose
# pyright: reportCallIssue=false, reportArgumentType=false
from __future__ import annotations

import contextlib
import copy
import inspect
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import test_wrong_inputs
from public_calls import CALLS

import tightloop as tl
from conftest import URDF
from tightloop import env, view
from tightloop.checks.signatures import checked_calls

#: The fixture with what the callables need.
world = test_wrong_inputs.world
#: Calls whose ``**`` names what only the run knows, with their own error.
OPEN = {"Params.write": tl.UnknownField}


def own(name: str, world: Any) -> tuple[Callable[..., Any], inspect.Signature]:
    """The callable of the package, without what the fixture put around it."""
    call = world.own.get(name) or CALLS[name].make(world)
    return call, inspect.signature(call)


def said(call: Callable[[], Any], error: type[Exception] = tl.SignatureError) -> str:
    with pytest.raises(tl.TightloopError) as caught:
        call()
    assert type(caught.value) is error, f"{type(caught.value).__name__}: {caught.value}"
    return str(caught.value)


@pytest.mark.parametrize("name", CALLS)
def test_an_argument_that_does_not_exist_is_named_with_the_nearest(name, world):
    call, signature = own(name, world)
    error = OPEN.get(name, tl.SignatureError)
    known = [
        one.name for one in signature.parameters.values() if one.kind in (one.POSITIONAL_OR_KEYWORD, one.KEYWORD_ONLY)
    ]
    for argument in known:
        wrong = f"{argument}z"
        message = said(lambda wrong=wrong: call(**{wrong: 1}), error)
        assert re.search(rf"[`']{wrong}[`']", message), message
        if error is tl.SignatureError:
            assert re.search(rf"did you mean .*`{argument}`", message), message
    message = said(lambda: call(thisisnowhere=1), error)
    assert "thisisnowhere" in message and all(argument in message for argument in known if name not in OPEN), message


@pytest.mark.parametrize("name", CALLS)
def test_too_many_values_without_a_name_are_refused_with_what_has_one(name, world):
    call, signature = own(name, world)
    places = [one.name for one in signature.parameters.values() if one.kind is one.POSITIONAL_OR_KEYWORD]
    message = said(lambda: call(*range(len(places) + 1)))
    assert f"got {len(places) + 1}" in message and all(f"`{place}`" in message for place in places), message
    assert re.search("give the others by name, such as|leave the others out", message), message
    if places:
        message = said(lambda: call(1, **{places[0]: 1}))
        assert re.search(f"`{places[0]}` is given twice.*leave one", message), message


@pytest.mark.parametrize("name", CALLS)
def test_arguments_that_are_missing_are_named(name, world):
    call, signature = own(name, world)
    needed = [
        one.name
        for one in signature.parameters.values()
        if one.default is one.empty and one.kind not in (one.VAR_KEYWORD, one.VAR_POSITIONAL)
    ]
    if needed:
        message = said(call)
        assert re.search(r"(is|are) missing; give", message), message
        assert all(f"`{argument}`" in message for argument in needed), message


def test_messages_name_the_call_the_culprit_and_the_cure(world):
    scene = world.scene()
    for call, message in (
        (
            lambda: world.sim.step(joint_targets=1),
            "Sim.step: there is no argument `joint_targets`; did you mean `joint_target_q",
        ),
        (
            lambda: world.sim.step([1.0]),
            "Sim.step: it takes no argument without a name and got 1; give the others by name, such as joint_f=…",
        ),
        (lambda: world.sim.reset(masks=1), "Sim.reset: there is no argument `masks`; did you mean `mask`?"),
        (lambda: world.sim.reset(env_ids=[0]), "did you mean `mask`?"),
        (lambda: world.sim.write(qpos=1), "Sim.write: there is no argument `qpos`; did you mean `joint_q`?"),
        (lambda: world.sim.close(True), "Sim.close: it takes no argument and got 1; call close()"),
        (
            lambda: scene.randomize(body_mass=tl.Uniform(0.8, 1.2)),
            'there is no argument `body_mass`; it is a parameter: randomize(params={"body_mass": ',
        ),
        (lambda: scene.add_box(size=(1, 1, 1)), "`half_extents` are half of each edge"),
        (lambda: scene.add_capsule(radius=0.1, length=1), "`half_height` is half the length of its straight part"),
        (lambda: scene.add_ground(pos=(0, 0, 1)), "there is no argument `pos`; `z` is its height"),
        (lambda: world.sim.reset(worlds=[0]), "`mask` has True for the worlds meant"),
        (lambda: tl.launch(scene, world=4), "launch: there is no argument `world`; did you mean `worlds`"),
        (lambda: tl.launch(scene, num_envs=4), "did you mean `worlds`?"),
        (
            lambda: tl.launch(scene),
            "launch: `worlds` is missing; give it. The call is launch(scene, *, worlds, groups=…",
        ),
        (lambda: tl.launch(worlds=1), "launch: `scene` is missing"),
        (tl.attach, "attach: `name` is missing; give it. The call is attach(name, *, timeout=…)"),
        (lambda: tl.Scene(gravitiy=1), "Scene: there is no argument `gravitiy`; did you mean `gravity`?"),
        (
            lambda: tl.Scene(0.001),
            "Scene: it takes no argument without a name and got 1; give the others by name, such as dt=…",
        ),
        (lambda: scene.add_urdf(URDF, "arm"), "Scene.add_urdf: it takes `path` without a name and got 2"),
        (lambda: scene.add_ground(pos=(0, 0, 1)), "Scene.add_ground: there is no argument `pos`"),
        (lambda: scene.add_cube(size=1), "Scene.add_cube: there is no argument `size`"),
        (lambda: scene.add_box(half_extent=(1, 1, 1)), "did you mean `half_extents`?"),
        (lambda: scene.add_sphere(radius=1, friction=1), "did you mean `mu`?"),
        (lambda: tl.Uniform(0.0), "Uniform: `high` is missing"),
        (tl.Snapshot.load, "Snapshot.load: `path` is missing"),
        (lambda: env.VectorEnv("CartPoleBalance", worlds=3), "there is no argument `worlds`; did you mean `num_envs`?"),
        (lambda: env.VectorEnv("FrankaReach", controls="joint_target"), "did you mean `control`?"),
        (
            lambda: env.Env("CartPoleBalance", sead=3),
            "environment of the task CartPoleBalance: there is no argument `sead`",
        ),
        (env.VectorEnv, "VectorEnv: `task` is missing"),
        (world.envs.step, "VectorEnv.step: `actions` is missing"),
        (
            lambda: world.envs.reset(3),
            "VectorEnv.reset: it takes no argument without a name and got 1; give the others by name, such as seed=…",
        ),
        (lambda: view.Camera((0, 0, 1)), "Camera: `target` is missing"),
    ):
        assert message in (found := said(call)), found


class Mine(env.VectorEnv):
    """A user's own class."""


def test_a_subclass_is_named_by_its_own_name():
    with contextlib.closing(Mine("CartPoleBalance", 1)) as envs:
        assert "Mine.reset: there is no argument `sead`" in said(lambda: envs.reset(sead=1))


def test_errors_inside_of_a_call_stay_as_they_are():
    @checked_calls
    def outer(value: Any) -> Any:
        return len(value)

    with pytest.raises(TypeError, match=r"object of type 'int' has no len") as caught:
        outer(3)
    assert type(caught.value) is TypeError


def test_signatures_docs_and_pickles_are_those_of_the_functions():
    assert [*inspect.signature(tl.launch).parameters][:3] == ["scene", "worlds", "groups"]
    assert [*inspect.signature(tl.Scene.add_box).parameters][:2] == ["self", "half_extents"]
    assert [*inspect.signature(tl.Scene).parameters][:2] == ["dt", "substeps"]
    assert (tl.launch.__doc__ or "").startswith("Start a daemon")
    assert pickle.loads(pickle.dumps(tl.launch)) is tl.launch
    assert pickle.loads(pickle.dumps(tl.Uniform(0.0, 1.0))) == tl.Uniform(0.0, 1.0)
    scene = copy.deepcopy(tl.Scene(substeps=3))
    assert scene.substeps == 3
    assert "def add_urdf(" in inspect.getsource(tl.Scene.add_urdf)


def test_warnings_point_at_the_line_of_the_caller(tmp_path):
    urdf = tmp_path / "thin.urdf"
    urdf.write_text(
        "<robot name='thin'><link name='a'/><link name='b'><inertial><mass value='1'/>"
        "<inertia ixx='1' ixy='0' ixz='0' iyy='0.1' iyz='0' izz='0.1'/></inertial></link>"
        "<joint name='j' type='continuous'><parent link='a'/><child link='b'/></joint></robot>"
    )
    with pytest.warns(UserWarning) as caught:
        tl.Scene().add_urdf(urdf)
    assert Path(caught[0].filename) == Path(__file__)
    scene = tl.Scene(dt=0.2, substeps=1)
    scene.add_urdf(URDF)
    with pytest.warns(UserWarning) as caught, tl.launch(scene, worlds=1):
        pass
    assert Path(caught[0].filename) == Path(__file__)
