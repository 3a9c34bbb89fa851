"""The README's picture of robots that walk: sixteen of them follow the same command.

    python docs/walking_picture.py [FILE]

Runs the trained policy of QuadrupedVelocityFlat, draws on the CPU and writes an animated WebP;
two minutes on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import onnxruntime
from PIL import Image

import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.quadruped import QuadrupedVelocityFlat
from tightloop.view import Camera, Picture
from tightloop.view.parts import parts

REPOSITORY = Path(__file__).resolve().parents[1]
FILE = REPOSITORY / "docs/pages/assets/walking.webp"
POLICY = REPOSITORY / "examples/trained/QuadrupedVelocityFlat.onnx"
SIZE = 640, 360  # pixels
WORLDS, STEPS, EVERY = 16, 250, 4  # control steps of 20 ms, and of how many one is shown
QUALITY = 35


class Formation(QuadrupedVelocityFlat):
    """All robots look along x, and get the same command: ahead, then a turn to the left."""

    goal_steps = 125

    def scene(self) -> tl.Scene:
        """The task's, without its draws."""
        scene = super().scene()
        still = tl.Uniform(0.0, 0.0)
        scene.randomize(joint_q={"dog": still}, body_q={"dog": {"yaw": still}})
        return scene

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Ahead for 2.5 s, then on while turning."""
        turn = np.where(worlds.elapsed > 0, 0.8, 0.0)
        return xp.stack([0.9 + 0.0 * turn, 0.0 * turn, turn], 1)


def main() -> None:
    """Draw and write."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    policy = onnxruntime.InferenceSession(POLICY, providers=["CPUExecutionProvider"])
    envs = VectorEnv(Formation(pushes=0.0), WORLDS, render_mode="rgb_array")
    try:
        sim = envs.sim
        picture = Picture(parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names), *SIZE)
        obs, _ = envs.reset(seed=0)
        images = []
        for step in range(STEPS):
            if step % EVERY == 0:
                x, y, _ = (float(value) for value in envs.frame.joint_q[:, :3].mean(axis=0))
                camera = Camera((x + 1.6, y - 2.9, 1.5), (x + 0.6, y + 1.2, 0.1), 0.7)
                images.append(Image.fromarray(picture.render(envs.frame, camera=camera, contacts=False)))
            obs, *_ = envs.step(np.asarray(policy.run(["action"], {"obs": obs})[0]))
    finally:
        envs.close()
    duration = round(1000 * EVERY * envs.control_dt)
    images[0].save(path, save_all=True, append_images=images[1:], duration=duration, loop=0, quality=QUALITY, method=6)
    print(f"{path}: {len(images)} pictures, {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
