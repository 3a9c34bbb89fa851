"""Every MuJoCo model of the fetched wheels, or of given files, against MuJoCo C.

The table goes to out/menagerie/table.md.

A model is compared in double precision at random states under random controls. First come accelerations, both sides
solved to the end. Then come runs with the model's own options, until MuJoCo departs from a run of its own that begins
next to it. Worlds with contacts of pairs for which MuJoCo has no closed form are left out, and a run also ends where
MuJoCo warns or a world has a fault, since a model that explodes has nothing to compare.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from fetch import MODELS
from live_model import Live, live, relative

from tightloop.arrays.frames import FAULTED
from tightloop.errors import SceneError

WORLDS = 8
# Relative to the largest acceleration of a world; with contacts the second counts
TOLERANCES = (1e-8, 1e-6)
PRIMITIVES = {"PLANE", "SPHERE", "CAPSULE", "BOX"}
# Pairs with closed forms beside those of these
MORE_CLOSED_FORMS = ({"PLANE", "CYLINDER"}, {"PLANE", "MESH"}, {"SPHERE", "CYLINDER"})
# Steps of a run, and how far its positions may be from MuJoCo's. A run ends where MuJoCo departs from its own
# neighbour by a hundredth of that.
STEPS = 200
RUN_TOLERANCE = 1e-9
# Accelerations of a mass matrix that cannot be inverted, in MuJoCo itself [m/s²].
SINGULAR = 1e12


@dataclass
class Row:
    """What became of a model."""

    name: str
    outcome: str
    """``agrees``, ``differs``, ``refused``, ``not compared`` or ``not compiled`` (by MuJoCo)."""
    detail: str


def main() -> int:
    """Compare all models, print the table's summary, and return 1 if any differs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("models", nargs="*", type=Path, help="XML files; those of the fetched wheels if left out")
    files = parser.parse_args().models or sorted(MODELS.rglob("*.xml"))
    rows = []
    for file in files:
        rows.append(compare(file))
        print(f"{rows[-1].outcome:<13}{rows[-1].name}: {rows[-1].detail}", flush=True)
    write_table(rows)
    counts = Counter(row.outcome for row in rows)
    compiled = len(rows) - counts["not compiled"]
    running = counts["agrees"] + counts["not compared"] + counts["differs"]
    share = running / max(compiled, 1)
    print(f"\n{len(rows)} files, {compiled} compiled by MuJoCo, {running} run ({share:.0%}); {dict(counts)}")
    return 1 if counts["differs"] else 0


def compare(file: Path) -> Row:
    """Run a model beside MuJoCo."""
    name = str(file.relative_to(MODELS) if file.is_relative_to(MODELS) else file)
    try:
        model = mujoco.MjModel.from_xml_path(str(file))
    except ValueError as error:
        return Row(name, "not compiled", str(error).split("\n")[0][:120])
    try:
        if model.nv == 0:
            return Row(name, "not compared", "nothing moves")
        with live(model, worlds=WORLDS) as case:
            errors = list(differences(case))
        model = mujoco.MjModel.from_xml_path(str(file))
        model.opt.solver = mujoco.mjtSolver.mjSOL_NEWTON
        with live(model, worlds=WORLDS // 4, solved=False) as case:
            departs, steps = run(case)
    except SceneError as error:
        return Row(name, "refused", str(error).partition(": ")[2])
    if not errors:
        return Row(name, "not compared", "every state has contacts without a closed form, or a singular mass matrix")
    if not steps:
        return Row(name, "not compared", "the first step has contacts without a closed form, or is chaotic")
    worst = max(error / tolerance for error, tolerance in errors)
    largest = max(error for error, _ in errors)
    agrees = worst < 1 and departs < RUN_TOLERANCE
    detail = f"{model.nv} dofs, {len(errors)} states, {largest:.1e}; {steps} steps, {departs:.1e}"
    return Row(name, "agrees" if agrees else "differs", detail)


def differences(case: Live):
    """Relative difference of accelerations of each comparable world, and its tolerance."""
    model = case.model
    states = case.states(0)
    frame = case.place(states)
    for world, data in enumerate(case.data(states)):
        mujoco.mj_forward(model, data)
        if not has_closed_forms(model, data):
            continue
        if np.abs(data.qacc).max() > SINGULAR:
            continue
        scale = max(np.abs(data.qacc).max(), 1e-3)
        error = float(np.abs(frame.qacc[world] - data.qacc).max() / scale)
        yield (error if np.isfinite(error) else np.inf), TOLERANCES[data.ncon > 0]


def has_closed_forms(model: mujoco.MjModel, data: mujoco.MjData) -> bool:
    """Whether all contacts are of pairs for which MuJoCo has a closed form."""
    names = {int(kind): name.removeprefix("mjGEOM_") for name, kind in mujoco.mjtGeom.__members__.items()}
    pairs = [{names[int(model.geom_type[geom])] for geom in contact.geom} for contact in data.contact]
    return all(pair <= PRIMITIVES or pair in MORE_CLOSED_FORMS for pair in pairs)


def run(case: Live) -> tuple[float, int]:
    """Largest relative difference of positions over a run, and the steps compared."""
    states = case.states(0, spread=0.1)
    own, other = list(case.data(states)), list(case.data(states))
    for data in other:
        data.qvel[:] = data.qvel * (1 + 1e-13) + 1e-14
    case.place(states)
    agrees, worst, steps = [True] * len(own), 0.0, 0
    for _ in range(STEPS):
        frame = case.sim.step()
        for world, (data, neighbour) in enumerate(zip(own, other, strict=True)):
            if not agrees[world]:
                continue
            mujoco.mj_step(case.model, data)
            mujoco.mj_step(case.model, neighbour)
            settled = relative(data.qpos, neighbour.qpos) < RUN_TOLERANCE / 100
            exploded = data.warning.number.any() or frame.status[world] & FAULTED
            agrees[world] = settled and has_closed_forms(case.model, data) and not exploded
            if agrees[world]:
                steps += 1
                worst = max(worst, relative(frame.qpos[world], data.qpos))
                agrees[world] = worst < RUN_TOLERANCE
    return worst, steps


def write_table(rows: list[Row]) -> None:
    """Write the rows as Markdown."""
    lines = ["| model | outcome | detail |", "|---|---|---|"]
    lines += [f"| {row.name} | {row.outcome} | {row.detail.replace('|', '/')} |" for row in rows]
    MODELS.mkdir(parents=True, exist_ok=True)
    (MODELS / "table.md").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    sys.exit(main())
