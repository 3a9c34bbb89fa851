"""Linearization of control frames by finite differences, with the perturbed states as worlds of a planner simulation.

The definitions are those of MuJoCo's ``mjd_transitionFD``. With a displacement δ of the state x and a change ε of the
controls u, both by ``eps`` in one column at a time:

    A = (f(x ⊕ δ, u) ⊖ f(x ⊖ δ, u)) / 2 eps          B = (f(x, u + ε) ⊖ f(x, u - ε)) / 2 eps          centered
    A = (f(x ⊕ δ, u) ⊖ f(x, u)) / eps                B = (f(x, u + ε) ⊖ f(x, u)) / eps                otherwise

Where a control would leave its ``ctrlrange``, the difference to the other side alone counts.
"""

from __future__ import annotations

import itertools
import weakref
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.arrays.frames import FAULTED
from tightloop.arrays.inputs import reals
from tightloop.checks import arguments as checks
from tightloop.checks.attributes import suggestion
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, CommandRefused, DaemonLost, UnknownField
from tightloop.optional_imports import optional_import
from tightloop.planning.plans import check_alike, varying
from tightloop.planning.rotations import rotations
from tightloop.planning.tangent import Tangent
from tightloop.scene.scene import Scene
from tightloop.sim.command_arrays import called
from tightloop.sim.launching import launch
from tightloop.sim.sim import Sim

Array = NDArray[np.float64]

#: Commands that can be the controls.
_CONTROLS = ("ctrl", "joint_f", "joint_target_q", "joint_target_qd")
#: What ``states`` may have.
_STATES = ("joint_q", "joint_qd", "act")
#: Most worlds of a planner that is launched here.
_WORLDS = 1024
#: Most planners that are kept for a simulation: their sizes cover those from 1 to `_WORLDS`, a factor of four each.
_PLANNERS = 5
_tangents: weakref.WeakKeyDictionary[Sim, Tangent] = weakref.WeakKeyDictionary()


class Linearization(NamedTuple):
    """Jacobians of a control frame; `linearize` returns it.

    The state is (dq, dv, act) as MuJoCo has them: a displacement of ``qpos`` and ``qvel``, with a column per dof each,
    then the activations. With one world, the arrays have no first axis. With ``states``, the first axis is theirs.
    """

    A: Array
    """Next state by state, ``(worlds, 2 dofs + activations, 2 dofs + activations)``."""
    B: Array
    """Next state by controls, ``(worlds, 2 dofs + activations, controls)``."""
    C: Array | None
    """``sensordata`` by state, ``(worlds, sensordata, 2 dofs + activations)``; None without ``sensors=True``."""
    D: Array | None
    """``sensordata`` by controls, ``(worlds, sensordata, controls)``; None without ``sensors=True``."""


