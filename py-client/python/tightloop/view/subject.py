"""The subject of pictures: the bodies that a camera frames, and the robot that it follows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike, fspath

import numpy as np
from numpy.typing import NDArray

from tightloop import _core


@dataclass(frozen=True, eq=False)
class Subject:
    """The bodies that matter in a picture.

    The main robot is the one with the most moving bodies; floating robots that have as many count as one.

    Attributes:
        bodies: Bodies that a camera frames: robots with their bases, and free bodies. Indices into ``body_names``.
        robot: Bodies of the main robot.
        floats: Whether the root of the main robot moves freely.
    """

    bodies: NDArray[np.intp]
    robot: NDArray[np.intp]
    floats: bool


def whole(bodies: int) -> Subject:
    """Return the subject of a scene of which only the number of bodies is known: all of them, which may go anywhere."""
    every = np.arange(bodies)
    return Subject(every, every, True)


def subject(scene_toml: str, folder: str | PathLike[str], body_names: Sequence[str]) -> Subject:
    """Find the subject of a scene.

    Args:
        scene_toml: The scene, such as ``sim.info["scene"]``.
        folder: What its paths are relative to, such as ``sim.info["scene_folder"]``.
        body_names: The bodies in the order of ``body_q``, such as ``sim.body_names``.

    Raises:
        SceneError: The scene is not valid.
    """
    core = _core.Dynamics(scene_toml, fspath(folder))
    dof_names, coord_names, names = core.names
    if sorted(names) != sorted(body_names):
        return whole(len(body_names))
    neutral = np.array([float(name.endswith(".qw")) for name in coord_names])
    shape = len(names), 6, len(dof_names)
    if 0 in shape:
        return Subject(np.arange(len(names)), np.arange(len(names)), False)
    # a dof moves a body if its column of the body's Jacobian is not zero
    jacobian = core.evaluate("body_jacobian", neutral, np.empty(0)).reshape(shape)
    moves = np.abs(jacobian).max(axis=1) > 0.0
    order = [names.index(name) for name in body_names]
    return _of_trees(moves[order], dof_names, list(body_names))


def _of_trees(moves: NDArray[np.bool_], dof_names: list[str], body_names: list[str]) -> Subject:
    """Return the subject, given which dofs move which bodies, shape ``(bodies, dofs)``."""
    if not moves.any():
        every = np.arange(len(body_names))
        return Subject(every, every, False)
    moving: NDArray[np.bool_] = np.asarray(moves.any(axis=1))
    trees = [moves[:, dof] for dof, name in enumerate(dof_names) if name.endswith(".vx")]
    floating = np.array(trees).any(axis=0) if trees else np.zeros(len(body_names), bool)
    owners = np.array([name.partition("/")[0] for name in body_names])
    fixed: NDArray[np.bool_] = np.asarray(moving & ~floating)
    # bodies stand in depth-first order, so the base of a fixed robot is right before what moves on it
    bases = np.zeros_like(moving)
    bases[:-1] = ~moving[:-1] & fixed[1:] & (owners[:-1] == owners[1:])
    robots = [(tree, True) for tree in trees]
    robots += [(fixed & (owners == owner), False) for owner in dict.fromkeys(owners[fixed])]
    main, floats = max(robots, key=lambda robot: (np.count_nonzero(robot[0]), not robot[1]))
    if floats:
        # several floating robots of one size, or loose bodies, are followed together
        main = np.array([tree for tree in trees if np.count_nonzero(tree) == np.count_nonzero(main)]).any(axis=0)
    else:
        main = main | (bases & np.isin(owners, owners[main]))
    return Subject(np.flatnonzero(moving | bases), np.flatnonzero(main), floats)
