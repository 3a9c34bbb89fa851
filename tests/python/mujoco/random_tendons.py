"""Random spatial tendons, with what they bend around, and muscles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

#: Writes so many random numbers between two bounds.
Numbers = Callable[..., str]


def shape(rng: np.random.Generator, numbers: Numbers, name: str) -> str:
    """A sphere or cylinder around which tendons bend, and a side site outside of it."""
    kind = rng.choice(["sphere", "cylinder"])
    radius = rng.uniform(0.05, 0.25)
    size = f"{radius:.17g}" if kind == "sphere" else f"{radius:.17g} 0.1"
    pos = rng.uniform(-0.3, 0.3, 3)
    side = pos + rng.choice([1.1, 2.0]) * radius * _unit(rng)
    return (
        f'<geom name="w{name}" type="{kind}" size="{size}" pos="{" ".join(f"{x:.17g}" for x in pos)}" '
        f'quat="{numbers(4)}" mass="0" contype="0" conaffinity="0"/>'
        f'<site name="q{name}" pos="{" ".join(f"{x:.17g}" for x in side)}"/>'
    )


def path(rng: np.random.Generator, places: int) -> str:
    """Sites of a path, from ``s0`` on, shapes between some of them, and a second branch behind a pulley."""
    text = ""
    for branch in range(rng.integers(1, 3)):
        if branch:
            text += f'<pulley divisor="{rng.choice([2.0, 3.0])}"/>'
        before = -1
        for k in range(rng.integers(2, 5)):
            if k and rng.random() < 0.7:
                around = rng.integers(places)
                side = f'sidesite="q{around}"' if rng.random() < 0.7 else ""
                text += f'<geom geom="w{around}" {side}/>'
            # no site twice in a row, which MuJoCo refuses
            before = int(rng.choice([place for place in range(places) if place != before]))
            text += f'<site site="s{before}"/>'
    return text


def muscle(rng: np.random.Generator, target: str, bounds: str) -> str:
    """A muscle on a target, of a strength of its own or by its scale."""
    low, high = np.sort(rng.uniform(-1.5, 1.5, 2))
    force = f'force="{rng.uniform(1, 10):.17g}"' if rng.random() < 0.7 else f'scale="{rng.uniform(5, 20):.17g}"'
    smooth = f'tausmooth="{rng.uniform(0.05, 0.5):.17g}"' if rng.random() < 0.5 else ""
    times = f'timeconst="{rng.uniform(0.005, 0.05):.17g} {rng.uniform(0.02, 0.1):.17g}" {smooth}'
    curves = f'range="{rng.uniform(0.5, 0.9):.17g} {rng.uniform(1.0, 1.4):.17g}" vmax="{rng.uniform(0.5, 3):.17g}"'
    curves += f' lmin="{rng.uniform(0.2, 0.6):.17g}" lmax="{rng.uniform(1.3, 2):.17g}"'
    curves += f' fpmax="{rng.uniform(0.5, 2):.17g}" fvmax="{rng.uniform(1.1, 1.6):.17g}"'
    return f'<muscle {target} lengthrange="{low:.17g} {high:.17g}" {force} {times} {curves}{bounds}/>'


def _unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(0, 1, 3)
    return vector / np.linalg.norm(vector)