@checked_calls
def linearize(
    sim: Sim,
    worlds: int | Sequence[int] | NDArray[np.integer[Any]] | None = None,
    *,
    controls: str | None = None,
    commands: Mapping[str, ArrayLike] | None = None,
    states: Mapping[str, ArrayLike] | None = None,
    eps: float = 1e-6,
    centered: bool = True,
    sensors: bool = False,
    planner: Sim | None = None,
) -> Linearization:
    """Compute the Jacobians of the next control frame of worlds, as ``mjd_transitionFD`` does.

    No world of ``sim`` moves. The perturbed states are worlds of a planner: a simulation of the same scene in double
    precision. The first call launches one, which later calls of similar size use and which ends with ``sim``.
    Differences amplify what the solver leaves: choose a small ``tolerance`` in `Scene.solver` where contacts or limits
    act.

    Args:
        sim: The simulation; this client must control it.
        worlds: Index of the world, or several; all worlds if left out.
        controls: The command that B is of: ``"ctrl"``, ``"joint_f"``, ``"joint_target_q"`` or ``"joint_target_qd"``. If
            left out, ``"ctrl"`` in scenes with actuators, else ``"joint_f"``.
        commands: Commands of the frame by name, ``(worlds, columns)`` or ``(columns,)``, such as ``{"ctrl": u}``. What
            is left out is what the worlds hold.
        states: States at which to linearize instead, such as those of a trajectory: ``{"joint_q": (n, coords),
            "joint_qd": (n, dofs), "act": (n, activations)}``. What is left out, and the parameters, are those of
            ``worlds``, which must be one. Commands are then ``(n, columns)`` or ``(columns,)``.
        eps: Size of each change, in the unit of its column.
        centered: Whether to take the difference of both sides; else of one side and the unchanged state.
        sensors: Whether to compute C and D as well, for ``sensordata`` at the state before the frame. The controls must
            be ``"ctrl"``.
        planner: A simulation of the same scene, substeps and varying parameters, with ``precision="f64"``. It needs the
            fields ``qpos``, ``qvel``, ``act`` if the scene has activations, the controls, and ``sensordata`` if
            ``sensors``. More worlds take fewer steps. With noise, launch it with ``draws="seed"``.

    Returns:
        The Jacobians, in double precision.

    Raises:
        ArgumentError: An argument is not valid.
        UnknownField: Frames of ``planner`` lack a field.
        SnapshotError: ``planner`` has another scene or other varying parameters.
        CommandRefused: A world is faulted, or a perturbed one faults.
        LeaseHeld: Another client controls ``sim``. Other errors are those of `Sim.step` and `launch`.
    """
    if not isinstance(sim, Sim):
        raise ArgumentError(f"linearize: sim is {type(sim).__name__}; give a tightloop.Sim")
    chosen = _worlds(sim, worlds)
    name = _control(sim, controls)
    there = _states(sim, states, chosen)
    count = len(next(iter(there.values()))) if there else len(chosen)
    given = _commands(sim, commands, count)
    eps = checks.number("linearize: eps", eps, above=0.0, error=ArgumentError)
    centered = checks.flag("linearize: centered", centered, error=ArgumentError)
    sensors = checks.flag("linearize: sensors", sensors, error=ArgumentError)
    if sensors and name != "ctrl":
        raise ArgumentError(f'linearize: sensors is True and controls is {name!r}; give controls="ctrl", or no sensors')
    fields = ["qpos", "qvel", name] + ["act"] * bool(sim.activation_names) + ["sensordata"] * sensors
    size = 2 * len(sim.dof_names) + len(sim.activation_names)
    columns = {known["name"]: known["columns"] for known in sim.info["commands"]}[name]
    displaced = _Displaced(size, columns, eps, centered)
    if planner is not None:
        _check_planner(sim, planner, fields)
    snapshot = sim.snapshot().in_double().of_worlds(chosen)
    if there:
        snapshot = snapshot.of_worlds(np.zeros(count, np.intp))
    labels = [f"state {index}" for index in range(count)] if there else [f"world {world}" for world in chosen]

    def jacobians(planner: Sim) -> Linearization:
        run = _Run(planner, name, given, there, displaced=displaced, sensors=sensors)
        return run.jacobians(snapshot, labels)

    found = jacobians(planner) if planner is not None else _with_planner(sim, fields, count * displaced.rows, jacobians)
    if there or worlds is None or np.ndim(worlds):
        return found
    a, b, c, d = (None if part is None else part[0] for part in found)
    assert a is not None and b is not None
    return Linearization(a, b, c, d)


class _Displaced:
    """The displacements of one state: a row each for the unchanged one, and for each column in either direction.

    Attributes:
        rows: Number of rows.
        state: Displacement of the state, ``(rows, states)``.
        controls: Change of the controls, ``(rows, controls)``.
    """

    def __init__(self, states: int, controls: int, eps: float, centered: bool) -> None:
        self.eps, self.centered, self.states = eps, centered, states
        # rows of each block: unchanged, state forward, state backward, controls forward, controls backward
        ends = np.cumsum([0, 1, states, states * centered, controls, controls])
        self.blocks = [slice(*pair) for pair in itertools.pairwise(ends.tolist())]
        self.rows = int(ends[-1])
        self.state, self.controls = np.zeros((self.rows, states)), np.zeros((self.rows, controls))
        _, *blocks = self.blocks
        for block, part, sign in zip(blocks, (self.state,) * 2 + (self.controls,) * 2, (1, -1) * 2, strict=True):
            if block.stop > block.start:
                part[block] = sign * eps * np.eye(part.shape[1])


