"""Physics steps per second beside MuJoCo C, one thread each, in one run.

    python benches/peers.py

Both run the target demo: the same robot, gains, limits, time step, solver options and targets, no contacts. MuJoCo runs
`mujoco.rollout`, which leaves Python once; tightloop runs through its daemon, a Python call and a frame of views each 8
steps. They take turns, so that a machine that changes its speed meanwhile changes both.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import mujoco
import numpy as np
from mujoco import rollout

import tightloop as tl

REPOSITORY = Path(__file__).parents[1]
sys.path.insert(0, str(REPOSITORY / "examples"))
from franka_lesson import FRAMES, START, STIFFNESS, URDF, scene, targets  # noqa: E402  (the examples are no package)

RECORDED = REPOSITORY.parent / "shared/reference/models/target.mjb"
SUBSTEPS = 8
WORLDS = 4096
PEER_WORLDS = 16  # its speed does not depend on the number
ROUNDS = 5


def peer() -> mujoco.MjModel:
    """MuJoCo's model of the lesson: the recorded one where it is present, else one of the same URDF."""
    if RECORDED.exists():
        model = mujoco.MjModel.from_binary_path(str(RECORDED))
    else:
        spec = mujoco.MjSpec.from_file(str(URDF))
        for dof, joint in enumerate(spec.joints):
            joint.armature = [0.195, 0.195, 0.195, 0.195, 0.074, 0.074, 0.074, 0.1, 0.1][dof]
            drive = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            drive.set_to_position(kp=STIFFNESS[dof], kv=STIFFNESS[dof] / 10)
        follow = spec.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=spec.joints[8].name, name2=spec.joints[7].name)
        follow.data[:5] = [0, 1, 0, 0, 0]
        spec.option.timestep = 1 / 480
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
        spec.option.iterations, spec.option.ls_iterations = 20, 100
        spec.option.impratio = 1000
        model = spec.compile()
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    return model


def peer_rate(model: mujoco.MjModel, commands: np.ndarray) -> float:
    """World-steps per second of one thread."""
    data = mujoco.MjData(model)
    data.qpos[:] = START
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.zeros(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, start, full)
    control = np.broadcast_to(np.repeat(commands, SUBSTEPS, axis=0), (PEER_WORLDS, FRAMES * SUBSTEPS, 9))
    began = time.perf_counter()
    rollout.rollout(model, data, np.tile(start, (PEER_WORLDS, 1)), control.astype(float))
    return PEER_WORLDS * FRAMES * SUBSTEPS / (time.perf_counter() - began)


def our_rate(sim: tl.Sim, commands: np.ndarray) -> float:
    """World-steps per second of one thread, through the daemon."""
    actions = [np.tile(command, (sim.worlds, 1)) for command in commands]
    sim.reset()
    began = time.perf_counter()
    for action in actions:
        sim.step(joint_target_q=action)
    return sim.worlds * FRAMES * SUBSTEPS / (time.perf_counter() - began)


def main() -> None:
    """Measure in turns and print the medians."""
    commands = np.array([targets(frame, np.ones(1))[0] for frame in range(FRAMES)])
    model = peer()
    theirs, ours = [], []
    with tl.launch(scene(driven=True), worlds=WORLDS, threads=1) as sim:
        for _ in range(ROUNDS):
            theirs.append(peer_rate(model, commands))
            ours.append(our_rate(sim, commands))
        device = sim.device
    them, us = float(np.median(theirs)), float(np.median(ours))
    source = "the recorded model" if RECORDED.exists() else "a model of the same URDF"
    print(f"target demo without contacts, one thread, median of {ROUNDS} rounds, world-steps/s")
    print(f"  MuJoCo C {mujoco.__version__} rollout, {source:<28}{them:>14,.0f}")
    print(f"  tightloop, {WORLDS} worlds, {device:<37}{us:>14,.0f}")
    print(f"  ratio {us / them:.1f} (rounds: {', '.join(f'{a / b:.1f}' for a, b in zip(ours, theirs, strict=True))})")


if __name__ == "__main__":
    main()
