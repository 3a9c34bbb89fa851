"""Hand-written policies for the manipulation tasks, which show that each task can be solved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tightloop.env import VectorEnv
from tightloop.tasks.lift import START

Array = NDArray[np.float64]

OPEN, CLOSED = 1.0, -1.0


class PickCube:
    """Above the cube, down, fingers closed, to the goal; begun with the observations of a reset."""

    def __init__(self, envs: VectorEnv, obs: Array) -> None:
        self._envs = envs
        self._yaw = along(obs[:, 32:36])
        self._over = np.zeros(len(obs), np.bool_)
        self._closed = np.zeros(len(obs), np.intp)  # for how many steps

    def __call__(self, obs: Array, step: int) -> Array:
        """Actions ``(worlds, 8)`` for these observations."""
        q, qd, tcp, goal, cube = obs[:, :9], obs[:, 9:16], obs[:, 19:26], obs[:, 26:29], obs[:, 29:36]
        off = np.abs(displacement(tcp, cube[:, :3], self._yaw))
        self._over |= (off[:, :2].max(1) < 0.01) & (off[:, 3:].max(1) < 0.1)
        close = self._over & ((off[:, 2] < 0.005) | (self._closed > 0))
        self._closed += close
        place = cube[:, :3] + np.where(self._over, 0.0, 0.07)[:, None] * np.array([0.0, 0.0, 1.0])
        # the cube, not the tcp, is to be at the goal
        place = np.where((self._closed > 4)[:, None], goal + tcp[:, :3] - cube[:, :3], place)
        turn = joint_turn(self._envs, np.c_[q, cube], displacement(tcp, place, self._yaw))
        return np.c_[delta(turn, qd), np.where(close, CLOSED, OPEN)]


class PushCube:
    """Fingers closed, behind the cube, down, ahead."""

    def __init__(self, envs: VectorEnv, obs: Array) -> None:
        self._envs = envs

    def __call__(self, obs: Array, step: int) -> Array:
        """Actions ``(worlds, 8)`` for these observations."""
        q, qd, tcp, goal, cube = obs[:, :9], obs[:, 9:16], obs[:, 18:25], obs[:, 25:28], obs[:, 28:35]
        if step < 18:
            place = cube[:, :3] + np.array([-0.06, 0.0, 0.08 if step < 10 else 0.0])
        else:
            # the tcp, behind the cube, stops 0.03 m inside the goal's edge
            place = np.c_[np.minimum(tcp[:, 0] + 0.03, goal[:, 0] - 0.07), cube[:, 1], cube[:, 2]]
        turn = joint_turn(self._envs, np.c_[q, cube], displacement(tcp, place, np.zeros(len(obs))))
        return np.c_[delta(turn, qd), np.full(len(obs), CLOSED)]


class Lift:
    """As `PickCube`, by targets about the start; the pose of the hand is found from the joints."""

    def __init__(self, envs: VectorEnv, obs: Array) -> None:
        self._envs, self._start = envs, np.array(START)
        self._target = self._start[:7] + np.zeros((len(obs), 1))

    def __call__(self, obs: Array, step: int) -> Array:
        """Actions ``(worlds, 8)`` for these observations."""
        q, cube, goal = obs[:, :9] + self._start, obs[:, 18:21], obs[:, 21:24]
        state = np.c_[q, cube, np.tile([0.0, 0.0, 0.0, 1.0], (len(obs), 1))]
        dynamics = self._envs.sim.dynamics
        tcp = dynamics.forward_kinematics(state)[:, dynamics.body_names.index(TCP)]
        over = np.array([0.0, 0.0, 0.08 if step < 40 else 0.0])
        place = cube + over if step < 90 else goal + tcp[:, :3] - cube
        turn = joint_turn(self._envs, state, displacement(tcp, place, np.zeros(len(obs))))
        # a fifth of the way in each step: the drives lag by a tenth of a second
        self._target += np.clip(0.2 * turn, -0.04, 0.04)
        self._target = np.clip(self._target, self._start[:7] - 1.5, self._start[:7] + 1.5)
        action = (self._target - self._start[:7]) / 0.5
        return np.c_[action, np.full(len(obs), OPEN if step < 75 else CLOSED)]


TCP = "arm/fr3_hand_tcp"


def along(quats: Array) -> Array:
    """By how much a hand turns about z to grasp a cube, at most an eighth of a turn [rad], shape ``(worlds,)``."""
    yaw = 2.0 * np.arctan2(quats[:, 2], quats[:, 3])
    return (yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4


def displacement(tcp: Array, place: Array, yaw: Array) -> Array:
    """From the tcp's pose to a place, the hand downwards and turned by ``yaw``: shape ``(worlds, 6)``.

    A shift [m], then a rotation vector [rad], in world axes.
    """
    # the quaternion of the hand that is asked for, times the inverse of what it has
    ax, ay = np.cos(yaw / 2), np.sin(yaw / 2)
    bx, by, bz, bw = tcp[:, 3:].T
    turn = np.c_[ax * bw - ay * bz, ay * bw + ax * bz, ay * bx - ax * by]
    sign = np.where(ax * bx + ay * by < 0.0, -1.0, 1.0)
    return np.c_[place - tcp[:, :3], 2.0 * sign[:, None] * turn]


def joint_turn(envs: VectorEnv, state: Array, shift: Array) -> Array:
    """Damped least squares of a displacement of the tcp over the arm's joints [rad], shape ``(worlds, 7)``.

    Args:
        envs: The environments.
        state: Their ``joint_q``, shape ``(worlds, 16)``.
        shift: As `displacement` gives it.
    """
    # observed in f32, a quaternion has length 1 only nearly
    state = np.c_[state[:, :12], state[:, 12:] / np.linalg.norm(state[:, 12:], axis=1)[:, None]]
    dynamics = envs.sim.dynamics
    jacobian = dynamics.body_jacobian(state)[:, dynamics.body_names.index(TCP), :, :7]
    # so much that a stretched arm does not whirl
    square = jacobian @ jacobian.transpose(0, 2, 1) + 1e-4 * np.eye(6)
    return np.einsum("wki,wk->wi", jacobian, np.linalg.solve(square, shift[:, :, None])[:, :, 0])


def delta(turn: Array, qd: Array) -> Array:
    """Action of ``joint_delta`` that goes some of the way, less the more the joints move already.

    Steps add up, so that the arm's weight is made up for.
    """
    return np.clip((0.6 * turn - 0.06 * qd) / 0.1, -1.0, 1.0)
