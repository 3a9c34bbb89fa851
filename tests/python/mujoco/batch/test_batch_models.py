"""`tightloop.mujoco.Batch`: names of fields, model fields per simulation, queries and snapshots."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from batch_reference import FIELDS, XML, Lockstep, N, model_of, positions, separate

from tightloop.mujoco import Batch

RAYS = 64


def test_every_bound_field_has_the_shape_and_dtype_of_mjdata() -> None:
    model = model_of()
    data, bound = mujoco.MjData(model), []
    with Batch(model, N, 1) as batch:
        for name in dir(data):
            value = getattr(data, name, None)
            if name.startswith("_") or not isinstance(value, np.ndarray):
                continue
            try:
                array = batch.bind(name)
            except ValueError as error:
                assert name in str(error)
                continue
            assert (array.shape, array.dtype) == ((N, *value.shape), value.dtype), name
            bound.append(name)
        assert {*FIELDS, "qpos", "qvel", "act", "ctrl", "eq_active", "mocap_pos"} <= set(bound)
        assert batch.bind("time").shape == (N,)
        batch.step()


def test_names_that_are_no_fields_are_refused_with_a_hint() -> None:
    with Batch(model_of(), N, 1) as batch:
        for call, name, message in (
            (batch.bind, "nope", "nope"),
            (batch.expand, "nope", "nope"),
            (batch.bind, "contact", "contact"),
            (batch.bind, "geom_friction", r'use expand\("geom_friction"\)'),
            (batch.bind, "gravity", r'use expand\("gravity"\)'),
            (batch.expand, "qpos", r'use bind\("qpos"\)'),
            (batch.bind, "crb", "crb: tightloop does not compute"),
            (batch.expand, "mesh_vert", "asset"),
        ):
            with pytest.raises(ValueError, match=message):
                call(name)
        assert batch.bind("qpos", np.float32).dtype == np.float32
        for name, dtype in (("qpos", None), ("eq_active", np.float32), ("xpos", np.int32), ("state", np.float32)):
            with pytest.raises(ValueError, match=name):
                batch.bind(name, dtype)
        for view, kind in ((batch.sensor, "sensor"), (batch.joint, "joint"), (batch.site, "site")):
            with pytest.raises(KeyError, match="nope"):
                view("nope")
            assert kind


EXPANSIONS = {
    "gravity": ("gravity", slice(None), (0.0, 1.0, -5.0)),
    "dof_armature": ("dof_armature", [1, 2, 3, 4], 0.05),
    "dof_damping": ("dof_damping", [0, 1, 2], 0.3),
    "dof_frictionloss": ("dof_frictionloss", [0, 1], 0.2),
    "mass": ("body_mass", [1, 2, 3, 4], [3.0, 1.0, 2.0, 0.5]),
    "inertia": ("body_inertia", [2, 3], [[0.02, 0.03, 0.04], [0.05, 0.06, 0.07]]),
    "gain": ("actuator_gainprm", (slice(None), [0, 1, 2]), [3.0, 0.5, 0.2]),
    "bias": ("actuator_biasprm", (slice(None), [0, 1, 2]), [0.3, -2.0, -0.1]),
}


@pytest.mark.parametrize("case", EXPANSIONS)
def test_expanded_fields_act_as_models_of_their_own(case: str) -> None:
    field, index, change = EXPANSIONS[case]
    model = model_of()
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        values = batch.expand(field)
        assert batch.expand(field) is values
        for sim, own in enumerate(models):
            home = own.opt if field == "gravity" else own
            np.testing.assert_array_equal(values[sim], getattr(home, field))
            getattr(home, field)[index] = np.multiply(change, sim + 1) / N
            values[sim] = getattr(home, field)
        lockstep = Lockstep(batch, models)
        lockstep.write("qpos", positions(model, 8))
        lockstep.write("ctrl", np.full((N, model.nu), 0.4))
        lockstep.step(nstep=3)
        lockstep.step([1, 2], nstep=2)
        lockstep.assert_equal(("qpos", "qvel"), 1e-8)


def test_a_flag_that_switches_a_part_off_holds_for_expanded_values() -> None:
    xml = XML.format(contacts=0).replace("<worldbody>", '<option><flag gravity="disable"/></option><worldbody>', 1)
    model = mujoco.MjModel.from_xml_string(xml)
    with Batch(model, N, 1, precision="f64") as batch:
        batch.expand("gravity")[:, 2] = -5.0
        lockstep = Lockstep(batch, [model] * N)
        lockstep.write("ctrl", np.full((N, model.nu), 0.4))
        lockstep.step(nstep=3)
        lockstep.assert_equal(("qpos", "qvel"), 1e-8)


def test_friction_and_scaled_bodies_act_as_models_of_their_own() -> None:
    model = model_of(contacts=True)
    models = separate(model)
    with Batch(model, N, 1, precision="f64") as batch:
        friction, mass, inertia = (batch.expand(field) for field in ("geom_friction", "body_mass", "body_inertia"))
        for sim, own in enumerate(models):
            own.geom_friction[:, 0] = 0.1 + 0.2 * sim
            own.body_mass[1:4] *= 1.0 + 0.3 * sim
            own.body_inertia[1:4] *= 1.0 + 0.3 * sim
            friction[sim], mass[sim], inertia[sim] = own.geom_friction, own.body_mass, own.body_inertia
        lockstep = Lockstep(batch, models)
        lockstep.write("qvel", np.tile([0, 0, 0, 0, 0, 2.0, 1.0, 0, 0, 0, 0], (N, 1)))
        lockstep.step(nstep=80)  # stones slide over the floor
        lockstep.assert_equal(("qpos", "qvel"), 1e-6)
        assert np.ptp(batch.bind("qvel")[:, 5]) > 0.01


def test_values_that_tightloop_cannot_vary_are_refused_by_simulation_and_field() -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1, precision="f64") as batch:
        mass = batch.expand("body_mass")
        mass[3, 1] = np.nan
        batch.step(np.array([0, 1]))
        with pytest.raises(ValueError, match="sim 3: body_mass is not finite"):
            batch.step()
        mass[3, 1] = -1.0
        with pytest.raises(ValueError, match=r"body_mass.*`model/cart`"):
            batch.step()
        mass[3, 1] = 1.0
        for field in ("body_parentid", "jnt_type", "dof_treeid", "actuator_trnid"):
            values, message = batch.expand(field), f"sim 2: {field} differs from the model's and says how a model"
            own = getattr(model, field)
            np.testing.assert_array_equal(values, np.repeat(own[None], N, axis=0))
            values[2] += 1
            for call in (batch.step, batch.forward, batch.reset):
                with pytest.raises(ValueError, match=message):
                    call()
            values[2] = own
        flags = batch.expand("enableflags")
        flags[4] |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
        with pytest.raises(ValueError, match="sim 4: sleep"):
            batch.forward()
        flags[4] = model.opt.enableflags
        batch.step()
        assert batch.bind("time")[3] == pytest.approx(0.004)


def test_equalities_are_switched_in_each_simulation() -> None:
    joined = '<equality><joint joint1="slide" joint2="hinge" polycoef="0 .1 0 0 0"/></equality><keyframe>'
    model = mujoco.MjModel.from_xml_string(XML.format(contacts=0).replace("<keyframe>", joined))
    own = [mujoco.MjData(model) for _ in range(N)]
    with Batch(model, N, 1, precision="f64") as batch:
        active, qpos, qvel = batch.bind("eq_active"), batch.bind("qpos"), batch.bind("qvel")
        assert (active == 1).all()
        qvel[:] = 0.5
        batch.step()
        active[5] = 0
        batch.step(nstep=3)
        for sim, data in enumerate(own):
            data.qvel[:] = 0.5
            mujoco.mj_step(model, data)
            data.eq_active[:] = sim != 5
            mujoco.mj_step(model, data, 3)
        np.testing.assert_allclose(qpos, [data.qpos for data in own], rtol=1e-8, atol=1e-10)
        assert not np.allclose(qpos[4], qpos[5])
        batch.reset()
        assert (active == 1).all()


@pytest.mark.parametrize(
    ("field", "place", "change"),
    [
        ("geom_size", (1, 0), 0.05),
        ("geom_pos", (3, 0), 0.3),
        ("body_pos", (1, 2), 0.2),
        ("jnt_axis", (0, 1), 0.4),
        ("geom_type", (1,), int(mujoco.mjtGeom.mjGEOM_ELLIPSOID)),
        ("geom_group", (1,), 3),
    ],
)
def test_rays_and_jacobians_see_the_geoms_of_each_simulation(field, place, change) -> None:
    model, rng = model_of(), np.random.default_rng(0)
    # from all around towards the cart and what it carries
    pnt = rng.uniform(-1.0, 1.0, (N, RAYS, 3)) + np.array([0.0, 0.0, 1.0])
    vec = rng.uniform([-0.12, -0.06, 0.94], [0.15, 0.06, 1.65], (N, RAYS, 3)) - pnt
    point, body = rng.uniform(-1.0, 1.0, (N, 3)), np.full(N, 3, np.int32)
    dist, geomid, jacp = np.zeros((N, RAYS)), np.zeros((N, RAYS), np.int32), np.zeros((N, 3, model.nv))
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    with Batch(model, N, 1, precision="f64") as batch:
        batch.rays(pnt, vec, dist, geomgroup=groups)
        batch.jac(jacp, None, point, body)
        before = dist[2].copy(), jacp[2].copy()
        values = batch.expand(field)
        values[2][place] = change if "i" in values.dtype.kind else values[2][place] + change
        batch.rays(pnt, vec, dist, geomid, geomgroup=groups)
        batch.jac(jacp, None, point, body)
        assert (dist[2] != before[0]).any() or (jacp[2] != before[1]).any(), "the change has an effect"
        qpos, hit = batch.bind("qpos"), np.zeros(1, np.int32)
        for sim in range(N):
            own = separate(model)[sim]
            getattr(own, field)[:] = values[sim]
            data = mujoco.MjData(own)
            data.qpos[:] = qpos[sim]
            mujoco.mj_kinematics(own, data)
            mujoco.mj_comPos(own, data)
            for ray in range(RAYS):
                far = mujoco.mj_ray(own, data, pnt[sim, ray], vec[sim, ray], groups, 1, -1, hit)
                assert abs(dist[sim, ray] - far) < 1e-9 and geomid[sim, ray] == hit[0]
            expected = np.zeros((3, model.nv))
            mujoco.mj_jac(own, data, expected, None, point[sim], int(body[sim]))
            np.testing.assert_allclose(jacp[sim], expected, atol=1e-12)
        other = batch.expand("body_weldid")
        other[1, 1] = 0
        with pytest.raises(ValueError, match="sim 1: body_weldid differs"):
            batch.rays(pnt, vec, dist)
        other[1, 1] = model.body_weldid[1]


def test_set_const_computes_constants_of_each_simulation() -> None:
    model = model_of()
    cart = model.body("cart").id
    own = separate(model)[0]
    with Batch(model, N, 1, precision="f64") as batch:
        mass = batch.expand("body_mass")
        mass[:, cart] = np.linspace(0.5, 3, N)
        with pytest.warns(UserWarning, match="softness"):
            batch.set_const()
        own.body_mass[cart] = 3.0
        mujoco.mj_setConst(own, mujoco.MjData(own))
        for field in ("body_subtreemass", "dof_invweight0"):
            np.testing.assert_allclose(batch.expand(field)[-1], getattr(own, field))
        data = mujoco.MjData(own)
        centers = batch.bind("subtree_com")
        batch.forward()
        mujoco.mj_forward(own, data)
        np.testing.assert_allclose(centers[-1], data.subtree_com, atol=1e-12)
        assert np.ptp(centers[:, cart, 2]) > 0.01


def test_set_const_names_the_first_simulation_that_mujoco_refuses() -> None:
    slider = '<body><joint type="slide"/><geom size=".1" contype="0" conaffinity="0"/></body>'
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody>{2 * slider}</worldbody></mujoco>")
    with Batch(model, N, 1) as batch:
        mass = batch.expand("body_mass")
        mass[[4, 5], 2], mass[3, 1] = 0.0, 7.0
        with pytest.raises(RuntimeError, match="sim 4"):
            batch.set_const()
        assert batch.expand("body_subtreemass")[3, 1] == 7.0


def test_rays_are_mujoco_s_and_change_nothing() -> None:
    model, rng, rays = model_of(contacts=True), np.random.default_rng(0), 16
    data = mujoco.MjData(model)
    with Batch(model, N, 1) as batch:
        qpos, xpos = batch.bind("qpos"), batch.bind("xpos")
        qpos[:] = positions(model, 3)
        pnt = rng.uniform(-1, 1, (N, rays, 3)) + np.array([0.5, 0, 2])
        vec = rng.normal(0, 0.3, (N, rays, 3)) - np.array([0, 0, 1])
        dist, geomid, normal = np.full((N, rays), 7.0), np.zeros((N, rays), np.int32), np.ones((N, rays, 3))
        batch.rays(pnt, vec, dist, geomid, normal, ids=np.array([1, 4]))
        hit, face = np.zeros(1, np.int32), np.zeros(3)
        for sim in (1, 4):
            data.qpos[:] = qpos[sim]
            mujoco.mj_forward(model, data)
            for ray in range(rays):
                far = mujoco.mj_ray(model, data, pnt[sim, ray], vec[sim, ray], None, True, -1, hit, face)
                assert (dist[sim, ray], geomid[sim, ray]) == (far, hit[0])
                if far >= 0:
                    np.testing.assert_array_equal(normal[sim, ray], face)
        assert {0, 1} <= set(geomid[[1, 4]].ravel())
        assert (dist[[0, 2, 3, 5]] == 7).all()
        assert (xpos == 0).all()
        with pytest.raises(ValueError, match="dist"):
            batch.rays(pnt, vec, dist[:, 1:])


def test_jacobians_are_mujoco_s() -> None:
    model, rng = model_of(), np.random.default_rng(1)
    data, linear, angular = mujoco.MjData(model), *np.empty((2, 3, model.nv))
    with Batch(model, N, 1) as batch:
        batch.bind("qpos", np.float32)[:] = positions(model, 7)
        point, body = rng.normal(0, 1, (N, 3)), rng.integers(0, model.nbody, N).astype(np.int32)
        jacp, jacr = np.full((N, 3, model.nv), 7.0), np.empty((N, 3, model.nv))
        batch.jac(jacp, jacr, point, body)
        batch.jac(None, jacr, point, body)
        for sim in range(N):
            data.qpos[:] = batch.bind("qpos", np.float32)[sim]
            mujoco.mj_forward(model, data)
            mujoco.mj_jac(model, data, linear, angular, point[sim], body[sim])
            np.testing.assert_allclose(jacp[sim], linear, atol=1e-12)
            np.testing.assert_allclose(jacr[sim], angular, atol=1e-12)
        with pytest.raises(ValueError, match="body"):
            batch.jac(jacp, None, point, body + 100)


def test_named_views_are_live() -> None:
    with Batch(model_of(), N, 1, precision="f64") as batch:
        joints = [batch.joint(name) for name in ("hinge", "ball", "free")]
        assert [(joint.qpos.shape[1], joint.qvel.shape[1]) for joint in joints] == [(1, 1), (4, 3), (7, 6)]
        push, tip, arm = batch.actuator("push"), batch.site("tip"), batch.body("arm")
        push.ctrl[:] = np.linspace(-1, 1, N)
        batch.step(nstep=3)
        np.testing.assert_allclose(push.force, push.ctrl, atol=1e-12)
        np.testing.assert_array_equal(joints[0].qpos[:, 0], batch.bind("qpos")[:, 1])
        assert np.ptp(tip.xpos[:, 0]) > 0
        np.testing.assert_allclose(np.linalg.det(tip.xmat.reshape(N, 3, 3)), 1.0)
        assert (arm.xpos.shape, arm.xquat.shape, arm.cvel.shape) == ((N, 3), (N, 4), (N, 6))


def test_snapshots_are_edited_as_a_whole() -> None:
    with Batch(model_of(), N, 1) as batch:
        sim = batch.sim
        first = sim.snapshot()
        sim.step(ctrl=np.ones(2))
        second = sim.snapshot()
        mask = np.arange(N) < 2
        mixed = second.with_worlds(first, mask)
        np.testing.assert_array_equal(mixed.numbers[:2], first.numbers[:2])
        np.testing.assert_array_equal(mixed.numbers[2:], second.numbers[2:])
        same = first.with_numbers(first.numbers)
        assert same.to_bytes() == first.to_bytes()
        frame = sim.restore(mixed)
        np.testing.assert_array_equal(frame.step, np.where(mask, 0, 1))


def test_mocap_bodies_and_activations_follow_their_rows() -> None:
    """A hand that pulls a body, and a filtered actuator, through writes, subsets, keyframes and forward calls."""
    model = mujoco.MjModel.from_xml_string(PULLED)
    sims = 6
    with Batch(model, sims, precision="f64") as batch:
        datas = [mujoco.MjData(model) for _ in range(sims)]
        names = ("qpos", "qvel", "act", "actuator_force", "xpos")
        bound = {name: batch.bind(name) for name in names}
        mocap, ctrl = batch.bind("mocap_pos"), batch.bind("ctrl")
        rng = np.random.default_rng(0)
        for call in range(20):
            ids = np.arange(sims) if call % 3 else np.array([1, 4])
            ctrl[ids], mocap[ids, 0] = rng.uniform(-1, 1, (len(ids), 1)), rng.normal([0, 0, 1], 0.1, (len(ids), 3))
            for sim in ids:
                datas[sim].ctrl[:], datas[sim].mocap_pos[:] = ctrl[sim], mocap[sim]
            if call == 10:
                batch.reset(ids, keyframe=0)
            elif call == 15:
                batch.forward(ids)
            else:
                batch.step(ids)
            for sim in ids:
                if call == 10:
                    mujoco.mj_resetDataKeyframe(model, datas[sim], 0)
                    datas[sim].ctrl[:], datas[sim].mocap_pos[:] = ctrl[sim], mocap[sim]
                if call in (10, 15):
                    mujoco.mj_forward(model, datas[sim])
                else:
                    mujoco.mj_step(model, datas[sim])
            for name in names:
                np.testing.assert_allclose(
                    bound[name][ids], [getattr(datas[sim], name) for sim in ids], rtol=1e-8, atol=1e-8, err_msg=name
                )


PULLED = """
<mujoco>
  <worldbody>
    <body name="hand" mocap="true" pos="0 0 1"><geom size=".02" contype="0" conaffinity="0"/></body>
    <body name="held" pos="0 0 1"><freejoint/><geom size=".05" mass=".2"/></body>
    <body pos="1 0 1"><joint name="hinge" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0 0 .3" size=".02"/></body>
  </worldbody>
  <equality><weld body1="hand" body2="held"/></equality>
  <actuator>
    <general joint="hinge" dyntype="filter" dynprm="0.02" gainprm="5" biastype="affine" biasprm="0 -5 0"/>
  </actuator>
  <keyframe><key qpos="0 .1 1 1 0 0 0 .5" ctrl=".2" act=".3" mpos="0 0 1.1"/></keyframe>
</mujoco>
"""
