"""Heaps of MuJoCo's free bodies on a GPU: contacts can join all of their dofs to one system, which loops solve."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

mujoco = pytest.importorskip("mujoco")

WORLDS = 3
FIELDS = ("joint_q", "joint_qd", "contacts_left_out", "status")


def heap(option: str, geom: str, bodies: int = 9) -> str:
    """Bodies in a row, each of which touches its neighbours and the ground."""
    balls = "".join(
        f'<body pos="{0.099 * k:.3f} 0 0.0499"><freejoint/>'
        f'<geom size="0.05" pos="0 {0.01 * (k % 3 == 0)} 0" {geom}/></body>'
        for k in range(bodies)
    )
    return (
        f'<mujoco><option timestep="0.002" {option}/><worldbody>'
        f'<geom type="plane" size="5 5 1"/>{balls}</worldbody></mujoco>'
    )


@pytest.mark.parametrize(
    ("option", "geom"),
    [
        ('cone="elliptic"', 'condim="6" friction="0.8 0.02 0.01"'),
        ('cone="pyramidal"', 'condim="4" friction="0.8 0.02 0.01"'),
    ],
)
def test_heaps_with_torsional_friction_move_as_on_the_cpu(option, geom, tmp_path):
    path = tmp_path / "heap.xml"
    path.write_text(heap(option, geom))
    seen = {}
    for device in ("cpu", "gpu"):
        scene = tl.Scene.from_mujoco(path, substeps=2)
        with tl.launch(scene, worlds=WORLDS, device=device, fields=FIELDS) as sim:
            frame = sim.reset()
            # 0.3 m/s and 10 rad/s: forces of centres of mass beside their frames' origins count
            largest = np.tile([0.3, 0.3, 0.3, 10.0, 10.0, 10.0], frame.joint_qd.shape[1] // 6)
            sim.write(joint_qd=largest * np.sin(np.arange(frame.joint_qd.size)).reshape(frame.joint_qd.shape))
            for _ in range(3):
                frame = sim.step()
            assert not frame.contacts_left_out.any()
            assert not frame.status.any()
            seen[device] = [np.array(frame.joint_q), np.array(frame.joint_qd)]
    # dofs are eliminated in another order; stiff contacts multiply such a rounding by some thousand
    np.testing.assert_allclose(seen["gpu"][0], seen["cpu"][0], atol=1e-5)
    np.testing.assert_allclose(seen["gpu"][1], seen["cpu"][1], atol=1e-3)
