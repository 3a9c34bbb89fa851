"""What the page shows, as the one who looks chose it; the panel writes it, the stage reads it."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["visual", "collision"]
Contacts = Literal["off", "followed world", "all worlds"]


@dataclass
class Looks:
    """Choices of the one who looks.

    Attributes:
        kind: What robots look like: their visual meshes or the shapes that touch.
        world: The world that is followed: ghosts, frames, plots, sliders and pushes are of it.
        alone: Whether it is shown alone.
        ghosts: Whether the robot is shown at its joint targets, too.
        frames: Whether the axes of each body are shown.
        contacts: In which worlds contacts are shown.
        force_scale: Length of an arrow [m/N].
        follow: Whether the camera goes along with the followed world.
    """

    kind: Kind = "visual"
    world: int = 0
    alone: bool = False
    ghosts: bool = False
    frames: bool = False
    contacts: Contacts = "off"
    force_scale: float = 0.02
    follow: bool = False
    _changed: threading.Event = field(default_factory=threading.Event, repr=False)

    def choose(self, **choices: Any) -> None:
        """Change what is shown, from the next picture on."""
        for name, value in choices.items():
            setattr(self, name, value)
        self._changed.set()

    def take_changes(self) -> bool:
        """Whether anything changed since this was asked last."""
        changed = self._changed.is_set()
        self._changed.clear()
        return changed
