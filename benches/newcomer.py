"""How long a newcomer waits for the first picture: `make demo` on a clean checkout, with cold caches and again.

    python3 benches/newcomer.py                   # clones this repository's HEAD into an empty folder; `make newcomer`
    python3 benches/newcomer.py --checkout .      # only again, where everything is built

Cold means that nothing was built or fetched: no target folder, no environment, no caches of cargo, pip or GPU programs.
Rust and Python themselves are there, as the README asks. The second time is in the same checkout.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from record import REPOSITORY, print_table, write_results

ASKED = {"cold": 480, "warm": 30}  # [s]


def demo(checkout: Path, environment: dict[str, str]) -> tuple[float, float]:
    """Seconds of `make demo` until its first picture was there, and until its end."""
    begun, clock = time.perf_counter(), time.time()
    process = subprocess.Popen(["make", "demo"], cwd=checkout, env=environment)
    first = None
    while process.poll() is None:
        pictures = (checkout / "out").rglob("*.png")
        # a picture that was there before is not it, and one of no size is still being written
        if first is None and any(path.stat().st_mtime > clock and path.stat().st_size for path in pictures):
            first = time.perf_counter() - begun
        time.sleep(0.05)
    if process.returncode or first is None:
        raise SystemExit(f"make demo: exit code {process.returncode}, {'a' if first else 'no'} picture")
    return first, time.perf_counter() - begun


def cold(folder: Path) -> tuple[Path, dict[str, str]]:
    """A clean checkout in an empty folder, and an environment with empty caches."""
    checkout = folder / "tightloop"
    subprocess.run(["git", "clone", "--quiet", str(REPOSITORY), str(checkout)], check=True)
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
    return checkout, environment


def main() -> None:
    """Measure, print, and keep the result."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--checkout", type=Path, help="measure only again, in this checkout; nothing is kept")
    parser.add_argument("--folder", type=Path, help="where the clean checkout goes (default: a temporary folder)")
    args = parser.parse_args()
    if args.checkout:
        times = {"warm": demo(args.checkout.resolve(), dict(os.environ))}
    else:
        folder = Path(tempfile.mkdtemp(prefix="newcomer-", dir=args.folder))
        try:
            checkout, environment = cold(folder)
            times = {"cold": demo(checkout, environment), "warm": demo(checkout, environment)}
        finally:
            shutil.rmtree(folder)
    rows = [
        {"caches": caches, "first_picture_s": f"{first:.1f}", "whole_demo_s": f"{whole:.1f}", "asked_s": ASKED[caches]}
        for caches, (first, whole) in times.items()
    ]
    print_table(rows)
    if not args.checkout:
        write_results("newcomer", rows, {"command": "python3 benches/newcomer.py", "steps": "git clone, make demo"})
    if any(first > ASKED[caches] for caches, (first, _) in times.items()):
        sys.exit(1)


if __name__ == "__main__":
    main()
