"""Tries tightloop with the installed version of MuJoCo, beside that MuJoCo.

    python tests/python/mujoco_versions/smoke.py out/mujoco-versions/files 3.11.0 3.14.0

It writes the exported models and their results to a folder of its version, and runs those of the versions that are
named. `environments.py` runs it in an environment of each version.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from inventory import undecided
from models import MODELS, NEWER, REFUSED, Model
from numpy.typing import NDArray

import tightloop as tl
from tightloop.mujoco import Batch

Array = NDArray[np.float64]

WORLDS = 3
BATCH_CALLS = 12
VERSION = tuple(int(part) for part in mujoco.__version__.split(".")[:2])


def off(ours: Array, theirs: Array) -> float:
    """Largest difference over the largest value, or over 1 if all are small."""
    if not theirs.size:
        return 0.0
    error = np.abs(ours - theirs).max() / max(1.0, np.abs(theirs).max())
    return float(error) if np.isfinite(error) else np.inf


def fields_of(model: mujoco.MjModel) -> tuple[str, ...]:
    """Fields that are compared: those that the model has."""
    sized = {"sensordata": model.nsensordata, "act": model.na, "actuator_force": model.nu}
    return ("qpos", "qvel", "qacc", "xpos", *(name for name, size in sized.items() if size))


def commands(model: mujoco.MjModel, frame: int) -> dict[str, Array]:
    """Controls and places of mocap bodies in a frame; the same for each version."""
    found = {}
    if model.nu:
        found["ctrl"] = 0.8 * np.sin(0.07 * frame + np.arange(model.nu))
    if model.nmocap:
        found["mocap_pos"] = np.array([[0.45, 0.1 * np.sin(0.1 * frame), 1.45]])
        found["mocap_quat"] = np.array([[np.cos(0.02 * frame), 0.0, np.sin(0.02 * frame), 0.0]])
    return found


def started(model: mujoco.MjModel) -> mujoco.MjData:
    """Data at the first keyframe, if there is one."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    return data


@contextmanager
def running(scene: tl.Scene, model: mujoco.MjModel) -> Iterator[tl.Sim]:
    """Launch a scene in double precision, at the first keyframe of its model."""
    with tl.launch(scene, worlds=WORLDS, precision="f64", device="cpu", threads=1, fields=fields_of(model)) as sim:
        if model.nkey:
            sim.reset(keyframe=sim.keyframe_names[0])
        yield sim


def rows(sim: tl.Sim, model: mujoco.MjModel, frames: int) -> Iterator[dict[str, Array]]:
    """Fields of the last world, frame by frame."""
    for number in range(frames):
        frame = sim.step(**commands(model, number))
        assert not frame.status.any(), f"status {frame.status} in frame {number}"
        yield {name: np.array(getattr(frame, name)[-1]) for name in fields_of(model)}


def steps(name: str, case: Model, folder: Path) -> str:
    """Step a model beside MuJoCo, save it, and run what was saved.

    Returns:
        The largest difference.
    """
    model = mujoco.MjModel.from_xml_string(case.xml)
    scene = tl.Scene.from_mujoco(model, name=name)
    scene.save(folder / f"{name}.toml")
    differs = case.before <= VERSION
    assert (case.note in scene.models[name].notes) == differs, f"its notes are {scene.models[name].notes}"
    data, worst, contacts = started(model), 0.0, 0
    data.time = 0.0  # that of a simulation begins at its reset
    ours: dict[str, list[Array]] = {field: [] for field in fields_of(model)}
    theirs: dict[str, list[Array]] = {field: [] for field in ours}
    with running(scene, model) as sim:
        identity = int(sim.info["model_hash"])
        for number, row in enumerate(rows(sim, model, case.frames)):
            for command, values in commands(model, number).items():
                getattr(data, command)[:] = values
            mujoco.mj_step(model, data)
            mujoco.mj_forward(model, data)
            contacts = max(contacts, data.ncon)
            for field, values in row.items():
                expected = np.array(getattr(data, field))
                ours[field].append(values)
                theirs[field].append(expected)
                error = off(values, expected)
                assert error < case.tolerance or differs, f"{field} is off by {error:.1e} in frame {number}"
                worst = max(worst, error)
    assert (contacts > 0) == name.startswith("heap"), f"{contacts} contacts"
    np.savez(folder / f"{name}.npz", **{f"ours.{field}": np.array(all_) for field, all_ in ours.items()})
    np.savez(folder / f"{name}.mujoco.npz", **{field: np.array(all_) for field, all_ in theirs.items()})
    (folder / f"{name}.json").write_text(json.dumps({"model_hash": identity}))
    assert_same(name, model, folder, "the saved scene")
    return f"differs by {worst:.0e}, as noted" if differs else f"within {worst:.0e}"


