"""What falls short, test by test: each must fail, so that a line leaves this table when its cause is mended."""

from __future__ import annotations

import pytest

PILES = "test_contacts_live.py::test_accelerations_of_piles_are_mujocos"
HOLD = "test_grasp_hold.py::test_the_cube_slips_no_more_than_mujocos"
STACK = "test_contact_physics.py::test_a_stack_of_five_boxes_keeps_four_contacts_a_box_for_twenty_seconds"
SLOPE = "test_contact_physics.py::test_a_block_slides_past_the_angle_of_friction_and_not_before"

STIFF = "f32: M drowns in the stiffness of contacts at large impratio"
CAPSULE = "MuJoCo lays the pyramid of a capsule on a plane along the capsule: 22.4, 0 for 19.2, 11.1 m/s²"

#: Ends of test names, and by how much and why they fail.
MISSES: dict[str, str] = {
    f"{PILES}[sphere-box-pyramidal-f32]": f"{STIFF}: up to 0.64 for one box, asked 1e-3",
    f"{PILES}[sphere-capsule-pyramidal-f64]": CAPSULE,
    f"{PILES}[sphere-capsule-pyramidal-f32]": CAPSULE,
    f"{HOLD}[f32]": "f32: more than 1.2 times the 20 um of MuJoCo and f64 in 60 s",
    f"{STACK}[f64]": "22 contacts instead of 20 at the end; 20 while the solver was not in correction form",
    f"{SLOPE}[pyramidal-f32]": f"{STIFF}: mu measures 0.3010 for 0.3",
}


def mark(items: list[pytest.Item]) -> None:
    """Expects the tests of the table to fail, and nothing else."""
    for item in items:
        for name, reason in MISSES.items():
            if item.nodeid.endswith(name):
                item.add_marker(pytest.mark.xfail(reason=reason, strict=True))
