"""What is written in the repository for readers: comments, docstrings, names of tests, messages, and documents."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

#: Folders and files whose sentences are read, from the root of the repository.
TREES = ("sim-core", "sim-daemon", "py-client", "tests", "benches", "examples", "docs", ".ci")
#: Endings of files with comments that begin with `#`, and of those that begin with `//`.
HASHES, SLASHES = {".py", ".pyi", ".toml", ".yml", ".sh", ""}, {".rs", ".c", ".h", ".cpp", ".js"}

#: Files with the words of their time, and of tools.
NOT_READ = ("CHANGELOG.md", "Cargo.lock")

_RUST = re.compile(
    r"//[/!]?(?P<comment>[^\n]*)"
    r"|r(?P<hashes>#*)\"(?P<raw>.*?)\"(?P=hashes)"
    r"|b?\"(?P<string>(?:\\.|[^\"\\])*)\""
    r"|'(?:\\[^']+|[^'\\])'"
    r"|#\[test\](?:\s*#\[[^\n]*\])*\s*fn (?P<test>\w+)",
    re.DOTALL,
)
_FENCE = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_CODE = re.compile(r"`[^`\n]*`|https?://\S+")


def _without_code(text: str) -> str:
    return _CODE.sub("`", text)


def _is_message(text: str) -> bool:
    """Whether a string literal is a sentence: three words or more."""
    return len(re.findall(r"[A-Za-z]{2,} +(?=[A-Za-z]{2,})", text)) >= 2


def _of_rust(text: str) -> Iterator[tuple[int, str]]:
    for match in _RUST.finditer(text):
        line = text.count("\n", 0, match.start()) + 1
        if (comment := match["comment"]) is not None:
            yield line, comment
        elif name := match["test"]:
            yield line, name.replace("_", " ")
        else:
            string = match["raw"] or match["string"] or ""
            if _is_message(string):
                yield line, re.sub(r"\\\n\s*", "", string)


def _of_python(text: str) -> Iterator[tuple[int, str]]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string.lstrip("#: ")
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
            yield node.lineno, node.name.replace("_", " ")
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and _is_message(node.value):
            for place, line in enumerate(node.value.splitlines()):
                yield node.lineno + place, line


def _of_hashes(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        if match := re.search(r"(?:^|\s)#+(?: (.*))?$", line):
            yield number, match[1] or ""


def _of_markdown(text: str) -> Iterator[tuple[int, str]]:
    blank = _FENCE.sub(lambda fence: "\n" * fence[0].count("\n"), text)
    yield from enumerate(blank.splitlines(), 1)


def written(file: Path, text: str) -> Iterator[tuple[int, str]]:
    """Yield what a file says to its readers, with the line of each, code in backticks left out."""
    if file.suffix in (".py", ".pyi"):
        found = _of_python(text)
    elif file.suffix in SLASHES:
        found = _of_rust(text)
    elif file.suffix == ".md":
        found = _of_markdown(text)
    else:
        found = _of_hashes(text)
    for line, sentence in found:
        yield line, _without_code(sentence)


def files(root: Path) -> list[Path]:
    """Return the files of the repository that people write."""
    found = [file for tree in TREES for file in (root / tree).rglob("*") if file.is_file()]
    found += [*root.glob("*.md"), root / "Makefile", root / "Cargo.toml"]
    endings = HASHES | SLASHES | {".md"}
    kept = [file for file in found if file.suffix in endings and "__pycache__" not in file.parts]
    return sorted(file for file in kept if file.name not in NOT_READ)
