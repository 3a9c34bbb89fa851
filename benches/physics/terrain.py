"""What height fields and height scans cost: gymnasium's ant on rough ground, on a plane, and in MuJoCo C.

    .venv/bin/python -m benches terrain

One thread per side; needs gymnasium and MuJoCo. The sides take turns, and a ratio is the median over rounds. Prints
physics steps per second, and nanoseconds per world for a scan of 17 x 11 rays. Writes
benches/results/MACHINE/terrain.csv.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

import tightloop as tl
from tightloop import terrain

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import print_table, write_results

# Sides of the square of rough ground and of its cells, and most elevation [m]
SIDE, CELL, AMPLITUDE = 30.0, 0.25, 0.15
# Steps before the clock starts: ants fall and lie
WARM_UP = 200
# Steps that an ant holds its random controls
HELD = 5


def ant(ground: terrain.Terrain | None) -> mujoco.MjModel:
    """Gymnasium's ant, on a plane or on a height field in its place."""
    assets = Path(gymnasium.__file__).parent / "envs/mujoco/assets"
    spec = mujoco.MjSpec.from_file(str(assets / "ant.xml"))
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    if ground is not None:
        z = ground.elevation
        low, high = z.min(), z.max()
        size = [0.5 * ground.size[0], 0.5 * ground.size[1], high - low, 1.0]
        data = ((z - low) / (high - low)).ravel()
        spec.add_hfield(name="rough", nrow=z.shape[0], ncol=z.shape[1], size=size, userdata=data)
        floor = next(geom for geom in spec.geoms if geom.type == mujoco.mjtGeom.mjGEOM_PLANE)
        floor.type, floor.hfieldname, floor.pos = mujoco.mjtGeom.mjGEOM_HFIELD, "rough", [0, 0, low]
    return spec.compile()


def ours(ground: terrain.Terrain | None, worlds: int, steps: int, *, scan: bool = False) -> tuple[float, int, float]:
    """Return steps per second, worlds that faulted, and the mean number of contacts."""
    model, rng = ant(ground), np.random.default_rng(0)
    scene, fields = tl.Scene.from_mujoco(model), ("joint_q", "contact_count")
    if scan:
        scene.add_height_scan(body=f"{next(iter(scene.models))}/torso")
        fields = (*fields, "height_scan")
    with tl.launch(scene, worlds=worlds, threads=1, fields=fields) as sim:
        start = sim.reset().joint_q.copy()
        start[:, :2] = rng.uniform(-0.4, 0.4, (worlds, 2)) * SIDE
        start[:, 2] = 0.9 + (0.0 if ground is None else ground.height(*start[:, :2].T.astype(float)))
        frame, faulted, contacts = sim.write(joint_q=start), 0, []
        begun, controls = time.perf_counter(), np.zeros((worlds, model.nu), np.float32)
        for step in range(WARM_UP + steps):
            if step == WARM_UP:
                begun = time.perf_counter()
            if step % HELD == 0:
                controls = rng.uniform(-1, 1, (worlds, model.nu)).astype(np.float32)
            frame = sim.step(ctrl=controls)
            if step % 100 == 99:
                faulted = max(faulted, int(((frame.status & 9) > 0).sum()))
                contacts.append(frame.contact_count.mean())
                gone = (abs(frame.joint_q[:, :2]) > 0.47 * SIDE).any(1)
                if gone.any():
                    sim.reset(mask=gone)
                    sim.write(joint_q=start, mask=gone)
        taken = time.perf_counter() - begun
    return worlds * steps / taken, faulted, float(np.mean(contacts))


def theirs(ground: terrain.Terrain | None, steps: int) -> tuple[float, float]:
    """Return steps per second of MuJoCo C, and the mean number of contacts."""
    model, rng = ant(ground), np.random.default_rng(0)
    data, contacts = mujoco.MjData(model), 0
    data.qpos[2] = 1.0
    begun = time.perf_counter()
    for step in range(WARM_UP + steps):
        if step == WARM_UP:
            begun, contacts = time.perf_counter(), 0
        if step % HELD == 0:
            data.ctrl[:] = rng.uniform(-1, 1, model.nu)
        mujoco.mj_step(model, data)
        contacts += data.ncon
    return steps / (time.perf_counter() - begun), contacts / steps


def measure(name: str, ground: terrain.Terrain | None, worlds: int, steps: int, rounds: int) -> dict[str, str]:
    """Return a row of the results: both sides on one kind of ground."""
    runs = [(ours(ground, worlds, steps), theirs(ground, 3 * steps)) for _ in range(rounds)]
    median = statistics.median
    return {
        "ground": name,
        "worlds": str(worlds),
        "steps_per_s": f"{median(one[0] for one, _ in runs):.0f}",
        "contacts": f"{median(one[2] for one, _ in runs):.2f}",
        "faulted": str(max(one[1] for one, _ in runs)),
        "mujoco_steps_per_s": f"{median(other[0] for _, other in runs):.0f}",
        "mujoco_contacts": f"{median(other[1] for _, other in runs):.2f}",
        "median_ratio": f"{median(one[0] / other[0] for one, other in runs):.2f}",
    }


def main() -> int:
    """Measure, print and write the results."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--worlds", type=int, default=512)
    parser.add_argument("--steps", type=int, default=1000)
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    rough = terrain.rough(amplitude=AMPLITUDE, tile=SIDE, cell=CELL)
    grounds = (("plane", None), ("rough", rough))
    rows = [measure(name, ground, args.worlds, args.steps, args.rounds) for name, ground in grounds]
    print_table(rows)
    scans = []
    for _ in range(args.rounds):
        without, with_scan = (ours(rough, args.worlds, args.steps, scan=scan)[0] for scan in (False, True))
        scans.append(1e9 / with_scan - 1e9 / without)
    facts = {
        "command": f"python -m benches terrain --worlds {args.worlds} --steps {args.steps} --rounds {args.rounds}",
        "cores": 1,
        "load_1_minute": f"{os.getloadavg()[0]:.1f}",
        "mujoco": mujoco.__version__,
        "tightloop": tl.__version__,
        "scan_of_187_rays": f"{statistics.median(scans):.0f} ns per world and step",
    }
    print(f"scan of 187 rays: {facts['scan_of_187_rays']}")
    write_results("terrain", rows, facts)
    return 0


if __name__ == "__main__":
    sys.exit(main())
