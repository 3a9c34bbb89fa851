"""A world that is no longer finite is frozen until it is reset, through the daemon."""

from __future__ import annotations

import numpy as np
import pytest

import tightloop as tl

FROZEN = 1


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_one_world_that_blows_up_is_frozen_and_comes_back_by_reset(pendulum, precision):
    worlds, sick = 21, 13
    fields = ("joint_q", "joint_qd", "body_q")
    torque, blow = np.full((worlds, 2), 0.1), np.full((worlds, 2), 0.1)
    blow[sick] = np.finfo(np.float32 if precision == "f32" else np.float64).max / 10
    well = np.arange(worlds) != sick
    with tl.launch(pendulum, worlds=worlds, precision=precision, fields=fields) as sim:
        runs = []
        for strike in (torque, blow):
            sim.reset()
            before = sim.step(joint_f=torque).copy()
            sim.step(joint_f=strike)
            runs.append(sim.step(joint_f=torque).copy())
        plain, struck = runs
        for name in fields:
            assert np.array_equal(getattr(struck, name)[well], getattr(plain, name)[well]), name
        # the last finite state, as it was
        assert np.array_equal(struck.joint_q[sick], before.joint_q[sick])
        assert np.array_equal(struck.joint_qd[sick], before.joint_qd[sick])
        assert np.array_equal(struck.status, np.where(well, 0, FROZEN))
        assert np.array_equal(struck.step, np.where(well, 3, 1)), "it says since when"
        # writing a state does not free it, a reset does
        frame = sim.write(joint_qd=np.zeros(2), mask=~well)
        assert frame.status[sick] == FROZEN and not frame.joint_qd[sick].any()
        assert sim.step().status[sick] == FROZEN
        assert not sim.reset(mask=~well).status.any()
        frame = sim.step(joint_f=torque)
        assert not frame.status.any() and frame.step.tolist() == np.where(well, 5, 1).tolist()
        assert np.array_equal(frame.joint_q[sick], before.joint_q[sick]), "as in its first frame"
