"""Random robots of every kind of joint, as URDF and as MuJoCo sees them.

MuJoCo's free joint has the velocity of its frame's origin and the angular velocity in its own axes, ours those of its
centre of mass (links fixed to it included) in world axes: `Coordinates` converts. MuJoCo's URDF reader knows no ball,
plane or free child: these are made by hand, a plane as slide, slide, hinge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import mujoco
import numpy as np
from mujoco_model import COMPILER, ITERATIONS, Array, drive, flatten_mimics, limits_in_force_space
from numpy.random import Generator
from random_trees import link, origin, words

import tightloop as tl

SCALARS = ("revolute", "continuous", "prismatic")
KINDS = (*SCALARS, "spherical", "planar")
DOFS = {"spherical": 3, "planar": 3}
FREE, BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)


class Joint(NamedTuple):
    """What MuJoCo's reader does not read of a joint."""

    kind: str
    axis: Array
    friction: float
    damping: float


@dataclass
class Tree:
    """A robot as URDF text; `loose` is the part below a floating joint of its own."""

    root: str
    parts: list[str] = field(default_factory=list)
    joints: dict[str, Joint] = field(default_factory=dict)
    """By child link."""
    loose: Tree | None = None

    def text(self, *, whole: bool = True) -> str:
        """The file; without its loose part if not whole."""
        parts = list(self.parts)
        if whole and self.loose is not None:
            child = f'<parent link="{self.root}"/><child link="{self.loose.root}"/>'
            parts += [f'<joint name="j_{self.loose.root}" type="floating">{child}</joint>', *self.loose.parts]
        return "\n".join(['<robot name="tree">', *parts, "</robot>"])


def random_tree(
    rng: Generator, dofs: int, *, kinds: tuple[str, ...] = KINDS, rich: bool = False, width: int = 3, name: str = "l"
) -> Tree:
    """A robot of so many dofs, its base not counted; a rich one has limits, frictions, dampings and mimics.

    Each link hangs on one of the `width` before it.
    """
    tree = Tree(f"{name}0")
    tree.parts.append(link(rng, tree.root, True))
    links, scalars = [tree.root], []
    while dofs:
        parent, child = str(rng.choice(links[-width:])), f"{name}{len(links)}"
        fitting = [kind for kind in kinds if DOFS.get(kind, 1) <= dofs]
        kind = "fixed" if rng.random() < 0.1 else str(rng.choice(fitting))
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        dofs -= 0 if kind == "fixed" else DOFS.get(kind, 1)
        tree.parts.append(link(rng, child, kind != "fixed" or rng.random() < 0.5))
        text = (
            f'<joint name="j_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{origin(rng, 0.3)}'
        )
        if kind != "fixed":
            text += f'<axis xyz="{words(axis)}"/>'
            friction, damping = rng.uniform(0, 1, 2) * (rng.random(2) < 0.5) if rich else (0.0, 0.0)
            text += f'<dynamics friction="{float(friction)!r}" damping="{float(damping)!r}"/>'
            tree.joints[child] = Joint(kind, axis, friction, damping)
        if kind in SCALARS:
            narrow = rich and rng.random() < 0.6
            low, high = rng.uniform([-0.3, 0.05], [-0.05, 0.3]).tolist() if narrow else (-1e3, 1e3)
            text += "" if kind == "continuous" else f'<limit lower="{low!r}" upper="{high!r}"/>'
            if rich and scalars and rng.random() < 0.15:
                ratio = rng.uniform(0.3, 2)
                text += (
                    f'<mimic joint="{rng.choice(scalars)}" multiplier="{ratio!r}" offset="{rng.uniform(-0.1, 0.1)!r}"/>'
                )
            scalars.append(f"j_{child}")
        tree.parts.append(f"{text}</joint>")
        links.append(child)
    return tree


