"""The script for machines with a GPU and no network (benches/gpu/card.sh), on the software driver."""

from __future__ import annotations

import csv
import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

REPOSITORY = Path(__file__).parents[3]
BINARY = Path(os.environ.get("CARGO_TARGET_DIR", REPOSITORY / "target")) / "release/examples/gpu_bench"
COMMAND = "cargo build --release --workspace --example gpu_bench"
PATIENCE = 300.0  # [s]
# A scene like those of MuJoCo's models: a ball on an arm that hits the ground
TINY = """
<mujoco>
  <option timestep="0.005"/>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body pos="0 0 0.25">
      <joint name="swing" axis="0 1 0" damping="0.01"/>
      <geom type="sphere" pos="0.2 0 0" size="0.1" mass="0.1"/>
    </body>
  </worldbody>
  <actuator><motor joint="swing" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


@pytest.fixture(scope="module")
def card(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that such a machine gets."""
    if not BINARY.exists():
        pytest.fail(f"there is no {BINARY}; run `{COMMAND}`, as `make test` does")
    folder, scenes = (tmp_path_factory.mktemp(name) for name in ("machine", "scenes"))
    code = "import sys; from card_scenes import *; model = mujoco.MjModel.from_xml_string(sys.argv[1])\n"
    code += "write(Path(sys.argv[2]), 'tiny', model, 2, np.sin(np.arange(20.0))[:, None])"
    subprocess.run([sys.executable, "-c", code, TINY, scenes], cwd=REPOSITORY / "benches/gpu", check=True)
    subprocess.run([REPOSITORY / "benches/gpu/card_folder.sh", folder / "card", scenes], check=True)
    return folder / "card"


def command(card: Path, results: Path, *stages: int, **variables: str) -> tuple[list[str], dict[str, str]]:
    """The call of some stages, and its environment."""
    given = {"CARD_QUICK": "1", "CARD_RESULTS": str(results), **variables}
    return [str(card / "card.sh"), *map(str, stages)], {**os.environ, **given}


def run(card: Path, results: Path, *stages: int, **variables: str) -> subprocess.CompletedProcess[str]:
    """Calls the script and waits for its end."""
    arguments, environment = command(card, results, *stages, **variables)
    return subprocess.run(
        arguments, env=environment, cwd=card.parent, capture_output=True, text=True, timeout=PATIENCE, check=False
    )


def rows(path: Path) -> list[dict[str, str]]:
    """Rows of a file of results, without its head."""
    return list(csv.DictReader(line for line in path.read_text().splitlines() if not line.startswith("#")))


def keys(results: Path) -> list[str]:
    """Pieces that are done, once for each time that they were."""
    lines = (results / "pieces.csv").read_text().splitlines()
    return [key for state, key, *_ in (line.split(",") for line in lines) if state == "done"]


