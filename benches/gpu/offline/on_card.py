"""Runs packed kernels as CUDA on a card: checks a frame, times its dispatches, and reads what the profiler counts.

    python3 out/on_card/on_card.py [--no-times] [--no-ncu] [--states grasp-112,target-90]

`on_card_pack.py` writes the folder and copies this file into it. CuPy is needed, and ncu for the counters.
"""

from __future__ import annotations

import argparse
import csv
import gzip
import io
import itertools
import json
import os
import re
import subprocess
import sys
import tempfile
import traceback
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
OUT = Path(os.environ.get("OUT", tempfile.gettempdir()))
PREFERRED = ("grasp-112", "target-90", "grasp-37", "standing-50")
REPETITIONS, AGAIN = 20, 7
SPIN = np.int64(4_000_000)
"""[cycles] for which the card waits, so that a whole frame is queued before it begins."""
HEAD = (
    "  kernel        file          regs local   n     µs  least   most |  model ratio |  again   132     1 |"
    " cycles of 1  model"
)
"""n: dispatches of a frame. again: launched once more, then with that many workgroups."""
VARIANTS = ("model or warp", "peers", "driver")
SECTIONS = (
    "SpeedOfLight LaunchStats Occupancy SchedulerStats WarpStateStats InstructionStats MemoryWorkloadAnalysis "
    "SourceCounters"
).split()
WANTED = (
    "sm__icc_requests sm__icc_requests_lookup_hit sm__icc_requests_lookup_miss gcc__cache_requests_type_instruction "
    "gcc__cache_requests_type_instruction_lookup_hit gcc__cache_requests_type_instruction_lookup_miss dram__bytes "
    "smsp__inst_executed lts__t_sectors l1tex__t_sectors"
).split()
COLUMNS = {
    "regs": "launch__registers_per_thread",
    "warps": "smsp__warps_active.avg.per_cycle_active",
    "issue": "smsp__issue_active.avg.per_cycle_active",
    "inst": "smsp__inst_executed.sum",
    "lanes": "smsp__thread_inst_executed_per_inst_executed.ratio",
    "cyc/inst": "smsp__average_warp_latency_per_inst_issued.ratio",
    "L1 %": "l1tex__t_sector_hit_rate.pct",
    "L2 %": "lts__t_sector_hit_rate.pct",
    "DRAM B": "dram__bytes.sum",
    "spills": "sass__inst_executed_register_spilling",
    "icc": "sm__icc_requests.sum",
    "icc miss": "sm__icc_requests_lookup_miss.sum",
    "gcc": "gcc__cache_requests_type_instruction.sum",
    "gcc miss": "gcc__cache_requests_type_instruction_lookup_miss.sum",
}
"""Of a quarter of a multiprocessor: resident warps, instructions a cycle. icc, gcc: levels 1 and 1.5 of code."""
STALL = re.compile(r"smsp__average_warps?_issue_stalled_(\w+?)_per_issue_active\.ratio")


def say(*parts: object) -> None:
    """Prints, and keeps what it prints."""
    print(*parts, flush=True)
    with (OUT / "on_card.txt").open("a") as kept:
        print(*parts, file=kept)


