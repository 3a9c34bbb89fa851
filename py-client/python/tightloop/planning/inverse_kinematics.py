"""Inverse kinematics: joint positions at which frames reach their targets, for many targets at once.

Levenberg-Marquardt with a damping that falls with the error (Sugihara, "Solvability-unconcerned inverse kinematics by
the Levenberg-Marquardt method", IEEE Transactions on Robotics 27, 2011), within joint limits, with random restarts.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop import _core, system
from tightloop.arrays.inputs import whole_seed
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError
from tightloop.planning.ik_objectives import Posture, Reach, rows, unit_quaternions
from tightloop.planning.ik_of_daemon import IkOfDaemon
from tightloop.scene.scene import Scene

# As of a daemon: a system that gives no more threads would end the process.
_THREADS_MAX = 1024

Array = NDArray[np.float64]
Targets = ArrayLike | Mapping[str, ArrayLike] | None


class IkResult(NamedTuple):
    """Solutions of inverse kinematics; `IkSolver.solve` returns it. For one problem, arrays lack the first axis."""

    joint_q: Array
    """Joint positions [rad or m], ``(n, coords)``; the best attempt where none succeeded."""
    success: NDArray[np.bool_]
    """Whether all frames are within the tolerances, ``(n,)``."""
    position_error: Array
    """Largest distance of a frame from its target [m], ``(n,)``."""
    rotation_error: Array
    """Largest angle between a frame and its target [rad], ``(n,)``."""
    iterations: NDArray[np.uint32]
    """Iterations of all attempts, ``(n,)``."""
    restarts: NDArray[np.uint32]
    """Attempts after the first, ``(n,)``."""


@checked_calls
def ik(
    scene: Scene,
    objectives: Reach | Posture | Sequence[Reach | Posture],
    *,
    joints: Sequence[str] | None = None,
    limits: bool = True,
) -> IkSolver:
    """Make a solver of inverse kinematics; `IkSolver.solve` takes the targets.

    Joints that move no frame keep their start. Mimic joints, joints that a MuJoCo model couples, and loops that it
    closes stay together. A floating base moves, too, unless ``joints`` leaves it out.

    Args:
        scene: The scene; later changes to it have no effect.
        objectives: One `Reach` or several, each of its own frame, and at most one `Posture`.
        joints: What may move: names of joints ``robot/joint``, or of robots for all of their joints. All if left out.
        limits: Whether joints keep within their limits.

    Returns:
        The solver.

    Raises:
        ArgumentError: An argument is not valid, or no joint that may move moves a frame.
        SceneError: The scene is not valid.
    """
    if not isinstance(scene, Scene):
        raise ArgumentError(f"ik: scene is {type(scene).__name__}; give a tightloop.Scene")
    return IkSolver(_core.Ik(scene.to_toml(), "/"), objectives, joints, limits)


class IkSolver:
    """A solver of inverse kinematics; `ik` and `Sim.ik` make it.

    That of a simulation solves in the daemon, by its threads. Its problems are the worlds, which start at their present
    positions unless ``joint_q`` is given. No world moves.

    Attributes:
        reaches: The `Reach` objectives.
        posture: The `Posture` objective, or None.
        coord_names: ``robot/joint`` of each coordinate.
        dof_names: ``robot/joint`` of each dof.
        frame_names: Names of all frames that an objective may name.
        start: Where problems start by default, as the scene does, ``(coords,)``; None for the worlds of a simulation.
    """

    def __init__(
        self,
        core: _core.Ik | IkOfDaemon,
        objectives: Reach | Posture | Sequence[Reach | Posture],
        joints: Sequence[str] | None,
        limits: bool,
    ) -> None:
        self.dof_names, self.coord_names, self.frame_names = core.names
        self.start = None if core.start is None else np.array(core.start)
        self.reaches, self.posture = _objectives(objectives)
        for reach in self.reaches:
            for name in (reach.frame, reach.relative_to):
                if name is not None and self.frame_names and name not in self.frame_names:
                    raise ArgumentError(
                        f"ik: objectives: there is no link or site `{name}`; {suggestion(name, self.frame_names)}"
                    )
        task = {
            "reaches": [
                {
                    "frame": reach.frame,
                    "relative_to": reach.relative_to,
                    "position_weight": reach.weights[0],
                    "orientation_weight": reach.weights[1],
                }
                for reach in self.reaches
            ],
            "moves": _moves(joints, self.dof_names),
            "limits": checks.flag("ik: limits", limits, error=ArgumentError),
            "posture_weight": self._posture_weight(),
        }
        self._core = core.solver(json.dumps(task))
        # a daemon's number of threads is its own
        self._worlds, self._threads = (core.worlds, 0) if isinstance(core, IkOfDaemon) else (1, None)

    def __repr__(self) -> str:
        return f"IkSolver({', '.join(reach.frame for reach in self.reaches)})"

    @checked_calls
    def solve(
        self,
        position: Targets = None,
        orientation: Targets = None,
        *,
        joint_q: ArrayLike | None = None,
        iterations: int = 50,
        restarts: int = 100,
        tolerance: tuple[float, float] = (1e-4, 1e-3),
        seed: int = 0,
        precision: str = "f32",
        threads: int | None = None,
    ) -> IkResult:
        """Find joint positions at which the frames reach their targets.

        Every array is for one problem or for many; one row stands for all. The first attempt starts at ``joint_q``,
        the others at random positions within the limits. A result depends on its targets, its start, its index and the
        seed alone: not on the number of problems, threads or lanes.

        Args:
            position: Target position [m], ``(3,)`` or ``(n, 3)``. With several `Reach`, a dict by frame. If left out,
                the objective's own.
            orientation: Target quaternion (x, y, z, w), ``(4,)`` or ``(n, 4)``, in the same forms.
            joint_q: Where the first attempt starts [rad or m], ``(coords,)`` or ``(n, coords)``; the scene's start if
                left out. Positions beyond limits move to them.
            iterations: Most iterations of an attempt. One that makes no progress ends earlier. All attempts at a
                problem may have a million together.
            restarts: Most attempts after the first.
            tolerance: Position [m] and rotation [rad] that count as reached.
            seed: Seed of the restarts.
            precision: Precision of the iterations, ``"f32"`` or ``"f64"``. Errors are always evaluated in double
                precision.
            threads: Number of threads, at most 1024; all cores of this process if left out.

        Returns:
            The solutions.

        Raises:
            ArgumentError: An argument is not valid.
        """
        positions = self._targets("position", position, 3)
        orientations = self._targets("orientation", orientation, 4)
        coords = len(self.coord_names)
        start = self.start if joint_q is None else rows("solve: joint_q", joint_q, coords)
        posture = np.empty(0) if self.posture is None or self.posture.joint_q is None else self.posture.joint_q
        what = {"Posture: joint_q": np.asarray(posture)} | ({} if start is None else {"joint_q": start})
        for reach, place, turn in zip(self.reaches, positions, orientations, strict=True):
            what |= {f"position of `{reach.frame}`": place, f"orientation of `{reach.frame}`": turn}
        counts = {name: len(array) for name, array in what.items() if array.ndim == 2}
        if start is None:  # those of the worlds
            counts["the present state of the worlds"] = self._worlds
        most = max(counts, key=lambda name: counts[name], default="")
        count = counts.get(most, 1)
        for name, given in counts.items():
            if given not in (1, count):
                raise ArgumentError(f"solve: {name} has {given} rows, and {most} has {count}; give all of one number")
        arrays = [np.empty(0) if start is None else start, np.asarray(posture)]
        for pair in zip(positions, orientations, strict=True):
            arrays += pair
        solved = self._core.solve(
            count,
            [array.reshape(-1) for array in arrays],
            (
                checks.integer("solve: iterations", iterations, error=ArgumentError),
                checks.integer("solve: restarts", restarts, least=0, error=ArgumentError),
                _seed(seed),
            ),
            _tolerance(tolerance),
            (_is_double(precision), _threads(threads, self._threads)),
        )
        result = IkResult(solved[0].reshape(count, coords), *solved[1:])
        return result if counts else IkResult(*(array[0] for array in result))

    def _targets(self, name: str, given: Targets, columns: int) -> list[Array]:
        """Return the target of each frame; empty where it does not count."""
        known = [reach.frame for reach in self.reaches]
        if isinstance(given, Mapping):
            for frame in given:
                if frame not in known:
                    raise ArgumentError(f"solve: {name} has {frame!r:.80}; {suggestion(str(frame), known)}")
            by_frame = dict(given)
        elif given is None:
            by_frame = {}
        elif len(known) == 1:
            by_frame = {known[0]: given}
        else:
            raise ArgumentError(f"solve: {name} is one array for {len(known)} frames; give a dict by frame: {known}")
        targets = []
        for reach in self.reaches:
            counts = any(reach.weights[columns == 4])
            value = by_frame.get(reach.frame, getattr(reach, name))
            what = f"solve: {name} of `{reach.frame}`"
            if not counts:
                if reach.frame in by_frame:
                    raise ArgumentError(f"{what} does not count: its {name}_weight is 0; leave it out")
                targets.append(np.empty(0))
                continue
            if value is None:
                raise ArgumentError(f"{what} is missing; give it, or make the objective with {name}_weight=0")
            array = rows(what, value, columns)
            if columns == 4:
                unit_quaternions(what, array)
            targets.append(array)
        return targets

    def _posture_weight(self) -> list[float]:
        dofs = len(self.dof_names)
        if self.posture is None:
            return [0.0] * dofs
        reference, weight = self.posture.joint_q, np.asarray(self.posture.weight)
        if reference is not None:
            rows("ik: joint_q of Posture", reference, len(self.coord_names))
        if weight.shape not in ((), (dofs,)):
            raise ArgumentError(f"ik: weight of Posture has shape {weight.shape}; give a number, or ({dofs},)")
        return np.broadcast_to(weight, dofs).tolist()


def _objectives(given: Any) -> tuple[list[Reach], Posture | None]:
    """Return the frames and the posture among objectives."""
    alone = isinstance(given, Reach | Posture)
    if not alone and (isinstance(given, str) or not isinstance(given, Sequence)):
        raise ArgumentError(f"ik: objectives is {given!r:.80}; give a tightloop.Reach, or a list of them")
    reaches: list[Reach] = []
    posture = None
    for objective in [given] if alone else given:
        if isinstance(objective, Reach):
            if objective.frame in [reach.frame for reach in reaches]:
                raise ArgumentError(f"ik: objectives has two for `{objective.frame}`; give one per frame")
            reaches.append(objective)
        elif isinstance(objective, Posture) and posture is None:
            posture = objective
        elif isinstance(objective, Posture):
            raise ArgumentError("ik: objectives has two of Posture; give one")
        else:
            raise ArgumentError(f"ik: objectives has {objective!r:.80}; give tightloop.Reach or tightloop.Posture")
    if not reaches:
        raise ArgumentError("ik: objectives has no Reach; give a frame that is to reach a target")
    return reaches, posture


def _moves(joints: Any, dof_names: list[str]) -> list[bool]:
    """Return whether each dof may move."""
    if joints is None:
        return [True] * len(dof_names)
    if isinstance(joints, str) or not isinstance(joints, Sequence):
        raise ArgumentError(f"ik: joints is {joints!r:.80}; give a list of names of joints or robots")
    moves = [False] * len(dof_names)
    # a joint with several dofs is `robot/joint.part`
    owners = [{name, name.partition("/")[0], name.rpartition(".")[0]} for name in dof_names]
    for joint in joints:
        named = [dof for dof, own in enumerate(owners) if isinstance(joint, str) and joint and joint in own]
        if not named:
            known = sorted(set().union(*owners) - {""})
            raise ArgumentError(f"ik: joints has {joint!r:.80}; {suggestion(str(joint), known)}")
        for dof in named:
            moves[dof] = True
    return moves


def _tolerance(value: Any) -> tuple[float, float]:
    position, rotation = checks.pair("solve: tolerance", value, error=ArgumentError)
    if min(position, rotation) <= 0.0:
        raise ArgumentError(f"solve: tolerance is {(position, rotation)}; give two positive numbers [m], [rad]")
    return position, rotation


def _seed(value: Any) -> int:
    seed = whole_seed(value)
    if seed is None:
        raise ArgumentError(f"solve: seed is {value!r:.80}; give a whole number from 0 to 2**64 - 1")
    return seed


def _is_double(value: Any) -> bool:
    if value not in ("f32", "f64"):
        raise ArgumentError(f'solve: precision is {value!r:.80}; give "f32" or "f64"')
    return value == "f64"


def _threads(value: Any, own: int | None) -> int:
    if value is None:
        return min(system.usable_cores(), _THREADS_MAX) if own is None else own
    return checks.integer("solve: threads", value, error=ArgumentError)
