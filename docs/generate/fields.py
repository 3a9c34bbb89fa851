"""Fields of frames, commands and parameters, as a running daemon describes them."""

from __future__ import annotations

from typing import Any

import tightloop as tl
from generate.tables import table
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


def parts() -> dict[str, str]:
    """Parts of the page `fields.md`."""
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
    inputs = {
        what: [[f"`{entry['name']}`", entry["unit"], entry["doc"]] for entry in info[what]]
        for what in ("commands", "writes")
    }
    params = [[f"`{param['info']['name']}`", param["info"]["unit"], param["info"]["doc"]] for param in info["params"]]
    named = ["name", "unit", "meaning"]
    return {
        "fields": table(["field", "shape", "type", "unit", "meaning"], rows(info["known_fields"], real)),
        "commands": table(named, inputs["commands"]),
        "writes": table(named, inputs["writes"]),
        "parameters": table(named, params),
    }
