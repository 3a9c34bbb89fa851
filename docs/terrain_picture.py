"""The site's picture of terrain: twelve robots on one field of tiles.

    python docs/terrain_picture.py [FILE]

Drops a standing quadruped on each tile, and three more between them, and draws them in place on the CPU.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import tightloop as tl
from tightloop.tasks.quadruped import ROBOT
from tightloop.view import Picture
from tightloop.view.parts import parts

FILE = Path(__file__).resolve().parent / "pages/assets/terrain.webp"
SIZE = 960, 600  # pixels
KINDS = ("stairs", "rough", "steps")
HARDEST = {"stairs": 0.15, "rough": 0.08, "steps": 0.15}  # [m]
ASIDE = (1.5, 1.6, 0.0)  # of the robots that share a tile [m]
STEPS = 60  # control frames in which they come to rest


def main() -> None:
    """Draw and write."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    ground = tl.terrain.mixed(KINDS, levels=3, cell=0.05, border=1.0, hardest=HARDEST)
    scene = tl.Scene(dt=0.005, substeps=4)
    scene.solver(cone="pyramidal", impratio=1.0)
    ground.add_to(scene)
    ROBOT.add_to(scene)
    places = np.concatenate([ground.starts.reshape(-1, 3), ground.starts[1] + ASIDE])
    places[:, 2] = ground.height(places[:, 0], places[:, 1]) + ROBOT.height + 0.1
    with tl.launch(scene, worlds=len(places), threads=1) as sim:
        start = sim.reset().joint_q.copy()
        start[:, :3] = places
        frame = sim.write(joint_q=start)
        for _ in range(STEPS):
            frame = sim.step()
        seen = parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names)
        pixels = Picture(seen, *SIZE).render(frame)
    Image.fromarray(pixels).save(path, quality=80, method=6)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
