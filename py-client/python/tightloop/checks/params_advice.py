"""Parameters that are written while a simulation runs and are most likely a mistake: reported once, with the cure."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks import advice
from tightloop.errors import TightloopError

#: Writes that are looked at, and worlds of each: such a mistake is in all of them.
_WRITES, _WORLDS = 256, 16
#: An inertia may be off from that of a body by this share, as rounding makes it [–].
_SLACK = 1e-6
#: Factors of the values of a model are within these, and a value this far outside of a range around 1 is none [–].
_FACTORS, _BESIDE = (0.1, 10.0), 1.25
#: Gravity beyond this is in other units, such as cm/s² [m/s²].
_GRAVITY_MAX = 50.0
#: Writes of a parameter that are compared with what was there.
_COMPARED = 4
#: Factors come in numbers, and most of them beside the values of the model.
_DRAWS_MIN, _SHARE = 2, 0.5
#: Parameters that a write replaces and that are other than 0 or 1 as a rule.
_REPLACED = {
    "actuator_bias",
    "actuator_forcerange",
    "actuator_gain",
    "body_inertia",
    "body_mass",
    "joint_armature",
    "joint_damping",
    "joint_effort_limit",
    "joint_friction",
    "joint_target_kd",
    "joint_target_ke",
}


class ParamsAdvice:
    """Looks at writes of parameters as the daemon looks at the scene.

    Args:
        info: The daemon's description.
    """

    def __init__(self, info: Mapping[str, Any]) -> None:
        self._info = info
        self._writes = 0
        self._told: set[str] = set()
        self._compared: dict[str, int] = {}
        self._scene: dict[str, Any] | None = None

    def look(
        self,
        given: Mapping[str, NDArray[Any]],
        mask: NDArray[np.bool_] | None,
        before: Callable[[str], NDArray[Any]],
        *,
        entries: bool = False,
    ) -> None:
        """Warn of what is written, if need be.

        Args:
            given: Arrays by name, ``(worlds, columns)``.
            mask: Worlds that are written; None for all.
            before: Returns a parameter as it is, ``(worlds, columns)``.
            entries: Whether only some entries change; others may follow.
        """
        if self._writes >= _WRITES:
            return
        self._writes += 1
        looks = {
            "gravity": self._gravity,
            "joint_effort_limit": self._effort,
            "body_mass": self._mass,
            "body_inertia": self._inertia,
            **({} if entries else {"shape_mu": self._friction}),
        }
        for name in given.keys() & _REPLACED - self._told:
            # reading what was there takes a snapshot
            if self._compared.get(name, 0) < _COMPARED:
                self._factors(name, given[name], mask, before)
        for name in given.keys() & looks.keys() - self._told:
            rows = np.flatnonzero(np.ones(len(given[name]), bool) if mask is None else mask)[:_WORLDS]
            problem = looks[name](given[name][rows], rows, before)
            if problem:
                self._told.add(name)
                advice.warn_of_values(f"params.{name} {problem}")

    def _factors(self, name: str, values: NDArray[Any], mask: NDArray[np.bool_] | None, before: Any) -> None:
        """Look for factors around 1, which replace the values that they should scale."""
        rows = np.flatnonzero(np.ones(len(values), bool) if mask is None else mask)[:_WORLDS]
        given = values[rows]
        # an assignment to some entries leaves the others
        near = (given >= _FACTORS[0]) & (given <= _FACTORS[1])
        if not near.any():
            return
        self._compared[name] = self._compared.get(name, 0) + 1
        old = before(name)[rows]
        # 1e30 stands for no limit, which has no factor
        is_scaled = (old != 0.0) & (np.abs(old) < 0.99e30)
        changed = near & (given.astype(np.float32) != old.astype(np.float32)) & is_scaled
        if changed.sum() < _DRAWS_MIN or (changed != (given.astype(np.float32) != old.astype(np.float32))).any():
            return
        drawn, own = given[changed], old[changed]
        low, high = drawn.min(), drawn.max()
        beside = (own < low / _BESIDE) | (own > high * _BESIDE)
        if not low < 1.0 < high or not beside.mean() > _SHARE:
            return
        self._told.add(name)
        cure = (
            "For factors, write body_mass_scale, which scales mass and inertia of a link together"
            if name in ("body_mass", "body_inertia")
            else f"For factors, multiply: factors * sim.params.{name}"
        )
        advice.warn_of_values(
            f"params.{name} gets {low:.3g} to {high:.3g}, which look like factors, and a write replaces the value: "
            f"{own.min():.3g} to {own.max():.3g} before. {cure}"
        )

    def _gravity(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        if not self._has_moving():
            return None
        # the client tells of one number for all axes
        different = values[:, 2] != values[:, 0]
        x, y, z = values.T
        problems = (
            ((z > 0.0) & different, "points up, and z is up"),
            ((z == 0.0) & ((x == 0.0) != (y == 0.0)), "acts along the ground, and z is up"),
            ((np.abs(values) > _GRAVITY_MAX).any(axis=1) & different, "looks like another unit: it is in m/s²"),
        )
        for wrong, problem in problems:
            if (found := np.flatnonzero(wrong)).size:
                shown = ", ".join(f"{value:g}" for value in values[found[0]])
                return f"is ({shown}) in world {rows[found[0]]}, which {problem}: give (0, 0, -9.81)"
        return None

    def _effort(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        driven = np.flatnonzero(np.array(self._info.get("driven", ()), int) & 3)
        if not driven.size or not rows.size or values[:, driven].any():
            return None
        return (
            f"is 0 for all drives, such as `{self._info['dof_names'][driven[0]]}`, so they do nothing: give the "
            "limit of each, or 1e30 for none. To switch drives off, set params.joint_target_ke and joint_target_kd to 0"
        )

    def _mass(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        if (values > 0.0).all():
            return None
        # links of some files have no mass from the start
        wrong = np.argwhere((values <= 0.0) & (before("body_mass")[rows] > 0.0))
        if not len(wrong):
            return None
        world, body = wrong[0]
        return (
            f"of `{self._info['body_names'][body]}` is 0 in world {rows[world]}: forces throw a body without mass "
            "about. Give a mass above 0; body_mass_scale scales mass and inertia together"
        )

    def _inertia(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        parts = values.reshape(len(rows), -1, 6)
        xx, yy, zz, xy, xz, yz = np.moveaxis(parts, -1, 0)
        tensors = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(*xx.shape, 3, 3)
        if not np.isfinite(tensors).all():
            return None  # the daemon refuses them
        moments = np.linalg.eigvalsh(tensors)
        largest = moments[..., 2]
        wrong = (moments[..., 0] <= 0.0) | (moments[..., 0] + moments[..., 1] < (1.0 - _SLACK) * largest)
        if not wrong.any():
            return None
        # files may have such inertias from the start
        changed = (before("body_inertia")[rows].reshape(parts.shape) != parts.astype(np.float32)).any(axis=-1)
        found = np.argwhere(wrong & changed)
        if not len(found):
            return None
        world, body = found[0]
        shown = ", ".join(f"{moment:.3g}" for moment in moments[world, body])
        return (
            f"of `{self._info['body_names'][body]}` has the principal moments ({shown}) in world {rows[world]}, which "
            "no body has: each is above 0 and at most the sum of the others. The order is xx, yy, zz, xy, xz, yz"
        )

    def _friction(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        """Look for static shapes whose coefficient never counts, since all that moves has a larger one."""
        rule = self._tables().get("friction_combine", "max")
        static = np.array(["/" not in name for name in self._info["shape_names"]], bool)
        if rule not in ("max", "min") or self._tables().get("mujoco") or not static.any() or static.all():
            return None
        moving = values[:, ~static]
        hidden = (
            values[:, static] < moving.min(axis=1, keepdims=True)
            if rule == "max"
            else values[:, static] > moving.max(axis=1, keepdims=True)
        )
        if not hidden.all(axis=1).any():
            return None
        hidden &= before("shape_mu")[rows][:, static] != values[:, static].astype(np.float32)
        if not hidden.all(axis=1).any():
            return None
        world, place = (int(index) for index in np.argwhere(hidden)[0])
        name = self._info["shape_names"][int(np.flatnonzero(static)[place])]
        word = "larger" if rule == "max" else "smaller"
        return (
            f"of `{name}` is {values[:, static][world, place]:g} in world {rows[world]} and has no effect: of two "
            f"shapes the {word} coefficient counts, and that of all that moves is {word}. Write theirs too, or choose "
            "another Scene(friction_combine=…)"
        )

    def _tables(self) -> dict[str, Any]:
        if self._scene is None:
            try:
                self._scene = json.loads(_core.parse_scene(self._info["scene"]))
            except TightloopError:  # of another version
                self._scene = {}
        return self._scene or {}

    def _has_moving(self) -> bool:
        """Return whether something may move that MuJoCo did not compile."""
        tables = self._tables()
        return bool(tables.get("robot")) or any(not body.get("fixed", False) for body in tables.get("body", ()))
