"""Random robots of 1 to 64 dofs with every kind of joint, on a fixed or floating base, against MuJoCo.

TIGHTLOOP_LIVE_TREES sets how many.
"""

from __future__ import annotations

import os
from pathlib import Path

import mujoco
import numpy as np
import pytest
from comparison import DOUBLE, MOTION, NOTHING, SINGLE, assert_link_frames
from mujoco_model import CHAOS, ITERATIONS, PERTURBATION, Array
from numpy.random import Generator
from random_robots import KINDS, SCALARS, Coordinates, Tree, mujoco_model_of, random_tree

import tightloop as tl
from tiers import sweep

TREES = int(os.environ.get("TIGHTLOOP_LIVE_TREES", "48"))
STEPS = 200
# Every size up to 40 within 40 seeds, and a few beyond
SIZES = [1 + 17 * seed % 40 for seed in range(TREES)]
LARGE = [41, 52, 58, 64]
*OTHERS, LARGEST = enumerate(SIZES + LARGE)
SCENES = pytest.mark.parametrize(("seed", "dofs"), sweep([LARGEST, *OTHERS], daily=12))


def random_scene(folder: Path, seed: int, dofs: int) -> tuple[tl.Scene, dict[str, Tree], Generator]:
    """So many dofs in all, in one robot or two, one of them with a loose part; half of the scenes are rich."""
    rng = np.random.default_rng([seed, dofs])
    rich = seed % 2 == 1
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.solver(iterations=ITERATIONS, tolerance=0.0)
    left, trees = dofs, {}
    while left:
        name = f"r{len(trees)}"
        floating = left > 6 and bool(rng.random() < 0.6)
        own = left - 6 * floating
        part = own if trees or seed % 4 else int(rng.integers(1, own + 1))
        kinds = KINDS if seed % 5 else SCALARS
        tree = random_tree(rng, part, kinds=kinds, rich=rich)
        left -= part + 6 * floating
        if left >= 6 and seed % 3 == 0 and not floating:
            tree.loose = random_tree(rng, (left - 6) // 2, kinds=kinds, rich=rich, name="k")
            left -= 6 + (left - 6) // 2
        (folder / f"{name}.urdf").write_text(tree.text())
        turn = rng.normal(size=4)
        pose = {"pos": tuple(rng.uniform(-2, 2, 3)), "quat": tuple(turn / np.linalg.norm(turn))}
        robot = scene.add_urdf(folder / f"{name}.urdf", name=name, floating=floating, **pose)
        if rich:
            drive_some(rng, robot)
        trees[name] = tree
    return scene, trees, rng


def drive_some(rng: Generator, robot: tl.Robot) -> None:
    """Armatures, gains, modes and effort limits on what may be driven; balls only have armatures."""
    names = robot.dof_names
    turns = np.array([name.rsplit(".", 1)[-1] in ("wx", "wy", "wz") for name in names])
    free = turns | np.array([name.rsplit(".", 1)[-1] in ("vx", "vy", "vz") for name in names])
    balls = turns & np.array([".".join([name.rsplit(".", 1)[0], "vx"]) not in names for name in names])
    # one armature a ball, as in MuJoCo
    armature = {name: rng.uniform(0, 0.2) for name in {name.rsplit(".", 1)[0] for name in names}}
    robot.joint_armature = [
        armature[name.rsplit(".", 1)[0]] * (ball or not off) for name, off, ball in zip(names, free, balls, strict=True)
    ]
    robot.joint_target_ke = rng.uniform(0, 100, len(names)) * ~free
    robot.joint_target_kd = rng.uniform(0, 10, len(names)) * ~free
    robot.joint_target_mode = [str(mode) for mode in rng.choice(["position", "velocity", "both"], len(names))]
    robot.joint_effort_limit = np.where(~free & (rng.random(len(names)) < 0.5), rng.uniform(1, 20, len(names)), np.inf)


def launch(scene: tl.Scene, precision: str) -> tl.Sim:
    """One world with every field that is compared."""
    fields = ("joint_q", "joint_qd", "joint_qdd", "mass_matrix", "bias_force", "body_q", "body_qd", "body_jacobian")
    return tl.launch(scene, worlds=1, precision=precision, threads=1, fields=fields)


def random_state(rng: Generator, sim: tl.Sim) -> tuple[Array, Array]:
    """A pose within a turn and 0.3 m of rest, and velocities of about 1."""
    q = rng.uniform(-0.3, 0.3, len(sim.coord_names))
    for first, name in enumerate(sim.coord_names):
        if name.endswith(".qx"):
            turn = rng.normal(size=4)
            q[first : first + 4] = turn / np.linalg.norm(turn)
    return q, rng.normal(size=len(sim.dof_names))


def random_commands(rng: Generator, sim: tl.Sim) -> dict[str, Array]:
    """Forces, and targets of what may be driven."""
    last = [name.rsplit(".", 1)[-1] for name in sim.dof_names]
    drivable = np.array([part not in ("vx", "vy", "vz", "wx", "wy", "wz") for part in last])
    scales = {"joint_f": 0.3, "joint_target_q": 0.3 * drivable, "joint_target_qd": drivable}
    return {name: rng.normal(size=len(last)) * scale for name, scale in scales.items()}


def off(ours: Array, theirs: Array) -> float:
    """Largest difference, relative to the largest entry."""
    return float(np.abs(ours - theirs).max() / max(np.abs(theirs).max(), NOTHING))


def command(to: Coordinates, data: mujoco.MjData, q: Array, commands: dict[str, Array]) -> None:
    """Gives MuJoCo what our commands mean at a state: the same power on the same motion."""
    data.qfrc_applied[:] = np.linalg.solve(to.to_qvel(q).T, commands["joint_f"])
    data.ctrl[:] = to.control(commands["joint_target_q"], commands["joint_target_qd"])


@pytest.mark.parametrize("precision", ["f64", "f32"])
@SCENES
def test_dynamics_of_every_joint_are_mujocos(tmp_path, seed, dofs, precision):
    tolerances = DOUBLE if precision == "f64" else SINGLE
    scene, trees, rng = random_scene(tmp_path, seed, dofs)
    model = mujoco_model_of(scene, trees)
    with launch(scene, precision) as sim:
        assert len(sim.dof_names) == dofs
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        for _ in range(4):
            q, qd = random_state(rng, sim)
            commands = random_commands(rng, sim)
            sim.step(**{name: values[None] for name, values in commands.items()})
            frame = sim.write(joint_q=q[None], joint_qd=qd[None])
            # what the run's precision made of them
            q, qd = frame.joint_q[0].astype(float), frame.joint_qd[0].astype(float)
            dtype = frame.joint_q.dtype
            command(to, data, q, {name: values.astype(dtype).astype(float) for name, values in commands.items()})
            convert = to.to_qvel(q)
            data.qpos[:], data.qvel[:] = to.positions(q), convert @ qd
            mujoco.mj_forward(model, data)
            mass_matrix = np.zeros((model.nv, model.nv))
            mujoco.mj_fullM(model, data, mass_matrix)
            bias = convert.T @ (data.qfrc_bias + mass_matrix @ to.drift(q, qd))
            assert off(frame.mass_matrix[0], convert.T @ mass_matrix @ convert) < tolerances.dynamics
            assert off(frame.bias_force[0], bias) < tolerances.dynamics
            assert off(convert @ frame.joint_qdd[0] + to.drift(q, qd), data.qacc) < tolerances.acceleration
            theirs = np.hstack([data.xpos[1:], np.roll(data.xquat[1:], -1, axis=1)])
            order = [sim.body_names.index(model.body(i).name) for i in range(1, model.nbody)]
            assert_link_frames(frame.body_q[:, order].astype(float), theirs[None], tolerances.pose)
            jacobian = np.zeros((len(order), 6, model.nv))
            for body, rows in enumerate(jacobian, 1):
                mujoco.mj_jacBodyCom(model, data, rows[:3], rows[3:], body)
            assert off(frame.body_jacobian[0, order], jacobian @ convert) < tolerances.dynamics
            assert off(frame.body_qd[0, order], jacobian @ data.qvel) < tolerances.dynamics


@pytest.mark.parametrize("seed", range(4))
def test_single_precision_holds_along_a_chain_of_forty_dofs(tmp_path, seed):
    # there the factor of a mass matrix of 24 bits leaves 1e-3; the corrections must come near the rounding of q̈ itself
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, 40, width=1)
    (tmp_path / "chain.urdf").write_text(tree.text())
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.add_urdf(tmp_path / "chain.urdf", name="r")
    model = mujoco_model_of(scene, {"r": tree})
    with launch(scene, "f32") as sim:
        to, data = Coordinates(model, sim), mujoco.MjData(model)
        for _ in range(20):
            q, qd = random_state(rng, sim)
            frame = sim.write(joint_q=q[None], joint_qd=qd[None])
            q, data.qvel[:] = frame.joint_q[0].astype(float), frame.joint_qd[0]
            data.qpos[:] = to.positions(q)
            mujoco.mj_forward(model, data)
            assert off(frame.joint_qdd[0], data.qacc) < SINGLE.acceleration / 5


