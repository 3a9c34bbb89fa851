"""FrankaPickCubeDepth beside FrankaPickCube: the same worlds, and an image in place of the cube's pose."""

from __future__ import annotations

from typing import Any

import numpy as np

from tightloop.env import VectorEnv
from tightloop.tasks.pick_cube import FrankaPickCube
from tightloop.tasks.pick_cube_depth import FrankaPickCubeDepth

WORLDS = 64


class Labelled(FrankaPickCubeDepth):
    """The task with the targets of the other one, and of whose images the labels are known."""

    fields = (*FrankaPickCubeDepth.fields, "wrist_segmentation")
    lead = FrankaPickCube.lead


def test_it_is_pick_cube_with_an_image_in_place_of_the_pose_of_the_cube() -> None:
    plain: Any = VectorEnv("FrankaPickCube", WORLDS, autoreset_mode="SAME_STEP")
    seeing: Any = VectorEnv(Labelled, WORLDS, autoreset_mode="SAME_STEP")
    try:
        assert not {part.name for part in seeing.task.observed()} & {"cube: position", "cube: orientation"}
        cube = [name.split("/")[0] for name in seeing.sim.segment_names].index("cube")
        draws, seen = np.random.default_rng(0), []
        state, _ = plain.reset(seed=3)
        obs, infos = seeing.reset(seed=3)
        for step in range(55):  # over the ends of episodes
            assert np.array_equal(obs[:, :29], state[:, :29])
            # all but the orientation of the cube
            assert np.array_equal(infos["privileged"], np.delete(state, slice(32, 36), 1))
            assert np.array_equal(obs[:, 29:], seeing.frame.wrist_depth.reshape(WORLDS, -1))
            seen.append((seeing.frame.wrist_segmentation == cube).sum((1, 2)))
            action = draws.uniform(-0.3, 0.3, (WORLDS, 8))
            state, reward, *_ = plain.step(action)
            obs, other, *_, infos = seeing.step(action)
            assert np.array_equal(reward, other), step
    finally:
        plain.close()
        seeing.close()
    # an episode begins with the cube in the image, some 8 pixels wide
    assert min(seen[0].min(), seen[50].min()) > 20
    image = obs[:, 29:]
    assert image[image > 0].min() > 0.02 and image.max() <= 1.0
