"""The examples and the trainer of the wheel: listed, copied with all that they need, and run."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from test_examples import EXAMPLES, LIBRARIES, WITHOUT

import tightloop
from tightloop import examples
from tightloop.errors import ArgumentError

INSTALLED = Path(tightloop.__file__).parent / "examples" / "files"


def call(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *arguments], cwd=cwd, capture_output=True, text=True, timeout=120, check=False
    )


def test_the_wheel_has_the_examples_of_the_repository():
    there = {str(path.relative_to(EXAMPLES)) for path in EXAMPLES.rglob("*.py")}
    assert {str(path.relative_to(INSTALLED)) for path in INSTALLED.rglob("*.py")} == there
    for name in there:
        assert (INSTALLED / name).read_bytes() == (EXAMPLES / name).read_bytes(), f"{name}: make wheel"
    assert (INSTALLED / "trained/FrankaReach.onnx").is_file()


def test_every_program_is_listed_with_what_it_does(tmp_path):
    programs = {path.stem for path in EXAMPLES.glob("*.py")}
    for arguments in ([], ["list"]):
        done = call("tightloop.examples", *arguments, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
        listed = {line.split()[0]: line.split()[1:] for line in done.stdout.splitlines() if line[0] != " "}
        assert set(listed) == programs and all(len(words) > 3 for words in listed.values()), done.stdout


def test_a_copy_has_all_that_it_imports_and_runs(tmp_path):
    done = call("tightloop.examples", "copy", "own_task", "mine", cwd=tmp_path)
    assert done.returncode == 0 and sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["own_task.py"], (
        done.stderr
    )
    # with modules, data and a folder of results in the working directory
    done = call("tightloop.examples", "copy", "mpc", "mine", cwd=tmp_path)
    assert (tmp_path / "mine/planning/ilqr.py").is_file(), done.stderr
    # of a package, the modules that it imports
    done = call("tightloop.examples", "copy", "evaluation", "shown", cwd=tmp_path)
    copied = sorted(str(path.relative_to(tmp_path / "shown")) for path in (tmp_path / "shown").rglob("*.*"))
    assert copied == ["evaluation.py", "learning/__init__.py", "learning/program.py"], done.stderr
    done = call("tightloop.examples", "copy", "franka_lesson", "mine", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    lesson = [sys.executable, str(tmp_path / "mine/franka_lesson.py"), "--worlds", "2"]
    done = subprocess.run(lesson, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and (tmp_path / "out/franka_lesson.png").is_file(), done.stderr


def test_nothing_is_overwritten_and_wrong_names_are_reported(tmp_path):
    own = tmp_path / "mine" / "own_task.py"
    own.parent.mkdir()
    own.write_text("changed")
    done = call("tightloop.examples", "copy", "all", "mine", cwd=tmp_path)
    assert done.returncode == 2 and "own_task.py is there already" in done.stderr and own.read_text() == "changed"
    assert [path.name for path in own.parent.iterdir()] == ["own_task.py"]
    done = call("tightloop.examples", "run", "own_tsk", cwd=tmp_path)
    assert done.returncode == 2 and "no example 'own_tsk'; there are" in done.stderr and "own_task" in done.stderr
    with pytest.raises(ArgumentError, match="learning"):
        examples.program("learning")


def test_all_are_copied_into_a_folder(tmp_path):
    done = call("tightloop.examples", "copy", "all", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    copied = {str(path.relative_to(tmp_path / "examples")) for path in (tmp_path / "examples").rglob("*.py")}
    assert copied == {str(path.relative_to(EXAMPLES)) for path in EXAMPLES.rglob("*.py")}


def test_a_program_runs_by_its_name_with_its_arguments(tmp_path):
    done = call("tightloop.examples", "run", "own_task", cwd=tmp_path)
    assert done.returncode == 0 and "mean reward of random actions" in done.stdout, done.stderr
    done = call("tightloop.examples", "run", "randomized_push", "--help", cwd=tmp_path)
    assert done.returncode == 0 and "--worlds" in done.stdout, done.stderr
    assert not list(tmp_path.iterdir())


def test_the_trainer_says_what_to_install(tmp_path):
    import tightloop.train.__main__ as trainer

    command = [sys.executable, "-c", WITHOUT, LIBRARIES["ppo.py"], str(trainer.__file__), "CartPoleBalance"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    names = LIBRARIES["ppo.py"]
    said = f"ppo.py: there is no {', '.join(names.split())}: pip install {names}\n"
    assert (done.returncode, done.stderr) == (1, said) and not list(tmp_path.iterdir())
