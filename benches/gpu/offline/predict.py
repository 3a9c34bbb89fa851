"""A scene's whole run on cards: every sampled frame is emulated once, then timed for each card and number of worlds."""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

from . import costs, emulate, frame_ends, model, toolchain
from .constants import CARDS
from .costs import Costs
from .dump import Scene
from .frame_ends import Ends

PROCESSES = 2


@dataclass
class Part:
    """What a kernel does in a run."""

    costs: Costs
    dispatches: int
    """Of a frame, of one tile."""
    seconds: float = 0.0
    """Of all frames."""
    bounds: dict[str, float] = field(default_factory=dict)
    """Seconds by what binds the dispatch."""
    instructions: float = 0.0
    """Of all warps and frames."""

    @property
    def bound(self) -> str:
        """What binds most of its time."""
        return max(self.bounds, key=lambda name: self.bounds[name])


@dataclass
class Prediction:
    """A run of a scene."""

    scene: Scene
    arch: str
    worlds: int
    tiles: int
    ends: Ends
    parts: dict[int, Part]
    instructions: float
    """Per step of 32 worlds."""
    lanes: float
    """Share of lanes that take part, by instructions."""
    loaded: float
    """[bytes] per step of a world, tables left out."""
    stored: float
    """[bytes] per step of a world."""
    footprint: float
    """[bytes] of a world that a frame touches."""
    mean: float
    """[cycles] per step of a warp that is alone."""
    worst: float
    """[cycles] per step of the slowest warp of each dispatch."""

    @property
    def seconds(self) -> float:
        """Of a frame, in the mean of the run."""
        steps = sum(part.seconds for part in self.parts.values()) / self.scene.frames
        return steps + self.ends.seconds

    @property
    def rate(self) -> float:
        """Steps of worlds a second, in the whole run."""
        return self.worlds * self.scene.substeps / self.seconds

    @property
    def dispatches(self) -> int:
        """Dispatches of a frame, those of its ends included."""
        return self.tiles * sum(part.dispatches for part in self.parts.values()) + self.ends.dispatches


@dataclass
class Frame:
    """A sampled frame, for each architecture and number of worlds."""

    footprint: float
    times: dict[tuple[str, int], list[tuple[int, model.Dispatch]]]
    """Kernel and time of each dispatch."""
    lanes: dict[str, float]
    """Instructions times lanes that take part."""
    loaded: float
    stored: float


Known = dict[str, dict[int, Costs]]
"""Costs of the kernels, by architecture."""


def frame(job: tuple[Scene, int, Known, tuple[int, ...], Path]) -> Frame:
    """Emulates a frame and times its dispatches."""
    scene, number, known, counts, cache = job
    emulator = emulate.emulator(scene, cache)
    worlds = emulate.worlds_of(scene, number)
    order = scene.step + scene.evaluate
    tallies = [(k, emulator.run(k, worlds)) for k in order]
    times = {}
    for arch, by_kernel in known.items():
        code = sum(one.compiled.code for one in by_kernel.values())
        for count in counts:
            tile = count // tile_count(scene, count)
            setting = model.Setting(CARDS[arch], tile, scene.worlds, code, worlds.footprint)
            times[arch, count] = [
                (k, model.dispatch(tally, by_kernel[k], scene.kernels[k].workgroup, setting)) for k, tally in tallies
            ]
    lanes = {
        arch: sum(float(tally.lanes @ by_kernel[k].instructions) for k, tally in tallies) / emulate.LANES
        for arch, by_kernel in known.items()
    }
    of_steps = tallies[: len(scene.step)]
    loaded, stored = (sum(float(getattr(tally, name).sum()) for _, tally in of_steps) for name in ("loaded", "stored"))
    return Frame(worlds.footprint, times, lanes, loaded, stored)


def tile_count(scene: Scene, worlds: int) -> int:
    """Tiles of a number of worlds."""
    return model.tiles(worlds, max(scene.facts["fields"], scene.facts["scratch"]))


def predict(scene: Scene, archs: tuple[str, ...], counts: tuple[int, ...], cache: Path) -> list[Prediction]:
    """Predictions for each architecture and number of worlds."""
    emulate.library(cache)
    toolchain.folder(cache)
    known: Known = {}
    for arch in archs:
        with ThreadPoolExecutor(PROCESSES) as compilers:
            found = compilers.map(lambda kernel, arch=arch: costs.costs(kernel, arch, cache), scene.kernels.values())
            known[arch] = dict(zip(scene.kernels, found, strict=True))
    weights = scene.weights()
    with ProcessPoolExecutor(PROCESSES) as pool:
        frames = list(pool.map(frame, [(scene, number, known, counts, cache) for number in scene.sampled]))
    return [
        gather(scene, arch, worlds, known[arch], dict(zip(weights.items(), frames, strict=True)))
        for arch in archs
        for worlds in counts
    ]


def gather(
    scene: Scene, arch: str, worlds: int, known: dict[int, Costs], frames: dict[tuple[int, int], Frame]
) -> Prediction:
    """Puts the sampled frames of a run together."""
    order, tiles = Counter(scene.step + scene.evaluate), tile_count(scene, worlds)
    parts = {k: Part(one, order[k]) for k, one in known.items()}
    all_frames = sum(weight for _, weight in frames)
    mean = worst = lanes = loaded = stored = footprint = 0.0
    for (_, weight), one in frames.items():
        for k, dispatch in one.times[arch, worlds]:
            part = parts[k]
            part.seconds += weight * tiles * dispatch.seconds
            part.bounds[dispatch.bound] = part.bounds.get(dispatch.bound, 0.0) + weight * dispatch.seconds
            part.instructions += weight * tiles * dispatch.instructions
            mean += weight * dispatch.mean
            worst += weight * dispatch.worst
        lanes += weight * one.lanes[arch]
        loaded += weight * one.loaded
        stored += weight * one.stored
        footprint += weight * one.footprint / all_frames
    steps = all_frames * scene.substeps
    instructions = sum(part.instructions for part in parts.values())
    return Prediction(
        scene,
        arch,
        worlds,
        tiles,
        frame_ends.ends(scene, CARDS[arch], worlds, tiles),
        parts,
        instructions * emulate.LANES / (worlds * steps),
        lanes * worlds / scene.worlds / instructions,
        loaded / (scene.worlds * steps),
        stored / (scene.worlds * steps),
        footprint,
        mean / steps,
        worst / steps,
    )
