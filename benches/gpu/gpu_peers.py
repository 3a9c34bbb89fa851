"""MuJoCo-Warp and MJX on the scenes of this bench, where they are installed.

    python -m benches gpu_peers --worlds 1024,4096 --scenes grasp --csv FILE
    python -m benches gpu_peers --scenes out/card/scenes/g1_flat.toml

Needs tightloop (for the scenes) and `mujoco`, and measures those of `mujoco_warp` and `mujoco.mjx` that can be
imported and have a GPU. It prints why it leaves out the others, and scenes that one of them refuses. The models are
MuJoCo's, made of the URDF files that main.rs carries. Of a scene file it is the model beside it (card_scenes.py), with
room for one and a half times the contacts that MuJoCo finds in its run. A frame is what it is there. Commands of all
worlds go to the device, which takes its steps as one recorded graph or one compiled function. Joint positions,
velocities and body poses come back as arrays of the host. Columns are those of run.sh, besides device, commit and date.

Like with like: model, time step, substeps, solver, iterations, cone, single precision, and the commands of world 0. Not
the same: all worlds are identical here, cubes and commands, and contacts are found by each engine's own means.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import importlib
import re
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

BENCHES = Path(__file__).parents[1]
sys.path[:0] = [str(BENCHES), str(BENCHES / "physics")]
sys.path[:0] = [str(BENCHES.parent / "examples"), str(BENCHES.parent / "tests/python/mujoco")]
import contacts  # noqa: E402  (neither benches nor examples are a package)
import franka_grasp as grasp  # noqa: E402
import franka_lesson as lesson  # noqa: E402
import legged  # noqa: E402
from mujoco_model import MujocoModel  # noqa: E402

Array = NDArray[np.float32]
# A frame: commands ``(worlds, controls)`` in, what it shows out
Frame = Callable[[Array], tuple[np.ndarray, ...]]

SUBSTEPS = 8
WARM_UP = 5
# Times the wanted duration, after which a run is left before its end
PATIENCE = 10.0
SCENES = ("torque_free", "target", "grasp", "quadruped")


class Plan:
    """A scene: its model, its start, and the controls of each frame; torques are applied, targets are controls."""

    def __init__(self, name: str) -> None:
        self.name, self.applies, self.substeps = Path(name).stem, name == "torque_free", SUBSTEPS
        self.room: dict[str, int] = {}
        if name.endswith(".toml"):
            self._read(Path(name))
            return
        if name == "quadruped":
            self.model = legged.rival_of(legged.CASES[0])
            self.start = np.r_[[0, 0, 0, 1, 0, 0, 0], self.model.jnt_range[1:].mean(axis=1)]
            self.rows = swings(self.model)
        elif name == "grasp":
            scene = grasp.scene()
            self.model = contacts.own_rival_of("grasp", scene)
            self.start = np.r_[lesson.START, [0.0, -0.35, 0.125, 1, 0, 0, 0]]
            self.rows = grasp.targets()
        else:
            self.model = MujocoModel(lesson.scene(driven=name == "target")).model
            self.model.opt.iterations, self.model.opt.tolerance = 20, 1e-8
            # the reference model's own flag, which MuJoCo-Warp does not know, goes
            self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
            self.start = np.array(lesson.START)
            values = lesson.targets if name == "target" else lesson.torques
            one = np.ones(1)
            self.rows = np.array([values(frame, one)[0] for frame in range(lesson.FRAMES)])
            if name == "target" and self.model.nu == 2 * self.model.nv:
                # the reference model has two actuators a joint, and the second takes a velocity target
                self.rows = np.stack([self.rows, np.zeros_like(self.rows)], axis=-1).reshape(len(self.rows), -1)
        self.rows = self.rows.astype(np.float32)
        if name != "grasp":
            # MJX refuses pairs of shapes that it does not know, contacts or not
            self.model.geom_contype[:] = self.model.geom_conaffinity[:] = 0

    def _read(self, scene: Path) -> None:
        """The model and the controls beside a scene file."""
        binary = gzip.decompress(scene.with_suffix(".mjb.gz").read_bytes())
        self.model = mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": binary})
        self.start = self.model.key_qpos[0] if self.model.nkey else self.model.qpos0
        self.rows = np.loadtxt(scene.with_suffix(".csv"), delimiter=",", dtype=np.float32, ndmin=2)
        substeps = re.search(r"^substeps = (\d+)$", scene.read_text(), re.MULTILINE)
        assert substeps is not None, f"{scene} has no substeps"
        self.substeps = int(substeps[1])
        data, most = self.data(), np.zeros(2)
        for row in self.rows:
            data.ctrl[:] = row
            for _ in range(self.substeps):
                mujoco.mj_step(self.model, data)
                most = np.maximum(most, [data.ncon, data.nefc])
        contacts, rows = (int(1.5 * x) + 16 for x in most)
        self.room = {"nconmax": contacts, "njmax": rows}

    def data(self) -> mujoco.MjData:
        """The start, evaluated."""
        data = mujoco.MjData(self.model)
        data.qpos[:] = self.start
        if self.model.nkey:
            data.qvel[:], data.ctrl[:] = self.model.key_qvel[0], self.model.key_ctrl[0]
            data.act[:] = self.model.key_act[0]
        mujoco.mj_forward(self.model, data)
        return data


def swings(model: mujoco.MjModel) -> Array:
    """Targets of the quadruped [rad], shape ``(frames, joints)``, as benches/robots/mod.rs has them."""
    lower, upper = model.jnt_range[1:].T
    # places among all dofs, of which the free base has six
    share = (np.arange(6, 6 + len(lower)) * 0.618034) % 1.0
    seconds = np.arange(legged.FRAMES)[:, None] / 50
    swing = np.sin(2 * np.pi * ((0.3 + share) * seconds + share))
    return ((lower + upper) / 2 + legged.SWING * (upper - lower) / 2 * swing).astype(np.float32)


def warp(plan: Plan, worlds: int) -> tuple[Frame, Callable[[], None]]:
    """MuJoCo-Warp: a frame, and what puts all worlds back to their start."""
    mjw, wp = importlib.import_module("mujoco_warp"), importlib.import_module("warp")
    data = plan.data()
    model = mjw.put_model(plan.model)
    state = mjw.put_data(plan.model, data, nworld=worlds, **plan.room)
    target = state.qfrc_applied if plan.applies else state.ctrl

    def steps() -> None:
        for _ in range(plan.substeps):
            mjw.step(model, state)

    steps()  # compiles
    graph = None
    if wp.get_device().is_cuda:
        with wp.ScopedCapture() as capture:
            steps()
        graph = capture.graph

    def frame(commands: Array) -> tuple[np.ndarray, ...]:
        wp.copy(target, wp.array(commands, dtype=target.dtype))
        if graph is None:
            steps()
        else:
            wp.capture_launch(graph)
        return state.qpos.numpy(), state.qvel.numpy(), state.xpos.numpy(), state.xquat.numpy()

    def reset() -> None:
        starts = [(state.qpos, plan.start), (state.qvel, data.qvel), (state.qacc_warmstart, data.qacc_warmstart)]
        starts += [(state.act, data.act)] if plan.model.na else []
        for array, values in starts:
            wp.copy(array, wp.array(np.tile(np.float32(values), (worlds, 1)), dtype=array.dtype))

    return frame, reset


def mjx(plan: Plan, worlds: int) -> tuple[Frame, Callable[[], None]]:
    """MJX, likewise."""
    jax, engine = importlib.import_module("jax"), importlib.import_module("mujoco.mjx")
    model = engine.put_model(plan.model)
    start = engine.put_data(plan.model, plan.data())
    name = "qfrc_applied" if plan.applies else "ctrl"

    def steps(data: Any, command: Any) -> Any:
        data = data.replace(**{name: command})
        return jax.lax.fori_loop(0, plan.substeps, lambda _, data: engine.step(model, data), data)

    run = jax.jit(jax.vmap(steps))
    repeat = jax.jit(jax.vmap(lambda _: start))
    state = [repeat(np.arange(worlds))]

    def frame(commands: Array) -> tuple[np.ndarray, ...]:
        state[0] = run(state[0], commands)
        return tuple(
            np.asarray(jax.device_get(getattr(state[0], field))) for field in ("qpos", "qvel", "xpos", "xquat")
        )

    def reset() -> None:
        state[0] = repeat(np.arange(worlds))

    return frame, reset


SIDES = {"mujoco_warp": warp, "mujoco.mjx": mjx}


def warp_device() -> tuple[str, bool]:
    """The device of MuJoCo-Warp, and whether it is a GPU."""
    device = importlib.import_module("warp").get_device()
    return device.name, device.is_cuda


def mjx_device() -> tuple[str, bool]:
    """The device of MJX, and whether it is a GPU."""
    device = importlib.import_module("jax").devices()[0]
    return f"{device.device_kind} ({device.platform})", device.platform in ("gpu", "cuda", "rocm")


DEVICES = {"mujoco_warp": warp_device, "mujoco.mjx": mjx_device}


def meter(device: str) -> Callable[[], float | None]:
    """Reads the energy that the only card of a name has taken [J], once its driver updates it, some ten times a second.

    It reads none without `nvidia-ml-py` and NVIDIA's driver.
    """
    try:
        counters = importlib.import_module("pynvml")
    except ImportError:
        return lambda: None
    try:
        counters.nvmlInit()
        cards = [counters.nvmlDeviceGetHandleByIndex(k) for k in range(counters.nvmlDeviceGetCount())]
        cards = [card for card in cards if counters.nvmlDeviceGetName(card) == device]
        if len(cards) != 1:
            print(f"energy is not measured: {len(cards)} cards are called {device}")
            return lambda: None
        counters.nvmlDeviceGetTotalEnergyConsumption(cards[0])
    except counters.NVMLError as error:
        print(f"energy is not measured: {error}")
        return lambda: None

    def read() -> float | None:
        before, since = counters.nvmlDeviceGetTotalEnergyConsumption(cards[0]), time.perf_counter()
        while time.perf_counter() - since < 1.0:
            now = counters.nvmlDeviceGetTotalEnergyConsumption(cards[0])
            if now != before:
                return 1e-3 * now
        return None

    return read


def measure(
    plan: Plan, side: str, worlds: int, seconds: float, energy: Callable[[], float | None]
) -> dict[str, str | int]:
    """A row: whole runs from the start until the seconds are over."""
    begin = time.perf_counter()
    frame, reset = SIDES[side](plan, worlds)
    commands = [np.tile(row, (worlds, 1)) for row in plan.rows]
    reset()
    frame(commands[0])
    cold = time.perf_counter() - begin
    for row in commands[1:WARM_UP]:
        frame(row)
    times: list[float] = []
    is_cut, shown = False, ()
    before, since = energy(), time.perf_counter()
    while sum(times) < seconds and not is_cut:
        reset()
        for row in commands:
            begin = time.perf_counter()
            shown = frame(row)
            times.append(time.perf_counter() - begin)
            if sum(times) > PATIENCE * seconds:
                is_cut = True
                break
        if not all(np.isfinite(array).all() for array in shown):
            raise ArithmeticError("its worlds are no longer finite")
    steps = worlds * plan.substeps
    after = energy()
    taken = None if before is None or after is None else after - before
    spent = time.perf_counter() - since
    return {
        "scene": plan.name,
        "worlds": worlds,
        "side": side,
        "dofs": plan.model.nv,
        "cold_s": f"{cold:.2f}",
        "steps_per_s": f"{steps / np.median(times):.0f}",
        "steps_per_s_whole": f"{steps * len(times) / sum(times):.0f}",
        "power_w": "–" if taken is None else f"{taken / spent:.0f}",
        "energy_uj": "–" if taken is None else f"{1e6 * taken / (steps * len(times)):.2f}",
        "frame_p50_ms": f"{1e3 * np.median(times):.3f}",
        "frame_p99_ms": f"{1e3 * np.quantile(times, 0.99):.3f}",
        "frames": len(times),
        "cut": "yes" if is_cut else "no",
    }


def installed() -> dict[str, str]:
    """Those that can be imported and have a GPU, with its name; it prints why the others are left out."""
    found = {}
    for side in SIDES:
        try:
            importlib.import_module(side)
            device, is_gpu = DEVICES[side]()
        except Exception as error:  # of a package that is missing, or of a driver that does not answer
            print(f"{side} is not measured: {error}")
            continue
        if is_gpu:
            found[side] = device
        else:
            print(f"{side} is not measured: its device is no GPU but {device}")
    return found


def write(path: Path, rows: list[dict[str, str | int]], *, append: bool) -> None:
    """Write the rows below what they are of, or below the rows of another call."""
    if append:
        lines = (line for line in path.read_text().splitlines() if not line.startswith("#"))
        if next(lines, "") != ",".join(rows[0]):
            raise SystemExit(f"{path}: it has other columns; delete it, or leave `--append` out")
    with path.open("a" if append else "w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        if not append:
            command = " ".join(sys.argv)
            file.write(f"# mujoco: {mujoco.__version__}\n# command: {command}\n# date: {time.strftime('%F')}\n")
            writer.writeheader()
        writer.writerows(rows)


def main() -> int:
    """Measure what is there; 1 where nothing is."""
    parser = argparse.ArgumentParser(description="MuJoCo-Warp and MJX on the scenes of benches/gpu.")
    parser.add_argument("--worlds", default="1024,4096,16384,65536", help="numbers of worlds")
    parser.add_argument("--scenes", default=",".join(SCENES), help="scenes, or scene files that end in .toml")
    parser.add_argument("--seconds", type=float, default=2.0, help="how long each is measured at least")
    parser.add_argument("--csv", type=Path, help="file for the results")
    parser.add_argument("--append", action="store_true", help="add to that file")
    parser.add_argument("--fact", action="append", default=[], help="`commit: NAME`, for the rows")
    parser.add_argument("--installed", action="store_true", help="only say which can be measured; 1 where none can")
    arguments = parser.parse_args()
    facts = dict(fact.split(": ", 1) for fact in arguments.fact)
    of_all = {"commit": facts.get("commit", "unknown"), "date": time.strftime("%F", time.gmtime())}
    sides, rows = installed(), []
    if arguments.installed:
        print(*sides)
        return int(not sides)
    for side, device in sides.items():
        energy = meter(device.removesuffix(" (gpu)").removesuffix(" (cuda)"))
        for name in arguments.scenes.split(","):
            for worlds in map(int, arguments.worlds.split(",")):
                try:
                    row = measure(Plan(name), side, worlds, arguments.seconds, energy) | {"device": device} | of_all
                except Exception as error:  # each engine refuses in its own way
                    print(f"{side} does not run {name} with {worlds} worlds: {type(error).__name__}: {error}")
                    continue
                print("  ".join(f"{name} {value}" for name, value in row.items()))
                rows.append(row)
    if arguments.csv and rows:
        write(arguments.csv, rows, append=arguments.append and arguments.csv.exists())
    return int(not rows)


if __name__ == "__main__":
    sys.exit(main())
