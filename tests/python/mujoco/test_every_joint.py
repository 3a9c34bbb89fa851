"""Random trees of every kind of joint, on a fixed or floating base, against MuJoCo.

MuJoCo's free joint has the velocity of its frame's origin and the angular velocity in its own axes, ours those of its
centre of mass in world axes: `Coordinates` converts. MuJoCo has no planar joint: it is built as slide, slide, hinge.
"""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
from judge import DOUBLE, MOTION, NOTHING, SINGLE, assert_link_frames
from numpy.random import Generator
from trees import link, origin, words
from twin import CHAOS, COMPILER, ITERATIONS, PERTURBATION, Array

import tightloop as tl

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48"))
KINDS = ("continuous", "prismatic", "spherical", "planar")
STEPS = 200
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


def random_tree(rng: Generator, joints: int, kinds: tuple[str, ...]) -> tuple[str, dict[str, tuple[str, Array]]]:
    """A robot as URDF text, and the kind and axis of each joint by its child link."""
    parts, made = [link(rng, "l0", True)], {}
    for number in range(1, joints + 1):
        child, parent = f"l{number}", f"l{rng.integers(max(0, number - 3), number)}"
        kind, axis = str(rng.choice(kinds)), rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        made[child] = (kind, axis)
        parts.append(link(rng, child, True))
        parts.append(
            f'<joint name="j_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
            f'{origin(rng, 0.3)}<axis xyz="{words(axis)}"/><limit lower="-1e3" upper="1e3"/></joint>'
        )
    return "\n".join(['<robot name="tree">', *parts, "</robot>"]), made


def in_plane(normal: Array) -> tuple[Array, Array]:
    """The axes along which a planar joint slides: x and y, turned as z is turned to the normal the short way.

    For a normal that points down they are first turned by half a turn about x.
    """
    x, y, z = normal
    if z < -0.5:
        along, across = in_plane(np.array([x, -y, -z]))
        return along * [1, -1, -1], across * [1, -1, -1]
    turn = np.array([-y, x, 0.0, 1.0 + z])
    rotation = matrix(turn / np.linalg.norm(turn))
    return rotation[:, 0], rotation[:, 1]


def judge_of(text: str, made: dict[str, tuple[str, Array]], robot: tl.Robot) -> mujoco.MjModel:
    """MuJoCo's model: its URDF reader knows neither balls nor planes, so these joints are made by hand."""
    head = text.index(">") + 1
    plain = text[:head] + COMPILER.format(balance="false") + text[head:]
    plain = plain.replace('type="spherical"', 'type="fixed"').replace('type="planar"', 'type="fixed"')
    spec = mujoco.MjSpec.from_string(plain)
    for child, (kind, axis) in made.items():
        body = spec.body(child)
        if kind == "spherical":
            body.add_joint(name=f"j_{child}", type=mujoco.mjtJoint.mjJNT_BALL)
        elif kind == "planar":
            x, y = in_plane(axis)
            for part, along, motion in (("x", x, "SLIDE"), ("y", y, "SLIDE"), ("angle", axis, "HINGE")):
                body.add_joint(name=f"j_{child}.{part}", type=getattr(mujoco.mjtJoint, f"mjJNT_{motion}"), axis=along)
    root, (x, y, z, w) = spec.body("l0"), robot.quat
    root.pos, root.quat = robot.pos, (w, x, y, z)
    if robot.floating:
        root.add_freejoint(name="floating_base")
    model = spec.compile()
    option = model.opt
    option.timestep, option.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.tolerance, option.iterations = 0.0, ITERATIONS
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_LIMIT
    return model


def matrix(quat: Array) -> Array:
    """Rotation of a quaternion (x, y, z, w)."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.roll(quat, 1))
    return rotation.reshape(3, 3)


class Coordinates:
    """Our positions and velocities as MuJoCo's, by the names of the joints."""

    def __init__(self, model: mujoco.MjModel, sim: tl.Sim) -> None:
        self.model = model
        self.joints = []
        for number in range(model.njnt):
            joint, name = model.joint(number), f"r/{model.joint(number).name}"
            coords, dofs = (
                [i for i, own in enumerate(names) if own == name or own.startswith(f"{name}.")]
                for names in (sim.coord_names, sim.dof_names)
            )
            center = model.body_ipos[model.jnt_bodyid[number]]
            self.joints.append((int(model.jnt_type[number]), joint.qposadr[0], joint.dofadr[0], coords, dofs, center))

    def positions(self, q: Array) -> Array:
        """Ours ``(coords,)`` as qpos."""
        qpos = np.empty(self.model.nq)
        for kind, at, _, coords, _, _ in self.joints:
            own = q[coords].copy()
            if kind in (FREE, BALL):
                own[-4:] = np.roll(own[-4:], 1)
            qpos[at : at + len(own)] = own
        return qpos

    def to_qvel(self, q: Array) -> Array:
        """The matrix that takes our velocities at `q` to qvel, ``(dofs, dofs)``."""
        convert = np.zeros((self.model.nv, self.model.nv))
        for kind, _, at, coords, dofs, center in self.joints:
            block = np.eye(len(dofs))
            if kind == FREE:
                rotation = matrix(q[coords[3:]])
                x, y, z = rotation @ center
                # the origin moves with v - ω × r = v + r × ω
                block[:3, 3:] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
                block[3:, 3:] = rotation.T
            convert[np.ix_(range(at, at + len(dofs)), dofs)] = block
        return convert

    def drift(self, q: Array, qd: Array) -> Array:
        """What qacc has beside the converted accelerations: -ω × (ω × r) of a free body."""
        out = np.zeros(self.model.nv)
        for kind, _, at, coords, dofs, center in self.joints:
            if kind == FREE:
                spin = qd[dofs[3:]]
                out[at : at + 3] = -np.cross(spin, np.cross(spin, matrix(q[coords[3:]]) @ center))
        return out

    def distance(self, q: Array, qpos: Array) -> float:
        """Largest difference of positions; quaternions but for their sign."""
        off = self.positions(q) - qpos
        for kind, at, _, coords, _, _ in self.joints:
            if kind in (FREE, BALL):
                four = slice(at + len(coords) - 4, at + len(coords))
                other = off[four] + 2 * qpos[four]
                off[four] = min(off[four], other, key=np.linalg.norm)
        return float(np.abs(off).max())


