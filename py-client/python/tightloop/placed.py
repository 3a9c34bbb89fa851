"""What robots and bodies of a scene share: a name, and where their frame stands."""

from __future__ import annotations

from typing import ClassVar

from tightloop import checks
from tightloop.checks import Quaternion, Triple, Vector


class Placed:
    """A part of a scene with a name and a frame in the world."""

    # A misspelt property is an error
    __slots__ = ("_name", "_pos", "_quat")

    #: What it is, for messages.
    kind: ClassVar[str]

    def __init__(self, name: str, pos: Vector, quat: Vector) -> None:
        self._name = name
        self.pos = pos
        self.quat = quat

    @property
    def name(self) -> str:
        """Its name in the scene, which stands before those of its joints and links."""
        return self._name

    @property
    def pos(self) -> Triple:
        """Where its frame, a robot's root link, stands in the world [m]; at the start, if it is free."""
        return self._pos

    @pos.setter
    def pos(self, pos: Vector) -> None:
        self._pos = checks.triple(f"{self.kind} `{self.name}`: pos", pos)

    @property
    def quat(self) -> Quaternion:
        """Orientation of that frame, unit quaternion (x, y, z, w)."""
        return self._quat

    @quat.setter
    def quat(self, quat: Vector) -> None:
        self._quat = checks.quaternion(f"{self.kind} `{self.name}`: quat", quat)
