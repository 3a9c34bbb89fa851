"""The protocol between a daemon and its clients, from the doc comments of its crate."""

from __future__ import annotations

import re

from generate import rust
from generate.tables import table

HEADERS = "sim-daemon/protocol/src/header.rs"
STRUCTS = (
    ("Header of a command", HEADERS, "CommandHeader"),
    ("Operations of a command", HEADERS, "Op"),
    ("Header of a frame", HEADERS, "FrameHeader"),
    ("Reasons for a refusal", HEADERS, "RefusalKind"),
    ("Row of a field table", HEADERS, "Row"),
    ("Header of a journal entry", "sim-daemon/protocol/src/journal_header.rs", "JournalHeader"),
)


def parts() -> dict[str, str]:
    """Parts of the page `protocol.md`."""
    version = re.search(r"PROTOCOL_VERSION: u32 = (\d+)", rust.source(HEADERS))
    assert version is not None
    structs = []
    for title, path, name in STRUCTS:
        shown = rust.listing(path, name)
        rows = [[f"`{item.name}`", f"`{item.type}`", item.doc] for item in shown.items]
        if not any(item.type for item in shown.items):
            text = table(["name", "meaning"], [[name, doc] for name, _, doc in rows])
        else:
            text = table(["name", "type", "meaning"], rows)
        structs.append(f"## {title}\n\n{shown.doc}\n\n{text}")
    return {
        "version": f"This page describes protocol version {version.group(1)}.",
        "overview": rust.module_doc("sim-daemon/protocol/src/lib.rs"),
        "samples": rust.module_doc(HEADERS),
        "structs": "\n".join(structs),
    }