def assert_same(name: str, model: mujoco.MjModel, folder: Path, what: str) -> None:
    """Run a saved scene: it has the hash and the bits of the scene that was saved."""
    known = np.load(folder / f"{name}.npz")
    with running(tl.Scene.load(folder / f"{name}.toml"), model) as sim:
        identity = json.loads((folder / f"{name}.json").read_text())["model_hash"]
        assert int(sim.info["model_hash"]) == identity, f"{what} has another model hash"
        for number, row in enumerate(rows(sim, model, len(known["ours.qpos"]))):
            for field, values in row.items():
                assert np.array_equal(values, known[f"ours.{field}"][number]), f"{what} has another {field}"


def other_version(folder: Path, other: Path) -> str:
    """Run what another version exported, and compare both.

    Returns:
        What is not the same model.
    """
    apart = [found for name, case in MODELS.items() if (found := difference(name, case, folder, other))]
    return ", ".join(["same results", *apart])


def difference(name: str, case: Model, folder: Path, other: Path) -> str:
    """Return how the model of another version differs, or nothing if it is the same model.

    Results may differ only as far as MuJoCo's own do.
    """
    model, homes = mujoco.MjModel.from_xml_string(case.xml), (folder, other)
    for home in homes:
        assert (home / f"{name}.json").exists(), f"there are no results of {name} with {home.name}"
    assert_same(name, model, other, f"the file of {name}")
    ours, theirs = ([np.load(home / f"{name}{end}") for home in homes] for end in (".npz", ".mujoco.npz"))
    between, apart = (max(off(one[field], two[field]) for field in one.files) for one, two in (ours, theirs))
    hashes = [json.loads((home / f"{name}.json").read_text())["model_hash"] for home in homes]
    if hashes[0] == hashes[1]:
        assert between == 0.0, f"{name} has one hash, but results that differ by {between:.1e}"
        return ""
    # compilers of two versions round differently, or weld other bodies
    assert between <= apart + 2 * case.tolerance, f"{name} differs by {between:.1e}, in MuJoCo by {apart:.1e}"
    return f"{name} within {between:.0e} (MuJoCo: {apart:.0e})"


def batch(case: Model) -> str:
    """Use `tightloop.mujoco.Batch` beside an `MjData` per simulation."""
    model = mujoco.MjModel.from_xml_string(case.xml)
    count, worst = 4, 0.0
    with Batch(model, count, precision="f64", forward=True) as sims:
        assert sims.nstate == mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        names = ("qpos", "qvel", "xpos", "xmat", "cvel", "qacc", "actuator_force", "sensordata")
        bound = {name: sims.bind(name) for name in names}
        ctrl, damping = sims.bind("ctrl"), sims.expand("dof_damping")
        hinges = np.isin(model.jnt_type[model.dof_jntid], (2, 3))
        damping[:, hinges] *= np.linspace(0.5, 2.0, count)[:, None]
        models = [mujoco.MjModel.from_xml_string(case.xml) for _ in range(count)]
        for own, values in zip(models, damping, strict=True):
            own.dof_damping[:] = values
        datas = [started(own) for own in models]
        sims.reset(keyframe=0 if model.nkey else -1)
        for call in range(BATCH_CALLS):
            if call == BATCH_CALLS // 2:
                sims.reset(np.array([1, 3]))
                datas[1], datas[3] = (mujoco.MjData(models[k]) for k in (1, 3))
            ctrl[:] = np.outer(np.arange(1, count + 1) / count, commands(model, call).get("ctrl", ()))
            sims.step(nstep=2)
            for own, data, values in zip(models, datas, ctrl, strict=True):
                data.ctrl[:] = values
                mujoco.mj_step(own, data, 2)
                mujoco.mj_forward(own, data)
            for name, array in bound.items():
                error = off(array, np.array([getattr(data, name) for data in datas]))
                assert error < case.tolerance, f"Batch: {name} is off by {error:.1e} in call {call}"
                worst = max(worst, error)
        queries(sims, model, datas)
        sims.set_const()
    return f"within {worst:.0e}"


