"""Text for terminals: names and quotes come from files, and codes in them would move the cursor or set colours."""

from __future__ import annotations

#: C0 and C1 codes but for ends of lines and tabs, and those that turn the direction of what follows.
_CODES = {*range(0x20), *range(0x7F, 0xA0), *range(0x202A, 0x202F), *range(0x2066, 0x206A)} - {ord("\n"), ord("\t")}
_SHOWN = {code: f"\\u{code:04x}" for code in _CODES}


def printable(text: str) -> str:
    r"""Return a text whose control characters, but for ends of lines and tabs, are written as ``\u001b`` is."""
    return text.translate(_SHOWN)
