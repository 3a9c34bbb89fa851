"""Datasets of episodes from recordings: HDF5 in robomimic's layout, LeRobot, MCAP and Rerun.

The libraries of the formats come with the extra ``data``; docs/pages/use/datasets.md describes the formats.

>>> from tightloop.datasets import export
>>> export("run.tlrec", "demos.hdf5", to="hdf5", action="joint_target_q")
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tightloop.datasets.exporting import Export, export
    from tightloop.datasets.reading import Episode, episodes

_HOMES = {"Episode": "reading", "Export": "exporting", "episodes": "reading", "export": "exporting"}

__all__ = ["Episode", "Export", "episodes", "export"]


def __getattr__(name: str) -> Any:
    # lazy (PEP 562): the parser of the command line needs no array
    home = _HOMES.get(name)
    if home is None:
        if name.startswith("_"):
            raise AttributeError(f"module `tightloop.datasets` has no attribute `{name}`")
        from tightloop.checks.attributes import suggestion
        from tightloop.errors import UnknownAttribute

        raise UnknownAttribute(f"module `tightloop.datasets` has no attribute `{name}`; {suggestion(name, __all__)}")
    from importlib import import_module

    return getattr(import_module(f"tightloop.datasets.{home}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
