"""The picture of an arm that picks up a cube by its depth camera: the arm, and what the camera sees.

    pip install onnxruntime
    python docs/depth_picture.py [FILE]

Runs the trained policy, draws on the CPU and writes an animated WebP; a minute on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path

import animation
import numpy as np
import onnxruntime
from numpy.typing import NDArray
from PIL import Image

from tightloop.env import VectorEnv
from tightloop.view import Camera, Picture
from tightloop.view.parts import parts

REPOSITORY = Path(__file__).resolve().parents[1]
FILE = REPOSITORY / "docs/pages/assets/pick_cube_depth.webp"
POLICY = REPOSITORY / "examples/trained/FrankaPickCubeDepth.onnx"
SIZE = 480, 360  # pixels of the arm's picture; the image beside it is as high
EPISODES, EVERY = 3, 2  # episodes of 50 steps of 50 ms, and of how many steps one is shown
SEED = 2_000_000  # no training came there
NEAR, FAR = 0.03, 0.5  # what is white and what is black [m]
EYE, AIM = (0.75, -0.75, 0.55), (-0.12, 0.0, 0.16)
QUALITY = 45


def seen(depth: NDArray[np.float32]) -> Image.Image:
    """Return a depth image in grey, the nearest brightest; what is too far is black."""
    far = np.where(depth > 0.0, depth, FAR)
    grey = np.clip((FAR - far) / (FAR - NEAR), 0.0, 1.0)
    image = Image.fromarray((255.0 * grey).astype(np.uint8))
    return image.resize((SIZE[1], SIZE[1]), Image.Resampling.NEAREST).convert("RGB")


def main() -> None:
    """Draw and write."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    policy = onnxruntime.InferenceSession(POLICY, providers=["CPUExecutionProvider"])
    envs = VectorEnv("FrankaPickCubeDepth", 1, autoreset_mode="SAME_STEP", render_mode="rgb_array", threads=2)
    images = []
    try:
        info = envs.sim.info
        picture = Picture(parts(info["scene"], info["scene_folder"], info["body_names"]), *SIZE)
        obs, _ = envs.reset(seed=SEED)
        for step in range(EPISODES * (envs.max_episode_steps or 0)):
            if step % EVERY == 0:
                arm = picture.render(envs.frame, camera=Camera(EYE, AIM, 0.7), goals=envs.marks, contacts=False)
                image = Image.new("RGB", (SIZE[0] + SIZE[1], SIZE[1]))
                image.paste(Image.fromarray(arm), (0, 0))
                image.paste(seen(envs.frame.wrist_depth[0]), (SIZE[0], 0))
                images.append(image)
            obs, *_ = envs.step(np.asarray(policy.run(["action"], {"obs": obs})[0]))
    finally:
        envs.close()
    duration = round(1000 * EVERY * envs.control_dt)
    animation.write(path, images, duration, QUALITY)


if __name__ == "__main__":
    main()
