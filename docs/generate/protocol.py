"""The wire between a daemon and its clients, from the doc comments of the crate that is it."""

from __future__ import annotations

import re

from generate import rust
from generate.tables import table

INTRODUCTION = """# Protocol

Clients in Python and Rust are part of tightloop, so nobody needs this page to use them. It is for those who want to
know what crosses between the processes, or to write a client of their own; it is made of the doc comments of the
crate `sim-protocol`, and [its rustdoc](api/rust.md) says more. Protocol version {version}: a client and a daemon of
different versions refuse each other by name.

A command goes like this. The controller writes its arrays into a loaned sample of shared memory and sends it; the
daemon copies and checks it, steps all worlds, writes the frame into a sample that the client then reads in place. So
an observation is never copied, and a command is copied once.

## On one screen
"""
HEADERS = "sim-daemon/protocol/src/header.rs"
STRUCTS = (
    ("Head of a command", HEADERS, "CommandHeader"),
    ("What a command asks for", HEADERS, "Op"),
    ("Head of a frame", HEADERS, "FrameHeader"),
    ("Why a command is refused", HEADERS, "RefusalKind"),
    ("Row of a field table", HEADERS, "Row"),
    ("Head of a journal's entry", "sim-daemon/protocol/src/journal.rs", "JournalHeader"),
)


def page() -> str:
    """The page."""
    version = re.search(r"PROTOCOL_VERSION: u32 = (\d+)", rust.source(HEADERS))
    assert version is not None
    parts = [INTRODUCTION.format(version=version.group(1)), rust.module_doc("sim-daemon/protocol/src/lib.rs")]
    parts += ["\n## Samples\n", rust.module_doc(HEADERS)]
    for title, path, name in STRUCTS:
        shown = rust.listing(path, name)
        rows = [[f"`{item.name}`", f"`{item.type}`", item.doc] for item in shown.items]
        if not any(item.type for item in shown.items):
            text = table(["name", "what it is"], [[name, doc] for name, _, doc in rows])
        else:
            text = table(["name", "type", "what it is"], rows)
        parts.append(f"\n## {title}\n\n{shown.doc}\n\n{text}")
    return "\n".join(parts)
