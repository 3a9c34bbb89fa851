"""``examples/ppo.py`` and ``examples/play.py``: they learn, come back after a kill, and leave what they say."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, *arguments], capture_output=True, text=True, check=False)


def curve(folder: Path) -> list[dict[str, str]]:
    with (folder / "curve.csv").open() as file:
        return list(csv.DictReader(file))


def test_it_learns_to_balance_and_its_policy_plays(tmp_path: Path) -> None:
    done = run(
        f"{EXAMPLES}/ppo.py",
        "CartPoleBalance",
        "--minutes",
        "0.5",
        "--evaluate",
        "5",
        "--out",
        str(tmp_path),
        "--threads",
        "1",
    )
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "CartPoleBalance-0"
    rows = curve(folder)
    # an untrained policy falls after some 40 steps of 500
    assert float(rows[0]["return"]) < 150 and float(rows[-1]["return"]) > 400, rows
    assert (folder / "curve.png").stat().st_size > 5000
    assert list((folder / "log").glob("events.*"))
    played = run(f"{EXAMPLES}/play.py", "CartPoleBalance", str(folder / "policy.onnx"), "--num-envs", "32")
    assert played.returncode == 0, played.stderr
    mean = float(played.stdout.split("return ")[1].split(" ±")[0])
    assert mean > 400, played.stdout
    assert (folder / "play.png").stat().st_size > 10_000
    film = folder / "film.gif"
    filmed = run(
        f"{EXAMPLES}/play.py", "CartPoleBalance", str(folder / "policy.onnx"), "--num-envs", "2", "--film", str(film)
    )
    assert filmed.returncode == 0 and film.stat().st_size > 10_000, filmed.stderr
    wrong = run(f"{EXAMPLES}/play.py", "FrankaReach", str(folder / "policy.onnx"))
    assert wrong.returncode == 1 and "takes 5 numbers, and FrankaReach has 32" in wrong.stderr


def test_a_killed_trainer_goes_on_in_the_running_daemon(tmp_path: Path) -> None:
    name = f"test-{os.getpid()}-{time.monotonic_ns()}"
    arguments = ["-m", "tightloop.env", "serve", "CartPoleBalance", "--num-envs", "64", "--name", name]
    daemon = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True)
    assert daemon.stdout is not None and "ready" in daemon.stdout.readline()
    train = [
        f"{EXAMPLES}/ppo.py", "CartPoleBalance", "--daemon", name, "--num-envs", "64", "--evaluate", "1", "--resume",
        "--out", str(tmp_path), "--threads", "1",
    ]  # fmt: skip
    folder = tmp_path / "CartPoleBalance-0"
    trainer = subprocess.Popen([sys.executable, *train, "--minutes", "10"], stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not (folder / "checkpoint.pt").exists():
        assert trainer.poll() is None and time.monotonic() < deadline
        time.sleep(0.1)
    time.sleep(3)
    trainer.send_signal(signal.SIGKILL)
    trainer.wait()
    again = run(*train, "--minutes", "0.2")
    assert again.returncode == 0, again.stderr
    assert "goes on after" in again.stdout
    assert daemon.poll() is None
    rows = curve(folder)
    steps = [int(float(row["steps"])) for row in rows]
    assert steps == sorted(set(steps)) and len(rows) >= 3
    daemon.send_signal(signal.SIGTERM)
    assert daemon.wait(20) == 0
