"""Plays a recording in the viewer: in real time or a multiple of it, frame by frame, or with skips."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any, Protocol

# Half of the time of a frame at 60 frames per second.
_UNPACED_SECONDS = 0.008
_LATE_MAX = 0.1


class Frames(Protocol):
    """A source of recorded frames."""

    period: float

    def poll(self, timeout: float) -> Any: ...
    def close(self) -> None: ...


class Player:
    """Plays a recording forwards, and restarts it on `reset`.

    Attributes:
        playing: Whether the recording plays.
        speed: Recorded seconds per second; infinite for as fast as possible.
        problem: A message at the end of the recording, else empty.

    Args:
        open_frames: Opens the recording at its start.
    """

    live = False
    can_push = False
    controller = None

    def __init__(self, open_frames: Callable[[], Frames]) -> None:
        self.playing = True
        self.speed = 1.0
        self.problem = ""
        self._open = open_frames
        self._frames = open_frames()
        self._wanted = 1  # frames to show at once: the first one
        self._due = time.monotonic()
        self._restart = False
        self._changed = threading.Condition()

    @property
    def pace(self) -> float:
        """Recorded seconds per second."""
        return self.speed if self.playing else 0.0

    def play(self) -> None:
        """Start to play."""
        self._set(playing=True)

    def pause(self) -> None:
        """Pause."""
        self._set(playing=False)

    def step(self) -> None:
        """Show the next frame, then pause."""
        self._set(playing=False, more=1)

    def skip(self, seconds: float) -> None:
        """Skip forwards by some recorded time [s]."""
        self._set(playing=self.playing, more=max(round(seconds / self._frames.period), 1))

    def reset(self, world: int | None) -> None:
        """Restart the recording; ``world`` has no effect."""
        with self._changed:
            self._restart, self._wanted, self.problem = True, 1, ""
            self._changed.notify_all()

    def poll(self, timeout: float) -> Any:
        """Return the next frame to show, or None if none is due within ``timeout`` [s]."""
        with self._changed:
            now = time.monotonic()
            wait = min(max(self._due - now, 0.0), timeout) if self.playing else timeout
            self._changed.wait_for(lambda: self._wanted or self._restart, timeout=wait)
            if self._restart:
                self._frames.close()
                self._frames, self._restart = self._open(), False
            wanted, self._wanted = self._wanted, 0
            now = time.monotonic()
            if not wanted and self.playing and now >= self._due:
                # frames that the page is too late for are dropped
                late = now - self._due
                wanted = 1 + int(late / self._spacing) if self._spacing > 0 and late < _LATE_MAX else 1
                self._due = (self._due if late < _LATE_MAX else now) + wanted * self._spacing
        shown = None
        # at infinite speed, read as many frames as the time allows
        until = now + _UNPACED_SECONDS if wanted and self.playing and self._spacing == 0 else now
        while wanted > 0 or time.monotonic() < until:
            wanted -= 1
            following = self._frames.poll(0.0)
            if following is None:
                self.playing, self.problem = False, "the recording ends here"
                break
            shown = following
        return shown

    @property
    def _spacing(self) -> float:
        return self._frames.period / self.speed

    def close(self) -> None:
        """Close the file."""
        self._frames.close()

    def _set(self, *, playing: bool, more: int = 0) -> None:
        with self._changed:
            self.playing = playing
            self.problem = ""
            self._wanted += more
            self._due = time.monotonic()
            self._changed.notify_all()
