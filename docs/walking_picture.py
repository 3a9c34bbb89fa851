"""The pictures of robots that walk: sixteen of them follow the same command.

    pip install --no-deps mjlab==1.6.0
    python docs/walking_picture.py [quadruped | G1] [FILE]

Runs a trained policy, draws on the CPU and writes an animated WebP; some minutes on two cores.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import animation
import numpy as np
import onnxruntime
from PIL import Image

import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.env.task import Array, Namespace, Worlds
from tightloop.tasks.humanoid import HumanoidVelocityFlat
from tightloop.tasks.quadruped import QuadrupedVelocityFlat
from tightloop.tasks.velocity import VelocityTask
from tightloop.view import Camera, Picture
from tightloop.view.parts import parts

REPOSITORY = Path(__file__).resolve().parents[1]
ASSETS, TRAINED = REPOSITORY / "docs/pages/assets", REPOSITORY / "examples/trained"
SIZE = 640, 360  # pixels
WORLDS, STEPS, EVERY = 16, 250, 4  # control steps of 20 ms, and of how many one is shown
QUALITY = 35


class Formation(VelocityTask):
    """All robots look along x, and get the same command: ahead, then a turn to the left."""

    goal_steps = 125

    def scene(self) -> tl.Scene:
        """The task's, without its draws."""
        scene = super().scene()
        if not self.robot.start_draws:
            still = tl.Uniform(0.0, 0.0)
            scene.randomize(joint_q={self.robot.name: still}, body_q={self.robot.name: {"yaw": still}})
        return scene

    def initial_state(self, xp: Namespace, worlds: Worlds, draws: Array) -> Mapping[str, Array]:
        """Starts in the middle of all draws."""
        return super().initial_state(xp, worlds, 0.0 * draws + 0.5)

    def goal(self, xp: Namespace, worlds: Worlds, draws: Array) -> Array:
        """Ahead for 2.5 s, then on while turning."""
        turn = np.where(worlds.elapsed > 0, 0.8, 0.0)
        return xp.stack([0.9 + 0.0 * turn, 0.0 * turn, turn], 1)


class Quadrupeds(Formation, QuadrupedVelocityFlat):
    """The task's own quadruped."""


class Humanoids(Formation, HumanoidVelocityFlat):
    """A robot on two legs."""


class Shot(NamedTuple):
    """A picture.

    Attributes:
        task: What walks.
        policy: File in examples/trained.
        file: File in docs/pages/assets.
        eye: Place of the camera from the middle of all robots [m].
        aim: What it looks at, likewise.
    """

    task: VelocityTask
    policy: str
    file: str
    eye: tuple[float, float, float]
    aim: tuple[float, float, float]


def shot(robot: str) -> Shot:
    """Return what the picture of a robot shows, by its name."""
    if robot == "G1":
        task, policy = Humanoids(0.0, model="unitree_g1"), "HumanoidVelocityFlat-unitree_g1.onnx"
        return Shot(task, policy, "walking_g1.webp", (1.9, -3.4, 1.7), (0.5, 0.7, 0.45))
    task, policy = Quadrupeds(0.0), "QuadrupedVelocityFlat.onnx"
    return Shot(task, policy, "walking.webp", (1.6, -2.9, 1.5), (0.6, 1.2, 0.1))


def main() -> None:
    """Draw and write."""
    parser = argparse.ArgumentParser(description="Film robots that walk.")
    parser.add_argument("robot", nargs="?", choices=("quadruped", "G1"), default="quadruped", help="which robot")
    parser.add_argument("file", nargs="?", type=Path, help="where to, instead of docs/pages/assets")
    args = parser.parse_args()
    shown = shot(args.robot)
    path = args.file or ASSETS / shown.file
    policy = onnxruntime.InferenceSession(TRAINED / shown.policy, providers=["CPUExecutionProvider"])
    envs = VectorEnv(shown.task, WORLDS, render_mode="rgb_array")
    try:
        sim = envs.sim
        picture = Picture(parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names), *SIZE)
        obs, _ = envs.reset(seed=0)
        images = []
        for step in range(STEPS):
            if step % EVERY == 0:
                x, y = (float(value) for value in envs.frame.joint_q[:, :2].mean(axis=0))
                eye, aim = ((x + off[0], y + off[1], off[2]) for off in (shown.eye, shown.aim))
                images.append(Image.fromarray(picture.render(envs.frame, camera=Camera(eye, aim, 0.7), contacts=False)))
            obs, *_ = envs.step(np.asarray(policy.run(["action"], {"obs": obs})[0]))
    finally:
        envs.close()
    duration = round(1000 * EVERY * envs.control_dt)
    animation.write(path, images, duration, QUALITY)


if __name__ == "__main__":
    main()
