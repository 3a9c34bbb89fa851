"""Runs the CUDA C of kernels on the processor, to check it against states that another translation made."""

from __future__ import annotations

import ctypes
import hashlib
import subprocess
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy.typing as npt

from . import cuda
from .tree import Kernel

SHIM = Path(__file__).with_name("cuda_shim.h")
FLAGS = ("-std=c++20", "-w", "-O1", "-march=native", "-ffp-contract=off", "-shared", "-fPIC", f"-I{SHIM.parent}")
PROCESSES = 2
PLAY = """
static float4 *fields_, *scratch_;
static const float* numbers_;
static const unsigned* indices_;
static void thread() {{ kernel_main(fields_, scratch_, numbers_, indices_); }}
extern "C" void play(float4* fields, float4* scratch, const float* numbers, const unsigned* indices) {{
    fields_ = fields, scratch_ = scratch, numbers_ = numbers, indices_ = indices;
    for (unsigned first = 0; first < {threads}u; first += {group}u) {{
        blockIdx.x = first / {group}u;
        {loop}
    }}
}}
"""
Array = npt.NDArray[Any]
Play = Callable[[Array, Array, Array, Array], None]


def source(kernel: Kernel, worlds: int) -> str:
    """A program that plays a dispatch."""
    alone = f"for (threadIdx.x = 0; threadIdx.x < {kernel.workgroup}u; threadIdx.x++) thread();"
    loop = alone if kernel.lanes == 1 else f"warp::run(thread, {kernel.workgroup}u);"
    play = PLAY.format(threads=worlds * kernel.lanes, group=kernel.workgroup, loop=loop)
    text = cuda.PRELUDE + cuda.cuda(kernel, worlds, names_peers=True)
    # pragmas are nvcc's; lines of WGSL would hide those of this text
    kept = (line for line in text.replace('_Pragma("unroll 1")', "").splitlines() if not line.startswith("#line"))
    return '#include "cuda_shim.h"\n' + "\n".join(kept) + play


def compiled(kernel: Kernel, worlds: int, cache: Path) -> Play:
    """A function that plays a dispatch on `fields`, `scratch`, `numbers` and `indices`."""
    if kernel.lanes > 1 and kernel.workgroup > 32:
        raise SystemExit(f"{kernel.file}: threads of {kernel.workgroup} cannot exchange values here, 32 can")
    text = source(kernel, worlds)
    key = hashlib.sha256((text + SHIM.read_text() + " ".join(FLAGS)).encode()).hexdigest()[:24]
    path = cache / "cuda_on_cpu" / f"{key}.so"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        written = path.with_suffix(".cpp")
        written.write_text(text)
        whole = path.with_suffix(".new")
        subprocess.run(["g++", *FLAGS, "-o", str(whole), str(written)], check=True)
        whole.rename(path)
    play = ctypes.CDLL(str(path)).play
    play.restype = None

    def run(*buffers: Array) -> None:
        play(*(ctypes.c_void_p(buffer.ctypes.data) for buffer in buffers))

    return run


def run(kernels: dict[int, Kernel], order: Iterable[int], buffers: tuple[Array, ...], cache: Path) -> None:
    """Plays dispatches on `fields` and `scratch`, `(vectors, worlds, 4)`, with `numbers` and `indices`."""
    worlds = buffers[0].shape[1]
    with ThreadPoolExecutor(PROCESSES) as pool:
        plays = dict(zip(kernels, pool.map(lambda k: compiled(kernels[k], worlds, cache), kernels), strict=True))
    for k in order:
        plays[k](*buffers)
