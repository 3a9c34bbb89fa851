"""The beginning of the performance page: how to read it, and the rows of its summary."""

from __future__ import annotations

from dataclasses import dataclass

INTRODUCTION = """# Performance

Each table is a file of `benches/results`. The rows below a table name its machine, commit and command.

<!-- forge -->

This page has the newest table of each topic. `make docs` builds it with those of all machines.

<!-- end -->

- A *step* is one physics step of one world. Rates add up all worlds.
- A *ratio* is the median over paired runs: both sides take turns in one run. So it can differ slightly from the
  quotient of the two rates.
- *Identical commands*: every world gets the same command. *Independent commands*: every world gets its own.
- `asked` columns hold the project's goals. A row can miss its goal.
- `–` means that a value was not measured, or that no goal exists.
- A commit that ends in `-dirty` had uncommitted changes.

`make bench`, `make bench-env`, `make bench-mujoco` and `make bench-gpu` measure your machine and write the same files.

## Summary

These rows use independent commands. The rows of MuJoCo compare one thread with one thread. In the rows of EnvPool and
gymnasium, each side uses all four cores of a 4-core machine. The other rows come from 2-core machines with AVX-512: the
first two from an Intel Xeon, the rest from an AMD EPYC.

- **Precision differs.** MuJoCo computes in float64, one world at a time. tightloop computes in float32, with 16 worlds
  in one AVX-512 register.
- **Hulls differ only for URDF.** MuJoCo keeps all vertices of a mesh's convex hull. tightloop keeps at most 64 of a
  URDF's mesh, and all of a MuJoCo model's.
- **EnvPool's scene is lighter.** Of its arm, only the hand and the fingers collide. Its solver stops after 5
  iterations.
- **mjbatch has [its own table](#mujoco-models-beside-mjbatch-on-one-thread).** It steps MuJoCo C.
- **Contacts cost more than joints.** Robots on the ground gain less than arms in the air: worlds that share a register
  wait for the one with the most contacts.
"""


@dataclass(frozen=True)
class Line:
    """A row of the summary: a file, the row of each side, their columns, and where the ratio stands."""

    workload: str
    peer: str
    file: str
    their_row: dict[str, str]
    our_row: dict[str, str]
    theirs: str
    ours: str
    ratio: dict[str, str]


def _peers(workload: str, demo: str) -> Line:
    row = {"demo": demo, "commands": "own"}
    theirs, ours = row | {"side": "MuJoCo C rollout"}, row | {"side": "tightloop, daemon and Python"}
    rate = "median_steps_per_s"
    place = "intel-r-xeon-r-processor-2-cores/peers.csv"
    return Line(workload, _ROLLOUT, place, theirs, ours, rate, rate, ours | {"column": "median_ratio"})


def _beside(workload: str, file: str, row: dict[str, str]) -> Line:
    ratio = row | {"column": "median_ratio"}
    return Line(workload, _ROLLOUT, file, row, row, "mujoco_steps_per_s", "tightloop_steps_per_s", ratio)


def _environments(peer: str, side: str) -> Line:
    theirs, rate = {"side": side}, "physics_steps_per_s"
    ratio = theirs | {"column": "physics_ratio"}
    file = "amd-epyc-4-cores/env.csv"
    return Line("FrankaPickCube, random actions", peer, file, theirs, {"side": "tightloop"}, rate, rate, ratio)


def _on_the_ground(workload: str, model: str, steps_per_call: int) -> Line:
    row = {"model": model, "steps_per_call": str(steps_per_call)}
    place = "amd-epyc-2-cores/mujoco_models.csv"
    ratio = row | {"column": "median_ratio"}
    return Line(workload, "mjbatch 0.1.4", place, row, row, "mjbatch_steps_per_s", "tightloop_steps_per_s", ratio)


_ROLLOUT = "MuJoCo C 3.17, `rollout`"
_CONTACTS = "amd-epyc-2-cores/contacts.csv"
SUMMARY = (
    _peers("FR3 arm, position targets, no contacts", "target"),
    _peers("FR3 arm, torques, no contacts", "torque"),
    _beside("FR3 arm, torques, above its table", _CONTACTS, {"demo": "torque", "worlds_alike": "no"}),
    _beside("FR3 arm grasps a cube", _CONTACTS, {"demo": "grasp", "worlds_alike": "no"}),
    _beside("FR3 arm and cube, random targets", _CONTACTS, {"demo": "random", "worlds_alike": "no"}),
    _beside("Quadruped, 18 dofs, no contacts", "amd-epyc-2-cores/legged.csv", {"robot": "quadruped"}),
    _on_the_ground("Go1 on the ground, feet only", "mjlab Go1, feet only", 4),
    _on_the_ground("G1 humanoid on the ground", "MuJoCo-Warp G1, flat", 4),
    _on_the_ground("Go1 falls and lies, all of it touches", "mjlab Go1 heap, pyramidal", 8),
    _on_the_ground("The same, elliptic cones, `impratio` 1000", "mjlab Go1 heap, elliptic 1000", 8),
    _environments("EnvPool 1.2.5, `PandaPickCube-v1`", "envpool PandaPickCube-v1"),
    _environments("gymnasium 1.2.2, `AsyncVectorEnv` over MuJoCo C", "gymnasium AsyncVectorEnv, MuJoCo C"),
)
