"""How objects show themselves in a notebook: tables as HTML, and pictures of worlds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from PIL.Image import Image

_ROWS = 40  # of a table; further ones are counted
_STYLE = "text-align:left;padding:1px 12px 1px 0"


def table(title: str, head: Sequence[str], rows: Iterable[Sequence[Any]], below: str = "") -> str:
    """Return a table as HTML; ``below`` is HTML that follows."""
    listed = [*rows]
    lines = [_row("th", head)] if head else []
    lines += [_row("td", row) for row in listed[:_ROWS]]
    if len(listed) > _ROWS:
        lines.append(_row("td", [f"and {len(listed) - _ROWS} more"]))
    return f"<div><b>{escape(title)}</b><table>{''.join(lines)}</table>{below}</div>"


def _row(tag: str, cells: Sequence[Any]) -> str:
    return "<tr>" + "".join(f'<{tag} style="{_STYLE}">{escape(str(cell))}</{tag}>' for cell in cells) + "</tr>"


def picture_html(kind: str, shown: Any) -> str:
    """Return a picture of a scene or robot at its start as HTML; empty without the libraries for it.

    Args:
        kind: Name of the function of ``tightloop.view.stills``, ``"of_scene"`` or ``"of_robot"``.
        shown: The scene or robot.
    """
    from tightloop.errors import TightloopError

    try:
        return cast("str", getattr(_view("stills"), kind)(shown))
    except (TightloopError, OSError):  # a table without its picture still helps
        return ""


def _view(module: str) -> Any:
    # by a name in a string: the viewer is built on this package's core, and its libraries are optional
    return import_module(f"tightloop.view.{module}")


def frame_html(frame: Any) -> str:
    """Return the fields of a frame as HTML: shapes, types and the range of the numbers."""
    rows = []
    for name in frame.fields:
        array = getattr(frame, name)
        spread = f"{array.min():.4g} … {array.max():.4g}" if array.size else "–"
        rows.append((name, array.shape, array.dtype, spread))
    return table("Frame", ("field", "shape", "type", "least … largest"), rows)


def simulation_picture(sim: Any, **given: Any) -> Image:
    """Return a picture of worlds of a simulation; the arguments are those of `Sim.picture`."""
    # the meshes stay loaded until the simulation is closed
    return cast("Image", _view("stills").of_simulation(sim, **given))


def simulation_html(name: str, worlds: int, info: Mapping[str, Any]) -> str:
    """Return the properties of a simulation as HTML."""
    rows = [
        ("worlds", worlds),
        ("device", info["device"]),
        ("precision", info["precision"]),
        ("step", f"{info['substeps']} × {info['dt']:.6g} s"),
        ("robots", ", ".join(robot["name"] for robot in info["robots"]) or "none"),
        ("dofs", len(info["dof_names"])),
        ("fields", ", ".join(field["name"] for field in info["fields"])),
        ("process", info["pid"]),
    ]
    return table(f"Sim {name}", (), rows)