def queries(sims: Batch, model: mujoco.MjModel, datas: list[mujoco.MjData]) -> None:
    """Rays, Jacobians, rows of the state and views by name."""
    count = len(datas)
    origin, direction = np.zeros((count, 1, 3)), np.zeros((count, 1, 3))
    origin[..., 2], direction[..., 2] = 5.0, -1.0
    distance, normal = np.zeros((count, 1)), np.zeros((count, 1, 3))
    sims.rays(origin, direction, distance, normal=normal)
    point, body = np.full((count, 3), 0.1), np.full(count, model.nbody - 1, np.int32)
    linear, angular = np.zeros((count, 3, model.nv)), np.zeros((count, 3, model.nv))
    sims.jac(linear, angular, point, body)
    expected, other = np.zeros((3, model.nv)), np.zeros((3, model.nv))
    for sim, data in enumerate(datas):
        mujoco.mj_jac(model, data, expected, other, point[sim], int(body[sim]))
        assert off(linear[sim], expected) < 1e-6 and off(angular[sim], other) < 1e-6, "Batch: Jacobians"
    last = model.joint(model.njnt - 1)
    assert np.array_equal(sims.joint(last.name).qpos, sims.bind("qpos")[:, last.qposadr[0] :]), "Batch: views"
    if model.nsensor and model.sensor(0).name:
        assert sims.sensor(model.sensor(0).name).shape == (count, model.sensor_dim[0])
    state, row = sims.bind("state"), np.empty(sims.nstate)
    before = state.copy()
    mujoco.mj_getState(model, datas[0], row, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert off(state[0, : 1 + model.nq], row[: 1 + model.nq]) < 1e-6, "Batch: rows of the state"
    sims.step()
    ahead = state.copy()
    state[:] = before
    sims.step()
    assert np.array_equal(ahead, state), "Batch: equal rows have other futures"


def refusals() -> str:
    """Every part that tightloop does not support is refused by name."""
    tried = 0
    for what, case in REFUSED.items():
        if case.since > VERSION:
            continue
        model = mujoco.MjModel.from_xml_string(f"<mujoco>{case.xml}</mujoco>")
        try:
            scene = tl.Scene.from_mujoco(model, name="m")
            if case.is_sensor:
                tl.launch(scene, worlds=1, device="cpu", fields=("sensordata",)).close()
        except tl.TightloopError as error:
            assert case.message in str(error), f"{what} is refused by other words: {error}"
        else:
            raise AssertionError(f"{what} is not refused")
        tried += 1
    return f"{tried} by name"


def inventory() -> str:
    """Every part of MuJoCo's model is read, refused or left out on purpose."""
    found = undecided()
    assert not found, f"MuJoCo {mujoco.__version__} has parts that inventory.py does not know: {', '.join(found)}"
    return "complete"


def main(home: Path, others: list[str]) -> int:
    """Run all and print a line for each; 1 if any fails."""
    folder = home / mujoco.__version__
    folder.mkdir(parents=True, exist_ok=True)
    tasks: dict[str, Any] = {"inventory": inventory, "refusals": refusals}
    for name, case in (MODELS | (NEWER if VERSION >= (4, 0) else {})).items():
        tasks[name] = lambda name=name, case=case: steps(name, case, folder)
    for name in ("cart", "machine", "heap"):
        tasks[f"Batch of {name}"] = lambda name=name: batch(MODELS[name])
    for other in others:
        tasks[f"files of {other}"] = lambda other=other: other_version(folder, home / other)
    failed = 0
    for what, task in tasks.items():
        try:
            print(f"  {what}: {task()}", flush=True)
        except Exception as error:
            failed += 1
            print(f"  {what}: FAILS: {type(error).__name__}: {error}", flush=True)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), sys.argv[2:]))
