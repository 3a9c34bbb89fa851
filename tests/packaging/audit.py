"""Audits built wheels: what each asks of a system, its size, and whether it fits every Python from 3.10 on.

python tests/packaging/audit.py out/dist          # `make wheels`
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

# What a wheel may have at most [bytes].
SIZE_MAX = 20_000_000
# The libc of RHEL 8, Debian 11 and Ubuntu 20.04, and later.
PLATFORM = "manylinux_2_28"


def output(*command: str) -> str:
    """Run a tool of this environment; return what it printed."""
    tool = Path(sys.executable).parent / command[0]
    done = subprocess.run([tool, *command[1:]], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(command)}:\n{done.stdout}{done.stderr}")
    return done.stdout


def main() -> None:
    """Audit each wheel of the folder."""
    wheels = sorted(Path(sys.argv[1]).glob("*.whl"))
    if not wheels:
        raise SystemExit(f"{sys.argv[1]} has no wheels; run `make wheels`")
    for wheel in wheels:
        size = wheel.stat().st_size
        if size > SIZE_MAX:
            raise SystemExit(f"{wheel.name}: {size} bytes, more than {SIZE_MAX}")
        if PLATFORM not in wheel.name:
            raise SystemExit(f"{wheel.name} is not for {PLATFORM}")
        shown = " ".join(output("auditwheel", "show", str(wheel)).split())
        if f'consistent with the following platform tag: "{PLATFORM}' not in shown:
            raise SystemExit(f"{wheel.name}: {shown}")
        output("abi3audit", "--strict", str(wheel))
        print(f"{wheel.name}: {size / 1e6:.1f} MB, {PLATFORM}, fits every Python from 3.10 on")


if __name__ == "__main__":
    main()
