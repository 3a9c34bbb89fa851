"""What mkdocs runs: it puts the generated pages among those that are written by hand."""

from __future__ import annotations

import sys
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

REPOSITORY = Path(__file__).parents[2]
sys.path.insert(0, str(REPOSITORY / "docs"))

from generate import command_line, fields, performance, protocol, scene_file, tasks  # noqa: E402

PAGES = {
    "command-line.md": command_line.page,
    "fields.md": fields.page,
    "performance.md": performance.page,
    "protocol.md": protocol.page,
    "scene-file.md": scene_file.page,
    "tasks.md": tasks.page,
}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and the pictures of the repository that pages show."""
    for name, page in PAGES.items():
        files.append(File.generated(config, name, content=page()))
    for picture in ("examples/franka_lesson.png", "examples/trained/FrankaPickCube-1.png"):
        content = (REPOSITORY / picture).read_bytes()
        files.append(File.generated(config, f"pictures/{Path(picture).name}", content=content))
    return files
