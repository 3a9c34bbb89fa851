"""Registration of the tasks with gymnasium; importing `tightloop.env` does it."""

from __future__ import annotations

import math
from typing import Any

from tightloop.env.registry import GYMNASIUM_TASKS, gymnasium_id
from tightloop.env.single import Env

#: Control steps of an episode, as each task's ``max_episode_steps``.
EPISODE_STEPS = {
    "CartPoleBalance": 500,
    "CartPoleSwingUp": 500,
    "FrankaReach": 360,
    "FrankaPushCube": 50,
    "FrankaPickCube": 50,
    "FrankaPickCubeDepth": 50,
    "FrankaLift": 250,
    "QuadrupedVelocityFlat": 1000,
    "QuadrupedVelocityRough": 1000,
    "HumanoidVelocityFlat": 1000,
    "AntRun": 1000,
}

#: The same of gymnasium's tasks, as gymnasium's own.
GYMNASIUM_STEPS = dict.fromkeys(GYMNASIUM_TASKS, 1000) | {"Pusher-v5": 100, "Reacher-v5": 50}


def register() -> None:
    """Register ``tightloop/FrankaReach-v0`` and the other tasks with gymnasium; a second call does nothing."""
    import gymnasium

    for task, steps in (EPISODE_STEPS | GYMNASIUM_STEPS).items():
        name = gymnasium_id(task)
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="tightloop.env.registration:single_env",
                vector_entry_point="tightloop.env:VectorEnv",
                max_episode_steps=steps,
                kwargs={"task": task},
            )


def single_env(**options: Any) -> Any:
    """Make a single environment for ``gymnasium.make``, whose own wrapper counts the steps of an episode."""
    return Env(max_episode_steps=math.inf, **options)
