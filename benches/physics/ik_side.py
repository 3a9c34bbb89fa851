"""The side of PyPI's mink in benches/physics/ik.py: a process with an environment and a MuJoCo of its own.

It reads a line of JSON for each thing to do, and answers each with one.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from typing import Any

import mink  # pyright: ignore[reportMissingImports]
import mujoco
import numpy as np

# The best of damping 0, 0.01, 0.1 and 1 and of 12, 20, 30 and 50 iterations, on 60 of the poses
DAMPING = 0.01
ITERATIONS = 20
FRAME = ("fr3_hand_tcp", "body")


class Side:
    """mink's solver on a robot."""

    def robot(self, urdf: str) -> dict[str, Any]:
        """Compile a robot; returns the ranges of its joints."""
        spec = mujoco.MjSpec.from_file(urdf)
        spec.compiler.fusestatic = False
        self.model = spec.compile()
        self.configuration = mink.Configuration(self.model)
        self.limits = [mink.ConfigurationLimit(self.model)]
        self.task = mink.FrameTask(*FRAME, position_cost=1.0, orientation_cost=1.0, lm_damping=DAMPING)
        return {"ranges": self.model.jnt_range.tolist()}

    def poses(self, joint_q: str) -> dict[str, Any]:
        """Evaluate where the hand is at the states of a file, by MuJoCo: position, then quaternion (x, y, z, w)."""
        found = []
        for q in np.load(joint_q):
            self.configuration.update(q)
            pose = self.configuration.get_transform_frame_to_world(*FRAME)
            w, x, y, z = pose.rotation().wxyz
            found.append([*pose.translation(), x, y, z, w])
        return {"poses": np.array(found).tolist()}

    def solve(
        self, poses: list[list[float]], start: list[float], restarts: int, tolerance: list[float]
    ) -> dict[str, Any]:
        """Solve each pose, restarted at random; returns solutions, seconds, iterations and restarts."""
        low, high = self.model.jnt_range.T
        random, solutions, iterations, begun_again = np.random.default_rng(1), [], 0, 0
        targets = [mink.SE3(np.array([q[6], *q[3:6], *q[:3]])) for q in poses]
        begin = time.perf_counter()
        for target in targets:
            self.task.set_target(target)
            self.configuration.update(np.array(start))
            taken, reached = self.attempt(tolerance)
            attempts, iterations = 0, iterations + taken
            while not reached and attempts < restarts:
                self.configuration.update(random.uniform(low, high))
                taken, reached = self.attempt(tolerance)
                attempts, iterations = attempts + 1, iterations + taken
            begun_again += attempts
            solutions.append(self.configuration.q.tolist())
        seconds = time.perf_counter() - begin
        return {"seconds": seconds, "solutions": solutions, "iterations": iterations, "restarts": begun_again}

    def attempt(self, tolerance: list[float]) -> tuple[int, bool]:
        """Iterate from the configuration; returns the iterations, and whether the pose is reached."""
        for taken in range(ITERATIONS + 1):
            error = self.task.compute_error(self.configuration)
            if np.linalg.norm(error[:3]) <= tolerance[0] and np.linalg.norm(error[3:]) <= tolerance[1]:
                return taken, True
            if taken < ITERATIONS:
                velocity = mink.solve_ik(self.configuration, [self.task], 1.0, "daqp", damping=1e-6, limits=self.limits)
                self.configuration.integrate_inplace(velocity, 1.0)
        return ITERATIONS, False


def main() -> None:
    """Do what the lines of stdin say, until it closes."""
    side = Side()
    names = {"mink": version("mink"), "daqp": version("daqp"), "mujoco": mujoco.__version__}
    print(json.dumps(names), flush=True)
    for line in sys.stdin:
        request = json.loads(line)
        print(json.dumps(getattr(side, request.pop("do"))(**request)), flush=True)


if __name__ == "__main__":
    main()
