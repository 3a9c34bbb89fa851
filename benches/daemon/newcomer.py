"""How long a newcomer waits for the first picture: from a clean checkout, in a built one, and from a wheel.

    python3 -m benches newcomer                   # clones this repository's HEAD into an empty folder; `make newcomer`
    python3 -m benches newcomer --checkout .      # only `warm` and `wheel`, where everything is built

| caches | what is timed |
|---|---|
| cold | `git clone` and `make demo`: no target folder, no environment, no caches of cargo, pip or GPU programs |
| warm | `make demo` again, in the same checkout |
| wheel | a new environment, `pip install` of the built wheel with the extra `view`, and `tightloop demo` |

Rust and Python themselves are there, as the README asks. With `--checkout` pip keeps its cache.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

ASKED = {"cold": 240, "warm": 30, "wheel": 30}  # until the first picture, on two cores [s]


def demo(
    command: Sequence[str], folder: Path, out: Path, environment: dict[str, str], begun: float
) -> tuple[float, float]:
    """Seconds since `begun` until the first picture of a demo was in its folder `out`, and until its end."""
    clock = time.time()
    process = subprocess.Popen(command, cwd=folder, env=environment)
    first = None
    while process.poll() is None:
        # a picture that was there before is not it, and one of no size is still being written
        if first is None and any(path.stat().st_mtime > clock and path.stat().st_size for path in out.rglob("*.png")):
            first = time.perf_counter() - begun
        time.sleep(0.05)
    if process.returncode or first is None:
        raise SystemExit(f"{' '.join(command)}: exit code {process.returncode}, {'a' if first else 'no'} picture")
    return first, time.perf_counter() - begun


def cold(folder: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Clone the repository into a folder, and run its demo."""
    begun = time.perf_counter()
    checkout = folder / "tightloop"
    subprocess.run(["git", "clone", "--quiet", str(REPOSITORY), str(checkout)], check=True)
    return demo(["make", "demo"], checkout, checkout / "out", environment, begun)


def warm(checkout: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Run the demo of a checkout."""
    return demo(["make", "demo"], checkout, checkout / "out", environment, time.perf_counter())


def wheel(checkout: Path, folder: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Install the wheel of a checkout into a new environment in an empty folder, and run its demo."""
    (built,) = (checkout / ".venv/wheels").glob("*.whl")
    begun = time.perf_counter()
    subprocess.run(["python3", "-m", "venv", folder / "venv"], env=environment, check=True)
    pip = [folder / "venv/bin/python", "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    subprocess.run([*pip, f"{built}[view]"], env=environment, check=True)
    command = [str(folder / "venv/bin/tightloop"), "demo", "--out", "out"]
    return demo(command, folder, folder / "out", environment, begun)


def empty_caches(folder: Path) -> dict[str, str]:
    """Variables of a user whose caches are empty folders."""
    homes = {"CARGO_HOME": "cargo", "PIP_CACHE_DIR": "pip", "XDG_CACHE_HOME": "cache"}
    environment = {name: value for name, value in os.environ.items() if name not in ("CARGO_TARGET_DIR", "VIRTUAL_ENV")}
    for name, place in homes.items():
        (folder / place).mkdir()
        environment[name] = str(folder / place)
    # where the registry is, is no cache
    cargo = Path(os.environ.get("CARGO_HOME", Path.home() / ".cargo"))
    for settings in ("config.toml", "config", "credentials.toml"):
        if (cargo / settings).exists():
            shutil.copy(cargo / settings, folder / "cargo" / settings)
    return environment


def main() -> None:
    """Measure, print, and keep the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--checkout", type=Path, help="measure only warm and wheel, in this checkout; nothing is kept")
    parser.add_argument("--folder", type=Path, help="where the clean checkout goes (default: a temporary folder)")
    args = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="newcomer-", dir=args.folder))
    try:
        times = {}
        if args.checkout:
            checkout, environment = args.checkout.resolve(), dict(os.environ)
        else:
            checkout, environment = folder / "tightloop", empty_caches(folder)
            times["cold"] = cold(folder, environment)
        times["warm"] = warm(checkout, environment)
        if not args.checkout:
            # pip has filled its cache since
            environment["PIP_CACHE_DIR"] = str(folder / "none")
        times["wheel"] = wheel(checkout, folder, environment)
    finally:
        shutil.rmtree(folder)
    rows = [
        {"caches": caches, "first_picture_s": f"{first:.1f}", "whole_demo_s": f"{whole:.1f}", "asked_s": ASKED[caches]}
        for caches, (first, whole) in times.items()
    ]
    print_table(rows)
    if not args.checkout:
        steps = "cold: git clone, make demo; warm: make demo; wheel: venv, pip install, tightloop demo"
        write_results("newcomer", rows, {"command": "python3 -m benches newcomer", "steps": steps})
    if any(first > ASKED[caches] for caches, (first, _) in times.items()):
        sys.exit(1)


if __name__ == "__main__":
    main()