def in_plane(normal: Array) -> tuple[Array, Array]:
    """The axes along which a planar joint slides: x and y, turned as z is turned to the normal the short way.

    For a normal that points down they are first turned by half a turn about x.
    """
    x, y, z = normal
    if z < -0.5:
        along, across = in_plane(np.array([x, -y, -z]))
        return along * [1, -1, -1], across * [1, -1, -1]
    turn = np.array([-y, x, 0.0, 1.0 + z])
    rotation = matrix(turn / np.linalg.norm(turn))
    return rotation[:, 0], rotation[:, 1]


def mujoco_model_of(
    scene: tl.Scene, trees: dict[str, Tree], add: Callable[[mujoco.MjSpec], None] = lambda spec: None
) -> mujoco.MjModel:
    """MuJoCo's model of a scene of these robots, with its drives, limits and poses, and what `add` gives it."""
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    option = spec.option
    option.timestep, option.integrator = scene.dt, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    option.gravity = scene.gravity
    option.tolerance, option.iterations, option.ls_iterations = 0.0, ITERATIONS, ITERATIONS
    # A start that is far outside its limits is no reason to start again
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for name, tree in trees.items():
        robot = scene.robots[name]
        x, y, z, w = robot.quat
        frame = spec.worldbody.add_frame(pos=robot.pos, quat=(w, x, y, z))
        spec.attach(spec_of(tree, "floating_base" if robot.floating else None), prefix=f"{name}/", frame=frame)
        if tree.loose is not None:
            loose = spec_of(tree.loose, f"j_{tree.loose.root}")
            spec.attach(loose, prefix=f"{name}/", frame=spec.worldbody.add_frame())
        for dof, joint in enumerate(robot.dof_names):
            mujoco_joint = spec.joint(f"{name}/{joint.rsplit('.w', 1)[0].rsplit('.v', 1)[0]}")
            if mujoco_joint.type in (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE):
                drive(spec, robot, dof, mujoco_joint.name)
            elif mujoco_joint.type == mujoco.mjtJoint.mjJNT_BALL:
                mujoco_joint.armature = robot.joint_armature[dof]
    add(spec)
    model = spec.compile()
    # MuJoCo gives what weighs nothing the centre of what it carries; ours is the origin of its frame
    model.body_ipos[model.body_mass == 0] = 0.0
    limits_in_force_space(model)
    flatten_mimics(model)
    set_effort(model, scene)
    return model


def spec_of(tree: Tree, free: str | None) -> mujoco.MjSpec:
    """MuJoCo's reading of a robot, with the joints that it does not know; `free` names the joint of a free root."""
    text = tree.text(whole=False)
    head = text.index(">") + 1
    plain = text[:head] + COMPILER.format(balance="false") + text[head:]
    plain = plain.replace('type="spherical"', 'type="fixed"').replace('type="planar"', 'type="fixed"')
    spec = mujoco.MjSpec.from_string(plain)
    for child, joint in tree.joints.items():
        body, resists = spec.body(child), {"frictionloss": joint.friction, "damping": joint.damping}
        if joint.kind == "spherical":
            body.add_joint(name=f"j_{child}", type=mujoco.mjtJoint.mjJNT_BALL, **resists)
        elif joint.kind == "planar":
            x, y = in_plane(joint.axis)
            for part, along, motion in (("x", x, "SLIDE"), ("y", y, "SLIDE"), ("angle", joint.axis, "HINGE")):
                kind = getattr(mujoco.mjtJoint, f"mjJNT_{motion}")
                body.add_joint(name=f"j_{child}.{part}", type=kind, axis=along, **resists)
    if free is not None:
        spec.body(tree.root).add_freejoint(name=free)
    return spec


def set_effort(model: mujoco.MjModel, scene: tl.Scene) -> None:
    """Effort limits clamp the sum of a joint's drives."""
    for name, robot in scene.robots.items():
        for joint, limit in zip(robot.dof_names, robot.joint_effort_limit, strict=True):
            if np.isfinite(limit):
                number = model.joint(f"{name}/{joint}").id
                model.jnt_actfrclimited[number] = True
                model.jnt_actfrcrange[number] = [-limit, limit]


