"""Writes a scene as MJCF, MuJoCo's XML, from the model that the daemon would simulate.

Links stay bodies, also those that are fixed to others, and every name stays. The pairs that may touch are explicit,
since MuJoCo reads `solreffriction` of pairs only. Softness is given as stiffness and damping, MuJoCo's direct `solref`,
so that it does not depend on MuJoCo's time step.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import SceneError

Facts = Mapping[str, Any]

_COMPILER = {
    "angle": "radian",
    "autolimits": "false",
    "balanceinertia": "false",
    "boundinertia": "0",
    "boundmass": "0",
    "fusestatic": "false",
    "inertiafromgeom": "false",
}
#: Names of the joints that a planar joint becomes.
_PLANAR = ("x", "y", "angle")
#: The least range that MuJoCo takes for a drive without effort [N or N·m].
_NO_EFFORT = 1e-300
#: Torsional and rolling friction of MuJoCo's default, which count with a larger condim than ours.
_TURNING = (0.005, 0.0001, 0.0001)


def written(scene: Facts, name: str) -> str:
    """Return the XML text of a scene as `_core.compiled_scene` has it.

    Raises:
        SceneError: Part of the scene has no equal in MJCF.
    """
    if models := [robot["name"] for robot in scene["robots"] if robot["from_mujoco"]]:
        raise SceneError(
            f"to_mujoco: MuJoCo model `{models[0]}` came from MuJoCo; use the MJCF file that you read it from, "
            "or make a scene without it"
        )
    return _Writer(scene, name).text()


class _Writer:
    """The elements of a scene."""

    def __init__(self, scene: Facts, name: str) -> None:
        self.scene = scene
        self.root = Element("mujoco", model=name)
        SubElement(self.root, "compiler", _COMPILER)
        SubElement(self.root, "option", _options(scene))
        self.assets = SubElement(self.root, "asset")
        self.world = SubElement(self.root, "worldbody")
        #: Bodies by name, and joints by their first dof with the coordinates of each.
        self.bodies: dict[str, Element] = {}
        self.joints: dict[int, Element] = {}
        self.starts: dict[str, list[float]] = {}
        #: Names of the pieces of each shape.
        self.pieces: list[list[str]] = []
        self._limits = {limit["dof"]: limit for limit in scene["limits"]}
        self._frictions = {friction["dof"]: friction["loss"] for friction in scene["frictions"]}

    def text(self) -> str:
        """Return the whole as XML."""
        for shape in self.scene["shapes"]:
            self._shape(self.world, shape)
        for robot in self.scene["robots"]:
            for link in robot["links"]:
                self._link(robot, link)
        for site in self.scene["sites"]:
            self._site(site)
        self._pairs()
        self._equalities()
        controls = self._drives()
        keys = SubElement(SubElement(self.root, "keyframe"), "key", name="start")
        joints = (part.attrib["name"] for part in self.world.iter() if part.tag in ("joint", "freejoint"))
        keys.set("qpos", _words(q for name in joints for q in self.starts[name]))
        keys.set("ctrl", _words(controls))
        for empty in [part for part in self.root if part is not self.world and not (len(part) or part.attrib)]:
            self.root.remove(empty)
        ElementTree.indent(self.root)
        return ElementTree.tostring(self.root, encoding="unicode") + "\n"

    def _link(self, robot: Facts, link: Facts) -> None:
        name, joint = f"{robot['name']}/{link['name']}", link["joint"]
        parent = None if joint is None else joint["parent"]
        carrier, place = self.world, robot if joint is None else joint
        if joint is not None and parent is not None and joint["kind"] != "free":
            carrier = self.bodies[f"{robot['name']}/{parent}"]
        body = self.bodies[name] = SubElement(carrier, "body", name=name)
        if joint is not None and joint["kind"] == "free":
            start = self.scene["joint_q"][joint["coord"] :][:7]
            place = {"pos": start[:3], "quat": start[3:]}
        _put(body, place)
        if link["inertial"] is not None:
            _inertial(body, link["inertial"])
        if joint is not None and joint["kind"] != "fixed":
            self._joint(body, f"{robot['name']}/{joint['name']}", joint)
        for shape in link["shapes"]:
            self._shape(body, shape)

    def _joint(self, body: Element, name: str, joint: Facts) -> None:
        kind, dof, coord = joint["kind"], joint["dof"], joint["coord"]
        q = self.scene["joint_q"]
        if kind == "free":
            self._resists(Element("joint"), name, range(dof, dof + 6), free=True)
            SubElement(body, "freejoint", name=name)
            self.starts[name] = [*q[coord : coord + 3], *_w_first(q[coord + 3 : coord + 7])]
        elif kind == "ball":
            own = SubElement(body, "joint", name=name, type="ball")
            self._resists(own, name, range(dof, dof + 3))
            self.joints |= dict.fromkeys(range(dof, dof + 3), own)
            self.starts[name] = _w_first(q[coord : coord + 4])
        else:
            along, across = _in_plane(np.array(joint["axis"]))
            parts = [("", kind, joint["axis"])]
            if kind == "planar":
                axes = (along, across, joint["axis"])
                parts = [(f".{part}", "slide", axis) for part, axis in zip(_PLANAR, axes, strict=True)]
                parts[2] = (parts[2][0], "hinge", joint["axis"])
            for k, (part, motion, axis) in enumerate(parts):
                own = SubElement(body, "joint", name=f"{name}{part}", type=motion, axis=_words(axis))
                self._resists(own, f"{name}{part}", range(dof + k, dof + k + 1))
                self.joints[dof + k] = own
                self.starts[f"{name}{part}"] = [q[coord + k]]

    def _resists(self, own: Element, name: str, dofs: range, *, free: bool = False) -> None:
        """Armature, damping, dry friction and range."""
        facts = [self.scene["dofs"][dof] | {"friction": self._frictions.get(dof, 0.0)} for dof in dofs]
        for field, attribute in (("armature", "armature"), ("damping", "damping"), ("friction", "frictionloss")):
            values = {fact[field] for fact in facts}
            if len(values) > 1 or (free and values != {0.0}):
                has = "none for a free joint" if free else "one for all axes of a ball joint"
                raise SceneError(f"to_mujoco: joint_{field} of joint `{name}` is {_words(values)}; MJCF has {has}")
            own.set(attribute, _words(values))
        if limit := self._limits.get(dofs[0]):
            own.attrib |= {"limited": "true", "range": _words(limit["range"])}
            own.set("solreflimit", _words(limit["solref"]))
        effort = facts[0]["effort_limit"]
        if effort is not None and len(facts) == 1:
            bound = max(effort, _NO_EFFORT)
            own.attrib |= {"actuatorfrclimited": "true", "actuatorfrcrange": _words((-bound, bound))}

    def _shape(self, body: Element, shape: Facts) -> None:
        kind, size, name = shape["kind"], shape["size"], shape["name"]
        pieces = size if kind == "mesh" else [size]
        names = [name, *(f"{name}#{k}" for k in range(1, len(pieces)))]
        self.pieces.append(names)
        for piece, values in zip(names, pieces, strict=True):
            geom = SubElement(body, "geom", name=piece, type=kind, contype="0", conaffinity="0")
            _put(geom, shape)
            if kind == "mesh":
                SubElement(self.assets, "mesh", name=piece, vertex=_words(np.ravel(values)))
                geom.set("mesh", piece)
            elif kind == "hfield":
                geom.set("hfield", piece)
                geom.set("pos", _words(_field(self.assets, piece, values, shape)))
            else:
                geom.set("size", "0 0 1" if kind == "plane" else _words(values))

    def _site(self, site: Facts) -> None:
        carrier = site["body"]
        # a rigid body has one link
        body = self.world if carrier is None else self.bodies.get(carrier)
        body = self.bodies[f"{carrier}/body"] if body is None else body
        _put(SubElement(body, "site", name=site["name"]), site)

    def _pairs(self) -> None:
        contact = SubElement(self.root, "contact")
        for pair in self.scene["pairs"]:
            first, second = (self.pieces[shape][piece] for shape, piece in pair["pieces"])
            own = SubElement(contact, "pair", geom1=first, geom2=second, condim=str(pair["condim"]))
            own.set("friction", _words((pair["mu"], pair["mu"], *_TURNING)))
            for field in ("solref", "solreffriction"):
                own.set(field, _words(pair[field]))
            for field in ("margin", "gap"):
                if pair[field]:
                    own.set(field, _words((pair[field],)))

    def _equalities(self) -> None:
        equality = SubElement(self.root, "equality")
        for tie in self.scene["equalities"]:
            follower, leader = (self.joints[tie[end]].attrib["name"] for end in ("follower", "leader"))
            own = SubElement(equality, "joint", name=follower, joint1=follower, joint2=leader)
            own.set("polycoef", _words((tie["offset"], tie["multiplier"], 0.0, 0.0, 0.0)))

    def _drives(self) -> list[float]:
        """Add the actuators; returns their controls at the start."""
        actuators, controls = SubElement(self.root, "actuator"), []
        for dof, (facts, name) in enumerate(zip(self.scene["dofs"], self.scene["dof_names"], strict=True)):
            ke, kd = facts["ke"], facts["kd"]
            if dof not in self.joints or (ke == 0.0 and kd == 0.0):
                continue
            joint = self.joints[dof]
            if joint.get("type") == "ball":
                raise SceneError(
                    f"to_mujoco: dof `{name}` of a ball joint has a drive, and MJCF has none with its law; "
                    "set its joint_target_ke and joint_target_kd to 0"
                )
            drives = []
            if facts["follows_position"]:
                drives.append((name, ke, (0.0, -ke, -kd), self.scene["joint_target_q"][dof]))
            if facts["follows_velocity"]:
                damps = 0.0 if drives else -kd
                label = f"{name}.velocity" if drives else name
                drives.append((label, kd, (0.0, 0.0, damps), self.scene["joint_target_qd"][dof]))
            for label, gain, bias, control in drives:
                own = SubElement(actuators, "general", name=label, joint=joint.attrib["name"], biastype="affine")
                own.attrib |= {"gainprm": _words((gain,)), "biasprm": _words(bias)}
                controls.append(control)
        return controls


def _options(scene: Facts) -> dict[str, str]:
    return {
        "timestep": repr(scene["dt"]),
        "gravity": _words(scene["gravity"]),
        "integrator": "implicitfast",
        "solver": "Newton",
        "iterations": str(scene["iterations"]),
        "ls_iterations": str(scene["ls_iterations"]),
        "tolerance": repr(scene["tolerance"]),
        "cone": "pyramidal" if scene["pyramidal"] else "elliptic",
        "impratio": repr(scene["impratio"]),
    }


def _field(assets: Element, name: str, field: Facts, shape: Facts) -> list[float]:
    """Add the samples of a height field; returns where its lowest one has its place."""
    samples = np.reshape(field["elevations"], (field["rows"], field["columns"]))
    low, height = samples.min(), np.ptp(samples)
    own = SubElement(assets, "hfield", name=name, nrow=str(field["rows"]), ncol=str(field["columns"]))
    own.set("size", _words((*field["half"], height or 1.0, low - field["bottom"])))
    # the first row that is written is the last one along y
    own.set("elevation", _words(np.ravel(samples[::-1])))
    return (np.array(shape["pos"]) + low * _matrix(shape["quat"])[:, 2]).tolist()


def _inertial(body: Element, inertial: Facts) -> None:
    """Principal moments and axes: MuJoCo's own, of a full matrix, are exact to fewer digits."""
    moments, axes = np.linalg.eigh(np.array(inertial["inertia"]))
    axes[:, 2] *= np.sign(np.linalg.det(axes))
    # a plate's largest moment is the sum of the others, but for rounding, which MuJoCo would refuse
    moments[2] = min(moments[2], moments[0] + moments[1])
    own = SubElement(body, "inertial", pos=_words(inertial["pos"]), mass=repr(inertial["mass"]))
    own.attrib |= {"quat": _words(_quat(axes)), "diaginertia": _words(moments)}


