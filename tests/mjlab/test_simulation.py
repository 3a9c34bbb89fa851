"""`Simulation` itself: resets, faults, fields that mjlab reads and writes, and fields of the model."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
import torch
from both_sides import OF_THE_MODEL, SEED, Ours, Theirs, state, write_state
from mjlab.sim import SimulationCfg
from mjlab.utils.nan_guard import NanGuard

import tightloop as tl

#: A pendulum with a motor, a free box above a plane, and a filtered actuator, so that there are activations.
SCENE = """
<mujoco>
  <worldbody>
    <geom name="ground" type="plane" size="5 5 1"/>
    <body name="arm" pos="0 0 2">
      <joint name="shoulder" axis="0 1 0" damping="0.1"/>
      <geom name="rod" type="capsule" fromto="0 0 0 0.5 0 0" size="0.03" contype="0" conaffinity="0"/>
    </body>
    <body name="box" pos="1 0 0.5">
      <freejoint name="box"/>
      <geom name="box" type="box" size="0.1 0.1 0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><general name="motor" joint="shoulder" dyntype="filter" dynprm="0.1" gainprm="3"/></actuator>
</mujoco>
"""
#: Single precision against single precision, over 5 steps.
TOLERANCE = 1e-4
TASK = "Mjlab-Velocity-Flat-Unitree-Go1"
Make = Callable[..., Any]


@pytest.fixture
def sim_of(made: Callable[[Any], Any]) -> Make:
    """Makes a simulation of `SCENE` with one of both classes."""

    def make(side: type[Any] = Ours, worlds: int = 4) -> Any:
        return made(side(worlds, SimulationCfg(), mujoco.MjModel.from_xml_string(SCENE), "cpu"))

    return make


def after(sim: Any, steps: int) -> dict[str, Any]:
    """Step a simulation and return its state."""
    for _ in range(steps):
        sim.step()
    return {name: getattr(sim.data, name)[:].numpy().copy() for name in ("qpos", "qvel", "act")}


def assert_close(one: dict[str, Any], other: dict[str, Any]) -> None:
    for name, value in one.items():
        assert np.abs(value - other[name]).max() <= TOLERANCE * max(1.0, np.abs(value).max()), name


def stepped(env: Any, steps: int) -> None:
    """Step an environment with random actions."""
    rng = np.random.default_rng(1)
    for _ in range(steps):
        actions = rng.uniform(-0.5, 0.5, (env.num_envs, env.action_space.shape[-1])).astype(np.float32)
        env.step(torch.from_numpy(actions))


def test_a_reset_of_some_worlds_leaves_the_bits_of_the_others(env_of: Make) -> None:
    env = env_of(TASK, Ours)
    env.reset(seed=SEED)
    stepped(env, 5)
    before = state(env)
    env.reset(env_ids=torch.tensor([1, 6]))
    now, others = state(env), [0, 2, 3, 4, 5, 7]
    for name in before:
        assert before[name][others].tobytes() == now[name][others].tobytes()
    assert (before["qpos"][[1, 6]] != now["qpos"][[1, 6]]).any(axis=1).all()


def test_a_seed_gives_the_same_bits_again(env_of: Make) -> None:
    found = []
    for _ in range(2):
        env = env_of(TASK, Ours)
        env.reset(seed=SEED)
        stepped(env, 10)
        found.append((state(env), env.obs_buf["critic"].numpy().tobytes()))
    assert found[0][1] == found[1][1]
    assert all(found[0][0][name].tobytes() == found[1][0][name].tobytes() for name in found[0][0])


def test_twice_the_worlds_change_no_bit_of_the_first_ones(env_of: Make) -> None:
    # random values of the model depend on the number of worlds
    half, whole = (env_of(TASK, Ours, worlds, left_out=OF_THE_MODEL) for worlds in (8, 16))
    for env in (half, whole):
        env.reset(seed=SEED)
    write_state(whole, {name: np.concatenate([value, value]) for name, value in state(half).items()})
    rng = np.random.default_rng(1)
    for _ in range(40):
        ctrl = torch.from_numpy(rng.uniform(-0.5, 0.5, tuple(half.sim.data.ctrl.shape)).astype(np.float32))
        half.sim.data.ctrl[:], whole.sim.data.ctrl[:] = ctrl, torch.cat([ctrl, ctrl])
        for env in (half, whole):
            env.sim.step()
    first, both = state(half), state(whole)
    for name, value in first.items():
        assert value.tobytes() == both[name][:8].tobytes() == both[name][8:].tobytes()


@pytest.mark.parametrize("value", [float("nan"), 1e30])
def test_a_world_with_a_fault_is_flagged_alone_until_its_reset(value: float, sim_of: Make) -> None:
    sim, untouched = sim_of(), sim_of()
    for each in (sim, untouched):
        each.step()
    sim.data.qvel[2] = value
    for number in range(6):
        if number == 3:
            sim.reset(torch.tensor([2]))
            sim.forward()
        for each in (sim, untouched):
            each.step()
        flags = NanGuard.detect_nans(sim.data).numpy()
        assert flags.tolist() == [False, False, number < 3, False]
        for name in ("qpos", "qvel", "act"):
            one, other = (getattr(each.data, name)[:].numpy()[[0, 1, 3]] for each in (sim, untouched))
            assert one.tobytes() == other.tobytes()
    fresh = sim_of()
    assert after(fresh, 3)["qpos"][2].tobytes() == sim.data.qpos[2].numpy().tobytes()


@pytest.mark.parametrize("name", ["ctrl", "qfrc_applied"])
def test_a_fault_is_flagged_to_whom_asks_only_then(name: str, sim_of: Make) -> None:
    sim = sim_of()
    sim.step()
    getattr(sim.data, name)[2] = float("nan")
    sim.step()
    assert NanGuard.detect_nans(sim.data).tolist() == [False, False, True, False]
    sim.reset(torch.tensor([2]))
    sim.step()
    assert not NanGuard.detect_nans(sim.data).any()


def test_a_field_that_is_not_filled_is_named(sim_of: Make) -> None:
    sim = sim_of()
    for name in ("efc", "contact", "qM"):
        if hasattr(sim._wp_data, name):
            with pytest.raises(AttributeError, match=rf"sim\.data\.{name}: .* there are .*xpos"):
                getattr(sim.data, name)
    with pytest.raises(AttributeError, match="no_such_field"):
        _ = sim.data.no_such_field


def test_a_gpu_is_refused_by_its_name() -> None:
    model = mujoco.MjModel.from_xml_string(SCENE)
    with pytest.raises(tl.ArgumentError, match=r"cuda:0.*device='cpu'"):
        Ours(2, SimulationCfg(), model, "cuda:0")


@pytest.mark.parametrize("name", ["xfrc_applied", "qfrc_applied"])
def test_a_force_that_is_written_pushes_as_with_mujoco_warp(name: str, sim_of: Make) -> None:
    both, still = [sim_of(side) for side in (Theirs, Ours)], sim_of()
    for sim in both:
        sim.data.qvel[:, 4:7] = torch.tensor([1.0, 2.0, 3.0])
        force = torch.tensor([3.0, -2.0, 5.0, 0.1, 0.2, -0.1])
        target = sim.data.xfrc_applied[1:3, 2] if name == "xfrc_applied" else sim.data.qfrc_applied[1:3, 1:]
        target[:] = force
        sim.data.qfrc_applied[0, 0] = 0.5
    still.data.qvel[:, 4:7] = torch.tensor([1.0, 2.0, 3.0])
    theirs, ours = (after(sim, 1) for sim in both)
    assert_close(theirs, ours)
    assert (np.abs(ours["qvel"] - after(still, 1)["qvel"]).max(axis=1) > 1e-3).tolist() == [True, True, True, False]
    theirs, ours = (after(sim, 9) for sim in both)
    assert_close(theirs, ours)
    for sim in both:
        sim.data.xfrc_applied[:] = 0.0
        sim.data.qfrc_applied[:] = 0.0
    assert_close(*(after(sim, 10) for sim in both))


def test_a_force_that_is_not_finite_loses_its_world_alone(sim_of: Make) -> None:
    sim = sim_of()
    sim.step()
    sim.data.xfrc_applied[1, 2, 0] = math.nan
    sim.step()
    lost = [False, True, False, False]
    assert torch.isnan(sim.data.qpos).any(dim=1).tolist() == lost
    assert torch.isnan(sim.data.qacc).any(dim=1).tolist() == lost
    sim.reset(torch.tensor([1]))
    sim.step()
    assert torch.isfinite(sim.data.qpos).all()
    assert torch.isfinite(sim.data.qacc).all()


def test_commands_and_activations_act_as_with_mujoco_warp(sim_of: Make) -> None:
    both = [sim_of(side) for side in (Theirs, Ours)]
    for sim in both:
        sim.data.ctrl[:, 0] = torch.tensor([0.0, 1.0, -1.0, 2.0])
        sim.data.act[3] = 0.5
    theirs, ours = (after(sim, 20) for sim in both)
    assert_close(theirs, ours)
    assert len(np.unique(ours["act"])) == 4


def test_damping_per_world_acts_as_with_mujoco_warp(sim_of: Make) -> None:
    both = [sim_of(side) for side in (Theirs, Ours)]
    for sim in both:
        sim.expand_model_fields(("dof_damping",))
        assert "dof_damping" in sim.expanded_fields
        sim.model.dof_damping[:, 0] = torch.tensor([0.0, 1.0, 2.0, 5.0])
        sim.data.qvel[:, 0] = 3.0
    theirs, ours = (after(sim, 5) for sim in both)
    assert_close(theirs, ours)
    assert len(np.unique(ours["qvel"][:, 0])) == 4


def test_a_field_that_does_not_vary_is_refused_with_its_world(sim_of: Make) -> None:
    sim = sim_of()
    sim.expand_model_fields(("geom_size",))
    sim.step()
    sim.model.geom_size[2, 2] = 0.2
    with pytest.raises(tl.ArgumentError, match="2: geom_size"):
        sim.step()


@pytest.mark.parametrize(
    ("name", "cure"),
    [
        ("body_mass", r"call sim\.expand_model_fields\(\(\"body_mass\",\)\) before you write it"),
        ("jnt_stiffness", "set it in the config of the environment instead"),
        ("opt.gravity", "set it in the config of the environment instead"),
        ("opt.timestep", "set it in the config of the environment instead"),
    ],
)
@pytest.mark.parametrize("inference", [False, True])
def test_a_write_that_does_not_reach_the_worlds_is_refused(name: str, cure: str, inference: bool, sim_of: Make) -> None:
    sim = sim_of()
    sim.step()
    with torch.inference_mode(inference):
        home = sim.model.opt if name.startswith("opt.") else sim.model
        field = getattr(home, name.removeprefix("opt."))
        # all worlds share the row; torch refuses to write it for each of them
        before = field[0].clone()
        field[0] = before
        sim.step()
        field[0] = 2.0 * before + 1.0
        for call in (sim.step, sim.forward):
            with pytest.raises(tl.ArgumentError, match=rf"sim\.model\.{re.escape(name)} was written.*{cure}"):
                call()
        field[0] = before
        sim.step()


@pytest.mark.parametrize("worlds", [1, 4])
def test_a_field_that_is_read_anew_is_compared_with_its_start(worlds: int, sim_of: Make) -> None:
    sim = sim_of(worlds=worlds)
    start = sim.model.body_mass[0].clone()
    sim.model.body_mass[0] = 2.0 * start
    sim.expand_model_fields(("geom_rgba",))  # makes new tensors of all fields
    field = sim.model.body_mass
    with pytest.raises(tl.ArgumentError, match=r"sim\.model\.body_mass was written"):
        sim.step()
    field[0] = start
    sim.step()
    field[0] = 3.0 * start
    with pytest.raises(tl.ArgumentError, match=r"sim\.model\.body_mass was written"):
        sim.step()


def test_a_field_that_is_expanded_again_keeps_its_values(sim_of: Make) -> None:
    sim = sim_of()
    for _ in range(2):
        sim.expand_model_fields(("body_mass",))
        sim.model.body_mass[1, -1] *= 2.0
    assert len(np.unique(sim.model.body_mass[:, -1])) == 2
    assert sim.model.body_mass[1, -1] == 4.0 * sim.model.body_mass[0, -1]
    sim.step()


def test_install_replaces_the_simulation_in_every_module(tmp_path: Path) -> None:
    code = (
        "from tightloop.adapters import mjlab; ours = mjlab.install()\n"
        "import mjlab.sim, mjlab.sim.sim, mjlab.envs.manager_based_rl_env as env\n"
        "assert ours is mjlab.sim.Simulation is mjlab.sim.sim.Simulation is env.Simulation\n"
        "from tightloop.adapters import mjlab; assert mjlab.install() is ours\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=tmp_path)


def test_scripts_of_mjlab_run(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "tightloop.mjlab"]
    listed = subprocess.run([*command, "list-envs"], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert "Mjlab-Cartpole-Balance" in listed.stdout
    options = "--env.scene.num-envs 8 --agent.max-iterations 1 --agent.logger tensorboard --gpu-ids None".split()
    trained = subprocess.run(
        [*command, "train", "Mjlab-Cartpole-Balance", *options],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"WANDB_MODE": "disabled"},
        check=False,
    )
    assert trained.returncode == 0, trained.stderr[-2000:]
    assert list(tmp_path.rglob("model_*.pt"))
