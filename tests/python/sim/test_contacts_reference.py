"""The lesson's demos with contacts through daemon, shared memory and Python, against MuJoCo C in float64 (tests/data).

Tolerances: how far apart two honest implementations are, measured with MuJoCo itself: its state rounded to float32
every step, or started 1e-7 away. After the fingers of the torque demo touch the table, in frame 14, it is chaos.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_reference import FRAMES, recorded

import tightloop as tl
from conftest import REPOSITORY, SHARED

FIELDS = ("joint_q", "contact_count", "contact_distance")
OWN = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"
PUBLISHED = SHARED / "fr3_franka_hand/urdf/fr3_franka_hand.urdf"
needs_published = pytest.mark.skipif(not PUBLISHED.exists(), reason="the published URDF lies in ../shared only")
# Both have the same boxes for fingers, which are all that touches in these demos
URDFS = pytest.mark.parametrize("urdf", [OWN, pytest.param(PUBLISHED, marks=needs_published)], ids=["own", "published"])
# Status bits that are an error: single precision may use up its 20 iterations (2), as at the hardest of blows
WRONG = {"f64": 7, "f32": 5}
# Frames until the fingers touch the table
FREE = 14
# How deep MuJoCo's own arm gets into the table: 51 mm, the most at the end of a frame of 30 runs of `torque.mjb` that
# start up to 1e-3 rad away; and a tenth more [m]
DEPTH_MAX = 0.056


def grasp_targets() -> np.ndarray:
    """Drive targets of every frame of the grasp demo, ``(frames, 9)``, float32 values."""
    targets = np.loadtxt(REPOSITORY / "tests/data/grasp_targets.csv", delimiter=",", dtype=np.float32)
    assert targets.shape == (FRAMES, 9)
    return targets


@URDFS
@pytest.mark.parametrize(("precision", "tolerance"), [("f32", 2e-6), ("f64", 1e-7)])
def test_torque_demo_follows_mujoco_until_the_fingers_touch_the_table(
    lesson, torques, urdf: Path, precision, tolerance
):
    scene = lesson(driven=False, urdf=urdf)
    scene.add_table()
    reference = recorded("torque")[:, 1:10]
    with tl.launch(scene, worlds=3, precision=precision, fields=FIELDS) as sim:
        for number in range(FRAMES):
            frame = sim.step(joint_f={"arm": torques(number)})
            q = frame.joint_q.astype(float)
            assert not (frame.status & WRONG[precision]).any() and np.isfinite(q).all()
            assert np.array_equal(q, np.broadcast_to(q[0], q.shape)), "equal worlds stay equal"
            if number + 1 < FREE:
                assert not frame.contact_count.any()
                assert np.abs(q[0] - reference[number + 1]).max() <= tolerance, f"frame {number + 1}"
            elif number + 1 == FREE + 1:
                assert frame.contact_count.all(), "the fingers touch"
            assert frame.contact_distance.min() > -DEPTH_MAX, f"frame {number + 1}"


@URDFS
@pytest.mark.parametrize(("precision", "early"), [("f32", 5e-6), ("f64", 5e-7)])
def test_grasp_demo_follows_mujoco_to_the_end(lesson, urdf: Path, precision, early):
    joints, cube = 1e-4, 2e-4
    scene = lesson(driven=True, urdf=urdf)
    scene.add_table()
    scene.add_cube()
    reference, targets = recorded("grasp"), grasp_targets()
    with tl.launch(scene, worlds=3, precision=precision, fields=FIELDS) as sim:
        rows = [sim.reset().joint_q.astype(float)]
        for target in targets:
            frame = sim.step(joint_target_q={"arm": target})
            assert not (frame.status & WRONG[precision]).any()
            rows.append(frame.joint_q.astype(float))
    ours = np.array(rows)
    assert np.array_equal(ours, np.broadcast_to(ours[:, :1], ours.shape)), "equal worlds stay equal"
    # joints and the cube's position
    error = np.abs(ours[:, 0, :12] - reference[:, 1:13])
    assert error[:91].max() <= early, f"{error[:91].max():.1e} up to frame 90"
    assert error[:, :9].max() <= joints, f"joints {error[:, :9].max():.1e}"
    assert error[:, 9:].max() <= cube, f"cube {error[:, 9:].max():.1e}"
    assert ours[-1, 0, 11] > 0.27, "the cube is lifted from 0.125 m"
