"""What the training examples have in common: libraries, reports, and the command line of two of them."""

from __future__ import annotations

import argparse
import csv
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol, TypeVar

from evaluation import told
from tightloop.whole_files import whole_file

# Libraries whose name for pip is not that of their module
PIP_NAMES = {"rsl_rl": "rsl-rl-lib", "stable_baselines3": "stable-baselines3", "PIL": "pillow"}


@contextmanager
def needed(*modules: str) -> Iterator[None]:
    """Check that libraries are installed, also those that are imported only at the end of a training.

    Args:
        modules: Names of their modules.

    Raises:
        SystemExit: Some are missing; the message has the command that installs them.
    """
    missing = [module for module in modules if find_spec(module) is None]
    if missing:
        names = " ".join(PIP_NAMES.get(module, module) for module in missing)
        raise SystemExit(f"{Path(sys.argv[0]).name}: there is no {', '.join(missing)}: pip install {names}")
    yield


def report(task: str, progress: str, found: Mapping[str, float]) -> None:
    """Print a line for an evaluation, unless a progress bar shows it in a terminal.

    Args:
        task: Name of the task.
        progress: How far the training is.
        found: What `evaluation.evaluate` returned.
    """
    if sys.stdout.isatty() and sys.stderr.isatty():
        return
    # a reader of a file or a pipe sees each line at once
    print(f"{task}, {progress}: {', '.join(f'{name} {value}' for name, value in told(found).items())}", flush=True)


def draw(curve: list[dict[str, float]], title: str, path: Path) -> None:
    """The curve as CSV and PNG: return, success and metrics over minutes."""
    names = [name for name in curve[-1] if name not in ("seconds", "steps")]
    with whole_file(path.with_suffix(".csv")) as part, part.open("w", newline="") as file:
        table = csv.DictWriter(file, ["seconds", "steps", *names], lineterminator="\n")
        table.writeheader()
        table.writerows({name: f"{value:.6g}" for name, value in row.items()} for row in curve)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    # the terms of the reward are in the table
    names = [name for name in names if not name.startswith("return/")]
    figure, axes = plt.subplots(1, len(names), figsize=(4 * len(names), 3), constrained_layout=True, squeeze=False)
    minutes = [row["seconds"] / 60 for row in curve]
    for axis, name in zip(axes[0], names, strict=True):
        axis.plot(minutes, [row.get(name, math.nan) for row in curve], marker=".")
        axis.set(title=name, xlabel="time [min]")
        axis.grid(alpha=0.3)
    figure.suptitle(title)
    with whole_file(path) as part:
        figure.savefig(part, dpi=90)
    plt.close(figure)


class Sized(Protocol):
    """Numbers of a run."""

    @property
    def total(self) -> int:
        """Env steps of all worlds together."""
        ...


P = TypeVar("P", bound=Sized)


def command_line(
    library: str,
    presets: Mapping[str, P],
    out: Path,
    train: Callable[[str, P, int, Path, int], dict[str, float]],
    model: str,
) -> None:
    """Train, evaluate, and leave the policy.

    Args:
        library: What trains.
        presets: Numbers of a run, by task.
        out: Folder of all runs, if none is given.
        train: Takes the task, its preset, a seed, the folder of the run and the threads of the simulation; returns what
            `evaluation.evaluate` found at the end.
        model: Name of the file that it leaves.
    """
    parser = argparse.ArgumentParser(description=f"Train a policy with {library}.")
    parser.add_argument("task", choices=presets, help="what to learn")
    parser.add_argument("--seed", type=int, default=0, help="of weights, actions and episodes (default 0)")
    parser.add_argument("--threads", type=int, default=2, help="most threads of the simulation (default 2)")
    parser.add_argument("--out", type=Path, default=out, help=f"folder of all runs (default out/{out.name}/)")
    args = parser.parse_args()

    preset, folder = presets[args.task], args.out / f"{args.task}-{args.seed}"
    folder.mkdir(parents=True, exist_ok=True)
    begun = time.perf_counter()
    found = train(args.task, preset, args.seed, folder, args.threads)
    seconds = time.perf_counter() - begun
    print(f"{args.task}, seed {args.seed}: {preset.total / 1e6:.1f} M steps in {seconds:.0f} s")
    print(", ".join(f"{name} {value}" for name, value in told(found).items()) + f"; {folder / model}")
