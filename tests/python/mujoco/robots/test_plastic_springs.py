"""Springs that yield beside MuJoCo: every integrator, resets, writes, keyframes, snapshots, and what is refused."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from live_model import Live, States, live, relative
from plastic_springs import IS_NATIVE, Robot, World

import tightloop as tl
from tightloop.mujoco import Batch

WORLDS = 3
STEPS = 200
FIELDS = ("qfrc_passive", "sensordata")
_SHAPE = '<geom size=".1" pos=".3 .05 0"/>'
# MuJoCo 4.0 turns balls and free joints with higher order in a Runge-Kutta step.
_TURNING = f"""
    <body pos="0 1 1"><joint name="ball" type="ball" stiffness="3" springyield=".08" damping=".05"/>{_SHAPE}</body>
    <body pos="0 2 1"><joint name="round" type="ball" stiffness="1 .5 2" springyield=".1"/>{_SHAPE}</body>
    <body pos="1 0 1"><freejoint name="free"/><geom type="box" size=".1 .05 .02" pos=".03 .02 .01"/>
      <site name="free" pos=".1 .1 0"/></body>"""
_PULLING = """
    <spatial name="leash" stiffness="20" springlength=".4 .5" springyield=".02">
      <site site="top"/><site site="free"/></spatial>"""
_MODEL = """<mujoco>
  <compiler angle="radian"/>
  <option integrator="{integrator}" timestep=".002"><flag energy="enable"/></option>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <site name="top" pos=".1 .1 1.6"/><site name="side" pos=".1 -.3 1"/>
    <body pos="0 0 1">
      <joint name="hinge" axis="0 1 0" stiffness="9" springref=".35" springyield=".1" damping=".02"/>
      <geom size=".1" pos=".3 0 0"/><site name="arm" pos=".3 0 .1"/><geom name="post" type="cylinder" size=".04 .2"/>
      <body pos=".5 0 0">
        <joint name="slide" type="slide" axis="1 0 0" stiffness="30 5 200" springref=".1" springyield=".02"/>
        <geom size=".08"/><site name="tip" pos="0 0 .1"/>
        <body pos="0 0 .2"><joint name="slack" axis="1 0 0" springyield=".1"/><geom size=".05" pos="0 .1 0"/></body>
      </body>
      <body pos="0 .3 0"><joint name="elastic" axis="1 0 0" stiffness="2"/><geom size=".08" pos="0 .2 0"/></body>
    </body>{bodies}
  </worldbody>
  <tendon>
    <fixed name="sum" stiffness="20" springlength="-.05 .05" springyield=".03">
      <joint joint="hinge" coef="1"/><joint joint="slide" coef="-2"/></fixed>
    <fixed name="cord" stiffness="9" springlength="0 .02" springyield=".01"><joint joint="slide" coef="1"/></fixed>
    <spatial name="rope" stiffness="20 10 5" springlength="0 .5" springyield=".05" damping=".3">
      <site site="top"/><site site="arm"/></spatial>
    <spatial name="band" stiffness="50" springlength=".55 .56" springyield=".01">
      <site site="side"/><geom geom="post"/><site site="tip"/></spatial>{tendons}
  </tendon>
  <sensor><e_potential/></sensor>
  <keyframe><key name="home" qpos="{qpos}"/>{keys}</keyframe>
