"""Compiled MuJoCo models as files that tightloop reads without MuJoCo.

A file has the arrays of ``mjModel`` under their own names, as safetensors. It stores enumerations by the names of their
members, because their numbers differ between versions of MuJoCo. `sim-core/model/src/mujoco` reads the file.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.checks import advice
from tightloop.errors import SceneError
from tightloop.files import cache as cache_files
from tightloop.files import named as named_files
from tightloop.files.kinds import instead, kind_of_file
from tightloop.mujoco import shared_frames, textures
from tightloop.mujoco.texts import as_bytes
from tightloop.mujoco.without import leave_out
from tightloop.optional_imports import optional_import
from tightloop.whole_files import whole_file

#: Version of the file; `sim-core/model/src/mujoco/format.rs` reads it.
FORMAT = 1
#: Versions of MuJoCo whose models are read: at least this one, and below the other.
VERSIONS = ((3, 11), (4, 1))
#: Most bytes of an MJCF file.
_XML_MAX = 1 << 28
#: What to install, for messages; `{}` is a package.
INSTALL = (
    'models from MuJoCo need `{}`: run `pip install "./py-client[mujoco]"` in the repository, or '
    '`pip install "FILE.whl[mujoco]"` from a wheel'
)

# Arrays of `MjModel` that every supported version has.
_ARRAYS = """
    body_parentid body_weldid body_pos body_quat body_ipos body_iquat body_mass body_inertia body_invweight0
    body_gravcomp jnt_bodyid jnt_dofadr jnt_qposadr jnt_pos jnt_axis jnt_limited jnt_range jnt_margin
    jnt_stiffness jnt_solref jnt_solimp jnt_actfrclimited jnt_actfrcrange dof_armature
    dof_damping dof_frictionloss dof_solref dof_solimp dof_invweight0 qpos0 qpos_spring geom_bodyid geom_pos
    geom_quat geom_size geom_dataid geom_contype geom_conaffinity geom_condim geom_priority geom_solmix
    geom_solref geom_solimp geom_friction geom_margin geom_gap geom_fluid
    hfield_nrow hfield_ncol hfield_adr hfield_size hfield_data
    mesh_vertadr mesh_vertnum mesh_vert mesh_faceadr mesh_facenum mesh_face exclude_signature
    mesh_polyadr mesh_polynum mesh_polynormal mesh_polyvertadr mesh_polyvertnum mesh_polyvert
    eq_obj1id eq_obj2id eq_active0 eq_data eq_solref eq_solimp site_bodyid site_pos site_quat
    tendon_adr tendon_num tendon_damping tendon_stiffness tendon_lengthspring tendon_frictionloss tendon_limited
    tendon_range tendon_margin tendon_length0 tendon_invweight0 tendon_solref_lim tendon_solimp_lim
    tendon_solref_fri tendon_solimp_fri wrap_objid wrap_prm actuator_trnid actuator_gear
    actuator_gainprm actuator_biasprm actuator_ctrllimited actuator_ctrlrange actuator_forcelimited
    actuator_forcerange actuator_actlimited actuator_actrange actuator_actadr actuator_actnum actuator_actearly
    actuator_dynprm actuator_group jnt_actgravcomp body_mocapid pair_dim pair_geom1 pair_geom2 pair_solref
    pair_solreffriction pair_solimp pair_margin pair_gap pair_friction
    actuator_lengthrange actuator_acc0 actuator_cranklength
    key_time key_qpos key_qvel key_act key_ctrl key_mpos key_mquat
    cam_bodyid cam_pos cam_quat cam_targetbodyid cam_pos0 cam_poscom0 cam_mat0 cam_fovy cam_resolution cam_sensorsize
    cam_intrinsic geom_group geom_matid geom_rgba mat_rgba site_size site_group site_matid site_rgba
    tendon_width tendon_group tendon_matid tendon_rgba
    light_bodyid light_targetbodyid light_pos light_dir light_pos0 light_poscom0 light_dir0 light_active
    light_castshadow light_attenuation light_cutoff light_exponent light_ambient light_diffuse light_specular
    sensor_adr sensor_dim sensor_objid sensor_refid sensor_cutoff
