"""Contacts a million times as stiff as the robot is heavy, in single precision, beside MuJoCo in double."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from tightloop.mujoco.batch.joints import JointMap

WORLDS, STEPS = 32, 600
FROZEN, UNCONVERGED = 1 | 8, 2
LEG = """
<body name="{name}" pos="{x} {y} 0">
  <joint name="{name}_hip" axis="1 0 0" range="-0.8 0.8"/>
  <geom type="capsule" fromto="0 0 0 0 {out} 0" size="0.03" mass="0.6"/>
  <body pos="0 {out} 0">
    <joint name="{name}_thigh" axis="0 1 0" range="-1 1.5"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.025" mass="0.8"/>
    <body pos="0 0 -0.2">
      <joint name="{name}_calf" axis="0 1 0" range="-2.4 -0.4"/>
      <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.015" mass="0.15"/>
      <geom type="sphere" pos="0 0 -0.2" size="0.022" mass="0.05"/>
    </body>
  </body>
</body>
"""
FEET = {"fl": (0.2, 0.08), "fr": (0.2, -0.08), "hl": (-0.2, 0.08), "hr": (-0.2, -0.08)}
MODEL = """
<mujoco>
  <option timestep="0.002" integrator="implicitfast" cone="{cone}" impratio="{impratio}" iterations="20"/>
  <default>
    <joint armature="0.005" damping="0.1"/>
    <geom condim="{condim}" friction="0.8 0.02 0.01" solimp="0.95 0.9999 0.001"/>
    <position kp="40" kv="1"/>
  </default>
  <worldbody>
    <geom type="plane" size="0 0 1"/>
    <body pos="0 0 0.55">
      <freejoint/>
      <geom type="box" size="0.2 0.06 0.05" mass="6"/>
      {legs}
    </body>
  </worldbody>
  <actuator>{actuators}</actuator>
</mujoco>
"""


def quadruped(cone: str, impratio: float, condim: int) -> mujoco.MjModel:
    """A quadruped above the ground, whose legs may touch each other and the trunk."""
    legs = [LEG.format(name=name, x=x, y=y, out=np.sign(y) * 0.06) for name, (x, y) in FEET.items()]
    joints = [f"{name}_{joint}" for name in FEET for joint in ("hip", "thigh", "calf")]
    actuators = [f'<position name="{name}" joint="{name}" inheritrange="1"/>' for name in joints]
    text = MODEL.format(cone=cone, impratio=impratio, condim=condim, legs="".join(legs), actuators="".join(actuators))
    return mujoco.MjModel.from_xml_string(text)


def swinging(model: mujoco.MjModel) -> NDArray[np.float32]:
    """Targets of every step, `(STEPS, WORLDS, actuators)`."""
    rng = np.random.default_rng(0)
    low, high = model.actuator_ctrlrange.T
    shape = (WORLDS, model.nu)
    rate, phase, part = rng.uniform(0.5, 2.5, shape), rng.uniform(0, 1, shape), rng.uniform(0, 0.5, shape)
    times = np.arange(STEPS)[:, None, None] * model.opt.timestep
    swing = part * np.sin(2 * np.pi * (rate * times + phase))
    return ((low + high) / 2 + swing * (high - low) / 2).astype(np.float32)


@pytest.mark.parametrize(
    ("cone", "impratio", "condim"),
    [("elliptic", 1000, 3), ("elliptic", 100, 6), ("pyramidal", 1000, 3)],
)
def test_a_robot_falls_and_lies_as_in_mujoco(cone: str, impratio: float, condim: int) -> None:
    """No world faults, few are unconverged, and accelerations of MuJoCo's states are MuJoCo's."""
    model = quadruped(cone, impratio, condim)
    ctrl = swinging(model)
    # MuJoCo's own runs, and the accelerations of some of their states
    states, at_limit = [], []
    exact = quadruped(cone, impratio, condim)
    exact.opt.iterations, exact.opt.tolerance, exact.opt.ls_tolerance = 200, 0, 1e-6
    for world in range(8):
        data, there = mujoco.MjData(model), mujoco.MjData(exact)
        for step in range(STEPS):
            data.ctrl[:] = ctrl[step, world]
            if step % 10 == 0 and data.ncon:
                there.qpos[:], there.qvel[:], there.ctrl[:] = np.float32(data.qpos), np.float32(data.qvel), data.ctrl
                mujoco.mj_forward(exact, there)
                if there.ncon:
                    states.append([np.array(x) for x in (there.qpos, there.qvel, there.ctrl, there.qacc)])
            mujoco.mj_step(model, data)
            at_limit.append(max(data.solver_niter) >= model.opt.iterations)
        assert np.isfinite(data.qacc).all() and not data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number
    qpos, qvel, held, qacc = (np.array(part) for part in zip(*states, strict=True))
    joints = JointMap(model)
    scene = tl.Scene.from_mujoco(model)
    scene.substeps = 1
    options = {"threads": 1, "device": "cpu", "fields": ("qacc",)}
    with tl.launch(scene, worlds=len(states), **options) as sim:
        sim.step(ctrl=held.astype(np.float32))
        frame = sim.write(joint_q=joints.positions(qpos), joint_qd=joints.velocities(qpos, qvel))
        off = np.abs(frame.qacc - qacc).max(axis=1) / np.abs(qacc).max(axis=1)
    # a contact that begins to touch may do so on one side alone
    assert len(states) > 200 and np.mean(off > 0.03) < 0.02, f"{np.sort(off)[-20:]}"

    with tl.launch(scene, worlds=WORLDS, **options) as sim:
        qpos = np.tile(model.qpos0, (WORLDS, 1))
        sim.write(joint_q=joints.positions(qpos), joint_qd=joints.velocities(qpos, np.zeros((WORLDS, model.nv))))
        flags = np.array([np.array(sim.step(ctrl=targets).status) for targets in ctrl])
    assert not np.any(flags & FROZEN)
    share, theirs = np.mean(flags & UNCONVERGED > 0), np.mean(at_limit)
    assert share < 0.03 and share < 2 * theirs + 0.01, f"{share} unconverged, {theirs} of MuJoCo's"
