"""The protocol between a daemon and its clients, from the doc comments of its crate."""

from __future__ import annotations

import re

from generate import rust
from generate.tables import table

HEADERS = "sim-daemon/protocol/src/wire/header.rs"
STRUCTS = (
    ("Header of a command", HEADERS, "CommandHeader"),
    ("Operations of a command", HEADERS, "Op"),
    ("Header of a frame", HEADERS, "FrameHeader"),
    ("Reasons for a refusal", HEADERS, "RefusalKind"),
    ("Row of a field table", HEADERS, "Row"),
    ("Types of entries", HEADERS, "Dtype"),
    ("Header of a journal entry", "sim-daemon/protocol/src/wire/journal_header.rs", "JournalHeader"),
)


CONTROL = "sim-daemon/protocol/src/wire/control.rs"
MESSAGES = (("Requests", "Request"), ("Responses", "Response"))


def messages(name: str) -> str:
    """A table of control messages: each as JSON, and what it means.

    Raises:
        LookupError: There is no such enum, or a line of it is not understood.
    """
    body = re.search(rf"^pub enum {name} {{\n(.*?)^}}", rust.source(CONTROL), re.MULTILINE | re.DOTALL)
    if body is None:
        raise LookupError(f"{CONTROL} has no public enum {name}")
    rows, docs, fields = list[list[str]](), list[str](), list[str]()
    variant = ""
    for line in map(str.strip, body.group(1).splitlines()):
        if line.startswith("///"):
            docs += [] if variant else [line.removeprefix("///").strip()]
        elif match := re.fullmatch(r"(\w+) {", line):
            variant = match.group(1)
        elif match := re.fullmatch(r"(\w+): (.+),", line):
            fields.append(f'"{match.group(1)}": {match.group(2)}')
        elif match := re.fullmatch(r"(\w+)\((\w+)\),", line):
            rows.append([f'`{{"{match.group(1)}": {match.group(2)}}}`', rust.plain(" ".join(docs))])
            docs = []
        elif match := re.fullmatch(r"(\w+),|},", line):
            shown = f'{{"{variant}": {{{", ".join(fields)}}}}}' if variant else f'"{match.group(1)}"'
            rows.append([f"`{shown}`", rust.plain(" ".join(docs))])
            docs, fields, variant = [], [], ""
        else:
            raise LookupError(f"{CONTROL}: {line!r} in {name} is not understood")
    return table(["message", "meaning"], rows)


def _codes(source: str, enum: str) -> list[str]:
    """The numbers of an enum's variants, in order."""
    body = source.partition(f"\npub enum {enum} {{\n")[2].partition("\n}")[0]
    return re.findall(r"^    \w+ = (\d+),", body, re.MULTILINE)


def parts() -> dict[str, str]:
    """Parts of the page `reference/protocol.md`."""
    version = re.search(r"PROTOCOL_VERSION: u32 = (\d+)", rust.source(HEADERS))
    assert version is not None
    structs = []
    for title, path, struct in STRUCTS:
        shown, source = rust.listing(path, struct), rust.source(path)
        rows = [[f"`{item.name}`", f"`{item.type}`", item.doc] for item in shown.items]
        if not any(item.type for item in shown.items):
            coded = [[name, code, doc] for (name, _, doc), code in zip(rows, _codes(source, struct), strict=True)]
            text = table(["name", "code", "meaning"], coded)
        else:
            text = table(["name", "type", "meaning"], rows)
        known = re.search(rf'#\[type_name\("([^"]+)"\)\]\npub struct {struct} ', source)
        doc = shown.doc + (f" Its type name in iceoryx2 is `{known[1]}`." if known else "")
        structs.append(f"## {title}\n\n{doc}\n\n{text}")
    return {
        "version": f"This page describes protocol version {version.group(1)}.",
        "overview": rust.module_doc("sim-daemon/protocol/src/lib.rs"),
        "samples": rust.module_doc(HEADERS),
        "structs": "\n".join(structs),
        "messages": "\n".join(f"## {title} on the service `control`\n\n{messages(name)}" for title, name in MESSAGES),
    }
