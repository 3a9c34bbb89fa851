"""Stiffness and damping of joint limits against MuJoCo, whose `solreflimit` takes them as (-ke f, -kd f)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import tightloop as tl

mujoco = pytest.importorskip("mujoco")

DT = 1 / 500
LIMIT = 0.5
#: MuJoCo's default ``solimp``, whose largest impedance turns force into acceleration.
D_MAX = 0.95
PENDULUM = """<robot name="pendulum">
  <link name="base"><inertial><mass value="1"/>
    <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="rod"><inertial><origin xyz="0.4 0 0"/><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-0.5" upper="0.5" effort="10" velocity="10"/></joint>
</robot>
"""
MODEL = """<mujoco><compiler angle="radian"/><option timestep="{dt}" gravity="0 0 -9.81"/><worldbody><body>
  <inertial pos="0.4 0 0" mass="2" diaginertia="0.02 0.03 0.03"/>
  <joint name="hinge" axis="0 1 0" range="-{limit} {limit}" limited="true" solreflimit="{reference}"/>
</body></worldbody></mujoco>"""


def ours(folder: Path, gains: dict[str, float]) -> tl.Scene:
    path = folder / "pendulum.urdf"
    path.write_text(PENDULUM)
    scene = tl.Scene(dt=DT, substeps=1)
    robot = scene.add_urdf(path)
    for name, gain in gains.items():
        setattr(robot, name, gain)
    return scene


def theirs(ke: float, kd: float):
    def model(reference: str):
        return mujoco.MjModel.from_xml_string(MODEL.format(dt=DT, limit=LIMIT, reference=reference))

    share = float(model("0.02 1").dof_invweight0[0]) * (1.0 - D_MAX)
    # direct references are negative or zero, and two zeros would be a time constant
    return model(f"{-ke * share!r} {-kd * share!r}")


@pytest.mark.parametrize(
    ("gains", "ke", "kd"),
    [
        ({}, 1e4, 10.0),
        ({"joint_limit_kd": 500.0}, 1e4, 500.0),
        ({"joint_limit_ke": 2e3, "joint_limit_kd": 40.0}, 2e3, 40.0),
        ({"joint_limit_ke": 5e4, "joint_limit_kd": 0.0}, 5e4, 0.0),
    ],
)
def test_a_pendulum_falls_on_its_limit_as_in_mujoco(tmp_path, gains, ke, kd):
    model = theirs(ke, kd)
    data = mujoco.MjData(model)
    with tl.launch(
        ours(tmp_path, gains), worlds=1, precision="f64", fields=("joint_q", "joint_qd", "constraint_force")
    ) as sim:
        sim.write(joint_q=[0.52], joint_qd=[1.5])
        frame = sim.forward()
        data.qpos[0], data.qvel[0] = 0.52, 1.5
        mujoco.mj_forward(model, data)
        # a row is the quotient and the sum of some ten roundings
        np.testing.assert_allclose(frame.constraint_force[0], data.qfrc_constraint, rtol=1e-12)
        assert frame.constraint_force[0, 0] < 0
        sim.reset()
        mujoco.mj_resetData(model, data)
        lowest = []
        for _ in range(600):
            mujoco.mj_step(model, data)
            lowest.append((sim.step().joint_q[0, 0], data.qpos[0]))
        mine, other = np.array(lowest).T
        assert mine.max() > LIMIT
        # each bounce multiplies what came before by less than 10
        np.testing.assert_allclose(mine, other, rtol=0, atol=1e-9)


def test_damping_of_limits_takes_the_bounce(tmp_path):
    heights = {}
    for kd in (10.0, 2000.0):
        with tl.launch(ours(tmp_path, {"joint_limit_kd": kd}), worlds=1, precision="f64") as sim:
            path = np.array([sim.step().joint_q[0, 0] for _ in range(400)])
        after = path[np.argmax(path > LIMIT) :]
        heights[kd] = LIMIT - after.min()
    assert heights[10.0] > 0.1 and heights[2000.0] < 0.01, heights


def test_gains_of_limits_are_properties_that_are_saved(tmp_path):
    scene = ours(tmp_path, {})
    robot = scene.robots["pendulum"]
    assert robot.joint_limit_ke.tolist() == [1e4] and robot.joint_limit_kd.tolist() == [10]
    robot.joint_limit_kd = {"hinge": 200.0}
    scene.save(tmp_path / "scene.toml")
    assert tl.Scene.load(tmp_path / "scene.toml").robots["pendulum"].joint_limit_kd.tolist() == [200]
    with pytest.raises(tl.SceneError, match=r"joint_limit_ke of dof `pendulum/hinge` is -1.*at least 0"):
        robot.joint_limit_ke = -1.0
