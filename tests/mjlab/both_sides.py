"""The same task with mjlab's own simulation, on MuJoCo-Warp's CPU device, and with tightloop's."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

import mjlab.tasks  # noqa: F401 - registers the tasks
import mujoco
import numpy as np
import torch
from mjlab.envs import ManagerBasedRlEnv, manager_based_rl_env
from mjlab.scene import Scene
from mjlab.sim import Simulation
from mjlab.tasks.registry import load_env_cfg
from numpy.typing import NDArray

from tightloop.adapters.mjlab.simulation import Simulation as TightloopSimulation

Array = NDArray[Any]

#: Both classes of simulations; nothing calls `install` in this process.
Theirs, Ours = Simulation, TightloopSimulation

#: Parts of names of events that draw fields of the model for all worlds together.
OF_THE_MODEL = ("friction", "base_com")
#: Seed of the environments, and of their first reset.
SEED = 3
#: Frames of the motion, at 50 frames per second.
_FRAMES = 75


def environment(
    task: str,
    simulation: type[Any],
    worlds: int = 8,
    *,
    motion: Path | None = None,
    left_out: tuple[str, ...] = (),
) -> Any:
    """Make an environment of a registered task with a class of simulations.

    Events whose names contain a part of ``left_out`` are removed.
    """
    cfg = load_env_cfg(task)
    cfg.scene.num_envs, cfg.seed = worlds, SEED
    # mjlab's 10 iterations are few now and then, and each solver then stops elsewhere
    cfg.sim.mujoco.iterations, cfg.sim.mujoco.ls_iterations = 100, 50
    for name in [name for name in cfg.events if any(part in name for part in left_out)]:
        cfg.events.pop(name)
    if "motion" in cfg.commands:
        assert motion is not None
        cfg.commands["motion"].motion_file = str(motion)
    with patch.object(manager_based_rl_env, "Simulation", simulation):
        return ManagerBasedRlEnv(cfg, device="cpu")


def motion_file(path: Path) -> Path:
    """Write a motion of the G1 for the tracking tasks: it stands and moves its arms."""
    cfg = load_env_cfg("Mjlab-Tracking-Flat-Unitree-G1")
    model = Scene(cfg.scene, device="cpu").compile()
    data = mujoco.MjData(model)
    robot = [body for body in range(1, model.nbody) if model.body(body).name.startswith("robot/")]
    arms = [joint for joint in range(model.njnt) if "shoulder" in model.joint(joint).name]
    rows: dict[str, list[Array]] = {}
    for frame in range(_FRAMES):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        phase = 2 * np.pi * frame / _FRAMES
        for joint in arms:
            data.qpos[model.jnt_qposadr[joint]] += 0.2 * np.sin(phase)
            data.qvel[model.jnt_dofadr[joint]] = 0.2 * np.cos(phase) * 2 * np.pi / _FRAMES * 50
        mujoco.mj_forward(model, data)
        velocities = np.empty((model.nbody, 6))
        for body in robot:
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, velocities[body], 0)
        found = {
            "joint_pos": data.qpos[7:],
            "joint_vel": data.qvel[6:],
            "body_pos_w": data.xpos[robot],
            "body_quat_w": data.xquat[robot],
            "body_lin_vel_w": velocities[robot, 3:],
            "body_ang_vel_w": velocities[robot, :3],
        }
        for name, value in found.items():
            rows.setdefault(name, []).append(np.array(value))
    np.savez(path, **{name: np.stack(values) for name, values in rows.items()})
    return path


@dataclass
class Step:
    """What an environment has returned, and the states that it went through.

    Attributes:
        values: Terms of observations and rewards by their names.
        states: The state after each substep; of a reset alone the state that it made.
        state: The state that the environment left, after its resets.
        ends: Which worlds ended.
        buried: Worlds with a foot under the ground, whose rays down see none.
    """

    values: dict[str, Array]
    states: list[dict[str, Array]]
    state: dict[str, Array]
    ends: dict[str, Array] = field(default_factory=dict)
    buried: Array | bool = False


def run(env: Any, steps: int, copied: list[Step] | None = None, *, each_substep: bool = False) -> list[Step]:
    """Reset an environment and step it with random actions.

    Args:
        env: The environment.
        steps: Number of control steps.
        copied: A run whose states are copied before each step.
        each_substep: Whether they are also copied after each substep.
    """
    rng = np.random.default_rng(0)
    states: list[dict[str, Array]] = []
    advance = env.sim.step

    def step() -> None:
        advance()
        if copied is not None and each_substep:
            write_state(env, copied[count + 1].states[len(states)])
        states.append(state(env))

    env.sim.step = step
    obs, _ = env.reset(seed=SEED)
    found = [Step(observations(env, obs), [state(env)], state(env), buried=buried(env))]
    for count in range(steps):
        states.clear()
        if copied is not None:
            write_state(env, copied[count].state)
        actions = rng.uniform(-0.5, 0.5, (env.num_envs, env.action_space.shape[-1])).astype(np.float32)
        obs, _, terminated, truncated, _ = env.step(torch.from_numpy(actions))
        rewards = zip(env.reward_manager.active_terms, env.reward_manager._step_reward.T.numpy(), strict=True)
        values = observations(env, obs) | {f"reward {name}": value.copy() for name, value in rewards}
        ends = {"terminated": terminated.numpy().copy(), "truncated": truncated.numpy().copy()}
        found.append(Step(values, list(states), state(env), ends, buried(env)))
    env.sim.step = advance
    return found


def observations(env: Any, obs: dict[str, Any]) -> dict[str, Array]:
    """Return the terms of all groups of observations by their names, each ``(worlds, ...)``."""
    manager, found = env.observation_manager, {}
    for group, terms in manager.active_terms.items():
        if not manager.group_obs_concatenate[group]:
            parts = {term: obs[group][term] for term in terms}
        elif len(manager.group_obs_dim[group]) == 1:
            sizes = [int(np.prod(size)) for size in manager.group_obs_term_dim[group]]
            parts = dict(zip(terms, torch.split(obs[group], sizes, dim=-1), strict=True))
        else:
            parts = {" ".join(terms): obs[group]}
        found |= {f"{group} {term}": part.numpy().copy() for term, part in parts.items()}
    return found


def state(env: Any) -> dict[str, Array]:
    """Return copies of the positions, velocities and activations."""
    return {name: getattr(env.sim.data, name)[:].numpy().copy() for name in ("qpos", "qvel", "act")}


def write_state(env: Any, given: dict[str, Array]) -> None:
    """Write what `state` returned."""
    for name, value in given.items():
        if value.size:
            getattr(env.sim.data, name)[:] = torch.from_numpy(value)


def buried(env: Any) -> Array | bool:
    """Return the worlds in which a ray down from a foot misses the ground."""
    sensor = env.scene.sensors.get("foot_height_scan")
    return False if sensor is None else (sensor.data.distances < 0.0).any(dim=1).numpy()
