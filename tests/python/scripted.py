"""Policies by hand for the manipulation tasks: what they do shows that a task can be done."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tightloop.env import VectorEnv

Array = NDArray[np.float64]

OPEN, CLOSED = 1.0, -1.0


def pick_cube(envs: VectorEnv, obs: Array, step: int) -> Array:
    """Above the cube, down, fingers closed, to the goal."""
    q, tcp, goal, cube = obs[:, :9], obs[:, 19:26], obs[:, 26:29], obs[:, 29:36]
    if step < 26:
        place = cube[:, :3] + [0.0, 0.0, 0.06 if step < 12 else 0.0]
    else:
        # the cube, not the tcp, is to be at the goal
        place = goal + tcp[:, :3] - cube[:, :3]
    turn = displacement(tcp, place, along(cube[:, 3:]) if step < 26 else None)
    return np.c_[_delta(envs, q, cube, turn), np.full(len(obs), OPEN if step < 20 else CLOSED)]


def push_cube(envs: VectorEnv, obs: Array, step: int) -> Array:
    """Fingers closed, behind the cube, down, ahead."""
    q, tcp, goal, cube = obs[:, :9], obs[:, 18:25], obs[:, 25:28], obs[:, 28:35]
    if step < 18:
        place = cube[:, :3] + [-0.06, 0.0, 0.08 if step < 10 else 0.0]
    else:
        # the tcp stays behind the cube, 0.05 m beyond the goal's edge
        place = np.c_[np.minimum(tcp[:, 0] + 0.03, goal[:, 0] - 0.07), cube[:, 1], cube[:, 2]]
    turn = displacement(tcp, place, np.zeros(len(obs)))
    return np.c_[_delta(envs, q, cube, turn), np.full(len(obs), CLOSED)]


def along(quats: Array) -> Array:
    """By how much a hand turns about z to grasp a cube, at most an eighth of a turn [rad], shape ``(worlds,)``."""
    yaw = 2.0 * np.arctan2(quats[:, 2], quats[:, 3])
    return (yaw + np.pi / 4) % (np.pi / 2) - np.pi / 4


def displacement(tcp: Array, place: Array, yaw: Array | None) -> Array:
    """From the tcp's pose to a place, the hand downwards and turned by ``yaw``, or as it is: shape ``(worlds, 6)``.

    A shift [m], then a rotation vector [rad], in world axes.
    """
    shift = place - tcp[:, :3]
    if yaw is None:
        # level it only: what turns its z axis to -z
        x, y, z, w = tcp[:, 3:].T
        down = np.c_[2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]
        return np.c_[shift, np.cross(down, [0.0, 0.0, -1.0])]
    zero = 0.0 * yaw
    ax, ay, az, aw = np.cos(yaw / 2), np.sin(yaw / 2), zero, zero
    bx, by, bz, bw = tcp[:, 3:].T * np.array([[-1.0], [-1.0], [-1.0], [1.0]])
    x = aw * bx + ax * bw + ay * bz - az * by
    y = aw * by - ax * bz + ay * bw + az * bx
    z = aw * bz + ax * by - ay * bx + az * bw
    w = aw * bw - ax * bx - ay * by - az * bz
    return np.c_[shift, 2.0 * np.where(w < 0.0, -1.0, 1.0)[:, None] * np.c_[x, y, z]]


def joint_turn(envs: VectorEnv, q: Array, cube: Array, turn: Array) -> Array:
    """Least squares of a displacement of the tcp over the arm's joints [rad], damped, shape ``(worlds, 7)``."""
    dynamics = envs.sim.dynamics
    tcp = dynamics.body_names.index("arm/fr3_hand_tcp")
    jacobian = dynamics.body_jacobian(np.c_[q, unit(cube)])[:, tcp, :, :7]
    # 0.01 m or rad of damping: a stretched arm does not whirl
    square = jacobian @ jacobian.transpose(0, 2, 1) + 1e-4 * np.eye(6)
    return np.einsum("wki,wk->wi", jacobian, np.linalg.solve(square, turn[:, :, None])[:, :, 0])


def unit(pose: Array) -> Array:
    """The pose with its quaternion brought to length 1, which an observation in f32 has only nearly."""
    return np.c_[pose[:, :3], pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1)[:, None]]


def _delta(envs: VectorEnv, q: Array, cube: Array, turn: Array) -> Array:
    """Action of ``joint_delta`` that goes most of the way, and then on, so that the arm's weight is made up for."""
    return np.clip(0.6 * joint_turn(envs, q, cube, turn) / 0.1, -1.0, 1.0)
