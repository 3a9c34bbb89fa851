"""Packs kernels as CUDA, states and predictions into a folder that `on_card.py` runs on a card.

    python -m benches.gpu.offline.on_card_pack

| variant | what differs |
|---|---|
| model | what the model times; only kernels without shuffles, since its shuffles are wrong where worlds diverge |
| warp | shuffles name no lanes, as in Vulkan; barriers name the active lanes |
| peers | CUDA's shuffles and barriers, which name the lanes of a world |
| driver | the PTX of `warp`, compiled by the card's driver |

PTX lost shuffles without a mask after 6.3. So the PTX is marked as 6.3 for the oldest target, and ptxas compiles that.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from . import check, costs, cuda, dump, emulate, predict, toolchain
from .__main__ import ROOT
from .dump import Scene

ARCH = "sm_90"
FRAMES = {"target": [90], "grasp": [37, 112], "standing": [50]}
"""Sampled frames: 37 has no contacts, 112 has the most iterations of the solver."""
SAMPLES = {"target": 3, "grasp": 12, "standing": 3}
STRIDE = 4
"""Of so many worlds one is compared."""
OLD_PTX = (
    (r"bar\.warp\.sync.*", "{ .reg .b32 active;\nactivemask.b32 active;\nbar.warp.sync active; }"),
    (r'\.pragma "used_bytes_mask.*', ""),
    (r"\.version .*", ".version 6.3"),
    (r"\.target .*", ".target sm_75"),
    (r"shfl\.sync\.(bfly|idx)\.b32(.*), (?:%r\d+|-1);", r"shfl.\1.b32\2;"),
)
SPIN = """
extern "C" __global__ void spin(long long cycles, long long* took) {
    long long began, ended, first = clock64();
    asm volatile("mov.u64 %0, %globaltimer;" : "=l"(began));
    while (clock64() - first < cycles) {}
    long long last = clock64();
    asm volatile("mov.u64 %0, %globaltimer;" : "=l"(ended));
    took[0] = last - first, took[1] = ended - began;
}
"""
"""Holds the card while a frame is queued, and tells its clock."""


def run(cache: Path, tool: str, *arguments: str) -> None:
    """Runs a compiler."""
    done = subprocess.run(
        [str(toolchain.folder(cache) / tool), *arguments], capture_output=True, text=True, check=False
    )
    if done.returncode:
        errors = [line for line in (done.stdout + done.stderr).splitlines() if "warning" not in line]
        raise SystemExit("\n".join([f"{tool} {' '.join(arguments)}:", *errors]))


def unchecked(ptx: str) -> str:
    """PTX whose shuffles name no lanes."""
    for pattern, new in OLD_PTX:
        ptx = re.sub(pattern, new, ptx)
    return ptx


def variants(scene: Scene, k: int, folder: Path, cache: Path) -> dict[str, str]:
    """Compiles a kernel; files by variant."""
    kernel, stem = scene.kernels[k], folder / f"{k}"
    exchanges = kernel.lanes > 1
    source = stem.with_suffix(".cu")
    source.write_text(cuda.PRELUDE + cuda.cuda(kernel, scene.worlds, names_peers=exchanges))
    flags = ("-w", f"-arch={ARCH}", *toolchain.FLAGS)
    own = "peers" if exchanges else "model"
    run(cache, "nvcc", *flags, "-cubin", "-o", f"{stem}-{own}.cubin", str(source))
    source.write_text(cuda.PRELUDE + cuda.cuda(kernel, scene.worlds, names_peers=False))
    ptx = Path(f"{stem}-driver.ptx")
    run(cache, "nvcc", *flags, "-ptx", "-o", str(ptx), str(source))
    source.unlink()
    ptx.write_text(unchecked(ptx.read_text()))
    files = {own: f"{k}-{own}.cubin", "driver": ptx.name}
    if exchanges:
        files["warp"] = f"{k}-warp.cubin"
        run(cache, "ptxas", f"-arch={ARCH}", "-o", str(folder / files["warp"]), str(ptx))
    return files


def predicted(scene: Scene, frame: int, cache: Path) -> dict[int, dict[str, float]]:
    """Predictions of a frame, in the mean of a kernel's dispatches."""
    known = {ARCH: {k: costs.costs(kernel, ARCH, cache) for k, kernel in scene.kernels.items()}}
    found = defaultdict(list)
    for k, one in predict.frame((scene, frame, known, (scene.worlds,), cache)).times[ARCH, scene.worlds]:
        found[k].append((one.seconds * 1e6, one.mean, one.worst, one.instructions))
    keys = ("us", "mean", "worst", "instructions")
    return {k: dict(zip(keys, np.mean(rows, axis=0).tolist(), strict=True)) for k, rows in found.items()}


def pack(scene: Scene, frames: list[int], folder: Path, cache: Path) -> None:
    """Writes a scene's part."""
    folder.mkdir(parents=True)
    kernels = {
        k: {
            "label": scene.facts["kernels"][k]["label"],
            "lanes": kernel.lanes,
            "workgroup": kernel.workgroup,
            "files": variants(scene, k, folder, cache),
        }
        for k, kernel in scene.kernels.items()
    }
    states = {frame: predicted(scene, frame, cache) for frame in frames}
    facts = {key: scene.facts[key] for key in ("worlds", "fields", "scratch", "state", "moving")} | {
        "order": scene.step + scene.evaluate,
        "steps": len(scene.step),
        "positions": [scene.positions.start, scene.positions.stop],
        "median": check.MEDIAN_OF_CONTACTS if scene.facts["scratch"] else check.MEDIAN,
        "stride": STRIDE,
        "kernels": kernels,
        "model": states,
    }
    (folder / "facts.json").write_text(json.dumps(facts, indent=1))
    tables: dict[str, Any] = {"numbers": scene.table("numbers"), "indices": scene.table("indices")}
    for frame in frames:
        after = scene.state("after", frame)[::STRIDE, : scene.facts["moving"]]
        arrays: dict[str, Any] = {"before": scene.state("before", frame), "after": after}
        np.savez_compressed(folder / f"{frame}.npz", **arrays, **tables)


def main() -> None:
    """Packs the scenes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--worlds", type=int, default=4096)
    parser.add_argument("--binary", type=Path, default=ROOT / "target/release/examples/gpu_bench")
    parser.add_argument("--cache", type=Path, default=ROOT / "out/offline")
    parser.add_argument("--dump", type=Path, help="a folder with dumped scenes; otherwise they are written anew")
    parser.add_argument("--out", type=Path, default=ROOT / "out/on_card")
    given = parser.parse_args()
    shutil.rmtree(given.out, ignore_errors=True)
    given.out.mkdir(parents=True)
    emulate.library(given.cache)
    for name, frames in FRAMES.items():
        folder = given.dump or given.cache / "dump"
        if given.dump is None:
            dump.write(given.binary, folder, name, given.worlds, SAMPLES[name])
        pack(dump.read(folder / name), frames, given.out / name, given.cache)
    source = given.out / "spin.cu"
    source.write_text(SPIN)
    run(given.cache, "nvcc", f"-arch={ARCH}", "-cubin", "-o", str(source.with_suffix(".cubin")), str(source))
    source.unlink()
    shutil.copy(Path(__file__).with_name("on_card.py"), given.out)
    size = sum(path.stat().st_size for path in given.out.rglob("*") if path.is_file())
    print(f"{given.out}: {size / 1e6:.1f} MB")


if __name__ == "__main__":
    main()
