"""Brings published robots into out/published: wheels from PyPI, unpacked, and what their xacro files make.

Wheels are unpacked, never installed or built: pybullet has none for every Python, but its robots are the same in all.
What is there already stays, so this may run any number of times.
"""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).parents[3]
REQUIREMENTS = REPOSITORY / "py-client/requirements-published.txt"
PUBLISHED = REPOSITORY / "out/published"
# Where each wheel keeps what is wanted of it
CONTENTS = {"pybullet": "pybullet_data/", "rtb-data": "rtbdata/", "pyyaml": "yaml/", "xacro": "xacro/"}
# A platform that every one of these wheels has been made for
PLATFORM = "--python-version 3.11 --implementation cp --platform manylinux2014_x86_64".split()

# Names that URDF files give to packages, where the wheel's folder has another
PACKAGES = {
    "rtb-data-1.1.0": {
        "abb_irb140_support": "abb_irb140",
        "armer_xarm": "../armer_xarm",
        "pxpincher_description": "pxpincher",
    },
    "rtb-data-2.0.0": {
        "abb_irb140": "abb_irb140_description",
        "abb_irb140_support": "abb_irb140_description",
        "armer_xarm": "../armer_xarm",
        "ridgeback_description": "clearpath_ridgeback_description",
    },
}
# What xacro files need from outside the wheels, or miss within: no robot can be made of these
BROKEN_XACRO = {
    "accessories/": "a sensor's mount, whose package `lms1xx` is in neither wheel",
    "kr210l150.xacro": "uses `deg`, which it does not define",
    "yumi_description/urdf/yumi": "leaves its interface to the user; the wheel has it as yumi.urdf, too",
    "pxpincher/urdf/pincher_gripper": "a part, to whose user `color` is left",
    "pxpincher/urdf/turtlebot_gripper": "a part, to whose user `color` is left",
}


def main() -> None:
    PUBLISHED.mkdir(parents=True, exist_ok=True)
    lines = (line.split("#")[0].strip() for line in REQUIREMENTS.read_text().splitlines())
    for requirement in filter(None, lines):
        name, version = requirement.split("==")
        folder = PUBLISHED / f"{name}-{version}"
        if not folder.exists():
            print(f"fetching {requirement}", flush=True)
            unpack(requirement, CONTENTS[name], folder)
    for folder in sorted(PUBLISHED.glob("rtb-data-*")):
        link_packages(folder)
    for folder in sorted([*PUBLISHED.glob("pybullet-*"), *PUBLISHED.glob("rtb-data-*")]):
        expanded = folder / "expanded"
        if not expanded.exists() or expanded.stat().st_mtime < Path(__file__).stat().st_mtime:
            expand_all(folder, expanded)


def unpack(requirement: str, contents: str, folder: Path) -> None:
    """One wheel's contents in a folder, which appears only when it is whole."""
    with tempfile.TemporaryDirectory(dir=PUBLISHED, prefix=".fetch-") as scratch:
        command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "download", "--quiet", "--no-deps"]
        command += ["--only-binary", ":all:", *PLATFORM, "--dest", scratch, requirement]
        subprocess.run(command, check=True)
        (wheel,) = Path(scratch).glob("*.whl")
        with zipfile.ZipFile(wheel) as archive:
            for member in archive.namelist():
                if member.startswith(contents):
                    archive.extract(member, Path(scratch) / "wheel")
        (Path(scratch) / "wheel").rename(folder)


def link_packages(folder: Path) -> None:
    """`packages/NAME` for every package of a wheel, by the name that its files use."""
    xacro, packages = folder / "rtbdata/xacro", folder / "packages"
    names = {path.name: path for path in xacro.iterdir() if path.is_dir()}
    for path in (xacro / "kuka_description").iterdir():
        names |= {path.name: path, f"{path.name}_support": path}
    names |= {name: xacro / own for name, own in PACKAGES[folder.name].items()}
    packages.mkdir(exist_ok=True)
    for name, path in names.items():
        if not (packages / name).exists():
            (packages / name).symlink_to(path)


def expand_all(folder: Path, expanded: Path) -> None:
    """Every xacro file of a wheel that makes a robot, as `expanded/….urdf`."""
    expand = expander(folder / "packages")
    shutil.rmtree(expanded, ignore_errors=True)
    scratch = folder / ".expanded"
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    found = sorted(folder.rglob("*.xacro"))
    # one that pybullet ships as URDF, with the substitutions still in it
    found += sorted(folder.rglob("husky.urdf"))
    for path in found:
        if any(broken in str(path) for broken in BROKEN_XACRO):
            continue
        # it warns of each property that is set twice
        with contextlib.redirect_stderr(io.StringIO()):
            text = expand(path)
        if len(re.findall(r"<link\s", text)) > 1:
            target = scratch / path.name.split(".")[0]
            target.with_suffix(".urdf").write_text(text)
    scratch.rename(expanded)


def expander(packages: Path):
    """Turns a xacro file into URDF text; `$(find NAME)` looks into a folder of packages."""
    sys.path[:0] = [str(path) for name in ("xacro", "pyyaml") for path in PUBLISHED.glob(f"{name}-*")]
    import xacro
    from xacro import substitution_args

    def find(package: str) -> str:
        if not (packages / package).exists():
            raise substitution_args.SubstitutionException(f"package {package} is not in {packages}")
        return str((packages / package).resolve())

    # xacro would ask ROS, which is not here
    substitution_args._eval_find = find
    return lambda path: xacro.process_file(str(path)).toprettyxml(indent="  ")


if __name__ == "__main__":
    main()
