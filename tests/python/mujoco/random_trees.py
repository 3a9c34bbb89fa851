"""Random robots as URDF text: trees of revolute, continuous and prismatic joints on a fixed base."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

# Quarter turns are where conversions of frames divide by zero, and axes along a frame are where they branch
QUARTER_TURNS = np.array([0.0, 0.5, -0.5, 1.0]) * np.pi
FRAME_AXES = np.vstack([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class Features:
    """What the joints of a tree have; some are left without, at random, so that both kinds stand side by side."""

    limits: bool = False
    """Narrow ranges, which the states of `states` violate now and then; otherwise nothing ever reaches them."""
    friction: bool = False
    damping: bool = False
    effort: bool = False
    mimics: int = 0
    """How many joints follow another, chains included."""
    fixed: float = 0.25
    """Share of fixed joints; half of their links have mass."""


PLAIN = Features()


class Edge(NamedTuple):
    """A joint's place in the tree."""

    name: str
    kind: str
    parent: str
    child: str


def random_urdf(seed: int, dofs: int, features: Features = PLAIN) -> str:
    """A robot of so many moving joints; branches, axes, frames and inertias are random, and so is the file's order."""
    rng = np.random.default_rng([seed, dofs])
    # names sort against the tree's order, so that code that sorts by name fails
    names = [f"l{number:03d}" for number in rng.permutation(1000)]
    root = names.pop()
    links, movers, edges = [root], [], []
    while len(movers) < dofs:
        parent, child = links[-1] if rng.random() < 0.6 else str(rng.choice(links)), names.pop()
        fixed = rng.random() < features.fixed
        kind = "fixed" if fixed else str(rng.choice(["revolute", "continuous", "prismatic"]))
        edges.append(Edge(f"j_{child}", kind, parent, child))
        links.append(child)
        if not fixed:
            movers.append(f"j_{child}")
    # leaders may stand before or behind their followers, in the tree as in the file
    ranks = [str(name) for name in rng.permutation(movers)]
    leaders = {ranks[i]: ranks[rng.integers(i)] for i in range(len(ranks) - min(features.mimics, dofs - 1), len(ranks))}
    joints = [joint(rng, edge, features, leaders.get(edge.name)) for edge in edges]
    bodies = [link(rng, name, f"j_{name}" in movers or rng.random() < 0.5) for name in links]
    parts = [bodies[i] for i in rng.permutation(len(bodies))] + [joints[i] for i in rng.permutation(len(joints))]
    return "\n".join(['<robot name="tree">', *parts, "</robot>"])


def joint(rng: Generator, edge: Edge, features: Features, leader: str | None) -> str:
    """A joint at a random frame, with what its features ask for."""
    name, kind, parent, child = edge
    text = f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{origin(rng, 0.5)}'
    if kind == "fixed":
        return f"{text}</joint>"
    axis = rng.choice(FRAME_AXES) if rng.random() < 0.4 else rng.normal(size=3)
    text += f'<axis xyz="{words(axis)}"/>'
    reach = 0.1 if kind == "prismatic" else 0.5
    narrow = features.limits and rng.random() < 0.8
    lower, upper = (-reach * rng.uniform(0.2, 1), reach * rng.uniform(0.2, 1)) if narrow else (-1e3, 1e3)
    limit = "" if kind == "continuous" else f'lower="{lower!r}" upper="{upper!r}"'
    effort = f'effort="{rng.uniform(1, 20)!r}"' if features.effort and rng.random() < 0.8 else ""
    if limit or effort:
        text += f"<limit {limit} {effort}/>"
    damping = rng.uniform(0, 2) if features.damping and rng.random() < 0.8 else 0.0
    friction = rng.uniform(0, 2) if features.friction and rng.random() < 0.8 else 0.0
    text += f'<dynamics damping="{damping!r}" friction="{friction!r}"/>'
    if leader is not None:
        ratio = rng.uniform(0.3, 3) * (1 if rng.random() < 0.5 else -1)
        text += f'<mimic joint="{leader}" multiplier="{ratio!r}" offset="{rng.uniform(-0.2, 0.2)!r}"/>'
    return f"{text}</joint>"


def link(rng: Generator, name: str, has_mass: bool) -> str:
    """A link; its inertia is that of a box, in axes of its own or turned into the link's."""
    if not has_mass:
        return f'<link name="{name}"/>'
    mass, edges = float(np.exp(rng.uniform(np.log(0.2), np.log(5.0)))), rng.uniform(0.05, 0.4, 3)
    moments = mass / 12 * (np.sum(edges**2) - edges**2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0] if rng.random() < 0.5 else np.eye(3)
    tensor = (turn * moments) @ turn.T
    upper = [("xyz"[i] + "xyz"[j], float(tensor[i, j])) for i in range(3) for j in range(i, 3)]
    entries = " ".join(f'i{axes}="{entry!r}"' for axes, entry in upper)
    inertial = f'{origin(rng, 0.2)}<mass value="{mass!r}"/><inertia {entries}/>'
    return f'<link name="{name}"><inertial>{inertial}</inertial></link>'


def origin(rng: Generator, reach: float) -> str:
    """A frame within reach [m] of its parent: upright, by quarter turns, or anyhow."""
    angles = rng.choice([np.zeros(3), rng.choice(QUARTER_TURNS, 3), rng.uniform(-np.pi, np.pi, 3)])
    return f'<origin xyz="{words(rng.uniform(-reach, reach, 3))}" rpy="{words(angles)}"/>'


def words(vector: NDArray[np.float64]) -> str:
    """Numbers as a URDF file has them, to the last bit."""
    return " ".join(repr(float(part)) for part in vector)


def states(seed: int, worlds: int, slides: NDArray[np.bool_]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions [rad or m] and velocities [rad/s or m/s], each ``(worlds, dofs)``; world 0 rests at zero."""
    rng = np.random.default_rng([seed, 1])
    q = rng.uniform(-1, 1, (worlds, len(slides))) * np.where(slides, 0.3, np.pi)
    qd = rng.uniform(-2, 2, (worlds, len(slides)))
    q[0] = qd[0] = 0.0
    return q, qd
