"""What `ppo.py` writes while it trains: means of the rollouts, to TensorBoard and Weights & Biases."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation import metrics, with_unit


class Statistics:
    """What the worlds did during a rollout, for the log: means of rewards and metrics, and of ended episodes."""

    def __init__(self, worlds: int) -> None:
        self._return, self._steps = np.zeros(worlds), np.zeros(worlds, int)
        self._values: dict[str, list[float]] = {}

    def see(self, reward: NDArray[np.float32], done: NDArray[np.bool_], infos: dict[str, Any]) -> None:
        """Take a step into account."""
        self._return += reward
        self._steps += 1
        self._note("reward_per_step", reward)
        for name, value in metrics(infos):
            self._note(with_unit(name), value)
        if done.any():
            self._note("episode_return", self._return[done])
            self._note("episode_length_steps", self._steps[done])
            self._return[done], self._steps[done] = 0.0, 0

    def take(self) -> dict[str, float]:
        """Means since the last call, by name."""
        means = {f"train/{name}": float(np.mean(values)) for name, values in self._values.items()}
        self._values = {}
        return means

    def _note(self, name: str, values: NDArray[Any]) -> None:
        # a faulted world may have no number
        numbers = values[np.isfinite(values)]
        if len(numbers):
            self._values.setdefault(name, []).append(float(numbers.mean()))


class Log:
    """The log of a run, in ``FOLDER/log`` for TensorBoard, and in Weights & Biases if it is asked for.

    The project of Weights & Biases is ``tightloop`` unless ``WANDB_PROJECT`` names another. A run that is resumed goes
    on in the same run there.
    """

    def __init__(
        self, folder: Path, config: Mapping[str, Any] | None = None, *, wandb: bool = False, resumed: bool = False
    ) -> None:
        """Open the log.

        Args:
            folder: Folder of the run, whose name is that of the run.
            config: Numbers of the run.
            wandb: Whether to log to Weights & Biases, too.
            resumed: Whether the run goes on from a checkpoint.
        """
        from torch.utils.tensorboard import SummaryWriter

        self._writer, self._run = SummaryWriter(str(folder / "log")), None
        if wandb:
            import wandb as library

            project = os.environ.get("WANDB_PROJECT", "tightloop")
            # a run that begins anew in the same folder is another one there
            known = folder / "wandb.txt"
            if not (resumed and known.exists()):
                known.write_text(secrets.token_hex(8))
            self._run = library.init(
                project=project,
                name=folder.name,
                id=known.read_text(),
                resume="allow",
                dir=folder,
                config=dict(config or {}),
            )

    def write(self, values: Mapping[str, float], steps: int) -> None:
        """Write values by name, after so many env steps."""
        for name, value in values.items():
            self._writer.add_scalar(name, value, steps)
        if self._run is not None:
            self._run.log(dict(values), step=steps)

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()
        if self._run is not None:
            self._run.finish()

    def __enter__(self) -> Log:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
