"""Tries the built wheel with several versions of MuJoCo, each in a virtual environment of its own.

    python tests/python/mujoco_versions/environments.py .venv/wheels     # `make mujoco-versions`

`py-client/requirements-mujoco-versions.txt` lists the versions. The environments stay in out/mujoco-versions, and later
runs use them again. `smoke.py` is what runs in each.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path

REPOSITORY = Path(__file__).parents[3]
REQUIREMENTS = REPOSITORY / "py-client/requirements-mujoco-versions.txt"
HOME = REPOSITORY / "out/mujoco-versions"
#: First version of MuJoCo without wheels for Python 3.10.
WITHOUT_310 = (4, 0)


def versions() -> list[str]:
    """Return the listed versions, oldest first."""
    lines = (line.split("#")[0].strip() for line in REQUIREMENTS.read_text().splitlines())
    return [line.removeprefix("mujoco==") for line in lines if line]


def environment(version: str, wheel: Path) -> Path:
    """Make the environment of a version, or bring it up to date, and return its Python."""
    folder = HOME / version
    python, stamp = folder / "bin/python", folder / "wheel.sha256"
    digest = hashlib.sha256(wheel.read_bytes()).hexdigest()
    installed = stamp.read_text() if stamp.exists() else None
    if installed == digest:
        return python
    pip = [python, "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    if installed is None:
        print(f"installing mujoco {version}", flush=True)
        # what an interrupted run left
        shutil.rmtree(folder, ignore_errors=True)
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        subprocess.run([*pip, f"{wheel}[mujoco]", f"mujoco=={version}"], check=True)
    else:
        subprocess.run([*pip, "--no-deps", "--force-reinstall", wheel], check=True)
    stamp.write_text(digest)
    return python


def main() -> int:
    """Try all versions, and say which do not work."""
    (wheel,) = Path(sys.argv[1]).resolve().glob("*.whl")
    files, root = HOME / "files", HOME / "root"
    shutil.rmtree(files, ignore_errors=True)
    root.mkdir(parents=True, exist_ok=True)
    inherited = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    variables = inherited | {"TIGHTLOOP_ROOT": str(root), "XDG_CACHE_HOME": str(HOME / "cache")}
    smoke = Path(__file__).with_name("smoke.py")
    outcomes: dict[str, str] = {}
    for version in versions():
        if sys.version_info < (3, 11) and tuple(map(int, version.split(".")[:2])) >= WITHOUT_310:
            outcomes[version] = "not tried: it needs Python 3.11"
            continue
        try:
            python = environment(version, wheel)
        except subprocess.CalledProcessError as error:
            outcomes[version] = f"NOT INSTALLED: pip or venv ended with {error.returncode}"
            continue
        tried = [other for other, outcome in outcomes.items() if outcome == "works"]
        print(f"mujoco {version}", flush=True)
        done = subprocess.run([python, smoke, files, *tried], env=variables, check=False)
        outcomes[version] = "FAILS" if done.returncode else "works"
    for version, outcome in outcomes.items():
        print(f"mujoco {version}: {outcome}")
    return 0 if all(outcome.startswith(("works", "not tried")) for outcome in outcomes.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