""".split()
# Arrays of newer versions; where they are missing, no model has what they describe.
_NEWER_ARRAYS = """
    jnt_stiffnesspoly jnt_springyield jnt_plasticadr dof_dampingpoly geom_adhesion geom_surfacevel tendon_armature
    tendon_dampingpoly tendon_stiffnesspoly tendon_springyield tendon_plasticadr key_plastic
    pair_adhesion tendon_actfrclimited tendon_actfrcrange
    actuator_delay actuator_history actuator_armature actuator_damping
    actuator_dampingpoly jnt_actuatorid tendon_actuatorid actuator_ctrlnum actuator_ctrlspec
    actuator_outnum site_dataid mesh_pos mesh_quat
    sensor_delay sensor_interval sensor_intprm
""".split()
# Enumerations: the array and its type.
_KINDS = {
    "jnt_type": "mjtJoint",
    "geom_type": "mjtGeom",
    "eq_type": "mjtEq",
    "eq_objtype": "mjtObj",
    "wrap_type": "mjtWrap",
    "actuator_trntype": "mjtTrn",
    "actuator_dyntype": "mjtDyn",
    "actuator_gaintype": "mjtGain",
    "actuator_biastype": "mjtBias",
    "site_type": "mjtGeom",
    "cam_mode": "mjtCamLight",
    "light_mode": "mjtCamLight",
    "light_type": "mjtLightType",
    "sensor_type": "mjtSensor",
    "sensor_datatype": "mjtDataType",
    "sensor_objtype": "mjtObj",
    "sensor_reftype": "mjtObj",
}
# Elements with names, and what counts them.
_NAMED = {
    "body": "nbody",
    "joint": "njnt",
    "geom": "ngeom",
    "site": "nsite",
    "mesh": "nmesh",
    "pair": "npair",
    "equality": "neq",
    "tendon": "ntendon",
    "actuator": "nactuator",
    "key": "nkey",
    "sensor": "nsensor",
    "camera": "ncam",
}
_REAL_OPTIONS = (
    *("timestep", "gravity", "tolerance", "ls_tolerance", "noslip_tolerance", "ccd_tolerance", "impratio"),
    *("density", "viscosity", "wind", "magnetic"),
)
#: Options that count where the flag ``mjENBL_OVERRIDE`` is set.
_OVERRIDE_OPTIONS = ("o_margin", "o_solref", "o_solimp", "o_friction")
_COUNT_OPTIONS = ("iterations", "ls_iterations", "noslip_iterations", "ccd_iterations", "disableactuator")
# Parts of `MjVisual`: the light at the camera, and colours of muscles.
_LOOKS = (
    *(("headlight", name) for name in ("active", "ambient", "diffuse", "specular")),
    *(("rgba", name) for name in ("actuator", "actuatorpositive")),
)
_COUNTS = ("nflex", "nplugin", "npair", "nmocap", "nsensor", "nsensordata")


def compiled(model: Any) -> Any:
    """Return the ``MjModel`` of a path to XML, an ``MjSpec`` or an ``MjModel``.

    Raises:
        SceneError: MuJoCo cannot read or compile it; the message is MuJoCo's.
        MissingLibrary: The package ``mujoco`` is not installed.
    """
    mujoco = optional_import("mujoco", INSTALL)
    optional_import("safetensors.numpy", INSTALL)
    version = tuple(int(part) for part in mujoco.__version__.split(".")[:2])
    if not VERSIONS[0] <= version < VERSIONS[1]:
        least, end = (".".join(map(str, version)) for version in VERSIONS)
        raise SceneError(f"mujoco is {mujoco.__version__}; install a version from {least} to below {end}")
    try:
        if isinstance(model, mujoco.MjModel):
            return model
        if isinstance(model, mujoco.MjSpec):
            return model.compile()
        if isinstance(model, str | os.PathLike):
            wrong = instead("model", model, "mujoco")
            is_robot = wrong is not None and kind_of_file(Path(model)) == "robot"
            if wrong is not None and not is_robot:
                raise SceneError(wrong)
            path = Path(model)
            if not path.exists():
                raise SceneError(f"{path}: there is no such file; give the path of an MJCF file")
            named_files.check("an MJCF file", path, SceneError, limit=_XML_MAX)
            try:
                found = mujoco.MjModel.from_xml_path(str(path))
            except ValueError:
                if is_robot:
                    raise SceneError(str(wrong)) from None
                raise
            if is_robot:
                advice.warn(f"{wrong} with its drives, limits and packages; MuJoCo compiles it without drives")
            return found
    except OSError as error:
        raise SceneError(f"{model}: cannot be read: {error.strerror}; give the path of an MJCF file") from error
    except (ValueError, RuntimeError) as error:
        where = f"{model}: " if isinstance(model, str | os.PathLike) else ""
        raise SceneError(f"{where}MuJoCo cannot compile it: {error}") from error
    raise SceneError(f"model is {type(model).__name__}; give a path to XML, an mujoco.MjSpec or an mujoco.MjModel")


def arrays(model: Any) -> dict[str, NDArray[Any]]:
    """Return what tightloop reads of an ``MjModel``: arrays by their names, as float64, int32 or uint8."""
    import mujoco

    found: dict[str, NDArray[Any]] = {"format": np.array([FORMAT], np.int32)}
    found["mujoco_version"] = as_bytes([mujoco.__version__])
    for name in _ARRAYS:
        found[name] = _plain(getattr(model, name))
    for name in _NEWER_ARRAYS:
        if hasattr(model, name):
            found[name] = _plain(getattr(model, name))
    # MuJoCo ignores surface velocities that were set later without this flag
    if not getattr(model, "flg_surfacevel", True):
        found["geom_surfacevel"][:] = 0
    shared_frames.apply(model, found)
    for name, kind in _KINDS.items():
        members = {int(value): key for key, value in getattr(mujoco, kind).__members__.items()}
        values = np.asarray(getattr(model, name)).astype(int)
        used = sorted(set(values.tolist()))
        if unknown := [value for value in used if value not in members]:
            raise SceneError(f"{name} is {unknown[0]}, which is no {kind}; give one of its members")
        found[name] = np.array([used.index(value) for value in values], np.int32)
        found[f"{name}.names"] = as_bytes([members[value] for value in used])
    text = bytes(model.names)
    for kind, count in _NAMED.items():
        short = {"joint": "jnt", "equality": "eq", "camera": "cam"}.get(kind, kind)
        starts = getattr(model, f"name_{short}adr")
        own = [text[start : text.index(b"\0", start)].decode(errors="replace") for start in starts]
        assert len(own) == getattr(model, count)
        found[f"names.{kind}"] = as_bytes(own)
    found["names.model"] = as_bytes([text[: text.index(b"\0")].decode(errors="replace")])
    found |= _hulls(model)
    found["mat_texture_mean"] = textures.means(model)
    overrides = _OVERRIDE_OPTIONS if model.opt.enableflags & mujoco.mjtEnableBit.mjENBL_OVERRIDE else ()
    for name in (*_REAL_OPTIONS, *overrides):
        found[f"opt.{name}"] = np.array(getattr(model.opt, name), np.float64).reshape(-1)
    for name in _COUNT_OPTIONS:
        found[f"opt.{name}"] = np.array([getattr(model.opt, name)], np.int32)
    for name, kind in (("integrator", "mjtIntegrator"), ("cone", "mjtCone"), ("solver", "mjtSolver")):
        found[f"opt.{name}"] = as_bytes([getattr(mujoco, kind)(getattr(model.opt, name)).name])
    flags = [*_flags(mujoco.mjtDisableBit, model.opt.disableflags), *_flags(mujoco.mjtEnableBit, model.opt.enableflags)]
    found["opt.flags"] = as_bytes(flags)
    # without it, MuJoCo has no pull of adhesion
    found["flg_adhesion"] = np.array([bool(getattr(model, "flg_adhesion", True))], np.int32)
    found["stat.meaninertia"] = np.array([model.stat.meaninertia])
    for part, name in _LOOKS:
        found[f"vis.{part}.{name}"] = np.array(getattr(getattr(model.vis, part), name), np.float64).reshape(-1)
    for name in _COUNTS:
        found[name] = np.array([getattr(model, name)], np.int32)
    return found


def export(model: Any, path: str | os.PathLike[str]) -> None:
    """Write an ``MjModel`` to a file.

    Args:
        model: A path to XML, an ``mujoco.MjSpec`` or an ``mujoco.MjModel``.
        path: The file.

    Raises:
        SceneError: MuJoCo cannot compile the model.
        OutputError: The file cannot be written.
        MissingLibrary: The package ``mujoco`` is not installed.
    """
    found = _bytes(arrays(compiled(model)))
    with whole_file(Path(path)) as part:
        part.write_bytes(found)


def cached(model: Any, without: Sequence[str] = ()) -> Path:
    """Write an ``MjModel`` to a file in the user's cache, named by its content, and return the file.

    Args:
        model: A path to XML, an ``mujoco.MjSpec`` or an ``mujoco.MjModel``.
        without: Names of elements and options to leave out; see `tightloop.mujoco.without`.

    Raises:
        SceneError: MuJoCo cannot compile the model, or the file cannot be written.
        MissingLibrary: The package ``mujoco`` is not installed.
    """
    found = arrays(compiled(model))
    if without:
        leave_out(found, without)
    return kept(found)


def kept(found: dict[str, NDArray[Any]]) -> Path:
    """Write the arrays of a model to a file in the user's cache, named by its content, and return the file."""
    digest = hashlib.sha256()
    for name in sorted(found):
        digest.update(f"{name} {found[name].dtype} {found[name].shape}\n".encode())
        digest.update(found[name].tobytes())
    name = f"{digest.hexdigest()[:32]}.safetensors"
    return cache_files.keep("mujoco", name, lambda part: part.write_bytes(_bytes(found)))


