"""Tumbling bodies that carry nothing against MuJoCo, which is implicit in their gyroscopic forces since 3.11."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import tightloop as tl

BODIES, STEPS = 6, 200
TIMESTEP, GRAVITY = 1 / 480, (1.0, 2.0, -9.0)
# MuJoCo and the text agree to roundings of 1e-16, which tumbling multiplies within 200 steps
AGREE = 1e-12
# f32 rounds spins of 8 rad/s by 6e-8 a step: all the same way, 200 steps move them by 1e-4 rad/s, and the turn of 0.4 s
# that they make by 4e-5; tumbling doubles it
AGREE_SINGLE = 1e-4


@pytest.mark.parametrize(("precision", "tolerance"), [("f64", AGREE), ("f32", AGREE_SINGLE)])
def test_free_bodies_tumble_as_mujocos(precision, tolerance):
    rng = np.random.default_rng(7)
    scene = tl.Scene(dt=TIMESTEP, substeps=1, gravity=GRAVITY)
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = TIMESTEP, GRAVITY
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for number in range(BODIES):
        pos, center = rng.uniform(-1, 1, 3), rng.uniform(-0.2, 0.2, 3)
        quat = rng.normal(size=4)
        quat /= np.linalg.norm(quat)
        spread = rng.normal(size=(3, 3))
        spread = spread @ spread.T + 0.1 * np.eye(3)
        inertia = np.trace(spread) * np.eye(3) - spread
        mass = float(rng.uniform(0.5, 5))
        scene.add_body(
            name=f"b{number}", pos=tuple(pos), quat=tuple(quat), mass=mass, com=tuple(center), inertia=inertia
        )
        body = spec.worldbody.add_body(pos=pos, quat=np.roll(quat, 1), explicitinertial=True)
        body.mass, body.ipos = mass, center
        body.fullinertia = [inertia[row, column] for row, column in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))]
        body.add_freejoint()
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    joint_qd = rng.normal(size=(BODIES, 6)) * [1, 1, 1, 5, 5, 5]
    for number, own in enumerate(joint_qd):
        rotation = data.xmat[number + 1].reshape(3, 3)
        arm = data.xipos[number + 1] - data.xpos[number + 1]
        data.qvel[6 * number :][:6] = [*(own[:3] - np.cross(own[3:], arm)), *(rotation.T @ own[3:])]
    with tl.launch(scene, worlds=1, precision=precision, fields=("joint_q",)) as sim:
        sim.reset()
        sim.write(joint_qd=joint_qd.reshape(1, -1))
        for _ in range(STEPS):
            frame = sim.step()
            mujoco.mj_step(model, data)
        ours, theirs = np.array(frame.joint_q[0]).reshape(BODIES, 7), data.qpos.reshape(BODIES, 7)
    np.testing.assert_allclose(ours[:, :3], theirs[:, :3], rtol=0, atol=tolerance)
    turned = np.roll(theirs[:, 3:], -1, axis=1)
    # a quaternion and its negative are one rotation
    turned *= np.sign(np.sum(turned * ours[:, 3:], axis=1, keepdims=True))
    np.testing.assert_allclose(ours[:, 3:], turned, rtol=0, atol=tolerance)
