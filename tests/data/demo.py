"""Make what the wheel's demo brings: `record.npz` of the recorded reference, and `pick_cube.npz` of the trained policy.

    python tests/data/demo.py

Needs `onnx`. Both files are read in `py-client/python/tightloop/demo`.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import numpy_helper

HERE = Path(__file__).parent
DEMO = HERE.parents[1] / "py-client/python/tightloop/demo"
TRAINED = HERE.parents[1] / "examples/trained"


def record() -> dict[str, np.ndarray]:
    """Coordinates of the recorded runs, frames 0 to 180, and the grasp's targets; `README.md` says more."""
    runs = {"target": ("mujoco_target", 9), "torque": ("mujoco_torque_free", 9), "grasp": ("mujoco_grasp", 16)}
    arrays = {
        name: np.loadtxt(HERE / f"{file}.csv", delimiter=",")[:, 1 : 1 + coords]
        for name, (file, coords) in runs.items()
    }
    return arrays | {"goals": np.loadtxt(HERE / "grasp_targets.csv", delimiter=",", dtype=np.float32)}


def policy(path: Path) -> dict[str, np.ndarray]:
    """Arrays of a policy as `examples/ppo.py` exports it."""
    weights = {one.name: numpy_helper.to_array(one) for one in onnx.load(path).graph.initializer}
    arrays = {"mean": weights["normalizer.mean"], "scale": weights["sqrt"]}
    for layer, name in enumerate(("actor.0", "actor.2", "actor.4")):
        arrays |= {f"weight{layer}": weights[f"{name}.weight"], f"bias{layer}": weights[f"{name}.bias"]}
    return arrays


if __name__ == "__main__":
    np.savez_compressed(DEMO / "record.npz", **record())
    np.savez_compressed(DEMO / "pick_cube.npz", **policy(TRAINED / "FrankaPickCube.onnx"))
