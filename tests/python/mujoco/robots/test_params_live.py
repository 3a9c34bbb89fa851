"""Parameters of each world against MuJoCo: what derives from masses at the reference pose stays on both sides."""

from __future__ import annotations

import copy

import mujoco
import numpy as np
import pytest
from contact_scenes import ContactScene, MujocoReference, lesson, states_of
from mujoco_model import Array
from numpy.random import Generator
from random_robots import Coordinates

import tightloop as tl
from conftest import START

WORLDS = 12
# Relative to the largest acceleration
TOLERANCES = {"f64": 1e-6, "f32": 1e-3}
OF_DOFS = ("joint_armature", "joint_damping", "joint_target_ke", "joint_target_kd", "joint_effort_limit")


def around(rng: Generator, numbers: Array) -> Array:
    """Other numbers for every world, ``(worlds, ...)``."""
    return numbers * rng.uniform(0.6, 1.5, (WORLDS, *np.shape(numbers)))


def give(model: mujoco.MjModel, sim: tl.Sim, world: int, params: dict[str, Array]) -> mujoco.MjModel:
    """MuJoCo's model with the numbers of a world."""
    own = copy.copy(model)
    own.opt.gravity[:] = params["gravity"][world]
    for link, scale in zip(sim.body_names, params["body_mass_scale"][world], strict=True):
        body = mujoco.mj_name2id(own, mujoco.mjtObj.mjOBJ_BODY, link)
        if body >= 0:
            own.body_mass[body] *= scale
            own.body_inertia[body] *= scale
    # MuJoCo has the masses of simple bodies twice; what derives from them for the softness of rows stays
    mujoco.mj_setConst(own, mujoco.MjData(own))
    for name in ("body_invweight0", "dof_invweight0"):
        getattr(own, name)[:] = getattr(model, name)
    for dof, name in enumerate(sim.dof_names):
        joint = mujoco.mj_name2id(own, mujoco.mjtObj.mjOBJ_JOINT, name)
        if joint < 0:
            continue  # of a free body: it has none of these
        place = own.jnt_dofadr[joint]
        own.dof_armature[place] = params["joint_armature"][world, dof]
        own.dof_damping[place] = params["joint_damping"][world, dof]
        limit = params["joint_effort_limit"][world, dof]
        own.jnt_actfrclimited[joint], own.jnt_actfrcrange[joint] = 1, (-limit, limit)
        for drive in np.flatnonzero(own.actuator_trnid[:, 0] == joint):
            # one follows the position target, another the velocity target, if any
            if own.actuator_biasprm[drive, 1]:
                stiffness = params["joint_target_ke"][world, dof]
                own.actuator_gainprm[drive, 0], own.actuator_biasprm[drive, 1] = stiffness, -stiffness
            if own.actuator_biasprm[drive, 2]:
                own.actuator_biasprm[drive, 2] = -params["joint_target_kd"][world, dof]
    names = sim.shape_names
    for pair, geoms in enumerate(zip(own.pair_geom1, own.pair_geom2, strict=True)):
        mu = [params["shape_mu"][world, names.index(own.geom(geom).name)] for geom in geoms]
        own.pair_friction[pair, :2] = max(mu)
    return own


def assert_same(
    sim: tl.Sim, model: mujoco.MjModel, states: tuple[Array, Array], params: dict[str, Array], *, touches: int = 0
) -> None:
    """Accelerations of every world at states (q, q̇), with parameters, ``body_f`` among them, of its own.

    At least so many worlds touch something.
    """
    sim.write(joint_q=states[0], joint_qd=states[1])
    frame = sim.params.write(**{name: params[name] for name in sim.params.names})
    touching = 0
    for world in range(WORLDS):
        own = give(model, sim, world, params)
        reference = MujocoReference(own, sim)
        push = np.zeros((own.nbody, 6))
        for link, wrench in zip(sim.body_names, params["body_f"][world], strict=True):
            body = mujoco.mj_name2id(own, mujoco.mjtObj.mjOBJ_BODY, link)
            if body >= 0:
                push[body] = wrench
        here, speed = frame.joint_q[world].astype(float), frame.joint_qd[world].astype(float)
        expected, count = reference.at(here, speed, push=push, control=targets(own, sim))
        off = np.abs(frame.joint_qdd[world] - expected).max() / max(1.0, np.abs(expected).max())
        assert off < TOLERANCES[sim.precision], f"world {world}: {off}"
        touching += count > 0
    assert len({tuple(row) for row in frame.joint_qdd}) == WORLDS
    assert touching >= touches


