"""Make the recorded reference again: MuJoCo C in float64, from the models beside the reference data.

    python tests/data/record.py REFERENCE/models OUT

Needs PyPI `mujoco==3.17.*` (the models are binary, and bound to that version). Reproduces every file bit for bit.
"""

import sys
from pathlib import Path

import mujoco
import numpy as np

HERE = Path(__file__).parent
FRAMES = 180
SUBSTEPS = 8
DOFS = 9
# Start state and commands are float32 values, also in a float64 run.
START = np.array(
    [-3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1, 0.05, 0.05],
    dtype=np.float32,
)


def target(frame: int) -> np.ndarray:
    """Drive targets of a frame of the target demo, shape ``(dofs,)`` [rad or m], float32."""
    goal = START.copy()
    goal[3] += 0.4 * np.sin(2 * np.pi * frame / FRAMES)
    goal[7:] = 0.04
    return goal


def torque(frame: int) -> np.float32:
    """Torque of joint 3 in a frame of the torque demo [N·m]."""
    return np.float32(35.0 * np.sin(2 * np.pi * frame / FRAMES))


def rollout(models: Path, name: str) -> np.ndarray:
    """Rows of time [s], qpos and qvel, the start state first. ``(frames + 1, 1 + nq + nv)``"""
    model = mujoco.MjModel.from_binary_path(str(models / f"{name}.mjb"))
    data = mujoco.MjData(model)
    data.qpos[:DOFS] = START
    rows = [np.r_[0.0, data.qpos, data.qvel]]
    grasp = np.loadtxt(HERE / "grasp_targets.csv", delimiter=",", dtype=np.float32)
    for frame in range(FRAMES):
        if name == "grasp":
            data.ctrl[:] = grasp[frame]
        elif model.nu:
            data.ctrl[:] = target(frame)
        else:
            data.qfrc_applied[2] = torque(frame)
        mujoco.mj_step(model, data, SUBSTEPS)
        rows.append(np.r_[(frame + 1) / 60.0, data.qpos, data.qvel])
    return np.array(rows)


def forward(models: Path) -> dict[str, np.ndarray]:
    """One evaluation of the target scene at the start pose and a velocity of -0.5 … 0.5."""
    model = mujoco.MjModel.from_binary_path(str(models / "target.mjb"))
    data = mujoco.MjData(model)
    data.qpos[:] = START
    data.qvel[:] = np.linspace(-0.5, 0.5, DOFS)
    data.ctrl[:] = target(10)
    mujoco.mj_forward(model, data)
    mass_matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass_matrix)
    names = (
        "qpos qvel ctrl qfrc_bias qfrc_passive qfrc_actuator qacc_smooth qacc qfrc_constraint efc_type efc_pos".split()
    )
    names += "efc_D efc_R efc_aref efc_KBIP efc_force efc_frictionloss xpos xquat".split()
    return {"M": mass_matrix, "efc_J": data.efc_J.reshape(-1, model.nv)} | {name: getattr(data, name) for name in names}


def main(models: Path, out: Path) -> None:
    """Write the recorded files of tests/data into a folder."""
    out.mkdir(parents=True, exist_ok=True)
    for name in ("target", "torque_free", "torque", "grasp"):
        rows = rollout(models, name)
        # the grasp's cube has a coordinate more than dofs
        dofs = (rows.shape[1] - 1) // 2
        columns = ["t"] + [f"qpos{k}" for k in range(rows.shape[1] - 1 - dofs)] + [f"qvel{k}" for k in range(dofs)]
        np.savetxt(out / f"mujoco_{name}.csv", rows, fmt="%.17g", delimiter=",", header=",".join(columns))
    np.savez(out / "unit_forward_target.npz", **forward(models))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
