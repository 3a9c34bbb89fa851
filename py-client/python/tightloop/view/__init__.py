"""Shows worlds in a browser, as pictures or as films, from a running daemon or a recording.

Its libraries come with the extra ``view``; docs/pages/start/install.md says how to install it.

>>> from tightloop.view import Film
>>> with Film("run.mp4", sim) as film:
...     for _ in range(600):
...         film.add(sim.step(joint_target_q=targets))
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tightloop.view.cameras import Camera
    from tightloop.view.films import Film, film
    from tightloop.view.picture import Picture

_HOMES = {"Camera": "cameras", "Film": "films", "Picture": "picture", "film": "films"}

__all__ = ["Camera", "Film", "Picture", "film"]


def __getattr__(name: str) -> Any:
    # Lazy (PEP 562): a simulation without a viewer needs none of the libraries
    home = _HOMES.get(name)
    if home is None:
        if name.startswith("_"):
            raise AttributeError(f"module `tightloop.view` has no attribute `{name}`")
        from tightloop.checks.attributes import suggestion
        from tightloop.errors import UnknownAttribute

        raise UnknownAttribute(f"module `tightloop.view` has no attribute `{name}`; {suggestion(name, __all__)}")
    from importlib import import_module

    return getattr(import_module(f"tightloop.view.{home}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
