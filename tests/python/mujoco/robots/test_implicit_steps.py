"""Models with `integrator="implicit"`: steps are implicit in all forces that change with velocities, as MuJoCo's."""

from __future__ import annotations

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import live, relative
from random_mjcf import ACTUATED, JOINTS, MEDIUM, random_mjcf

import tightloop as tl
from tightloop.errors import ArgumentError, SceneError

WORLDS = 10
STEPS = 200
#: An arm that branches, a free body that carries others, and one alone; nothing touches.
XML = """<mujoco model="m"><option integrator="{integrator}" timestep=".004"/>
<default><geom type="box" size=".05 .1 .15" contype="0" conaffinity="0"/></default>
<worldbody><site name="wall" pos=".2 .1 .3"/>
  <body pos="0 0 1"><joint name="yaw" axis="0 0 1" damping=".2"/><geom pos=".2 0 0"/>
    <body pos=".4 0 0"><joint name="wrist" type="ball" damping=".3"/><geom pos=".1 .1 0"/>
      <body pos=".2 .1 0"><joint name="slide" type="slide" axis="1 .3 0" stiffness="90" damping="1 .5 .2"/>
        <joint name="turn" axis="0 1 .5" armature=".01"/><geom pos="0 .1 .1"/><site name="tip" pos=".1 .1 .1"/></body>
    </body>
    <body pos="-.3 0 0"><joint name="left" axis="0 1 0"/><geom pos="-.1 0 .1"/></body>
    <body pos="0 .3 0"><joint name="right" axis="1 1 0"/><geom pos="0 .1 .1"/></body></body>
  <body pos="1 0 1"><joint name="float" type="free" damping=".1" armature=".02"/><geom pos=".05 .02 .03"/>
    <body pos=".2 0 0"><joint type="ball"/><geom pos=".1 0 .05"/>
      <body pos=".2 0 0"><joint name="fin" axis="0 1 1" damping=".05"/><geom pos=".1 .1 0"/></body></body></body>
  <body pos="2 0 1"><freejoint name="loose"/><geom pos=".02 .03 -.04"/></body>
</worldbody>
<tendon><fixed name="both" damping=".4"><joint joint="left" coef="1"/><joint joint="right" coef="-1.5"/></fixed>
  <spatial name="rope" damping=".3" armature=".5"><site site="wall"/><site site="tip"/></spatial></tendon>
<actuator><velocity joint="yaw" kv="2"/><velocity joint="turn" kv=".5" forcerange="-1 1"/>
  <velocity tendon="both" kv=".7"/>
  <general joint="fin" gaintype="affine" gainprm="1 0 .3" biastype="affine" biasprm="0 0 -.4"/>
  <general joint="wrist" gear="1 2 3" biastype="affine" biasprm="0 0 -.2"/>
  <general joint="loose" gear="1 0 1 .3 .2 .1" biastype="affine" biasprm="0 0 -.3"/>
  <general site="tip" gear="1 2 0 0 .5 1" biastype="affine" biasprm="0 0 -.2"/>
  <velocity tendon="rope" kv=".3"/></actuator></mujoco>"""


def model_of(integrator: str = "implicit") -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(XML.format(integrator=integrator))


def assert_run(model: str | mujoco.MjModel, seed: int, precision: str, tolerance: float, speed: float = 1.0) -> None:
    """Step worlds from random states, under controls that hold; the first step and the last state are MuJoCo's."""
    with live(model, worlds=WORLDS, precision=precision) as case:
        states = case.states(seed, speed=speed)
        case.place(states)
        own = list(case.data(states))
        for step in range(STEPS):
            frame = case.sim.step()
            for data in own:
                mujoco.mj_step(case.model, data)
            if step in (0, STEPS - 1):
                for world, data in enumerate(own):
                    assert relative(frame.qpos[world], data.qpos) < tolerance, f"qpos after step {step}"
                    assert relative(frame.qvel[world], data.qvel) < tolerance, f"qvel after step {step}"


@pytest.mark.parametrize(("precision", "tolerance"), [("f64", 1e-8), ("f32", 1e-3)])
def test_runs_of_an_arm_and_free_bodies_are_mujocos(precision: str, tolerance: float) -> None:
    assert_run(model_of(), 3, precision, tolerance)