class State:
    """A dumped state in the card's memory, and the kernels of its frame."""

    def __init__(self, name: str) -> None:
        import cupy  # the profiler's parent needs no card

        scene, self.frame = name.split("-")
        self.cupy, self.folder = cupy, HERE / scene
        self.facts = json.loads((self.folder / "facts.json").read_text())
        self.order: list[int] = self.facts["order"]
        self.kernels = {int(k): kernel for k, kernel in self.facts["kernels"].items()}
        with np.load(self.folder / f"{self.frame}.npz") as kept:
            before, self.after = kept["before"], kept["after"]
            numbers, indices = cupy.asarray(kept["numbers"]), cupy.asarray(kept["indices"])
        worlds, width = before.shape
        whole = np.zeros((worlds, -(-width // 4) * 4), np.float32)
        whole[:, :width] = before
        self.before = cupy.asarray(np.ascontiguousarray(whole.reshape(worlds, -1, 4).transpose(1, 0, 2)))
        self.fields = cupy.zeros((-(-self.facts["fields"] // 4), worlds, 4), np.float32)
        scratch = cupy.zeros((max(-(-self.facts["scratch"] // 4), 1), worlds, 4), np.float32)
        self.arguments = (self.fields, scratch, numbers, indices)
        self.took, self.dropped = cupy.zeros(2, np.int64), cupy.zeros(2, np.int64)
        self.spin = self.load(HERE / "spin.cubin", "spin")

    def load(self, path: Path, name: str = "kernel_main") -> Any:
        """A function of a cubin, or of PTX, which the driver compiles."""
        module = self.cupy.cuda.function.Module()
        module.load_file(str(path))
        return module.get_function(name)

    def file(self, k: int, variant: str) -> str:
        """What a kernel has of a variant."""
        files = self.kernels[k]["files"]
        return files.get(variant) or files.get("warp") or files["model"]

    def functions(self, variant: str) -> dict[int, Any]:
        """The kernels of a variant."""
        try:
            return {k: self.load(self.folder / self.file(k, variant)) for k in self.kernels}
        except Exception as error:
            say(f"{variant} cannot be loaded, the driver compiles instead: {error}")
            return {k: self.load(self.folder / kernel["files"]["driver"]) for k, kernel in self.kernels.items()}

    def start(self) -> None:
        """Puts the state back, and holds the card while the frame is queued."""
        self.fields.data.copy_from_device_async(self.before.data, self.before.nbytes)
        self.spin((1, 1, 1), (1, 1, 1), (SPIN, self.took))

    def blocks(self, k: int) -> int:
        """Workgroups of a kernel."""
        kernel = self.kernels[k]
        return -(-self.facts["worlds"] * kernel["lanes"] // kernel["workgroup"])

    def launch(self, k: int, function: Any, most: int = 1 << 30) -> None:
        """A dispatch, or its first workgroups."""
        grid = (min(self.blocks(k), most), 1, 1)
        function(grid, (self.kernels[k]["workgroup"], 1, 1), self.arguments)

    def mark(self) -> Any:
        """A time stamp."""
        event = self.cupy.cuda.Event()
        event.record()
        return event

    def between(self, marks: list[Any]) -> list[float]:
        """Times between time stamps [µs]."""
        marks[-1].synchronize()
        return [1e3 * self.cupy.cuda.get_elapsed_time(*pair) for pair in itertools.pairwise(marks)]

    def frames(self, functions: dict[int, Any]) -> np.ndarray:
        """Times of a frame's dispatches [µs], in the median of repetitions."""
        found = []
        for _ in range(REPETITIONS):
            self.start()
            marks = [self.mark()]
            for k in self.order:
                self.launch(k, functions[k])
                marks.append(self.mark())
            found.append(self.between(marks))
        return np.median(found[2:], axis=0)

    def middle(self, k: int) -> int:
        """A dispatch of a kernel, in the middle of the frame."""
        places = [place for place, other in enumerate(self.order) if other == k]
        return places[len(places) // 2]

    def again(self, k: int, functions: dict[int, Any]) -> list[float]:
        """Times of a kernel [µs]: once more, at most a workgroup on each multiprocessor, one workgroup."""
        found = []
        for _ in range(AGAIN):
            self.start()
            for other in self.order[: self.middle(k) + 1]:
                self.launch(other, functions[other])
            marks = [self.mark()]
            for most in (1 << 30, 132, 132, 1, 1):
                self.launch(k, functions[k], most)
                marks.append(self.mark())
            found.append(self.between(marks))
        return np.median(found, axis=0)[[0, 2, 4]].tolist()

    def agreement(self) -> str:
        """How far the frame's end is from the dumped one, as check.py tells it."""
        moving, (first, last) = self.facts["moving"], self.facts["positions"]
        memory = self.fields.get()[: -(-moving // 4)]
        found = memory.transpose(1, 0, 2).reshape(memory.shape[1], -1)[:: self.facts["stride"], :moving]
        difference = np.abs(found - self.after)
        difference[np.isnan(found) != np.isnan(self.after)] = np.inf
        difference = np.nan_to_num(difference, nan=0.0, posinf=np.inf)
        scaled = difference / np.maximum(np.nan_to_num(np.abs(self.after)), 1.0)
        median, positions = np.median(scaled.max(axis=1)), difference[:, first:last].max()
        verdict = "agrees" if median < self.facts["median"] and positions < 1e-4 else "DIFFERS"
        return f"{verdict}: largest {scaled.max():.1e}, median of worlds {median:.1e}, positions {positions:.1e}"

    def price(self) -> list[float]:
        """Times of nothing and of an empty kernel between time stamps [µs]."""
        self.start()
        marks = [self.mark(), self.mark()]
        for _ in range(2):
            self.spin((1, 1, 1), (1, 1, 1), (np.int64(0), self.dropped))
            marks.append(self.mark())
        return self.between(marks)


def times(name: str) -> None:
    """Prints a state's times."""
    state = State(name)
    driver = state.cupy.cuda.driver
    model = state.facts["model"][state.frame]
    exchanges = any(kernel["lanes"] > 1 for kernel in state.kernels.values())
    for variant in VARIANTS if exchanges else VARIANTS[::2]:
        try:
            functions = state.functions(variant)
            measured = state.frames(functions)
            agreement = state.agreement()
            clock = np.divide(*state.took.get().tolist())
            steps = sum(measured[: state.facts["steps"]])
            say(f"\n{name} {variant}: {agreement}; steps {steps:.0f} µs a frame, {clock:.3f} GHz")
            if variant == VARIANTS[0]:
                say(HEAD)
            for k, kernel in state.kernels.items():
                if variant == "peers" and variant not in kernel["files"]:
                    continue
                rows = measured[[place for place, other in enumerate(state.order) if other == k]]
                regs = driver.funcGetAttribute(driver.CU_FUNC_ATTRIBUTE_NUM_REGS, functions[k].ptr)
                local = driver.funcGetAttribute(driver.CU_FUNC_ATTRIBUTE_LOCAL_SIZE_BYTES, functions[k].ptr)
                mean, expected = rows.mean(), model[str(k)]
                line = (
                    f"  {kernel['label']:13} {state.file(k, variant):14}{regs:4}{local:6}{len(rows):4}{mean:7.1f}"
                    f"{rows.min():7.1f}{rows.max():7.1f} |{expected['us']:7.1f}{mean / expected['us']:6.2f}"
                )
                if variant != "peers":
                    again, spread, alone = state.again(k, functions)
                    line += (
                        f" |{again:7.1f}{spread:6.1f}{alone:6.1f} |{alone * clock * 1e3:12.0f}{expected['mean']:7.0f}"
                    )
                say(line)
        except Exception:  # the others may still work
            say(f"{name} {variant} failed:\n{traceback.format_exc(limit=-3)}")
    nothing, *empty = state.price()
    say(f"  between time stamps: nothing {nothing:.1f} µs, an empty kernel {min(empty):.1f} µs")


def profiled(order: list[int], steps: int) -> list[int]:
    """Dispatches that are profiled: of each kernel of the steps one, in the middle of the frame."""
    places: dict[int, list[int]] = defaultdict(list)
    for place, k in enumerate(order[:steps]):
        places[k].append(place)
    return sorted(found[len(found) // 2] for found in places.values())


def play(names: list[str]) -> None:
    """Runs frames for the profiler."""
    for name in names:
        state = State(name)
        profiler, functions = state.cupy.cuda.profiler, state.functions(VARIANTS[0])
        chosen = set(profiled(state.order, state.facts["steps"]))
        for is_second in (False, True):
            state.start()
            for place, k in enumerate(state.order):
                if is_second and place in chosen:
                    state.cupy.cuda.Device().synchronize()
                    profiler.start()
                    state.launch(k, functions[k])
                    state.cupy.cuda.Device().synchronize()
                    profiler.stop()
                else:
                    state.launch(k, functions[k])
        state.cupy.cuda.Device().synchronize()


def ncu(*arguments: str, limit: int = 60) -> str:
    """What the profiler prints."""
    command = ["timeout", "-k", "2", str(limit), "ncu", *arguments]  # ends the program that is profiled, too
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    errors = [line for line in (done.stdout + done.stderr).splitlines() if line.startswith("==ERROR==")]
    if done.returncode:
        say(f"ncu ended with {done.returncode}: {' '.join(errors)[:600] or (done.stdout + done.stderr)[-600:]}")
    return done.stdout


def metrics() -> list[str]:
    """Those of the wanted metrics that the chip has."""
    try:
        known = set(re.findall(r"^(\w+)", ncu("--query-metrics", "--chips", "gh100"), re.MULTILINE))
    except (OSError, subprocess.SubprocessError) as error:
        say(f"metrics are not listed: {error}")
        known = set()
    return [f"{name}.sum" for name in WANTED if name in known]


def number(text: str | None) -> float:
    """A number of the profiler's, NaN without one."""
    try:
        return float((text or "").replace(",", ""))
    except ValueError:
        return float("nan")


def short(x: float) -> str:
    """A number in seven characters or fewer."""
    if np.isnan(x):
        return "-"
    return f"{x / 1e6:.2f}M" if x >= 1e6 else f"{x / 1e3:.1f}k" if x >= 1e4 else f"{x:.4g}"


def rows_of(text: str) -> list[dict[str, str]]:
    """Kernels of a raw page; its second line has units."""
    lines = text.splitlines()
    first = next((place for place, line in enumerate(lines) if line.startswith('"ID"')), None)
    if first is None:
        return []
    return [row for row in csv.DictReader(io.StringIO("\n".join(lines[first:]))) if (row["ID"] or "").isdigit()]


def counters(names: list[str]) -> None:
    """Profiles states and prints the counters."""
    labels = []
    for name in names:
        facts = json.loads((HERE / name.split("-")[0] / "facts.json").read_text())
        chosen = profiled(facts["order"], facts["steps"])
        labels += [f"{name} {facts['kernels'][str(facts['order'][place])]['label']}" for place in chosen]
    report = Path(tempfile.mkdtemp()) / "report.ncu-rep"
    how = "--clock-control none --cache-control none --profile-from-start off --warp-sampling-interval 2 -f".split()
    sections = [part for name in SECTIONS for part in ("--section", name)]
    extra = ["--metrics", ",".join(found)] if (found := metrics()) else []
    what = (sys.executable, str(Path(__file__).resolve()), "--play", ",".join(names))
    for more in (extra, []):
        ncu(*how, *sections, *more, "-o", str(report), *what)
        if report.exists():
            break
    if not report.exists():
        return
    rows = rows_of(ncu("--import", str(report), "--page", "raw", "--csv", "--print-units", "base"))
    if len(rows) != len(labels):
        say(f"{len(rows)} kernels were profiled, not {len(labels)}")
        labels = [f"kernel {row['ID']}" for row in rows]
    table(rows, labels)
    source = ncu("--import", str(report), "--page", "source", "--csv")
    (OUT / f"sass-{'-'.join(names)}.csv.gz").write_bytes(gzip.compress(source.encode()))
    operations(source, labels)


def table(rows: list[dict[str, str]], labels: list[str]) -> None:
    """Prints counters and reasons of stalls."""
    say(f"\n{'kernel':22}{'µs':>7}" + "".join(f"{title:>9}" for title in COLUMNS))
    for label, row in zip(labels, rows, strict=False):
        time = number(row.get("gpu__time_duration.sum")) / 1e3
        say(f"{label:22}{time:7.1f}" + "".join(f"{short(number(row.get(name))):>9}" for name in COLUMNS.values()))
    stalls = [{match[1]: number(row[name]) for name in row if (match := STALL.match(name or ""))} for row in rows]
    reasons = sorted(set(itertools.chain(*stalls)), key=lambda one: -sum(row.get(one, 0) for row in stalls))[:12]
    say(f"\n{'cycles an instruction':22}" + "".join(f"{reason[:9]:>10}" for reason in reasons))
    for label, row in zip(labels, stalls, strict=False):
        say(f"{label:22}" + "".join(f"{row.get(reason, np.nan):10.2f}" for reason in reasons))


def operations(source: str, labels: list[str]) -> None:
    """Prints which operations the samples of stalled warps lie on."""
    found: list[Counter[str]] = []
    operation_at = samples_at = -1
    for row in csv.reader(io.StringIO(source)):
        if "Source" in row:
            operation_at = row.index("Source")
            samples_at = next((place for place, name in enumerate(row) if "Samp" in name), -1)
            found.append(Counter())
        elif found and samples_at >= 0 and len(row) > max(operation_at, samples_at):
            match = re.match(r"\s*(?:@!?U?P\w+\s+)?([A-Z]\w*)", row[operation_at])
            samples = number(row[samples_at])
            if match and samples > 0:
                found[-1][match[1]] += round(samples)
    say("\nsamples by operation, %")
    for label, one in zip(labels, found, strict=False):
        whole = sum(one.values()) or 1
        say(f"{label:22}", ", ".join(f"{name} {100 * n / whole:.0f}" for name, n in one.most_common(9)), f"of {whole}")


def main() -> None:
    """Does what the command line asks."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--states", default=",".join(PREFERRED))
    parser.add_argument("--no-times", action="store_true")
    parser.add_argument("--no-ncu", action="store_true")
    parser.add_argument("--play", help="for the profiler: only run the frames of these states")
    given = parser.parse_args()
    if given.play:
        play(given.play.split(","))
        return
    names = given.states.split(",")
    parts = [] if given.no_times else [(times, name) for name in names]
    pairs = [] if given.no_ncu else [names[k : k + 2] for k in range(0, len(names), 2)]
    for do, what in [*parts, *((counters, pair) for pair in pairs)]:
        try:
            do(what)
        except Exception:  # the others may still work
            say(f"{do.__name__} {what} failed:\n{traceback.format_exc(limit=-3)}")


if __name__ == "__main__":
    main()