def members(session: int) -> list[int]:
    """The processes of a session that run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _parent, _group, its = stat.read_text().rsplit(")", 1)[1].split()[:4]
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(its) == session and state != "Z":
            found.append(int(stat.parent.name))
    return found


def write_results(results: Path, state: str) -> None:
    """Results of a scene whose check has that state, and whose rate is 1.44e8 steps/s with 4096 worlds."""
    results.mkdir()
    (results / "pieces.csv").write_text(
        f"{state},1/torque_free,1,2026-08-01T10:00:00Z,unknown\ndone,2/torque_free-4096,1,2026-08-02T10:00:00Z,unknown\n"
    )
    (results / "speed.csv").write_text(
        "# adapter: NVIDIA H200\n# commit: abc\n# date: 2026-08-01\n"
        "scene,worlds,steps_per_s,steps_per_s_whole\ntorque_free,4096,150000000,144000000\n"
    )


def test_a_call_that_was_killed_in_a_stage_goes_on_from_there_and_the_results_are_whole(card: Path, tmp_path: Path):
    results, copy = tmp_path / "results", tmp_path / "out"
    arguments, environment = command(card, results)
    with subprocess.Popen(
        arguments, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT, start_new_session=True
    ) as killed:
        until = time.monotonic() + PATIENCE
        while not (results / "pieces.csv").exists() or "2/torque_free-64" not in keys(results):
            assert time.monotonic() < until
            assert killed.poll() is None
            time.sleep(0.02)
        os.killpg(killed.pid, signal.SIGKILL)
        # what it was running is in another process group, and ends too
        until = time.monotonic() + 10
        while members(killed.pid):
            assert time.monotonic() < until
            time.sleep(0.02)
    before = keys(results)
    assert before == ["1/torque_free", "1/tiny", "1/bits-torque_free", "2/torque_free-64"]
    assert [row["worlds"] for row in rows(results / "speed.csv")] == ["64"]

    done = run(card, results, CARD_COPY=str(copy))
    assert done.returncode == 0, done.stdout + done.stderr
    assert keys(results)[:4] == before and len(set(keys(results))) == len(keys(results))
    head = [line for line in (results / "speed.csv").read_text().splitlines() if line.startswith("# ")]
    for fact in ("adapter", "driver", "commit", "date", "clocks before"):
        assert any(line.startswith(f"# {fact}: ") for line in head), fact
    measured = rows(results / "speed.csv")
    sides = [(row["scene"], row["worlds"], row["steps_per_s"] == "–") for row in measured]
    counts = [(scene, worlds) for worlds in ("64", "1024") for scene in ("torque_free", "tiny")]
    assert sides == [(*count, is_cpu) for is_cpu in (False, True) for count in counts]
    splits = rows(results / "splits.csv")
    assert [(row["world_threads"], row["kernel_size"]) for row in splits] == [
        ("auto", "auto"),
        ("1 (cpu bits)", "auto"),
        ("auto", "3000"),
    ]
    assert int(splits[2]["kernels"]) > int(splits[0]["kernels"])
    assert "# not measured: " in (results / "tensors.csv").read_text() and "tensors: not measured: " in done.stdout
    assert {row["engine"] for row in rows(results / "published.csv")} == {"mujoco_warp"}
    log = (results / "log.txt").read_text()
    for scene in ("torque_free", "tiny"):
        assert f"{scene}: same bits among 1, 7, 16 and 64 worlds" in log
    assert "tiny: after 5 frames within " in log
    assert re.search(r"torque_free: after 5 frames all \d+ numbers are the CPU's", log)
    names = sorted(path.name for path in results.iterdir())
    assert names == sorted(path.name for path in copy.iterdir())
    stages = ("speed.csv", "splits.csv", "tensors.csv", "profile.txt", "published.csv")
    assert names == sorted(("log.txt", "pieces.csv", "stamp.txt", *stages))

    again = run(card, results)
    assert again.returncode == 0
    assert "== " not in again.stdout and keys(results) == keys(copy)


def test_a_call_ends_in_time_and_asks_for_another(card: Path, tmp_path: Path):
    began = time.monotonic()
    done = run(card, tmp_path / "results", 1, 2, CARD_SECONDS="3")
    assert done.returncode == 3
    assert done.stdout.endswith("time is up: call card.sh again\n")
    assert time.monotonic() - began < 60


def test_a_check_that_fails_is_named(card: Path, tmp_path: Path):
    results = tmp_path / "results"
    done = run(card, results, 1, 2, CARD_ADAPTER="no such adapter")
    assert done.returncode == 1
    assert "no such adapter; there are:" in done.stdout
    assert "checks: torque_free is failed" in done.stdout
    assert not (results / "speed.csv").exists() and not (results / "stamp.txt").exists()


@pytest.mark.parametrize("state", ["failed", "cut", "done"])
def test_rates_of_a_check_that_failed_are_marked(tmp_path: Path, state: str):
    results = tmp_path / "results"
    write_results(results, state)
    asked = [sys.executable, REPOSITORY / "benches/gpu/card_report.py", results]
    done = subprocess.run(asked, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "144000000" in done.stdout
    mark = f"checks: torque_free is {state}; its rates are not those of right results"
    assert (mark in done.stdout) == (state != "done")
    assert f"pieces: {2 if state == 'done' else 1} done" in done.stdout


def test_results_of_another_commit_or_adapter_are_refused(card: Path, tmp_path: Path):
    results = tmp_path / "results"
    assert run(card, results, 4).returncode == 0
    stamp = results / "stamp.txt"
    there = stamp.read_text()
    assert [line.split(": ")[0] for line in there.splitlines()] == ["commit", "adapter", "driver"]
    stamp.write_text(there.replace("commit: ", "commit: not-"))
    log = (results / "log.txt").read_text()
    refused = run(card, results, 4)
    assert refused.returncode == 1
    assert "commit: not-" in refused.stderr and "set CARD_RESULTS to another folder" in refused.stderr
    assert (results / "log.txt").read_text() == log


def test_the_profile_fails_if_the_bench_does(card: Path, tmp_path: Path):
    tools = tmp_path / "tools"
    tools.mkdir()
    (tools / "nvidia-smi").write_text("#!/bin/sh\necho 1980 MHz, 2619 MHz, 70 W, 30\n")
    (tools / "nvidia-smi").chmod(0o755)
    path = f"{tools}:{os.environ['PATH']}"
    failed = run(card, tmp_path / "results", 5, CARD_ADAPTER="no such adapter", PATH=path)
    assert failed.returncode == 1
    assert "5/profile: failed" in failed.stdout
    assert run(card, tmp_path / "results", 5, PATH=path).returncode == 0


def test_the_folder_holds_all_that_its_peers_import(card: Path):
    asked = [sys.executable, card / "benches/gpu/gpu_peers.py", "--help"]
    done = subprocess.run(asked, cwd=card.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def peers(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """benches/gpu/gpu_peers.py."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    spec = importlib.util.spec_from_file_location("gpu_peers", REPOSITORY / "benches/gpu/gpu_peers.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_peers_without_a_gpu_are_left_out(
    peers: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def place(platform: str, is_cuda: bool) -> None:
        device = SimpleNamespace(platform=platform, device_kind="one of these")
        monkeypatch.setitem(sys.modules, "jax", SimpleNamespace(devices=lambda: [device]))
        there = SimpleNamespace(name="one of those", is_cuda=is_cuda)
        monkeypatch.setitem(sys.modules, "warp", SimpleNamespace(get_device=lambda: there))

    for name in ("mujoco_warp", "mujoco.mjx"):
        monkeypatch.setitem(sys.modules, name, ModuleType(name))
    place("cpu", is_cuda=False)
    assert peers.installed() == {}
    assert "mujoco.mjx is not measured: its device is no GPU but one of these (cpu)" in capsys.readouterr().out
    place("gpu", is_cuda=True)
    assert peers.installed() == {"mujoco_warp": "one of those", "mujoco.mjx": "one of these (gpu)"}


def test_peers_are_not_appended_below_other_columns(peers: ModuleType, tmp_path: Path):
    path = tmp_path / "peers.csv"
    peers.write(path, [{"scene": "grasp", "worlds": 64}], append=False)
    peers.write(path, [{"scene": "grasp", "worlds": 128}], append=True)
    assert [row["worlds"] for row in rows(path)] == ["64", "128"]
    with pytest.raises(SystemExit, match="it has other columns"):
        peers.write(path, [{"scene": "grasp", "device": "H200"}], append=True)


def test_a_stage_that_does_not_exist_is_refused(card: Path, tmp_path: Path):
    done = run(card, tmp_path / "results", 8)
    assert done.returncode == 1
    assert "stage 8: unknown; give numbers from 1 to 7" in done.stdout
