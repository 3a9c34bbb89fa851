"""Scenes of benches/env/cameras.py. Needs MuJoCo and NumPy only, since each side compiles them itself."""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "physics"))
from mujoco_files import MENAGERIE, found

#: Pixels of a row and rows.
SIZE = 64
#: Squares of the rough ground, its width [m] and its height [m].
SQUARES, WIDTH, HEIGHT = 80, 8.0, 0.12


def panda(reference: Path) -> mujoco.MjModel:
    """The Panda of MuJoCo Menagerie over a table with a cube, seen from the other side of the table."""
    spec = mujoco.MjSpec.from_file(str(reference / "menagerie_panda/panda.xml"))
    box = mujoco.mjtGeom.mjGEOM_BOX
    add = spec.worldbody.add_geom
    add(name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], pos=[0, 0, -0.7], rgba=[0.6, 0.6, 0.6, 1])
    add(name="table", type=box, size=[0.5, 0.7, 0.02], pos=[0.4, 0, -0.02], rgba=[0.5, 0.35, 0.2, 1])
    add(name="cube", type=box, size=[0.025, 0.025, 0.025], pos=[0.5, 0.1, 0.025], rgba=[0.8, 0.1, 0.1, 1])
    spec.worldbody.add_light(pos=[0, 0, 4], dir=[0.2, 0.1, -1])
    _look(spec, (1.4, 0.5, 0.7), (0.3, 0.0, 0.25))
    return spec.compile()


def g1(_: Path) -> mujoco.MjModel:
    """The G1 of mjlab on rough ground, seen from the side."""
    spec = mujoco.MjSpec.from_file(str(found(MENAGERIE, "mjlab/mjlab/asset_zoo/robots/unitree_g1/xmls/g1.xml")))
    elevation = np.random.default_rng(0).uniform(0.0, 1.0, (SQUARES + 1, SQUARES + 1))
    spec.add_hfield(
        name="rough",
        nrow=SQUARES + 1,
        ncol=SQUARES + 1,
        size=[WIDTH / 2, WIDTH / 2, HEIGHT, 0.1],
        userdata=elevation.ravel().tolist(),
    )
    spec.worldbody.add_geom(name="ground", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="rough", pos=[0, 0, -HEIGHT])
    spec.worldbody.add_light(pos=[0, 0, 4], dir=[0.2, 0.1, -1])
    _look(spec, (2.2, -1.4, 1.3), (0.0, 0.0, 0.6))
    return spec.compile()


SCENES = {"panda": panda, "g1": g1}


def _look(spec: mujoco.MjSpec, eye: tuple[float, ...], target: tuple[float, ...]) -> None:
    """Add the camera `eye`, which looks at a point."""
    back = np.subtract(eye, target)
    right = np.cross((0.0, 0.0, 1.0), back)
    up = np.cross(back, right)
    axes: NDArray[np.float64] = np.concatenate([right / np.linalg.norm(right), up / np.linalg.norm(up)])
    camera = spec.worldbody.add_camera(name="eye", pos=list(eye), fovy=50.0)
    camera.alt.type = mujoco.mjtOrientation.mjORIENTATION_XYAXES
    camera.alt.xyaxes = axes.tolist()
