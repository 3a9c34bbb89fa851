"""Predict a scene's speed on cards without one.

    python -m benches.gpu.offline grasp standing --worlds 4096,16384 --arch sm_90

The kernels come from `cargo build --release --workspace --example gpu_bench`. Its dump and what is compiled go below
`out/offline`. The first run installs NVIDIA's compilers there, from the Python package index. g++ and numpy are needed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from . import check, dump, predict, radv, report, results
from .constants import CARDS
from .dump import Scene

ROOT = Path(__file__).resolve().parents[3]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benches.gpu.offline", description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("scenes", nargs="+", help="torque_free, target, grasp, quadruped or standing")
    parser.add_argument("--worlds", default="4096,16384", help="numbers of worlds")
    parser.add_argument("--arch", default="sm_90", help=f"architectures, of {', '.join(CARDS)}")
    parser.add_argument("--samples", type=int, default=12, help="frames that are emulated, across the run")
    parser.add_argument("--emulated", type=int, default=4096, help="worlds that are emulated")
    parser.add_argument(
        "--dump", type=Path, help="a folder that `gpu_bench --dump` wrote; otherwise it is written anew"
    )
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/examples/gpu_bench", help="what dumps")
    parser.add_argument("--cache", type=Path, default=ROOT / "out/offline", help="for what is compiled")
    parser.add_argument(
        "--results", type=Path, default=ROOT / "benches/results/gpu_offline", help="folder of the CSV files"
    )
    parser.add_argument("--no-results", action="store_true", help="only print")
    instead = parser.add_mutually_exclusive_group()
    instead.add_argument(
        "--check", action="store_true", help="instead, check the translations against the dumped states"
    )
    instead.add_argument(
        "--amd", metavar="FAMILIES", help=f"instead, what Mesa compiles for these of {', '.join(radv.FAMILIES)}"
    )
    return parser.parse_args()


def check_scene(scene: Scene, given: argparse.Namespace) -> bool:
    """Checks the translations of a scene; false where a frame differs."""
    found = check.check(scene, given.cache)
    print(f"{scene.name}: a frame from the state before it", *found, sep="\n", flush=True)
    return all(one.holds for one in found)


def compile_for_amd(scene: Scene, given: argparse.Namespace) -> None:
    """Prints and keeps what Mesa compiles."""
    for family in given.amd.split(","):
        found = radv.programs(scene, family, given.cache)
        print(radv.table(scene, family, found), flush=True)
        if not given.no_results:
            results.keep_amd(found, scene.name, family, given.results, results.commit(ROOT))


def predict_scene(scene: Scene, given: argparse.Namespace) -> None:
    """Prints and keeps a scene's rates."""
    archs = tuple(given.arch.split(","))
    counts = tuple(int(count) for count in given.worlds.split(","))
    found = predict.predict(scene, archs, counts, given.cache)
    for prediction in found:
        print(report.table(prediction), flush=True)
    if not given.no_results:
        results.keep(found, given.results, results.commit(ROOT))


def main() -> None:
    """Does what the command line asks with each scene."""
    given = arguments()
    folder = given.dump or given.cache / "dump"
    agrees = True
    for name in given.scenes:
        if given.dump is None:
            dump.write(given.binary, folder, name, given.emulated, given.samples)
        scene = dump.read(folder / name)
        if given.check:
            agrees &= check_scene(scene, given)
        elif given.amd:
            compile_for_amd(scene, given)
        else:
            predict_scene(scene, given)
    if not agrees:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
