"""A container made of the system's own tools: a fresh root, its own processes, and a small ``/dev/shm``."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

import tightloop as tl

# A user and a group that no database knows.
STRANGER = 12345
_PACKAGES = Path(tl.__file__).parents[1]
_NAMESPACES = ["unshare", "--mount", "--pid", "--fork", "--kill-child", "--propagation=private"]
# Arguments: mount options of /dev/shm, or `none`; `proc` or `none`; the new root; folders up to `--`; the command.
# The root is read-only in the end. The command is process 1, as a container's is.
_SCRIPT = """
shm=$1 proc=$2 root=$3; shift 3
mount -t tmpfs -o mode=755 tmpfs "$root"
mkdir "$root/tmp" "$root/proc" "$root/dev"
mount -t tmpfs -o size=64m,mode=1777 tmpfs "$root/tmp"
while [ "$1" != -- ]; do
  mkdir -p "$root$1"; mount --bind "$1" "$root$1"; shift
done
shift
for link in bin lib lib64 sbin; do [ -L /$link ] && cp -P /$link "$root/$link"; done
if [ $proc = proc ]; then mount -t proc proc "$root/proc"; fi
for device in null zero urandom; do
  touch "$root/dev/$device"; mount --bind /dev/$device "$root/dev/$device"
done
if [ "$shm" != none ]; then mkdir "$root/dev/shm"; mount -t tmpfs -o "$shm" tmpfs "$root/dev/shm"; fi
mount -o remount,bind,ro "$root"
cd "$root"
exec chroot . "$@"
"""


def namespaces() -> list[str]:
    """Return the command that runs another one with mounts and processes of its own; skip the test without it."""
    user = [] if os.geteuid() == 0 else ["--map-root-user"]
    command = [*_NAMESPACES, *user]
    if subprocess.run([*command, "true"], capture_output=True, check=False).returncode:
        pytest.skip("no namespace of mounts can be made here: it needs root, or user namespaces")
    return command


def contained(
    folder: Path,
    arguments: Sequence[str],
    *,
    shm: str = "size=64m,mode=1777",
    proc: bool = True,
    user: int = 0,
    environment: Mapping[str, str] | None = None,
) -> subprocess.CompletedProcess[str]:
    """Run this Python with arguments in a container, as its process 1, without ``HOME`` and without ``/etc``.

    Args:
        folder: An empty folder for the root of the container.
        arguments: Arguments of Python.
        shm: Options of the file system at ``/dev/shm``; ``"none"`` leaves the folder out.
        proc: Whether ``/proc`` is there.
        user: Number of user and group. Another one than 0 needs root.
        environment: Variables besides those that Python needs.
    """
    if user and os.geteuid() != 0:
        pytest.skip("only root may become another user")
    # the interpreter's folder may be one that only its user can open: the container has it below folders of its own
    wanted = {"/usr", sys.base_prefix, sys.prefix, str(_PACKAGES)}
    wanted |= {f"/{name}" for name in ("bin", "lib", "lib64") if Path(f"/{name}").is_dir()}
    mounted = [path for path in sorted(wanted) if not Path("/", Path(path).name).is_symlink() or path.count("/") > 1]
    folders = [path for path in mounted if not any(Path(path).is_relative_to(top) for top in mounted if top != path)]
    variables = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(_PACKAGES), "PYTHONDONTWRITEBYTECODE": "1"}
    variables |= environment or {}
    as_user = ["setpriv", f"--reuid={user}", f"--regid={user}", "--clear-groups"] if user else []
    given = [f"{name}={value}" for name, value in variables.items()]
    program = [shutil.which("env") or "env", "-i", *given, *as_user, sys.executable, *arguments]
    script = ["bash", "-euc", _SCRIPT, "container", shm, "proc" if proc else "none", str(folder), *folders, "--"]
    return subprocess.run(
        [*namespaces(), *script, *program], capture_output=True, text=True, timeout=60, check=False, cwd="/"
    )
