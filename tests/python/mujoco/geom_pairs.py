"""Models of two geoms, and poses of one around the other."""

from __future__ import annotations

import mujoco
import numpy as np
from live_model import Array, States

import tightloop as tl

PAIR_FIELDS = ("contact_count", "contact_pos", "contact_normal", "contact_distance", "qacc", "contacts_left_out")
#: Distances, places [m] and normals agree to this, accelerations to as much of the largest.
SAME = 1e-9

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


def pair_points(model: mujoco.MjModel, qpos: Array) -> tuple[list[Array], Array]:
    """Distance, place and normal of each contact of each world, in f64, and accelerations."""
    with tl.launch(tl.Scene.from_mujoco(model), worlds=len(qpos), precision="f64", fields=PAIR_FIELDS) as sim:
        frame = sim.write(joint_q=qpos[:, [0, 1, 2, 4, 5, 6, 3]])
        assert not frame.contacts_left_out.any()
        points = np.concatenate([frame.contact_distance[..., None], frame.contact_pos, frame.contact_normal], axis=-1)
        kept = zip(points, frame.contact_count, strict=True)
        return [np.array(row[:count]) for row, count in kept], np.array(frame.qacc)


def difference(model: mujoco.MjModel, data: mujoco.MjData, pose: Array, ours: Array, qacc: Array) -> str | None:
    """What of the contacts in a pose is not MuJoCo's, if anything is not."""
    mujoco.mj_resetData(model, data)
    data.qpos[:] = pose
    mujoco.mj_forward(model, data)
    theirs = np.column_stack([data.contact.dist, data.contact.pos, data.contact.frame[:, :3]])
    what = f"{pose.tolist()}: {ours}, MuJoCo {theirs}"
    if len(ours) != len(theirs):
        return what
    for point in theirs:
        # each of ours stands for one of MuJoCo's, which may have the same point twice
        off = np.abs(ours - point).max(1)
        if off.min() > SAME:
            return what
        ours = np.delete(ours, off.argmin(), axis=0)
    scale = max(np.abs(data.qacc).max(), 1.0)
    return what if np.abs(qacc - data.qacc).max() > 1e-8 * scale else None


def assert_pair_is_mujocos(model: mujoco.MjModel, qpos: Array) -> Array:
    """Compare every world; how many points they have."""
    points, qacc = pair_points(model, qpos)
    data = mujoco.MjData(model)
    for world, pose in enumerate(qpos):
        wrong = difference(model, data, pose, points[world], qacc[world])
        assert wrong is None, wrong
    return np.array([len(row) for row in points])
