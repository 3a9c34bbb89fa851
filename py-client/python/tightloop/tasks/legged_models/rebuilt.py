"""An MjSpec of a compiled MuJoCo model, which has none: bodies, joints, geoms, actuators and what they need."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import ArgumentError
from tightloop.mujoco import reflected


def rebuilt(model: Any) -> Any:
    """Return an MjSpec that compiles to the same bodies, joints and geoms, in the same order.

    Args:
        model: An MjModel.

    Raises:
        ArgumentError: It has equalities, tendons or height fields, which need its file.
    """
    mujoco: Any = import_module("mujoco")

    for count, what in ((model.neq, "equalities"), (model.ntendon, "tendons"), (model.nplugin, "plugins")):
        if count:
            raise ArgumentError(f"model: an MjModel with {what} cannot be changed; give its file, or its MjSpec")
    spec = mujoco.MjSpec()
    spec.compiler.autolimits = False
    spec.compiler.degree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = 0.0
    meshes = [_mesh(spec, model, place) for place in range(model.nmesh)]
    bodies = [spec.worldbody]
    for place in range(1, model.nbody):
        body = bodies[model.body_parentid[place]].add_body(name=_name(model.body(place), "body", place))
        body.pos, body.quat = model.body_pos[place], model.body_quat[place]
        if model.body_mass[place] > 0.0:
            body.explicitinertial = True
            body.mass, body.inertia = model.body_mass[place], model.body_inertia[place]
            body.ipos, body.iquat = model.body_ipos[place], model.body_iquat[place]
        body.gravcomp = model.body_gravcomp[place]
        bodies.append(body)
    shares = reflected.shares(model)
    for place in range(model.njnt):
        _joint(bodies[model.jnt_bodyid[place]], model, place, shares)
    for place in range(model.ngeom):
        if mujoco.mjtGeom(model.geom_type[place]) not in (mujoco.mjtGeom.mjGEOM_HFIELD, mujoco.mjtGeom.mjGEOM_SDF):
            _geom(bodies[model.geom_bodyid[place]], model, place, meshes)
    for signature in model.exclude_signature:
        ends = [bodies[int(end)].name for end in (signature >> 16, signature & 0xFFFF)]
        spec.add_exclude(bodyname1=ends[0], bodyname2=ends[1])
    return spec


def _name(element: Any, kind: str, place: int) -> str:
    return element.name or f"{kind}_{place}"


def _mesh(spec: Any, model: Any, place: int) -> str:
    first, count = model.mesh_vertadr[place], model.mesh_vertnum[place]
    mesh = spec.add_mesh(name=f"mesh_{place}")
    mesh.uservert = np.asarray(model.mesh_vert[first : first + count], float).ravel().tolist()
    first, count = model.mesh_faceadr[place], model.mesh_facenum[place]
    mesh.userface = np.asarray(model.mesh_face[first : first + count]).ravel().tolist()
    return mesh.name


def _joint(body: Any, model: Any, place: int, shares: tuple[NDArray[Any], NDArray[Any]]) -> None:
    mujoco: Any = import_module("mujoco")

    dof, coord = model.jnt_dofadr[place], model.jnt_qposadr[place]
    # an integer of NumPy is in no tuple of MuJoCo's types
    kind = mujoco.mjtJoint(model.jnt_type[place])
    joint = body.add_joint(name=_name(model.joint(place), "joint", place), type=kind)
    if kind == mujoco.mjtJoint.mjJNT_FREE:
        return
    joint.pos, joint.axis = model.jnt_pos[place], model.jnt_axis[place]
    joint.limited, joint.range = bool(model.jnt_limited[place]), model.jnt_range[place]
    joint.actfrclimited, joint.actfrcrange = bool(model.jnt_actfrclimited[place]), model.jnt_actfrcrange[place]
    joint.solref_limit, joint.solimp_limit = model.jnt_solref[place], model.jnt_solimp[place]
    joint.solref_friction, joint.solimp_friction = model.dof_solref[dof], model.dof_solimp[dof]
    # what actuators add stays without them
    armature, damping = (share[dof] for share in shares)
    joint.armature, joint.frictionloss = model.dof_armature[dof] + armature, model.dof_frictionloss[dof]
    joint.damping[0], joint.stiffness[0] = model.dof_damping[dof] + damping[0], model.jnt_stiffness[place]
    if kind in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE):
        joint.ref, joint.springref = model.qpos0[coord], model.qpos_spring[coord]


def _geom(body: Any, model: Any, place: int, meshes: list[str]) -> None:
    mujoco: Any = import_module("mujoco")

    kind = mujoco.mjtGeom(model.geom_type[place])
    geom = body.add_geom(name=_name(model.geom(place), "geom", place), type=kind)
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        geom.meshname = meshes[model.geom_dataid[place]]
    else:
        geom.size = model.geom_size[place]
    # a compiled mesh is about its own centre, so compiling it again moves it no more
    geom.pos, geom.quat = model.geom_pos[place], model.geom_quat[place]
    geom.contype, geom.conaffinity = int(model.geom_contype[place]), int(model.geom_conaffinity[place])
    geom.condim, geom.priority = int(model.geom_condim[place]), int(model.geom_priority[place])
    geom.friction, geom.solmix = model.geom_friction[place], model.geom_solmix[place]
    geom.solref, geom.solimp = model.geom_solref[place], model.geom_solimp[place]
    geom.margin, geom.gap = model.geom_margin[place], model.geom_gap[place]
    geom.group, geom.rgba = int(model.geom_group[place]), model.geom_rgba[place]