def _bytes(found: dict[str, NDArray[Any]]) -> bytes:
    from safetensors.numpy import save

    return save(found)


def _hulls(model: Any) -> dict[str, NDArray[Any]]:
    """Vertices of the convex hull that MuJoCo made of each mesh; none where it made none."""
    firsts, counts, corners = [], [], []
    for mesh, start in enumerate(model.mesh_graphadr):
        # the graph: numbers of vertices and faces, where the edges of each vertex begin, then the vertices
        count = 0 if start < 0 else int(model.mesh_graph[start])
        firsts.append(len(corners))
        counts.append(count)
        corners += (model.mesh_graph[start + 2 + count : start + 2 + 2 * count]).tolist()
        assert all(0 <= corner < model.mesh_vertnum[mesh] for corner in corners[firsts[-1] :])
    arrays = {"mesh_hulladr": firsts, "mesh_hullnum": counts, "mesh_hullvert": corners}
    return {name: np.array(values, np.int32) for name, values in arrays.items()}


def _plain(array: Any) -> NDArray[Any]:
    """A copy of an array as float64 or int32."""
    array = np.asarray(array)
    return np.array(array, dtype=np.float64 if array.dtype.kind == "f" else np.int32, order="C")


def _flags(kind: Any, value: int) -> list[str]:
    """Names of the flags that a number has set."""
    members = [(int(bit), name) for name, bit in kind.__members__.items()]
    return [name for bit, name in members if bit > 0 and bit & (bit - 1) == 0 and value & bit and "mjN" not in name]
