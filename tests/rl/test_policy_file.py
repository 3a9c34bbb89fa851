"""Policies carry metadata, which ``policy_file.py`` writes and ``evaluation.py`` reads."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import onnx
import onnxruntime
import pytest

from tightloop.env import VectorEnv, policy_metadata

EXAMPLES = Path(__file__).parents[2] / "examples"
TRAINED = EXAMPLES / "trained"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)


def metadata(path: Path) -> dict[str, str]:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.get_modelmeta().custom_metadata_map


def test_a_run_leaves_a_policy_with_metadata(tmp_path: Path) -> None:
    done = run(f"{EXAMPLES}/ppo.py", "CartPoleBalance", "--num-envs", "64", "--minutes", "0.02", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    envs = VectorEnv("CartPoleBalance", 1)
    expected = policy_metadata(envs) | {"observation_normalization": "in the graph"}
    envs.close()
    assert metadata(tmp_path / "CartPoleBalance-0" / "policy.onnx") == expected


def test_metadata_is_attached_to_a_policy_without(tmp_path: Path) -> None:
    path = tmp_path / "policy.onnx"
    model = onnx.load(TRAINED / "FrankaReach.onnx")
    del model.metadata_props[:]
    onnx.save(model, path)
    assert not metadata(path)
    done = run(f"{EXAMPLES}/policy_file.py", str(path), "--task", "FrankaReach")
    assert done.returncode == 0 and "task = tightloop/FrankaReach-v0\n" in done.stdout, done.stderr
    there = metadata(TRAINED / "FrankaReach.onnx")
    assert metadata(path) == {name: text for name, text in there.items() if name != "observation_normalization"}
    assert onnx.load(path).graph == model.graph


def test_a_policy_of_another_task_or_no_policy_is_named(tmp_path: Path) -> None:
    path, broken = tmp_path / "policy.onnx", tmp_path / "broken.onnx"
    shutil.copy(TRAINED / "QuadrupedVelocityFlat.onnx", path)
    broken.write_text("none")
    before = path.read_bytes()
    for file, program, said in (
        (path, "policy_file.py", "obs has 50 numbers, and the task has"),
        (broken, "policy_file.py", "is no policy as ONNX"),
        (tmp_path / "lost.onnx", "policy_file.py", "there is no file"),
        (broken, "evaluation.py", "is no policy as ONNX"),
    ):
        done = run(f"{EXAMPLES}/{program}", str(file), "--task", "FrankaReach")
        assert done.returncode == 1 and said in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert path.read_bytes() == before


def test_levels_of_an_evaluation_do_not_depend_on_how_the_task_is_named() -> None:
    code = (
        "import sys, evaluation as e; act = lambda obs: 0 * obs[:, :12]\n"
        "[print(sorted(set(e.episodes(name, act, threads=1)['level']))) for name in sys.argv[1:]]"
    )
    names = ("QuadrupedVelocityRough", "tightloop/QuadrupedVelocityRough-v0")
    done = subprocess.run(
        [sys.executable, "-c", code, *names], cwd=EXAMPLES, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    first, second = done.stdout.splitlines()
    assert first == second and first.count(",") == 9


@pytest.mark.parametrize("path", sorted(TRAINED.glob("*.onnx")), ids=lambda path: path.stem)
def test_trained_policies_carry_the_metadata_of_their_tasks(path: Path) -> None:
    envs = VectorEnv(path.stem, 1)
    expected = policy_metadata(envs)
    envs.close()
    there = metadata(path)
    # an older version may have trained it
    assert {name for name in expected if there.get(name) != expected[name]} <= {"tightloop_version"}


def test_runs_are_evaluated_with_an_interval_over_all_of_them(tmp_path: Path) -> None:
    for seed in (0, 1):
        (tmp_path / f"CartPoleSwingUp-{seed}").mkdir()
        shutil.copy(TRAINED / "CartPoleSwingUp.onnx", tmp_path / f"CartPoleSwingUp-{seed}" / "policy.onnx")
    done = run(f"{EXAMPLES}/evaluation.py", *(str(tmp_path / f"CartPoleSwingUp-{seed}") for seed in (0, 1)))
    assert done.returncode == 0, done.stderr
    rows = re.findall(r"^(.+): return ([\d.]+) \(([\d.]+) to ([\d.]+)\), success", done.stdout, re.M)
    assert [name for name, *_ in rows] == [f"{tmp_path}/CartPoleSwingUp-{s}" for s in (0, 1)] + ["mean of 2 runs"]
    # twice the same policy on the same episodes
    (mean, low, high) = rows[0][1:]
    assert rows[1][1:] == rows[0][1:] and float(low) < float(mean) < float(high)
    assert rows[2][1:] == (mean, mean, mean)
    lost = run(f"{EXAMPLES}/evaluation.py", str(tmp_path))
    assert lost.returncode == 1 and "there is no policy" in lost.stderr