class _Run:
    """The steps of a planner for one call of `linearize`."""

    def __init__(
        self,
        planner: Sim,
        name: str,
        given: dict[str, Array],
        states: dict[str, Array],
        *,
        displaced: _Displaced,
        sensors: bool,
    ) -> None:
        self._planner, self._name, self._given, self._states = planner, name, given, states
        self._displaced, self._sensors = displaced, sensors
        self._tangent = _tangent(planner)
        self._dofs = len(planner.dof_names)

    def jacobians(self, snapshot: Any, labels: Sequence[str]) -> Linearization:
        """Return the Jacobians at each world of a snapshot; ``labels`` name them in messages."""
        count, rows, size = len(labels), self._displaced.rows, self._planner.worlds
        parts = []
        for first in range(0, count * rows, size):
            # the last call has worlds to spare, which repeat its last sample
            index = np.minimum(np.arange(first, first + size), count * rows - 1)
            parts.append(self._evaluate(snapshot, index // rows, index % rows, labels))
        next_state, sensordata, held = (
            [np.concatenate(arrays)[: count * rows].reshape(count, rows, -1) for arrays in zip(*group, strict=True)]
            for group in zip(*parts, strict=True)
        )
        forward, backward = self._nudges(held[0][:, 0])
        a, b = self._differences(self._state_difference, next_state, forward, backward)
        c, d = None, None
        if self._sensors:
            c, d = self._differences(lambda start, end: end[0] - start[0], sensordata, forward, backward)
        return Linearization(a, b, c, d)

    def _evaluate(
        self, snapshot: Any, state: NDArray[np.intp], row: NDArray[np.intp], labels: Sequence[str]
    ) -> tuple[list[Array], list[Array], list[Array]]:
        """Return next states, sensors before, and controls, of one displacement per world of the planner."""
        planner, displaced = self._planner, self._displaced
        frame = planner.restore(snapshot.of_worlds(state))
        if self._states:
            frame = self._write({name: values[state] for name, values in self._states.items()})
        self._check_status(frame, state, row, labels)
        by, change = displaced.state[row], displaced.controls[row]
        qpos = self._tangent.moved(frame.qpos, by[:, : self._dofs])
        qvel = frame.qvel + by[:, self._dofs : 2 * self._dofs]
        commands = {name: values[state] for name, values in self._given.items()}
        held = commands.get(self._name, np.array(getattr(frame, self._name)))
        commands[self._name] = held + change
        more = {"act": frame.act + by[:, 2 * self._dofs :]} if planner.activation_names else {}
        if "ctrl" in commands:  # a write of these shows their effect on sensors
            more["ctrl"] = commands.pop("ctrl")
        joints = {"joint_q": self._tangent.positions(qpos), "joint_qd": self._tangent.velocities(qpos, qvel)}
        frame = self._write(joints | more)
        sensordata = [np.array(frame.sensordata)] if self._sensors else []
        frame = planner.step(**commands)
        self._check_status(frame, state, row, labels)
        act = [np.array(frame.act)] if planner.activation_names else []
        return [np.array(frame.qpos), np.array(frame.qvel), *act], sensordata, [held]

    def _write(self, values: dict[str, Array]) -> Any:
        """Write values to all worlds; return a frame there."""
        return called(self._planner, self._planner._client.write, values, None, True)

    def _check_status(self, frame: Any, state: Any, row: Any, labels: Sequence[str]) -> None:
        faulted = np.flatnonzero((frame.status & FAULTED) != 0)
        if not faulted.size:
            return
        label = labels[int(state[faulted[0]])]
        if row[faulted[0]] == 0:
            cure = "reset it first" if label.startswith("world") else "give another state"
            raise CommandRefused(f"linearize: {label} is faulted, or faults in this frame; {cure}")
        raise CommandRefused(f"linearize: a perturbed state of {label} faults; give a smaller eps")

    def _state_difference(self, start: Sequence[Array], end: Sequence[Array]) -> Array:
        coords, others = start[0].shape[-1], [after - before for before, after in zip(start[1:], end[1:], strict=True)]
        moved = self._tangent.difference(start[0].reshape(-1, coords), end[0].reshape(-1, coords))
        return np.concatenate((moved.reshape(*start[0].shape[:-1], -1), *others), axis=-1)

    def _differences(self, difference: Any, samples: list[Array], forward: Any, backward: Any) -> tuple[Array, Array]:
        """Return the derivatives by state and by controls, from samples ``(worlds, rows, …)``."""
        eps, (here, *blocks) = self._displaced.eps, self._displaced.blocks
        same, ahead, behind, more, less = ([part[:, block] for part in samples] for block in (here, *blocks))

        def spread(like: list[Array]) -> list[Array]:
            return [np.broadcast_to(one, other.shape) for one, other in zip(same, like, strict=True)]

        if self._displaced.centered:
            by_state = difference(behind, ahead) / (2.0 * eps)
        else:
            by_state = difference(spread(ahead), ahead) / eps
        both = difference(less, more) / (2.0 * eps)
        up, down = difference(spread(more), more) / eps, difference(less, spread(less)) / eps
        forward, backward = forward[..., None], (backward & (self._displaced.centered | ~forward))[..., None]
        by_controls = np.where(forward & backward, both, np.where(forward, up, np.where(backward, down, 0.0)))
        return by_state.swapaxes(1, 2), by_controls.swapaxes(1, 2)

    def _nudges(self, held: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which controls stay in their ranges when they go up, and when they go down, ``(worlds, controls)``."""
        if self._name != "ctrl":
            return np.ones(held.shape, bool), np.ones(held.shape, bool)
        low, high = _ctrl_ranges(self._planner)
        within = (held >= low) & (held <= high)
        eps = self._displaced.eps
        return within & (held + eps <= high), within & (held - eps >= low)


def _worlds(sim: Sim, worlds: Any) -> NDArray[np.intp]:
    cure = f"give an index from 0 to {sim.worlds - 1}, or a list of such"
    if worlds is None:
        return np.arange(sim.worlds)
    try:
        given = np.atleast_1d(np.asarray(worlds))
    except ValueError:
        given = np.zeros((1, 1))
    if given.ndim != 1 or given.dtype.kind not in "iu" or not given.size:
        raise ArgumentError(f"linearize: worlds is {worlds!r:.80}; {cure}")
    if given.min() < 0 or given.max() >= sim.worlds:
        raise ArgumentError(f"linearize: worlds has {given.min()} to {given.max()}; {cure}")
    return given.astype(np.intp)


def _control(sim: Sim, controls: Any) -> str:
    if controls is None:
        return "ctrl" if sim.actuator_names else "joint_f"
    if controls not in _CONTROLS:
        raise ArgumentError(f"linearize: controls is {controls!r:.80}; {suggestion(str(controls), _CONTROLS)}")
    if controls == "ctrl" and not sim.actuator_names:
        raise ArgumentError("linearize: controls is 'ctrl', and the scene has no actuators; give 'joint_f'")
    return controls


def _states(sim: Sim, states: Any, chosen: NDArray[np.intp]) -> dict[str, Array]:
    """Return the states to linearize at by name, each ``(n, columns)``; none if left out."""
    if states is None:
        return {}
    sizes = zip(_STATES, (len(sim.coord_names), len(sim.dof_names), len(sim.activation_names)), strict=True)
    known = {name: size for name, size in sizes if size}
    if not isinstance(states, Mapping) or not states:
        raise ArgumentError(f"linearize: states is {states!r:.80}; give a dict by name, of {', '.join(known)}")
    given = {}
    for name, value in states.items():
        if name not in known:
            raise ArgumentError(f"linearize: states has {name!r:.80}; {suggestion(str(name), known)}")
        array = reals(f"linearize: states: {name}", value)
        if array.ndim != 2 or array.shape[1] != known[name] or not len(array):
            raise ArgumentError(f"linearize: states: {name} has shape {array.shape}; give (n, {known[name]})")
        wrong = np.flatnonzero(~np.isfinite(array).all(axis=1))
        if wrong.size:
            raise ArgumentError(f"linearize: states: {name} of state {wrong[0]} is not finite; give finite numbers")
        given[name] = array.astype(np.float64)
    if len({len(array) for array in given.values()}) != 1:
        found = ", ".join(f"{name} {len(array)}" for name, array in given.items())
        raise ArgumentError(f"linearize: states have different numbers: {found}; give all the same number")
    if len(chosen) != 1:
        raise ArgumentError(f"linearize: states belong to one world, and worlds has {len(chosen)}; give its index")
    return given


def _commands(sim: Sim, commands: Any, count: int) -> dict[str, Array]:
    if commands is None:
        return {}
    known = {known["name"]: known["columns"] for known in sim.info["commands"] if known["name"] in _CONTROLS}
    if not isinstance(commands, Mapping):
        raise ArgumentError(f"linearize: commands is {commands!r:.80}; give a dict by name, of {', '.join(known)}")
    given = {}
    for name, value in commands.items():
        if name not in known:
            raise ArgumentError(f"linearize: commands has {name!r:.80}; {suggestion(str(name), known)}")
        array, shapes = reals(f"linearize: commands: {name}", value), ((count, known[name]), (known[name],))
        if array.shape not in shapes:
            raise ArgumentError(f"linearize: commands: {name} has shape {array.shape}; give {shapes[0]} or {shapes[1]}")
        given[name] = np.array(np.broadcast_to(array, shapes[0]), np.float64)
    return given


def _with_planner(sim: Sim, fields: Sequence[str], samples: int, run: Callable[[Sim], Linearization]) -> Linearization:
    """Return what a run with a planner of the simulation gives; launch another one if that one was killed."""
    planner = _planner(sim, fields, samples)
    try:
        return run(planner)
    except DaemonLost:
        sim._companions.remove(planner)
        planner.close()
        return run(_planner(sim, fields, samples))


def _planner(sim: Sim, fields: Sequence[str], samples: int) -> Sim:
    """Return a planner that belongs to a simulation; launch one if none has these fields and about as many worlds."""
    size = min(samples, _WORLDS)
    for kept in [one for one in sim._companions if isinstance(one, Sim)]:
        if not ({*fields} <= {*kept.fields} and kept._end.alive):
            sim._companions.remove(kept)
            kept.close()
    planners = [one for one in sim._companions if isinstance(one, Sim)]
    for kept in planners:
        # then neither steps nor worlds are more than twice those of a planner of this size
        if size <= 2 * kept.worlds and kept.worlds <= 2 * size:
            # the last is the one used last
            sim._companions.remove(kept)
            sim._companions.append(kept)
            return kept
    for oldest in planners[: max(0, len(planners) + 1 - _PLANNERS)]:
        sim._companions.remove(oldest)
        oldest.close()
    scene = Scene.from_toml(sim.info["scene"], sim.info["scene_folder"])
    planner = launch(
        scene,
        worlds=size,
        device="cpu",
        precision="f64",
        fields=fields,
        params=varying(sim.info),
        # noise is then the same in all perturbed worlds
        draws="seed",
        watch_worlds=1,
    )
    try:
        check_alike("linearize", sim.info, planner.info)
    except BaseException:
        planner.close()
        raise
    sim._companions.append(planner)
    return planner


def _check_planner(sim: Sim, planner: Any, fields: Sequence[str]) -> None:
    if not isinstance(planner, Sim):
        raise ArgumentError(f"linearize: planner is {type(planner).__name__}; give a tightloop.Sim, or leave it out")
    if planner is sim:
        raise ArgumentError("linearize: planner is the simulation itself, whose worlds would move; give another one")
    check_alike("linearize", sim.info, planner.info)
    if planner.precision != "f64":
        raise ArgumentError(f'linearize: planner has precision {planner.precision}; launch it with precision="f64"')
    missing = [field for field in fields if field not in planner.fields]
    if missing:
        raise UnknownField(f"linearize: frames of planner lack {', '.join(missing)}; add them to `fields` at launch")


def _tangent(planner: Sim) -> Tangent:
    """Return the tangent space of a planner's scene."""
    if planner in _tangents:
        return _tangents[planner]
    tangent = Tangent(planner.coord_names, planner.dof_names)
    spins = []
    for axis in range(2 if tangent.free else 0):
        # with an angular velocity about an axis and the centre of mass at rest, the origin moves by -axis × r
        joint_qd = np.zeros((planner.worlds, len(planner.dof_names)))
        for _, d in tangent.free:
            joint_qd[:, d + 3 + axis] = 1.0
        frame = planner._client.write({"joint_qd": joint_qd}, None, True)
        spins.append([np.array(frame.qvel[0, d : d + 3]) for _, d in tangent.free])
        turns = [rotations(np.array(frame.qpos[0, q + 3 : q + 7])) for q, _ in tangent.free]
        if axis == 1:
            for number, (about_x, about_y) in enumerate(zip(*spins, strict=True)):
                center = np.array([about_y[2], -about_x[2], about_x[1]])
                tangent.centers[number] = turns[number].T @ center
    _tangents[planner] = tangent
    return tangent


def _ctrl_ranges(sim: Sim) -> tuple[Array, Array]:
    """Return the lowest and highest control of each actuator, infinite where it has no range."""
    load = optional_import("safetensors.numpy", "linearize reads ranges of controls; pip install safetensors").load_file
    ranges = []
    for model in Scene.from_toml(sim.info["scene"], sim.info["scene_folder"]).models.values():
        kept = load(model.file)
        limited = kept["actuator_ctrllimited"].astype(bool).reshape(-1, 1)
        ranges.append(np.where(limited, kept["actuator_ctrlrange"].reshape(-1, 2), (-np.inf, np.inf)))
    low, high = np.concatenate(ranges).T
    return low, high
