"""Images in observations of environments: with a history, and beside what only a critic sees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import tightloop as tl
from tightloop.env import JointTorque, Observed, Task, VectorEnv
from tightloop.tasks import cartpole

HEIGHT, WIDTH = 12, 20


class Watch(Task):
    """A cart pole that the policy sees, and whose positions the critic knows."""

    fields = ("joint_q", "side_depth", "side_rgb")
    max_episode_steps = 5

    def scene(self) -> tl.Scene:
        scene = tl.Scene(dt=1 / 120, substeps=2)
        scene.add_urdf(cartpole.URDF, name="cart")
        scene.randomize(joint_q={"cart": tl.Uniform(-0.3, 0.3)})
        scene.add_camera(pos=(0, -3, 0.3), target=(0, 0, 0.3), width=WIDTH, height=HEIGHT, name="side")
        return scene

    def controls(self) -> Sequence[Any]:
        return [JointTorque(["cart/slide"], scale=10)]

    def observed(self) -> Sequence[Observed]:
        pixels = HEIGHT * WIDTH
        return [Observed("depth", 0, 5, pixels, unit="m", history=2), Observed("red", 0, 1, pixels)]

    def observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        count = len(worlds.elapsed)
        return worlds.side_depth.reshape(count, -1), (worlds.side_rgb[..., 0] / 255.0).reshape(count, -1)

    def privileged_observed(self) -> Sequence[Observed]:
        return [Observed("positions", -3, 3, 2)]

    def privileged_observe(self, xp: Any, worlds: Any) -> Sequence[Any]:
        return (worlds.joint_q,)

    def reward(self, xp: Any, worlds: Any) -> Any:
        return 1.0 - xp.abs(worlds.joint_q[:, 0])


def test_an_observation_holds_the_images_of_this_step_and_of_the_one_before() -> None:
    pixels = HEIGHT * WIDTH
    envs = VectorEnv(Watch, 3)
    try:
        first, infos = envs.reset(seed=1)
        assert first.shape == (3, 3 * pixels) and envs.single_observation_space.shape == (3 * pixels,)
        assert infos["privileged"].shape == (3, 2)
        second, *_, infos = envs.step(np.ones((3, 1), np.float32))
        past, now = second[:, :pixels], second[:, pixels : 2 * pixels]
        assert np.array_equal(past, first[:, pixels : 2 * pixels]) and not np.array_equal(past, now)
        images = now.reshape(3, HEIGHT, WIDTH)
        # the cart and its pole, 3 m away
        assert ((images > 2.0) & (images < 3.2)).any(axis=(1, 2)).all()
        assert not np.array_equal(images[0], images[1])
        assert 0 < second[:, 2 * pixels :].max() <= 1.0
    finally:
        envs.close()
