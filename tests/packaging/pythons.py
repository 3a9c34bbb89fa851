"""Tries the built wheel on every Python of this machine: installed into an environment of its own, and used.

    python tests/packaging/pythons.py .venv/wheels          # `make packages`; needs a package index for NumPy

It looks for ``python3.N`` on the path and in pyenv's folder. The short version is
``tests/python/package/test_wheel.py``.
"""

from __future__ import annotations

import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

OLDEST = (3, 10)
# What somebody does first; it leaves no daemon behind.
SMOKE = """
import json, sys
import numpy as np
import tightloop as tl
from tightloop.env import VectorEnv
from tightloop.tasks import cartpole

scene = tl.Scene(dt=1 / 120, substeps=2)
scene.add_urdf(cartpole.URDF, name="cart")
with tl.launch(scene, worlds=8) as sim:
    frame = sim.step(joint_f=np.ones(2))
    assert frame.joint_q.shape == (8, 2) and np.isfinite(frame.joint_q).all() and frame.step[7] == 1
envs = VectorEnv("CartPoleBalance", 4)
envs.reset(seed=0)
obs, *_ = envs.step(envs.action_space.sample())
envs.close()
assert obs.shape == (4, 5)
print(json.dumps({"python": sys.version.split()[0], "numpy": np.__version__, "tightloop": tl.__version__}))
"""


def pythons() -> list[Path]:
    """One interpreter of each minor release from the oldest on that is supported, PyPy and the like left out."""
    path = [Path(folder) for folder in os.environ.get("PATH", "").split(os.pathsep)]
    pyenv = sorted((Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions").glob("*/bin"))
    found: dict[tuple[int, int], Path] = {}
    # a build without the lock has an ABI of its own, which no abi3 wheel is for
    lockless = "sysconfig.get_config_var('Py_GIL_DISABLED')"
    ask = f"import sys, sysconfig; print(sys.implementation.name, *sys.version_info[:2], {lockless})"
    for folder in [*path, *pyenv]:
        for python in sorted(folder.glob("python3*")):
            if not re.fullmatch(r"python3(\.\d+)?", python.name) or not os.access(python, os.X_OK):
                continue
            done = subprocess.run([python, "-I", "-c", ask], capture_output=True, text=True, check=False)
            said = done.stdout.split()
            if done.returncode or said[0] != "cpython" or said[3] == "1":
                continue
            version = (int(said[1]), int(said[2]))
            if version >= OLDEST:
                found.setdefault(version, python)
    return [found[version] for version in sorted(found)]


def smoke(python: Path, environment: dict[str, str]) -> dict[str, str]:
    """Use the package that this interpreter has.

    Raises:
        RuntimeError: It does not work; the message is what it said.
    """
    done = subprocess.run([python, "-c", SMOKE], env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise RuntimeError(f"{python}: {done.stderr}")
    return json.loads(done.stdout)


def installed(python: Path, wheel: Path, folder: Path) -> dict[str, str]:
    """Install the wheel into an environment of that Python, with what it depends on, and use it."""
    subprocess.run([python, "-m", "venv", folder], check=True)
    inside = folder / "bin/python"
    pip = [inside, "-m", "pip", "--disable-pip-version-check", "install", "--quiet", wheel]
    subprocess.run(pip, check=True)
    environment = os.environ | {"TIGHTLOOP_ROOT": str(folder / "root")}
    (folder / "root").mkdir()
    found = smoke(inside, environment)
    version = subprocess.run([folder / "bin/tightloop", "--version"], capture_output=True, text=True, check=True)
    return found | {"command line": version.stdout.strip()}


def main() -> int:
    """Try all, and say which do not work."""
    machine = platform.machine()
    (wheel,) = Path(sys.argv[1]).glob(f"*_{machine}.whl")
    print(f"{wheel.name}: {wheel.stat().st_size / 1e6:.1f} MB")
    failed = 0
    for python in pythons():
        folder, begun = Path(tempfile.mkdtemp(prefix="tightloop-wheel-")), time.perf_counter()
        try:
            found = installed(python, wheel, folder)
            told = ", ".join(f"{what} {value}" for what, value in found.items())
            print(f"works: {told}; {time.perf_counter() - begun:.0f} s ({python})", flush=True)
        except (RuntimeError, subprocess.CalledProcessError) as error:
            failed += 1
            print(f"FAILS: {python}: {error}", flush=True)
        finally:
            shutil.rmtree(folder)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
