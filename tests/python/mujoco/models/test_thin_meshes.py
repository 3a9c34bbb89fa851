"""Thin meshes beside MuJoCo: they load by every door, weigh what their density says, and carry what lies on them."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl

Array = NDArray[np.float64]
SIDES = [(1.0, 1.0), (1.0, 0.02)]
THICKNESSES = [8e-4, 1e-5, 2e-7]
#: MuJoCo keeps vertices of meshes in f32.
F32 = 1e-6


def corners(sides: tuple[float, float], thickness: float) -> Array:
    return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 0.5 * [*sides, thickness]


def plate(folder: Path, sides: tuple[float, float], thickness: float) -> Path:
    """A cuboid as an OBJ file."""
    file = folder / "plate.obj"
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners(sides, thickness).tolist()]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    file.write_text("\n".join([*lines, *(f"f {face}" for face in faces)]))
    return file


def mjcf(file: Path, sides: tuple[float, float], inside: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{1 / 480}" integrator="implicitfast" cone="elliptic"/>
        <asset><mesh name="plate" file="{file}"/></asset><worldbody>{inside}</worldbody></mujoco>"""
    )


def rested(scene: tl.Scene, precision: str) -> tuple[Array, Array]:
    """Position and velocity of the only body after two seconds."""
    with tl.launch(scene, worlds=1, precision=precision) as sim:
        for _ in range(120):
            frame = sim.step()
    return frame.joint_q[0].astype(float), frame.joint_qd[0].astype(float)


def height_in_mujoco(model: mujoco.MjModel) -> float:
    data = mujoco.MjData(model)
    for _ in range(960):
        mujoco.mj_step(model, data)
    return float(data.qpos[2])


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("door", ["add_mesh", "decomposed", "urdf", "mujoco"])
def test_a_plate_rests_at_half_its_thickness_as_in_mujoco(tmp_path, door, thickness, precision):
    sides = (1.0, 1.0)
    file = plate(tmp_path, sides, thickness)
    start = thickness / 2 + 1e-3
    geom = '<geom type="mesh" mesh="plate" density="1000"/>'
    floor = '<geom type="plane" size="0 0 1"/>'
    model = mjcf(file, sides, f'{floor}<body pos="0 0 {start}"><freejoint/>{geom}</body>')
    if door == "mujoco":
        scene = tl.Scene.from_mujoco(model, substeps=8)
    else:
        scene = tl.Scene(dt=1 / 480, substeps=8)
        scene.add_ground()
        if door == "urdf":
            robot = tmp_path / "robot.urdf"
            robot.write_text(
                '<robot name="r"><link name="a"><collision><geometry><mesh filename="plate.obj"/></geometry>'
                "</collision></link></robot>"
            )
            scene.add_urdf(robot, pos=(0, 0, start), floating=True)
        else:
            scene.add_body(name="b", pos=(0, 0, start))
            scene.add_mesh(file, body="b", convex_decomposition=door == "decomposed")
    q, qd = rested(scene, precision)
    expected = height_in_mujoco(model)
    # a soft contact gives way by a third of a millimetre
    assert abs(expected - thickness / 2) < 5e-4
    assert q[2] == pytest.approx(expected, abs=1e-5)
    assert np.abs(q[3:5]).max() < 1e-4, "it lies flat"
    assert np.abs(qd).max() < 1e-3, "it rests"


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize(
    ("geom", "add"),
    [
        ('type="sphere" size=".1"', lambda s: s.add_sphere(body="b", radius=0.1)),
        ('type="box" size=".1 .1 .1"', lambda s: s.add_box(body="b", half_extents=(0.1, 0.1, 0.1))),
        ('type="cylinder" size=".1 .1"', lambda s: s.add_cylinder(body="b", radius=0.1, half_height=0.1)),
    ],
)
def test_what_lies_on_a_plate_rests_above_half_its_thickness(tmp_path, geom, add, thickness, precision):
    sides = (1.0, 1.0)
    file = plate(tmp_path, sides, thickness)
    start = 0.1 + thickness / 2
    scene = tl.Scene(dt=1 / 480, substeps=8)
    scene.add_mesh(file)
    scene.add_body(name="b", pos=(0.1, 0.05, start))
    add(scene)
    q, qd = rested(scene, precision)
    assert q[2] == pytest.approx(start, abs=5e-4)
    assert np.abs(q[3:5]).max() < 1e-3, "it stands"
    assert np.abs(qd).max() < 2e-3, "it rests"


@pytest.mark.parametrize("thickness", THICKNESSES)
@pytest.mark.parametrize("sides", SIDES)
def test_a_plate_weighs_and_turns_as_in_mujoco(tmp_path, sides, thickness):
    file = plate(tmp_path, sides, thickness)
    model = mjcf(file, sides, '<body><freejoint/><geom type="mesh" mesh="plate" density="700"/></body>')
    scene = tl.Scene()
    scene.add_body(name="b")
    scene.add_mesh(file, body="b", density=700)
    with tl.launch(scene, worlds=1, precision="f64", fields=("joint_q", "mass_matrix")) as sim:
        inertia = np.diag(sim.reset().mass_matrix[0])
    assert inertia[:3] == pytest.approx(model.body_mass[1], rel=F32)
    assert np.sort(inertia[3:]) == pytest.approx(np.sort(model.body_inertia[1]), rel=F32)