def targets(model: mujoco.MjModel, sim: tl.Sim) -> Array:
    """Where drives pull to: where the arm starts."""
    names = [model.joint(joint).name for joint in model.actuator_trnid[:, 0]]
    return np.array([START[sim.dof_names.index(name)] for name in names])


@pytest.mark.parametrize("precision", TOLERANCES)
def test_an_arm_with_numbers_of_its_own_in_each_world(precision: str):
    rng = np.random.default_rng(5)
    contact_scene, compiled = lesson(driven=True)
    model = compiled()
    names = ("gravity", "body_mass_scale", *OF_DOFS, "shape_mu", "body_f")
    with tl.launch(
        contact_scene.scene,
        worlds=WORLDS,
        precision=precision,
        params=names,
        fields=("joint_q", "joint_qd", "joint_qdd"),
    ) as sim:
        assert sim.params.names == names
        params = {name: around(rng, getattr(sim.params, name)[0]) for name in names[:-1]}
        q = START + rng.uniform(-0.2, 0.2, (WORLDS, 9)) * (np.arange(9) < 7)
        qd = rng.uniform(-0.5, 0.5, (WORLDS, 9)) * (np.arange(9) < 7)
        # MuJoCo has the centre of a link that weighs nothing somewhere else: ours is its frame's origin
        weighs = [model.body(name).mass[0] > 0 for name in sim.body_names]
        params["body_f"] = rng.uniform(-5, 5, (WORLDS, len(sim.body_names), 6)) * np.array(weighs)[:, None]
        assert_same(sim, model, (q, qd), params)


@pytest.mark.parametrize("precision", TOLERANCES)
def test_bodies_that_lie_and_slide_with_numbers_of_their_own(precision: str):
    rng = np.random.default_rng(6)
    contact_scene = ContactScene()
    contact_scene.shape("plane", "ground", {}, mu=0.4)
    for number in range(4):
        contact_scene.body(f"b{number}", np.array([0.2 * number, 0, 0.06 + 0.02 * number]), np.array([0, 0, 0, 1.0]))
        contact_scene.shape(
            "box", f"s{number}", {"half_extents": (0.05, 0.04, 0.05)}, body=f"b{number}", mu=0.2 * number
        )
    model = contact_scene.compile()
    names = ("gravity", "body_mass_scale", "shape_mu", "body_f")
    with tl.launch(
        contact_scene.scene,
        worlds=WORLDS,
        precision=precision,
        params=names,
        fields=("joint_q", "joint_qd", "joint_qdd"),
    ) as sim:
        steps = list(np.linspace(20, 300, WORLDS, dtype=int))
        q, qd = states_of(model, Coordinates(model, sim), steps, rng.uniform(-0.5, 0.5, model.nv))
        params = {name: around(rng, getattr(sim.params, name)[0]) for name in names[:-1]}
        for name in OF_DOFS:
            params[name] = np.zeros((WORLDS, len(sim.dof_names)))
        push = rng.uniform(-2, 2, (WORLDS, len(sim.body_names), 6)) * [1, 1, 1, 0.1, 0.1, 0.1]
        assert_same(sim, model, (q, qd), params | {"body_f": push}, touches=WORLDS // 2)
