"""Words of WGSL, with their lines."""

from __future__ import annotations

import re
from dataclasses import dataclass

WORDS = re.compile(
    r"""(?P<space>[ \t\r]+|//[^\n]*)
    |(?P<newline>\n)
    |(?P<number>\d+(?:\.\d*)?(?:e[+-]?\d+)?[fu]?)
    |(?P<name>(?:vec[234]|array)<(?:[^<>]|<[^<>]*>)*>|[A-Za-z_]\w*)
    |(?P<sign>\+\+|\+=|&&|\|\||==|!=|<=|>=|[-+*/%<>!=(){}\[\];,.:@&])""",
    re.VERBOSE,
)


class Refused(ValueError):
    """The text holds something that the translation does not know."""

    def __init__(self, file: str, line: int, reason: str) -> None:
        super().__init__(f"{file}:{line}: {reason}")


@dataclass(frozen=True, slots=True)
class Token:
    """A word, a number or a sign."""

    kind: str
    text: str
    line: int


def tokens(file: str, text: str) -> list[Token]:
    """The words of a text; `file` is for messages.

    Raises:
        Refused: A character that no word begins with.
    """
    found: list[Token] = []
    line, at = 1, 0
    while at < len(text):
        match = WORDS.match(text, at)
        if match is None:
            raise Refused(file, line, f"unknown character {text[at]!r}")
        kind = match.lastgroup or ""
        if kind == "newline":
            line += 1
        elif kind != "space":
            found.append(Token(kind, match[0], line))
        at = match.end()
    found.append(Token("end", "the end of the file", line))
    return found
