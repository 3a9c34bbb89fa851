"""A MuJoCo model in a scene."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tightloop import _core
from tightloop.checks.arguments import Vector
from tightloop.checks.signatures import checked_calls
from tightloop.errors import SceneError, UnknownAttribute
from tightloop.mujoco import position_actuators
from tightloop.scene.actuated_joints import chosen, gains
from tightloop.scene.entity import Entity


@checked_calls
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
    def cameras(self) -> dict[str, dict[str, Any]]:
        """The model's cameras by name: ``link``, ``pos``, ``quat``, ``resolution``, and ``fov`` or ``focal``."""
        return {camera["name"]: camera for camera in self._summary["cameras"]}

    @property
    def tendon_names(self) -> list[str]:
        """Names of the tendons, in the order of ``ten_length``."""
        return list(self._summary["tendon_names"])

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

    def add_position_actuators(
        self,
        joints: str | Sequence[str] = ".*",
        *,
        stiffness: float,
        damping: float,
        effort_limit: float | None = None,
    ) -> list[str]:
        """Give hinges and slides position actuators, such as those of a file that has none.

        Each is MuJoCo's ``<position>`` with ``kp`` and ``kv``: ``force = stiffness * (ctrl - q) - damping * qd``. It
        has the name of its joint, and its control is clamped to the range of the joint. As in MuJoCo, controls are 0 at
        the start. After a reset to a keyframe, they are the positions of the joints there.

        Args:
            joints: Names of joints, or regular expressions for whole names.
            stiffness: Gain of each [N·m/rad or N/m].
            damping: Damping of each [N·m·s/rad or N·s/m].
            effort_limit: Largest force of each [N·m or N]; no limit if left out.

        Returns:
            The names of the new actuators; commands have the model's name before them, ``model/joint``.

        Raises:
            SceneError: No joint matches, a joint has an actuator already, or a value is wrong.
            MissingLibrary: The extra ``mujoco`` is not installed.
        """
        subject = self._subject()
        stiffness, damping, limit = gains(subject, stiffness, damping, effort_limit)
        places = {self.dof_names[dof]: joint for dof, joint in position_actuators.joints_of(self.file).items()}
        names = chosen(subject, joints, list(places), ())
        driven = position_actuators.driven_joints(self.file)
        for name in names:
            if places[name] in driven or name in self.actuator_names:
                raise SceneError(
                    f"{subject}: add_position_actuators: joint `{name}` has an actuator already; command "
                    "it by `ctrl`, and name the other joints here"
                )
        own = {places[name]: name for name in names}
        file = position_actuators.added(self.file, own, stiffness, damping, math.inf if limit is None else limit)
        self._summary = json.loads(_core.read_mujoco(str(file), self.mesh_max_hull_vertices))
        self.file = file
        self._changed("add_position_actuators")
        return names

    def table(self) -> dict[str, Any]:
        """Return the model as a table of a scene file."""
        return {
            "name": self.name,
            "model": str(self.file),
            "pos": self.pos,
            "quat": self.quat,
            "mesh_max_hull_vertices": self.mesh_max_hull_vertices,
        }

    def _refused(self, name: str) -> UnknownAttribute:
        if name.startswith("joint_target"):
            return UnknownAttribute(
                f"{self._subject()} has no attribute {name!r}, since its actuators drive it; "
                "`add_position_actuators` adds some"
            )
        return super()._refused(name)

    def __repr__(self) -> str:
        dofs, actuators = len(self.dof_names), len(self.actuator_names)
        return f"MujocoModel({self.name!r}, dofs={dofs}, actuators={actuators})"
