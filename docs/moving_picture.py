"""The README's first picture: an arm grasps a cube, then 4096 arms wave.

    python docs/moving_picture.py [FILE]

Runs both scenes of `tightloop demo`, draws them on the CPU and writes an animated WebP; ten minutes on two cores.
"""

from __future__ import annotations

import sys
from pathlib import Path

import animation
import numpy as np
from numpy.typing import NDArray
from PIL import Image

import tightloop as tl
from tightloop.demo import lesson
from tightloop.view import Camera, Picture
from tightloop.view.parts import parts

FILE = Path(__file__).resolve().parent / "pages/assets/moving_picture.webp"
SIZE = 720, 405  # pixels
WORLDS, SIDE = 4096, 64
# Every sixth frame of 60 a second; a wave takes 120 of them, so that its part repeats without a jump.
EVERY, WAVE = 6, 120
SETTLE = 60  # frames until the wave has grown to its full height
PICTURE_MS, LAST_MS = 100, 700
# Of the WebP, from 0 to 100: the file stays below 0.9 MB, most of it many small arms.
QUALITY = 25
GRASP_CAMERA = Camera((1.15, -1.5, 0.75), (-0.2, -0.42, 0.36), 0.52)
WAVE_CAMERA = Camera((-2.6, -4.6, 3.4), (7.0, 6.5, -0.6), 0.62)

Pixels = NDArray[np.uint8]


def grasp() -> list[Pixels]:
    """Return pictures of an arm that grasps a cube and lifts it."""
    goals = lesson.record("goals").astype(np.float32)
    with tl.launch(lesson.grasp(), worlds=1, fields=("body_q",)) as sim:
        picture = _picture(sim)
        frame = sim.reset()
        pictures = []
        for number, goal in enumerate(goals):
            if number % EVERY == 0:
                pictures.append(picture.render(frame, camera=GRASP_CAMERA, contacts=False))
            frame = sim.step(joint_target_q={"arm": goal})
        return [*pictures, picture.render(frame, camera=GRASP_CAMERA, contacts=False)]


def wave() -> list[Pixels]:
    """Return pictures of thousands of arms that wave."""
    with tl.launch(lesson.arm(driven=True), worlds=WORLDS, fields=("body_q",)) as sim:
        picture = _picture(sim)
        frame = sim.reset()
        pictures = []
        for number in range(SETTLE + WAVE):
            if number >= SETTLE and number % EVERY == 0:
                pictures.append(picture.render(frame, camera=WAVE_CAMERA, contacts=False))
            frame = sim.step(joint_target_q={"arm": lesson.wave(number, WORLDS, SIDE)})
        return pictures


def _picture(sim: tl.Sim) -> Picture:
    return Picture(parts(sim.info["scene"], sim.info["scene_folder"], sim.body_names), *SIZE)


def main() -> None:
    """Draw and write."""
    path = Path(sys.argv[1]) if len(sys.argv) > 1 else FILE
    first, second = grasp(), wave()
    images = [Image.fromarray(pixels) for pixels in first + second]
    durations = [PICTURE_MS] * len(images)
    durations[len(first) - 1] = LAST_MS
    animation.write(path, images, durations, QUALITY)


if __name__ == "__main__":
    main()
