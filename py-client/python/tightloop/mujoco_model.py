"""A MuJoCo model in a scene."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from tightloop.checks import Vector
from tightloop.entity import Entity


class MujocoModel(Entity):
    """A MuJoCo model in a scene; `Scene.add_mujoco` returns it.

    Its ``pos`` and ``quat`` place the model's world in the scene.
    """

    __slots__ = ("_summary", "file", "mesh_max_hull_vertices")

    kind = "MuJoCo model"

    def __init__(
        self,
        name: str,
        *,
        file: Path,
        pos: Vector,
        quat: Vector,
        mesh_max_hull_vertices: int,
        summary: dict[str, Any],
    ) -> None:
        super().__init__(name, pos, quat)
        #: The exported file, which tightloop reads without MuJoCo.
        self.file = file
        self.mesh_max_hull_vertices = mesh_max_hull_vertices
        self._summary = summary

    @property
    def actuator_names(self) -> list[str]:
        """Names of the actuators, in the order of ``ctrl``."""
        return list(self._summary["actuator_names"])

    @property
    def dof_names(self) -> list[str]:
        """Names of the dofs, in MuJoCo's order."""
        return list(self._summary["dof_names"])

    @property
    def coord_names(self) -> list[str]:
        """Names of the position coordinates, in the order of ``joint_q``, which has quaternions as (x, y, z, w)."""
        return list(self._summary["coord_names"])

    @property
    def body_names(self) -> list[str]:
        """Names of the bodies, the world first, in MuJoCo's order."""
        return list(self._summary["link_names"])

    @property
    def site_names(self) -> list[str]:
        """Names of the sites, in the order of ``site_xpos``."""
        return list(self._summary["site_names"])

    @property
    def geom_names(self) -> list[str]:
        """Names of the geoms, in the order of ``geom_xpos``."""
        return list(self._summary["geom_names"])

    @property
    def sensor_names(self) -> list[str]:
        """Names of the sensors, in the order of ``sensordata``."""
        return list(self._summary["sensor_names"])

    @property
    def notes(self) -> list[str]:
        """What was changed when the model was read, a sentence each."""
        return list(self._summary["notes"])

    @property
    def options(self) -> dict[str, Any]:
        """The model's ``dt``, ``gravity`` and ``solver``, as a scene has them."""
        return dict(self._summary["options"])

    def table(self) -> dict[str, Any]:
        """Return the model as a table of a scene file."""
        return {
            "name": self.name,
            "model": str(self.file),
            "pos": self.pos,
            "quat": self.quat,
            "mesh_max_hull_vertices": self.mesh_max_hull_vertices,
        }

    def __repr__(self) -> str:
        dofs, actuators = len(self.dof_names), len(self.actuator_names)
        return f"MujocoModel({self.name!r}, dofs={dofs}, actuators={actuators})"
