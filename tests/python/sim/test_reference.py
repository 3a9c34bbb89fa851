"""The lesson through daemon, shared memory and Python, against MuJoCo C in float64 (tests/data).

Tolerances: how far apart two honest implementations are, measured with MuJoCo itself: its state rounded to float32
every step, or started 1e-7 away.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import tightloop as tl
from conftest import REPOSITORY, SHARED

FRAMES = 180


def recorded(name: str) -> NDArray[np.float64]:
    """Rows of time, 9 positions, 9 velocities; frame 0 is the start."""
    rows = np.loadtxt(REPOSITORY / f"tests/data/mujoco_{name}.csv", delimiter=",")
    if (SHARED / "data").exists():
        assert np.array_equal(rows, np.loadtxt(SHARED / f"data/mujoco_{name}.csv", delimiter=","))
    return rows


def urdfs() -> list[Path]:
    """The project's own description, and the published one where it is present."""
    own = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"
    published = SHARED / "fr3_franka_hand/urdf/fr3_franka_hand.urdf"
    return [own, published] if published.exists() else [own]


def distance(sim: tl.Sim, name: str, command: str, values: Callable[[int], NDArray]) -> NDArray[np.float64]:
    """Largest difference of a joint position from the reference, by frame."""
    reference = recorded(name)
    rows = [sim.reset().joint_q.astype(float)]
    for frame in range(FRAMES):
        given: dict[str, Any] = {command: {"arm": values(frame)}}
        rows.append(sim.step(**given).joint_q.astype(float))
    assert all(np.array_equal(row, np.broadcast_to(row[0], row.shape)) for row in rows), "equal worlds stay equal"
    return np.abs(np.array(rows)[:, 0] - reference[:, 1:10]).max(axis=1)


@pytest.mark.parametrize("urdf", urdfs(), ids=lambda path: path.stem)
@pytest.mark.parametrize(("precision", "tolerance"), [("f32", 2e-6), ("f64", 1e-7)])
def test_target_demo_follows_mujoco_to_the_end(lesson, targets, urdf, precision, tolerance):
    with tl.launch(lesson(driven=True, urdf=urdf), worlds=3, precision=precision) as sim:
        assert distance(sim, "target", "joint_target_q", targets).max() <= tolerance


@pytest.mark.parametrize("urdf", urdfs(), ids=lambda path: path.stem)
@pytest.mark.parametrize(
    ("precision", "tolerances"),
    [("f32", {30: 5e-6, 60: 5e-5, 120: 1e-2}), ("f64", {60: 1e-7, 120: 1e-5})],
)
def test_torque_demo_follows_mujoco_until_chaos(lesson, torques, urdf, precision, tolerances):
    with tl.launch(lesson(driven=False, urdf=urdf), worlds=3, precision=precision) as sim:
        errors = distance(sim, "torque_free", "joint_f", torques)
    for frame, tolerance in tolerances.items():
        assert errors[: frame + 1].max() <= tolerance, f"up to frame {frame}"


@pytest.mark.parametrize(("precision", "tolerance", "solved"), [("f64", 1e-9, 1e-6), ("f32", 1e-5, 1e-5)])
def test_fields_of_one_evaluation_equal_mujocos(lesson, precision, tolerance, solved):
    reference = np.load(REPOSITORY / "tests/data/unit_forward_target.npz")
    scene = lesson(driven=True)
    scene.robots["arm"].joint_target_q = reference["ctrl"]
    fields = ("mass_matrix", "bias_force", "efc_J", "efc_D", "efc_aref", "joint_qdd")
    with tl.launch(scene, worlds=2, precision=precision, fields=fields) as sim:
        frame = sim.write(joint_q=reference["qpos"], joint_qd=reference["qvel"])
        ours = {field: getattr(frame, field)[1].astype(float) for field in fields}

    def assert_close(name: str, got: NDArray, expected: NDArray, bound: float) -> None:
        error = np.abs(got - expected).max() / np.abs(expected).max()
        assert error <= bound, f"{name} is off by {error:.1e} of its largest entry"

    assert_close("mass_matrix", ours["mass_matrix"].reshape(9, 9), reference["M"], tolerance)
    assert_close("bias_force", ours["bias_force"], reference["qfrc_bias"], tolerance)
    assert_close("joint_qdd", ours["joint_qdd"], reference["qacc"], solved)
    # Row order is each simulator's own, and ours has slots for rows that are idle: match the active ones by direction
    active = np.flatnonzero(ours["efc_D"])
    assert len(active) == len(reference["efc_J"])
    apart = np.abs(ours["efc_J"][active][None] - reference["efc_J"][:, None]).max(axis=2)
    match = active[apart.argmin(axis=1)]
    assert len(set(match)) == len(match)
    for name in ("efc_J", "efc_D", "efc_aref"):
        assert_close(name, ours[name][match], reference[name], tolerance)
