"""Draws and writes that look like factors, two grounds, and drives that swing or shake: reported with the cure."""

from __future__ import annotations

import re
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import tightloop as tl
from tightloop.checks import advice
from tightloop.env import VectorEnv
from tightloop.tasks.reach import FrankaReach

AROUND_1 = tl.Uniform(0.8, 1.2)


def told(scene: tl.Scene, **options: Any) -> list[str]:
    """Launch a scene, and return what it warns of, also if it was reported before."""
    advice.forget()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tl.launch(scene, worlds=1, **options).close()
    return [str(warning.message) for warning in caught]


ARM = """<robot name="arm"><link name="base"/>
  <link name="upper"><inertial><mass value="3.5"/>
    <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.03"/></inertial></link>
  <link name="lower"><inertial><mass value="1.8"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="87" velocity="2"/><dynamics damping="{damping}" friction="{friction}"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" effort="87" velocity="2"/><dynamics damping="{damping}" friction="{friction}"/></joint>
</robot>"""


def arm(scene: tl.Scene, folder: Path, damping: float = 7.0, friction: float = 5.0) -> tl.Robot:
    path = folder / "arm.urdf"
    path.write_text(ARM.format(damping=damping, friction=friction))
    robot = scene.add_urdf(path, name="arm")
    robot.joint_target_ke, robot.joint_target_kd, robot.joint_armature = 2000.0, 200.0, 0.1
    return robot


@pytest.mark.parametrize(
    ("params", "said"),
    [
        (
            {"body_mass": {"arm": AROUND_1}},
            r"body_mass of `arm` .*Uniform\(0\.8, 1\.2\).*: 1\.8 to 3\.5 kg in the model.*body_mass_scale",
        ),
        ({"body_mass": {"arm": tl.Normal(1.0, 0.1)}}, r"body_mass of `arm` .*Normal\(1, 0\.1\).*body_mass_scale"),
        ({"body_mass": {"arm/upper": tl.Uniform(0.5, 2)}}, r"body_mass of `arm/upper`.*body_mass_scale"),
        ({"body_inertia": {"arm": AROUND_1}}, r"body_inertia of `arm` .*kg·m² in the model.*body_mass_scale"),
        (
            {"joint_target_ke": {"arm": tl.Uniform(0.9, 1.1)}},
            r"joint_target_ke of `arm`.*2000.*Uniform\(0\.9 \* 2000, 1\.1",
        ),
        ({"joint_target_ke": {"arm": tl.Uniform(0.5, 0.9)}}, r"joint_target_ke of `arm`.*2000"),
        ({"joint_target_kd": {"arm": tl.Uniform(0.9, 1.1)}}, r"joint_target_kd of `arm`.*200 N·m·s/rad"),
        ({"joint_damping": {"arm": AROUND_1}}, r"joint_damping of `arm`.*Uniform\(0\.8 \* 7, 1\.2 \* 7\)"),
        ({"joint_armature": {"arm": AROUND_1}}, r"joint_armature of `arm`.*0\.1"),
        ({"joint_friction": {"arm": AROUND_1}}, r"joint_friction of `arm`.*5"),
        ({"joint_effort_limit": {"arm": AROUND_1}}, r"joint_effort_limit of `arm`.*: 87 N"),
        (
            {"gravity": {"z": tl.Uniform(0.9, 1.1)}},
            r"gravity of `z`.*-9\.81 m/s² in the model.*Uniform\(0\.9 \* -9\.81",
        ),
        ({"shape_mu": {"table": AROUND_1}}, r"shape_mu of `table`.*0\.3 in the model"),
    ],
)
def test_a_draw_around_1_of_what_it_replaces_is_reported_as_a_factor(params, said, tmp_path):
    scene = tl.Scene()
    arm(scene, tmp_path)
    scene.add_box(half_extents=(0.1, 0.1, 0.1), pos=(2, 0, 0), mu=0.3, name="table")
    scene.friction_combine = "product"
    assert told(scene) == []
    scene.randomize(params=params)
    [warning] = told(scene)
    assert re.search(said, warning), warning
    # a scene file with the same draws
    scene.save(tmp_path / "scene.toml")
    assert told(tl.Scene.load(tmp_path / "scene.toml")) == [warning]


def test_draws_that_are_values_or_true_factors_are_no_mistake(tmp_path):
    scene = tl.Scene()
    arm(scene, tmp_path, damping=0.0)
    scene.add_cube(name="brick", pos=(2, 0, 1))
    scene.bodies["brick"].mass = 1.05
    scene.randomize(
        params={
            "body_mass_scale": {"arm": AROUND_1},
            "body_mass": {"brick": AROUND_1, "arm/upper": tl.Uniform(2.5, 3.5)},
            "joint_target_ke": {"arm": tl.Uniform(1800, 2200)},
            "joint_damping": {"arm": AROUND_1},  # the model has none
            "joint_q_noise": {"arm": tl.Uniform(0, 1.2)},
            "shape_mu": {"brick": tl.Uniform(0.5, 1.25)},
        }
    )
    assert told(scene) == []


