"""Images per second of a camera, 64 × 64, beside MuJoCo's renderer and MuJoCo-Warp's, on one core.

    python -m benches cameras
    python -m benches cameras --warp .venv-mjlab/bin/python   # beside MuJoCo-Warp on its CPU device

The Panda over its table and the G1 of mjlab on rough ground, as MuJoCo models with their meshes. tightloop draws 1024
worlds in its daemon; its rate is that of the frames with images, less the frames without. MuJoCo's renderer draws one
world after the other with OpenGL on the CPU (Mesa). Colours have the shadows of one light. Sides take turns.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import time
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "0")  # Mesa draws on the caller's thread

import mujoco
from camera_scenes import SCENES, SIZE

import tightloop as tl

sys.path.insert(0, str(Path(__file__).parents[1]))
from record import REPOSITORY, print_table, write_results

WORLDS, WARP_WORLDS, MUJOCO_IMAGES = 1024, 32, 20
MOVED = 1e-5  # of a joint from image to image [rad or m]
#: Images per second that are asked for.
ASKED = {("panda", "depth"): 3000, ("g1", "depth"): 2000}


def ours(scene: str, reference: Path, rounds: int) -> dict[str, list[float]]:
    """Images per second by what they have."""
    world = tl.Scene.from_mujoco(SCENES[scene](reference), name="robot")
    camera = world.add_camera(mujoco="robot/eye", width=SIZE, height=SIZE, name="eye")
    sides: dict[str, tuple[str, ...]] = {
        "none": (),
        "depth": (camera.depth,),
        "depth and labels": (camera.depth, camera.segmentation),
        "rgb": (camera.rgb,),
    }
    times: dict[str, list[float]] = {side: [] for side in sides}
    for side, fields in sides.items():
        with tl.launch(world, worlds=WORLDS, threads=1, device="cpu", fields=("joint_q", "body_q", *fields)) as sim:
            moved = sim.reset().joint_q.copy()
            for _ in range(rounds + 1):
                # images of worlds that are as in the frame before would be kept
                moved[:, -1] += MOVED
                begin = time.perf_counter()
                frame = sim.write(joint_q=moved)
                times[side].append(time.perf_counter() - begin)
                del frame
    without = statistics.median(times.pop("none")[1:])
    return {side: [WORLDS / max(spent - without, 1e-9) for spent in spent[1:]] for side, spent in times.items()}


def mujocos(scene: str, reference: Path, rounds: int) -> dict[str, list[float]]:
    """Images per second by what they have."""
    model = SCENES[scene](reference)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    rates: dict[str, list[float]] = {}
    with mujoco.Renderer(model, SIZE, SIZE) as renderer:
        for kind in ("depth", "rgb"):
            (renderer.enable_depth_rendering if kind == "depth" else renderer.disable_depth_rendering)()
            rates[kind] = []
            for _ in range(rounds + 1):
                begin = time.perf_counter()
                for _ in range(MUJOCO_IMAGES):
                    renderer.update_scene(data, "eye")
                    renderer.render()
                rates[kind].append(MUJOCO_IMAGES / (time.perf_counter() - begin))
            rates[kind] = rates[kind][1:]
    return rates


def warps(python: str, scene: str, reference: Path, rounds: int) -> tuple[str, dict[str, list[float]]]:
    """The version, and images per second by what they have."""
    side = Path(__file__).with_name("camera_warp_side.py")
    command = [python, str(side), scene, str(reference), str(WARP_WORLDS), str(rounds)]
    output = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout
    answer = json.loads(output.splitlines()[-1])
    return answer["version"], answer["rates"]


def main() -> int:
    """Measure, write the results, and return 1 if a rate is below what is asked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--rounds", type=int, default=5, help="rounds of each side")
    parser.add_argument(
        "--reference", type=Path, default=REPOSITORY.parent / "shared/reference", help="menagerie_panda's folder"
    )
    parser.add_argument("--warp", help="a Python that has mujoco-warp; left out, that side is")
    arguments = parser.parse_args()
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    rows: list[dict[str, str | int]] = []
    slow = False
    for scene in SCENES:
        sides: dict[str, dict[str, list[float]]] = {
            "tightloop": ours(scene, arguments.reference, arguments.rounds),
            f"MuJoCo {mujoco.__version__} renderer": mujocos(scene, arguments.reference, arguments.rounds),
        }
        if arguments.warp:
            version, rates = warps(arguments.warp, scene, arguments.reference, arguments.rounds)
            sides[f"MuJoCo-Warp {version}, CPU"] = rates
        for side, rates in sides.items():
            for kind, measured in rates.items():
                rate = round(statistics.median(measured))
                asked = ASKED.get((scene, kind)) if side == "tightloop" else None
                slow |= asked is not None and rate < asked
                row = {"scene": scene, "image": kind, "side": side, "images_per_second": rate}
                ends = {"least": round(min(measured)), "most": round(max(measured))}
                rows.append(row | ends | {"asked": "–" if asked is None else asked})
    print_table(rows)
    facts = {"command": "python -m benches cameras", "rounds": arguments.rounds, "worlds": WORLDS}
    write_results("cameras", rows, facts)
    return int(slow)


if __name__ == "__main__":
    sys.exit(main())
