"""Names under which gymnasium finds the environments, once `tightloop.env` has been imported."""

from __future__ import annotations

import math
from typing import Any

#: Where each task is.
TASKS = {
    "CartPoleBalance": "tightloop.tasks.cartpole:CartPoleBalance",
    "CartPoleSwingUp": "tightloop.tasks.cartpole:CartPoleSwingUp",
    "FrankaReach": "tightloop.tasks.reach:FrankaReach",
    "FrankaPushCube": "tightloop.tasks.push_cube:FrankaPushCube",
    "FrankaPickCube": "tightloop.tasks.pick_cube:FrankaPickCube",
    "FrankaLift": "tightloop.tasks.lift:FrankaLift",
}
#: Steps of an episode; the tasks say the same.
EPISODE_STEPS = {
    "CartPoleBalance": 500,
    "CartPoleSwingUp": 500,
    "FrankaReach": 360,
    "FrankaPushCube": 50,
    "FrankaPickCube": 50,
    "FrankaLift": 250,
}


def register() -> None:
    """Tell gymnasium of ``tightloop/FrankaReach-v0`` and its like; done by itself, twice does no harm."""
    import gymnasium

    for task, steps in EPISODE_STEPS.items():
        name = f"tightloop/{task}-v0"
        if name not in gymnasium.registry:
            gymnasium.register(
                name,
                entry_point="tightloop.registration:env",
                vector_entry_point="tightloop.env:VectorEnv",
                max_episode_steps=steps,
                kwargs={"task": task},
            )


def env(**options: Any) -> Any:
    """A single environment for ``gymnasium.make``, which counts the steps of an episode itself."""
    from tightloop.env import Env

    return Env(max_episode_steps=math.inf, **options)
