"""What all of gymnasium's MuJoCo tasks share: the model, actions, noise at the start, and infos."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

import tightloop as tl
from tightloop.checks.signatures import unknown_argument
from tightloop.env.controls import ActuatorControl, Control
from tightloop.env.observed import Observed
from tightloop.env.task import Array, Namespace, Task, Worlds
from tightloop.errors import ArgumentError, MissingLibrary
from tightloop.mujoco import export

#: Keywords of gymnasium's renderer and their defaults; pictures of tightloop have options of their own.
_RENDERER: dict[str, Any] = {
    "default_camera_config": None,
    "width": 480,
    "height": 480,
    "camera_id": None,
    "camera_name": None,
    "max_geom": 1000,
    "visual_options": None,
}
#: The MuJoCo model in the scene.
MODEL = "model"


class GymnasiumTask(Task):
    """A task of gymnasium's, in tightloop's physics.

    Observations are float64 without bounds, as gymnasium's. Actions beyond their range reach the reward as they are,
    and MuJoCo's limits clamp them in the simulation. What MuJoCo computes in a step belongs to the state before the
    last substep, as in gymnasium, whose observations lag in this way.

    Attributes:
        step_infos: Names in ``infos`` of a step.
        start_infos: Names in ``infos`` of a reset.
    """

    # Ant begins beyond its joint limits
    warns_of_starts = False
    dtype = np.float64
    max_episode_steps = 1000
    step_infos: ClassVar[Sequence[str]] = ()
    start_infos: ClassVar[Sequence[str]] = ()

    def __init__(self, xml_file: str, frame_skip: int, renderer: Mapping[str, Any]) -> None:
        """Read the model.

        Args:
            xml_file: A file, if it begins with ``.``, ``/`` or ``~``, or the name of one of gymnasium's.
            frame_skip: Substeps of a step.
            renderer: Keywords of gymnasium's renderer, which must have their defaults.

        Raises:
            ArgumentError: The file is missing, or a keyword of the renderer has another value.
            SignatureError: A keyword is unknown.
            MissingLibrary: MuJoCo is not installed, or gymnasium has no such models.
        """
        kind = type(self).__name__
        for name, value in renderer.items():
            if name not in _RENDERER:
                raise unknown_argument(f"task {kind}", name, [*_RENDERER])
            if value != _RENDERER[name]:
                raise ArgumentError(
                    f"task {kind}: {name} is for gymnasium's renderer; leave it out, and give render_mode, or film "
                    "with tightloop.view"
                )
        self._model = export.compiled(_file_of(kind, xml_file))
        # the import needs the package of MuJoCo
        from tightloop.mujoco.batch.joints import JointMap

        self._joints = JointMap(self._model)
        self._frame_skip = frame_skip
        self.dt: float = self._model.opt.timestep * frame_skip

    def scene(self) -> tl.Scene:
        """The model alone."""
        scene = tl.Scene.from_mujoco(self._model, name=MODEL)
        scene.substeps = self._frame_skip
        return scene

    def controls(self) -> Sequence[Control]:
        """The actuators."""
        return [ActuatorControl(self._model.actuator_ctrlrange, clips=False)]

    def body(self, name: int | str) -> int:
        """Return the index of a body of the model.

        Raises:
            ArgumentError: There is no such body.
        """
        try:
            return int(self._model.body(name).id)
        except (KeyError, IndexError, TypeError):
            raise ArgumentError(f"task {type(self).__name__}: the model has no body {name!r}") from None

    def parts(self, *sizes: tuple[str, int, str]) -> Sequence[Observed]:
        """Return parts of the observation without bounds, by name, size and unit; those of size 0 are left out."""
        return [Observed(name, -np.inf, np.inf, size, unit) for name, size, unit in sizes if size]

    # starts

    def states_of(self, qpos: NDArray[np.float64], qvel: NDArray[np.float64]) -> Mapping[str, NDArray[np.float64]]:
        """Convert MuJoCo's positions and velocities."""
        nq, nv = self._model.nq, self._model.nv
        if qpos.shape[1:] != (nq,) or qvel.shape[1:] != (nv,):
            raise ArgumentError(
                f"set_state: qpos has {qpos.shape[1:]} values per world and qvel {qvel.shape[1:]}; give {nq} and {nv}"
            )
        return {"joint_q": self._joints.positions(qpos), "joint_qd": self._joints.velocities(qpos, qvel)}

    def spread(self, draws: Array, scale: float) -> Array:
        """Return draws as uniform numbers from ``-scale`` to ``scale``, in float64."""
        return scale * (2.0 * np.asarray(draws, np.float64) - 1.0)

    def around_start(self, positions: Array, velocities: Array) -> Mapping[str, Array]:
        """Return states that differ from the model's start by some positions and velocities."""
        return self.states_of(self._model.qpos0 + positions, velocities)

    # results, which `remember` has computed

    def reward(self, xp: Namespace, worlds: Worlds) -> Array:
        """The reward."""
        return worlds.memory["reward"]

    def metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """What ``infos`` of a step have."""
        return {name: worlds.memory[name] for name in self.step_infos}

    def start_metrics(self, xp: Namespace, worlds: Worlds) -> Mapping[str, Array]:
        """What ``infos`` of a reset have."""
        return {name: worlds.memory[name] for name in self.start_infos}


def normal(draws: Array, scale: float) -> Array:
    """Return normal numbers of a standard deviation, ``(n, k)``, from uniform ones in [0, 1), ``(n, 2 k)``."""
    uniform = np.asarray(draws, np.float64)
    count = uniform.shape[1] // 2
    # Box and Muller (1958)
    return scale * np.sqrt(-2.0 * np.log1p(-uniform[:, :count])) * np.cos(2.0 * np.pi * uniform[:, count:])


def squared(xp: Namespace, array: Array) -> Array:
    """Return the sum of the squares of each world."""
    return xp.sum(array * array, axis=1)


def speed(worlds_now: Array, memory: Mapping[str, Array] | None, name: str, dt: float) -> Array:
    """Return how fast a place has changed in a step; 0 where an episode begins."""
    return 0.0 * worlds_now if memory is None else (worlds_now - memory[name]) * (1.0 / dt)


def vector(value: ArrayLike, name: str) -> tuple[float, float]:
    """Return a range.

    Raises:
        ArgumentError: It is not two numbers.
    """
    ends = np.asarray(value, np.float64)
    if ends.shape != (2,):
        raise ArgumentError(f"{name} is {value!r}; give the lower and the upper end")
    return float(ends[0]), float(ends[1])


def _file_of(kind: str, xml_file: str) -> Path:
    """Return the file of a model, found as gymnasium does."""
    name = str(xml_file)
    if name.startswith(".") or Path(name).is_absolute():
        path = Path(name)
    elif name.startswith("~"):
        path = Path(name).expanduser()
    else:
        path = Path(gymnasium.__file__).parent / "envs/mujoco/assets" / name
        if not path.parent.is_dir():
            raise MissingLibrary(
                f"task {kind}: the installed gymnasium {gymnasium.__version__} has no models at {path.parent}; run "
                '`pip install --force-reinstall "gymnasium[mujoco]>=1.1"`'
            )
    if not path.is_file():
        raise ArgumentError(
            f"task {kind}: xml_file is {xml_file!r}, and there is no file {path}; give a path that begins with `.` or "
            '`/`, or the name of a model of gymnasium\'s (`pip install "gymnasium[mujoco]>=1.1"`)'
        )
    return path
