"""Commands that documents, workflows and hooks name: found in their text, and looked up in the repository."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

from conftest import REPOSITORY

# Folders that builds make, or that are not ours.
IGNORED = {"target", "out", ".venv", ".git", "node_modules"}
CARGO_COMMANDS = {"add", "bench", "build", "check", "clippy", "doc", "fmt", "install", "run", "test", "tree"}
# Subcommands that are programs of their own: `make coverage` installs the first, the second is optional.
CARGO_PLUGINS = {"llvm-cov", "nextest"}
# Options of cargo with a value that is not looked up here.
CARGO_VALUES = {"--features", "--manifest-path", "--output-dir", "--root", "--target", "--version", "-E", "-j"}
TARGET_FOLDERS = {"--test": "tests", "--bench": "benches", "--example": "examples"}
FILE_ENDINGS = (".py", ".sh", ".rs", ".md", ".toml", ".yml", ".urdf", "/")

SPAN = re.compile(r"`([^`]+)`")
FENCE = re.compile(r"^ *```(\w*)[^\n]*\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)


# What there is.


def files(*endings: str) -> list[Path]:
    """Files of the repository with one of these endings."""
    found = []
    for folder, folders, names in os.walk(REPOSITORY):
        folders[:] = [name for name in folders if name not in IGNORED]
        found += [Path(folder, name) for name in names if name.endswith(endings)]
    return found


@cache
def sources(ending: str) -> dict[Path, str]:
    return {path: path.read_text() for path in files(ending)}


@cache
def makefile() -> str:
    return (REPOSITORY / "Makefile").read_text()


@cache
def make_targets() -> set[str]:
    heads = re.findall(r"^([a-z][\w -]*):(?!=)", makefile(), re.MULTILINE)
    return {name for head in heads for name in head.split()}


@cache
def crates() -> dict[str, Path]:
    """Folders of the crates, by name."""
    packages = {
        path.parent: re.search(r'^\[package\]\nname = "(.+)"', text, re.M) for path, text in manifests().items()
    }
    return {match.group(1): folder for folder, match in packages.items() if match}


@cache
def manifests() -> dict[Path, str]:
    return {path: text for path, text in sources(".toml").items() if path.name == "Cargo.toml"}


def cargo_targets(crate: str, option: str) -> set[str]:
    """Tests, benches, examples or binaries of a crate: found by their place, or named in its manifest."""
    kind, folder = option.removeprefix("--"), crates()[crate]
    named = re.findall(rf'^\[\[{kind}\]\]\nname = "(.+)"', manifests()[folder / "Cargo.toml"], re.MULTILINE)
    place = folder / TARGET_FOLDERS.get(option, "src/bin")
    return {
        *named,
        *(path.stem for path in place.glob("*.rs")),
        *(path.parent.name for path in place.glob("*/main.rs")),
    }


@cache
def manuals() -> dict[str, str]:
    """Manual pages of tightloop's subcommands, by name; one process writes them all."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "tightloop", "man", folder], check=True, capture_output=True)
        pages = {path.stem: path.read_text().replace("\\-", "-") for path in Path(folder).glob("tightloop-*.1")}
    return {name.removeprefix("tightloop-"): page for name, page in pages.items()}


# What a text names.


def commands_of(name: str, text: str) -> Iterator[str]:
    """Commands of a document, a workflow, the Makefile or a script."""
    if name.endswith(".md"):
        for language, block in FENCE.findall(text):
            if language in ("sh", "bash"):
                yield from block.replace("\\\n", " ").splitlines()
        yield from (span.replace("\n", " ") for span in SPAN.findall(FENCE.sub("", text)))
    elif name.endswith((".yml", ".yaml")):
        lines = re.sub(r"\$\{\{.*?\}\}", "$", text)
        yield from re.findall(r"^ *-? *(?:run|entry): (.+)", lines, re.MULTILINE)
        yield from SPAN.findall(text)
        for entries in re.findall(r"^ *target: \[(.+)\]", text, re.MULTILINE):
            yield f"make {entries.replace(',', ' ')}"
    elif name.endswith("Makefile"):
        recipes = re.findall(r"^\t[@-]*(.+)", text.replace("\\\n", " "), re.MULTILINE)
        yield from (line.replace("$(PYTHON)", "python").replace("$(PYTEST)", "python -m pytest") for line in recipes)
    else:
        yield from text.splitlines()


def documents() -> dict[str, str]:
    """All texts whose commands are checked, by path."""
    paths = [*files(".md", ".yml", ".yaml"), REPOSITORY / "Makefile", *(REPOSITORY / ".ci").iterdir()]
    return {str(path.relative_to(REPOSITORY)): path.read_text() for path in paths}


def words_of(command: str) -> Iterator[list[str]]:
    """Words of each simple command of a shell line, without what stands before its program."""
    line = re.sub(r"(^|\s)#.*|\s\d?>\S*", "", command)
    for simple in re.split(r"&&|\|\|?|;|\$\((?=[a-z])| &(?= |$)", line):
        words = [word.strip("\"'") for word in simple.split()]
        while words and (words[0] in ("if", "then", "else", "exec", "nice", "sudo", "time") or "=" in words[0]):
            words.pop(0)
        if words:
            yield words


# What is wrong with it.


def is_placeholder(word: str) -> bool:
    return word.isupper() or any(sign in word for sign in "$<>{}…*")


