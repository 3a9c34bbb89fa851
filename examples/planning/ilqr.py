"""iLQR with control limits (Tassa et al. 2012, 2014), whose step sizes and regularisations are worlds of one rollout.

The cost of a frame is Σ r² of residuals r(x) plus the effort e (u - u₀). About a trajectory, with the Jacobians A, B of
`tightloop.linearize`, J = ∂r/∂x, and the value V of the frame after it:

    Q_x = Jᵀr + Aᵀ V_x            Q_xx = JᵀJ + Aᵀ V_xx A               Gauss-Newton, so Q_xx is never indefinite
    Q_u = e² (u - u₀) + Bᵀ V_x    Q_uu = e² + Bᵀ V_xx B                Q_ux = Bᵀ V_xx A
    k = -Q̃_uu⁻¹ Q_u               K = -Q̃_uu⁻¹ Q̃_ux                    with V_xx + μ 1 instead of V_xx in Q̃

Each update first rolls out u + α k + K δx for all α and μ, from where the plant is, and then linearizes about the best
one for the next update: the real-time iteration of Diehl et al. (2005).
"""

from __future__ import annotations

import itertools

import numpy as np

import tightloop as tl
from planning.cartpole import CartPole
from planning.problem import Array

STEPS = (1.0, 0.6, 0.3, 0.1, 0.03)  # α [–]
REGULARISATIONS = (1e-6, 1e-2, 1.0)  # μ [–]
DIFFERENCE = 1e-5  # of the state, for J


