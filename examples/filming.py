"""Films of environments, for the examples that show a policy."""

from __future__ import annotations

from pathlib import Path

from tightloop.env import VectorEnv
from tightloop.view import Film
from tightloop.view.subject import subject

MOST = 16  # worlds in a film, if their robots stay where they are


def film_of(envs: VectorEnv, path: Path, camera: str | None) -> Film:
    """A film of several worlds side by side, or of one whose robot walks away: the camera follows it."""
    info = envs.sim.info
    floats = subject(info["scene"], info["scene_folder"], info["body_names"]).floats
    path.parent.mkdir(parents=True, exist_ok=True)
    return Film(path, envs.sim, worlds=1 if floats else min(MOST, envs.num_envs), camera=camera)
