"""Predictive sampling (Howell et al. 2022): roll out the last plan with noise, and take the cheapest plan."""

from __future__ import annotations

import numpy as np

import tightloop as tl
from planning.problem import Array, Problem


class Sampling:
    """Plans by samples, each a world of one rollout.

    Two more plans compete: the last one, and one half-way from it to the rest.

    A plan begins with the command that acts while the planner works. Its second command is the next one of the plant.

    Args:
        problem: The problem.
        plan: A simulation of its scene.
        seed: Seed of the noise.

    Attributes:
        controls: Controls of the present frame, ``(controls,)``.
    """

    def __init__(self, problem: Problem, plan: tl.Sim, seed: int) -> None:
        self._problem, self._plan, self._random = problem, plan, np.random.default_rng(seed)
        self._rest = self.controls = problem.rest[list(problem.columns)]
        # small noise refines a plan, large noise finds another one; world 0 has none, so the last plan competes, too
        self._scales = np.append(0.0, np.geomspace(0.1, 1.0, plan.worlds - 1))
        self._best = np.tile(self.controls, (problem.horizon, 1))
        # weights of the knots in each frame: straight lines between them
        knots = np.arange(0, problem.horizon + problem.knot, problem.knot)
        frames = np.arange(problem.horizon)
        self._lines = np.stack([np.interp(frames, knots, one) for one in np.eye(len(knots))], axis=1)
        self._out: tl.Rollout | None = None

    def update(self, state: tl.Snapshot) -> None:
        """Plan from the state at the start of the present frame; then `controls` are those of the next frame."""
        problem, plan = self._problem, self._plan
        noise = self._random.normal(0, problem.noise, (self._lines.shape[1], plan.worlds, len(self.controls)))
        sampled = self._best[:, None] + np.tensordot(self._lines, self._scales[:, None] * noise, 1)
        sampled[:, 1] = 0.5 * (self._best + self._rest)
        sampled = np.clip(sampled, problem.low, problem.high)
        sampled[0] = self.controls
        commands = {problem.command: problem.full(sampled)}
        self._out = plan.rollout(commands, start=state, cost=problem.cost, out=self._out)
        assert self._out.cost is not None
        best: Array = sampled[:, (self._out.cost + problem.effort_cost(sampled).sum(axis=0)).argmin()]
        self._best = np.append(best[1:], best[-1:], axis=0)
        self.controls = self._best[0]
