"""Sources of frames for the viewer: a running daemon, with about 1 % overhead, or a recording."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from tightloop import _core
from tightloop.checks import arguments as checks
from tightloop.errors import (
    ArgumentError,
    DaemonLost,
    DaemonRestarted,
    ProtocolMismatch,
    SceneError,
    SimClosed,
    UnknownDaemon,
    UnknownField,
)

#: Fields that viewers need in every frame, besides time, step, status and contacts_left_out.
FIELDS = ("body_q", "joint_q", "joint_qd", "joint_target_q")
#: Further fields to show contacts.
CONTACT_FIELDS = ("contact_count", "contact_pos", "contact_normal", "contact_force")


def is_recording(target: str) -> bool:
    """Return whether a target is a file, not the name of a daemon."""
    return target.endswith(".tlrec") or any(mark in target for mark in ("/", os.sep))


def check_name(target: str) -> None:
    """Refuse a file that is no recording where a daemon is named; groups have names such as ``franka.0``.

    Raises:
        ArgumentError: It is one.
    """
    ending = Path(target).suffix[1:]
    if ending and not ending.isdigit() and Path(target).is_file():
        raise ArgumentError(
            f"{target} is a file and no recording (.tlrec); name a daemon, as `tightloop serve {target} --name NAME` "
            f"starts it, or show a robot or scene by `tightloop demo {target} --view`"
        )


class Shown:
    """The worlds at one instant, as arrays in memory of their own. Attributes are fields, as in `Frame`."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> NDArray[Any]:
        raise UnknownField(f"{name!r} is not shown; there are: {', '.join(self.__dict__)}")


class Source(Protocol):
    """A source of frames.

    Attributes:
        info: The daemon's description of itself, as `Sim.info`.
        worlds: Number of worlds in its frames: the first ones.
        period: Simulated time between two control frames [s].
    """

    info: dict[str, Any]
    worlds: int
    period: float

    def poll(self, timeout: float = 0.0) -> Shown | None:
        """Return the next frame, or None if there is none within ``timeout`` [s]."""
        ...

    def rest(self) -> None:
        """Cause no work until the next `poll`."""
        ...

    def close(self) -> None:
        """Close the source."""
        ...


class Live:
    """The worlds of a running daemon, as its observers see them.

    The daemon publishes the state of its first ``watch_worlds`` worlds about 60 times per second, half as often for
    more than 256 worlds. Fields are evaluated in this process, so that any field is available.

    Args:
        name: Name of the daemon, or of a group such as ``"franka.1"``; the first group if none is named.
        worlds: Largest number of worlds to show; at most the daemon's ``watch_worlds``.
        fields: Fields to evaluate.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
        SceneError: A file of its scene cannot be read here, or has changed.
        UnknownField: There is no such field.
    """

    def __init__(self, name: str, worlds: int = 256, fields: Sequence[str] = (*FIELDS, *CONTACT_FIELDS)) -> None:
        asked = checks.integer("view: worlds", worlds, least=1, error=ArgumentError)
        # with several groups, show the first one unless another is named
        named = checks.text("view: name", name, error=ArgumentError)
        check_name(named)
        self._name = named if _core.groups(named) == 1 else f"{named}.0"
        #: When the newest frame arrived, on the monotonic clock [s].
        self.came = time.monotonic()
        self._closed = False
        self._client: _core.Client | None = _core.Client(self._name, lease=False)
        try:
            self.info: dict[str, Any] = json.loads(self._client.describe())
            self.worlds = min(asked, self.info["watch_worlds"])
            self.period: float = self.info["dt"] * self.info["substeps"]
            self._evaluation = _core.Evaluation(
                self.info["scene"],
                self.info["scene_folder"],
                self.worlds,
                self.info["precision"],
                list(fields),
                drawn=(self.info["first_world"], self.info["draws"], self.info["on_fault"] == "reset"),
            )
            if self._evaluation.model_hash != self.info["model_hash"]:
                raise SceneError(f"the files of simulation `{name}` have changed since it started; launch it again")
        except BaseException:
            self.close()
            raise

    def poll(self, timeout: float = 0.0, patience: float = 0.0) -> Shown | None:
        """Return the newest frame, or None if there is no new one within ``timeout`` [s].

        Args:
            timeout: How long to wait for a frame [s].
            patience: How long to wait for the following frame if one is there already [s], so that a client that
                shows every other frame gets evenly spaced ones.

        Raises:
            DaemonLost: The daemon went away.
            SimClosed: This source was closed.
        """
        client = self._client = self._client or self._again()
        frame = client.latest()
        if frame is None:
            frame = client.wait_newer(timeout) if timeout > 0.0 else None
        elif patience > 0.0:
            frame = client.wait_newer(patience) or frame
        if frame is not None:
            self.came = time.monotonic()
        return None if frame is None else Shown(self._evaluation.evaluate(frame.state))

    def rest(self) -> None:
        """Detach until the next `poll`, so that the daemon publishes no frames."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        """Detach from the daemon, which continues."""
        self._closed = True
        self.rest()

    def _again(self) -> _core.Client:
        if self._closed:
            raise SimClosed("this view of the simulation was closed")
        try:
            client = _core.Client(self._name, lease=False)
        except UnknownDaemon as gone:
            raise DaemonLost(str(gone)) from gone
        except (ArgumentError, ProtocolMismatch) as other:  # it now has groups, or another version
            raise DaemonRestarted(f"another daemon runs as `{self._name}`: {other}") from other
        if json.loads(client.describe())["session"] != self.info["session"]:
            client.close()
            raise DaemonRestarted(f"another daemon runs as `{self._name}`")
        return client


class Recorded:
    """The frames of a recording (``tightloop record``), replayed one after the other.

    Args:
        path: The file.
        worlds: Largest number of worlds to show.
        fields: Fields to evaluate.

    Attributes:
        note: A note on the recording, or None.

    Raises:
        RecordingError: The file cannot be read or is no recording, or files of its scene are missing.
        UnknownField: There is no such field.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        worlds: int = 256,
        fields: Sequence[str] = (*FIELDS, *CONTACT_FIELDS),
    ) -> None:
        asked = checks.integer("view: worlds", worlds, least=1, error=ArgumentError)
        self._playback = _core.Playback(checks.path("view: path", path, error=ArgumentError), asked, list(fields))
        self.info: dict[str, Any] = json.loads(self._playback.describe())
        self.worlds = min(asked, self.info["worlds"])
        self.period: float = self.info["dt"] * self.info["substeps"]
        self.note = self._playback.note

    @property
    def end(self) -> str | None:
        """Why the recording ended, once there are no more frames."""
        return self._playback.end

    def poll(self, timeout: float = 0.0) -> Shown | None:
        """Return the next frame, or None at the end; it does not wait.

        Raises:
            RecordingError: The file cannot be read further.
        """
        arrays = self._playback.next()
        return None if arrays is None else Shown(arrays)

    def rest(self) -> None:
        """Do nothing: a recording causes no work between two polls."""

    def close(self) -> None:
        """Do nothing: no resource is held."""
