"""Steps a daemon for the viewer, in real time or a multiple of it, while no other client is in control."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import CommandRefused, DaemonLost, TightloopError
from tightloop.sim.sim import Sim
from tightloop.view.browser.drag_spring import DragSpring

# A step that is later than this restarts the schedule instead of catching up [s].
_LATE_MAX = 0.1
_PACE_SECONDS = 1.0


class LiveDriver:
    """Steps a daemon for the user of a page. The first command takes the lease, `pause` releases it.

    Attributes:
        playing: Whether this viewer advances the worlds.
        speed: Simulated seconds per second; infinite for as fast as possible.
        problem: Why the last request failed, or empty.

    Args:
        sim: An attached client of its own.
        newest: Returns the last shown frame, with the first worlds.
    """

    #: A live daemon has no end; its bodies can be dragged.
    live = True

    def __init__(self, sim: Sim, newest: Callable[[], Any]) -> None:
        self.playing = False
        self.speed = 1.0
        self.problem = ""
        self._sim = sim
        self._newest = newest
        self._dt = sim.dt * sim.substeps
        self._requests: list[Callable[[], None]] = []
        self._targets: NDArray[Any] | None = None
        self._targets_sent = True
        self._spring: DragSpring | None = None
        self._pushed = False
        self._steps: deque[float] = deque(maxlen=2000)
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="live-driver", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Check that the daemon runs.

        Raises:
            DaemonLost: The daemon went away.
        """
        self._sim.controller()

    @property
    def controller(self) -> int | None:
        """Process id of another client that is in control, or None."""
        pid = None
        with contextlib.suppress(TightloopError):  # a lost daemon is reported elsewhere
            pid = self._sim.controller()
        return None if pid == os.getpid() else pid

    @property
    def pace(self) -> float:
        """Simulated seconds per second, measured over the last second."""
        now = time.monotonic()
        return sum(now - at < _PACE_SECONDS for at in tuple(self._steps)) * self._dt / _PACE_SECONDS

    @property
    def can_push(self) -> bool:
        """Whether ``body_f`` varies in this run, so that bodies can be dragged."""
        return "body_f" in self._sim.params.names

    def play(self) -> None:
        """Start to advance the worlds."""
        self._request(lambda: None, play=True)

    def pause(self) -> None:
        """Stop advancing the worlds, and release control."""
        with self._changed:
            self.playing = False
            self._requests.append(lambda: None)
            self._changed.notify_all()

    def step(self) -> None:
        """Advance by one control frame, then pause."""
        self._request(self._step, play=False)

    def reset(self, world: int | None) -> None:
        """Reset one world, or all of them if ``world`` is None."""

        def job() -> None:
            mask = None if world is None else np.arange(self._sim.worlds) == world
            self._sim.reset(mask=mask)
            self._targets = None

        self._request(job)

    def set_target(self, dof: int, value: float, world: int, *, everywhere: bool) -> None:
        """Set a joint's target and those of the joints that mimic it, and play.

        Args:
            dof: Index of the joint in ``dof_names``.
            value: Target [rad or m].
            world: World whose targets change.
            everywhere: Whether all worlds get the targets of that world.
        """

        def job() -> None:
            targets = self._all_targets(world, everywhere)
            row = ... if targets.ndim == 1 else world
            targets[row, dof] = value
            name = self._sim.dof_names[dof]
            for own in self._sim.info["followers"]:
                if own["leader"] == name:
                    follower = self._sim.dof_names.index(own["name"])
                    targets[row, follower] = own["multiplier"] * value + own["offset"]
            self._targets, self._targets_sent = targets, False

        self._request(job, play=True)

    def drag(self, spring: DragSpring | None) -> None:
        """Pull a body by a spring from now on, and play; None releases the body."""
        self._spring = spring
        if spring is not None:
            self.play()

    def close(self) -> None:
        """Stop the thread, and release control."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout=2.0)
        self._sim.close()

    def _request(self, job: Callable[[], None], *, play: bool | None = None) -> None:
        with self._changed:
            self.problem = ""
            self._requests.append(job)
            if play is not None:
                self.playing = play
            self._changed.notify_all()

    def _run(self) -> None:
        due = time.monotonic()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._requests or self.playing)
                # while playing, wait for the next frame's time unless there is a request
                if self.playing and not self._requests:
                    self._changed.wait_for(
                        lambda: self._closed or self._requests or not self.playing,
                        timeout=max(due - time.monotonic(), 0.0),
                    )
                if self._closed:
                    return
                requests, self._requests = self._requests, []
            try:
                for request in requests:
                    request()
                now = time.monotonic()
                if self.playing and now >= due:
                    self._step()
                    due = (due if now - due < _LATE_MAX else now) + self._dt / self.speed
                elif not self.playing:
                    self._release()
            except Exception as problem:  # the page reports any error and stays usable
                self.playing = False
                self.problem = str(problem)
                if isinstance(problem, DaemonLost):
                    return

    def _step(self) -> None:
        commands: dict[str, Any] = {}
        if not self._targets_sent and self._targets is not None:
            commands["joint_target_q"] = self._targets
        spring = self._spring
        if spring is not None or self._pushed:
            wrench = np.zeros((self._sim.worlds, len(self._sim.body_names), 6))
            if spring is not None:
                wrench[spring.world, spring.body, :3] = spring.force(self._newest())
            commands["body_f"] = wrench
        self._sim.step(**commands)
        self._targets_sent = True
        self._pushed = spring is not None
        self._steps.append(time.monotonic())

    def _release(self) -> None:
        if self._pushed:
            self._sim.params.body_f = 0.0
            self._pushed = False
        # the next controller sets its own targets
        self._targets, self._targets_sent = None, True
        self._sim.release()

    def _all_targets(self, world: int, everywhere: bool) -> NDArray[Any]:
        """Return targets as a command takes them: ``(dofs,)`` for identical worlds, or ``(worlds, dofs)``."""
        shown = np.asarray(self._newest().joint_target_q)
        if everywhere:
            held = self._targets
            return (shown if held is None else np.atleast_2d(held))[
                world if held is None or held.ndim == 2 else 0
            ].copy()
        if self._targets is not None:
            return np.broadcast_to(self._targets, (self._sim.worlds, shown.shape[1])).copy()
        if len(shown) == self._sim.worlds:
            return shown.copy()
        if "joint_target_q" in self._sim.fields:
            return np.array(self._sim.forward().joint_target_q)
        raise CommandRefused(
            f"one world alone can be set where the targets of all {self._sim.worlds} are known: set all worlds, or "
            'launch with fields=("joint_target_q", …)'
        )
