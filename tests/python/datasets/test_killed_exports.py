"""An export that is killed leaves a dataset that opens, with all episodes that it had committed."""

from __future__ import annotations

import json
import random
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader
from pyarrow import parquet
from recorded_run import opened
from rerun.chunk import RrdReader

import tightloop as tl
from conftest import PENDULUM
from tightloop.datasets import export

EPISODES, STEPS, WORLDS = 60, 20, 2
KILLS = 3
# Commits after each episode, and reports each that is committed.
EXPORTER = """
import sys
from tightloop.datasets import exporting
exporting._COMMIT_SECONDS = 0.0
def tell(frames, episodes):
    print(episodes, flush=True)
    return True
exporting.export(sys.argv[1], sys.argv[2], to=sys.argv[3], fields=["joint_q", "body_q"], progress=tell)
"""


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Many short episodes."""
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "pendulum.urdf").write_text(PENDULUM)
    scene = tl.Scene(dt=1 / 600, substeps=10)
    scene.add_urdf(folder / "pendulum.urdf", name="arm")
    with tl.launch(scene, worlds=WORLDS) as sim, sim.record(folder / "run.tlrec"):
        for episode in range(EPISODES):
            sim.reset()
            for _ in range(STEPS):
                sim.step(joint_f=np.full(2, float(episode)))
    return folder / "run.tlrec"


def killed(recording: Path, out: Path, to: str, seed: int) -> int:
    """Export, and kill that at a random moment; returns how many episodes it had committed."""
    generator = random.Random(seed)
    least = generator.randint(1, EPISODES * WORLDS // 2)
    command = [sys.executable, "-c", EXPORTER, str(recording), str(out), to]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as exporter:
        assert exporter.stdout is not None
        for line in exporter.stdout:
            if int(line) >= least:
                break
        time.sleep(generator.uniform(0, 0.01))
        exporter.kill()
        last = [int(line) for line in exporter.stdout if line.endswith("\n")]
    assert exporter.returncode != 0
    return max(last, default=least)


def episodes_of_hdf5(part: Path) -> list[float]:
    with opened(part) as file:
        demos = [file[f"data/demo_{index}"] for index in range(len(file["data"]))]
        assert file["data"].attrs["total"] == STEPS * len(demos)
        for demo in demos:
            for name in ("states", "rewards", "dones", "obs/joint_q", "next_obs/joint_q", "next_obs/body_q"):
                assert len(demo[name][()]) == STEPS
            assert demo["obs/body_q"].shape == (STEPS, 3, 7)
        return [float(demo["actions"][-1, 0]) for demo in demos]


def episodes_of_lerobot(part: Path) -> list[float]:
    info = json.loads((part / "meta/info.json").read_text())
    json.loads((part / "meta/stats.json").read_text())
    rows = [
        row
        for file in sorted((part / "meta").rglob("episodes/*/*.parquet"))
        for row in parquet.read_table(file).to_pylist()
    ]
    steps = [row for file in sorted((part / "data").rglob("*.parquet")) for row in parquet.read_table(file).to_pylist()]
    count = info["total_episodes"]
    # an episode that is not counted yet may be there
    assert count <= len(rows) <= len(steps) // STEPS <= count + 1
    return [steps[row["dataset_to_index"] - 1]["action"][0] for row in rows[:count]]


def episodes_of_mcap(part: Path) -> list[float]:
    last: dict[int, float] = {}
    current: dict[str, int] = {}
    with part.open("rb") as file:
        # a message that was being written when the process ended
        try:
            for _, channel, message in NonSeekingReader(file).iter_messages(log_time_order=False):
                world, topic = channel.topic.strip("/").split("/")
                values = json.loads(message.data)
                if topic == "episode":
                    current[world] = values["index"]
                elif topic == "action":
                    last[current[world]] = values["values"][0]
        except McapError:
            pass
    return list(last.values())


def episodes_of_rerun(part: Path) -> list[float]:
    last: dict[int, float] = {}
    with warnings.catch_warnings():
        # that a file was cut off
        warnings.simplefilter("ignore")
        for chunk in RrdReader(part).stream():
            if chunk.entity_path.endswith("/action") and not chunk.is_static:
                batch = chunk.to_record_batch()
                numbers, rows = (batch.column(name).to_pylist() for name in ("episode", "Scalars:scalars"))
                last |= {number: row[0] for number, row in zip(numbers, rows, strict=True)}
    return list(last.values())


FORMATS: dict[str, tuple[str, str, Callable[[Path], list[float]]]] = {
    "hdf5": ("demos.hdf5", "demos.part.hdf5", episodes_of_hdf5),
    "lerobot": ("demos", "demos.part", episodes_of_lerobot),
    "mcap": ("run.mcap", "run.part.mcap", episodes_of_mcap),
    "rerun": ("run.rrd", "run.part.rrd", episodes_of_rerun),
}


@pytest.mark.parametrize("to", FORMATS)
def test_what_a_killed_export_leaves_opens_with_all_committed_episodes(
    recording: Path, tmp_path: Path, to: str
) -> None:
    name, part, read = FORMATS[to]
    for seed in range(KILLS):
        folder = tmp_path / str(seed)
        folder.mkdir()
        committed = killed(recording, folder / name, to, seed)
        assert not (folder / name).exists()
        forces = read(folder / part)
        assert len(forces) >= committed
        assert forces == [float(index // WORLDS) for index in range(len(forces))]
        with pytest.raises(tl.ArgumentError, match=r"\.part.* is there already, of an export that was killed"):
            export(recording, folder / name, to=to)
