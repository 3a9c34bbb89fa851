"""Who drives a simulation that is looked at: this viewer, while nobody else does, in real time or a multiple of it."""

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
from tightloop.sim import Sim
from tightloop.view.grip import Grip

# A step that is later than this begins a new count, instead of being caught up with [s].
_LATE_MAX = 0.1
_PACE_SECONDS = 1.0


class Pilot:
    """Steps a daemon for the one who looks. The first use takes the lease, `pause` gives it back.

    Attributes:
        playing: Whether the worlds advance by this viewer.
        speed: Simulated seconds a second; infinite for as fast as it goes.
        problem: Why the last wish was not fulfilled, or nothing.

    Args:
        sim: A client of its own, attached.
        newest: What was shown last: arrays of the first worlds.
    """

    #: A recording has an end, and cannot be pushed.
    live = True

    def __init__(self, sim: Sim, newest: Callable[[], Any]) -> None:
        self.playing = False
        self.speed = 1.0
        self.problem = ""
        self._sim = sim
        self._newest = newest
        self._dt = sim.dt * sim.substeps
        self._wishes: list[Callable[[], None]] = []
        self._targets: NDArray[Any] | None = None
        self._targets_sent = True
        self._grip: Grip | None = None
        self._pushed = False
        self._steps: deque[float] = deque(maxlen=2000)
        self._closed = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._run, name="pilot", daemon=True)
        self._thread.start()

    def check(self) -> None:
        """Ask the daemon something.

        Raises:
            DaemonLost: It is gone.
        """
        self._sim.controller()

    @property
    def controller(self) -> int | None:
        """Process of another client that is in control, if there is one."""
        pid = None
        with contextlib.suppress(TightloopError):  # a daemon that is gone is told elsewhere
            pid = self._sim.controller()
        return None if pid == os.getpid() else pid

    @property
    def pace(self) -> float:
        """Simulated seconds a second that were reached, over the last second."""
        now = time.monotonic()
        return sum(now - at < _PACE_SECONDS for at in tuple(self._steps)) * self._dt / _PACE_SECONDS

    @property
    def can_push(self) -> bool:
        """Whether forces on bodies vary in this run."""
        return "body_f" in self._sim.params.names

    def play(self) -> None:
        """Advance, from now on."""
        self._wish(lambda: None, play=True)

    def pause(self) -> None:
        """Advance no more, and let others take control."""
        with self._changed:
            self.playing = False
            self._wishes.append(lambda: None)
            self._changed.notify_all()

    def step(self) -> None:
        """Advance by one control frame, and stand still."""
        self._wish(self._step, play=False)

    def reset(self, world: int | None) -> None:
        """Put one world, or all, back to the scene's start."""

        def job() -> None:
            mask = None if world is None else np.arange(self._sim.worlds) == world
            self._sim.reset(mask=mask)
            self._targets = None

        self._wish(job)

    def set_target(self, dof: int, value: float, world: int, *, everywhere: bool) -> None:
        """Set a joint's target, and play on towards it.

        Args:
            dof: Its place in ``dof_names``.
            value: The target [rad or m].
            world: The world whose targets are meant.
            everywhere: Whether all worlds get that world's targets.
        """

        def job() -> None:
            targets = self._all_targets(world, everywhere)
            targets[... if targets.ndim == 1 else world, dof] = value
            self._targets, self._targets_sent = targets, False

        self._wish(job, play=True)

    def hold(self, grip: Grip | None) -> None:
        """Pull a body by a spring from now on, and play; None lets it go."""
        self._grip = grip
        if grip is not None:
            self.play()

    def close(self) -> None:
        """Stop, and let others take control."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()
        self._thread.join(timeout=2.0)
        self._sim.close()

    def _wish(self, job: Callable[[], None], *, play: bool | None = None) -> None:
        with self._changed:
            self.problem = ""
            self._wishes.append(job)
            if play is not None:
                self.playing = play
            self._changed.notify_all()

    def _run(self) -> None:
        due = time.monotonic()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._wishes or self.playing)
                # while it plays, the next frame is waited for, unless something is wished for
                if self.playing and not self._wishes:
                    self._changed.wait_for(
                        lambda: self._closed or self._wishes or not self.playing,
                        timeout=max(due - time.monotonic(), 0.0),
                    )
                if self._closed:
                    return
                wishes, self._wishes = self._wishes, []
            try:
                for wish in wishes:
                    wish()
                now = time.monotonic()
                if self.playing and now >= due:
                    self._step()
                    due = (due if now - due < _LATE_MAX else now) + self._dt / self.speed
                elif not self.playing:
                    self._let_go()
            except Exception as problem:  # whatever it is, the page says it, and may go on
                self.playing = False
                self.problem = str(problem)
                if isinstance(problem, DaemonLost):
                    return

    def _step(self) -> None:
        commands: dict[str, Any] = {}
        if not self._targets_sent and self._targets is not None:
            commands["joint_target_q"] = self._targets
        grip = self._grip
        if grip is not None or self._pushed:
            wrench = np.zeros((self._sim.worlds, len(self._sim.body_names), 6))
            if grip is not None:
                wrench[grip.world, grip.body, :3] = grip.force(self._newest())
            commands["body_f"] = wrench
        self._sim.step(**commands)
        self._targets_sent = True
        self._pushed = grip is not None
        self._steps.append(time.monotonic())

    def _let_go(self) -> None:
        if self._pushed:
            self._sim.params.body_f = 0.0
            self._pushed = False
        # whoever drives next sets targets of their own
        self._targets, self._targets_sent = None, True
        self._sim.release()

    def _all_targets(self, world: int, everywhere: bool) -> NDArray[Any]:
        """Targets as a command takes them: ``(dofs,)`` for every world alike, or ``(worlds, dofs)``."""
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
