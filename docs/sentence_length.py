"""Measure how long the sentences of Markdown files are.

    python docs/sentence_length.py README.md docs/pages

Prints the number of sentences, their mean and 95th percentile length in words, then every sentence of more than 25
words. Code blocks, tables, headings, comments, API directives and generated parts do not count. Inline code counts as
one word.
``tests/python/docs/test_prose.py`` holds README.md and docs/pages to a limit.
"""

from __future__ import annotations

import argparse
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

#: Words above which a sentence is printed.
LONG = 25

_COMMENT = re.compile(r"<!-- generated: .*?<!-- end -->|<!--.*?-->", re.DOTALL)
_FENCE = re.compile(r"^ *(```|~~~)")
# Headings, tables, link targets, and mkdocstrings directives with their options.
_SKIPPED = re.compile(r"^ *(#|\||\[[^\]]+\]: |::: )|^ {4,}\w+:( |$)")
_ITEM = re.compile(r"^ *([-*+]|\d+\.) +")
_INLINE_CODE = re.compile(r"(`+)(?!`).+?\1")
_LINK = re.compile(r"!?\[((?:[^\[\]]|\[[^\]]*\])*)\](?:\([^)]*\)|\[[^\]]*\])")
_IMAGE = re.compile(r"^ *!\[[^\]]*\]\([^)]*\) *$")
_ABBREVIATION = re.compile(r"\b(e\.g|i\.e|vs|cf|etc|approx|Fig|No)\.(?= )")
# Stands for a blank of inline code, so that the code stays one word.
_BLANK = "␣"
_END = re.compile(r"(?<=[.!?…])[\"')*_]*\s+(?=[\"'(*_]*[A-Z0-9`«])")


@dataclass(frozen=True)
class Sentence:
    """One sentence of a file."""

    line: int  # where its paragraph begins, counted from 1
    text: str

    @property
    def words(self) -> int:
        """How many words it has."""
        return sum(any(letter.isalnum() for letter in word) for word in self.text.split())


@dataclass(frozen=True)
class Summary:
    """Lengths of a set of sentences, in words."""

    count: int
    mean: float
    percentile_95: int
    longest: int


def sentences(markdown: str) -> list[Sentence]:
    """Return the sentences of a Markdown text, in order."""
    found = list[Sentence]()
    for line, paragraph in _paragraphs(markdown):
        text = _INLINE_CODE.sub(lambda code: code.group().replace(" ", _BLANK), paragraph)
        text = _LINK.sub(r"\1", text)
        text = _ABBREVIATION.sub(r"\1", text)
        found += [Sentence(line, part) for part in _END.split(text) if any(map(str.isalnum, part))]
    return found


def _paragraphs(markdown: str) -> Iterator[tuple[int, str]]:
    """Paragraphs and list items, each on one line, with the number of its first line."""
    # a comment keeps its line breaks, so that lines are still counted right
    lines = _COMMENT.sub(lambda match: "\n" * match.group().count("\n"), markdown).splitlines()
    in_code, start, parts = False, 0, list[str]()
    for number, line in enumerate([*lines, ""], start=1):
        fence = _FENCE.match(line) is not None
        in_code ^= fence
        skipped = fence or in_code or not line.strip() or _SKIPPED.match(line) or _IMAGE.match(line)
        item = _ITEM.match(line)
        if (skipped or item) and parts:
            yield start, " ".join(parts)
            parts = []
        if not skipped:
            start = start if parts else number
            parts.append(line[item.end() :] if item else line.strip().lstrip("> "))


def summary(found: Sequence[Sentence]) -> Summary:
    """Return mean, 95th percentile and maximum of the lengths; zeros if there is no sentence."""
    lengths = sorted(sentence.words for sentence in found)
    if not lengths:
        return Summary(0, 0.0, 0, 0)
    rank = math.ceil(0.95 * len(lengths)) - 1
    return Summary(len(lengths), sum(lengths) / len(lengths), lengths[rank], lengths[-1])


def markdown_files(paths: Sequence[Path]) -> list[Path]:
    """Return the given files, and all Markdown files of the given folders."""
    return [file for path in paths for file in (sorted(path.rglob("*.md")) if path.is_dir() else [path])]


def main() -> None:
    """Print one row per file, their total, and the long sentences."""
    parser = argparse.ArgumentParser(description="Print how long the sentences of Markdown files are.")
    parser.add_argument("paths", nargs="+", type=Path, help="Markdown files, or folders of them")
    by_file = {file: sentences(file.read_text()) for file in markdown_files(parser.parse_args().paths)}
    print("| file | sentences | mean | 95th percentile | longest |\n|---|---|---|---|---|")
    total = [sentence for found in by_file.values() for sentence in found]
    for name, counted in [*by_file.items(), ("total", total)]:
        row = summary(counted)
        print(f"| {name} | {row.count} | {row.mean:.1f} | {row.percentile_95} | {row.longest} |")
    for file, found in by_file.items():
        for sentence in found:
            if sentence.words > LONG:
                print(f"{file}:{sentence.line}: {sentence.words} words: {sentence.text.replace(_BLANK, ' ')}")


if __name__ == "__main__":
    main()
