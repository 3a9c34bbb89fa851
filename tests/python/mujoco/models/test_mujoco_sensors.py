"""Sensors of random models against MuJoCo's `sensordata`."""

from __future__ import annotations

import os
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from live_model import Live, has_closed_form, live
from random_mjcf import CONSTRAINED, Features, random_mjcf
from random_sensors import KINDS, TOUCHES, add_sensors, heap

import tightloop as tl

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48")) // 4
FORCES = ("cacc", "cfrc_int", "cfrc_ext", "subtree_linvel", "subtree_angmom")
TOUCHING = replace(CONSTRAINED, geoms=True, equalities=False, connections=False)


def model_of(seed: int, features: Features) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_string(add_sensors(random_mjcf(seed, 2 + seed % 6, features), seed, 3))


def kind_of(model: mujoco.MjModel, sensor: int) -> str:
    return mujoco.mjtSensor(model.sensor_type[sensor]).name


def strains(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether a row of an equality has a force and no Jacobian: bodies are welded that no joint moves that way."""
    assert not mujoco.mj_isSparse(model)
    rows = data.efc_J[: data.ne * model.nv].reshape(data.ne, model.nv)
    return bool(((rows == 0.0).all(axis=1) & (data.efc_force[: data.ne] != 0.0)).any())


def comparable(model: mujoco.MjModel, sensor: int, values: np.ndarray) -> np.ndarray:
    """What of a sensor does not depend on the order in which contacts are found."""
    _, reduction, number = model.sensor_intprm[sensor]
    if model.sensor_type[sensor] != mujoco.mjtSensor.mjSENS_CONTACT or reduction not in (0, 2):
        return values
    rows = values.reshape(number, -1)
    if reduction == 2:  # all contacts without force have the same one
        return rows if rows[0, 1:4].any() else rows[:, :4]
    if rows[0, 0] > number:  # not all are shown
        return rows[:, 0]
    coarse = np.round(rows / np.maximum(1.0, np.abs(rows).max(axis=0)), 3)
    return rows[np.lexsort(coarse.T)]


def assert_sensors(case: Live, seed: int, tolerance: float) -> set[str]:
    """Compare all sensors at random states, relative to the largest value of their type.

    Returns:
        Types that were not 0.
    """
    states = case.states(seed)
    frame = case.place(states)
    shown: set[str] = set()
    for world, data in enumerate(case.data(states)):
        data.time = frame.time[world]
        mujoco.mj_forward(case.model, data)
        shown |= assert_same_sensors(case.model, data, world, frame.sensordata[world], tolerance)
    return shown


def assert_same_sensors(
    model: mujoco.MjModel, data: mujoco.MjData, world: int, values: np.ndarray, tolerance: float
) -> set[str]:
    """Compare all sensors of a world; return the types that were not 0, none where MuJoCo has no unique answer."""
    shown: set[str] = set()
    if strains(model, data) or not all(has_closed_form(model, contact) for contact in data.contact):
        return shown
    # what a body feels is a sum of these
    forces = np.abs(data.cfrc_ext).max()
    kinds = np.repeat(model.sensor_type, model.sensor_dim)
    assert values.shape == data.sensordata.shape
    for sensor in range(model.nsensor):
        own = slice(model.sensor_adr[sensor], model.sensor_adr[sensor] + model.sensor_dim[sensor])
        expected, found = (comparable(model, sensor, all_[own]) for all_ in (data.sensordata, values))
        alike = data.sensordata[kinds == model.sensor_type[sensor]]
        felt = forces if model.sensor_needstage[sensor] == mujoco.mjtStage.mjSTAGE_ACC else 0.0
        scale = max(1.0, felt, np.abs(alike).max())
        error = np.abs(found - expected).max() / scale
        name = kind_of(model, sensor)
        assert error < tolerance, f"world {world}, {name} {sensor}: {found}, not {expected}"
        if expected.any():
            shown.add(name)
    return shown


@pytest.mark.parametrize("seed", range(TREES))
def test_sensors_are_mujocos(seed: int) -> None:
    with live(model_of(seed, CONSTRAINED), fields=("sensordata", *FORCES)) as case:
        assert_sensors(case, seed, 1e-8)


@pytest.mark.parametrize("seed", range(TREES))
def test_forces_between_bodies_are_mujocos(seed: int) -> None:
    with live(random_mjcf(seed, 2 + seed % 6, CONSTRAINED), fields=FORCES) as case:
        states = case.states(seed)
        frame = case.place(states)
        for world, data in enumerate(case.data(states)):
            mujoco.mj_forward(case.model, data)
            if strains(case.model, data):
                continue
            mujoco.mj_rnePostConstraint(case.model, data)
            mujoco.mj_subtreeVel(case.model, data)
            for name in FORCES:
                expected, found = getattr(data, name), getattr(frame, name)[world]
                error = np.abs(found - expected).max() / max(1.0, np.abs(expected).max())
                assert error < 1e-8, f"{name}: {error}"


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", range(TREES))
def test_sensors_feel_contacts(seed: int, cone: str) -> None:
    with live(model_of(seed, replace(TOUCHING, option=f'cone="{cone}"')), fields=("sensordata",)) as case:
        assert_sensors(case, seed, 1e-6)


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("seed", range(TREES // 2))
def test_contacts_that_sensors_show_are_mujocos(seed: int, cone: str) -> None:
    text = add_sensors(heap(seed, f'cone="{cone}"'), seed, 20, ("contact", "touch", "force", "torque"))
    with live(mujoco.MjModel.from_xml_string(text), fields=("sensordata",)) as case:
        assert_sensors(case, seed, 1e-6)


def pile(seed: int) -> str:
    """Bodies with several geoms that lie in each other, of kinds that touch in one point, and pairs that are named."""
    rng = np.random.default_rng(seed)
    bodies, geoms = [], []
    for body in range(6):
        parts = []
        for part in range(int(rng.integers(1, 5))):
            name, pos = f"g{body}_{part}", " ".join(f"{x:.3f}" for x in rng.uniform(-0.15, 0.15, 3))
            # a box touches a sphere in one point; it does not touch the floor
            boxed = body == 3 and part == 0
            shape = 'type="box" size=".1 .1 .1"' if boxed else f'contype="3" size="{rng.uniform(0.05, 0.12):.3f}"'
            parts.append(f'<geom name="{name}" {shape} pos="{pos}"/>')
            geoms.append((body, name))
        where = " ".join(f"{x:.3f}" for x in rng.uniform(-0.1, 0.1, 3))
        bodies.append(f'<body name="b{body}" pos="{where}"><freejoint/>{"".join(parts)}</body>')
    named = {tuple(sorted(rng.choice(len(geoms), 2, replace=False))) for _ in range(4)}
    pairs = [(geoms[a], geoms[b]) for a, b in named if geoms[a][0] != geoms[b][0]]
    contact = "".join(f'<pair geom1="{b}" geom2="{a}"/>' for (_, a), (_, b) in pairs)
    sensor = '<contact body1="b{}" num="{}" data="found force dist pos normal tangent"/>'
    sensors = "".join(sensor.format(body, 1 + body) for body in range(6))
    floor = '<geom name="floor" type="plane" size="3 3 .1" contype="0" conaffinity="2"/>'
    world = floor + '<geom name="post" size=".1" pos="0 .05 0"/>'
    return f"""<mujoco><option tolerance="0" iterations="100"/><worldbody>{world}{"".join(bodies)}</worldbody>
      <contact>{contact}</contact><sensor>{sensors}<contact num="20" data="found dist pos"/></sensor></mujoco>"""


@pytest.mark.parametrize("seed", range(TREES))
def test_the_first_contacts_of_a_sensor_are_mujocos(seed: int) -> None:
    model = mujoco.MjModel.from_xml_string(pile(seed))
    with live(model, fields=("sensordata",)) as case:
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        values = case.sim.forward().sensordata[0]
        left_out = 0
        for sensor in range(model.nsensor):
            first, number = model.sensor_adr[sensor], model.sensor_intprm[sensor, 2]
            expected = data.sensordata[first : first + model.sensor_dim[sensor]].reshape(number, -1)
            rows = values[first : first + model.sensor_dim[sensor]].reshape(number, -1)
            left_out += expected[0, 0] > number
            np.testing.assert_allclose(rows, expected, rtol=1e-6, atol=1e-6 * max(1.0, np.abs(expected).max()))
        assert left_out, "no sensor had to choose"


@pytest.mark.parametrize("substeps", [1, 3])
@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
@pytest.mark.parametrize("seed", range(TREES // 4))
def test_sensors_of_the_last_substep_lag_as_mujocos(seed: int, integrator: str, substeps: int) -> None:
    features = replace(TOUCHING, option=f'integrator="{integrator}"')
    shown: set[str] = set()
    with live(model_of(seed, features), fields=("sensordata",), substeps=substeps, outputs_at="last_substep") as case:
        states = case.states(seed)
        case.place(states)
        frame = case.sim.step(**({"ctrl": states.ctrl} if case.model.nu else {}))
        for world, data in enumerate(case.data(states)):
            mujoco.mj_step(case.model, data, substeps)
            shown |= assert_same_sensors(case.model, data, world, frame.sensordata[world], 1e-6)
    assert shown


@pytest.mark.parametrize("seed", range(TREES // 2))
def test_sensors_in_single_precision_are_near(seed: int) -> None:
    with live(model_of(seed, CONSTRAINED), fields=("sensordata",), precision="f32") as case:
        assert_sensors(case, seed, 1e-3)


@pytest.mark.parametrize("seed", range(TREES // 6))
def test_sensors_on_a_gpu_and_in_lanes_are_near(seed: int) -> None:
    """Recorded programs on lavapipe and worlds in SIMD lanes."""
    text = add_sensors(random_mjcf(seed, 2 + seed % 4, CONSTRAINED), seed, 1)
    for device in ("cpu", "gpu"):
        model = mujoco.MjModel.from_xml_string(text)
        with live(model, worlds=20, fields=("sensordata", "xpos"), precision="f32", device=device) as case:
            assert_sensors(case, seed, 1e-3)
            frame = case.sim.step()
            clock = model.sensor_adr[model.sensor_type == mujoco.mjtSensor.mjSENS_CLOCK][0]
            cutoff = model.sensor_cutoff[model.sensor_type == mujoco.mjtSensor.mjSENS_CLOCK][0] or np.inf
            np.testing.assert_allclose(frame.sensordata[:, clock], np.minimum(frame.time, cutoff), rtol=1e-6)


def test_contacts_on_a_gpu_are_near() -> None:
    text = add_sensors(heap(1, "", bodies=2), 1, 3, ("contact", "touch", "force", "torque", "rangefinder"))
    with live(mujoco.MjModel.from_xml_string(text), fields=("sensordata",), precision="f32", device="gpu") as case:
        assert_sensors(case, 1, 1e-2)


def test_every_type_of_sensor_appears_and_is_not_zero() -> None:
    shown: set[str] = set()
    for seed in range(8):
        with live(model_of(seed, CONSTRAINED), fields=("sensordata",)) as case:
            case.sim.step()
            shown |= assert_sensors(case, seed, 1e-8)
        text = add_sensors(heap(seed, ""), seed, 3, TOUCHES)
        with live(mujoco.MjModel.from_xml_string(text), fields=("sensordata",)) as case:
            shown |= assert_sensors(case, seed, 1e-6)
    names = {name.removeprefix("mjSENS_").lower() for name in shown}
    wanted = {kind.replace("actuatorfrc", "actfrc") for kind in (*KINDS, *TOUCHES) if kind != "actuatorfrc"}
    wanted.add("actuatorfrc")
    assert wanted <= names, wanted - names


def test_sensors_have_names_and_columns() -> None:
    xml = """<mujoco model="arm"><worldbody><body name="b"><joint name="j"/><geom size=".1"/><site name="s"/></body>
    </worldbody><sensor><gyro name="imu" site="s"/><jointpos joint="j"/></sensor></mujoco>"""
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml))
    arm = scene.models["arm"]
    assert (arm.sensor_names, arm.site_names, arm.geom_names) == (["imu", "sensor1"], ["s"], ["geom0"])
    with tl.launch(scene, worlds=2, fields=("sensordata",)) as sim:
        assert sim.sensor_names == ["arm/imu", "arm/sensor1"]
        assert sim.sensors["arm/imu"] == sim.sensors["imu"] == slice(0, 3)
        assert sim.sensors["sensor1"] == slice(3, 4)
        assert sim.step().sensordata.shape == (2, 4)


def test_sensors_that_are_not_supported_are_named_where_their_field_is_wanted() -> None:
    xml = """<mujoco model="arm"><worldbody><geom name="g" size=".1"/><body><joint name="j"/><geom name="h" size=".1"/>
    </body></worldbody><sensor><jointpos joint="j"/><user name="own" dim="2"/></sensor></mujoco>"""
    scene = tl.Scene.from_mujoco(mujoco.MjModel.from_xml_string(xml))
    assert any("sensor `own`: no support for user" in note for note in scene.models["arm"].notes)
    with tl.launch(scene, worlds=1, fields=("qpos",)) as sim:
        sim.step()
    with pytest.raises(tl.TightloopError, match=r"sensordata.*sensor `own`: no support for user"):
        tl.launch(scene, worlds=1, fields=("sensordata",))
