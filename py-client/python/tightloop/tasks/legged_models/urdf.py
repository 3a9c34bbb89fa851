"""Legged robots from URDF."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import cast
from xml.etree import ElementTree

import numpy as np

import tightloop as tl
from tightloop.errors import TightloopWarning
from tightloop.tasks.legged_models.skeleton import Array, Hinge, Source

#: Name of the robot in its scenes.
NAME = "robot"


def source(path: Path) -> Source:
    """Read a robot.

    Raises:
        UrdfError: The file is not URDF, or describes a robot that cannot be simulated.
    """
    scene = tl.Scene()
    with warnings.catch_warnings():
        # the scene of the task warns again
        warnings.simplefilter("ignore", TightloopWarning)
        robot = scene.add_urdf(path, name=NAME, floating=True)
    dofs = robot.dof_names
    ranges, efforts, leaders = robot.joint_range, robot.joint_effort_limit, robot.joint_leaders
    armatures = robot.joint_armature
    hinges = []
    for joint, kind in robot.joint_types.items():
        if kind in ("revolute", "continuous") and joint not in leaders:
            dof = dofs.index(joint)
            low, high = ranges[dof]
            hinges.append(Hinge(joint, float(low), float(high), float(efforts[dof]), float(armatures[dof])))
    return Source(str(path), scene, NAME, hinges, _masses(path))


def _masses(path: Path) -> dict[str, tuple[float, Array]]:
    """Mass and centre of mass of each link."""
    found = {}
    for link in _robot(path.read_bytes()).iter("link"):
        mass, origin = link.find("inertial/mass"), link.find("inertial/origin")
        place = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
        if mass is not None:
            found[link.get("name", "")] = float(mass.get("value", "0")), np.array([float(x) for x in place.split()])
    return found


def _robot(data: bytes) -> ElementTree.Element:
    """The first element of a file that the scene's reader accepts."""
    parser = ElementTree.XMLPullParser(["start", "end"])
    parser.feed(data)
    depth, root = 0, None
    # what follows the robot may be no XML, but its error comes after these events
    for event, element in cast("Iterator[tuple[str, ElementTree.Element]]", parser.read_events()):
        root = element if root is None else root
        depth += 1 if event == "start" else -1
        if depth == 0:
            return root
    raise AssertionError("the scene's reader takes no robot without an end")
