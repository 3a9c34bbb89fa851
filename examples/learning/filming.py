"""Films of environments, for the examples that show a policy."""

from __future__ import annotations

import time
from pathlib import Path

from tightloop.env import VectorEnv
from tightloop.view import Film
from tightloop.view.subject import subject

MOST = 16  # worlds in a film, if their robots stay where they are
LINES = 5.0  # seconds between two lines


def film_of(envs: VectorEnv, path: Path, camera: str | None) -> Film:
    """A film of several worlds side by side, or of one whose robot walks away: the camera follows it."""
    info = envs.sim.info
    floats = subject(info["scene"], info["scene_folder"], info["body_names"]).floats
    path.parent.mkdir(parents=True, exist_ok=True)
    return Film(path, envs.sim, worlds=1 if floats else min(MOST, envs.num_envs), camera=camera)


class Shooting:
    """Progress of a film: a bar in a terminal, and lines in a file or a pipe."""

    def __init__(self, steps: int | None, name: str) -> None:
        """Show nothing yet.

        Args:
            steps: Steps that there will be at most, if that is known.
            name: What is filmed.
        """
        from tqdm import tqdm

        self._bar = tqdm(total=steps, unit=" steps", desc=name, disable=None)
        self._name, self._steps, self._done = name, steps, 0
        self._begun = self._told = time.monotonic()

    def step(self) -> None:
        """Count a step."""
        self._done += 1
        self._bar.update(1)
        now = time.monotonic()
        if self._bar.disable and now >= self._told + LINES:
            self._told = now
            self._tell(now)

    def close(self) -> None:
        """End the bar, or tell how long it took."""
        self._bar.close()
        if self._bar.disable:
            self._tell(time.monotonic())

    def _tell(self, now: float) -> None:
        of = "" if self._steps is None else f" of at most {self._steps}"
        print(f"{self._name}: {self._done}{of} steps, {now - self._begun:.0f} s", flush=True)