def make_errors(words: list[str]) -> Iterator[str]:
    for word in words:
        name, is_variable, _ = word.partition("=")
        if is_variable and not re.search(rf"\$\({name}\)", makefile()):
            yield f"the Makefile reads no variable {name}"
        if not is_variable and not word.startswith("-") and not is_placeholder(word) and word not in make_targets():
            yield f"no make target {word}"


def cargo_errors(words: list[str]) -> Iterator[str]:
    command = next((word for word in words if not word.startswith("+")), "--help")
    if command not in CARGO_COMMANDS | CARGO_PLUGINS and not is_placeholder(command) and not command.startswith("-"):
        yield f"no command cargo {command}"
        return
    named, filters = cargo_arguments(words[words.index(command) + 1 :] if command in words else [])
    packages = [value for option, value in named if option in ("-p", "--package")]
    yield from (f"no crate {name}" for name in packages if name not in crates())
    yield from (
        f"no crate in {value}"
        for option, value in named
        if option == "--path" and not (REPOSITORY / value / "Cargo.toml").exists()
    )
    # without -p and --workspace cargo takes the package of the root
    owners = set(crates()) if "--workspace" in words else set(packages or ["tightloop"]) & set(crates())
    for option, value in named:
        if option in (*TARGET_FOLDERS, "--bin") and not any(value in cargo_targets(crate, option) for crate in owners):
            yield f"no {option} {value} of {', '.join(packages) or 'any crate asked for'}"
    if command in {"test", *CARGO_PLUGINS}:
        for name in filters:
            if not any(re.search(rf"fn \w*{name.rpartition(':')[2]}", text) for text in sources(".rs").values()):
                yield f"no Rust test {name}"


def cargo_arguments(words: list[str]) -> tuple[list[tuple[str, str]], list[str]]:
    """Options that name something of the workspace, and filters of tests."""
    named, filters, rest = [], [], iter(words)
    for word in rest:
        option, _, value = word.partition("=")
        if word == "--":
            break
        if option in ("-p", "--package", *TARGET_FOLDERS, "--bin", "--path"):
            named.append((option, value or next(rest, "")))
        elif option in CARGO_VALUES:
            next(rest, "")
        elif not word.startswith("-") and word not in ("run", "list", "nextest"):
            filters.append(word)
    return named, filters


def python_errors(words: list[str]) -> Iterator[str]:
    if words[:1] == ["-m"] and words[1].startswith("tightloop"):
        place = REPOSITORY / "py-client/python" / words[1].replace(".", "/")
        if not (place.with_suffix(".py").exists() or (place / "__main__.py").exists()):
            yield f"no module {words[1]}"
        if words[1] == "tightloop":
            yield from tightloop_errors(words[2:])
    if words[:2] == ["-m", "benches"]:
        named = [word for word in words[2:3] if not is_placeholder(word)]
        yield from (f"no bench {name}" for name in named if not list((REPOSITORY / "benches").glob(f"*/{name}.py")))
    for word in words:
        path, _, test = word.partition("::")
        if test and (REPOSITORY / path).exists() and f"def {test}(" not in (REPOSITORY / path).read_text():
            yield f"no test {test} in {path}"
    for option, word in pairwise(words):
        if option == "-k" and not any(re.search(rf"def \w*{word}", text) for text in sources(".py").values()):
            yield f"no Python test {word}"


def tightloop_errors(words: list[str]) -> Iterator[str]:
    if not words or words[0].startswith("-") or is_placeholder(words[0]):
        return
    if words[0] not in {*manuals(), "help"}:
        yield f"no command tightloop {words[0]}"
        return
    for flag in (word.partition("=")[0] for word in words[1:] if word.startswith("--")):
        if not re.search(rf"{flag}\b", manuals().get(words[0], "")):
            yield f"tightloop {words[0]} has no {flag}"


PROGRAMS: dict[str, Callable[[list[str]], Iterator[str]]] = {
    "make": make_errors,
    "cargo": cargo_errors,
    "python": python_errors,
    "python3": python_errors,
    "pytest": python_errors,
    "tightloop": tightloop_errors,
}


def file_errors(words: list[str]) -> Iterator[str]:
    """Files in folders of the repository, and programs that cargo builds."""
    for word in words:
        path = word.removeprefix("./").partition("::")[0]
        first, _, rest = path.partition("/")
        built = re.fullmatch(r"target/release/(examples/)?([\w-]+)", path)
        if built:
            option = "--example" if built.group(1) else "--bin"
            if not any(built.group(2) in cargo_targets(crate, option) for crate in crates()):
                yield f"nothing builds {path}"
        elif rest and re.fullmatch(r"[\w./-]+", path) and path.endswith(FILE_ENDINGS):
            # other projects' files are named too: ours begin with a folder of the root
            ours = first not in IGNORED and (REPOSITORY / first).exists()
            if ours and not (REPOSITORY / path).exists():
                yield f"no file {path}"


def errors_of(name: str, text: str) -> tuple[int, list[str]]:
    """How many commands a text names, and what is wrong with them."""
    count, errors = 0, []
    for command in commands_of(name, text):
        for variable in re.findall(r"\b(TIGHTLOOP_\w+)=", command):
            if not any(variable in source for ending in (".rs", ".py") for source in sources(ending).values()):
                errors.append(f"{name}: nothing reads {variable}")
        for program, *words in words_of(command):
            check = PROGRAMS.get(program.rpartition("/bin/")[2])
            if check or program.endswith((".sh", ".py")) or program.startswith(("./", "target/")):
                count += 1
                found = [*(check(words) if check else ()), *file_errors([program, *words])]
                errors += [f"{name}: {error}" for error in found]
    return count, errors
