"""QuadrupedVelocityFlat on PyPI's mjbatch, for benches/env/quadruped_task.py: a process with an environment of its own.

The same robot, rates, observation, reward terms and ends, in NumPy over all worlds at once. It reads a line of JSON for
each thing to do, and answers each with one.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from typing import Any

import mujoco
import numpy as np
from mjbatch import Batch  # pyright: ignore[reportMissingImports]
from numpy.typing import NDArray

Array = NDArray[Any]
STANDING, HEIGHT = np.tile([0.0, 0.8, -1.6], 4), 0.32
SUBSTEPS, CONTROL_DT, EPISODE, GOAL_STEPS = 4, 0.02, 1000, 250
GAIT, SWING, RADIUS, GROUPS = 2.5, 0.07, 0.02, [0, 1, 1, 0]
WEIGHTS = CONTROL_DT * np.array([1.5, -1.0, 0.75, -1.0, -0.05, -2.5, -2e-4, -0.01, 1.0, -0.1, -50.0])


class Side:
    """The environment."""

    def start(self, xml: str, robot: str, actions: str, worlds: int) -> dict[str, Any]:
        """Make worlds of a model, and reset them."""
        model = mujoco.MjModel.from_xml_path(xml)
        self.actions, self.count = np.load(actions), 0
        self.limits = model.jnt_range[1:].T
        # heights of feet are those one physics step before, as mj_step leaves them
        self.batch = Batch(model, worlds, num_threads=1)
        names = ("qpos", "qvel", "ctrl", "xpos", "qfrc_actuator")
        self.qpos, self.qvel, self.ctrl, self.places, self.torque = (self.batch.bind(name) for name in names)
        self.feet = [model.body(f"{robot}/{leg}_foot").id for leg in ("FL", "FR", "RL", "RR")]
        self.rng = np.random.default_rng(0)
        self.last, self.phase, self.age = np.zeros((worlds, 12)), np.zeros(worlds), np.zeros(worlds, int)
        self.command = np.zeros((worlds, 3))
        self._begin(np.ones(worlds, bool))
        return {}

    def _begin(self, mask: Array) -> None:
        """Start episodes."""
        count = int(mask.sum())
        self.batch.reset(np.flatnonzero(mask))
        yaw = self.rng.uniform(-np.pi, np.pi, count)
        self.qpos[mask, :3] = 0.0, 0.0, HEIGHT
        self.qpos[mask, 3], self.qpos[mask, 6] = np.cos(0.5 * yaw), np.sin(0.5 * yaw)
        self.qpos[mask, 7:] = STANDING + self.rng.uniform(-0.1, 0.1, (count, 12))
        self.last[mask], self.phase[mask], self.age[mask] = 0.0, 0.0, 0
        self._order(mask)

    def _order(self, mask: Array) -> None:
        """Draw commands."""
        draws = self.rng.uniform(-1.0, 1.0, (int(mask.sum()), 3)) * [1.0, 0.6, 1.0]
        self.command[mask] = draws * (self.rng.uniform(size=(len(draws), 1)) >= 0.1)

    def step(self, action: Array) -> tuple[Array, Array, Array, Array]:
        """Return observations, rewards, and which episodes terminated and were cut off."""
        action = np.clip(action, -4.0, 4.0)
        self.ctrl[:] = np.clip(STANDING + 0.3 * action, *self.limits)
        self.batch.step(nstep=SUBSTEPS)
        self.age += 1
        w, x, y, z = self.qpos[:, 3:7].T
        axes = np.stack(
            [
                np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], 1),
                np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], 1),
                np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], 1),
            ],
            1,
        )
        velocity = np.einsum("nij,nj->ni", axes, self.qvel[:, :3])
        turning = self.qvel[:, 3:6]  # a free joint's is in the body's axes
        gravity = -axes[:, :, 2]
        self.phase = (self.phase + 2.0 * np.pi * GAIT * CONTROL_DT) * self.command.any(axis=1)
        swing = np.sin(self.phase)
        lift = SWING * np.maximum(np.stack([swing, -swing], 1), 0.0)[:, GROUPS]
        feet = self.places[:, self.feet, 2] - RADIUS - lift
        turned, torque = self.qpos[:, 7:] - STANDING, self.torque[:, 6:]
        off, turn = self.command[:, :2] - velocity[:, :2], self.command[:, 2] - turning[:, 2]
        fell = (gravity[:, 2] > -0.5) | (self.qpos[:, 2] < 0.15)
        terms = [
            np.exp(-4.0 * np.einsum("ni,ni->n", off, off)),
            np.sqrt(np.einsum("ni,ni->n", off, off)),
            np.exp(-4.0 * turn * turn),
            velocity[:, 2] ** 2,
            np.einsum("ni,ni->n", turning[:, :2], turning[:, :2]),
            np.einsum("ni,ni->n", gravity[:, :2], gravity[:, :2]),
            np.einsum("ni,ni->n", torque, torque),
            np.einsum("ni,ni->n", action - self.last, action - self.last),
            np.exp(-200.0 * np.einsum("ni,ni->n", feet, feet)),
            np.einsum("ni,ni->n", turned, turned),
            fell,
        ]
        reward = WEIGHTS @ np.stack(terms)
        self.last = action
        cut = self.age >= EPISODE
        done = fell | cut
        if done.any():
            self._begin(done)
        due = (self.age > 0) & (self.age % GOAL_STEPS == 0)
        if due.any():
            self._order(due)
        clock = np.stack([np.sin(self.phase), np.cos(self.phase)], 1)
        parts = [velocity, turning, gravity, self.command, turned, self.qvel[:, 6:], self.last, clock]
        return np.concatenate(parts, 1, dtype=np.float32), reward, fell, cut

    def turn(self, seconds: float) -> dict[str, Any]:
        """Step for that long; returns environment steps per second, and per second of processor time."""
        steps, before, begin = 0, time.process_time(), time.perf_counter()
        while (passed := time.perf_counter() - begin) < seconds:
            self.step(self.actions[self.count % len(self.actions)])
            self.count += 1
            steps += len(self.ctrl)
        return {"rates": [steps / passed, steps / (time.process_time() - before)]}


def main() -> None:
    """Do what the lines of stdin say, until it closes."""
    side = Side()
    print(json.dumps({"mjbatch": version("mjbatch"), "mujoco": mujoco.__version__}), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(getattr(side, request.pop("do"))(**request)), flush=True)


if __name__ == "__main__":
    main()
