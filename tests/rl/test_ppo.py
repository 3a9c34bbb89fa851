"""``examples/ppo.py`` and ``examples/play.py``: they learn, come back after a kill, and leave what they say."""

from __future__ import annotations

import csv
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

EXAMPLES = Path(__file__).parents[2] / "examples"


def run(*arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    command, environment = [sys.executable, *arguments], os.environ | variables
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def curve(folder: Path) -> list[dict[str, str]]:
    with (folder / "curve.csv").open() as file:
        return list(csv.DictReader(file))


OWN_TASK = """
from tightloop.tasks.cartpole import CartPoleBalance


class Leaning(CartPoleBalance):
    max_episode_steps = 20

    def metrics(self, xp, worlds):
        angle = abs(worlds.joint_q[:, 1])
        return {"error": worlds.joint_q[:, 0] * 0.0 + 0.25, "angle_rad": angle, "reward_upright": 1.0 - angle}

    def success(self, xp, worlds):
        return abs(worlds.joint_q[:, 1]) < 0.1
"""
METRICS = ["error", "angle_rad", "reward_upright"]  # in its order


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
    # a file or a pipe gets a line per evaluation, and no bar
    assert len(re.findall(r"^CartPoleBalance, \d+ of 30 s, [\d,]+ steps: return [\d.]+$", done.stdout, re.M)) == len(
        rows
    )
    assert "%|" not in done.stderr
    picture = folder / "play.png"
    played = run(
        f"{EXAMPLES}/play.py", "CartPoleBalance", f"{folder}/policy.onnx", "--num-envs", "32", "--out", str(picture)
    )
    assert played.returncode == 0, played.stderr
    mean = float(played.stdout.split("return ")[1].split(" ±")[0])
    assert mean > 400 and "success" not in played.stdout, played.stdout
    assert picture.stat().st_size > 10_000
    film = folder / "film.gif"
    filmed = run(
        f"{EXAMPLES}/play.py", "CartPoleBalance", str(folder / "policy.onnx"), "--num-envs", "2", "--film", str(film)
    )
    assert filmed.returncode == 0 and film.stat().st_size > 10_000, filmed.stderr
    assert re.search(r"^film: \d+ of at most 500 steps, \d+ s$", filmed.stdout, re.M), filmed.stdout
    wrong = run(f"{EXAMPLES}/play.py", "FrankaReach", str(folder / "policy.onnx"))
    assert wrong.returncode == 1 and "takes 5 numbers, and FrankaReach has 32" in wrong.stderr


def test_the_log_has_all_metrics_of_the_task_with_their_units(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN_TASK)
    done = run(
        f"{EXAMPLES}/ppo.py", f"{tmp_path}/own.py:Leaning", "--minutes", "0.05", "--num-envs", "64", "--evaluate", "1",
        "--out", str(tmp_path), "--threads", "1",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    log = EventAccumulator(str(tmp_path / "Leaning-0/log"))
    log.Reload()
    own = {"success", "error_m", "angle_rad", "reward_upright"}
    assert set(log.Tags()["scalars"]) == {
        *(f"train/{name}" for name in own | {"reward_per_step", "episode_return", "episode_length_steps"}),
        *(f"evaluation/{name}" for name in own | {"return"}),
        *(f"learn/{name}" for name in ("kl_nats", "value_loss", "action_std", "learning_rate")),
        "time/steps_per_second",
        "time/training_s",
    }

    def last(name: str) -> float:
        return log.Scalars(name)[-1].value

    assert last("train/error_m") == last("evaluation/error_m") == 0.25
    # 1 a step; an episode has at most 20 steps
    assert last("train/reward_per_step") == 1.0
    assert last("train/episode_return") == last("train/episode_length_steps") <= 20
    assert (
        0.0 < last("train/angle_rad") < 1.0 and abs(last("train/angle_rad") + last("train/reward_upright") - 1) < 1e-5
    )
    assert [*curve(tmp_path / "Leaning-0")[-1]] == ["seconds", "steps", "return", "success", *METRICS]


def test_a_run_leaves_films_and_a_log_of_wandb_and_ends_with_intervals(tmp_path: Path) -> None:
    done = run(
        f"{EXAMPLES}/ppo.py", "CartPoleBalance", "--num-envs", "64", "--minutes", "0.1", "--evaluate", "2", "--wandb",
        "--film-every", "0.05", "--out", str(tmp_path), WANDB_MODE="offline", WANDB_SILENT="true",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "CartPoleBalance-0"
    films = list((folder / "films").glob("*.mp4"))
    assert films and all(film.stat().st_size > 5000 for film in films)
    assert list((folder / "wandb").glob("offline-run-*/*.wandb"))
    # at the end means have intervals
    assert re.search(r"steps: return [\d.]+ \([\d.]+ to [\d.]+\)$", done.stdout, re.M), done.stdout


FILMING = """
import sys, time
import ppo
config = ppo.Config(num_envs=8, film_every=1.0)
trainer = ppo.Trainer("CartPoleBalance", 0, config, sys.argv[1], daemon=None, device="cpu")
assert trainer.films.take(trainer.snapshot, 0.0, 0) is None
begun = time.perf_counter()
assert trainer.films.take(trainer.snapshot, 61.0, 100) is None
taken, process = time.perf_counter() - begun, trainer.films._process
busy = trainer.films.take(trainer.snapshot, 121.0, 200)
print(taken, process.pid, busy, flush=True)
time.sleep(300)
"""


def test_a_film_is_made_beside_the_training_and_ends_with_it(tmp_path: Path) -> None:
    beside = os.environ | {"PYTHONPATH": os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])}
    command = [sys.executable, "-c", FILMING, str(tmp_path)]
    with subprocess.Popen(command, env=beside, stdout=subprocess.PIPE, text=True) as trainer:
        try:
            assert trainer.stdout is not None
            taken, pid, busy = trainer.stdout.readline().split(maxsplit=2)
            # a film has 300 pictures, each some 20 ms
            assert float(taken) < 2.0, taken
            assert busy.strip() == "100.mp4 is not done, so there is no film of 200 steps; film less often"
            deadline = time.monotonic() + 120
            while not list((tmp_path / "films").glob("*.mp4")) and time.monotonic() < deadline:
                time.sleep(0.05)
            assert list((tmp_path / "films").glob("*.mp4")), "the film has begun"
            # the 19th field, after the name and 16 others
            nice = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[16]
            assert int(nice) >= 10
        finally:
            trainer.kill()
    deadline = time.monotonic() + 30
    while Path(f"/proc/{pid}").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not Path(f"/proc/{pid}").exists() and not list((tmp_path / "films").iterdir())


def test_what_wandb_and_films_need_is_checked_at_the_start(tmp_path: Path) -> None:
    (tmp_path / "hide.py").write_text(
        "import importlib.util, runpy, sys\n"
        "find_spec = importlib.util.find_spec\n"
        "hidden, sys.argv = sys.argv[1], sys.argv[2:]\n"
        "importlib.util.find_spec = lambda name, package=None: None if name == hidden else find_spec(name, package)\n"
        "runpy.run_path(sys.argv[0], run_name='__main__')\n"
    )
    for module, pip, arguments in (("wandb", "wandb", ["--wandb"]), ("PIL", "pillow", ["--film-every", "1"])):
        done = run(
            str(tmp_path / "hide.py"), module, f"{EXAMPLES}/ppo.py", "CartPoleBalance", *arguments, "--out",
            str(tmp_path / "out"), PYTHONPATH=str(EXAMPLES),
        )  # fmt: skip
        assert done.returncode == 1 and done.stderr == f"ppo.py: there is no {module}: pip install {pip}\n", done.stderr
    assert not (tmp_path / "out").exists()


def test_simulation_and_torch_have_a_thread_each(tmp_path: Path) -> None:
    code = (
        "import ppo, torch; "
        "trainer = ppo.Trainer('CartPoleBalance', 0, ppo.Config(num_envs=4), '.', daemon=None, device='cpu'); "
        "print(trainer.config.threads, torch.get_num_threads()); trainer.close()"
    )
    beside = os.environ | {"PYTHONPATH": os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])}
    beside.pop("OMP_NUM_THREADS", None)
    done = subprocess.run([sys.executable, "-c", code], env=beside, capture_output=True, text=True, check=True)
    assert done.stdout == "1 1\n"


