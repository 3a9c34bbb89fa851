"""The randomization of a scene: the distributions that a reset draws from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import nearest, suggestion
from tightloop.checks.signatures import add_hints
from tightloop.errors import SceneError
from tightloop.scene.distributions import Distribution, Normal, Uniform, from_table
from tightloop.scene.parts import Parts
from tightloop.scene.robot import Robot

_POSE = ("x", "y", "z", "roll", "pitch", "yaw")
_CAMERA = (*_POSE, "focal")
_VELOCITY = ("vx", "vy", "vz", "wx", "wy", "wz")
#: Parts as they are called elsewhere.
_PARTS_MEANT = {"rx": ["roll"], "ry": ["pitch"], "rz": ["yaw"], "theta": ["yaw"], "heading": ["yaw"]}

_PARAM = 'it is a parameter: randomize(params={{"{}": {{…: tightloop.Uniform(…)}}}})'
add_hints("randomize", dict.fromkeys(_core.param_names(), _PARAM))

Offsets = Mapping[str, Distribution]
BodyOffsets = Mapping[str, Mapping[str, Distribution]]
ParamRanges = Mapping[str, Distribution | Mapping[str, Distribution]]


def checked(
    scene: Parts,
    *,
    joint_q: Offsets | None,
    joint_qd: Offsets | None,
    body_q: BodyOffsets | None,
    body_qd: BodyOffsets | None,
    params: ParamRanges | None,
    cameras: BodyOffsets | None,
) -> dict[str, dict[str, Any]]:
    """Check the arguments of `Scene.randomize`; return tables of distributions by field and name.

    Raises:
        SceneError: A name does not exist in the scene, or a value is not a distribution.
    """
    return {
        "joint_q": _joints(scene, "joint_q", joint_q),
        "joint_qd": _joints(scene, "joint_qd", joint_qd),
        "body_q": _bodies(scene, "body_q", body_q, _POSE),
        "body_qd": _bodies(scene, "body_qd", body_qd, _VELOCITY),
        "cameras": _cameras(scene, cameras),
        "params": _ranges(params),
    }


def merge(tables_by_field: Mapping[str, dict[str, Any]], distributions: dict[str, dict[str, Any]]) -> None:
    """Add tables to the distributions of a scene; one of a name and part that is there already replaces it."""
    for field, tables in tables_by_field.items():
        if tables:
            old = distributions.setdefault(field, {})
            for name, table in tables.items():
                parts = old.get(name, {})
                old[name] = table if _is_alone(table) or _is_alone(parts) else parts | table


def _joints(scene: Parts, field: str, offsets: Offsets | None) -> dict[str, Any]:
    tables = {}
    for name, distribution in _items(f"randomize: {field}", offsets):
        what = f"randomize: {field} of {name!r}"
        _check_joint(scene, what, name)
        tables[name] = _table(what, distribution)
    return tables


def _check_joint(scene: Parts, what: str, name: str) -> None:
    robot, _, joint = name.partition("/")
    if robot in scene.bodies:
        raise SceneError(f"{what}: it is a body; give body_q or body_qd")
    found = _robot(scene, what, robot)
    kinds, leaders = found.joint_types, found.joint_leaders
    own = [joint for joint, kind in kinds.items() if kind != "floating" and joint not in leaders]
    _check_complete(what, name)
    if not joint:
        if not own:
            raise SceneError(f"{what}: it has no joints but floating and following ones")
        return
    parts = [dof for dof in found.dof_names if dof.rpartition(".")[0] in kinds]
    owner = joint if joint in kinds else joint.rpartition(".")[0] if joint in parts else None
    if owner is None:
        raise SceneError(f"{what}: there is no joint {joint!r}; {_meant(joint, [*kinds])}")
    if owner in leaders:
        leader = leaders[owner]
        raise SceneError(f"{what}: it follows `{leader}`; give `{robot}/{leader}` the distribution")
    if owner not in own:
        raise SceneError(f"{what}: it is a floating joint; give body_q or body_qd")


def _bodies(scene: Parts, field: str, offsets: BodyOffsets | None, parts: tuple[str, ...]) -> dict[str, Any]:
    tables = {}
    for name, given in _items(f"randomize: {field}", offsets):
        what = f"randomize: {field} of {name!r}"
        _check_body(scene, what, name)
        tables[name] = {}
        for part, distribution in _items(what, given):
            if part not in parts:
                near = "".join(f"did you mean `{other}`? " for other in _PARTS_MEANT.get(part, ()) if other in parts)
                raise SceneError(f"{what}: there is no part {part!r}; {near}use {', '.join(parts)}")
            tables[name][part] = _table(f"{what}, {part}", distribution)
    return tables


def _check_body(scene: Parts, what: str, name: str) -> None:
    if name in scene.bodies:
        if scene.bodies[name].fixed:
            raise SceneError(f"{what}: it is fixed; make it with fixed=False, or leave it out")
        return
    robot, _, joint = name.partition("/")
    kinds = _robot(scene, what, robot).joint_types
    _check_complete(what, name)
    floating = [joint for joint, kind in kinds.items() if kind == "floating"]
    if not floating:
        raise SceneError(f"{what}: it does not move freely; add the robot with add_urdf(floating=True)")
    if joint not in floating and ("/" in name or len(floating) > 1):
        names = [f"{robot}/{joint}" for joint in floating]
        raise SceneError(f"{what}: name one of the floating joints: {_some(names)}")


def _cameras(scene: Parts, offsets: BodyOffsets | None) -> dict[str, Any]:
    tables = {}
    for name, given in _items("randomize: cameras", offsets):
        what = f"randomize: cameras of {name!r}"
        if name not in scene.cameras:
            raise SceneError(f"{what}: there is no such camera; {_meant(name, [*scene.cameras])}")
        tables[name] = {}
        for part, distribution in _items(what, given):
            if part not in _CAMERA:
                raise SceneError(f"{what}: there is no part {part!r}; use {', '.join(_CAMERA)}")
            tables[name][part] = _table(f"{what}, {part}", distribution)
    return tables


def _robot(scene: Parts, what: str, name: str) -> Robot:
    if name not in scene.robots:
        raise SceneError(f"{what}: there is no robot or body {name!r}; {_meant(name, [*scene.robots, *scene.bodies])}")
    return scene.robots[name]


def from_tables(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Return the arguments of `Scene.randomize` for the distributions of a scene file."""
    fields: dict[str, Any] = {}
    for field, named in tables.items():
        fields[field] = {
            name: from_table(table)
            if _is_alone(table)
            else {part: from_table(of_part) for part, of_part in table.items()}
            for name, table in named.items()
        }
    return fields


