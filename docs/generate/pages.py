"""Pages whose tables repeat what the code says: what stands between the two marks is generated.

    make pages      # or, in docs: python -m generate.pages

writes it anew. A page has ``<!-- generated: NAME -->`` before a part of its module, and ``<!-- end -->`` after it. A
test compares the repository's pages with the code. The site's are filled at each build. What stands between
``<!-- forge -->`` and ``<!-- end -->`` is for readers of the repository, and not on the site.
"""

from __future__ import annotations

import os.path
import re
from collections.abc import Callable
from pathlib import Path

from generate import command_line, fields, protocol, scene_file, tasks
from generate.rust import REPOSITORY

DOCS = REPOSITORY / "docs/pages"
#: The parts of each page, by their names.
PARTS: dict[str, Callable[[], dict[str, str]]] = {
    "reference/command-line.md": command_line.parts,
    "reference/fields.md": fields.parts,
    "reference/protocol.md": protocol.parts,
    "reference/scene-file.md": scene_file.parts,
    "reference/tasks.md": tasks.parts,
}

_FORGE = re.compile(r"<!-- forge -->.*?<!-- end -->\n*", re.DOTALL)
_PART = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->\n", re.DOTALL)
_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(((?:\.\./)+[^)]+)\)")


def page(name: str) -> str:
    """A page as the site has it; `hooks` adds results to that of performance.

    Raises:
        LookupError: The page lacks the place of a part, or has one that no part is for.
    """
    return fill(name, (DOCS / name).read_text())


def fill(name: str, text: str) -> str:
    """A page's text as the site has it: with its generated parts, without marks and what is for a forge."""
    return _PART.sub(lambda part: part[2].strip() + "\n", write(name, _FORGE.sub("", text)))


def write(name: str, text: str) -> str:
    """A page's text with its generated parts between their marks, as the repository has it."""
    parts = PARTS[name]() if name in PARTS else {}
    places = {part[1] for part in _PART.finditer(text)}
    if places != set(parts):
        raise LookupError(f"docs/pages/{name} has places for {sorted(places)}; give it those for {sorted(parts)}")
    return _PART.sub(lambda part: f"<!-- generated: {part[1]} -->\n\n{parts[part[1]].strip()}\n\n<!-- end -->\n", text)


def handwritten(text: str) -> str:
    """A page's text without its generated parts."""
    return _PART.sub("", text)


def inside(name: str, text: str) -> str:
    """A page's text without links that leave docs/pages: pictures are taken along, of other links the words stay."""

    def moved(match: re.Match[str]) -> str:
        picture, words, target = match.groups()
        if _leaves(name, target) is None:
            return match.group()
        up = "../" * name.count("/")
        return f"![{words}]({up}pictures/{Path(target).name})" if picture else words

    return _LINK.sub(moved, text)


def pictures() -> list[Path]:
    """Pictures of the repository that pages show from outside of docs/pages."""
    found = set[Path]()
    for path in DOCS.rglob("*.md"):
        name = str(path.relative_to(DOCS))
        shown = [target for picture, _, target in _LINK.findall(path.read_text()) if picture]
        found |= {file for target in shown if (file := _leaves(name, target)) is not None}
    return sorted(found)


def _leaves(name: str, target: str) -> Path | None:
    """The file that a link of a page leads to; None if it is in docs/pages."""
    file = Path(os.path.normpath((DOCS / name).parent / target.partition("#")[0]))
    return None if file.is_relative_to(DOCS) else file


if __name__ == "__main__":
    for name in PARTS:
        (DOCS / name).write_text(write(name, (DOCS / name).read_text()))
