"""Steps per second of published MuJoCo models beside PyPI's mjbatch, on one thread each, in one run.

    make bench-mujoco             # brings the models first
    python -m benches mujoco_models

mjbatch steps MuJoCo C, in a process with an environment and a MuJoCo of its own (out/mjbatch, made by the first run).
tightloop steps the same models through `sim.step`, and through `tightloop.mujoco.Batch`.
benches/physics/mujoco_robots.py says where the models are from, and benches/physics/mujoco_heaps.py has the legged
robots in a heap (`--models heap`). Without the wheels' files in out/menagerie and out/published, or a reference folder,
their models are left out.

Every world has ctrl of its own: sums of a few sines inside ctrlrange, drawn before the clock starts, the same numbers
for all sides. tightloop first runs the worlds until the robots stand or lie in contact; all sides begin there. Then
they take turns, so that a machine that changes its speed meanwhile changes all of them; ratios are taken within a turn,
and the first turn is dropped. `cpu_ratio` compares steps per second of processor time, of client and daemon together,
which other programs change less. Each model is measured with a call per physics step, and with one per control step of
its owner's task. Writes benches/results/MACHINE/mujoco_models.csv.

Like with like: one file, time step, integrator, cone, iterations, no sensors; states and controls pass through NumPy.
Not the same: MuJoCo computes in double precision, tightloop in single; where a model asks for MuJoCo's PGS (gymnasium's
Humanoid), tightloop uses Newton's method.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from mujoco_robots import ROBOTS, Robot, contacts_of, start_of
from numpy.typing import NDArray
from tqdm import tqdm

import tightloop as tl
from tightloop.mujoco import Batch
from tightloop.mujoco.batch.joints import JointMap

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

ENVIRONMENT = REPOSITORY / "out/mjbatch"
REQUIREMENTS = REPOSITORY / "py-client/requirements-mjbatch.txt"
REFERENCE = REPOSITORY.parent / "shared/reference"
# Controls repeat after so long [s], or after so many calls; fastest sine [Hz]; sines of an actuator
PERIOD, CALLS_MAX, FREQUENCY_MAX, SINES = 2.0, 400, 2.5, 3
# Bits of `status`
FROZEN, UNCONVERGED, LEFT_OUT = 1 | 8, 2, 4
# Worlds whose contacts are counted
SAMPLED = 128

State = dict[str, NDArray[Any]]


def mjbatch_python() -> Path:
    """Python of the environment with mjbatch, which is made where it is missing."""
    python = ENVIRONMENT / "bin/python"
    if not python.exists():
        print(f"installing mjbatch into {ENVIRONMENT.relative_to(REPOSITORY)}", flush=True)
        venv.create(ENVIRONMENT, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", "-r", REQUIREMENTS], check=True)
    return python


class Peer:
    """A side in a process of its own. `ask` names a method of the class `Side` in its program."""

    def __init__(self, name: str, command: Sequence[str | Path], environ: Mapping[str, str] | None = None) -> None:
        self._name = name
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environ and os.environ | environ
        )
        self.versions = self._answer()

    def _answer(self) -> dict[str, Any]:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit(f"{self._name} ended; its error is above")
        return json.loads(line)

    def ask(self, do: str, **arguments: Any) -> dict[str, Any]:
        """Have it do something, and return its answer."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({"do": do, **arguments}) + "\n")
        self._process.stdin.flush()
        return self._answer()

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


class Mjbatch(Peer):
    """mjbatch, in an environment of its own; for `ask` see benches/physics/mjbatch_side.py."""

    def __init__(self, side: str = "physics/mjbatch_side.py") -> None:
        super().__init__("mjbatch", [mjbatch_python(), REPOSITORY / "benches" / side])


class Native:
    """tightloop's own interface; the steps of a call are substeps of one control frame."""

    def __init__(self, model: mujoco.MjModel, given: NDArray[np.float32], nstep: int) -> None:
        self.model, self.given, self.nstep, self.calls = model, given, nstep, 0
        scene = tl.Scene.from_mujoco(model)
        scene.substeps = nstep
        names = ("qpos", "qvel", "act") if model.na else ("qpos", "qvel")
        self.sim = tl.launch(scene, worlds=given.shape[1], threads=1, device="cpu", fields=names)
        self.fields = names

    @property
    def daemon(self) -> int:
        """Its process."""
        return self.sim.pid

    def place(self, state: State) -> None:
        """Put every world where it begins."""
        joints = JointMap(self.model)
        act = {"act": state["act"]} if self.model.na else {}
        velocities = joints.velocities(state["qpos"], state["qvel"])
        self.sim.write(joint_q=joints.positions(state["qpos"]), joint_qd=velocities, **act)

    def call(self) -> None:
        """One call of a step."""
        self.frame = self.sim.step(ctrl=self.given[self.calls % len(self.given)])
        self.calls += 1

    def state(self) -> State:
        """Where the worlds are, `(worlds, …)` each."""
        return {name: np.array(getattr(self.frame, name), dtype=float) for name in self.fields}

    def close(self) -> None:
        """End the daemon."""
        self.sim.close()


