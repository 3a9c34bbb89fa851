"""What Mesa's compiler for AMD makes of a scene's kernels: registers, spills, code.

RADV takes the family of a card from `RADV_FORCE_FAMILY`, and compiles for it with nothing behind. It chooses waves of
32 or 64 threads. Needed are `mesa-vulkan-drivers`, `libvulkan-dev` and a C compiler.
"""

from __future__ import annotations

import functools
import hashlib
import json
import os
import subprocess
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from .dump import Scene

PROGRAM = Path(__file__).with_name("radv.c")
FAMILIES = {"navi21": "RDNA2, RX 6900", "gfx1100": "RDNA3, RX 7900"}
"""Names of Mesa, and cards."""
DRIVER = Path("/usr/share/vulkan/icd.d/radeon_icd.x86_64.json")


@dataclass(frozen=True, slots=True)
class Program:
    """What the compiler tells of a kernel."""

    kernel: str
    subgroup: int
    """Threads of a wave."""
    registers: int
    """Vector registers of a thread."""
    spilled: int
    """Vector registers that are kept in memory."""
    spilled_scalars: int
    """Scalar registers that are kept in vector registers."""
    code: int
    """[bytes]"""
    waves: int
    """Waves that a quarter of a compute unit's pair may hold."""
    cold: float
    """Time in which the driver makes the pipeline [ms]."""
    cached: float
    """Time in which it makes it from the data of a pipeline cache, as later launches do [ms]."""


def program(cache: Path) -> Path:
    """The program that asks the driver, compiled once."""
    path = cache / f"radv-{hashlib.sha256(PROGRAM.read_bytes()).hexdigest()[:16]}"
    if not path.exists():
        cache.mkdir(parents=True, exist_ok=True)
        done = subprocess.run(["cc", "-O1", "-o", str(path), str(PROGRAM), "-lvulkan"], check=False)
        if done.returncode:
            raise SystemExit("radv.c needs a C compiler and Vulkan's headers: apt-get install libvulkan-dev")
    return path


def programs(scene: Scene, family: str, cache: Path) -> list[Program]:
    """The recorded kernels of a scene for a family.

    Raises:
        SystemExit: The dump has no SPIR-V, or there is no such driver.
    """
    files = {k: (scene.folder / scene.file(k)).with_suffix(".spv") for k in scene.kernels}
    if not DRIVER.exists():
        raise SystemExit(f"{DRIVER} does not exist: apt-get install mesa-vulkan-drivers")
    if missing := [path for path in files.values() if not path.exists()]:
        raise SystemExit(f"{missing[0]} does not exist; dump the scene with a gpu_bench that writes SPIR-V")
    environment = os.environ | {
        "RADV_FORCE_FAMILY": family,
        "VK_ICD_FILENAMES": str(DRIVER),
        "MESA_SHADER_CACHE_DISABLE": "true",
    }
    return [compiled(path, family, environment, cache) for path in files.values()]


def compiled(path: Path, family: str, environment: dict[str, str], cache: Path) -> Program:
    """A kernel for a family; the same SPIR-V is compiled once by the same program."""
    tool = program(cache)
    key = hashlib.sha256(path.read_bytes() + f"{family} {tool.name}".encode()).hexdigest()[:24]
    known = cache / "radv" / f"{key}.json"
    if known.exists():
        return replace(Program(**json.loads(known.read_text())), kernel=path.stem)
    told = statistics([str(tool), str(path)], environment)
    times = statistics([str(tool), "--times", str(path)], environment)
    found = Program(
        path.stem,
        int(told["Subgroup size"]),
        int(told["VGPRs"]),
        int(told["Spilled VGPRs"]),
        int(told["Spilled SGPRs"]),
        int(told["Code size"]),
        int(told["Subgroups per SIMD"]),
        float(times["cold"]),
        float(times["cached"]),
    )
    known.parent.mkdir(parents=True, exist_ok=True)
    known.write_text(json.dumps(asdict(found)))
    return found


def statistics(command: list[str], environment: dict[str, str]) -> dict[str, str]:
    """What the program prints of a kernel.

    Mesa 22.3 makes the pipelines of large kernels in waves of 64 for navi21, but crashes where it has to tell of them.
    Those are asked for again in waves of 32, and the table says 32.
    """
    run = functools.partial(subprocess.run, capture_output=True, text=True, check=False)
    done = run(command, env=environment)
    if done.returncode < 0:
        done = run(command, env=environment | {"RADV_PERFTEST": "cswave32"})
    if done.returncode:
        raise SystemExit(f"{command[-1]}: ended with {done.returncode}: {done.stderr}")
    return {name: value for _, name, value in (line.split("\t") for line in done.stdout.splitlines())}


def table(scene: Scene, family: str, found: list[Program]) -> str:
    """The kernels of a scene."""
    head = f"  {'kernel':14}{'wave':>5}{'regs':>6}{'spilled':>8}{'scalars':>8}{'code kB':>9}{'waves':>6}"
    head += f"{'cold ms':>9}{'cached':>8}"
    rows = [
        f"  {one.kernel:14}{one.subgroup:5}{one.registers:6}{one.spilled:8}{one.spilled_scalars:8}"
        f"{one.code / 1024:9.1f}{one.waves:6}{one.cold:9.1f}{one.cached:8.1f}"
        for one in found
    ]
    cold, cached = (sum(getattr(one, name) for one in found) for name in ("cold", "cached"))
    total = f"  {'all':14}{'':39}{cold:9.1f}{cached:8.1f}"
    return "\n".join([f"{scene.name}, {family} ({FAMILIES.get(family, 'as Mesa names it')})", head, *rows, total])
