"""What tightloop does with each part of `MjModel`, so that a new part of a newer MuJoCo is found.

`undecided` lists parts of the installed MuJoCo of which nobody has decided yet. For each, do one of these:

- read it: add it to `py-client/python/tightloop/mujoco/export.py`, and use it in `sim-core/model/src/mujoco`;
- refuse it: the same, with a row in `sim-core/model/src/mujoco/refusals.rs`;
- leave it out: add it here, under its reason.
"""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import Any

import mujoco

from tightloop.mujoco import export

#: Parts of `MjModel` that are not read: reason, then names or patterns.
MODEL = {
    "pictures": """cam_* light_* mat_* tex_* skin_* *_rgba *_matid *_group tendon_width geom_castshadow vis
        mesh_normal* mesh_tex* mesh_facenormal mesh_facetexcoord""",
    "texts and numbers of the user": "name_* names names_map *_user text_* tuple_* numeric_* paths *_pathadr",
    "MuJoCo's own tables": """signature B_* D_* M_* map* bvh_* oct_* efm* *_bvhadr *_bvhnum *_octadr *_octnum
        *_sameframe *_treeid *_treenum tree_bodyadr tree_bodynum tree_dofadr tree_dofnum body_simple dof_simplenum
        ten_J_* mesh_graph* mesh_poly* mesh_extrema mesh_scale geom_aabb geom_rbound""",
    "derived from what is read": """body_rootid body_jntadr body_jntnum body_dofadr body_dofnum body_geomadr
        body_geomnum body_subtreemass body_contype body_conaffinity body_margin dof_bodyid dof_jntid dof_parentid
        dof_Madr dof_M0 tendon_type pair_signature actuator_length0
        actuator_ctrladr actuator_outadr actuator_historyadr flg_gravcomp sensor_needstage""",
    "read with adhesion and surface velocities": "flg_adhesion flg_surfacevel",
    "no effect in a step": "sensor_noise",
    "refused with flexes (nflex)": "flex*",
    "refused with plugins (nplugin)": "plugin* *_plugin",
    "of pictures of height fields": "hfield_pathadr",
    "refused with delays of sensors": "sensor_history*",
    "refused with the flag for sleep": "tree_sleep_policy dof_length",
    "read in parts": "opt stat",
}
#: Parts of `MjOption` that are not read.
OPTIONS = {
    "of MuJoCo's numerical methods": "jacobian sdf_*",
    "read with the flag for override": "o_*",
    "refused with the flag for sleep": "sleep_tolerance",
}
#: Options that the file has by other names: enumerations and flags.
NAMED_OPTIONS = "integrator cone solver disableflags enableflags"
#: Enumerations whose members the file names. The Rust reader accepts or refuses each by its name.
MEMBERS = {
    "mjtJoint": "FREE BALL SLIDE HINGE",
    "mjtGeom": "PLANE HFIELD SPHERE CAPSULE ELLIPSOID CYLINDER BOX MESH SDF ARROW ARROW1 ARROW2 LINE LINEBOX FLEX SKIN "
    "LABEL TRIANGLE NONE",
    "mjtEq": "CONNECT WELD JOINT TENDON FLEX FLEXVERT FLEXSTRAIN DISTANCE",
    "mjtWrap": "NONE JOINT PULLEY SITE SPHERE CYLINDER",
    "mjtTrn": "JOINT JOINTINPARENT SLIDERCRANK TENDON SITE BODY SO3 UNDEFINED",
    "mjtDyn": "NONE INTEGRATOR FILTER FILTEREXACT MUSCLE DCMOTOR PID USER",
    "mjtGain": "FIXED AFFINE MUSCLE DCMOTOR SO3 PID USER",
    "mjtBias": "NONE AFFINE MUSCLE DCMOTOR SO3 USER",
    "mjtSensor": "TOUCH ACCELEROMETER VELOCIMETER GYRO FORCE TORQUE MAGNETOMETER RANGEFINDER CAMPROJECTION JOINTPOS "
    "JOINTVEL TENDONPOS TENDONVEL ACTUATORPOS ACTUATORVEL ACTUATORFRC JOINTACTFRC TENDONACTFRC BALLQUAT BALLANGVEL "
    "JOINTLIMITPOS JOINTLIMITVEL JOINTLIMITFRC TENDONLIMITPOS TENDONLIMITVEL TENDONLIMITFRC FRAMEPOS FRAMEQUAT "
    "FRAMEXAXIS FRAMEYAXIS FRAMEZAXIS FRAMELINVEL FRAMEANGVEL FRAMELINACC FRAMEANGACC SUBTREECOM SUBTREELINVEL "
    "SUBTREEANGMOM INSIDESITE GEOMDIST GEOMNORMAL GEOMFROMTO CONTACT E_POTENTIAL E_KINETIC CLOCK TACTILE PLUGIN USER",
    "mjtConDataField": "FOUND FORCE TORQUE DIST POS NORMAL TANGENT LINVEL ANGVEL",
    "mjtRayDataField": "DIST DIR ORIGIN POINT NORMAL DEPTH",
    "mjtDataType": "REAL POSITIVE AXIS QUATERNION",
    "mjtCamLight": "FIXED TRACK TRACKCOM TARGETBODY TARGETBODYCOM",
    "mjtLightType": "SPOT DIRECTIONAL POINT IMAGE",
    "mjtIntegrator": "EULER RK4 IMPLICIT IMPLICITFAST DISCRETE",
    "mjtCone": "PYRAMIDAL ELLIPTIC",
    "mjtSolver": "PGS CG NEWTON",
    "mjtDisableBit": "CONSTRAINT EQUALITY FRICTIONLOSS LIMIT CONTACT SPRING DAMPER GRAVITY CLAMPCTRL WARMSTART "
    "FILTERPARENT ACTUATION REFSAFE SENSOR MIDPHASE EULERDAMP AUTORESET NATIVECCD ISLAND MULTICCD",
    "mjtEnableBit": "OVERRIDE ENERGY FWDINV INVDISCRETE SLEEP DIAGEXACT IPC SPECULATIVE",
    "mjtState": "TIME QPOS QVEL ACT HISTORY WARMSTART CTRL QFRC_APPLIED XFRC_APPLIED EQ_ACTIVE MOCAP_POS MOCAP_QUAT "
    "USERDATA PLUGIN PLASTIC PHYSICS FULLPHYSICS USER INTEGRATION",
}


