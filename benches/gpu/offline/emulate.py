"""Runs the dispatches of a frame for warps of 32 lanes, from a saved state, and counts what each warp does."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from . import bytecode, dump
from .dump import Scene
from .tree import Kernel

LANES = 32
"""Threads of a warp."""
SECTOR = 32
"""Bytes that memory moves at least."""
FLAGS = ("-std=c++20", "-O3", "-march=native", "-ffp-contract=off", "-Wno-psabi", "-shared", "-fPIC")
Array = npt.NDArray[Any]


class Memory(ctypes.Structure):
    """`Memory` of lockstep.cpp."""

    _fields_ = (
        ("values", ctypes.c_void_p),
        ("touched", ctypes.c_void_p),
        ("now", ctypes.c_void_p),
        ("ever", ctypes.c_void_p),
        ("places", ctypes.c_uint64),
    )


class Job(ctypes.Structure):
    """`Job` of lockstep.cpp."""

    _fields_ = (
        ("code", ctypes.c_void_p),
        ("constants", ctypes.c_void_p),
        ("constant_count", ctypes.c_uint32),
        ("slot_count", ctypes.c_uint32),
        ("stretch_count", ctypes.c_uint32),
        ("worlds", ctypes.c_uint32),
        ("share", ctypes.c_uint32),
        ("memory", Memory * 2),
        ("tables", ctypes.c_void_p * 2),
        ("table_lengths", ctypes.c_uint64 * 2),
    )


TALLIES = ("visits", "cold", "lanes", "loaded", "stored", "load_sectors", "store_sectors", "first")


class RawTally(ctypes.Structure):
    """`Tally` of lockstep.cpp."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in TALLIES),
        ("strays", ctypes.c_uint64),
        ("outside", ctypes.c_uint64),
    )


@dataclass
class Tally:
    """What a dispatch did."""

    visits: Array
    """Times that each warp came by each stretch, `(warps, stretches)`."""
    cold: Array
    """Of them with a load of something that the warp had not touched, `(warps, stretches)`."""
    lanes: Array
    """Lanes that took part in the visits of all warps, `(stretches,)`."""
    loaded: Array
    """Bytes that lanes of all warps asked for, `(stretches,)`; tables are left out."""
    stored: Array
    """The same of stores."""
    load_sectors: Array
    """Sectors of 32 bytes that these loads move, `(stretches,)`."""
    store_sectors: Array
    """The same of stores."""
    first: Array
    """Sectors that each warp touched first by a load, and by a store, `(warps, 2)`."""


@dataclass
class Worlds:
    """Memory of worlds."""

    fields: Array
    """`(vectors, worlds, 4)`"""
    scratch: Array
    """`(vectors, worlds, 4)`"""
    ever: tuple[Array, ...]
    """Sectors of both that any dispatch touched, `(vectors, pairs of worlds)`."""

    @property
    def footprint(self) -> float:
        """Bytes of a world that dispatches touched."""
        return SECTOR * float(sum(int(marks.sum()) for marks in self.ever)) / self.fields.shape[1]


@cache
def library(cache_folder: Path) -> ctypes.CDLL:
    """The interpreter, compiled once."""
    source = bytecode.INTERPRETER.read_bytes()
    path = cache_folder / f"lockstep-{hashlib.sha256(source + ' '.join(FLAGS).encode()).hexdigest()[:16]}.so"
    if not path.exists():
        cache_folder.mkdir(parents=True, exist_ok=True)
        whole = path.with_suffix(".new")
        subprocess.run(["g++", *FLAGS, "-o", str(whole), str(bytecode.INTERPRETER)], check=True)
        whole.rename(path)
    found = ctypes.CDLL(str(path))
    found.run.restype = None
    return found


def pointer(array: Array) -> int:
    """Address of an array's values."""
    assert array.flags.c_contiguous
    return array.ctypes.data


class Emulator:
    """Worlds in memory, and programs that step them."""

    def __init__(self, kernels: dict[int, Kernel], tables: tuple[Array, Array], cache_folder: Path) -> None:
        self.kernels = kernels
        self.programs = {k: bytecode.program(kernel) for k, kernel in kernels.items()}
        self.tables = tables
        self.library = library(cache_folder)

    def run(self, k: int, worlds_memory: Worlds) -> Tally:
        """One dispatch of kernel `k`.

        Raises:
            SystemExit: The kernel reads lanes that do not take part, or memory beyond a buffer.
        """
        program, kernel = self.programs[k], self.kernels[k]
        worlds, stretches = worlds_memory.fields.shape[1], len(program.stretches.lines)
        if worlds * kernel.lanes % LANES:
            raise SystemExit(f"{worlds} worlds of {kernel.lanes} threads are no whole warps of {LANES}")
        warps = worlds * kernel.lanes // LANES
        counts = {name: np.zeros(stretches, np.uint64) for name in TALLIES[2:7]}
        visits, cold = (np.zeros((warps, stretches), np.uint32) for _ in range(2))
        found = Tally(visits, cold, **counts, first=np.zeros((warps, 2), np.uint64))
        raw = RawTally(*(pointer(getattr(found, name)) for name in TALLIES))
        marks, parts = [], []
        for values, ever in zip((worlds_memory.fields, worlds_memory.scratch), worlds_memory.ever, strict=True):
            marks.append(np.zeros((2, len(values)), np.uint32))
            own = (values, marks[-1][0], marks[-1][1], ever)
            parts.append(Memory(*(pointer(array) for array in own), len(values)))
        code, constants = np.ascontiguousarray(program.code), np.ascontiguousarray(program.constants)
        job = Job(
            pointer(code),
            pointer(constants),
            len(constants),
            program.slots,
            stretches,
            worlds,
            kernel.lanes,
            (Memory * 2)(*parts),
            (ctypes.c_void_p * 2)(*(pointer(table) for table in self.tables)),
            (ctypes.c_uint64 * 2)(*(len(table) for table in self.tables)),
        )
        self.library.run(ctypes.byref(job), ctypes.byref(raw))
        if raw.strays or raw.outside:
            strays = f"{raw.strays} reads of lanes that do not take part"
            raise SystemExit(f"{kernel.file}: {strays}, {raw.outside} accesses beyond a buffer")
        return found


def emulator(scene: Scene, cache_folder: Path) -> Emulator:
    """The recorded kernels of a scene."""
    return Emulator(scene.kernels, (scene.table("numbers"), scene.table("indices")), cache_folder)


def worlds_of(scene: Scene, frame: int, count: int | None = None) -> Worlds:
    """The worlds of a scene before a frame, or the first of them."""
    before = scene.state("before", frame)[:count]
    fields = dump.vectors(before, scene.facts["fields"])
    scratch = np.zeros((max(-(-scene.facts["scratch"] // 4), 1), len(before), 4), np.float32)
    pairs = (len(before) + 1) // 2
    ever = tuple(np.zeros((len(values), pairs), np.uint8) for values in (fields, scratch))
    return Worlds(fields, scratch, ever)
