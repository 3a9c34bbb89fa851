"""`tightloop.mujoco.Batch` at its edges: clocks of single simulations, values and arguments that are refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
from batch_reference import XML, N, model_of, positions

from tightloop.mujoco import Batch
from tightloop.mujoco.batch import engine

CLOCKS = """
<mujoco>
  <option timestep="0.01">{flag}</option>
  <worldbody><body><joint name="turn" type="slide"/><geom size=".1" mass="1"/></body></worldbody>
  <sensor><clock/><jointpos joint="turn"/><clock cutoff="0.05"/></sensor>
</mujoco>
"""

PAIR = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 .1"/>
    <body name="ball" pos="0 0 1"><freejoint/><geom name="ball" size=".1"/></body>
  </worldbody>
  <contact><pair geom1="floor" geom2="ball"/></contact>
</mujoco>
"""

MOVED = """
<mujoco>
  <worldbody>
    <body name="hand" mocap="true" pos="0 0 1"><geom size=".02" contype="0" conaffinity="0"/></body>
    <body name="held" pos="0 0 1"><freejoint/><geom size=".05" mass=".2" contype="0" conaffinity="0"/></body>
    <body pos="1 0 1"><joint name="hinge" axis="0 1 0"/><geom size=".02" pos="0 0 .3"/></body>
  </worldbody>
  <equality><weld body1="hand" body2="held"/></equality>
  <actuator><general joint="hinge" dyntype="filter" dynprm="0.02"/></actuator>
</mujoco>
"""


@pytest.mark.parametrize("forward", [False, True])
@pytest.mark.parametrize("flag", ["", '<flag sensor="disable"/>'])
def test_clock_sensors_show_the_time_of_their_own_simulation(forward: bool, flag: str) -> None:
    model = mujoco.MjModel.from_xml_string(CLOCKS.format(flag=flag))
    datas = [mujoco.MjData(model) for _ in range(3)]
    with Batch(model, 3, 1, forward, precision="f64") as batch:
        sensors, time = batch.bind("sensordata"), batch.bind("time")

        def advance(nstep: int) -> None:
            batch.step(nstep=nstep)
            for sim, data in enumerate(datas):
                mujoco.mj_step(model, data, nstep)
                if forward:
                    mujoco.mj_forward(model, data)
                np.testing.assert_allclose(sensors[sim], data.sensordata, rtol=1e-9, atol=1e-9)

        advance(4)
        batch.reset(np.array([1]))
        mujoco.mj_resetData(model, datas[1])
        mujoco.mj_forward(model, datas[1])
        np.testing.assert_array_equal(sensors[1], datas[1].sensordata)
        advance(1)
        time[2] = datas[2].time = 7.0
        advance(3)
        batch.expand("gravity")
        advance(2)


def test_rays_without_a_direction_are_refused() -> None:
    with Batch(model_of(), N, 1) as batch:
        pnt, dist = np.zeros((N, 2, 3)), np.zeros((N, 2))
        down = np.tile([0.0, 0.0, -1.0], (N, 2, 1))
        for bad, message in ((0.0, "length 0"), (np.nan, "vec has a value that is NaN"), (np.inf, "vec has a value")):
            vec = down.copy()
            vec[3, 1] = bad
            with pytest.raises(ValueError, match=message):
                batch.rays(pnt, vec, dist)
            batch.rays(pnt, vec, dist, ids=np.array([0, 4]))
        with pytest.raises(ValueError, match="pnt has a value"):
            batch.rays(pnt + np.nan, down, dist)
        point, body, jacobian = np.zeros((N, 3)), np.zeros(N, np.int32), np.zeros((N, 3, batch.model.nv))
        calls: list[tuple[Callable[..., None], tuple[Any, ...], str]] = [
            (batch.rays, (pnt.tolist(), down, dist), "pnt"),
            (batch.rays, (pnt, down.tolist(), dist), "vec"),
            (batch.jac, (jacobian, None, point.tolist(), body), "point"),
            (batch.jac, (jacobian, None, point, body.tolist()), "body"),
            (batch.jac, (jacobian.tolist(), None, point, body), "jacp"),
        ]
        for call, arguments, name in calls:
            with pytest.raises(ValueError, match=f"{name} must be an array"):
                call(*arguments)


