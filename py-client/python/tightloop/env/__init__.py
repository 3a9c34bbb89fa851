"""Gymnasium environments of tasks in thousands of worlds, for reinforcement learning.

>>> import gymnasium, tightloop.env
>>> envs = gymnasium.make_vec("tightloop/FrankaReach-v0", num_envs=4096)
>>> obs, _ = envs.reset(seed=0)
>>> obs, reward, terminated, truncated, infos = envs.step(envs.action_space.sample())
"""

from __future__ import annotations

from typing import Any

from gymnasium.vector import AutoresetMode

from tightloop.env.controls import (
    ActuatorControl,
    ActuatorTarget,
    EndEffectorDelta,
    Gripper,
    JointDelta,
    JointTarget,
    JointTorque,
)
from tightloop.env.episodes.disturbances import Push
from tightloop.env.groups import make_groups
from tightloop.env.metadata import policy_metadata
from tightloop.env.mirror import Mirror
from tightloop.env.names import Names
from tightloop.env.observed import Observed
from tightloop.env.registration import register
from tightloop.env.single import Env
from tightloop.env.task import Task, Worlds
from tightloop.env.vector import VectorEnv

__all__ = [
    "ActuatorControl",
    "ActuatorTarget",
    "AutoresetMode",
    "EndEffectorDelta",
    "Env",
    "Gripper",
    "JointDelta",
    "JointTarget",
    "JointTorque",
    "Mirror",
    "Names",
    "Observed",
    "Push",
    "Task",
    "VectorEnv",
    "Worlds",
    "make_groups",
    "policy_metadata",
]


def __getattr__(name: str) -> Any:
    if name.startswith("_"):
        raise AttributeError(f"module `tightloop.env` has no attribute `{name}`")
    from tightloop.checks.attributes import suggestion
    from tightloop.errors import UnknownAttribute

    raise UnknownAttribute(f"module `tightloop.env` has no attribute `{name}`; {suggestion(name, __all__)}")


register()
