"""NVIDIA's compilers from the Python package index, and what they make of a kernel. No driver or card is needed."""

from __future__ import annotations

import hashlib
import json
import os
import re
import subprocess
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from . import cuda
from .tree import Kernel

PACKAGES = (
    "nvidia-cuda-nvcc==13.5.37",
    "nvidia-cuda-crt==13.5.37",
    "nvidia-cuda-nvdisasm==13.5.37",
    "nvidia-cuda-runtime==13.5.37",
    "nvidia-nvvm==13.5.37",
)
"""Compiler, headers, disassembler. Other versions would give other registers."""
FOLDER_VARIABLE = "TIGHTLOOP_CUDA"
"""Names a folder that the packages were unpacked to; otherwise they are installed below the cache folder."""
FLAGS = ("--fmad=false", "--prec-div=false", "--prec-sqrt=false", "--ftz=true")
"""What a Vulkan driver may do: no fused products, approximate division and roots, small values flushed."""
WORLDS = 4096
"""Kernels are compiled for this number of worlds. Others differ in the offsets of addresses alone."""


@dataclass(frozen=True, slots=True)
class Compiled:
    """What the compiler tells of a kernel, and where its machine code lies."""

    cubin: str
    registers: int
    """32-bit registers of a thread."""
    stack: int
    """[bytes] of local memory of a thread."""
    spilled: int
    """[bytes] written to local memory for want of registers."""
    code: int
    """[bytes] of machine code, padding left out."""
    seconds: float
    """Time of ptxas [s]."""


def folder(cache: Path) -> Path:
    """Where the compilers lie; installs them if they are not there.

    Raises:
        SystemExit: The packages cannot be installed.
    """
    named = os.environ.get(FOLDER_VARIABLE)
    site = Path(named) if named else cache / "cuda"
    found = sorted(site.glob("nvidia/*/bin/nvcc"))
    if not found:
        command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", str(site), *PACKAGES]
        if subprocess.run(command, check=False).returncode:
            raise SystemExit(
                f"CUDA's compilers cannot be installed; unpack {', '.join(PACKAGES)} and set {FOLDER_VARIABLE}"
            )
        found = sorted(site.glob("nvidia/*/bin/nvcc"))
    return found[0].parent


def compiled(kernel: Kernel, arch: str, cache: Path) -> Compiled:
    """The kernel as machine code for an architecture such as `sm_90`; the same text is compiled once.

    Raises:
        SystemExit: The compiler refuses it.
    """
    text = cuda.PRELUDE + cuda.cuda(kernel, WORLDS, names_peers=False)
    key = "\n".join([text, arch, *FLAGS, *PACKAGES])
    at = cache / "cubins" / hashlib.sha256(key.encode()).hexdigest()[:24]
    known = at.with_suffix(".json")
    if known.exists():
        return Compiled(**json.loads(known.read_text()) | {"cubin": str(at.with_suffix(".cubin"))})
    at.parent.mkdir(parents=True, exist_ok=True)
    source, cubin = at.with_suffix(".cu"), at.with_suffix(".cubin")
    source.write_text(text)
    tools = folder(cache)
    command = [str(tools / "nvcc"), f"-arch={arch}", "-cubin", "-lineinfo", *FLAGS, "-Xptxas", "-v"]
    done = subprocess.run([*command, "-o", str(cubin), str(source)], capture_output=True, text=True, check=False)
    log = done.stdout + done.stderr
    if done.returncode:
        raise SystemExit(f"{kernel.file}: nvcc refuses its CUDA C:\n{log}")
    stack, stores = numbers(r"(\d+) bytes stack frame, (\d+) bytes spill stores", log)
    (registers,) = numbers(r"Used (\d+) registers", log)
    time = re.search(r"Compile time = ([\d.]+) ms", log)
    sass = disassembled(cubin, cache)
    places = [int(x, 16) for x in re.findall(r"^\s*/\*([0-9a-f]{4,})\*/\s+(?!\s|NOP)", sass, re.MULTILINE)]
    code = max(places) + 16
    found = Compiled(str(cubin), registers, stack, stores, code, float(time[1]) / 1e3 if time else 0.0)
    known.write_text(json.dumps(asdict(found)))
    return found


def numbers(pattern: str, log: str) -> list[int]:
    """Numbers that the compiler reports."""
    match = re.search(pattern, log)
    if match is None:
        raise SystemExit(f"ptxas does not report `{pattern}`:\n{log}")
    return [int(x) for x in match.groups()]


def disassembled(cubin: Path, cache: Path) -> str:
    """Machine code as text with the bits of instructions and the lines that they come from; kept beside the cubin."""
    kept = cubin.with_suffix(".sass")
    if not kept.exists():
        command = [str(folder(cache) / "nvdisasm"), "-gi", "-c", "-hex", str(cubin)]
        kept.write_text(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return kept.read_text()
