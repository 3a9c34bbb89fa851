"""Random robots as URDF text: trees of revolute, continuous and prismatic joints on a fixed base."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

# Quarter turns are where conversions of frames divide by zero, and axes along a frame are where they branch
QUARTER_TURNS = np.array([0.0, 0.5, -0.5, 1.0]) * np.pi
FRAME_AXES = np.vstack([np.eye(3), -np.eye(3)])


@dataclass(frozen=True)
class Features:
    """What the joints of a tree have. Each is left out for some joints at random, so that both kinds stand side by side.

    ``limits``: ranges that the states of `states` violate now and then; else nothing ever reaches them.
    ``mimics``: how many joints follow another, chains included.
    """

    limits: bool = False
    friction: bool = False
    damping: bool = False
    effort: bool = False
    mimics: int = 0
    fixed_links: bool = True


def random_urdf(seed: int, dofs: int, features: Features = Features()) -> str:  # noqa: B008  (frozen)
    """A robot of so many moving joints; branches, axes, frames and inertias are random, and so is the file's order."""
    rng = np.random.default_rng([seed, dofs])
    # names sort against the tree's order, so that whoever sorts by name is found out
    names = [f"l{number:03d}" for number in rng.permutation(1000)[: 3 * dofs + 2]]
    links, joints = [names.pop()], []
    movers: list[str] = []
    moving = 0
    while moving < dofs:
        parent = links[-1] if rng.random() < 0.6 else str(rng.choice(links))
        child = names.pop()
        links.append(child)
        if features.fixed_links and rng.random() < 0.25 and names[2 * (dofs - moving) :]:
            joints.append(joint(rng, f"j_{child}", "fixed", parent, child))
            continue
        kind = str(rng.choice(["revolute", "continuous", "prismatic"]))
        mimic = str(rng.choice(movers)) if movers and len(movers) > dofs - 1 - features.mimics else None
        joints.append(joint(rng, f"j_{child}", kind, parent, child, features, mimic))
        movers.append(f"j_{child}")
        moving += 1
    carried = {child for child in links[1:] if f"j_{child}" not in movers}
    # a moving link has mass; a fixed one may, and the root may
    bodies = [link(rng, name, rng.random() < 0.5 if name in carried or name == links[0] else True) for name in links]
    parts = [bodies[i] for i in rng.permutation(len(bodies))] + [joints[i] for i in rng.permutation(len(joints))]
    return "\n".join(chain(['<robot name="tree">'], parts, ["</robot>"]))


def joint(  # noqa: PLR0917  (one line of a file, in its order)
    rng: Generator,
    name: str,
    kind: str,
    parent: str,
    child: str,
    features: Features = Features(),  # noqa: B008  (frozen)
    mimic: str | None = None,
) -> str:
    """A joint at a random frame, with what its features ask for."""
    lines = [f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{origin(rng, 0.5)}']
    if kind != "fixed":
        axis = rng.choice(FRAME_AXES) if rng.random() < 0.4 else rng.normal(size=3)
        lines.append(f'<axis xyz="{words(axis)}"/>')
        reach = 0.1 if kind == "prismatic" else 0.5
        narrow = features.limits and rng.random() < 0.8
        lower, upper = (-rng.uniform(0.2, 1) * reach, rng.uniform(0.2, 1) * reach) if narrow else (-100.0, 100.0)
        limit = "" if kind == "continuous" else f'lower="{lower!r}" upper="{upper!r}"'
        effort = f'effort="{rng.uniform(1, 20)!r}"' if features.effort and rng.random() < 0.8 else ""
        if limit or effort:
            lines.append(f"<limit {limit} {effort}/>")
        damping = rng.uniform(0, 2) if features.damping and rng.random() < 0.8 else 0.0
        friction = rng.uniform(0, 2) if features.friction and rng.random() < 0.8 else 0.0
        if damping or friction:
            lines.append(f'<dynamics damping="{damping!r}" friction="{friction!r}"/>')
        if mimic is not None:
            ratio, offset = rng.choice([-1, 1]) * rng.uniform(0.3, 3), rng.uniform(-0.2, 0.2)
            lines.append(f'<mimic joint="{mimic}" multiplier="{ratio!r}" offset="{offset!r}"/>')
    return "".join([*lines, "</joint>"])


def link(rng: Generator, name: str, has_mass: bool) -> str:
    """A link; its inertia is that of a box, in axes of its own or turned into the link's."""
    if not has_mass:
        return f'<link name="{name}"/>'
    mass, edges = np.exp(rng.uniform(np.log(0.2), np.log(5.0))), rng.uniform(0.05, 0.4, 3)
    moments = mass / 12 * (np.sum(edges**2) - edges**2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0] if rng.random() < 0.5 else np.eye(3)
    tensor = (turn * moments) @ turn.T
    entries = (
        "".join(f'i{a}{b}="{tensor[i, j]!r}" ' for i, a in enumerate("xyz") for j, b in enumerate("xyz") if i <= j)
        .replace("np.float64(", "")
        .replace(")", "")
    )
    inertial = f'{origin(rng, 0.2)}<mass value="{float(mass)!r}"/><inertia {entries}/>'
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
