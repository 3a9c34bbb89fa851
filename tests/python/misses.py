"""What falls short, test by test: each must fail, so that a line leaves this table when its cause is mended."""

from __future__ import annotations

import pytest

#: Ends of test names, and by how much and why they fail.
MISSES: dict[str, str] = {
    "mujoco/test_contacts_live.py::test_accelerations_of_piles_are_mujocos[sphere-box-elliptic-f32]": "f32: 1.1e-3 to 5.4e-3 of the largest, asked 1e-3; M drowns in the stiffness of contacts at large impratio",
    "mujoco/test_contacts_live.py::test_accelerations_of_piles_are_mujocos[sphere-box-pyramidal-f32]": "f32: up to 0.64 for one box at impratio 1000, asked 1e-3; as above",
    "mujoco/test_contacts_live.py::test_accelerations_of_piles_are_mujocos[sphere-capsule-elliptic-f32]": "f32: 1.1e-3 to 5.4e-3, asked 1e-3; as above",
    "mujoco/test_contacts_live.py::test_accelerations_of_piles_are_mujocos[sphere-capsule-pyramidal-f64]": "MuJoCo turns the pyramid of a capsule on a plane along the capsule: -22.4, 0 instead of -19.2, -11.1 m/s²",
    "mujoco/test_contacts_live.py::test_accelerations_of_piles_are_mujocos[sphere-capsule-pyramidal-f32]": "as in f64",
    "mujoco/test_contacts_live.py::test_a_centre_of_mass_may_lie_anywhere[elliptic-f64]": "0.449 instead of 0.477 m/s²: rows lack the swing of a centre that lies off its frame",
    "mujoco/test_contacts_live.py::test_a_centre_of_mass_may_lie_anywhere[elliptic-f32]": "as in f64",
    "mujoco/test_contacts_live.py::test_a_centre_of_mass_may_lie_anywhere[pyramidal-f64]": "as elliptic",
    "mujoco/test_contacts_live.py::test_a_centre_of_mass_may_lie_anywhere[pyramidal-f32]": "as elliptic",
    "mujoco/test_contacts_live.py::test_accelerations_of_arms_that_touch_are_mujocos[pyramidal-f32]": "f32: 1.8e-3, asked 1e-3",
    "mujoco/test_grasp_hold.py::test_the_cube_slips_no_more_than_mujocos[f32]": "f32: 2.49 mm in 60 s, MuJoCo and f64 20 um",
    "test_contact_physics.py::test_a_block_slides_past_the_angle_of_friction_and_not_before[pyramidal-f32]": "f32: mu measures 0.3010 for 0.3",
}


def mark(items: list[pytest.Item]) -> None:
    """Expects the tests of the table to fail, and nothing else."""
    for item in items:
        for name, reason in MISSES.items():
            if item.nodeid.endswith(name):
                item.add_marker(pytest.mark.xfail(reason=reason, strict=True))
