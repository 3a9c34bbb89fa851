"""Puts MuJoCo models with controls into a folder, for `gpu_bench --scenes FOLDER/NAME.toml` and `gpu_peers.py`.

    python -m benches card_scenes out/scenes

NAME.toml and the file that it names are the scene, NAME.csv has the controls of each frame, and NAME.mjb.gz is the
model for MuJoCo's other engines, which the same version of MuJoCo reads. Worlds begin in the model's first keyframe.
Without the wheels' files in out/menagerie, or a reference folder, their models are left out.
"""

from __future__ import annotations

import argparse
import gzip
import re
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

import tightloop as tl

BENCHES = Path(__file__).parents[1]
sys.path.insert(0, str(BENCHES / "physics"))
from mjlab_robots import feet_go1  # noqa: E402  (benches are no package)
from mujoco_files import REPOSITORY, Robot  # noqa: E402
from mujoco_robots import ROBOTS  # noqa: E402

REFERENCE = REPOSITORY.parent / "shared/reference"
# Controls repeat after so long [s]; fastest sine [Hz]
PERIOD, FREQUENCY_MAX = 2.0, 2.5
SEED = 0
# Substeps of MuJoCo-Warp's benchmarks
SUBSTEPS = 4

Controls = NDArray[np.float64]


def swings(model: mujoco.MjModel, robot: Robot) -> Controls:
    """Controls of world 0, `(frames, nu)`: sines about those of the start, of whole periods."""
    draw = np.random.default_rng(SEED)
    low, high = model.actuator_ctrlrange.T
    unbounded = low == high
    low, high = np.where(unbounded, -1.0, low), np.where(unbounded, 1.0, high)
    middle = model.key_ctrl[0] if model.nkey else (low + high) / 2
    frames = round(PERIOD / (robot.substeps * model.opt.timestep))
    at = np.arange(frames)[:, None] / frames
    cycles = draw.integers(1, int(FREQUENCY_MAX * PERIOD) + 1, model.nu)
    phases = draw.uniform(0.0, 1.0, model.nu)
    swing = robot.swing * (high - low) / 2 * np.sin(2 * np.pi * (cycles * at + phases))
    limited = model.actuator_ctrllimited.astype(bool)
    return np.where(limited, np.clip(middle + swing, low, high), middle + swing)


def begin(model: mujoco.MjModel, keyframe: str | None) -> None:
    """Make a keyframe the first one."""
    if keyframe is not None:
        key = model.key(keyframe).id
        for name in ("key_qpos", "key_qvel", "key_act", "key_ctrl"):
            getattr(model, name)[0] = getattr(model, name)[key].copy()


def write(folder: Path, name: str, model: mujoco.MjModel, substeps: int, controls: Controls) -> None:
    """Write the files of a scene; without sensors, which MuJoCo would evaluate in every step."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
    scene = tl.Scene.from_mujoco(model)
    scene.substeps = substeps
    np.savetxt(folder / f"{name}.csv", controls, fmt="%.9g", delimiter=",")
    with tempfile.NamedTemporaryFile(suffix=".mjb") as file:
        mujoco.mj_saveModel(model, file.name, None)
        (folder / f"{name}.mjb.gz").write_bytes(gzip.compress(Path(file.name).read_bytes()))
    scene.save(folder / f"{name}.toml")


def of_robot(name: str) -> Callable[[Path, str, Path], None]:
    """Writes a model of mujoco_robots.py."""

    def made(folder: Path, scene: str, reference: Path) -> None:
        robot = ROBOTS[name]
        model = robot.model(reference)
        begin(model, robot.keyframe)
        write(folder, scene, model, robot.substeps, swings(model, robot))

    return made


def go1(folder: Path, scene: str, _: Path) -> None:
    """mjlab's Go1 without its looks, which are 17 MB."""
    robot, spec = ROBOTS["mjlab Go1, feet only"], feet_go1()
    for geom in spec.geoms:
        if geom.contype == geom.conaffinity == 0:
            spec.delete(geom)
    for part in (*spec.meshes, *spec.materials, *spec.textures):
        spec.delete(part)
    model = spec.compile()
    begin(model, robot.keyframe)
    write(folder, scene, model, robot.substeps, swings(model, robot))


def dance(folder: Path, scene: str, reference: Path) -> None:
    """The G1 of MuJoCo-Warp's benchmark, with the motion that it replays."""
    of_g1 = reference / "mjwarp/unitree_g1"
    model = mujoco.MjModel.from_xml_path(str(of_g1 / "scene_flat.xml"))
    motion = np.load(of_g1 / "shuffle_dance.npz")
    model.key_qpos[0], model.key_qvel[0], model.key_ctrl[0] = (motion[name][0] for name in ("qpos", "qvel", "ctrl"))
    write(folder, scene, model, SUBSTEPS, motion["ctrl"])


def three(folder: Path, scene: str, reference: Path) -> None:
    """The three humanoids of MuJoCo-Warp's benchmark."""
    path = reference / "mjwarp/humanoid/three_humanoids.xml"
    model = mujoco.MjModel.from_xml_path(str(path))
    robot = Robot(scene, lambda _: model, SUBSTEPS)
    write(folder, scene, model, SUBSTEPS, swings(model, robot))


CARD: dict[str, Callable[[Path, str, Path], None]] = {
    "g1_flat": dance,
    "humanoid": of_robot("MuJoCo-Warp humanoid"),
    "three_humanoids": three,
    "ant": of_robot("gymnasium Ant"),
    "go1": go1,
    "shadow_hand": of_robot("mjx Shadow hand and cube"),
    "panda": of_robot("Menagerie Panda"),
}


def export(folder: Path, reference: Path, scenes: dict[str, Callable[[Path, str, Path], None]]) -> int:
    """Write scenes, and return how many; it prints why the others are left out."""
    folder.mkdir(parents=True, exist_ok=True)
    written = 0
    for name, make in scenes.items():
        try:
            make(folder, name, reference)
            written += 1
        except (FileNotFoundError, ValueError) as error:  # MuJoCo's error for a missing file
            print(f"{name} is left out: {error}")
    return written


def export_all(folder: Path, reference: Path) -> int:
    """Write the scenes of `make card`, and all models of mujoco_robots.py."""
    robots = {re.sub(r"\W+", "_", name): of_robot(name) for name in ROBOTS}
    return export(folder, reference, CARD | robots)


def main() -> int:
    """Write what there is; 1 where nothing is."""
    parser = argparse.ArgumentParser(description="MuJoCo models with controls, for gpu_bench and gpu_peers.py.")
    parser.add_argument("folder", type=Path, help="where they go")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of models that no wheel has")
    arguments = parser.parse_args()
    return int(not export(arguments.folder, arguments.reference, CARD))


if __name__ == "__main__":
    sys.exit(main())
