"""Position actuators that are added to an exported MuJoCo model, whose makers gave its joints none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.mujoco import export
from tightloop.mujoco.texts import as_bytes, texts
from tightloop.optional_imports import optional_import

#: Kinds of joints with one dof.
_SINGLE = ("mjJNT_HINGE", "mjJNT_SLIDE")
_TEMPLATE = """<mujoco><worldbody><body><joint name="j"/><geom size="1"/></body></worldbody>
<actuator><position joint="j" kp="1"/></actuator></mujoco>"""


def joints_of(file: Path) -> dict[int, int]:
    """Return the hinges and slides of an exported model: index of the joint, by that of its dof."""
    found = _read(file)
    kinds = texts(found["jnt_type.names"])
    single = [kinds[kind] in _SINGLE for kind in found["jnt_type"]]
    return {int(dof): joint for joint, dof in enumerate(found["jnt_dofadr"]) if single[joint]}


def driven_joints(file: Path) -> set[int]:
    """Return the joints that an actuator of an exported model drives."""
    found = _read(file)
    kinds = texts(found["actuator_trntype.names"])
    pairs = zip(found["actuator_trntype"], found["actuator_trnid"].reshape(-1, 2), strict=True)
    return {int(ends[0]) for kind, ends in pairs if kinds[kind] in ("mjTRN_JOINT", "mjTRN_JOINTINPARENT")}


def added(file: Path, joints: Mapping[int, str], stiffness: float, damping: float, effort_limit: float) -> Path:
    """Write a model with position actuators behind its own to the user's cache, and return the file.

    Each is ``force = stiffness * (ctrl - q) - damping * qd``, as MuJoCo's ``<position>`` with ``kp`` and ``kv``. Its
    controls are clamped to the range of its joint. Controls of keyframes are the positions there.

    Args:
        file: The exported model.
        joints: Index of each joint, with the name of its actuator.
        stiffness: Gain [N·m/rad or N/m].
        damping: Damping [N·m·s/rad or N·s/m].
        effort_limit: Largest force [N·m or N]; infinite for none.
    """
    mujoco: Any = optional_import("mujoco", export.INSTALL)
    found = _read(file)
    old, new = len(found["actuator_group"]), len(joints)
    # whatever a version of MuJoCo knows of actuators has MuJoCo's defaults
    rows = export.arrays(mujoco.MjModel.from_xml_string(_TEMPLATE))
    places = np.array([*joints], int)
    limited = found["jnt_limited"][places]
    own_rows: dict[str, NDArray[Any]] = {
        "actuator_trnid": np.stack([places, np.full(new, -1)], axis=1),
        "actuator_gainprm": _rows(rows["actuator_gainprm"], new, [stiffness]),
        "actuator_biasprm": _rows(rows["actuator_biasprm"], new, [0.0, -stiffness, -damping]),
        "actuator_ctrllimited": limited,
        "actuator_ctrlrange": np.where(limited[:, None] != 0, found["jnt_range"][places], 0.0),
        "actuator_forcelimited": np.full(new, np.isfinite(effort_limit)),
        "actuator_forcerange": np.tile(
            [-effort_limit, effort_limit] if np.isfinite(effort_limit) else [0, 0], (new, 1)
        ),
    }
    for name in [name for name in found if name.startswith("actuator_") and not name.endswith(".names")]:
        own = found[name]
        if f"{name}.names" in found:
            kinds, kind = texts(found[f"{name}.names"]), texts(rows[f"{name}.names"])[rows[name][0]]
            kinds += [kind] * (kind not in kinds)
            found[f"{name}.names"] = as_bytes(kinds)
            more: NDArray[Any] = np.full(new, kinds.index(kind))
        elif name in own_rows:
            more = own_rows[name]
        else:
            row = rows[name] if name in rows else np.zeros((1, *own.shape[1:]))
            more = np.repeat(row, new, axis=0)
        found[name] = np.concatenate([own, more.astype(own.dtype)]).reshape(old + new, *own.shape[1:])
    found["names.actuator"] = np.concatenate([found["names.actuator"], as_bytes([*joints.values()])])
    positions = found["key_qpos"][:, found["jnt_qposadr"][places]]
    found["key_ctrl"] = np.ascontiguousarray(np.concatenate([found["key_ctrl"], positions], axis=1))
    return export.kept(found)


def _rows(row: NDArray[Any], count: int, first: list[float]) -> NDArray[Any]:
    """Repeat a row, with other first entries."""
    rows = np.repeat(row, count, axis=0)
    rows[:, : len(first)] = first
    return rows


def _read(file: Path) -> dict[str, NDArray[Any]]:
    numpy: Any = optional_import("safetensors.numpy", export.INSTALL)
    return dict(numpy.load(file.read_bytes()))
