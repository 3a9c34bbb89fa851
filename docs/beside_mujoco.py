"""A picture for the site: one scene drawn by MuJoCo's renderer and by tightloop's.

    MUJOCO_GL=egl python docs/beside_mujoco.py [FILE]

MuJoCo gets the triangles that tightloop draws, with the floor, sky and light of its own example models.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

import tightloop as tl
from tightloop.demo import lesson
from tightloop.view import Camera, Picture
from tightloop.view.meshes.floor import is_floor
from tightloop.view.parts import Parts, parts
from tightloop.view.poses import IDENTITY, compose

os.environ.setdefault("MUJOCO_GL", "egl")
import mujoco

FILE = Path(__file__).resolve().parent / "pages/assets/beside_mujoco.webp"
WIDTH, HEIGHT = 720, 540
CAMERA = Camera((1.25, -1.75, 0.95), (-0.25, -0.42, 0.33), 0.6)
JOINTS = [0.0, -0.6, 0.0, -2.2, 0.0, 1.7, 0.8, 0.03, 0.03]
CUBE = [0.0, -0.35, 0.125, 0.0, 0.0, 0.0, 1.0]
# as in MuJoCo's humanoid and the models of its Menagerie
STAGE = """
<mujoco>
  <visual>
    <headlight diffuse=".6 .6 .6" ambient=".3 .3 .3" specular="0 0 0"/>
    <rgba haze=".15 .25 .35 1"/>
    <global offwidth="1024" offheight="1024"/>
    <quality shadowsize="4096" offsamples="8"/>
  </visual>
  <asset>
    <texture type="skybox" builtin="gradient" rgb1=".3 .5 .7" rgb2="0 0 0" width="512" height="3072"/>
    <texture type="2d" name="floor" builtin="checker" mark="edge" rgb1=".2 .3 .4" rgb2=".1 .2 .3" markrgb=".8 .8 .8"
      width="300" height="300"/>
    <material name="floor" texture="floor" texuniform="true" texrepeat="5 5" reflectance=".2"/>
  </asset>
  <worldbody>
    <light pos="0 0 1.5" dir="0 0 -1" directional="true"/>
    <geom type="plane" size="0 0 .05" material="floor"/>
  </worldbody>
</mujoco>
"""


def by_mujoco(look: Parts, body_q: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return MuJoCo's picture of some parts; ``body_q`` is of one world, shape ``(bodies, 7)``."""
    spec = mujoco.MjSpec.from_string(STAGE)
    for part in look.of("visual"):
        if is_floor(part):
            continue
        body = IDENTITY if part.body < 0 else body_q[part.body]
        x, y, z, *turn = compose(np.asarray(body, float)[None], np.asarray(part.pose, float)[None])[0]
        for color in np.unique(part.mesh.colors, axis=0):
            name = f"mesh{len(spec.meshes)}"
            mesh = spec.add_mesh(name=name, inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
            mesh.uservert = np.asarray(part.mesh.vertices, float).ravel()
            mesh.userface = part.mesh.faces[(part.mesh.colors == color).all(axis=1)].astype(np.int32).ravel()
            placed = spec.worldbody.add_body(pos=[x, y, z], quat=[turn[3], *turn[:3]])
            placed.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, rgba=color / 255)
    model = spec.compile()
    model.vis.global_.fovy = np.degrees(CAMERA.fov)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    camera = mujoco.MjvCamera()
    x, y, z = np.subtract(CAMERA.target, CAMERA.position)
    camera.lookat[:], camera.distance = CAMERA.target, np.linalg.norm((x, y, z))
    camera.azimuth, camera.elevation = np.degrees([np.arctan2(y, x), np.arcsin(z / camera.distance)])
    renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
    renderer.update_scene(data, camera)
    return renderer.render()


def main() -> None:
    """Draw both and write them side by side."""
    scene = lesson.grasp()
    dynamics = tl.Dynamics(scene)
    look = parts(scene.to_toml(), "/", dynamics.body_names)
    shown = SimpleNamespace(body_q=dynamics.forward_kinematics(np.array([[*JOINTS, *CUBE]])))
    ours = Picture(look, WIDTH, HEIGHT).render(shown, camera=CAMERA)
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    Image.fromarray(np.hstack([by_mujoco(look, shown.body_q[0]), ours])).save(path, quality=80, method=6)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