def undecided() -> list[str]:
    """Return the parts of the installed MuJoCo's models that neither `export.py` nor this file has."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint/><geom size='1'/></body></worldbody></mujoco>"
    )
    read = {*export._ARRAYS, *export._NEWER_ARRAYS, *export._KINDS, *export._COUNTS}
    options = {*export._REAL_OPTIONS, *export._COUNT_OPTIONS, *NAMED_OPTIONS.split()}
    found = [f"MjModel.{name}" for name in _fields(model) if name not in read and not _is_listed(name, MODEL)]
    found += [
        f"MjOption.{name}" for name in _fields(model.opt) if name not in options and not _is_listed(name, OPTIONS)
    ]
    for kind, known in MEMBERS.items():
        members = [name for name in getattr(mujoco, kind).__members__ if not name.startswith("mjN")]
        found += [f"{kind}.{name}" for name in members if name.partition("_")[2] not in known.split()]
    return found


def _fields(home: Any) -> list[str]:
    """Names of the fields of an object, sizes and methods left out."""
    names = [name for name in dir(home) if not name.startswith("_") and not callable(getattr(home, name))]
    # sizes of a model follow from its arrays
    is_size = {name: name.startswith("n") and isinstance(getattr(home, name), int) for name in names}
    return [name for name in names if not (isinstance(home, mujoco.MjModel) and is_size[name])]


def _is_listed(name: str, reasons: dict[str, str]) -> bool:
    return any(fnmatchcase(name, pattern) for patterns in reasons.values() for pattern in patterns.split())