def test_the_randomization_of_an_environment_is_looked_at():
    class Heavy(FrankaReach):
        def scene(self) -> tl.Scene:
            scene = super().scene()
            [robot] = scene.robots
            scene.randomize(params={"body_mass": {robot: AROUND_1}})
            return scene

    with pytest.warns(tl.TightloopWarning, match="body_mass of .*looks like factors.*body_mass_scale"):
        VectorEnv(Heavy, 1).close()


@pytest.mark.parametrize("name", ["body_mass", "joint_target_ke", "joint_target_kd", "joint_damping"])
def test_a_write_of_factors_is_reported_and_one_of_values_is_not(name, tmp_path):
    scene = tl.Scene()
    arm(scene, tmp_path)
    factors = np.random.default_rng(0)
    with tl.launch(scene, worlds=4, params=(name,)) as sim:
        own = np.array(getattr(sim.params, name))
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            setattr(sim.params, name, own * factors.uniform(0.8, 1.2, own.shape))
        with pytest.warns(
            tl.TightloopWarning, match=rf"params\.{name} gets 0\.8\d* to 1\.\d+, which look like factors"
        ):
            setattr(sim.params, name, np.where(own == 0.0, 0.0, factors.uniform(0.8, 1.2, own.shape)))


def test_two_grounds_are_reported():
    scene = tl.Scene()
    scene.add_cube(pos=(0, 0, 1))
    scene.add_ground()
    scene.add_plane(pos=(3, 0, 0), quat=(0, -0.7071068, 0, 0.7071068), name="wall")
    assert told(scene) == []
    scene.add_ground()
    [warning] = told(scene)
    assert "`ground` and `ground_2` are the same plane" in warning
    scene = tl.Scene()
    scene.add_cube(pos=(0, 0, 1))
    scene.add_ground()
    scene.add_ground(z=0.2, name="floor")
    [warning] = told(scene)
    assert "`floor` is 0.2000 m above `ground`" in warning and "Leave one of them out" in warning


def test_a_ground_beside_that_of_a_mujoco_model_is_reported(tmp_path):
    pytest.importorskip("mujoco")
    model = tmp_path / "floor.xml"
    model.write_text(
        '<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/>'
        '<body pos="0 0 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>'
    )
    scene = tl.Scene.from_mujoco(model)
    assert told(scene) == []
    scene.add_ground()
    [warning] = told(scene)
    assert "are the same plane" in warning and "`ground`" in warning and "floor" in warning


def test_a_body_that_starts_below_the_ground_is_reported():
    scene = tl.Scene()
    scene.add_ground()
    scene.add_cube(pos=(0, 0, -3))
    [warning] = told(scene)
    assert "`cube/box` is 3.02 m deep in `ground`" in warning


def test_stiffness_without_damping_is_reported(tmp_path):
    scene = tl.Scene()
    robot = arm(scene, tmp_path, damping=0.0, friction=0.0)
    robot.joint_target_kd = 0.0
    [warning] = told(scene)
    assert "`shoulder`, `elbow`" in warning and "nothing damps them" in warning and "joint_target_kd" in warning
    assert told(scene, params=("joint_target_kd",)) == []
    robot.joint_target_kd = 20.0
    assert told(scene) == []
    damped = tl.Scene()
    arm(damped, tmp_path, damping=1.0, friction=0.0).joint_target_kd = 0.0
    assert told(damped) == []
    # what a vendor's file has of damping and friction stops no stiff drive
    barely = tl.Scene()
    arm(barely, tmp_path, damping=0.003, friction=0.2).joint_target_kd = 0.0
    [warning] = told(barely)
    assert "nothing damps them" in warning
    held = tl.Scene()
    arm(held, tmp_path, damping=0.003, friction=5.0).joint_target_kd = 0.0
    assert told(held) == []


def test_gains_that_a_time_step_cannot_hold_shake_and_are_reported(tmp_path):
    urdf = Path(tmp_path / "light.urdf")
    urdf.write_text(
        """<robot name="light"><link name="base"/><link name="tip"><inertial><mass value="1"/>
        <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
        <joint name="turn" type="continuous"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/></joint>
        </robot>"""
    )

    def scene(dt: float) -> tl.Scene:
        made = tl.Scene(dt=dt, substeps=1, gravity=(0, 0, 0))
        robot = made.add_urdf(urdf)
        robot.joint_target_ke, robot.joint_target_kd, robot.joint_target_q = 1000.0, 0.1, 0.01
        return made

    # k h² = 4 I + 2 d h, by hand: h = (d + √(d² + 4 k I)) / k
    limit = (0.1 + (0.01 + 40.0) ** 0.5) / 1000.0
    [warning] = told(scene(1.02 * limit))
    assert "`turn`" in warning and f"{limit:.1e} s" in warning.replace("6.4e-3", f"{limit:.1e}")
    assert told(scene(0.98 * limit)) == []
    # and it does what the warning says
    reached = []
    for dt in (0.98 * limit, 1.02 * limit):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with tl.launch(scene(dt), worlds=1, precision="f64") as sim:
                frame = sim.forward()
                for _ in range(3000):
                    frame = sim.step()
                reached.append(abs(float(frame.joint_q[0, 0])) if not frame.status[0] else np.inf)
    assert reached[0] < 0.02 and reached[1] > 1.0, reached
