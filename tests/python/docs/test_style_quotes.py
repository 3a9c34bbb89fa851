"""The style guide quotes code that exists: each line of a titled block is in a file of that name."""

from __future__ import annotations

import re

from named_commands import files

from conftest import REPOSITORY

QUOTE = re.compile(r'^```(?:rust|python) title="([^"]+)"\n(.*?)^```$', re.MULTILINE | re.DOTALL)
LINES_MAX, COLUMNS_MAX = 110, 120


def missing(text: str) -> list[str]:
    """Quoted lines that no file of the named kind holds; spaces at both ends and comment signs do not count."""
    wrong = []
    for title, quote in QUOTE.findall(text):
        held = [path.read_text() for path in files(".rs", ".py") if f"/{path}".endswith(f"/{title}")]
        lines = [line.strip().removeprefix("//! ") for line in quote.splitlines() if line.strip()]
        if not any(all(line in source for line in lines) for source in held):
            wrong.append(f"{title}: {lines[0]}")
    return wrong


def test_quoted_code_exists():
    text = (REPOSITORY / "STYLE.md").read_text()
    assert len(QUOTE.findall(text)) >= 5
    assert missing(text) == []


def test_invented_code_is_found():
    blocks = {"energy.rs": "fn drift() {}", "conftest.py": "REPOSITORY = 7", "tests/python/conftest.py": "import os"}
    text = "".join(f'```rust title="{title}"\n{line}\n```\n' for title, line in blocks.items())
    assert missing(text) == ["energy.rs: fn drift() {}", "conftest.py: REPOSITORY = 7"]


def test_the_guide_is_short():
    text = (REPOSITORY / "STYLE.md").read_text().splitlines()
    assert len(text) <= LINES_MAX and max(map(len, text)) <= COLUMNS_MAX
