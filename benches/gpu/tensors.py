"""Tensors on the GPU beside NumPy views: the same bits, the same worlds, and the time of a frame both ways.

    python -m benches tensors --worlds 1024,4096,16384 --csv FILE

Needs an NVIDIA GPU, its driver, torch and cuda-bindings. First it checks that each field of a frame is the same bit for
bit on the GPU and here, while frames are held and dropped, and that targets by tensor and by array lead to the same
worlds. Then it measures a loop of a policy on the GPU, one matrix product per frame: with tensors, and with NumPy views
that are sent there and targets that are fetched. Ends with 1 where a check fails, and where it cannot run unless
`--if-possible` is given.
"""

from __future__ import annotations

import argparse
import csv
import importlib
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any


def missing() -> str:
    """Return why a package cannot be imported, or an empty text."""
    try:
        for name in ("numpy", "torch", "cuda.bindings.driver"):
            importlib.import_module(name)
    except (ImportError, OSError) as error:
        return str(error)
    return ""


LACK = missing()
if TYPE_CHECKING or not LACK:
    import numpy as np
    import torch

    import tightloop as tl

REPOSITORY = Path(__file__).parents[2]
URDF = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"
START = (0.0, 0.0, 0.0, -2.4, 0.0, 2.4, 0.8, 0.04, 0.04)
FIELDS = ("joint_q", "joint_qd", "body_q")
#: Frames that are not measured
WARM_UP = 50


def scene() -> tl.Scene:
    """Return the arm with its hand, driven to targets."""
    made = tl.Scene(dt=1 / 480, substeps=8)
    arm = made.add_urdf(URDF, name="arm")
    arm.joint_q = START
    arm.joint_target_ke, arm.joint_target_kd = 400.0, 40.0
    return made


def targets(worlds: int, frame: int) -> np.ndarray:
    """Return targets that differ from world to world [rad], shape ``(worlds, 9)``."""
    return (np.array(START) + 0.01 * frame * np.sin(np.arange(worlds))[:, None]).astype(np.float32)


def bits(array: Any) -> bytes:
    """Return the bytes of an array here or of a tensor."""
    return (array.cpu().numpy() if isinstance(array, torch.Tensor) else np.asarray(array)).tobytes()


def differing(held: list[tuple[dict[str, torch.Tensor], dict[str, bytes]]]) -> list[str]:
    """Return the names of tensors that are not what the arrays of their frames were."""
    return [name for tensors, arrays in held for name in tensors if bits(tensors[name]) != arrays[name]]


def lack(device: str) -> tuple[str, str]:
    """Return the adapter, and the reason why tensors cannot be measured on it, or an empty text."""
    if LACK:
        return "unknown", LACK
    if not torch.cuda.is_available():
        return "unknown", "torch sees no CUDA device"
    with tl.launch(scene(), worlds=1, device=device) as sim:
        adapter = sim.info["adapter"]
    return adapter, "" if "nvidia" in adapter.lower() else f"tensors need an NVIDIA GPU, and the adapter is {adapter}"


def check_fields(worlds: int, device: str) -> list[str]:
    """Compare each field of held frames with its tensor; return what differs."""
    wrong = []
    with tl.launch(scene(), worlds=worlds, device=device, fields=FIELDS) as sim:
        print(f"order: {sim.keep_on_gpu().order}")
        held: list[tuple[dict[str, torch.Tensor], dict[str, bytes]]] = []
        for n in range(24):
            frame = sim.step(joint_target_q=targets(worlds, n))
            names = FIELDS if n % 2 else FIELDS[:1]
            tensors = {name: frame.torch(name) for name in names}
            held.append((tensors, {name: bits(getattr(frame, name)) for name in names}))
            del frame, tensors
            wrong += [f"frame {n}: {name}" for name in differing(held)]
            del held[: max(0, len(held) - 3)]
    return wrong


