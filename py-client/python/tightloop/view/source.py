"""Where what is shown comes from: a running daemon, which pays next to nothing for it, or a recording."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Sequence
from typing import Any, Protocol

from numpy.typing import NDArray

from tightloop import _core, checks
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

#: What viewers need of every frame; time, step, status and contacts_left_out come with it.
FIELDS = ("body_q", "joint_q", "joint_qd", "joint_target_q")
#: What they need besides to show contacts.
CONTACT_FIELDS = ("contact_count", "contact_pos", "contact_normal", "contact_force")

#: Bits of ``status`` of a world that is frozen: no longer finite, or beyond the bounds of the run.
FROZEN = 1 | 8


def is_recording(target: str) -> bool:
    """Whether a file is meant, and not the name of a daemon."""
    return target.endswith(".tlrec") or "/" in target


class Shown:
    """The worlds at one instant. Attributes are arrays by field, worlds first, as in `Frame`; they are the caller's."""

    def __init__(self, arrays: dict[str, NDArray[Any]]) -> None:
        self.__dict__.update(arrays)

    def __getattr__(self, name: str) -> NDArray[Any]:
        raise UnknownField(f"{name!r} is not shown; there are: {', '.join(self.__dict__)}")


class Source(Protocol):
    """Something that can be looked at.

    Attributes:
        info: What the daemon tells about itself, as `Sim.info`.
        worlds: Worlds that are shown: the first ones.
        period: Simulated time between two control frames [s].
    """

    info: dict[str, Any]
    worlds: int
    period: float

    def poll(self, timeout: float = 0.0) -> Shown | None:
        """The next thing to show, or None if there is nothing new within ``timeout`` [s]."""
        ...

    def rest(self) -> None:
        """Let it cost nothing until the next `poll`."""
        ...

    def close(self) -> None:
        """Let go of it."""
        ...


class Live:
    """The worlds of a running daemon, as its observers see them: some 60 times a second, half as often where they
    see more than 256 worlds.

    The daemon shows the state of its first ``watch_worlds`` worlds; fields are evaluated here, in this process, so that
    any may be asked for, whatever the frames of the daemon carry.

    Args:
        name: Name of the daemon; ``"franka.1"`` is a group of its worlds, and the first one is shown if none is named.
        worlds: How many worlds to show; the ``watch_worlds`` of the daemon if there are fewer.
        fields: What to evaluate.

    Raises:
        UnknownDaemon: No daemon of that name is running; the message lists those that are.
        SceneError: A file of its scene cannot be read here, or has changed.
        UnknownField: There is no such field.
    """

    def __init__(self, name: str, worlds: int = 256, fields: Sequence[str] = (*FIELDS, *CONTACT_FIELDS)) -> None:
        asked = checks.integer("view: worlds", worlds, least=1, error=ArgumentError)
        # of worlds in groups the first is shown, unless another is named
        named = checks.text("view: name", name, error=ArgumentError)
        self._name = named if _core.groups(named) == 1 else f"{named}.0"
        #: When the newest frame came, by the monotonic clock [s].
        self.came = time.monotonic()
        self._closed = False
        self._client: _core.Client | None = _core.Client(self._name, lease=False)
        try:
            self.info: dict[str, Any] = json.loads(self._client.describe())
            self.worlds = min(asked, self.info["watch_worlds"])
            self.period: float = self.info["dt"] * self.info["substeps"]
            self._evaluation = _core.Evaluation(
                self.info["scene"], self.info["scene_folder"], self.worlds, self.info["precision"], list(fields)
            )
            if self._evaluation.model_hash != self.info["model_hash"]:
                raise SceneError(f"the files of simulation `{name}` have changed since it started; launch it again")
        except BaseException:
            self.close()
            raise

    def poll(self, timeout: float = 0.0, patience: float = 0.0) -> Shown | None:
        """The newest state, or None if there is none that was not shown, within ``timeout`` [s].

        Args:
            timeout: How long to wait for one [s].
            patience: How long to wait for the one after it, where one is there already [s]: who polls every other
                frame so sees evenly spaced ones.

        Raises:
            DaemonLost: The daemon went away.
            SimClosed: This was closed.
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
        """Have the daemon show nothing until the next `poll`: what nobody sees costs it nothing."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        """Let go of the daemon, which goes on."""
        self._closed = True
        self.rest()

    def _again(self) -> _core.Client:
        if self._closed:
            raise SimClosed("this view of the simulation was closed")
        try:
            client = _core.Client(self._name, lease=False)
        except UnknownDaemon as gone:
            raise DaemonLost(str(gone)) from gone
        except (ArgumentError, ProtocolMismatch) as other:  # of groups now, or of another version
            raise DaemonRestarted(f"another daemon runs as `{self._name}`: {other}") from other
        if json.loads(client.describe())["session"] != self.info["session"]:
            client.close()
            raise DaemonRestarted(f"another daemon runs as `{self._name}`")
        return client


class Recorded:
    """The frames of a recording (``tightloop record``), run again one after the other.

    Args:
        path: The file.
        worlds: How many worlds to show; those it has if they are fewer.
        fields: What to evaluate.

    Attributes:
        note: What is to be known about it, if anything.

    Raises:
        RecordingError: It cannot be read, is no recording, or its scene's files are not where they were.
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
        """Why there are no more frames, once there are none."""
        return self._playback.end

    def poll(self, timeout: float = 0.0) -> Shown | None:
        """The next frame, or None at the end; it does not wait.

        Raises:
            RecordingError: The file cannot be read further.
        """
        arrays = self._playback.next()
        return None if arrays is None else Shown(arrays)

    def rest(self) -> None:
        """It costs nothing between two polls."""

    def close(self) -> None:
        """Nothing is held that would have to be let go."""