def random_state(rng: Generator, sim: tl.Sim) -> tuple[Array, Array]:
    """A pose within a turn and 0.3 m of rest, and velocities of about 1."""
    q = rng.uniform(-0.3, 0.3, len(sim.coord_names))
    for first, name in enumerate(sim.coord_names):
        if name.endswith(".qx"):
            turn = rng.normal(size=4)
            q[first : first + 4] = turn / np.linalg.norm(turn)
    return q, rng.normal(size=len(sim.dof_names))


def launch(folder: Path, seed: int, precision: str) -> tuple[tl.Sim, mujoco.MjModel, Generator]:
    """A random tree with its judge; every third is plain, two of three float."""
    rng = np.random.default_rng([seed, 7])
    kinds = KINDS if seed % 3 else KINDS[:2]
    text, made = random_tree(rng, int(rng.integers(1, 11)), kinds)
    (folder / "tree.urdf").write_text(text)
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    turn = rng.normal(size=4)
    pose = {"pos": tuple(rng.uniform(-2, 2, 3)), "quat": tuple(turn / np.linalg.norm(turn))}
    robot = scene.add_urdf(folder / "tree.urdf", name="r", floating=seed % 3 != 1, **pose)
    fields = ("joint_q", "joint_qd", "joint_qdd", "mass_matrix", "bias_force", "body_q", "body_qd", "body_jacobian")
    sim = tl.launch(scene, worlds=1, precision=precision, threads=1, fields=fields)
    return sim, judge_of(text, made, robot), rng


def off(ours: Array, theirs: Array) -> float:
    """Largest difference, relative to the largest entry."""
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), NOTHING))


@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("seed", range(TREES))
def test_dynamics_of_every_joint_are_mujocos(tmp_path, seed, precision):
    tolerances = DOUBLE if precision == "f64" else SINGLE
    sim, model, rng = launch(tmp_path, seed, precision)
    with sim:
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        for _ in range(4):
            q, qd = random_state(rng, sim)
            frame = sim.write(joint_q=q[None], joint_qd=qd[None])
            # what the run's precision made of the state
            q, qd = frame.joint_q[0].astype(float), frame.joint_qd[0].astype(float)
            convert = to.to_qvel(q)
            data.qpos[:], data.qvel[:] = to.positions(q), convert @ qd
            mujoco.mj_forward(model, data)
            mass_matrix = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass_matrix)
            bias = convert.T @ (data.qfrc_bias + mass_matrix @ to.drift(q, qd))
            assert off(frame.mass_matrix[0], convert.T @ mass_matrix @ convert) < tolerances.dynamics
            assert off(frame.bias_force[0], bias) < tolerances.dynamics
            assert off(convert @ frame.joint_qdd[0] + to.drift(q, qd), data.qacc) < 10 * tolerances.acceleration
            theirs = np.hstack([data.xpos[1:], np.roll(data.xquat[1:], -1, axis=1)])
            order = [sim.body_names.index(f"r/{model.body(i).name}") for i in range(1, model.nbody)]
            assert_link_frames(frame.body_q[:, order].astype(float), theirs[None], tolerances.pose)
            jacobian = np.zeros((len(order), 6, model.nv))
            for body, rows in enumerate(jacobian, 1):
                mujoco.mj_jacBodyCom(model, data, rows[:3], rows[3:], body)
            assert off(frame.body_jacobian[0, order], jacobian @ convert) < tolerances.dynamics
            assert off(frame.body_qd[0, order], jacobian @ data.qvel) < tolerances.dynamics


@pytest.mark.parametrize("seed", range(TREES))
def test_two_hundred_steps_of_every_joint_follow_mujoco(tmp_path, seed):
    sim, model, rng = launch(tmp_path, seed, "f64")
    with sim:
        to, data, nudged = Coordinates(model, sim), mujoco.MjData(model), mujoco.MjData(model)
        q, qd = random_state(rng, sim)
        sim.write(joint_q=q[None], joint_qd=qd[None])
        for side, nudge in ((data, 0.0), (nudged, PERTURBATION)):
            side.qpos[:], side.qvel[:] = to.positions(q) + nudge, to.to_qvel(q) @ qd
        calm = 0
        for _ in range(STEPS):
            force = rng.normal(0, 0.3, len(qd))
            frame = sim.step(joint_f=force[None])
            for side in (data, nudged):
                # the same power on the same motion
                side.qfrc_applied[:] = np.linalg.solve(to.to_qvel(q).T, force)
                mujoco.mj_step(model, side)
            if np.abs(data.qpos - nudged.qpos).max() > CHAOS:
                break
            q, calm = frame.joint_q[0].astype(float), calm + 1
            assert to.distance(q, data.qpos) < MOTION, f"step {calm}"
        assert calm > STEPS // 2, f"chaotic after {calm} steps"
