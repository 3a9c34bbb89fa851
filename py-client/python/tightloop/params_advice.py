"""Parameters that are written while a simulation runs and are most likely a mistake: told once, with the cure."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop import _core, advice
from tightloop.errors import TightloopError

#: Writes that are looked at, and worlds of each: such a mistake is in all of them.
_WRITES, _WORLDS = 256, 16
#: An inertia may be off from that of a body by this share, as rounding makes it [–].
_SLACK = 1e-6


class ParamsAdvice:
    """Looks at writes of parameters as the daemon looks at the scene.

    Args:
        info: The daemon's description.
    """

    def __init__(self, info: Mapping[str, Any]) -> None:
        self._info = info
        self._writes = 0
        self._told: set[str] = set()
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
        for name in given.keys() & looks.keys() - self._told:
            rows = np.flatnonzero(np.ones(len(given[name]), bool) if mask is None else mask)[:_WORLDS]
            problem = looks[name](given[name][rows], rows, before)
            if problem:
                self._told.add(name)
                advice.warn_of_values(f"params.{name} {problem}")

    def _gravity(self, values: NDArray[Any], rows: NDArray[Any], before: Any) -> str | None:
        wrong = np.flatnonzero((values[:, 2] > 0.0) & (values[:, 2] != values[:, 0]))
        if not len(wrong) or not self._has_loose():
            return None
        x, y, z = (f"{value:g}" for value in values[wrong[0]])
        return f"is ({x}, {y}, {z}) in world {rows[wrong[0]]}, which points up, and z is up: give (0, 0, -9.81)"

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

    def _has_loose(self) -> bool:
        """Return whether something floats above a ground."""
        tables = self._tables()
        floats = any(robot.get("floating") for robot in tables.get("robot", ()))
        floats |= any(not body.get("fixed", False) for body in tables.get("body", ()))
        return floats and any(shape["type"] in ("ground", "plane") for shape in tables.get("shape", ()))