def test_values_that_moved_since_the_rollout_go_on_to_their_targets(tmp_path: Path) -> None:
    code = """
import ppo, torch
trainer = ppo.Trainer('CartPoleBalance', 0, ppo.Config(num_envs=8, steps=8), '.', daemon=None, device='cpu')
rollout, critic = trainer.rollouts[0], trainer.agent.critic
# the critic that acted gave 0, the one that learns gives 1, and 5 is right
critic[-1].bias.data.fill_(1.0)
rollout.reward.fill_(5.0)
rollout.done.fill_(1.0)
trainer.learn(rollout, 0.0)
print(trainer.agent.value(rollout.critic_obs).mean().item() > 1.05)
trainer.close()
"""
    beside = os.environ | {"PYTHONPATH": os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([sys.executable, "-c", code], env=beside, capture_output=True, text=True, check=False)
    assert done.stdout == "True\n", done.stdout + done.stderr


@pytest.mark.parametrize("task", ["CartPoleSwingUp", "QuadrupedVelocityFlat"])
def test_a_run_that_ends_by_steps_goes_on_with_the_same_bits(task: str, tmp_path: Path) -> None:
    code = f"""
import ppo, torch
from pathlib import Path
from learning.log import Log

class Stopped(Exception):
    pass

task = {task!r}

def run(folder, stop_at=None, resume=False):
    folder = Path({str(tmp_path)!r}) / folder
    folder.mkdir(exist_ok=True)
    mirror = task != 'CartPoleSwingUp'
    config = ppo.Config(num_envs=64, steps=16, total=16 * 64 * 9, evaluate_steps=16 * 64 * 3, mirror=mirror)
    trainer = ppo.Trainer(task, 3, config, folder, daemon=None, device='cpu')
    assert mirror == (trainer.agent.halves is not None)
    if resume:
        trainer.resume()
    save = trainer.save
    def saving():
        save()
        if stop_at is not None and len(trainer.curve) == stop_at:
            raise Stopped
    trainer.save = saving
    try:
        with Log(folder) as log:
            trainer.run(log)
    except Stopped:
        pass
    trainer.close()
    return trainer

whole, part = run('whole'), run('part', stop_at=2)
assert part.steps < whole.steps == 16 * 64 * 9
again = run('part', resume=True)
assert [row['steps'] for row in again.curve] == [row['steps'] for row in whole.curve]
mine, theirs = again.agent.state_dict(), whole.agent.state_dict()
same = all(torch.equal(mine[name], theirs[name]) for name in theirs)
print(same, whole.curve[-1]['return'] == again.curve[-1]['return'])
"""
    beside = os.environ | {"PYTHONPATH": os.pathsep.join([str(EXAMPLES), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run([sys.executable, "-c", code], env=beside, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines()[-1:] == ["True True"], done.stdout + done.stderr


def test_nothing_is_written_beside_the_trained_policies() -> None:
    trained = EXAMPLES / "trained"
    before = {path: path.stat().st_mtime_ns for path in trained.iterdir()}
    policy = trained / "CartPoleSwingUp.onnx"
    done = run(f"{EXAMPLES}/play.py", "CartPoleSwingUp", str(policy), "--num-envs", "8")
    assert done.returncode == 0, done.stderr
    assert {path: path.stat().st_mtime_ns for path in trained.iterdir()} == before
    assert f"picture: {EXAMPLES.parent}/out/play/CartPoleSwingUp.png" in done.stdout


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
