"""``examples/train_ddp.py``: two processes of torchrun learn one policy."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples/train_ddp.py"


def test_two_ranks_learn_to_balance_with_equal_weights(tmp_path: Path) -> None:
    launch = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2"]
    command = [*launch, str(EXAMPLE), "CartPoleBalance", "--rollouts", "40", "--out", str(tmp_path)]
    # the program ends with an error if the weights of its ranks differ
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=600)
    assert done.returncode == 0, done.stderr
    assert re.search(r"CartPoleBalance, seed 0: 0\.5 M steps in \d+ s on 2 ranks", done.stdout), done.stdout
    said = re.search(r"^return ([\d.]+); ", done.stdout, re.MULTILINE)
    # an untrained policy falls after some 40 steps of 500
    assert said and float(said.group(1)) > 400, done.stdout
    assert (tmp_path / "CartPoleBalance-0/policy.onnx").stat().st_size > 10_000


def test_without_torchrun_the_error_says_how_to_start_it(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(EXAMPLE), "CartPoleBalance"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 1 and "torchrun --nproc-per-node 2" in done.stderr