</mujoco>"""


def robot(integrator: str = "implicitfast", keys: str = "") -> Robot:
    turns = not (IS_NATIVE and integrator == "RK4")
    qpos = ".3 .1 0 .2" + " .8 .6 0 0 1 0 0 0 1 0 1 1 0 0 0" * turns
    bodies, tendons = (_TURNING, _PULLING) if turns else ("", "")
    return Robot(_MODEL.format(integrator=integrator, bodies=bodies, tendons=tendons, qpos=qpos, keys=keys))


def moving(case: Live) -> States:
    return case.states(3, spread=0.3, speed=2.0)


def placed(case: Live, worlds: list[World], states: States) -> None:
    case.place(states)
    for k, world in enumerate(worlds):
        world.data.qpos[:], world.data.qvel[:] = states.qpos[k], states.qvel[k]


def assert_steps_are_mujocos(case: Live, worlds: list[World], tolerance: float, substeps: int = 1) -> None:
    for _ in range(STEPS):
        frame = case.sim.step()
        for k, world in enumerate(worlds):
            for _ in range(substeps):
                world.step()
            assert relative(frame.qpos[k], world.data.qpos) < tolerance
            assert relative(frame.qvel[k], world.data.qvel) < tolerance


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast", "implicit", "RK4"])
def test_steps_are_mujocos(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot(integrator)
    with live(plastic.patch(monkeypatch), worlds=WORLDS, fields=FIELDS) as case:
        worlds = [World(plastic) for _ in range(WORLDS)]
        starts = worlds[0].rests()
        placed(case, worlds, moving(case))
        assert_steps_are_mujocos(case, worlds, 1e-9)
        # forces and energy of the state are by the rests that it has
        frame = case.sim.forward()
        for k, world in enumerate(worlds):
            mujoco.mj_forward(world.model, world.data)
            assert relative(frame.qfrc_passive[k], world.data.qfrc_passive) < 1e-9
            assert relative(frame.sensordata[k], world.data.sensordata) < 1e-9
        moved = np.mean([world.rests() != starts for world in worlds], axis=0)
        assert np.count_nonzero(moved) > 0.8 * len(starts)


def test_every_substep_moves_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot()
    with live(plastic.patch(monkeypatch), worlds=WORLDS, substeps=3) as case:
        worlds = [World(plastic) for _ in range(WORLDS)]
        placed(case, worlds, moving(case))
        assert_steps_are_mujocos(case, worlds, 1e-8, substeps=3)


@pytest.mark.parametrize("integrator", ["implicitfast", "RK4"])
def test_single_precision_is_near(integrator: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot(integrator)
    with live(plastic.patch(monkeypatch), worlds=WORLDS, precision="f32") as case:
        worlds = [World(plastic) for _ in range(WORLDS)]
        placed(case, worlds, moving(case))
        assert_steps_are_mujocos(case, worlds, 1e-3)


def test_a_write_of_the_state_keeps_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot()
    with live(plastic.patch(monkeypatch), worlds=WORLDS) as case:
        worlds = [World(plastic) for _ in range(WORLDS)]
        placed(case, worlds, moving(case))
        assert_steps_are_mujocos(case, worlds, 1e-9)
        placed(case, worlds, case.states(5, spread=0.1, speed=0.1))
        assert_steps_are_mujocos(case, worlds, 1e-9)


@pytest.mark.parametrize("keyframe", [None, "home"])
def test_after_a_reset_rests_are_those_of_the_model(keyframe: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot()
    with live(plastic.patch(monkeypatch), worlds=WORLDS) as case:
        case.place(moving(case))
        for _ in range(STEPS):
            case.sim.step()
        case.sim.reset(keyframe=keyframe)
        worlds = [World(plastic) for _ in range(WORLDS)]
        if keyframe is not None:
            for world in worlds:
                mujoco.mj_resetDataKeyframe(world.model, world.data, 0)
        assert_steps_are_mujocos(case, worlds, 1e-9)


def test_a_reset_leaves_other_worlds_and_a_snapshot_keeps_rests(monkeypatch: pytest.MonkeyPatch) -> None:
    with live(robot().patch(monkeypatch), worlds=WORLDS) as case:
        sim, states = case.sim, moving(case)
        case.place(states)
        first = [sim.step().copy() for _ in range(50)]
        # the same start with the rests of the model, but in the world that is left alone
        sim.reset(mask=[True, False, True])
        case.place(states)
        again = [sim.step().copy() for _ in range(50)]
        for one, other in zip(first, again, strict=True):
            assert np.array_equal(one.qvel[[0, 2]], other.qvel[[0, 2]])
        assert not np.array_equal(first[-1].qvel[1], again[-1].qvel[1])
        # rests are part of a snapshot, and evaluating in between changes nothing
        snapshot = sim.snapshot()
        on = [sim.step().copy().qpos for _ in range(50)]
        sim.restore(snapshot)
        for expected in on:
            sim.forward()
            assert np.array_equal(sim.step().qpos, expected)


def test_without_the_flag_for_springs_nothing_yields(monkeypatch: pytest.MonkeyPatch) -> None:
    plastic = robot()
    plastic.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SPRING
    with live(plastic.patch(monkeypatch), worlds=WORLDS) as case:
        worlds = [World(plastic) for _ in range(WORLDS)]
        placed(case, worlds, moving(case))
        assert_steps_are_mujocos(case, worlds, 1e-9)


def test_a_saved_scene_keeps_its_yields(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = tl.Scene.from_mujoco(robot().patch(monkeypatch), name="m")
    scene.save(tmp_path / "scene.toml")
    ends = []
    for each in (scene, tl.Scene.load(tmp_path / "scene.toml")):
        with tl.launch(each, worlds=1, fields=("qpos",)) as sim:
            ends.append([sim.step().qpos.copy() for _ in range(50)])
    assert np.array_equal(*ends)


def test_a_keyframe_whose_springs_have_yielded_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    count = len(World(robot()).rests())
    bent = robot(keys=f'<key name="bent" plastic="{" ".join(["1"] * count)}"/>').patch(monkeypatch)
    with pytest.raises(tl.SceneError, match=r"key `bent`: no support for rests of plastic springs in a keyframe"):
        tl.Scene.from_mujoco(bent)
    scene = tl.Scene.from_mujoco(bent, name="m", without=("bent",))
    with tl.launch(scene, worlds=1) as sim:
        assert sim.keyframe_names == ["m/home"]


@pytest.mark.skipif(not IS_NATIVE, reason="this MuJoCo has no plastic springs")
def test_a_batch_refuses_plastic_springs_by_name() -> None:
    with pytest.raises(tl.ArgumentError, match="Batch: no support for the plastic spring of joint `hinge`"):
        Batch(robot().model, 2)