def _is_alone(table: Mapping[str, Any]) -> bool:
    """Return whether this is the table of one distribution, not tables by name."""
    return any(isinstance(value, list) for value in table.values())


def _check_complete(what: str, name: str) -> None:
    if name.endswith("/"):
        robot = name.rstrip("/")
        raise SceneError(f"{what}: the name is incomplete; give {robot!r} for the whole, or the joint after the slash")


def _ranges(params: ParamRanges | None) -> dict[str, Any]:
    tables = {}
    for param, given in _items("randomize: params", params):
        what = f"randomize: params, {param}"
        if param not in (known := _core.param_names()):
            raise SceneError(
                f"randomize: params has {param!r}, and there is no such parameter; {suggestion(param, known)}"
            )
        if isinstance(given, Uniform | Normal):
            tables[param] = given.table()
        else:
            named = _items(what, given)
            if not named:
                raise SceneError(f"{what} is {given!r}; give distributions by name")
            tables[param] = {name: _table(f"{what} of {name!r}", distribution) for name, distribution in named}
    return tables


def _items(what: str, given: Any) -> list[tuple[str, Any]]:
    if given is None:
        return []
    if not isinstance(given, Mapping):
        raise SceneError(f"{what} is {given!r}; give a dict of distributions by name")
    for name in given:
        if not isinstance(name, str):
            raise SceneError(f"{what} has the key {name!r}; give names")
        checks.text(f"{what}: a name", name)
    return list(given.items())


def _table(what: str, distribution: Any) -> dict[str, list[float]]:
    if not isinstance(distribution, Uniform | Normal):
        raise SceneError(f"{what} is {distribution!r}; give a tightloop.Uniform or a tightloop.Normal")
    return distribution.table()


def _meant(name: str, known: list[str]) -> str:
    """Return the nearest names, or those that there are."""
    near = nearest(name, known)
    return f"did you mean {' or '.join(f'`{other}`' for other in near)}?" if near else f"there are: {_some(known)}"


def _some(names: list[str]) -> str:
    return ", ".join(names[:20]) + (", …" if len(names) > 20 else "") if names else "none"
