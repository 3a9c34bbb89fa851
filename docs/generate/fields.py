"""Fields of frames, commands and parameters, as a running daemon describes them."""

from __future__ import annotations

from typing import Any

import tightloop as tl
from generate.tables import table
from tightloop.tasks import cartpole

INTRODUCTION = """# Fields and parameters

This page is what a daemon says of itself (`sim.info`): what frames can carry, what can be sent, and which numbers of
the model can differ from world to world. Arrays have the worlds first. *Real* numbers are float32 or float64, as the
run's `precision` says.

## Fields

`launch(fields=(…))` and `tightloop serve --fields …` choose them; all belong to the state in their frame. `time`,
`step`, `status` and `contacts_left_out` come with every frame. Frames of `sim.latest` have a snapshot of the worlds
that observers see besides, as bytes: `state`.
"""
COMMANDS = """
## Commands

Arguments of `sim.step` and `sim.send`. What is left out keeps its last value; a reset goes back to the scene's.
"""
WRITES = """
## What can be written

Arguments of `sim.write`, for all worlds or those of a mask.
"""
PARAMS = """
## Parameters

`launch(params=(…))`, the scene's `params`, or a range in the scene's `randomize` let one vary from world to world;
`sim.params.NAME` then reads and writes it. The others are constants of the program, and writing one is refused by
name.
"""


def description() -> dict[str, Any]:
    """What a daemon tells about itself: of a cart and its pole, with a shape, a site and a contact sensor."""
    scene = tl.Scene(dt=1 / 120, substeps=2)
    scene.add_urdf(cartpole.URDF, name="cartpole")
    scene.add_ground()
    scene.add_site(name="tip", body="cartpole/pole")
    scene.add_contact_sensor(name="touch", of="ground")
    with tl.launch(scene, worlds=1, device="cpu") as sim:
        return sim.info


def page() -> str:
    """The page."""
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
    return (
        INTRODUCTION
        + "\n"
        + table(["field", "shape", "type", "unit", "what it is"], rows(info["known_fields"], real))
        + COMMANDS
        + "\n"
        + table(["command", "unit", "what it is"], inputs["commands"])
        + WRITES
        + "\n"
        + table(["name", "unit", "what it is"], inputs["writes"])
        + PARAMS
        + "\n"
        + table(["parameter", "unit", "what it is"], params)
    )
