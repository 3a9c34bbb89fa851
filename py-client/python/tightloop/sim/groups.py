"""Groups of a daemon's worlds, which step independently."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

from tightloop.checks.signatures import checked_calls
from tightloop.sim.sim import Sim


@checked_calls
class Groups(Sequence[Sim]):
    """The groups of a daemon's worlds: a sequence of `Sim`, each of which steps independently of the others.

    >>> groups = tl.launch(scene, worlds=4096, groups=2)
    >>> for sim in groups:
    ...     sim.send(joint_target_q=policy(sim.reset()))
    >>> while training:
    ...     for sim in groups:
    ...         frame = sim.recv()
    ...         sim.send(joint_target_q=policy(frame))     # the other group steps meanwhile

    World ``w`` of group ``g`` is world ``g * groups[g].worlds + w`` of the daemon, and its draws use that index. Masks,
    seeds, snapshots and error messages count the worlds of the group.

    Attributes:
        name: Name of the daemon.
        pid: Process id of the daemon.
        worlds: Number of worlds of all groups.
    """

    def __init__(self, name: str, sims: Sequence[Sim]) -> None:
        self.name = name
        self._sims = tuple(sims)
        self.pid: int = self._sims[0].pid
        self.worlds: int = sum(sim.worlds for sim in self._sims)

    def __len__(self) -> int:
        return len(self._sims)

    @overload
    def __getitem__(self, index: int) -> Sim: ...

    @overload
    def __getitem__(self, index: slice) -> tuple[Sim, ...]: ...

    def __getitem__(self, index: int | slice) -> Sim | tuple[Sim, ...]:
        return self._sims[index]

    def close(self) -> None:
        """End all simulations: stop a launched daemon, or release an attached one. Frames stay valid."""
        for sim in self._sims:
            sim.close()

    def __enter__(self) -> Groups:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Groups({self.name!r}, groups={len(self)}, worlds={self.worlds}, pid={self.pid})"