def _put(own: Element, place: Facts) -> None:
    own.attrib |= {"pos": _words(place["pos"]), "quat": _words(_w_first(place["quat"]))}


def _words(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _w_first(quat: list[float]) -> list[float]:
    return [quat[3], *quat[:3]]


def _matrix(quat: Iterable[float]) -> NDArray[np.float64]:
    """Return the rotation of a quaternion (x, y, z, w)."""
    x, y, z, w = quat
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def _quat(m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quaternion (w, x, y, z) of a rotation: the column of 4 q qᵀ whose diagonal is largest."""
    outer = np.array(
        [
            [1 + m[0, 0] + m[1, 1] + m[2, 2], m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
            [m[2, 1] - m[1, 2], 1 + m[0, 0] - m[1, 1] - m[2, 2], m[1, 0] + m[0, 1], m[2, 0] + m[0, 2]],
            [m[0, 2] - m[2, 0], m[1, 0] + m[0, 1], 1 - m[0, 0] + m[1, 1] - m[2, 2], m[2, 1] + m[1, 2]],
            [m[1, 0] - m[0, 1], m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], 1 - m[0, 0] - m[1, 1] + m[2, 2]],
        ]
    )
    column = outer[:, np.argmax(outer.diagonal())]
    return column / np.linalg.norm(column)


def _in_plane(normal: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the slides of a planar joint: x and y, turned as z is turned to the normal the short way.

    For a normal that points down they are first turned by half a turn about x.
    """
    if normal[2] < -0.5:
        along, across = _in_plane(normal * (1, -1, -1))
        return along * (1, -1, -1), across * (1, -1, -1)
    turn = np.array([-normal[1], normal[0], 0.0, 1.0 + normal[2]])
    rotation = _matrix(turn / np.linalg.norm(turn))
    return rotation[:, 0], rotation[:, 1]
