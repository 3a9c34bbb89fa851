"""What a page is fed from: a daemon that runs, or a recording of one, each with who drives it."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from tightloop.launching import attach
from tightloop.view.pilot import Pilot
from tightloop.view.player import Player
from tightloop.view.source import CONTACT_FIELDS, Live, Recorded, is_recording

#: So many are shown as often as the daemon does, more of them half as often.
FEW_WORLDS = 16
# Of 60 frames a second every other one has come by then, after the one before.
_EVERY_OTHER_SECONDS = 0.036
# While nobody looks, it is seen this often whether the daemon is there.
_THERE_SECONDS = 1.0
#: What is always asked for; contacts and plots ask for more.
FIELDS = ("body_q", "body_qd", "joint_q", "joint_target_q")


class LiveFeed:
    """Frames of a daemon as observers see them.

    Args:
        name: Of the daemon.
        worlds: The most worlds to show.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
    """

    def __init__(self, name: str, worlds: int) -> None:
        self._name = name
        self._most = worlds
        self._fields = frozenset(FIELDS)
        self._newest: Any = None
        self._seen = time.monotonic()
        self._source = Live(name, worlds, FIELDS)
        self.info: dict[str, Any] = self._source.info
        self.worlds: int = self._source.worlds
        #: What is to be known about what is shown.
        self.told: list[str] = []
        if self.worlds < min(worlds, self.info["worlds"]):
            cure = "launch(watch_worlds=…) or serve --watch-worlds let it show more"
            self.told.append(f"the daemon shows its first {self.worlds} worlds of {self.info['worlds']}; {cure}")
        self.driver = Pilot(attach(self.info["name"]), lambda: self._newest)

    @property
    def came(self) -> float:
        """When the newest frame came, by the monotonic clock [s]."""
        return self._source.came

    def poll(self, timeout: float) -> Any:
        """The newest frame, None if none came in that time [s].

        Raises:
            DaemonLost: The daemon went away.
        """
        patience = 0.0
        if self.worlds > FEW_WORLDS:
            patience = max(self.came + _EVERY_OTHER_SECONDS - time.monotonic(), 0.0)
        shown = self._source.poll(timeout, patience)
        if shown is not None:
            self._newest = shown
        return shown

    def want(self, fields: Iterable[str]) -> None:
        """Have frames carry these fields, too, from now on."""
        wanted = self._fields | set(fields)
        if wanted != self._fields:
            before = self._source
            self._source = Live(self._name, self._most, tuple(sorted(wanted)))
            self._fields = wanted
            before.close()

    def rest(self) -> None:
        """Ask the daemon for nothing until the next `poll`, but whether it is there.

        Raises:
            DaemonLost: The daemon went away.
        """
        self._source.rest()
        now = time.monotonic()
        if now - self._seen > _THERE_SECONDS:
            self._seen = now
            self.driver.check()

    def close(self) -> None:
        """Detach; the daemon goes on."""
        self.driver.close()
        self._source.close()


class RecordedFeed:
    """Frames of a recording.

    Args:
        path: The file.
        worlds: The most worlds to show.
    """

    def __init__(self, path: str, worlds: int) -> None:
        self._path = str(Path(path).expanduser().absolute())
        self._most = worlds
        # a recording is opened once: what any choice may need is evaluated at once
        self._fields = frozenset((*FIELDS, *CONTACT_FIELDS))
        first = self._open()
        self.info: dict[str, Any] = first.info
        self.worlds: int = first.worlds
        self.told: list[str] = [] if first.note is None else [first.note]
        first.close()
        self.driver = Player(self._open)
        #: When the newest frame came, by the monotonic clock [s].
        self.came = time.monotonic()

    def _open(self) -> Recorded:
        return Recorded(self._path, self._most, tuple(sorted(self._fields)))

    def poll(self, timeout: float) -> Any:
        """The frame that is due, None if none is in that time [s]."""
        shown = self.driver.poll(timeout)
        self.came = time.monotonic()
        return shown

    def want(self, fields: Iterable[str]) -> None:
        """Have frames carry these fields, too; the recording then begins anew."""
        wanted = self._fields | set(fields)
        if wanted != self._fields:
            self._fields = wanted
            self.driver.reset(None)

    def rest(self) -> None:
        """Between two polls nothing is played."""

    def close(self) -> None:
        """Close the file."""
        self.driver.close()


Feed = LiveFeed | RecordedFeed


def open_feed(target: str, worlds: int) -> Feed:
    """The feed of a daemon's name or a recording's path, with at most so many worlds."""
    return RecordedFeed(target, worlds) if is_recording(target) else LiveFeed(target, worlds)
