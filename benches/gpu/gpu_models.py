"""MuJoCo models on a GPU beside the CPU: with the bits of the CPU, and with eight threads per world.

    make gpu-models               # brings the models first
    python -m benches gpu_models --models g1_flat,ant --ways 1,8

For each model of mujoco_robots.py it runs the checks of `gpu_bench`: 16 worlds on both for five frames, then the same
worlds among 1 and 7 others. The way `cpu-bits` asks for the bits of the CPU, and compares all numbers. A number is one
of threads per world: it prints how far positions and velocities are apart, and how many numbers have the same bits.
Exit code 1 means that a number has other bits than on the CPU, that positions differ by more than 1e-6 after a frame,
that bits depend on the number of worlds, that a model does not start, or that there is none. Mesa's software driver
takes about half an hour.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

BENCHES = Path(__file__).parents[1]
sys.path.insert(0, str(BENCHES / "physics"))
from card_scenes import REFERENCE, export_all  # noqa: E402  (benches are no package)
from mujoco_files import REPOSITORY  # noqa: E402

BINARY = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "release/examples/gpu_bench"
# Least number of worlds that is compared with 1 and 7
CHECK_WORLDS = 9
# The software driver compiles three humanoids for 32 threads per world in more than its limit of 180 s a program
SLOW = ("three_humanoids",)
PATIENCE = 1200.0  # [s]


def check(scene: Path, way: str) -> bool:
    """Runs the checks of a scene, and prints their results."""
    command = [BINARY, "--checks", "only", "--scenes", scene, "--check-worlds", str(CHECK_WORLDS)]
    command += ["--cpu-bits"] if way == "cpu-bits" else ["--world-threads", way]
    print(f"== {scene.stem}, {way if way == 'cpu-bits' else f'{way} threads per world'}", flush=True)
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        print(f"no result within {PATIENCE:.0f} s")
        return False
    lines = done.stdout.splitlines()
    print("\n".join(line for line in lines if line.startswith(scene.stem)))
    if done.returncode:
        print(done.stderr)
    return done.returncode == 0


def main() -> int:
    """Check all; 1 where one fails."""
    parser = argparse.ArgumentParser(description="MuJoCo models on a GPU beside the CPU.")
    parser.add_argument("--reference", type=Path, default=REFERENCE, help="folder of models that no wheel has")
    parser.add_argument("--models", help="names of some, as card_scenes.py writes them")
    parser.add_argument("--ways", default="cpu-bits,8", help="cpu-bits, and numbers of threads per world")
    arguments = parser.parse_args()
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        export_all(Path(folder), arguments.reference)
        known = {scene.stem: scene for scene in sorted(Path(folder).glob("*.toml"))}
        wanted = arguments.models.split(",") if arguments.models else [name for name in known if name not in SLOW]
        missing = [name for name in wanted if name not in known]
        if missing or not wanted:
            print(f"no scene is called {', '.join(missing)}; there are: {', '.join(known)}")
            return 1
        for name in wanted:
            scene = known[name]
            failed += [f"{name} ({way})" for way in arguments.ways.split(",") if not check(scene, way)]
    print(f"failed: {', '.join(failed)}" if failed else "all agree")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
