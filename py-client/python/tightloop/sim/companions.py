"""What ends with a simulation: its viewers, recorders and planners, its connection, and the daemon that it launched."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Protocol

from tightloop import _core
from tightloop.sim.daemon import Daemon


class Companion(Protocol):
    """What ends with a simulation, such as its viewers."""

    def close(self) -> None:
        """End it; a second call does nothing."""


def end(client: _core.Client, daemon: Daemon | None, name: str, owner: int, companions: Iterable[Companion]) -> None:
    """End a simulation with its companions.

    Args:
        client: Its connection.
        daemon: The daemon that it launched; None if it attached to one.
        name: Its name.
        owner: The process that made it.
        companions: What ends first.
    """
    # a forked child must not close what belongs to its parent
    if os.getpid() != owner:
        return
    # the last one in is the first one out, and each runs whatever another one raises
    with ExitStack() as rest:
        if daemon is None:
            rest.callback(_core.sweep, name)  # does nothing while the daemon lives
        else:
            rest.callback(daemon.leave)
        rest.callback(client.close)
        for companion in reversed([*companions]):
            rest.callback(companion.close)
