"""Indices in the arrays of a simulation, by name."""

from __future__ import annotations

from typing import Any

from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError


@checked_calls
class Names:
    """Indices in the arrays of frames and commands, by name.

    Its methods raise `ArgumentError` for a name that the scene does not have; the message lists those it has.

    Attributes:
        coords: Slice of each robot's or free body's entries of ``joint_q``.
        dofs: Slice of its entries of ``joint_qd`` and of commands.
        bodies: Slice of its entries of ``body_q``.
        dof_names: ``robot/joint`` of each dof.
        body_count: Number of bodies, the rows of ``body_q`` and ``body_f``.
        actuator_names: ``model/actuator`` of each actuator, in the order of ``ctrl``.
    """

    def __init__(self, info: dict[str, Any]) -> None:
        self.dof_names: list[str] = info["dof_names"]
        self.body_count = len(info["body_names"])
        self.actuator_names: list[str] = info["actuator_names"]
        self.coords, self.dofs, self.bodies = (
            {robot["name"]: slice(*robot[places]) for robot in info["robots"]}
            for places in ("coords", "dofs", "bodies")
        )
        self._places = {
            "coordinate": info["coord_names"],
            "dof": info["dof_names"],
            "body": info["body_names"],
            "site": info["site_names"],
            "contact sensor": info["contact_sensor_names"],
        }

    def coord(self, name: str) -> int:
        """Return the index of a coordinate, ``robot/joint``, in ``joint_q``."""
        return self._place("coordinate", name)

    def has_coord(self, name: str) -> bool:
        """Return whether there is a coordinate, ``robot/joint``."""
        return name in self._places["coordinate"]

    def dof(self, name: str) -> int:
        """Return the index of a dof, ``robot/joint``, in ``joint_qd`` and in commands."""
        return self._place("dof", name)

    def body(self, name: str) -> int:
        """Return the index of a body, ``robot/link``, in ``body_q`` and the other body fields."""
        return self._place("body", name)

    def site(self, name: str) -> int:
        """Return the index of a site in ``site_q`` and the other site fields."""
        return self._place("site", name)

    def contact_sensor(self, name: str) -> int:
        """Return the index of a contact sensor in ``contact_sensor``."""
        return self._place("contact sensor", name)

    def _place(self, kind: str, name: str) -> int:
        names = self._places[kind]
        if name not in names:
            cure = suggestion(str(name), names) if names else "there are: none"
            raise ArgumentError(f"there is no {kind} {name!r} in the scene; {cure}")
        return names.index(name)
