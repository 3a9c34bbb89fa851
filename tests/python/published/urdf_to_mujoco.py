"""A URDF file as MuJoCo reads it: an independent reference for how tightloop reads and moves a robot.

MuJoCo's own reader makes bodies and dofs of links and joints; nothing of tightloop's has a part in it. The XML is only
made digestible. Links get a prefix (one named `world` would vanish into MuJoCo's). Visuals and collisions go, since
contacts are not compared. Joints that MuJoCo's reader lacks (ball, planar, floating) are built by hand.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
from collision_mass import add_inertial
from mujoco_model import COMPILER, ITERATIONS, flatten_mimics, limits_in_force_space
from numpy.typing import NDArray
from random_robots import in_plane

PREFIX = "r/"
FLOATING_BASE = f"{PREFIX}floating_base"
# MuJoCo refuses moments below 1e-14 kg m², even those of frames that are fixed to a link of 1e-2
MOMENT_MIN = 2e-14


def parse(path: Path) -> ET.Element:
    """The file's XML. Blanks before its declaration, NULs behind its end, commas behind numbers are no part of it."""
    text = path.read_bytes().decode("utf-8-sig").strip("\0 \t\r\n")
    text = re.sub(r"(?<=[0-9]),(?= )", "", text)
    return ET.fromstring(re.sub(r"^<\?xml.*?\?>", "", text))


def model_of(path: Path, *, floating: bool, dt: float, package_dirs: tuple[Path, ...] = ()) -> mujoco.MjModel:
    """MuJoCo's model of a file, links prefixed, solved to the end as in the other live tests."""
    robot = parse(path)
    for link in robot.findall("link"):
        if link.find("inertial") is None and link.find("collision") is not None:
            add_inertial(link, path, package_dirs)
    by_hand = digest(robot)
    robot.insert(0, ET.fromstring(COMPILER.format(balance="true")))
    spec = mujoco.MjSpec.from_string(ET.tostring(robot, encoding="unicode"))
    for joint in by_hand:
        add_joint(spec, joint)
    if floating:
        (root,) = spec.worldbody.bodies
        root.add_freejoint(name=FLOATING_BASE)
    option = spec.option
    option.timestep = dt
    option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.iterations, option.ls_iterations, option.tolerance = ITERATIONS, ITERATIONS, 0.0
    # a start that is far outside its limits is no reason to start again
    option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    model = spec.compile()
    # MuJoCo gives what weighs nothing the centre of what it carries; ours is the origin of its frame
    model.body_ipos[model.body_mass == 0] = 0.0
    limits_in_force_space(model)
    flatten_mimics(model)
    return model


def digest(robot: ET.Element) -> list[ET.Element]:
    """Leave what MuJoCo's reader takes, and give back the joints to be built by hand."""
    for link in robot.findall("link"):
        link.set("name", PREFIX + link.get("name", ""))
        for child in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(child)
        inertia = link.find("inertial/inertia")
        if inertia is not None:
            raise_moments(inertia)
    by_hand = []
    for joint in robot.findall("joint"):
        prefix(joint)
        for again in joint.findall("axis")[1:]:
            joint.remove(again)
        if joint.get("type") in ("spherical", "planar", "floating"):
            by_hand.append(ET.fromstring(ET.tostring(joint)))
            joint.set("type", "fixed")
        if joint.get("type") == "continuous":
            # it has no range, whatever its limit says; MuJoCo would take one
            for limit in joint.findall("limit"):
                limit.attrib.pop("lower", None)
                limit.attrib.pop("upper", None)
        if joint.get("type") == "fixed":
            for child in [child for name in ("limit", "dynamics", "mimic") for child in joint.findall(name)]:
                joint.remove(child)
    return by_hand


def prefix(joint: ET.Element) -> None:
    """The robot's name before those of the joint, of what it connects and of what it follows."""
    joint.set("name", PREFIX + joint.get("name", ""))
    for child in joint:
        for attribute in {"mimic": ("joint",), "parent": ("link",), "child": ("link",)}.get(child.tag, ()):
            child.set(attribute, PREFIX + child.get(attribute, ""))


def raise_moments(inertia: ET.Element) -> None:
    """Moments of a frame of almost no mass, as small as MuJoCo takes them; a zero stays, and is refused."""
    moments = {name: float(inertia.get(name, 0)) for name in ("ixx", "iyy", "izz")}
    if 0 < max(moments.values()) < MOMENT_MIN:
        for name in moments:
            inertia.set(name, repr(MOMENT_MIN))


def add_joint(spec: mujoco.MjSpec, joint: ET.Element) -> None:
    """A ball, a free joint, or the slide, slide, hinge that make a planar one."""
    name, kind = joint.get("name", ""), joint.get("type")
    child, axis, dynamics = joint.find("child"), joint.find("axis"), joint.find("dynamics")
    assert child is not None, f"joint `{name}` has no child"
    body = spec.body(child.get("link", ""))
    if kind == "floating":
        body.add_freejoint(name=name)
        return
    if kind == "spherical":
        parts = [body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_BALL)]
    else:
        normal = np.array("1 0 0".split() if axis is None else axis.get("xyz", "").split(), dtype=float)
        normal /= np.linalg.norm(normal)
        x, y = in_plane(normal)
        slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
        shapes = (("x", x, slide), ("y", y, slide), ("angle", normal, hinge))
        parts = [body.add_joint(name=f"{name}.{part}", type=motion, axis=along) for part, along, motion in shapes]
    for part in parts:
        if dynamics is not None:
            part.damping[0], part.frictionloss = float(dynamics.get("damping", 0)), float(dynamics.get("friction", 0))


def root_bodies(model: mujoco.MjModel) -> NDArray[np.int64]:
    """The first link and all that is fixed to it, or to a base that does not move."""
    bodies = np.arange(model.nbody)
    return bodies[(bodies > 0) & (model.body_weldid == model.body_weldid[1])]
