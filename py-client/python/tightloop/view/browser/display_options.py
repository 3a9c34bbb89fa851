"""What the page shows, as its user chose it. The panel writes these options, the page and its meshes read them."""

from __future__ import annotations

import threading
from dataclasses import dataclass, field
from typing import Any, Literal

Kind = Literal["visual", "collision"]
Contacts = Literal["off", "followed world", "all worlds"]


@dataclass
class DisplayOptions:
    """Display options of a page.

    Attributes:
        kind: How robots are drawn: by their visual meshes or by their collision shapes.
        world: The followed world: ghosts, body frames, plots, sliders and drag forces refer to it.
        alone: Whether only that world is shown.
        ghosts: Whether the robot is also shown at its joint targets.
        frames: Whether the axes of each body are shown.
        contacts: The worlds whose contacts are shown.
        force_scale: Length of a force arrow [m/N].
        follow: Whether the camera follows that world.
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
        """Change options; the next picture uses them."""
        for name, value in choices.items():
            setattr(self, name, value)
        self._changed.set()

    def take_changes(self) -> bool:
        """Return whether an option changed since the last call."""
        changed = self._changed.is_set()
        self._changed.clear()
        return changed
