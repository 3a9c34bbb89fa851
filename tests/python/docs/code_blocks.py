"""Code blocks of the documents, taken from Markdown and run one after the other, as a reader would."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import tightloop as tl
from processes import wait_until
from tightloop.env import VectorEnv

# A block that cannot be run says what it needs, where readers see it: ```sh title="needs a network"
NEEDS = re.compile(r'title="(needs [^"]+)"')
FENCE = re.compile(r"^```(\w+)([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SHOWN = {"text"}  # output and drawings


@dataclass(frozen=True)
class CodeBlock:
    """A fenced code block of a page."""

    page: str
    line: int
    language: str
    needs: str  # "" of one that runs
    text: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks(page: str, text: str) -> list[CodeBlock]:
    """All fenced blocks of a page, in order."""
    found = []
    for match in FENCE.finditer(text):
        needs = NEEDS.search(match.group(2))
        line = text.count("\n", 0, match.start()) + 1
        found.append(CodeBlock(page, line, match.group(1), needs.group(1) if needs else "", match.group(3)))
    fences = sum(line.startswith("```") for line in text.splitlines())
    assert fences == 2 * len(found), f"{page}: a fence has no language, or no end"
    return found


class PageRunner:
    """Runs a page's blocks in a folder of their own, where ``examples`` is that of the repository."""

    def __init__(self, folder: Path, repository: Path, given: dict[str, Any]) -> None:
        self.folder = folder
        self.names: dict[str, Any] = {"__name__": "page"} | given
        self.started: list[subprocess.Popen[bytes]] = []
        (folder / "examples").symlink_to(repository / "examples")
        (folder / "home").mkdir()
        beside = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
        self.environment = os.environ | {"PATH": beside, "HOME": str(folder / "home"), "MPLBACKEND": "Agg"}

    def run(self, block: CodeBlock) -> None:
        """Run a block; what it says is wrong is a failure of the test."""
        if block.language == "python":
            # its lines are counted from the page's first, so that a traceback leads there
            code = compile("\n" * block.line + block.text, block.page, "exec")
            exec(code, self.names)
        elif block.language in ("sh", "bash"):
            self._shell(block)
        elif block.language == "toml":
            self._scene(block)
        else:
            assert block.language in SHOWN, f"{block}: {block.language} is neither run nor shown"

    def _shell(self, block: CodeBlock) -> None:
        # a recording is read when it is whole
        if ".tlrec" in block.text and " record " not in block.text:
            self._await_end_of_background()
        said = self.folder / f"said-{block.line}.txt"
        with said.open("wb") as out:
            # a group of its own, so that what stays in the background is found at the page's end
            shell = subprocess.Popen(
                ["bash", "-euo", "pipefail", "-c", block.text],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
                start_new_session=True,
            )
        self.started.append(shell)
        assert shell.wait(timeout=120) == 0, f"{block}:\n{said.read_text()}"
        # a reader's next line comes later than ours
        for name in re.findall(r"\bserve\b.*--name (\S+).*&$", block.text, re.MULTILINE):
            wait_for(name, self.environment)
        for file in re.findall(r"\btightloop record \S+ (\S+).*&$", block.text, re.MULTILINE):
            assert wait_until((self.folder / file).exists, 60), f"no file {file}"

    def _scene(self, block: CodeBlock) -> None:
        head = "" if re.search(r"^dt =", block.text, re.MULTILINE) else "dt = 0.002\nsubsteps = 8\n"
        file = self.folder / f"scene-{block.line}.toml"
        file.write_text(head + block.text)
        scene = tl.Scene.load(file)
        tl.Dynamics(scene)  # describes it, and compiles its model

    def close(self) -> None:
        """End what the page left running."""
        for value in list(self.names.values()):
            if isinstance(value, tl.Sim | VectorEnv):
                value.close()
        for shell in self.started:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGTERM)
        self._await_end_of_background()

    def _await_end_of_background(self) -> None:
        alone = wait_until(lambda: not any(_lives(shell.pid) for shell in self.started), 60)
        assert alone, "what a page started goes on"


def wait_for(name: str, environment: dict[str, str]) -> None:
    """Wait until a daemon of that name runs."""
    command = [sys.executable, "-m", "tightloop", "list", "--names"]

    def runs() -> bool:
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        return name in done.stdout.split()

    assert wait_until(runs, 60), f"no daemon {name}"


def _lives(group: int) -> bool:
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@contextlib.contextmanager
def reading(folder: Path, repository: Path, **given: Any) -> Iterator[PageRunner]:
    """A reader of one page in that folder, which is then the working directory."""
    reader, before = PageRunner(folder, repository, given), Path.cwd()
    os.chdir(folder)
    try:
        yield reader
    finally:
        os.chdir(before)
        reader.close()
        shutil.rmtree(folder / "home")
