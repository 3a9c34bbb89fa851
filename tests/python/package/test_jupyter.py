"""A notebook in a real Jupyter kernel: launch, step, show, interrupt, restart. No daemon is left."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
import pytest
from jupyter_core.utils import run_sync
from nbclient.client import NotebookClient
from nbclient.exceptions import CellExecutionError

from processes import alive, left_of, stems_of, wait_until

LAUNCH = """
import tightloop as tl
scene = tl.Scene(dt=1 / 240, substeps=2)
scene.add_urdf(tl.assets.CARTPOLE, name="cart").joint_q = [0.0, 0.5]
sim = tl.launch(scene, worlds=8)
sim.pid
"""
PICTURE = """
from PIL import Image
sim.picture(size=(64, 48))
"""
# Cells that run until somebody interrupts them: between short calls, and in long ones. A file shows that they run.
ENDLESS = """
from pathlib import Path
import numpy as np
sim.step()
Path("running").touch()
while True:
    {call}
"""
CALLS = {
    "steps": "sim.step()",
    "rollouts": 'sim.rollout({"joint_f": np.zeros((1000, 8, 2), np.float32)}, fields=("joint_q",))',
}


@pytest.fixture
def client(tmp_path: Path) -> Iterator[Any]:
    """A notebook without cells, and its kernel."""
    client = NotebookClient(nbformat.v4.new_notebook(), timeout=60, resources={"metadata": {"path": tmp_path}})
    with client.setup_kernel():
        yield client


def run(client: Any, source: str) -> list[dict[str, Any]]:
    """Run a cell; return its outputs."""
    cell = nbformat.v4.new_code_cell(source)
    client.nb.cells.append(cell)
    client.execute_cell(cell, len(client.nb.cells) - 1)
    return cell.outputs


def shown(client: Any, source: str) -> dict[str, Any]:
    """Run a cell; return what its last expression shows, by MIME type."""
    outputs = run(client, source)
    assert [output["output_type"] for output in outputs] == ["execute_result"], outputs
    return outputs[0]["data"]


def test_cells_launch_step_and_show_frames_pictures_and_simulations(client):
    assert int(shown(client, LAUNCH)["text/plain"])
    frame = shown(client, "frame = sim.step()\nframe")
    assert "joint_q" in frame["text/html"] and "(8, 2)" in frame["text/html"]
    assert "Sim(" in shown(client, "sim")["text/plain"]
    assert shown(client, PICTURE)["image/png"]
    assert "<table>" in shown(client, "scene")["text/html"]
    # an error is shown in the cell, and the kernel goes on
    with pytest.raises(CellExecutionError, match="no argument `joint_targets`"):
        run(client, "sim.step(joint_targets=0)")
    assert shown(client, "int(sim.step().step[0])")["text/plain"] == "2"


@pytest.mark.parametrize("call", CALLS)
def test_an_interrupted_cell_ends_at_once_and_the_next_one_goes_on(client, tmp_path, call):
    shown(client, LAUNCH)
    interrupted: list[float] = []

    def interrupt() -> None:
        if wait_until((tmp_path / "running").exists, 20.0):
            time.sleep(0.2)
            interrupted.append(time.monotonic())
            asyncio.run(client.km.interrupt_kernel())

    thread = threading.Thread(target=interrupt)
    thread.start()
    with pytest.raises(CellExecutionError, match="KeyboardInterrupt"):
        run(client, ENDLESS.format(call=CALLS[call]))
    thread.join()
    assert time.monotonic() - interrupted[0] < 2
    assert int(shown(client, "int(sim.step().step[0])")["text/plain"]) > 1


@pytest.mark.parametrize("now", [False, True], ids=["restart", "killed"])
def test_a_kernel_that_restarts_takes_its_daemons_with_it_and_launches_again(client, now):
    first = int(shown(client, LAUNCH)["text/plain"])
    stems = stems_of(first)
    restart(client, now)
    assert wait_until(lambda: not alive(first), 2.0)
    assert not left_of(stems)
    assert int(shown(client, LAUNCH)["text/plain"]) != first
    assert shown(client, "int(sim.step().step[0])")["text/plain"] == "1"


def restart(client: Any, now: bool) -> None:
    """Restart the kernel, as the menu of a notebook does, or after its death."""
    run_sync(client.km.restart_kernel)(now=now)
    run_sync(client.kc.wait_for_ready)(timeout=30)
