"""Fields of frames, commands and parameters, as a running daemon describes them."""

from __future__ import annotations

import inspect
from typing import Any

import tightloop as tl
from generate.tables import table
from tightloop.sim.command_rows import COMMANDS, CommandRow
from tightloop.tasks import cartpole


def description() -> dict[str, Any]:
    """What a daemon reports about itself, for a cart and its pole with a shape, a site and a contact sensor."""
    scene = tl.Scene(dt=1 / 120, substeps=2)
    scene.add_urdf(cartpole.URDF, name="cartpole")
    scene.add_ground()
    scene.add_site(name="tip", body="cartpole/pole")
    scene.add_contact_sensor(name="touch", of="ground")
    with tl.launch(scene, worlds=1, device="cpu") as sim:
        return sim.info


def _shape(row: CommandRow) -> str:
    parts = f", {row.parts}" if row.parts > 1 else ""
    return f"`(worlds, {row.axis}{parts})`"


def parts() -> dict[str, str]:
    """Parts of the page `reference/fields.md`."""
    info = description()
    always = {"time", "step", "status", "contacts_left_out"}

    def rows(entries: list[dict[str, Any]], real: str) -> list[list[str]]:
        return [
            [
                f"`{entry['name']}`" + ("" if entry["name"] not in always else " (always)"),
                f"`{entry['axes']}`",
                "real" if entry["dtype"] == real else entry["dtype"],
                entry["unit"],
                entry["doc"],
            ]
            for entry in entries
        ]

    real = next(field["dtype"] for field in info["known_fields"] if field["name"] == "joint_q")
    written = inspect.signature(tl.Sim.write).parameters
    writes = [entry for entry in info["known_fields"] if entry["name"] in written]
    params = [[f"`{param['info']['name']}`", param["info"]["unit"], param["info"]["doc"]] for param in info["params"]]
    named, shaped = ["name", "unit", "meaning"], ["name", "shape", "unit", "meaning"]
    return {
        "fields": table(["field", "shape", "type", "unit", "meaning"], rows(info["known_fields"], real)),
        "commands": table(shaped, [[f"`{row.name}`", _shape(row), row.unit, row.doc] for row in COMMANDS.values()]),
        "writes": table(shaped, [[f"`{e['name']}`", f"`{e['axes']}`", e["unit"], e["doc"]] for e in writes]),
        "parameters": table(named, params),
    }