class ILQR:
    """Plans by iLQR, one iteration per frame; the last plan, shifted by a frame, is the next start.

    The first plan is the cheapest of random ones. All joints must have one coordinate.

    Args:
        problem: The problem, which has residuals.
        plan: A simulation of its scene with `worlds` worlds.
        seed: Seed of the random plans.

    Attributes:
        worlds: Number of worlds that the planner's simulation needs.
        controls: Controls of the present frame, ``(controls,)``.
    """

    worlds = 64

    def __init__(self, problem: CartPole, plan: tl.Sim, seed: int) -> None:
        assert len(plan.coord_names) == len(plan.dof_names), "a joint with a quaternion has no state (q, qd)"
        self._problem, self._plan = problem, plan
        self._rest = problem.rest[list(problem.columns)]
        self.controls = self._rest
        states, count = 2 * len(plan.dof_names), len(self._rest)
        self._u = np.tile(self._rest, (problem.horizon, 1))
        self._x = np.zeros((problem.horizon + 1, states))
        self._k = np.zeros((len(REGULARISATIONS), problem.horizon, count))
        self._gain = np.zeros((len(REGULARISATIONS), problem.horizon, count, states))
        # step size and regularisation of each world; those to spare repeat the last plan
        pairs = list(itertools.product(STEPS, range(len(REGULARISATIONS))))
        self._alpha, self._which = np.zeros(plan.worlds), np.zeros(plan.worlds, np.intp)
        self._alpha[1 : len(pairs) + 1], self._which[1 : len(pairs) + 1] = np.transpose(pairs)
        knots = np.random.default_rng(seed).normal(
            0, problem.noise, (-(-problem.horizon // problem.knot), plan.worlds, count)
        )
        self._noise = np.repeat(knots, problem.knot, axis=0)[: problem.horizon]

    def update(self, state: tl.Snapshot) -> None:
        """Plan from the state at the start of the present frame; then `controls` are those of the next frame."""
        x, u, cost = self._rollouts(state)
        best = cost.argmin()
        self._x, self._u = x[:, best], u[:, best]
        self._noise[:] = 0.0
        self.controls = self._u[1]
        self._backward()
        # the next frame is the first one of the next plan; nothing is known of its last frame
        self._u, self._x = (np.append(one[1:], one[-1:], axis=0) for one in (self._u, self._x))
        self._k, self._gain = (np.append(one[:, 1:], 0 * one[:, :1], axis=1) for one in (self._k, self._gain))

    def _rollouts(self, state: tl.Snapshot) -> tuple[Array, Array, Array]:
        """Return states ``(frames + 1, worlds, states)``, controls ``(frames, worlds, controls)``, and costs."""
        problem, plan = self._problem, self._plan
        x = np.empty((problem.horizon + 1, plan.worlds, self._x.shape[1]))
        u = np.empty((problem.horizon, plan.worlds, len(self._rest)))
        cost = np.zeros(plan.worlds)
        frame = plan.copy_from(state)
        for t in range(problem.horizon):
            x[t] = np.concatenate((frame.joint_q, frame.joint_qd), axis=1)
            away = np.einsum("wij,wj->wi", self._gain[self._which, t], x[t] - self._x[t])
            u[t] = self._u[t] + self._alpha[:, None] * self._k[self._which, t] + away + self._noise[t]
            u[t] = np.clip(u[t], problem.low, problem.high) if t else self.controls
            frame = plan.step(**{problem.command: problem.full(u[t])})
            cost += problem.cost(frame) + problem.effort_cost(u[t])
            cost[frame.status != 0] = np.inf
        x[-1] = np.concatenate((frame.joint_q, frame.joint_qd), axis=1)
        return x, u, cost

    def _backward(self) -> None:
        """Compute the gains about the trajectory, for all regularisations at once."""
        problem, dofs = self._problem, self._x.shape[1] // 2
        states = {"joint_q": self._x[:-1, :dofs], "joint_qd": self._x[:-1, dofs:]}
        commands = {problem.command: problem.full(self._u)}
        found = tl.linearize(self._plan, 0, controls=problem.command, states=states, commands=commands)
        r, j = self._residuals()
        l_x, l_xx = np.einsum("tij,ti->tj", j, r), np.einsum("tij,tik->tjk", j, j)
        v_x, v_xx = l_x[-1][:, None], l_xx[-1]
        e = problem.effort**2 * np.eye(len(self._rest))
        mu = np.reshape(REGULARISATIONS, (-1, 1, 1)) * np.eye(len(l_xx[0]))
        for t in reversed(range(problem.horizon)):
            a, b, u = found.A[t], found.B[t][:, problem.columns], self._u[t]
            q_u = e @ (u - self._rest)[:, None] + b.T @ v_x
            q_uu, q_ux = e + b.T @ v_xx @ b, b.T @ v_xx @ a
            softer = v_xx + mu
            k, gain = limited(
                q_u, e + b.T @ softer @ b, b.T @ softer @ a, (problem.low - u)[:, None], (problem.high - u)[:, None]
            )
            self._k[:, t], self._gain[:, t] = k[..., 0], gain
            # the value before the frame, of the gains that were found (Tassa et al. 2012, equation 11)
            back, cross = gain.swapaxes(-1, -2), q_ux.swapaxes(-1, -2)
            v_x = a.T @ v_x + back @ (q_uu @ k + q_u) + cross @ k
            v_xx = a.T @ v_xx @ a + back @ q_uu @ gain + back @ q_ux + cross @ gain
            if t:
                v_x, v_xx = v_x + l_x[t - 1][:, None], v_xx + l_xx[t - 1]
            v_xx = 0.5 * (v_xx + v_xx.swapaxes(-1, -2))

    def _residuals(self) -> tuple[Array, Array]:
        """Return residuals after each frame, ``(frames, residuals)``, and their Jacobians by the state."""
        dofs = self._x.shape[1] // 2

        def of(x: Array) -> Array:
            return self._problem.residuals(x[..., :dofs], x[..., dofs:])

        here = self._x[1:]
        by = DIFFERENCE * np.eye(2 * dofs)[:, None]
        return of(here), np.moveaxis((of(here + by) - of(here - by)) / (2 * DIFFERENCE), 0, -1)


def limited(q_u: Array, q_uu: Array, q_ux: Array, low: Array, high: Array) -> tuple[Array, Array]:
    """Minimize ½ kᵀ Q_uu k + kᵀ Q_u within limits: what leaves them is fixed there, and the rest solved again.

    For one control, this is the minimum. For several, it is the active-set method without releases.

    Args:
        q_u: ``(…, n, 1)``.
        q_uu: Positive definite, ``(…, n, n)``.
        q_ux: ``(…, n, states)``.
        low: Lower limits of k, ``(n, 1)``.
        high: Upper limits.

    Returns:
        k ``(…, n, 1)`` and K ``(…, n, states)``, which is zero for controls at a limit.
    """
    count = q_uu.shape[-1]
    fixed = np.zeros(np.broadcast_shapes(q_u.shape, (*q_uu.shape[:-1], 1)), bool)
    k = np.zeros(fixed.shape)
    solved = np.zeros((*fixed.shape[:-1], 0))
    for _ in range(count + 1):
        free = ~fixed
        matrix = np.where(free & free.swapaxes(-1, -2), q_uu, np.eye(count))
        held = np.where(fixed, k, 0.0)
        right = np.concatenate((np.where(free, q_u + q_uu @ held, -held), np.where(free, q_ux, 0.0)), axis=-1)
        solved = -np.linalg.solve(matrix, right)
        k = np.clip(solved[..., :1], low, high)
        leaving = free & (k != solved[..., :1])
        if not leaving.any():
            break
        fixed |= leaving
    return k, np.where(fixed, 0.0, solved[..., 1:])
