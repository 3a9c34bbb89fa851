"""Attributes that do not exist: the error suggests the one that was probably meant."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from tightloop.errors import UnknownAttribute, UnknownName

Entry = TypeVar("Entry")

#: What other simulators call these attributes, or what their names are without a prefix.
SYNONYMS = {
    "actions": ("action", "joint_target_q"),
    "angular_velocity": ("joint_qd", "body_qd"),
    "armature": ("joint_armature",),
    "control": ("joint_f", "joint_target_q", "ctrl"),
    "controls": ("control", "joint_f", "joint_target_q", "ctrl"),
    "decimation": ("substeps",),
    "damping": ("joint_target_kd",),
    "dof_pos": ("joint_q",),
    "dof_vel": ("joint_qd",),
    "effort": ("joint_effort_limit", "joint_f"),
    "effort_limit": ("joint_effort_limit",),
    "fixed_base": ("floating",),
    "fix_base": ("floating",),
    "env_ids": ("mask",),
    "euler": ("quat",),
    "extents": ("half_extents",),
    "file": ("path",),
    "filename": ("path",),
    "frame": ("forward",),
    "friction": ("mu", "shape_mu", "joint_friction"),
    "half_size": ("half_extents",),
    "height": ("half_height",),
    "ids": ("mask",),
    "indices": ("mask",),
    "joint_pos": ("joint_q",),
    "joint_positions": ("joint_q",),
    "joint_vel": ("joint_qd",),
    "joint_velocities": ("joint_qd",),
    "joint_limits": ("joint_range",),
    "kd": ("joint_target_kd",),
    "ke": ("joint_target_ke",),
    "kp": ("joint_target_ke",),
    "kv": ("joint_target_kd",),
    "limits": ("joint_range",),
    "mu": ("shape_mu",),
    "n_envs": ("num_envs", "worlds"),
    "num_envs": ("worlds",),
    "num_worlds": ("worlds", "num_envs"),
    "nworld": ("worlds",),
    "obs": ("forward",),
    "observation": ("forward",),
    "orientation": ("quat",),
    "position": ("pos", "joint_q"),
    "qpos": ("joint_q",),
    "qvel": ("joint_qd",),
    "render": ("picture", "view"),
    "rot": ("quat",),
    "rotation": ("quat",),
    "rpy": ("quat",),
    "size": ("half_extents", "radius", "radii"),
    "state": ("forward", "snapshot"),
    "stiffness": ("joint_target_ke",),
    "target": ("joint_target_q",),
    "targets": ("joint_target_q",),
    "timestep": ("dt",),
    "torque": ("joint_f", "joint_torque"),
    "velocity": ("joint_qd", "joint_target_qd"),
    "world_ids": ("mask",),
    "worlds": ("num_envs",),
    "xform": ("body_q",),
    "xpos": ("body_q",),
    "xquat": ("body_q",),
}
# difflib's measure of likeness, from 0 to 1
_LIKENESS = 0.6


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return up to three of the known names that a wrong one may have meant."""
    known = [*known]
    meant = [synonym for synonym in SYNONYMS.get(name.removeprefix("set_"), ()) if synonym in known]
    return meant or difflib.get_close_matches(name, known, cutoff=_LIKENESS)


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return the end of a message: the nearest known names, or all of them."""
    known = sorted(known)
    near = nearest(name, known)
    if near:
        return "did you mean " + " or ".join(f"`{other}`" for other in near) + "?"
    return f"there are: {', '.join(known)}"


class ByName(dict[str, Entry]):
    """What a scene or a simulation has, by name: a dict, whose error of a wrong name suggests another."""

    def __init__(self, kind: str, entries: Mapping[str, Entry] | None = None) -> None:
        super().__init__(entries or {})
        self._kind = kind

    def __missing__(self, name: Any) -> Any:
        cure = suggestion(str(name), self) if self else "there is none yet"
        raise UnknownName(f"there is no {self._kind} {name!r}; {cure}")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        cure = f"write [{name!r}]" if name in self else 'entries are by name, such as ["arm"]'
        raise UnknownAttribute(f"a dict of each {self._kind} by name has no attribute {name!r}; {cure}")


class Attributes:
    """Base of classes whose attributes have fixed names: another name raises `UnknownAttribute`."""

    __slots__ = ()

    def _own_attributes(self) -> list[str]:
        """Names of the public attributes that hold values."""
        return [name for name in dir(type(self)) if name[0] != "_" and not callable(getattr(type(self), name))]

    def _subject(self) -> str:
        """What this is, for messages."""
        return type(self).__name__

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
        methods = [method for method in dir(type(self)) if method[0] != "_"]
        known = {*self._own_attributes(), *methods}
        raise UnknownAttribute(f"{self._subject()} has no attribute {name!r}; {suggestion(name, known)}")

    def __setattr__(self, name: str, value: Any) -> None:
        # a sealed object has a dict, which would take any name
        if name[0] != "_" and "_sealed" in getattr(self, "__dict__", ()):
            raise self._refused(name)
        try:
            object.__setattr__(self, name, value)
        except AttributeError:
            raise self._refused(name) from None
        if name[0] != "_":
            self._changed(name)

    def _changed(self, attribute: str) -> None:
        """Take note that a public attribute was set."""

    def _refused(self, name: str) -> UnknownAttribute:
        """Return the error of setting an attribute that does not exist, or cannot be set."""
        known = self._own_attributes()
        if name in getattr(self, "fields", ()):
            return UnknownAttribute(
                f"{self._subject()} has no attribute {name!r}; `write` and arguments of `step` change worlds"
            )
        if name in known or hasattr(type(self), name):
            return UnknownAttribute(f"{self._subject()}: `{name}` can only be read; {self._instead(name)}")
        return UnknownAttribute(f"{self._subject()} has no attribute {name!r}; {suggestion(name, known)}")

    def _instead(self, name: str) -> str:
        """What to do instead of setting an attribute that can only be read."""
        return "give it to the call that makes the object"
