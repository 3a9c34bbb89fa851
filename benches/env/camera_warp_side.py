"""The side of MuJoCo-Warp in benches/env/cameras.py: a process with an environment of its own, on Warp's CPU device.

Arguments: scene, folder of references, worlds, rounds. Prints a line of JSON: images per second by what they have, a
list of rounds each.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from pathlib import Path

import mujoco
import mujoco_warp as mjw  # pyright: ignore[reportMissingImports]
import warp as wp  # pyright: ignore[reportMissingImports]
from camera_scenes import SCENES, SIZE


def main(scene: str, reference: str, worlds: int, rounds: int) -> None:
    """Draw."""
    wp.config.quiet = True
    wp.set_device("cpu")
    model = SCENES[scene](Path(reference))
    start = mujoco.MjData(model)
    mujoco.mj_forward(model, start)
    rates = {}
    kinds = {"depth": {"render_depth": True}, "rgb": {"render_rgb": True, "use_shadows": True, "use_textures": False}}
    for kind, options in kinds.items():
        m = mjw.put_model(model)
        d = mjw.put_data(model, start, nworld=worlds)
        context = mjw.create_render_context(model, nworld=worlds, cam_res=(SIZE, SIZE), **options)
        mjw.render(m, d, context)  # compiles
        rates[kind] = []
        for _ in range(rounds):
            begin = time.perf_counter()
            mjw.refit_bvh(m, d, context)
            mjw.render(m, d, context)
            wp.synchronize()
            rates[kind].append(worlds / (time.perf_counter() - begin))
    print(json.dumps({"version": version("mujoco-warp"), "rates": rates}))


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]))