def light_chain(dofs: int, load: float) -> Tree:
    """Hinges one behind the other, of links that grow so much heavier to the last."""
    tree = Tree("l0", parts=['<link name="l0"/>'])
    for number in range(dofs):
        mass = float(load ** (number / (dofs - 1)))
        moments = " ".join(f'i{axis}{axis}="{1e-3 * mass!r}"' for axis in "xyz")
        inertial = f'<origin xyz="0.1 0 0"/><mass value="{mass!r}"/><inertia {moments} ixy="0" ixz="0" iyz="0"/>'
        axis = "0 0 1" if number % 3 == 0 else "0 1 0"
        tree.parts += [
            f'<link name="l{number + 1}"><inertial>{inertial}</inertial></link>',
            f'<joint name="j{number}" type="continuous"><parent link="l{number}"/><child link="l{number + 1}"/>'
            f'<origin xyz="{0.2 if number else 0} 0 0" rpy="{0.3 * (number % 2)!r} 0 0"/><axis xyz="{axis}"/></joint>',
        ]
    return tree


@pytest.mark.parametrize(("dofs", "load"), [(7, 100), (12, 100), (20, 1), (20, 100), (40, 1)])
def test_single_precision_carries_a_heavy_load_on_a_light_chain(tmp_path, dofs, load):
    # unrefined, accelerations are off by up to 4e-2
    tree, rng = light_chain(dofs, load), np.random.default_rng(0)
    (tmp_path / "chain.urdf").write_text(tree.text())
    scene = tl.Scene(dt=1e-3, substeps=1)
    scene.add_urdf(tmp_path / "chain.urdf", name="r")
    model = mujoco_model_of(scene, {"r": tree})
    with launch(scene, "f32") as sim:
        data = mujoco.MjData(model)
        for _ in range(20):
            data.qpos[:] = rng.uniform(-0.5, 0.5, dofs).astype(np.float32)
            frame = sim.write(joint_q=data.qpos[None])
            mujoco.mj_forward(model, data)
            assert off(frame.joint_qdd[0], data.qacc) < SINGLE.acceleration


@SCENES
def test_two_hundred_steps_of_every_joint_follow_mujoco(tmp_path, seed, dofs):
    scene, trees, rng = random_scene(tmp_path, seed, dofs)
    model = mujoco_model_of(scene, trees)
    with launch(scene, "f64") as sim:
        to, data, nudged = Coordinates(model, sim), mujoco.MjData(model), mujoco.MjData(model)
        q, qd = random_state(rng, sim)
        sim.write(joint_q=q[None], joint_qd=qd[None])
        for side, nudge in ((data, 0.0), (nudged, PERTURBATION)):
            side.qpos[:], side.qvel[:] = to.positions(q) + nudge, to.to_qvel(q) @ qd
        calm = 0
        for _ in range(STEPS):
            commands = random_commands(rng, sim)
            frame = sim.step(**{name: values[None] for name, values in commands.items()})
            for side in (data, nudged):
                command(to, side, q, commands)
                mujoco.mj_step(model, side)
            if np.abs(data.qpos - nudged.qpos).max() > CHAOS:
                break
            q, calm = frame.joint_q[0].astype(float), calm + 1
            assert to.distance(q, data.qpos) < MOTION, f"step {calm}"
        assert calm > STEPS // 2, f"chaotic after {calm} steps"
