"""Planning in a simulation: worlds that begin from the state of another one, and rollouts of command sequences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from numpy.typing import ArrayLike

from tightloop._core import Frame
from tightloop.arrays.frames import FrameCopy
from tightloop.arrays.inputs import as_mask
from tightloop.checks import arguments as checks
from tightloop.errors import ArgumentError, LeaseHeld, SnapshotError
from tightloop.sim.snapshot import Snapshot


@runtime_checkable
class Simulation(Protocol):
    """What planning needs of a simulation; `tightloop.Sim` has it."""

    info: dict[str, Any]
    name: str
    precision: str
    worlds: int

    def snapshot(self) -> Snapshot:
        """Take a snapshot of all worlds."""
        ...

    def restore(self, snapshot: Snapshot, *, worlds: ArrayLike | None = None, from_world: int | None = None) -> Frame:
        """Restore worlds from a snapshot."""
        ...


def copy_world(
    sim: Simulation, source: Simulation | Snapshot | Frame | FrameCopy, world: int, mask: ArrayLike | None
) -> Frame:
    """Copy one world of a source into worlds of a simulation; see `Sim.copy_from`."""
    if isinstance(source, Simulation):
        check_alike("copy_from", source.info, sim.info)
        if source.precision != sim.precision:
            of_each = f"`{source.name}` is {source.precision}, `{sim.name}` {sim.precision}"
            raise SnapshotError(f"copy_from: {of_each}; launch both with the same precision")
    world = checks.integer("copy_from: world", world, least=0, error=ArgumentError)
    worlds = None if mask is None else as_mask("copy_from: mask", mask, sim.worlds)
    taken = _snapshot_of(source)
    if world >= taken.worlds:
        raise ArgumentError(f"copy_from: world is {world}; the source has worlds 0 to {taken.worlds - 1}")
    return sim.restore(taken if taken.worlds == 1 else taken.of_worlds([world]), worlds=worlds, from_world=0)


def begin_rollout(sim: Simulation, start: Any) -> None:
    """Bring the worlds of a simulation to where a rollout starts; see `Sim.rollout`."""
    if isinstance(start, tuple):
        if len(start) != 2:
            raise ArgumentError(f"rollout: start has {len(start)} entries; give (source, world)")
        source, world = start
    else:
        source, world = start, 0
    if not isinstance(source, Simulation | Snapshot | Frame | FrameCopy):
        cure = "give a Sim, a frame of `Sim.latest`, a Snapshot, or one of them with its world"
        raise ArgumentError(f"rollout: start is {source!r:.80}; {cure}")
    if isinstance(start, Snapshot) and start.worlds == sim.worlds:
        sim.restore(start)
    else:
        copy_world(sim, source, world, None)


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
    if not isinstance(source, Simulation):
        cure = "give a Sim, a frame of `Sim.latest`, or a Snapshot"
        raise ArgumentError(f"copy_from: source is {type(source).__name__}; {cure}")
    try:
        return source.snapshot()
    except LeaseHeld as held:
        cure = "give the frame of its `latest()`, which needs no control"
        raise LeaseHeld(f"copy_from: `{source.name}`: {held}; or {cure}") from None
