"""The base class of robots and bodies in a scene: a name and a pose."""

from __future__ import annotations

from typing import ClassVar

from tightloop.checks import arguments as checks
from tightloop.checks.arguments import Quaternion, Triple, Vector
from tightloop.checks.attributes import Attributes
from tightloop.checks.running import Running


class Entity(Attributes):
    """A named part of a scene with a pose in the world."""

    __slots__ = ("_name", "_pos", "_quat", "_running")

    #: Kind of entity, for messages.
    kind: ClassVar[str]

    def __init__(self, name: str, pos: Vector, quat: Vector) -> None:
        self._name = name
        # of the scene that it becomes part of
        self._running: Running | None = None
        self.pos = pos
        self.quat = quat

    def _changed(self, attribute: str) -> None:
        running = getattr(self, "_running", None)  # which a copy gets last
        if running is not None:
            moves = getattr(self, "floating", not getattr(self, "fixed", True))
            running.tell(self._subject(), attribute, self._name, moves=moves)

    def _subject(self) -> str:
        return f"{self.kind} `{self.name}`"

    @property
    def name(self) -> str:
        """Name in the scene; it precedes the names of its joints and links."""
        return self._name

    @property
    def pos(self) -> Triple:
        """Position of the frame (of a robot: its root link) in the world [m]; the start position if it moves freely."""
        return self._pos

    @pos.setter
    def pos(self, pos: Vector) -> None:
        self._pos = checks.triple(f"{self.kind} `{self.name}`: pos", pos)

    @property
    def quat(self) -> Quaternion:
        """Orientation of the frame, unit quaternion (x, y, z, w)."""
        return self._quat

    @quat.setter
    def quat(self, quat: Vector) -> None:
        self._quat = checks.quaternion(f"{self.kind} `{self.name}`: quat", quat)
