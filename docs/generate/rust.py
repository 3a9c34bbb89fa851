"""Structs and enums of the Rust sources: names, types, doc comments, attributes of serde."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

REPOSITORY = Path(__file__).parents[2]


@dataclass
class Item:
    """A field of a struct, or a variant of an enum."""

    name: str  # as it is outside of Rust
    type: str  # "" of a variant without one
    doc: str
    serde: str  # arguments of its #[serde(…)]


@dataclass
class Listing:
    """A struct or an enum."""

    name: str
    doc: str
    serde: str
    items: list[Item] = field(default_factory=list)


def module_doc(path: str) -> str:
    """The `//!` lines at the head of a file, as Markdown whose references are plain code."""
    lines = [line[3:].removeprefix(" ") for line in source(path).splitlines() if line.startswith("//!")]
    return plain("\n".join(lines))


def source(path: str) -> str:
    """A file of the repository."""
    return (REPOSITORY / path).read_text()


def plain(doc: str) -> str:
    """Markdown of rustdoc without its links: ``[`Line`]`` is `Line`, and `crate::Line` too."""
    doc = re.sub(r"\[(`[^`\]]+`)\](?:\([^)]*\))?", r"\1", doc)
    return re.sub(r"`(?:\w+::)+(\w+)`", r"`\1`", doc)


def listing(path: str, name: str) -> Listing:
    """The public struct or enum of that name in a file.

    Raises:
        LookupError: There is none, or a line of it is not understood.
    """
    lines = source(path).splitlines()
    heads = {f"pub {kind} {name} {{": kind for kind in ("struct", "enum")}
    start = next((number for number, line in enumerate(lines) if line in heads), None)
    if start is None:
        raise LookupError(f"{path} has no public struct or enum {name} with braces")
    kind, stop = heads[lines[start]], lines.index("}", start)
    first = start  # of what stands above it without a blank line between
    while first > 0 and lines[first - 1]:
        first -= 1
    head = "\n".join(lines[first:start])
    made = Listing(name, _doc(head), ", ".join(re.findall(r"#\[serde\((.*?)\)\]", head, re.DOTALL)))
    made.items = list(_items(lines[start + 1 : stop], kind, 'rename_all = "lowercase"' in made.serde, path))
    return made


def _items(lines: list[str], kind: str, lowercase: bool, path: str) -> Iterator[Item]:
    """Entries of a body: doc comments, attributes over one line or several, then one line."""
    shape = re.compile(r"pub (\w+): (.+),$" if kind == "struct" else r"(\w+)(?:\((.*)\))?(?: = \d+)?,$")
    docs, attributes, depth = list[str](), "", 0
    for line in map(str.strip, lines):
        if line.startswith("///"):
            docs.append(line)
        elif line.startswith("#[") or depth:
            attributes += line
            depth += line.count("[") - line.count("]")
        elif line:
            match = shape.match(line)
            if match is None:
                raise LookupError(f"{path}: a line is not understood: {line!r}")
            item, type_ = match.groups()
            serde = ", ".join(re.findall(r"#\[serde\((.*?)\)\]", attributes))
            renamed = re.search(r'rename = "(\w+)"', serde)
            outside = renamed.group(1) if renamed else item.lower() if lowercase else item
            yield Item(outside, type_ or "", _doc("\n".join(docs)), serde)
            docs, attributes = [], ""


def _doc(text: str) -> str:
    lines = [line.strip().removeprefix("///").strip() for line in text.splitlines() if line.strip().startswith("///")]
    return plain(" ".join(lines))