@pytest.mark.parametrize("hill", [False, True])
def test_rays_have_mujoco_s_filters_with_and_without_a_height_field(hill: bool) -> None:
    spec = mujoco.MjSpec.from_string(XML.format(contacts=1))
    if hill:
        spec.add_hfield(name="hill", nrow=3, ncol=3, size=[2, 2, 0.2, 0.1], userdata=np.linspace(0, 1, 9))
        field = spec.worldbody.add_geom(name="hill", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="hill", group=4)
        field.contype = field.conaffinity = 0
    model, rng, rays = spec.compile(), np.random.default_rng(3), 40
    data, hit, face = mujoco.MjData(model), np.zeros(1, np.int32), np.zeros(3)
    pnt = rng.normal(0, 0.3, (N, rays, 3)) + np.array([0.5, 0, 2])
    vec = (rng.normal(0, 0.5, (N, rays, 3)) + np.array([0.5, 0, 0.5]) - pnt).astype(np.float32)
    body = rng.integers(-2, model.nbody + 2, rays).astype(np.int32)
    pnt, dist, normal = pnt.astype(np.float32), np.zeros((N, rays), np.float32), np.zeros((N, rays, 3), np.float32)
    geomid = np.zeros((N, rays), np.int32)
    with Batch(model, N, 2) as batch:
        batch.bind("qpos")[:] = positions(model, 3)
        for group in (None, np.array([1, 0, 0, 0, 1, 0], np.uint8), np.array([0, 1, 1, 1, 1, 1], np.uint8)):
            for static in (True, False):
                batch.rays(pnt, vec, dist, geomid, normal, group, static, body)
                for sim in range(N):
                    data.qpos[:] = batch.bind("qpos")[sim]
                    mujoco.mj_forward(model, data)
                    for ray in range(rays):
                        start, way = pnt[sim, ray].astype(float), vec[sim, ray].astype(float)
                        far = mujoco.mj_ray(model, data, start, way, group, static, body[ray], hit, face)
                        assert geomid[sim, ray] == hit[0]
                        assert dist[sim, ray] == pytest.approx(far, rel=1e-6)
                        np.testing.assert_allclose(normal[sim, ray], face if far >= 0 else 0, atol=1e-6)


def test_a_launch_that_fails_gives_the_same_error_again() -> None:
    with Batch(mujoco.MjModel.from_xml_string(PAIR), 2, 1, device="gpu", precision="f64") as batch:
        messages = []
        for _ in range(2):
            with pytest.raises(ValueError, match="a GPU computes in single precision") as caught:
                batch.step()
            messages.append(str(caught.value))
        assert messages[0] == messages[1]


def test_a_batch_goes_on_when_the_cause_of_a_failed_launch_is_gone(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise MemoryError("full")

    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch, Batch(model, N, 1, precision="f64") as other:
        for each in (batch, other):
            each.step(nstep=5)
            each.bind("qacc")
        with monkeypatch.context() as patch:
            patch.setattr(engine, "launch", refuse)
            for _ in range(2):
                with pytest.raises(MemoryError, match="full"):
                    batch.step()
        for each in (batch, other):
            each.step(nstep=3)
        np.testing.assert_allclose(batch.bind("qpos"), other.bind("qpos"), rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(batch.bind("time"), other.bind("time"))


def test_fields_whose_sizes_change_are_refused() -> None:
    with Batch(model_of(), N, 1) as batch:
        for name in ("efc_force", "iefc_force", "island_nv", "map_efc2iefc", "iacc", "ifrc_smooth"):
            with pytest.raises(ValueError, match=f"{name}: tightloop does not compute"):
                batch.bind(name)


def test_counts_are_integers() -> None:
    model = model_of()
    for name, arguments in (("num_sims", (2.5,)), ("num_threads", (2, "1"))):
        with pytest.raises(ValueError, match=f"{name} must be an integer"):
            Batch(model, *arguments)  # pyright: ignore[reportArgumentType]
    with Batch(model, np.int32(2), 1) as batch:  # pyright: ignore[reportArgumentType]
        for nstep in (2.5, "2", None):
            with pytest.raises(ValueError, match="nstep must be an integer"):
                batch.step(nstep=nstep)  # pyright: ignore[reportArgumentType]
        with pytest.raises(ValueError, match="keyframe must be an integer; got 'home'"):
            batch.reset(keyframe="home")  # pyright: ignore[reportArgumentType]


def test_a_mocap_quaternion_of_zeros_is_no_rotation() -> None:
    model = mujoco.MjModel.from_xml_string(MOVED)
    with Batch(model, 2, 1, precision="f64") as batch, Batch(model, 2, 1, precision="f64") as unit:
        quat, same = batch.bind("mocap_quat"), unit.bind("mocap_quat")
        quat[0], quat[1] = 0.0, (0.0, 1.0, 0.0, 0.0)
        same[0], same[1] = (1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0)
        for each in (batch, unit):
            each.step(nstep=3)
        np.testing.assert_array_equal(batch.bind("qpos"), unit.bind("qpos"))
        assert (quat[0] == 0.0).all()


def test_values_that_are_not_finite_are_refused_by_field_and_simulation() -> None:
    with Batch(mujoco.MjModel.from_xml_string(MOVED), 3, 1) as batch:
        for name in ("act", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat"):
            field = batch.bind(name)
            before = field[1].copy()
            for bad in (np.nan, np.inf):
                field[1].flat[0] = bad
                with pytest.raises(ValueError, match=f"sim 1: {name} is NaN"):
                    batch.step()
                batch.step(np.array([0, 2]))
            field[1] = before
        batch.step()
        assert np.isfinite(batch.bind("state")).all()
