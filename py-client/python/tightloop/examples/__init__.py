"""The programs of the folder ``examples`` of the repository, as the wheel carries them.

``python -m tightloop.examples`` lists, copies and runs them.
"""

from __future__ import annotations

import ast
import runpy
import shutil
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from tightloop.errors import ArgumentError

#: Their folder; in a checkout a link to ``examples``.
FOLDER = Path(__file__).with_name("files")
# Folders of data that programs name in their text.
_DATA = ("assets", "trained")
_SUFFIXES = (".csv", ".onnx", ".safetensors", ".urdf", ".xml")


def programs() -> dict[str, str]:
    """Return what each program does, the first sentence of its text, by name."""
    found = {}
    for path in sorted(FOLDER.glob("*.py")):
        text = path.read_text(encoding="utf-8")
        if '__name__ == "__main__"' in text:
            said = ast.get_docstring(ast.parse(text)) or ""
            found[path.stem] = " ".join(said.split("\n\n")[0].split())
    return found


def program(name: str) -> Path:
    """Return the file of a program.

    Raises:
        ArgumentError: There is none of that name.
    """
    known = programs()
    stem = name.removesuffix(".py")
    if stem not in known:
        raise ArgumentError(f"there is no example {name!r}; there are {', '.join(known)}")
    return FOLDER / f"{stem}.py"


def run(name: str, arguments: Sequence[str]) -> None:
    """Run a program in this process, as if its file were called.

    Args:
        name: The program.
        arguments: Its arguments.

    Raises:
        ArgumentError: There is none of that name.
    """
    path = program(name)
    sys.argv = [str(path), *arguments]
    # it imports its neighbours
    sys.path.insert(0, str(path.parent))
    runpy.run_path(str(path), run_name="__main__")


def copy(name: str, folder: Path) -> list[Path]:
    """Copy a program with what it imports and reads, or ``"all"``, and return the new files.

    Raises:
        ArgumentError: There is none of that name, or a file would be overwritten.
    """
    names = programs() if name == "all" else (name,)
    sources = sorted({source for one in names for source in _parts(program(one))})
    targets = [folder / source.relative_to(FOLDER) for source in sources]
    there = [str(target) for target in targets if target.exists()]
    if there:
        raise ArgumentError(f"{there[0]} is there already; remove it, or give another folder")
    for source, target in zip(sources, targets, strict=True):
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    return targets


def _parts(path: Path, seen: set[Path] | None = None) -> set[Path]:
    """A file, the modules beside it that it imports, and the data that they name."""
    seen = set() if seen is None else seen
    if path in seen:
        return seen
    seen.add(path)
    text = path.read_text(encoding="utf-8")
    for module in _imported(ast.parse(text)):
        beside = FOLDER / module.replace(".", "/")
        for part in (beside.with_suffix(".py"), beside / "__init__.py", beside.parent / "__init__.py"):
            if part.is_file():
                _parts(part, seen)
    for data in _DATA:
        if f"{data}/" in text or f'"{data}"' in text:
            seen |= {found for found in sorted(_files(FOLDER / data)) if found.suffix in _SUFFIXES}
    return seen


def _imported(tree: ast.Module) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (name.name for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield node.module
            yield from (f"{node.module}.{name.name}" for name in node.names)


def _files(folder: Path) -> Iterator[Path]:
    # rglob does not follow the links of a checkout
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.is_dir():
            yield from _files(path)
        else:
            yield path
