"""Models of two geoms, and poses of one around the other."""

from __future__ import annotations

import mujoco
import numpy as np
from live_model import Array, States

# Quaternions (w, x, y, z) whose axes are those of the still geom
UPRIGHT = [
    [1.0, 0, 0, 0],
    [0, 1, 0, 0],
    [0.5**0.5, 0.5**0.5, 0, 0],
    [0.5**0.5, 0, 0.5**0.5, 0],
    [0.5**0.5, 0, -(0.5**0.5), 0],
]


def pair_model(free: tuple[str, tuple[float, ...]], still: tuple[str, tuple[float, ...]], margin: float) -> str:
    """The first geom on a free body, the second of the world."""

    def geom(kind: str, size: tuple[float, ...], more: str) -> str:
        return f'<geom type="{kind}" size="{" ".join(map(str, size))}" {more}/>'

    ground, moving = geom(*still, f'margin="{margin}"'), geom(*free, 'mass="1"')
    body = f"<body><freejoint/>{moving}</body>"
    return f'<mujoco><option gravity="0 0 0"/><worldbody>{ground}{body}</worldbody></mujoco>'


def reach(kind: str, size: tuple[float, ...]) -> Array:
    """Half extents of what a geom can touch, at most."""
    if kind == "plane":
        return np.zeros(3)
    return np.array(size) if kind == "box" else np.full(3, max(size) if kind == "ellipsoid" else sum(size))


def random_poses(rng: np.random.Generator, free: tuple, still: tuple, count: int) -> Array:
    """Poses of any kind; a quarter has the axes of the still geom, a quarter nearly so. ``(count, 7)``"""
    quats = rng.normal(size=(count, 4))
    quarter = count // 4
    straight = np.array(UPRIGHT)[rng.integers(len(UPRIGHT), size=2 * quarter)]
    quats[: 2 * quarter] = straight
    quats[:quarter] += rng.normal(size=(quarter, 4)) * 10 ** rng.uniform(-6, -1, (quarter, 1))
    quats /= np.linalg.norm(quats, axis=1)[:, None]
    box = reach(*still) + rng.uniform(0, 1, (count, 1)) * reach(*free)
    return np.hstack([rng.uniform(-1, 1, (count, 3)) * box, quats])


def at_rest(model: mujoco.MjModel, qpos: Array) -> States:
    """States without velocities."""
    none = np.zeros((len(qpos), 0))
    return States(qpos, np.zeros((len(qpos), model.nv)), none, none, none, none, none)
