"""Scenes of things that touch, made once for tightloop and once for MuJoCo.

Every pair that may touch is an explicit pair of MuJoCo's, since it has `solreffriction` on pairs only. Of two surfaces
the larger friction and condim count, margins and gaps add, and solref is the mean (MuJoCo's mix of two geoms).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
from mujoco_model import ITERATIONS, Array, drive, flatten_mimics, limits_in_force_space
from numpy.random import Generator
from random_robots import Coordinates, set_effort

import tightloop as tl
from conftest import START, STIFFNESS, URDF

# Newton's shape parameters if left out
SURFACE = {"mu": 1.0, "ke": 2500.0, "kd": 100.0, "kf": 1000.0, "margin": 0.0, "gap": 0.0, "condim": 3}
D_MAX = 0.95
GEOMS = {
    "plane": mujoco.mjtGeom.mjGEOM_PLANE,
    "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
    "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE,
    "box": mujoco.mjtGeom.mjGEOM_BOX,
    "cylinder": mujoco.mjtGeom.mjGEOM_CYLINDER,
    "mesh": mujoco.mjtGeom.mjGEOM_MESH,
}


@dataclass
class ContactScene:
    """A scene and MuJoCo's, filled by the same calls."""

    dt: float = 1 / 480
    substeps: int = 1
    cone: str = "elliptic"
    impratio: float = 1000.0
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    by_pairs: bool = True
    """Whether MuJoCo gets the parameters of each pair; else it finds pairs and parameters by its geoms."""
    surfaces: dict[str, dict] = field(default_factory=dict)
    """By geom, which is named as in ``sim.shape_names``."""
    owners: dict[str, str | None] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.scene = tl.Scene(dt=self.dt, substeps=self.substeps, gravity=self.gravity)
        self.scene.solver(iterations=ITERATIONS, tolerance=0.0, cone=self.cone, impratio=self.impratio)
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        option = self.spec.option
        option.timestep, option.gravity = self.dt, self.gravity
        option.integrator, option.solver = mujoco.mjtIntegrator.mjINT_IMPLICITFAST, mujoco.mjtSolver.mjSOL_NEWTON
        option.iterations, option.ls_iterations, option.tolerance = ITERATIONS, ITERATIONS, 0.0
        option.cone = getattr(mujoco.mjtCone, f"mjCONE_{self.cone.upper()}")
        option.impratio = self.impratio
        # a body's own velocity may be anything
        option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET

    def body(self, name: str, pos: Array, quat: Array) -> None:
        """A free body at a pose, quaternion (x, y, z, w)."""
        self.scene.add_body(name=name, pos=tuple(pos), quat=tuple(quat))
        body = self.spec.worldbody.add_body(name=f"{name}/body", pos=pos, quat=np.roll(quat, 1))
        body.add_freejoint(name=f"{name}/free")

    def shape(
        self,
        kind: str,
        name: str,
        size: dict,
        *,
        pos: Array | tuple = (0.0, 0.0, 0.0),
        quat: Array | tuple = (0.0, 0.0, 0.0, 1.0),
        body: str | None = None,
        density: float = 1000.0,
        **surface: float,
    ) -> None:
        """A shape of the world, of a body or of a link (``robot/link``), which keeps its mass."""
        of_link = body is not None and "/" in body
        # a plane never moves
        bearer = {} if kind == "plane" else {"body": body}
        bearer |= {} if body is None or of_link else {"density": density}
        add = {"name": name, "pos": tuple(pos), "quat": tuple(quat), **bearer, **surface}
        if kind == "mesh":
            points, file = size["points"], size["file"]
            write_hull(points, file)
            self.scene.add_mesh(file, **add)
            self.spec.add_mesh(name=name, uservert=points.ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
        else:
            getattr(self.scene, f"add_{kind}")(**size, **add)
        shape = self.scene.shapes[name]
        owner = self.spec.worldbody if body is None else self.spec.body(body if of_link else f"{body}/body")
        geom = owner.add_geom(name=shape.full_name, type=GEOMS[kind], pos=pos, quat=np.roll(quat, 1))
        geom.contype = geom.conaffinity = 0
        geom.density = 0.0 if of_link else density
        if kind == "mesh":
            geom.meshname = name
        else:
            values = size.get("half_extents", (size.get("radius", 1.0), size.get("half_height", 1.0), 0.01))
            geom.size[:] = values
        self.surfaces[shape.full_name] = SURFACE | surface
        self.owners[shape.full_name] = body

    def robot(self, name: str, urdf: Path, pos: Array | tuple = (0.0, 0.0, 0.0), **surface: float) -> None:
        """A robot on its base; links of one robot do not touch each other. Its shapes have names of their own."""
        self.scene.add_urdf(urdf, name=name, pos=tuple(pos), **surface)
        text = urdf.read_text()
        head = text.index(">", text.index("<robot")) + 1
        compiler = '<mujoco><compiler discardvisual="true" fusestatic="false" balanceinertia="false"/></mujoco>'
        child = mujoco.MjSpec.from_string(text[:head] + compiler + text[head:])
        for link in child.bodies:
            for place, geom in enumerate(link.geoms):
                # shapes without a name have their place for one
                geom.name = f"{link.name}/{geom.name or place}"
                geom.contype = geom.conaffinity = 0
                self.surfaces[f"{name}/{geom.name}"] = SURFACE | surface
                self.owners[f"{name}/{geom.name}"] = f"{name}/{link.name}"
        frame = self.spec.worldbody.add_frame(pos=pos)
        self.spec.attach(child, prefix=f"{name}/", frame=frame)

    def compile(self) -> mujoco.MjModel:
        """MuJoCo's model, with a pair for every two shapes that may touch."""
        if not self.by_pairs:
            return self._compile_geoms()
        model = self.spec.compile()
        still = {name for name in self.surfaces if not model.body_weldid[model.geom(name).bodyid[0]]}
        for a, b in itertools.combinations(self.surfaces, 2):
            x, y = self.owners[a], self.owners[b]
            robots = {owner.split("/")[0] for owner in (x, y) if owner is not None}
            moves = a not in still or b not in still
            if moves and (len(robots) == 2 or (len(robots) == 1 and None in (x, y))):
                self.spec.add_pair(geomname1=a, geomname2=b)
        model = self.spec.compile()
        # in an order of MuJoCo's own
        for number, geoms in enumerate(zip(model.pair_geom1, model.pair_geom2, strict=True)):
            s, t = (self.surfaces[model.geom(geom).name] for geom in geoms)
            weight = model.body_invweight0[model.geom_bodyid[list(geoms)], 0].sum()
            softness = [(2 / u["kd"], u["kd"] / (2 * np.sqrt(u["ke"]))) for u in (s, t)]
            rate = (s["kf"] + t["kf"]) / 2 * weight * ((1 - D_MAX) / self.impratio + D_MAX)
            model.pair_solref[number] = np.mean(softness, axis=0)
            model.pair_solreffriction[number] = 2 / rate, 1.0
            model.pair_friction[number, :2] = max(s["mu"], t["mu"])
            model.pair_margin[number] = s["margin"] + t["margin"]
            model.pair_gap[number] = s["gap"] + t["gap"]
            model.pair_dim[number] = max(s["condim"], t["condim"])
        return model

    def _compile_geoms(self) -> mujoco.MjModel:
        for name, surface in self.surfaces.items():
            geom = self.spec.geom(name)
            geom.contype = geom.conaffinity = 1
            geom.friction[0], geom.condim = surface["mu"], surface["condim"]
            geom.solref[:] = 2 / surface["kd"], surface["kd"] / (2 * np.sqrt(surface["ke"]))
            geom.margin, geom.gap = surface["margin"], surface["gap"]
        return self.spec.compile()


class MujocoReference:
    """MuJoCo at states that the run has."""

    def __init__(self, model: mujoco.MjModel, sim: tl.Sim) -> None:
        self.model, self.data = model, mujoco.MjData(model)
        self.to = Coordinates(model, sim)
        self.names = sim.shape_names

    def at(
        self,
        q: Array,
        qd: Array,
        joint_f: Array | None = None,
        *,
        push: Array | None = None,
        control: Array | None = None,
    ) -> tuple[Array, int]:
        """MuJoCo's accelerations in our coordinates, and how many contacts it has; `data` holds the rest.

        `push` is force and torque on each of its bodies, `control` of each of its actuators.
        """
        convert, data = self.to.to_qvel(q), self.data
        mujoco.mj_resetData(self.model, data)
        data.qpos[:], data.qvel[:] = self.to.positions(q), convert @ qd
        if joint_f is not None:
            data.qfrc_applied[:] = np.linalg.solve(convert.T, joint_f)
        if push is not None:
            data.xfrc_applied[:] = push
        if control is not None:
            data.ctrl[:] = control
        mujoco.mj_forward(self.model, data)
        return np.linalg.solve(convert, data.qacc - self.to.drift(q, qd)), data.ncon

    def constraint_force(self, q: Array) -> Array:
        """MuJoCo's last constraint force in our coordinates: of a free body, force and torque at its centre of mass."""
        return self.to.to_qvel(q).T @ self.data.qfrc_constraint

    def contacts(self) -> list[tuple[tuple[int, int], float, Array]]:
        """Of MuJoCo's last state: places in shape_names (rising), distance, point."""
        out = []
        for contact in self.data.contact:
            pair = tuple(sorted(self.names.index(self.model.geom(geom).name) for geom in contact.geom))
            out.append((pair, float(contact.dist), contact.pos.copy()))
        return out


def lesson(*, driven: bool) -> tuple[ContactScene, Callable[[], mujoco.MjModel]]:
    """The lesson's arm over its table, solved as the lesson is; and what compiles MuJoCo's model of it."""
    contact_scene = ContactScene(dt=1 / 480, substeps=8)
    contact_scene.shape("box", "table", {"half_extents": (0.4, 0.4, 0.05)}, pos=(0.0, -0.5, 0.05))
    contact_scene.robot("arm", URDF, pos=(-0.5, -0.5, 0.1))
    arm = contact_scene.scene.robots["arm"]
    arm.joint_q = START
    arm.joint_target_ke, arm.joint_target_kd = STIFFNESS * driven, STIFFNESS / 10 * driven
    arm.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
    arm.joint_effort_limit = [87] * 4 + [12] * 3 + [100] * 2
    for dof, name in enumerate(arm.joint_names):
        drive(contact_scene.spec, arm, dof, f"arm/{name}")
    contact_scene.scene.solver()
    contact_scene.spec.option.iterations, contact_scene.spec.option.tolerance = 20, 1e-8

    def compiled() -> mujoco.MjModel:
        model = contact_scene.compile()
        limits_in_force_space(model)
        flatten_mimics(model)
        set_effort(model, contact_scene.scene)
        return model

    return contact_scene, compiled


def states_of(model: mujoco.MjModel, coordinates: Coordinates, steps: list[int], push: Array) -> tuple[Array, Array]:
    """What MuJoCo makes of a scene after so many steps, from velocities `push`, in our coordinates."""
    data = mujoco.MjData(model)
    data.qvel[:] = push
    q, qd = [], []
    for step in range(max(steps) + 1):
        if step in steps:
            own = ours(coordinates, data)
            q.append(own[0])
            qd.append(own[1])
        mujoco.mj_step(model, data)
    return np.array(q), np.array(qd)


def ours(to: Coordinates, data: mujoco.MjData) -> tuple[Array, Array]:
    """MuJoCo's state in our coordinates."""
    q = np.empty(to.model.nq)
    for _, at, _, coords, _, _ in to.joints:
        own = data.qpos[at : at + len(coords)].copy()
        if len(own) > 1:
            own[-4:] = np.roll(own[-4:], -1)
        q[coords] = own
    return q, np.linalg.solve(to.to_qvel(q), data.qvel)


def turn(rng: Generator) -> Array:
    """A rotation of any kind, (x, y, z, w)."""
    quat = rng.normal(size=4)
    return quat / np.linalg.norm(quat)


def write_hull(points: Array, file: Path) -> None:
    """Points [m] as an OBJ file. Its triangles close nothing, so that both sides take the convex hull."""
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
    lines += [f"f {corner} {corner + 1} {corner + 2}" for corner in range(1, len(points) - 1)]
    file.write_text("\n".join(lines) + "\n")
