"""Robots that are known by name: their motors and feet, and what is said where their package is missing."""

from __future__ import annotations

from importlib import import_module, util
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tightloop.errors import ArgumentError
from tightloop.tasks.legged_models.known import KNOWN
from tightloop.tasks.legged_models.rebuilt import rebuilt
from tightloop.tasks.quadruped import QuadrupedVelocityFlat

#: Without types.
mujoco: Any = import_module("mujoco")
LEGS = {"FR": (0.19, -0.05), "FL": (0.19, 0.05), "RR": (-0.19, -0.05), "RL": (-0.19, 0.05)}
LEG = """
<body name="{leg}_hip" pos="{x} {y} 0">
  <inertial pos="0 0 0" mass="0.7" diaginertia="0.001 0.001 0.001"/>
  <joint name="{leg}_hip_joint" axis="1 0 0" range="-0.9 0.9"/>
  <body name="{leg}_thigh" pos="0 {side} 0">
    <inertial pos="0 0 -0.03" mass="1" diaginertia="0.005 0.005 0.001"/>
    <joint name="{leg}_thigh_joint" axis="0 1 0" range="-0.7 4.5"/>
    <body name="{leg}_calf" pos="0 0 -0.213">
      <inertial pos="0 0 -0.14" mass="0.2" diaginertia="0.001 0.001 0.0001"/>
      <joint name="{leg}_calf_joint" axis="0 1 0" range="-2.8 -0.9"/>
      <geom name="{leg}_calf_collision" type="capsule" size="0.01" fromto="0 0 0 0 0 -0.2"/>
      <geom name="{leg}_foot_collision" type="sphere" size="0.023" pos="0 0 -0.213"/>
    </body>
  </body>
</body>"""
ROBOT = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="trunk" pos="0 0 0.4">
<freejoint/><inertial pos="0 0 0" mass="5" diaginertia="0.02 0.06 0.07"/>
<geom name="trunk_collision" type="box" size="0.13 0.09 0.05"/>{legs}</body></worldbody></mujoco>"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package with a Go1 in the proportions of the real one; returns its file."""
    legs = [LEG.format(leg=leg, x=x, y=y, side=0.08 * np.sign(y)) for leg, (x, y) in LEGS.items()]
    file = tmp_path / "mjlab" / KNOWN["unitree_go1"].file
    file.parent.mkdir(parents=True)
    (tmp_path / "mjlab/__init__.py").write_text("raise RuntimeError('the package is not imported')")
    file.write_text(ROBOT.format(legs="".join(legs)))
    monkeypatch.syspath_prepend(tmp_path)
    return file


@pytest.mark.usefixtures("package")
def test_a_known_robot_has_its_motors_and_touches_with_its_feet(envs: Any) -> None:
    env = envs("QuadrupedVelocityFlat", 4, model="unitree_go1", pushes=0.0)
    robot = env.task.robot
    assert robot.standing == pytest.approx((0.1, 0.9, -1.8, -0.1, 0.9, -1.8) * 2)
    # rotors of 1.118e-4 kg·m² behind gears of 6 and 9, at 10 Hz and twice the critical damping
    inertia = 1.11842e-4 * np.array([36.0, 36.0, 81.0] * 4)
    np.testing.assert_allclose(robot.model.dof_armature[6:], inertia)
    np.testing.assert_allclose([*robot.stiffness.values()], inertia * (20 * np.pi) ** 2)
    np.testing.assert_allclose([*robot.damping.values()], 4.0 * inertia * 20 * np.pi)
    np.testing.assert_allclose(robot.model.actuator_forcerange[:, 1], [23.7, 23.7, 35.55] * 4)
    touching = [robot.model.geom(k).name for k in range(robot.model.ngeom) if robot.model.geom_conaffinity[k]]
    assert sorted(touching) == sorted(f"{leg}_foot_collision" for leg in LEGS)
    env.reset(seed=0)
    for _ in range(150):
        assert not env.step(np.zeros(env.action_space.shape))[2].any()
    np.testing.assert_allclose(env.frame.joint_q[:, 2], robot.height, rtol=0.1)


def test_a_rebuilt_model_keeps_its_springs() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="arm", mass=1.0, inertia=(1, 1, 1), explicitinertial=True)
    joint = body.add_joint(name="elbow", ref=0.2, springref=0.6)
    joint.stiffness[0] = 14.0
    model, again = spec.compile(), rebuilt(spec.compile()).compile()
    assert again.qpos_spring == model.qpos_spring != 0.0 and again.qpos0 == model.qpos0 != 0.0
    assert again.jnt_stiffness == 14.0


def test_what_is_missing_is_named(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package.write_text(package.read_text().replace("FL_calf_joint", "FL_knee"))
    with pytest.raises(ArgumentError, match=r"has a joint 'FL_knee', whose motor is not known"):
        QuadrupedVelocityFlat(model="unitree_go1")
    package.unlink()
    with pytest.raises(ArgumentError, match=r"there is no .*go1\.xml; install mjlab 1\.6\.0"):
        QuadrupedVelocityFlat(model="unitree_go1")
    monkeypatch.setattr(util, "find_spec", lambda name: None)
    with pytest.raises(ArgumentError, match=r"which is not installed: pip install --no-deps mjlab"):
        QuadrupedVelocityFlat(model="unitree_go1")
