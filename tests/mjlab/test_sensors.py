"""Sensors of contacts and rays, beside MuJoCo C."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest
import torch
from both_sides import OF_THE_MODEL, SEED, Ours, Theirs, run, write_state
from numpy.typing import NDArray

#: Scale of forces at a foot: the weight of a robot. Small forces are differences of large ones. [N]
FORCE = 100.0


@pytest.mark.parametrize("task", ["Mjlab-Velocity-Flat-Unitree-G1", "Mjlab-Velocity-Flat-Unitree-Go1"])
def test_forces_at_feet_are_those_of_mujoco_c(task: str, env_of: Callable[..., Any]) -> None:
    # C has the model's own values
    # MuJoCo C has the model without what events draw
    env = env_of(task, Ours, 4, left_out=OF_THE_MODEL)
    model, sim = env.sim.mj_model, env.sim
    data, solved = mujoco.MjData(model), 0
    names = [name for name in (model.sensor(i).name for i in range(model.nsensor)) if "feet_ground" in name]
    forces = [name for name in names if name.endswith("force")]
    found = [name.removesuffix("force") + "found" for name in forces]
    assert set(found) <= set(names)
    for step in run(env, 20)[1:]:
        write_state(env, step.state)
        sim.data.sensordata[:]
        sim.step()
        ours, ctrl = sim.data.sensordata[:].numpy().astype(np.float64), sim.data.ctrl[:].numpy()
        for world, (qpos, qvel) in enumerate(zip(step.state["qpos"], step.state["qvel"], strict=True)):
            mujoco.mj_resetData(model, data)
            data.qpos[:], data.qvel[:], data.ctrl[:] = qpos, qvel, ctrl[world]
            mujoco.mj_step(model, data)
            if any(ours[world, columns(model, name)] != data.sensordata[columns(model, name)] for name in found):
                # rounding decides whether one more end of a foot touches
                continue
            solved += 1
            for name in forces:
                off = np.abs(ours[world, columns(model, name)] - data.sensordata[columns(model, name)]).max()
                assert off <= 1e-4 * FORCE, (name, world, off)
    assert solved > 60


def columns(model: Any, name: str) -> slice:
    """Return the columns of a sensor in ``sensordata``."""
    sensor = model.sensor(name)
    return slice(sensor.adr[0], sensor.adr[0] + sensor.dim[0])


def scan(env: Any, name: str) -> dict[str, NDArray[Any]]:
    """Return the rays of a sensor and what they met."""
    sensor = env.scene[name]
    parts = ("pnt", "vec", "dist", "normal", "geomid")
    return {part: getattr(sensor, f"_ray_{part}").numpy().copy() for part in parts}


def test_rays_of_a_height_scan_meet_what_those_of_mujoco_warp_meet(env_of: Callable[..., Any]) -> None:
    envs = [env_of("Mjlab-Velocity-Rough-Unitree-Go1", side) for side in (Theirs, Ours)]
    for env in envs:
        env.reset(seed=SEED)
    for name in ("terrain_scan", "foot_height_scan"):
        theirs, ours = (scan(env, name) for env in envs)
        # MuJoCo-Warp misses a height field from below its surface
        hits = theirs["dist"] >= 0.0
        assert hits.mean() > 0.9
        assert np.array_equal(theirs["geomid"][hits], ours["geomid"][hits])
        for part in ("dist", "normal"):
            assert np.abs(theirs[part][hits] - ours[part][hits]).max() <= 1e-4
    assert torch.equal(
        envs[0].scene["terrain_scan"].data.distances >= 0, envs[1].scene["terrain_scan"].data.distances >= 0
    )
