"""What a page and the loop that steps its worlds tell each other: values to plot, and choices such as policies.

Each message is a line of JSON. The loop's come at the standard input of the page's process, and the page's leave at its
standard output.
"""

from __future__ import annotations

import json
import threading
from collections import deque
from typing import IO, Any, NamedTuple

#: Values that wait for the page, at most.
_WAITING_MAX = 1000


class Values(NamedTuple):
    """Values of the followed world in a step.

    Attributes:
        time: Time since the world's reset [s].
        values: Numbers by name.
    """

    time: float
    values: dict[str, float]


class LoopLink:
    """The page's side.

    Attributes:
        choices: What the loop lets users choose among, in order; the first one is chosen at first.

    Args:
        pipes: Where messages come from, and where they go.
    """

    def __init__(self, pipes: tuple[IO[str], IO[str]]) -> None:
        self.choices: list[str] = []
        self._incoming, self._outgoing = pipes
        self._waiting: deque[Values] = deque(maxlen=_WAITING_MAX)
        self._world = 0
        self._lock = threading.Lock()
        threading.Thread(target=self._listen, name="loop-link", daemon=True).start()

    def take(self) -> list[Values]:
        """Return the values that came since the last call."""
        return [self._waiting.popleft() for _ in range(len(self._waiting))]

    def follow(self, world: int) -> None:
        """Ask for the values of a world."""
        if world != self._world:
            self._world = world
            self._waiting.clear()
            self._say({"world": world})

    def choose(self, choice: str) -> None:
        """Say what was chosen."""
        self._say({"choice": choice})

    def _listen(self) -> None:
        for line in self._incoming:
            message = json.loads(line)
            if "choices" in message:
                self.choices = message["choices"]
            elif message["world"] == self._world:
                self._waiting.append(Values(message["time"], message["values"]))

    def _say(self, message: dict[str, Any]) -> None:
        with self._lock:
            self._outgoing.write(json.dumps(message) + "\n")
            self._outgoing.flush()
