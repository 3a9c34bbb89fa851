"""Sites, inertial measurement units, joint torques and dry friction of each world against MuJoCo, on random robots."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison import DOUBLE, SINGLE
from contact_scenes import ContactScene, MujocoReference
from mujoco_model import Array
from numpy.random import Generator
from random_robots import Coordinates, mujoco_model_of
from test_every_joint import command, off, random_commands, random_scene, random_state

import tightloop as tl

SITES = 12
STATES = 4
SCENES = pytest.mark.parametrize(("seed", "dofs"), [(0, 7), (1, 12), (3, 30), (6, 24), (9, 18), (11, 40), (12, 30)])
PRECISIONS = pytest.mark.parametrize("precision", ["f64", "f32"])
FIELDS = ("joint_q", "joint_qd", "site_q", "site_qd", "gyro", "accelerometer", "joint_torque", "joint_qdd")
SENSORS = {
    "pos": mujoco.mjtSensor.mjSENS_FRAMEPOS,
    "quat": mujoco.mjtSensor.mjSENS_FRAMEQUAT,
    "linvel": mujoco.mjtSensor.mjSENS_FRAMELINVEL,
    "angvel": mujoco.mjtSensor.mjSENS_FRAMEANGVEL,
    "gyro": mujoco.mjtSensor.mjSENS_GYRO,
    "accelerometer": mujoco.mjtSensor.mjSENS_ACCELEROMETER,
}


def add_sites(rng: Generator, scene: tl.Scene) -> None:
    """Sites in the world and on links, half of them measured from another site or from a link."""
    links = [f"{name}/{link}" for name, robot in scene.robots.items() for link in robot.link_names]
    for number in range(SITES):
        others: list[str | None] = [*scene.sites, *links]
        quat = rng.normal(size=4)
        scene.add_site(
            body=None if rng.random() < 0.15 else str(rng.choice(links)),
            pos=tuple(rng.uniform(-0.3, 0.3, 3)),
            quat=tuple(quat / np.linalg.norm(quat)),
            relative_to=str(rng.choice(others)) if rng.random() < 0.5 else None,
            damping=0.1 * (1 + number),
            name=f"s{number}",
        )


def give_sites(scene: tl.Scene, spec: mujoco.MjSpec) -> None:
    """The same in MuJoCo, with its sensors."""
    for site in scene.sites.values():
        owner = spec.worldbody if site.body is None else spec.body(site.body)
        owner.add_site(name=site.name, pos=site.pos, quat=np.roll(site.quat, 1))
    for site in scene.sites.values():
        for name, kind in SENSORS.items():
            sensor = spec.add_sensor(name=f"{site.name}/{name}", type=kind, objname=site.name)
            sensor.objtype = mujoco.mjtObj.mjOBJ_SITE
            if site.relative_to is not None and name not in ("gyro", "accelerometer"):
                is_site = site.relative_to in scene.sites
                sensor.reftype = mujoco.mjtObj.mjOBJ_SITE if is_site else mujoco.mjtObj.mjOBJ_XBODY
                sensor.refname = site.relative_to


def shown(data: mujoco.MjData, name: str) -> Array:
    """A sensor of every site, ``(sites, entries)``."""
    return np.array([data.sensor(f"s{number}/{name}").data for number in range(SITES)])


@PRECISIONS
@SCENES
def test_sites_and_torques_of_random_robots_are_mujocos(tmp_path: Path, seed: int, dofs: int, precision: str):
    tolerances = DOUBLE if precision == "f64" else SINGLE
    scene, trees, rng = random_scene(tmp_path, seed, dofs)
    add_sites(rng, scene)
    model = mujoco_model_of(scene, trees, lambda spec: give_sites(scene, spec))
    with tl.launch(scene, worlds=1, precision=precision, fields=FIELDS) as sim:
        assert sim.site_names == [f"s{number}" for number in range(SITES)]
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        for _ in range(STATES):
            q, qd = random_state(rng, sim)
            commands = random_commands(rng, sim)
            sim.step(**{name: values[None] for name, values in commands.items()})
            frame = sim.write(joint_q=q[None], joint_qd=qd[None])
            q, qd = frame.joint_q[0].astype(float), frame.joint_qd[0].astype(float)
            dtype = frame.joint_q.dtype
            command(to, data, q, {name: values.astype(dtype).astype(float) for name, values in commands.items()})
            data.qpos[:], data.qvel[:] = to.positions(q), to.to_qvel(q) @ qd
            mujoco.mj_forward(model, data)
            poses = frame.site_q[0].astype(float)
            # sensors of MuJoCo take their units from the file: metres here
            assert np.abs(poses[:, :3] - shown(data, "pos")).max() < tolerances.pose * 10
            quats = np.roll(shown(data, "quat"), -1, axis=1)
            assert (1 - np.abs((poses[:, 3:] * quats).sum(axis=1))).max() < tolerances.pose
            speeds = np.hstack([shown(data, "linvel"), shown(data, "angvel")])
            assert off(frame.site_qd[0], speeds) < tolerances.dynamics
            assert off(frame.gyro[0], shown(data, "gyro")) < tolerances.dynamics
            # MuJoCo shows nothing on what stands still, where a real one shows gravity
            ids = [model.site(name).id for name in scene.sites]
            turns = data.site_xmat[ids].reshape(-1, 3, 3)
            still = model.body_weldid[model.site_bodyid[ids]] == 0
            at_rest = -np.einsum("sij,i->sj", turns, model.opt.gravity)
            accelerations = np.where(still[:, None], at_rest, shown(data, "accelerometer"))
            assert off(frame.accelerometer[0], accelerations) < tolerances.acceleration
            torque = to.to_qvel(q).T @ (data.qfrc_actuator + data.qfrc_applied)
            assert off(frame.joint_torque[0], torque) < tolerances.dynamics


def jacobian(model: mujoco.MjModel, data: mujoco.MjData, scene: tl.Scene, site: tl.Site) -> Array:
    """What takes qvel to the velocity of a site, as `site_qd` has it, ``(6, nv)``."""
    rows = np.zeros((6, model.nv))
    mujoco.mj_jacSite(model, data, rows[:3], rows[3:], model.site(site.name).id)
    if site.relative_to is None:
        return rows
    # less what carries the same point along with the other frame, in that frame's axes
    other, carried = scene.sites.get(site.relative_to), np.zeros((6, model.nv))
    if other is None:
        body, turn = model.body(site.relative_to).id, data.body(site.relative_to).xmat
    else:
        place = model.site(other.name).id
        body, turn = model.site_bodyid[place], data.site_xmat[place]
    mujoco.mj_jac(model, data, carried[:3], carried[3:], data.site(site.name).xpos, body)
    back = turn.reshape(3, 3).T
    return np.vstack([back @ (rows - carried)[:3], back @ (rows - carried)[3:]])


@PRECISIONS
@SCENES
def test_inverse_jacobians_of_sites_of_random_robots_are_mujocos(tmp_path: Path, seed: int, dofs: int, precision: str):
    scene, trees, rng = random_scene(tmp_path, seed, dofs)
    add_sites(rng, scene)
    model = mujoco_model_of(scene, trees, lambda spec: give_sites(scene, spec))
    with tl.launch(scene, worlds=1, precision=precision, fields=("joint_q", "site_inverse_jacobian")) as sim:
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        for _ in range(STATES):
            q, _ = random_state(rng, sim)
            frame = sim.write(joint_q=q[None])
            q = frame.joint_q[0].astype(float)
            data.qpos[:] = to.positions(q)
            mujoco.mj_forward(model, data)
            for number, site in enumerate(scene.sites.values()):
                rows = jacobian(model, data, scene, site) @ to.to_qvel(q)
                square = rows @ rows.T + site.damping**2 * np.eye(6)
                # a solve multiplies the rounding of the recursions by the condition of the matrix
                rounding = 1e-12 if precision == "f64" else 1e-6
                inverse = rows.T @ np.linalg.inv(square)
                limit = rounding * np.linalg.cond(square)
                assert off(frame.site_inverse_jacobian[0, number], inverse) < limit, (site, limit)


@PRECISIONS
@pytest.mark.parametrize(("seed", "dofs"), [(1, 12), (3, 30), (5, 9), (11, 40)])
def test_dry_friction_of_each_world_is_mujocos(tmp_path: Path, seed: int, dofs: int, precision: str):
    tolerances = DOUBLE if precision == "f64" else SINGLE
    scene, trees, rng = random_scene(tmp_path, seed, dofs)
    model = mujoco_model_of(scene, trees)
    worlds = 6
    with tl.launch(scene, worlds=worlds, precision=precision, params=("joint_friction",), fields=FIELDS) as sim:
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        held = {name: values[None].repeat(worlds, 0) for name, values in random_commands(rng, sim).items()}
        sim.step(**held)
        states = [random_state(rng, sim) for _ in range(worlds)]
        losses = rng.uniform(0.1, 3.0, (worlds, dofs))
        for kind, _, _, _, own, _ in to.joints:
            # MuJoCo has one friction for a joint
            losses[:, own] = losses[:, own[:1]] * (kind != mujoco.mjtJoint.mjJNT_FREE)
        sim.write(joint_q=np.array([q for q, _ in states]), joint_qd=np.array([qd for _, qd in states]))
        frame = sim.params.write(joint_friction=losses)
        losses = losses.astype(frame.joint_q.dtype).astype(float)
        for world in range(worlds):
            q, qd = frame.joint_q[world].astype(float), frame.joint_qd[world].astype(float)
            for _, _, at, _, own, _ in to.joints:
                model.dof_frictionloss[at : at + len(own)] = losses[world, own]
            command(to, data, q, {name: values[0].astype(frame.joint_q.dtype) for name, values in held.items()})
            convert = to.to_qvel(q)
            data.qpos[:], data.qvel[:] = to.positions(q), convert @ qd
            mujoco.mj_forward(model, data)
            theirs = np.linalg.solve(convert, data.qacc - to.drift(q, qd))
            assert off(frame.joint_qdd[world], theirs) < tolerances.acceleration


@PRECISIONS
def test_contact_sensors_add_up_what_mujoco_has_of_each_contact(precision: str):
    rng = np.random.default_rng(8)
    contact_scene = ContactScene()
    contact_scene.shape("plane", "ground", {})
    for number, height in enumerate((0.049, 0.147)):
        contact_scene.body(f"b{number}", np.array([0.01 * number, 0, height]), np.array([0, 0, 0, 1.0]))
        contact_scene.shape("box", f"s{number}", {"half_extents": (0.05, 0.05, 0.05)}, body=f"b{number}")
    model = contact_scene.compile()
    pairs = [("b0", None), ("b0", "b1"), ("b1/s1", "b0"), ("ground", None), ("b1", "ground")]
    for of, against in pairs:
        contact_scene.scene.add_contact_sensor(of=of, against=against)
    with tl.launch(
        contact_scene.scene,
        worlds=1,
        precision=precision,
        fields=("joint_q", "joint_qd", "contact_sensor", "contact_count"),
    ) as sim:
        assert sim.contact_sensor_names == ["contact", *(f"contact_{k}" for k in range(2, 6))]
        frame = sim.write(joint_qd=rng.uniform(-0.1, 0.1, (1, 12)))
        reference = MujocoReference(model, sim)
        _, count = reference.at(frame.joint_q[0].astype(float), frame.joint_qd[0].astype(float))
        assert count == frame.contact_count[0] == 8
        expected = np.zeros((len(pairs), 3))
        for number, contact in enumerate(reference.data.contact):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(model, reference.data, number, wrench)
            # on the second geom, along the contact's axes
            force = contact.frame.reshape(3, 3).T @ wrench[:3]
            first, second = (model.geom(geom).name for geom in contact.geom)
            for row, (of, against) in enumerate(pairs):
                for on, by, sign in ((second, first, 1.0), (first, second, -1.0)):
                    if on.startswith(of) and by.startswith(against or ""):
                        expected[row] += sign * force
        assert np.abs(expected[:4, 2]).min() > 1.0
        largest = np.abs(expected).max()
        assert np.abs(frame.contact_sensor[0] - expected).max() < largest * (1e-8 if precision == "f64" else 1e-3)
        # nothing of the upper box touches the ground
        assert not frame.contact_sensor[0, 4].any()