class Batched:
    """tightloop behind the interface of mjbatch."""

    def __init__(self, model: mujoco.MjModel, given: NDArray[np.float32], nstep: int) -> None:
        self.given, self.nstep, self.calls = given, nstep, 0
        self.batch = Batch(model, given.shape[1], num_threads=1)
        self.arrays = {name: self.batch.bind(name) for name in ("qpos", "qvel", "act")[: 3 if model.na else 2]}
        self.ctrl = self.batch.bind("ctrl")

    @property
    def daemon(self) -> int:
        """Its process; the first call launches a new one."""
        return self.batch.sim.pid

    def place(self, state: State) -> None:
        """Put every world where it begins."""
        for name, array in self.arrays.items():
            array[:] = state[name]

    def call(self) -> None:
        """One call of a step."""
        self.ctrl[:] = self.given[self.calls % len(self.given)]
        self.batch.step(nstep=self.nstep)
        self.calls += 1

    def close(self) -> None:
        """End the daemon."""
        self.batch.close()


def controls(robot: Robot, model: mujoco.MjModel, nstep: int, worlds: int) -> NDArray[np.float32]:
    """Random smooth ctrl that repeats without a jump, `(calls, worlds, actuators)`."""
    rng = np.random.default_rng(0)
    calls = min(round(PERIOD / (nstep * model.opt.timestep)), CALLS_MAX)
    waves = max(int(FREQUENCY_MAX * calls * nstep * model.opt.timestep), 1)
    low, high = model.actuator_ctrlrange.T
    shape = (SINES, worlds, model.nu)
    cycles, phase, part = rng.integers(1, waves + 1, shape), rng.uniform(0, 1, shape), rng.uniform(0, 1, shape)
    part *= rng.uniform(0, robot.swing, shape[1:]) / part.sum(axis=0) * (high - low) / 2
    center = start_of(robot, model).ctrl
    given = np.empty((calls, *shape[1:]), np.float32)
    for call in range(calls):
        sines = part * np.sin(2 * np.pi * (cycles * (call / calls) + phase))
        given[call] = np.clip(center + sines.sum(axis=0), low, high)
    return given


