"""A scene as `gpu_bench --dump` writes it: kernels, tables, the order of dispatches, and states of its run."""

from __future__ import annotations

import json
import re
import subprocess
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .parser import parse
from .tree import Kernel

WIDTH = 4
"""Values of a vector of device memory."""


@dataclass(frozen=True)
class Scene:
    """A dumped scene."""

    folder: Path
    facts: dict[str, Any]

    @property
    def name(self) -> str:
        """Its name."""
        return self.facts["scene"]

    @property
    def worlds(self) -> int:
        """Worlds of the dumped states."""
        return self.facts["worlds"]

    @property
    def substeps(self) -> int:
        """Steps of a frame."""
        return self.facts["substeps"]

    @property
    def frames(self) -> int:
        """Frames of the whole run."""
        return self.facts["frames"]

    @cached_property
    def step(self) -> list[int]:
        """Kernels of a frame's steps, a dispatch each."""
        return flat(self.facts["step"])

    @cached_property
    def evaluate(self) -> list[int]:
        """Kernels of a frame's evaluation, a dispatch each."""
        return flat(self.facts["evaluate"])

    @cached_property
    def kernels(self) -> dict[int, Kernel]:
        """The recorded kernels by their numbers."""
        return {k: parse(self.text(k), self.file(k)) for k in sorted({*self.step, *self.evaluate})}

    @cached_property
    def around(self) -> dict[str, str]:
        """Sources of the hand-written kernels around the steps, by label."""
        labels = [kernel["label"] for kernel in self.facts["kernels"]]
        recorded = self.kernels
        return {label: self.text(k) for k, label in enumerate(labels) if k not in recorded}

    def file(self, k: int) -> str:
        """Name of a kernel's file."""
        return self.facts["kernels"][k]["file"] + ".wgsl"

    def text(self, k: int) -> str:
        """Source of a kernel."""
        return (self.folder / self.file(k)).read_text()

    @cached_property
    def sampled(self) -> list[int]:
        """Frames with a state before and after."""
        found = (re.fullmatch(r"before-(\d+)", path.stem) for path in self.folder.glob("before-*.bin"))
        return sorted(int(match[1]) for match in found if match)

    def weights(self) -> dict[int, int]:
        """Frames of the run that a sampled frame stands for: those nearest to it."""
        sampled = np.array(self.sampled)
        nearest = np.abs(np.arange(self.frames)[:, None] - sampled).argmin(axis=1)
        return {frame: int((nearest == k).sum()) for k, frame in enumerate(self.sampled)}

    def state(self, when: str, frame: int) -> npt.NDArray[np.float32]:
        """States `before` or `after` a frame, `(worlds, state)`."""
        values = np.fromfile(self.folder / f"{when}-{frame}.bin", np.float32)
        return values.reshape(-1, self.facts["state"])

    def table(self, name: str) -> npt.NDArray[Any]:
        """`numbers` or `indices`."""
        return np.fromfile(self.folder / f"{name}.bin", np.float32 if name == "numbers" else np.uint32)

    @cached_property
    def positions(self) -> slice:
        """Places of joint positions: the first values that the check for faults reads."""
        found = re.search(r"for \(var i = (\d+)u; i < (\d+)u; i\+\+\)", self.around["check faults"])
        if found is None:
            raise SystemExit(f"{self.folder}: the kernel `check faults` reads no positions; adapt dump.py to it")
        return slice(int(found[1]), int(found[2]))


def flat(order: list[Any]) -> list[int]:
    """Kernels of an order, with repetitions `[iterations, order]` written out."""
    found: list[int] = []
    for part in order:
        found += [part] if isinstance(part, int) else part[0] * flat(part[1])
    return found


def vectors(values: npt.NDArray[np.float32], places: int) -> npt.NDArray[np.float32]:
    """Values `(worlds, n)` as device memory has them, `(vectors, worlds, 4)`, with room for `places` values each."""
    worlds, n = values.shape
    memory = np.zeros((-(-places // WIDTH), worlds, WIDTH), np.float32)
    whole = np.zeros((worlds, -(-n // WIDTH) * WIDTH), np.float32)
    whole[:, :n] = values
    memory[: whole.shape[1] // WIDTH] = whole.reshape(worlds, -1, WIDTH).transpose(1, 0, 2)
    return memory


def rows(memory: npt.NDArray[np.float32], n: int) -> npt.NDArray[np.float32]:
    """The first `n` values of all worlds, `(worlds, n)`."""
    used = memory[: -(-n // WIDTH)]
    return used.transpose(1, 0, 2).reshape(memory.shape[1], -1)[:, :n]


def midpoints(frames: int, samples: int) -> list[int]:
    """Frames in the middle of equal parts of a run."""
    return [(2 * k + 1) * frames // (2 * samples) for k in range(samples)]


def read(folder: Path) -> Scene:
    """The scene in a folder.

    Raises:
        SystemExit: No scene lies there.
    """
    path = folder / "scene.json"
    if not path.exists():
        raise SystemExit(f"{path} does not exist; write it with `gpu_bench --dump`, see benches/NOTES.md")
    return Scene(folder, json.loads(path.read_text()))


def write(binary: Path, folder: Path, scene: str, worlds: int, samples: int) -> None:
    """Lets the binary dump a scene: frame 0 tells how long the run is, then frames across it."""
    command = [str(binary), "--dump", str(folder), "--worlds", str(worlds), "--scenes", scene, "--frames"]
    for path in (folder / scene).glob("*.bin"):
        path.unlink()
    subprocess.run([*command, "0"], check=True)
    frames = midpoints(read(folder / scene).frames, samples)
    subprocess.run([*command, ",".join(map(str, frames))], check=True)
    if 0 not in frames:
        for when in ("before", "after"):
            (folder / scene / f"{when}-0.bin").unlink()
