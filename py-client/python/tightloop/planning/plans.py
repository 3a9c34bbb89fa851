"""Planning in a simulation: worlds that begin from the state of another one, and rollouts of command sequences."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike, NDArray

from tightloop._core import Frame
from tightloop.arrays.frames import FrameCopy
from tightloop.arrays.inputs import as_mask
from tightloop.checks import arguments as checks
from tightloop.checks.signatures import checked_calls
from tightloop.errors import ArgumentError, LeaseHeld, SnapshotError
from tightloop.planning import rollouts
from tightloop.planning.rollouts import Rollout
from tightloop.sim.snapshot import Snapshot


@checked_calls
class Plans:
    """Part of `tightloop.Sim`: what a simulation that plans for another one does."""

    info: dict[str, Any]
    name: str
    precision: str
    worlds: int

    def snapshot(self) -> Snapshot:
        """Take a snapshot of all worlds."""
        raise NotImplementedError

    def restore(self, snapshot: Snapshot, *, worlds: ArrayLike | None = None, from_world: int | None = None) -> Frame:
        """Restore worlds from a snapshot."""
        raise NotImplementedError

    def copy_from(
        self, source: Plans | Snapshot | Frame | FrameCopy, world: int = 0, *, mask: ArrayLike | None = None
    ) -> Frame:
        """Copy one world of another simulation into worlds of this one, such as the robot's into those of a planner.

        The simulations may belong to different daemons, and to different processes by `attach`. Both must have the same
        scene, precision and varying parameters. The copy has the state, commands, parameters, seed, episode, ``step``
        and ``status``. Draws of noise differ between the worlds, since they depend on the world's index.

        Args:
            source: The other simulation. This client must control it, since the copy takes a snapshot. To copy from a
                simulation that another client controls, give the observer's frame of its `Sim.latest`. A `Snapshot`
                is valid too.
            world: Index of the world in ``source``.
            mask: Worlds of this simulation that get the copy, bool, shape ``(worlds,)``; all if left out.

        Returns:
            A frame at the copied state.

        Raises:
            ArgumentError: ``source`` is none of these, or has no such world.
            SnapshotError: The simulations differ in scene, precision or varying parameters; no world changed.
            LeaseHeld: Another client controls one of the simulations.
            CommandRefused: ``mask`` has a wrong shape or dtype, or a step is in flight. Other errors are those of
                `step`.
        """
        if isinstance(source, Plans):
            check_alike("copy_from", source.info, self.info)
            if source.precision != self.precision:
                of_each = f"`{source.name}` is {source.precision}, `{self.name}` {self.precision}"
                raise SnapshotError(f"copy_from: {of_each}; launch both with the same precision")
        world = checks.integer("copy_from: world", world, least=0, error=ArgumentError)
        worlds = None if mask is None else as_mask("copy_from: mask", mask, self.worlds)
        taken = _snapshot_of(source)
        if world >= taken.worlds:
            raise ArgumentError(f"copy_from: world is {world}; the source has worlds 0 to {taken.worlds - 1}")
        return self.restore(taken if taken.worlds == 1 else taken.of_worlds([world]), worlds=worlds, from_world=0)

    def rollout(
        self,
        commands: Mapping[str, Any],
        fields: Sequence[str] | None = None,
        *,
        start: Plans | Snapshot | Frame | FrameCopy | tuple[Any, int] | None = None,
        cost: Callable[[Frame], NDArray[Any]] | None = None,
        out: Rollout | None = None,
    ) -> Rollout:
        """Step through a sequence of commands per world, and collect fields or a cost.

        Each world runs its own sequence. Fields of a frame are copied, and its cost is computed, while the worlds
        already do the next step. The worlds stay at the end of the rollout. Commands that are left out keep their last
        value.

        Args:
            commands: Sequence of each command of `step`, by its name: an array ``(frames, worlds, columns)``, or
                ``(frames, columns)`` for identical commands, or a dict of such by robot, joint or pattern.
            fields: Fields to collect; those of the launch if left out, or none if there is a ``cost``.
            start: What all worlds start from: a simulation or an observer's frame, whose world 0 counts, ``(source,
                world)`` for another world, or a `Snapshot`. A snapshot with one world counts for all worlds here. If
                left out, the worlds continue.
            cost: Function of a frame that returns the cost of each world, ``(worlds,)``. Its sum over the frames is
                `Rollout.cost`. The function must not call this simulation, and must not keep the frame.
            out: A rollout with the same worlds, frames and fields, whose arrays are written again. A loop that gives
                the last result allocates no array.

        Returns:
            The arrays, and the faults of each world.

        Raises:
            ArgumentError: An argument is not valid, or ``out`` does not fit.
            UnknownField: Frames of this run do not carry the field.
            CommandRefused: A command is not valid; the message names the frame. The worlds stay at the frame before.
            SnapshotError: ``start`` does not fit; no world changed. Other errors are those of `copy_from` and `step`.
        """
        run = rollouts.Run(self, commands, fields, cost, out)
        if start is not None:
            self._begin(start)
        return run.go()

    def _begin(self, start: Any) -> None:
        if isinstance(start, tuple):
            if len(start) != 2:
                raise ArgumentError(f"rollout: start has {len(start)} entries; give (source, world)")
            source, world = start
        else:
            source, world = start, 0
        if not isinstance(source, Plans | Snapshot | Frame | FrameCopy):
            cure = "give a Sim, a frame of `Sim.latest`, a Snapshot, or one of them with its world"
            raise ArgumentError(f"rollout: start is {source!r:.80}; {cure}")
        if isinstance(start, Snapshot) and start.worlds == self.worlds:
            self.restore(start)
        else:
            self.copy_from(source, world)


def check_alike(call: str, source: Mapping[str, Any], target: Mapping[str, Any]) -> None:
    """Refuse simulations whose worlds do not fit each other, whatever their precisions.

    Args:
        call: Name of the call, for messages.
        source: `Sim.info` of the one whose worlds are copied.
        target: `Sim.info` of the other.

    Raises:
        SnapshotError: They differ in scene or varying parameters.
    """
    names = f"{call}: `{source['name']}` and `{target['name']}`"
    differing = sorted({*varying(source)} ^ {*varying(target)})
    if differing:
        cure = f"launch both with the same params, such as {tuple(differing)}"
        raise SnapshotError(f"{names}: {', '.join(differing)} varies in one of them only; {cure}")
    if source["model_hash"] != target["model_hash"]:
        raise SnapshotError(f"{names} have other models; launch both with the same scene, dt and substeps")


def varying(info: Mapping[str, Any]) -> list[str]:
    """Return the names of the parameters that vary in a simulation, from its `Sim.info`."""
    return [param["info"]["name"] for param in info["params"] if param["place"] is not None]


def _snapshot_of(source: Any) -> Snapshot:
    if isinstance(source, Snapshot):
        return source
    if isinstance(source, Frame | FrameCopy):
        if "state" not in source.fields:
            raise ArgumentError("copy_from: source is a frame without `state`; give one of `Sim.latest`, or the Sim")
        return Snapshot.from_bytes(source.state.tobytes())
    if not isinstance(source, Plans):
        cure = "give a Sim, a frame of `Sim.latest`, or a Snapshot"
        raise ArgumentError(f"copy_from: source is {type(source).__name__}; {cure}")
    try:
        return source.snapshot()
    except LeaseHeld as held:
        cure = "give the frame of its `latest()`, which needs no control"
        raise LeaseHeld(f"copy_from: `{source.name}`: {held}; or {cure}") from None
