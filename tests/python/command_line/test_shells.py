"""What the command line gives to shells and to ``man``."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys

import pytest

PROGRAM = [sys.executable, "-m", "tightloop"]


def said(*arguments: str) -> str:
    return subprocess.run([*PROGRAM, *arguments], capture_output=True, text=True, check=True).stdout


def commands() -> set[str]:
    lines = said("--help").partition("Commands:\n")[2].partition("\n\n")[0].splitlines()
    return {line.split()[0] for line in lines} - {"help"}


def test_bash_completes_commands_and_flags(tmp_path):
    script = tmp_path / "tightloop"
    script.write_text(said("completions", "bash"))

    def completed(*words: str) -> set[str]:
        line = (
            f"source {script}; COMP_WORDS=({' '.join(words)} ''); COMP_CWORD={len(words)}; "
            f"_tightloop tightloop '' '{words[-1]}'; printf '%s\\n' \"${{COMPREPLY[@]}}\""
        )
        return set(subprocess.run(["bash", "-c", line], capture_output=True, text=True, check=True).stdout.split())

    assert commands() <= completed("tightloop")
    flags = set(re.findall(r"^ +(?:-\w, )?(--[\w-]+)", said("serve", "--help"), re.MULTILINE))
    assert len(flags) > 12 and flags <= completed("tightloop", "serve")


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_get_scripts_of_theirs(shell):
    script = said("completions", shell)
    assert all(name in script for name in commands()) and "--watch-worlds" in script.replace("-l watch", "--watch")
    if shutil.which(shell):
        subprocess.run([shell, "-n", "/dev/stdin"], input=script, text=True, check=True)


def test_every_command_has_a_manual_page(tmp_path):
    assert said("man", str(tmp_path / "man1")) == ""
    pages = {path.name: path.read_text() for path in (tmp_path / "man1").iterdir()}
    assert set(pages) == {"tightloop.1"} | {f"tightloop-{name}.1" for name in commands()}
    assert all(page.splitlines()[2].startswith(".TH ") for page in pages.values())
    assert "Number of worlds" in pages["tightloop-serve.1"]
    assert pages["tightloop.1"] == said("man")


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    done = subprocess.run([*PROGRAM, "man", str(tmp_path / "file")], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and str(tmp_path / "file") in done.stderr


@pytest.mark.parametrize("command", ["view", "film", "export", "demo"])
def test_commands_of_python_have_the_flags_that_shells_complete(command):
    """``tightloop view --help`` is Python's, ``tightloop help view`` what completions and manual are made of."""
    flags = re.compile(r"^ +(?:-\w, )?(--[\w-]+)", re.MULTILINE)
    of_python, of_shells = said(command, "--help"), said("help", command)
    assert of_python != of_shells, f"`{command}` is not carried out by Python"
    # --version is the whole program's
    assert set(flags.findall(of_python)) == set(flags.findall(of_shells)) - {"--version"}
