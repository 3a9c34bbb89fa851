"""Every program of ``examples/`` runs, with few worlds and for a moment, and leaves what it says."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from conftest import REPOSITORY
from tiers import NIGHTLY

EXAMPLES = REPOSITORY / "examples"
# How each is run here; {out} is an empty folder. What is said must match.
RUNS = {
    "franka_lesson.py": ("--worlds 4 --precision f64 --out {out}", r"distance from MuJoCo C +\d\.\de-\d\d"),
    "franka_grasp.py": ("--worlds 8 --out {out}", r"\d+ of 8 worlds lifted the cube"),
    "mpc.py": ("arm --seeds 1", r"1 of 1 seeds succeed"),
    "newton_ik_lesson.py": ("--worlds 4", r"the hand is [01]\.\d mm off its target in the mean, [0-4]\.\d mm at most"),
    "newton_lesson.py": ("--worlds 4", r"target demo: joint 4 from -2\.\d+ to -1\.\d+ rad"),
    "own_task.py": ("", r"mean reward of random actions: \d"),
    "own_quadruped.py": ("", r"mean reward of random actions: -?\d"),
    "randomized_push.py": ("--worlds 32 --out {out}", r"\d+ of 32 within 1 cm"),
    "sysid.py": ("", r"0\.\d+ mrad are expected from the noise of 0\.1 mrad"),
}
PICTURES = {"franka_lesson.py", "franka_grasp.py", "randomized_push.py"}
# Those that need torch or onnxruntime, and the test that runs each, by `make test-rl`.
TRAINING = {
    "evaluation.py": "tests/rl/test_policy_file.py",
    "play.py": "tests/rl/test_ppo.py",
    "policy_file.py": "tests/rl/test_policy_file.py",
    "ppo.py": "tests/rl/test_ppo.py",
    "sim2sim.py": "tests/rl/test_trained.py",
    "train_ddp.py": "tests/rl/test_train_ddp.py",
    "train_jax.py": "tests/rl/test_jax_env.py",
    "train_rsl_rl.py": "tests/rl/test_train_examples.py",
    "train_sb3.py": "tests/rl/test_train_examples.py",
    "train_skrl.py": "tests/rl/test_train_examples.py",
}
# Libraries that each needs, as pip names them.
LIBRARIES = {
    "evaluation.py": "onnxruntime",
    "play.py": "matplotlib onnxruntime tqdm",
    "policy_file.py": "onnx",
    "ppo.py": "matplotlib onnx onnxscript tensorboard torch tqdm",
    "sim2sim.py": "mujoco onnxruntime",
    "train_ddp.py": "matplotlib onnx onnxscript tensorboard torch tqdm",
    "train_jax.py": "jax",
    "train_rsl_rl.py": "onnx onnxscript rsl-rl-lib torch tqdm",
    "train_sb3.py": "stable-baselines3 torch tqdm",
    "train_skrl.py": "skrl torch tqdm",
}
# Runs an example where some modules seem to be missing.
WITHOUT = """
import importlib.util, runpy, sys
find_spec = importlib.util.find_spec
missing, sys.argv = sys.argv[1].split(), sys.argv[2:]
importlib.util.find_spec = lambda name, package=None: None if name in missing else find_spec(name, package)
runpy.run_path(sys.argv[0], run_name="__main__")
"""


@pytest.mark.parametrize("name", RUNS)
def test_an_example_runs(name, tmp_path):
    arguments, said = RUNS[name]
    command = [sys.executable, str(EXAMPLES / name), *arguments.format(out=tmp_path / "out").split()]
    # its working directory is somewhere else: examples find their files themselves
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert re.search(said, done.stdout), done.stdout
    pictures = sorted((tmp_path / "out").glob("*.png"))
    assert [path.stem for path in pictures] == ([Path(name).stem] if name in PICTURES else [])
    assert all(path.stat().st_size > 10_000 for path in pictures)


@pytest.mark.parametrize("name", LIBRARIES)
def test_missing_libraries_are_named_at_the_start(name, tmp_path):
    modules = LIBRARIES[name].replace("rsl-rl-lib", "rsl_rl").replace("-", "_")
    command = [sys.executable, "-c", WITHOUT, modules, str(EXAMPLES / name), "CartPoleBalance", "--out", str(tmp_path)]
    beside = os.environ | {"PYTHONPATH": os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(command, env=beside, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 1 and not list(tmp_path.iterdir())
    assert done.stderr == f"{name}: there is no {', '.join(modules.split())}: pip install {LIBRARIES[name]}\n"
    # its page of use names the same
    assert set(LIBRARIES) == set(TRAINING) and f"pip install {LIBRARIES[name]}\n" in (EXAMPLES / name).read_text()


def test_every_example_has_a_test():
    there = {path.name for path in EXAMPLES.glob("*.py")}
    assert there == {*RUNS, *TRAINING}
    for name, test in TRAINING.items():
        assert name.removesuffix(".py") in (REPOSITORY / test).read_text(), f"{test} does not run {name}"
    texts = {path: path.read_text() for path in [*EXAMPLES.glob("*.py"), *EXAMPLES.glob("learning/*.py")]}
    modules = [f"learning.{path.stem}" for path in EXAMPLES.glob("learning/[a-z]*.py")]
    for module in modules:
        assert any(f"from {module} import" in text for text in texts.values()), f"nobody imports {module}"
    assert [path.name for path in EXAMPLES.glob("*.rs")] == ["franka_lesson.rs"]


@NIGHTLY
def test_the_twin_in_rust_runs():
    # the Rust tests have built it; this makes sure that it is of this checkout
    build = ["cargo", "build", "--release", "--quiet", "--workspace", "--example", "franka_lesson"]
    subprocess.run(build, cwd=REPOSITORY, check=True)
    command = [str(REPOSITORY / "target/release/examples/franka_lesson"), "16"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert re.findall(r"^(\w+): 16 worlds", done.stdout, re.MULTILINE) == ["Target", "Torque"]
    assert "fr3_joint4" in done.stdout
