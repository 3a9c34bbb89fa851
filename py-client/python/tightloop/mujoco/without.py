"""What a MuJoCo model is made without, where it has something that tightloop does not support."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import SceneError
from tightloop.mujoco.texts import as_bytes, texts

Arrays = dict[str, NDArray[Any]]

#: Where a file keeps what was left out, a sentence each; `sim-core/model/src/mujoco` adds them to the model's notes.
NOTES = "notes.without"
#: Enabled parts that are supported; all that can be disabled is.
_FLAGS = ("mjENBL_ENERGY", "mjENBL_FWDINV", "mjENBL_OVERRIDE")
#: Largest power of ``solimp``, as `sim-core/model/src/softness.rs` has it, and its place.
_POWER_MAX, _POWER = 16.0, 4
#: Integrators that every device has. A GPU has no ``mjINT_IMPLICIT``, so that a model may be made without it.
_INTEGRATORS = ("mjINT_EULER", "mjINT_IMPLICITFAST", "mjINT_RK4")
#: Arrays with a row for each element of a kind begin so.
_PREFIXES = {
    **{"equality": "eq_", "pair": "pair_", "tendon": "tendon_", "actuator": "actuator_", "geom": "geom_"},
    "key": "key_",
}


def checked(names: Iterable[str]) -> tuple[str, ...]:
    """Return names as a tuple.

    Raises:
        SceneError: They are no names.
    """
    if isinstance(names, str):
        raise SceneError(f"without is {names!r}; give a tuple of names, ({names!r},)")
    if not isinstance(names, Iterable):
        raise SceneError(f"without is {names!r}; give names of elements, such as ('tendon2',)")
    names = tuple(names)
    for name in names:
        if not isinstance(name, str):
            raise SceneError(f"without has {name!r}; give names of elements, such as ('tendon2',)")
    return names


def leave_out(found: Arrays, names: Sequence[str]) -> None:
    """Change the exported arrays of a model to those of one without some elements and options.

    Args:
        found: The arrays, which are changed in place.
        names: Names of elements, with their kind before it where several have it (``tendon:arm``); ``integrator``,
            ``noslip_iterations``, or a flag such as ``mjENBL_SLEEP``.

    Raises:
        SceneError: The model has nothing of a name, several elements have it, it is supported anyhow, or it cannot be
            left out.
    """
    notes: list[str] = []
    for name in names:
        notes += _option(found, name) or _element(found, name)
    found[NOTES] = as_bytes(notes)


def _option(found: Arrays, name: str) -> list[str]:
    """Leave out an option; nothing if it is none."""
    if name == "noslip_iterations":
        if not found["opt.noslip_iterations"].any():
            raise SceneError("without: the model has no noslip_iterations; leave them out of `without`")
        found["opt.noslip_iterations"] = np.zeros(1, np.int32)
        return ["without `noslip_iterations` contacts slip a little under load, as by MuJoCo's solver alone"]
    if name == "integrator":
        (own,) = texts(found["opt.integrator"])
        if own in _INTEGRATORS:
            raise SceneError(f"without: {own} is supported; leave `integrator` out of `without`")
        found["opt.integrator"] = as_bytes(["mjINT_IMPLICITFAST"])
        return [f"mjINT_IMPLICITFAST takes the place of {own}"]
    if name in (flags := texts(found["opt.flags"])):
        if name.startswith("mjDSBL_") or name in _FLAGS:
            raise SceneError(f"without: {name} is supported; leave it out of `without`")
        found["opt.flags"] = as_bytes([flag for flag in flags if flag != name])
        return [f"the flag {name} is off"]
    return []


def _element(found: Arrays, name: str) -> list[str]:
    """Leave out an element."""
    kind, _, own = name.partition(":")
    if kind not in _LEFT_OUT:
        kind, own = "", name
    kinds = [kind] if kind else list(_LEFT_OUT)
    places = [(kind, place) for kind in kinds for place, known in enumerate(_names(found, kind)) if known == own]
    if not places:
        raise SceneError(
            f"without: the model has no {' or '.join(kinds)} `{own}`; name what the message without `without` names"
        )
    if len(places) > 1:
        which = " or ".join(f"{kind}:{own}" for kind, _ in places)
        raise SceneError(f"without: several elements have the name `{own}`; give {which}")
    ((kind, place),) = places
    return [f"{kind} `{own}` {note}" for note in _LEFT_OUT[kind](found, place)]


def _names(found: Arrays, kind: str) -> list[str]:
    """Names of elements; those without a name have their kind and number, as in messages."""
    own = texts(found[f"names.{kind}"])
    return [name or f"{kind}{place}" for place, name in enumerate(own)]


def _zero(found: Arrays, place: int, *arrays: str) -> None:
    for name in arrays:
        if name in found:
            found[name] = found[name].copy()
            found[name][place] = 0


def _bound_power(found: Arrays, places: slice, *arrays: str) -> str:
    """Bound the power of ``solimp`` to what is supported; return what to say of it."""
    changed = False
    for name in arrays:
        rows = found[name] = found[name].copy()
        powers = rows.reshape(-1, _POWER + 1)[places, _POWER]
        changed |= bool((powers > _POWER_MAX).any())
        np.minimum(powers, _POWER_MAX, out=powers)
    return f"; the power of its solimp is {_POWER_MAX:g}" if changed else ""


def _choose(found: Arrays, array: str, place: int, kind: str) -> None:
    """Give a row of an enumeration another member."""
    members = texts(found[f"{array}.names"])
    members += [kind] * (kind not in members)
    found[f"{array}.names"] = as_bytes(members)
    found[array] = found[array].copy()
    found[array][place] = members.index(kind)


def _drop(found: Arrays, kind: str, dropped: NDArray[np.bool_]) -> None:
    """Remove rows of all arrays of a kind that nothing else counts."""
    for name in [*found]:
        if name.startswith(_PREFIXES[kind]) and not name.endswith(".names"):
            found[name] = np.ascontiguousarray(found[name][~dropped])
    kept = [name for name, gone in zip(texts(found[f"names.{kind}"]), dropped, strict=True) if not gone]
    found[f"names.{kind}"] = as_bytes(kept)
    if f"n{kind}" in found:
        found[f"n{kind}"] = np.array([len(kept)], np.int32)


def _geom(found: Arrays, place: int) -> list[str]:
    _zero(found, place, "geom_contype", "geom_conaffinity", "geom_adhesion", "geom_surfacevel")
    _drop(found, "pair", (found["pair_geom1"] == place) | (found["pair_geom2"] == place))
    return ["touches nothing"]


def _joint(found: Arrays, place: int) -> list[str]:
    single = texts(found["jnt_type.names"])[found["jnt_type"][place]] in ("mjJNT_HINGE", "mjJNT_SLIDE")
    if not single:
        _zero(found, place, "jnt_actfrclimited")
    first = found["jnt_dofadr"][place]
    following = found["jnt_dofadr"][found["jnt_dofadr"] > first]
    end = following.min() if len(following) else len(found["dof_armature"])
    powers = [
        _bound_power(found, slice(place, place + 1), "jnt_solimp"),
        _bound_power(found, slice(int(first), int(end)), "dof_solimp"),
    ]
    return [("keeps what is supported" if single else "has no bound of its actuators' forces") + max(powers)]


def _pair(found: Arrays, place: int) -> list[str]:
    _drop(found, "pair", np.arange(len(found["pair_geom1"])) == place)
    return ["is left out: its geoms touch by their own parameters, if they may"]


def _key(found: Arrays, place: int) -> list[str]:
    _drop(found, "key", np.arange(len(found["key_time"])) == place)
    return ["is left out"]


def _equality(found: Arrays, place: int) -> list[str]:
    _drop(found, "equality", np.arange(len(found["eq_active0"])) == place)
    return ["holds nothing together"]


def _tendon(found: Arrays, place: int) -> list[str]:
    polynomials = ("tendon_dampingpoly", "tendon_stiffnesspoly")
    own = ("tendon_damping", "tendon_stiffness", "tendon_frictionloss", "tendon_limited", "tendon_armature")
    _zero(found, place, *own, *polynomials, "tendon_num", "tendon_actfrclimited")
    if "tendon_plasticadr" in found:
        found["tendon_plasticadr"] = found["tendon_plasticadr"].copy()
        found["tendon_plasticadr"][place] = -1
    _bound_power(found, slice(place, place + 1), "tendon_solimp_lim", "tendon_solimp_fri")
    kinds = texts(found["eq_type.names"])
    ties = np.array([kinds[kind] == "mjEQ_TENDON" for kind in found["eq_type"]], bool)
    ties &= (found["eq_obj1id"] == place) | (found["eq_obj2id"] == place)
    _drop(found, "equality", ties)
    kinds = texts(found["actuator_trntype.names"])
    ends = zip(found["actuator_trntype"], found["actuator_trnid"].reshape(-1, 2), strict=True)
    pulling = [k for k, (kind, (end, _)) in enumerate(ends) if kinds[kind] == "mjTRN_TENDON" and end == place]
    for actuator in pulling:
        _actuator(found, actuator)
    also = f", nor by its {len(pulling)} actuators" if pulling else ""
    return [f"has length 0 and pulls nothing, neither by itself nor by equalities{also}"]


def _actuator(found: Arrays, place: int) -> list[str]:
    if not len(found["jnt_type"]):
        raise SceneError("without: the model has no joints, so nothing moves; simulate it with a joint, or not at all")
    # on a joint with gear 0, without activation
    _choose(found, "actuator_trntype", place, "mjTRN_JOINT")
    found["actuator_trnid"] = found["actuator_trnid"].copy()
    found["actuator_trnid"].reshape(-1, 2)[place] = (0, -1)
    laws = {"dyntype": "mjDYN_NONE", "gaintype": "mjGAIN_FIXED", "biastype": "mjBIAS_NONE"}
    for law, kind in laws.items():
        _choose(found, f"actuator_{law}", place, kind)
    parts = ("gear", "gainprm", "biasprm", "delay", "armature", "damping", "dampingpoly", "actlimited")
    _zero(found, place, *(f"actuator_{part}" for part in parts))
    first, count = int(found["actuator_actadr"][place]), int(found["actuator_actnum"][place])
    if count > 0:
        # activations behind its own move up
        later = found["actuator_actadr"] > first
        found["actuator_actadr"] = np.where(later, found["actuator_actadr"] - count, found["actuator_actadr"])
        found["actuator_actadr"] = found["actuator_actadr"].astype(np.int32)
        found["key_act"] = np.ascontiguousarray(np.delete(found["key_act"], np.s_[first : first + count], axis=1))
    found["actuator_actadr"] = found["actuator_actadr"].copy()
    found["actuator_actadr"][place] = -1
    _zero(found, place, "actuator_actnum")
    for name in ("actuator_ctrlnum", "actuator_outnum"):
        if name in found:
            found[name] = found[name].copy()
            found[name][place] = 1
    return ["exerts no force; its control is kept and does nothing" + (", its activation is gone" if count else "")]


#: How an element of each kind is left out; the functions return what is said of it.
_LEFT_OUT: dict[str, Callable[[Arrays, int], list[str]]] = {
    "geom": _geom,
    "joint": _joint,
    "pair": _pair,
    "equality": _equality,
    "tendon": _tendon,
    "actuator": _actuator,
    "key": _key,
}