@pytest.mark.parametrize(("precision", "tolerance"), [("f64", 1e-8), ("f32", 1e-3)])
@pytest.mark.parametrize("medium", ["", MEDIUM])
@pytest.mark.parametrize("seed", range(6))
def test_runs_of_random_models_are_mujocos(seed: int, medium: str, precision: str, tolerance: float) -> None:
    option = f'integrator="implicit" timestep=".002" {medium}'
    features = replace(JOINTS, armature=True, damping=True, option=option)
    assert_run(random_mjcf(seed, 2 + seed, features), seed, precision, tolerance, speed=0.5)


@pytest.mark.parametrize("seed", range(8))
def test_a_step_of_a_random_model_with_actuators_is_mujocos(seed: int) -> None:
    features = replace(ACTUATED, damping=True, transmissions=True, bounds=True, pulls=True, spatial=True, muscles=True)
    features = replace(features, option=f'integrator="implicit" timestep=".01" {MEDIUM}')
    with live(random_mjcf(seed, 3 + seed % 4, features), worlds=WORLDS) as case:
        states = case.states(seed, speed=2.0)
        case.place(states)
        frame = case.sim.step()
        for world, data in enumerate(case.data(states)):
            mujoco.mj_step(case.model, data)
            assert relative(frame.qvel[world], data.qvel) < 1e-8


def test_forces_of_rotating_bodies_on_each_other_count() -> None:
    """A step without Coriolis forces in its matrix is another one, by far more than the tolerances here."""
    moved = []
    for integrator in ("implicit", "implicitfast"):
        with live(model_of(integrator), worlds=WORLDS) as case:
            case.place(case.states(3, speed=3.0))
            moved.append(case.sim.step().qvel.copy())
    assert relative(*moved) > 1e-4


@pytest.mark.parametrize(
    ("param", "field"),
    [("body_mass", "body_mass"), ("joint_damping", "dof_damping"), ("actuator_bias", "actuator_biasprm")],
)
def test_parameters_of_each_world_are_in_its_matrix(param: str, field: str) -> None:
    scales = np.linspace(0.5, 2.0, WORLDS)
    with live(model_of(), worlds=WORLDS, params=(param,)) as case:
        values = np.array(getattr(case.sim.params, param))
        scaled = values * scales.reshape(-1, *[1] * (values.ndim - 1))
        case.sim.params.write(**{param: scaled})
        states = case.states(5, speed=2.0)
        case.place(states)
        frame = case.sim.step()
        for world, data in enumerate(case.data(states)):
            model = model_of()
            model.opt.tolerance, model.opt.iterations = 0.0, 100
            getattr(model, field)[:] *= scales[world]
            mujoco.mj_step(model, data)
            assert relative(frame.qvel[world], data.qvel) < 1e-8


def test_a_world_alone_moves_as_among_others() -> None:
    with live(model_of(), worlds=WORLDS, precision="f32") as case:
        states = case.states(3)
        case.place(states)
        for _ in range(30):
            among = case.sim.step()
        among = among.qpos[7].copy()
    with live(model_of(), worlds=1, precision="f32") as case:
        case.place(type(states)(**{name: values[7:8] for name, values in vars(states).items()}))
        for _ in range(30):
            alone = case.sim.step()
        np.testing.assert_array_equal(alone.qpos[0], among)


def test_a_gpu_refuses_and_the_model_runs_with_implicitfast() -> None:
    with pytest.raises(ArgumentError, match="a GPU has no integrator `implicit`"):
        tl.launch(tl.Scene.from_mujoco(model_of()), worlds=1, device="gpu")
    scene = tl.Scene.from_mujoco(model_of(), without=("integrator",))
    (read,) = scene.models.values()
    assert any("mjINT_IMPLICITFAST takes the place of mjINT_IMPLICIT" in note for note in read.notes)
    fast = model_of("implicitfast")
    data = mujoco.MjData(fast)
    data.ctrl[:] = 0.3
    with tl.launch(scene, worlds=1, precision="f64", fields=("qpos",)) as sim:
        for _ in range(50):
            frame = sim.step(ctrl=np.full(fast.nu, 0.3))
            mujoco.mj_step(fast, data)
        assert relative(frame.qpos[0], data.qpos) < 1e-8


def test_models_of_a_scene_have_one_integrator() -> None:
    scene = tl.Scene.from_mujoco(model_of(), name="first")
    scene.add_mujoco(model_of(), name="second", pos=(0, 0, 2))
    with pytest.raises(SceneError, match=r"integrator of model `third` is ImplicitFast.*the scene has Implicit"):
        scene.add_mujoco(model_of("implicitfast"), name="third")
