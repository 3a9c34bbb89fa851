"""Films of a policy while it is trained, made by another process so that the training goes on.

The process gets a snapshot of the policy, steps worlds of its own at low priority, and ends with its parent.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from learning.filming import film_of
from tightloop import system
from tightloop.env import VectorEnv

SECONDS = 10.0  # of a film, at most
FILMED = 4  # worlds in it
NICENESS = 10  # about a tenth of a busy core
STOP_SECONDS = 10.0  # to wait for the end of a film that is given up
CHILD = "import sys; sys.path.insert(0, sys.argv[1]); from learning import films; films.film(*sys.argv[2:])"


class Films:
    """A film of the policy every so many minutes, ``FOLDER/films/STEPS.mp4``."""

    def __init__(self, task: str, made: Mapping[str, Any], folder: Path, minutes: float, threads: int) -> None:
        """Make no film yet.

        Args:
            task: Name of the task.
            made: How the task is made.
            folder: Folder of the run.
            minutes: Between two films; 0 for none.
            threads: Most threads that a step of the simulation may use.
        """
        self._about = {"task": task, "made": dict(made), "threads": threads}
        self._folder, self._spacing = folder / "films", 60.0 * minutes
        self._next: float | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._film = Path()

    def take(self, save: Callable[[Path, str], None], seconds: float, steps: int) -> str | None:
        """Begin a film, if it is time to; returns what went wrong with films, if anything did.

        Args:
            save: Writes a snapshot of the policy to a file, with a text about the film.
            seconds: Time since the start of the run.
            steps: Env steps since then, the name of the film.
        """
        if not self._spacing:
            return None
        # a run that was resumed makes no films of the time before
        due = self._next is not None and seconds >= self._next
        if due or self._next is None:
            self._next = self._spacing * (seconds // self._spacing + 1.0)
        if not due:
            return None
        if self._process is not None and self._process.poll() is None:
            return f"{self._film.name} is not done, so there is no film of {steps} steps; film less often"
        problem = self._ended()
        self._folder.mkdir(parents=True, exist_ok=True)
        self._film = self._folder / f"{steps}.mp4"
        snapshot = self._film.with_suffix(".pt")
        save(snapshot, json.dumps(self._about, default=str))
        here = str(Path(__file__).parents[1])
        command = [sys.executable, "-c", CHILD, here, str(snapshot), str(self._film), str(os.getpid())]
        self._process = system.start_apart(command)
        return problem

    def finish(self) -> str | None:
        """Wait for the film that is being made; returns what went wrong with it, if anything did."""
        if self._process is not None and self._process.poll() is None:
            print(f"waiting for {self._film}", flush=True)
            self._process.wait()
        return self._ended()

    def close(self) -> None:
        """Give up the film that is being made, if one is."""
        if self._process is not None and self._process.poll() is None:
            system.ask_to_end(self._process)
            try:
                self._process.wait(STOP_SECONDS)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        self._ended()

    def _ended(self) -> str | None:
        process, self._process = self._process, None
        if process is None:
            return None
        assert process.stdout is not None
        process.stdout.close()
        # where it was killed
        self._film.with_suffix(".pt").unlink(missing_ok=True)
        if process.returncode == 0:
            return None
        return f"{self._film} was not made: its process ended with exit code {process.returncode}"


def film(snapshot: str, out: str, parent: str) -> None:
    """Film the policy of a snapshot, in the process that `Films` starts; ends when its parent does."""
    system.give_way(NICENESS)
    for number in system.stop_signals():
        signal.signal(number, lambda *_: sys.exit(1))
    import torch

    from learning.agent import Agent
    from learning.estimator import Sight

    torch.set_num_threads(1)
    state = torch.load(snapshot, weights_only=True)
    Path(snapshot).unlink()
    agent = Agent(*state["sizes"], sight=Sight(*state["sight"]) if state["sight"] else None)
    agent.load_state_dict(state["agent"])
    about = json.loads(state["about"])
    envs = VectorEnv(about["task"], FILMED, threads=about["threads"], render_mode="rgb_array", **about["made"])
    try:
        system.give_way_as_session(envs.sim.pid, NICENESS)
        obs, _ = envs.reset(seed=0)
        steps = min(envs.max_episode_steps or 10**9, round(SECONDS / envs.control_dt))
        with film_of(envs, Path(out), None) as made, torch.no_grad():
            for _ in range(steps):
                if system.is_orphan(int(parent)):
                    sys.exit(1)
                made.add(envs.frame, goals=envs.marks)
                obs = envs.step(agent(torch.from_numpy(obs).float()).numpy())[0]
    finally:
        envs.close()