def check_targets(worlds: int, device: str) -> list[str]:
    """Move two simulations to the same targets, by tensor and by array; return what differs."""
    wrong = []
    with (
        tl.launch(scene(), worlds=worlds, device=device, fields=FIELDS) as there,
        tl.launch(scene(), worlds=worlds, device=device, fields=FIELDS) as here,
    ):
        card = there.keep_on_gpu()
        for n in range(20):
            goal = targets(worlds, n)
            frame = there.step(joint_target_q=torch.from_numpy(goal).to(f"cuda:{card.device}"))
            expected = here.step(joint_target_q=goal)
            pairs = {name: (getattr(frame, name), getattr(expected, name)) for name in FIELDS}
            wrong += [f"step {n}: {name}" for name, (a, b) in pairs.items() if bits(a) != bits(b)]
        bad = torch.full((worlds, 9), float("nan"), device=f"cuda:{card.device}")
        try:
            there.step(joint_target_q=bad)
            wrong.append("NaN by tensor was not refused")
        except tl.CommandRefused as error:
            print(f"NaN is refused: {error}")
    return wrong


def frame_us(worlds: int, frames: int, device: str, by_tensor: bool) -> float:
    """Return the time of a frame with a policy on the GPU [µs]."""
    with tl.launch(scene(), worlds=worlds, device=device, fields=FIELDS) as sim:
        there = "cuda"
        if by_tensor:
            there = f"cuda:{sim.keep_on_gpu().device}"
        weights = 0.001 * torch.ones((9, 9), device=there)
        start = torch.tensor(START, dtype=torch.float32, device=there)
        frame, began = sim.reset(), 0.0
        for n in range(WARM_UP + frames):
            if n == WARM_UP:
                torch.cuda.synchronize()
                began = time.perf_counter()
            q = frame.torch("joint_q") if by_tensor else torch.tensor(frame.joint_q, device=there)
            goal = start + q @ weights
            del q
            frame = sim.step(joint_target_q=goal if by_tensor else goal.cpu().numpy())
        torch.cuda.synchronize()
        return 1e6 * (time.perf_counter() - began) / frames


def write(path: Path, head: dict[str, str], rows: list[dict[str, str]]) -> None:
    """Write the rows below what they are of."""
    with path.open("w", newline="") as file:
        file.writelines(f"# {name}: {value}\n" for name, value in head.items())
        if rows:
            writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
            writer.writeheader()
            writer.writerows(rows)


def main() -> int:
    """Check, measure and print; 0 if every check holds."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--worlds", default="1024,4096,16384", help="numbers of worlds")
    options.add_argument("--frames", type=int, default=1000, help="frames that are measured")
    options.add_argument("--adapter", help="index or part of the name of the adapter; the first GPU if left out")
    options.add_argument("--csv", type=Path, help="file for the results")
    options.add_argument("--fact", action="append", default=[], help="a line of its head, `name: value`")
    options.add_argument("--if-possible", action="store_true", help="end with 0 where it cannot run")
    given = options.parse_args()
    device = "gpu" if given.adapter is None else f"gpu:{given.adapter}"
    adapter, reason = lack(device)
    facts = dict(fact.split(": ", 1) for fact in given.fact)
    head = {"adapter": adapter, "date": time.strftime("%F", time.gmtime()), **facts, "command": " ".join(sys.argv)}
    if reason:
        print(f"not measured: {reason}")
        if given.csv and given.if_possible:
            write(given.csv, {**head, "not measured": reason}, [])
        return 0 if given.if_possible else 1
    wrong = [*check_fields(130, device), *check_targets(130, device)]
    print("\n".join(wrong) or "tensors equal NumPy views bit for bit, and so do worlds that follow them")
    if wrong:
        return 1
    rows = []
    for worlds in map(int, given.worlds.split(",")):
        times = {way: frame_us(worlds, given.frames, device, way == "tensors") for way in ("views", "tensors")}
        row = {"worlds": str(worlds), "commit": head.get("commit", "unknown"), "date": head["date"]}
        rows.append(row | {f"{way}_us": f"{us:.1f}" for way, us in times.items()})
        print(f"{worlds} worlds: " + ", ".join(f"{way} {us:.1f} µs a frame" for way, us in times.items()))
    if given.csv:
        write(given.csv, head, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