def turn(side: Native | Batched, seconds: float) -> tuple[float, float]:
    """Physics steps of one world per second by the clock, over at least so many seconds, and per CPU second."""

    def used() -> float:
        stat = Path(f"/proc/{side.daemon}/stat").read_text().rpartition(")")[2].split()
        return time.process_time() + (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")

    calls, before, begin = 0, used(), time.perf_counter()
    while (passed := time.perf_counter() - begin) < seconds:
        side.call()
        calls += 1
    steps = calls * side.given.shape[1] * side.nstep
    return steps / passed, steps / (used() - before)


def settled(robot: Robot, model: mujoco.MjModel, worlds: int, seconds: float) -> State:
    """Where the worlds are after so much simulated time; a faulted one is left out for its neighbour."""
    data = start_of(robot, model)
    side = Native(model, controls(robot, model, robot.substeps, worlds), robot.substeps)
    try:
        start = {name: np.tile(getattr(data, name), (worlds, 1)) for name in side.fields}
        side.place(start)
        for _ in range(max(round(seconds / (robot.substeps * model.opt.timestep)), 1)):
            side.call()
        state, healthy = side.state(), np.flatnonzero(side.frame.status & FROZEN == 0)
    finally:
        side.close()
    if len(healthy) < worlds:
        print(f"{robot.name}: {worlds - len(healthy)} of {worlds} worlds faulted before the measurement")
    return {name: array[np.resize(healthy, worlds)] for name, array in state.items()}


class Case:
    """A model with so many physics steps per call, and its rates, one a turn."""

    def __init__(self, robot: Robot, model: mujoco.MjModel, nstep: int, state: State, peer: Mjbatch) -> None:
        self.robot, self.model, self.nstep, self.peer = robot, model, nstep, peer
        self.worlds = len(state["qpos"])
        given = controls(robot, model, nstep, self.worlds)
        self.native, self.batched = Native(model, given, nstep), Batched(model, given, nstep)
        with tempfile.TemporaryDirectory() as folder:
            start, ctrl = f"{folder}/state.npz", f"{folder}/ctrl.npy"
            np.savez(start, allow_pickle=False, **state)
            np.save(ctrl, given)
            peer.ask("start", worlds=self.worlds, nstep=nstep, state=start, ctrl=ctrl)
        self.native.place(state)
        self.batched.place(state)

    def measure(self, turns: int, seconds: float) -> dict[str, str | int]:
        """Take turns; the first one warms caches and clocks, and is dropped."""
        sides: dict[str, Callable[[], tuple[float, float]]] = {
            "mjbatch": lambda: self.peer.ask("turn", seconds=seconds)["rates"],
            "native": lambda: turn(self.native, seconds),
            "batch": lambda: turn(self.batched, seconds),
        }
        rates: dict[str, list[tuple[float, float]]] = {name: [] for name in sides}
        statuses = []
        for _ in range(1 + turns):
            for name, side in sides.items():
                rates[name].append(side())
            statuses.append(np.array(self.native.frame.status))
        # by the clock, then per CPU second
        theirs, ours, batch = (np.array(rates[name][1:]).T for name in sides)
        state = {name: array[:SAMPLED] for name, array in self.native.state().items()}
        ctrl = self.native.given[(self.native.calls - 1) % len(self.native.given), :SAMPLED]
        contacts, iterations = contacts_of(self.model, state, ctrl)
        their = self.peer.ask("end", sampled=SAMPLED)
        ratio, cpu_ratio = ours / theirs
        return {
            "device": self.native.sim.device,
            "model": self.robot.name,
            "dofs": int(self.model.nv),
            "steps_per_call": self.nstep,
            "worlds": self.worlds,
            "contacts": f"{contacts:.1f}",
            "mjbatch_contacts": f"{their['contacts']:.1f}",
            "mujoco_iterations": f"{iterations:.1f}",
            "mjbatch_steps_per_s": f"{np.median(theirs[0]):.0f}",
            "tightloop_steps_per_s": f"{np.median(ours[0]):.0f}",
            "median_ratio": f"{np.median(ratio):.2f}",
            "ratio_min": f"{ratio.min():.2f}",
            "ratio_max": f"{ratio.max():.2f}",
            "cpu_ratio": f"{np.median(cpu_ratio):.2f}",
            "batch_steps_per_s": f"{np.median(batch[0]):.0f}",
            "batch_ratio": f"{np.median(batch[0] / theirs[0]):.2f}",
            "faulted": int(np.count_nonzero(statuses[-1] & FROZEN)),
            "mjbatch_unstable": their["unstable"],
            "unconverged_percent": f"{100 * np.mean([status & UNCONVERGED > 0 for status in statuses]):.1f}",
            "contacts_left_out_percent": f"{100 * np.mean([status & LEFT_OUT > 0 for status in statuses]):.1f}",
        }

    def close(self) -> None:
        """End both daemons."""
        self.native.close()
        self.batched.close()


def rows_of(robot: Robot, peer: Mjbatch, options: argparse.Namespace) -> list[dict[str, str | int]]:
    """The rows of a model; none where it is missing, or where tightloop refuses it."""
    try:
        model = robot.model(options.reference)
        state = settled(robot, model, options.worlds, options.settle)
    except (FileNotFoundError, ValueError, tl.errors.SceneError) as error:
        print(f"{robot.name} is left out: {error}")
        return []
    same = peer.ask("robot", name=robot.name, reference=str(options.reference))
    sizes = [model.nq, model.nv, model.nu, model.na, model.ngeom]
    assert same["sizes"] == sizes and np.isclose(same["mass"], model.body_mass.sum()), "both sides have one model"
    rows = []
    for nstep in (1, robot.substeps):
        case = Case(robot, model, nstep, state, peer)
        try:
            rows.append(case.measure(options.turns, options.seconds))
        finally:
            case.close()
    return rows


def main() -> None:
    """Measure the chosen models, print and write the results."""
    parser = argparse.ArgumentParser(description="Steps per second of MuJoCo models beside mjbatch, a thread each.")
    parser.add_argument("--models", nargs="+", default=[""], help="parts of names, such as Ant G1 (default: all)")
    parser.add_argument("--worlds", type=int, default=1024, help="worlds of each side (default 1024)")
    parser.add_argument("--turns", type=int, default=5, help="turns that count (default 5)")
    parser.add_argument("--seconds", type=float, default=0.6, help="length of a turn [s] (default 0.6)")
    parser.add_argument("--settle", type=float, default=2.0, help="simulated time before the turns [s] (default 2)")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of the models that no wheel has")
    parser.add_argument("--dry-run", action="store_true", help="write no file")
    options = parser.parse_args()
    chosen = [robot for robot in ROBOTS.values() if any(part.lower() in robot.name.lower() for part in options.models)]
    peer = Mjbatch()
    try:
        rows = [row for robot in tqdm(chosen, desc="models", disable=None) for row in rows_of(robot, peer, options)]
    finally:
        peer.close()
    if not rows:
        raise SystemExit("no model was measured")
    device = "; ".join(sorted({row.pop("device") for row in rows}))
    print(
        f"mjbatch {peer.versions['mjbatch']} on MuJoCo {peer.versions['mujoco']}; tightloop {tl.__version__}: {device}"
    )
    print_table(rows)
    if options.dry_run:
        return
    # the folder of the models is of this machine
    words = ["REFERENCE" if Path(word) == options.reference else word for word in sys.argv[1:]]
    given = "".join(f" {word}" for word in words)
    facts = {
        "command": f"python -m benches mujoco_models{given}",
        "mjbatch": peer.versions["mjbatch"],
        "mujoco_of_mjbatch": peer.versions["mujoco"],
        "mujoco_of_tightloop": mujoco.__version__,
        "device": device,
        "threads": 1,
    }
    write_results("mujoco_models", rows, facts)


if __name__ == "__main__":
    main()
