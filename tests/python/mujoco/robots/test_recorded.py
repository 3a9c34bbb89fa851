"""One evaluation of the lesson against the recorded one (tests/data), row by row in MuJoCo's order."""

from __future__ import annotations

import numpy as np
import pytest
from comparison import FIELDS, assert_close, assert_link_frames

import tightloop as tl
from conftest import REPOSITORY

# q̈ of the record is as good as MuJoCo's default termination left it
DOUBLE = {"mass_matrix": 1e-9, "bias_force": 1e-9, "J": 1e-9, "D": 1e-9, "aref": 1e-9, "force": 1e-6, "joint_qdd": 1e-6}
SINGLE = dict.fromkeys(DOUBLE, 1e-5)


@pytest.mark.parametrize(("precision", "tolerances"), [("f64", DOUBLE), ("f32", SINGLE)])
def test_the_recorded_evaluation_is_reproduced_row_by_row(lesson, precision, tolerances):
    recorded = np.load(REPOSITORY / "tests/data/unit_forward_target.npz")
    scene = lesson(driven=True)
    scene.robots["arm"].joint_target_q = recorded["ctrl"]
    with tl.launch(scene, worlds=3, precision=precision, fields=FIELDS) as sim:
        frame = sim.write(joint_q=recorded["qpos"], joint_qd=recorded["qvel"])
    theirs = {"mass_matrix": recorded["M"], "bias_force": recorded["qfrc_bias"], "joint_qdd": recorded["qacc"]}
    ours = {name: getattr(frame, name) for name in theirs}
    active = frame.efc_D[0] != 0
    assert active.sum() == len(recorded["efc_D"])
    for name in ("J", "D", "aref", "force"):
        rows = getattr(frame, f"efc_{name}")
        assert not rows[:, ~active].any(), f"an idle row has efc_{name}"
        ours[name], theirs[name] = rows[:, active], recorded[f"efc_{name}"]
    for name, tolerance in tolerances.items():
        for world in range(3):
            assert_close(
                f"{name} in {precision}", ours[name][world].reshape(1, -1), theirs[name].reshape(1, -1), tolerance
            )
    links = np.hstack([recorded["xpos"][1:], np.roll(recorded["xquat"][1:], -1, axis=1)])
    assert_link_frames(frame.body_q, links[None], 1e-9 if precision == "f64" else 1e-5)