def matrix(quat: Array) -> Array:
    """Rotation of a quaternion (x, y, z, w)."""
    rotation = np.zeros(9)
    mujoco.mju_quat2Mat(rotation, np.roll(quat, 1))
    return rotation.reshape(3, 3)


def welded_center(model: mujoco.MjModel, body: int) -> Array:
    """Centre of mass, in a body's frame, of the body and all that is fixed to it."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    welded = model.body_weldid == body
    center = np.average(data.xipos[welded], axis=0, weights=model.body_mass[welded])
    return data.xmat[body].reshape(3, 3).T @ (center - data.xpos[body])


class Coordinates:
    """Our positions and velocities as MuJoCo's, by the names of the joints."""

    def __init__(self, model: mujoco.MjModel, sim: tl.Sim) -> None:
        self.model = model
        self.joints = []
        for number in range(model.njnt):
            joint = model.joint(number)
            coords, dofs = (
                [i for i, own in enumerate(names) if own == joint.name or own.startswith(f"{joint.name}.")]
                for names in (sim.coord_names, sim.dof_names)
            )
            kind = int(model.jnt_type[number])
            center = welded_center(model, int(model.jnt_bodyid[number])) if kind == FREE else np.zeros(3)
            self.joints.append((kind, joint.qposadr[0], joint.dofadr[0], coords, dofs, center))
        driven = {model.actuator_trnid[k, 0] for k in range(model.nu)}
        self.driven = [joint for number, joint in enumerate(self.joints) if number in driven]

    def positions(self, q: Array) -> Array:
        """Ours ``(coords,)`` as qpos."""
        qpos = np.empty(self.model.nq)
        for kind, at, _, coords, _, _ in self.joints:
            own = q[coords].copy()
            if kind in (FREE, BALL):
                own[-4:] = np.roll(own[-4:], 1)
            qpos[at : at + len(own)] = own
        return qpos

    def to_qvel(self, q: Array) -> Array:
        """The matrix that takes our velocities at `q` to qvel, ``(dofs, dofs)``."""
        convert = np.zeros((self.model.nv, self.model.nv))
        for kind, _, at, coords, dofs, center in self.joints:
            block = np.eye(len(dofs))
            if kind == FREE:
                rotation = matrix(q[coords[3:]])
                x, y, z = rotation @ center
                # the origin moves with v - ω × r = v + r × ω
                block[:3, 3:] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
                block[3:, 3:] = rotation.T
            convert[np.ix_(range(at, at + len(dofs)), dofs)] = block
        return convert

    def drift(self, q: Array, qd: Array) -> Array:
        """What qacc has beside the converted accelerations: -ω × (ω × r) of a free body."""
        out = np.zeros(self.model.nv)
        for kind, _, at, coords, dofs, center in self.joints:
            if kind == FREE:
                spin = qd[dofs[3:]]
                out[at : at + 3] = -np.cross(spin, np.cross(spin, matrix(q[coords[3:]]) @ center))
        return out

    def control(self, target_q: Array, target_qd: Array) -> Array:
        """Targets of all dofs as MuJoCo's controls: position, velocity, joint by joint."""
        dofs = [joint[4][0] for joint in self.driven]
        by_joint = {self.model.actuator_trnid[k, 0]: k for k in range(0, self.model.nu, 2)}
        ctrl = np.empty(self.model.nu)
        for (number, k), dof in zip(sorted(by_joint.items()), dofs, strict=True):
            assert self.model.jnt_type[number] not in (FREE, BALL)
            ctrl[k : k + 2] = target_q[dof], target_qd[dof]
        return ctrl

    def distance(self, q: Array, qpos: Array) -> float:
        """Largest difference of positions; quaternions but for their sign."""
        off = self.positions(q) - qpos
        for kind, at, _, coords, _, _ in self.joints:
            if kind in (FREE, BALL):
                four = slice(at + len(coords) - 4, at + len(coords))
                other = off[four] + 2 * qpos[four]
                off[four] = min(off[four], other, key=np.linalg.norm)
        return float(np.abs(off).max())
