"""What an entry of benches/physics/mujoco_robots.py is, and where the files of wheels are.

Needs MuJoCo and NumPy only, because the process of mjbatch has its own MuJoCo and reads the models here too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mujoco

REPOSITORY = Path(__file__).parents[2]
# Each is filled by tests/python/NAME/fetch.py
MENAGERIE, PUBLISHED = REPOSITORY / "out/menagerie", REPOSITORY / "out/published"


@dataclass(frozen=True)
class Robot:
    """A model and how it is driven.

    Attributes:
        name: Name of the row.
        build: Makes the model; the argument is the folder of what no wheel has.
        substeps: Physics steps per control step of its owner's task.
        keyframe: Keyframe where it begins, whose ctrl its own ctrl swings about; the model's start if left out.
        swing: Largest amplitude of its ctrl, as a part of half of ctrlrange [–].
    """

    name: str
    build: Callable[[Path], mujoco.MjModel]
    substeps: int
    keyframe: str | None = None
    swing: float = 1.0

    def model(self, folder: Path) -> mujoco.MjModel:
        """The model without sensors: MuJoCo would evaluate them in every step, tightloop only for a field that asks."""
        model = self.build(folder)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_SENSOR
        return model


def found(folder: Path, file: str) -> Path:
    """The file whose wheel, the first part of its name, has any version."""
    wheel, _, rest = file.partition("/")
    versions = sorted(folder.glob(f"{wheel}-*/{rest}"))
    if not versions:
        raise FileNotFoundError(f"{folder.name}/{file} is missing; run tests/python/{folder.name}/fetch.py")
    return versions[-1]
