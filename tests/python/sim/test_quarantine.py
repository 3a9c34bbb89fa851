"""A world that is no longer finite is frozen until it is reset, through the daemon."""

from __future__ import annotations

import re
import time
from pathlib import Path

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


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["joint_f", "joint_target_q", "body_f"])
def test_a_world_whose_command_is_no_number_is_frozen_where_asked(pendulum, precision, bad, name):
    worlds, sick = 19, 5
    well = np.arange(worlds) != sick
    pendulum.robots["arm"].joint_target_ke = 10.0
    good = np.full((worlds, 3, 6) if name == "body_f" else (worlds, 2), 0.1)
    spoilt = good.copy()
    spoilt[sick, -1] = bad
    fields = ("joint_q", "joint_qd", "joint_qdd", "body_q")
    for on_fault in ("freeze", "reset"):
        with tl.launch(
            pendulum,
            worlds=worlds,
            precision=precision,
            fields=fields,
            params=("body_f",),
            on_nan="freeze",
            on_fault=on_fault,
        ) as sim:
            plain = [sim.step(**{name: good}).copy() for _ in range(2)]
            sim.reset()
            sim.step(**{name: good})
            struck = sim.step(**{name: spoilt}).copy()
            assert np.array_equal(struck.status, np.where(well, 0, FROZEN))
            for field in fields:
                assert np.isfinite(getattr(struck, field)).all(), field
                assert np.array_equal(getattr(struck, field)[well], getattr(plain[1], field)[well]), field
            # at its last state, with the command that it had
            assert struck.step[sick] == 1 and np.array_equal(struck.joint_q[sick], plain[0].joint_q[sick])
            assert np.array_equal(struck.joint_qdd[sick], plain[0].joint_qdd[sick])
            after = sim.step(**{name: good}).copy()
            assert after.status[sick] == (FROZEN if on_fault == "freeze" else 0) and after.step[sick] == 1
            if on_fault == "freeze":
                sim.reset(mask=~well)
                after = sim.step(**{name: good})
                assert not after.status.any()
            assert np.array_equal(after.joint_q[sick], plain[0].joint_q[sick]), "as new"
    with tl.launch(pendulum, worlds=worlds, precision=precision, params=("body_f",)) as sim:
        with pytest.raises(tl.CommandRefused, match=rf"{name}. is -?(NaN|inf) in world {sick} "):
            sim.step(**{name: spoilt})
        assert not sim.forward().status.any()
    with pytest.raises(tl.ArgumentError, match=r"on-nan.*refuse or freeze"):
        tl.launch(pendulum, worlds=1, on_nan="ignore")


def frozen_lines(log: Path) -> list[str]:
    return [line for line in log.read_text().splitlines() if line.startswith("frozen: ")]


def test_the_log_counts_frozen_worlds_and_does_not_list_them(pendulum, tmp_path):
    worlds, log = 4096, tmp_path / "daemon.log"
    sick = np.arange(worlds) % 41 == 7  # 100 of them, from world 7 on
    assert sick.sum() == 100
    torque = np.zeros((worlds, 2), np.float32)
    with tl.launch(pendulum, worlds=worlds, bounds={"joint_qd": 50.0}, log=log) as sim:
        for _ in range(3):
            sim.step(joint_f=torque)
        assert not frozen_lines(log)
        torque[sick] = 1e37
        begun = time.monotonic()
        sim.step(joint_f=torque)
        for world in np.flatnonzero(sick)[:5] + 1:  # more of them, but too soon for a line of their own
            torque[world] = 1e4
            sim.step(joint_f=torque)
        lines, passed = frozen_lines(log), time.monotonic() - begun
    # a line may come late, and be reported by the next command or at the end
    assert lines[0] == (
        "frozen: 100 worlds (100 no longer finite), the first of them world 7, no longer finite after its step 3; "
        "frozen now: 100 of 4096"
    )
    assert len(lines) <= 1 + passed
    told = frozen_lines(log)
    assert len(told) <= 2 + passed
    assert sum(int(line.split()[1]) for line in told) == 105
    assert told[-1].endswith("frozen now: 105 of 4096") and "beyond the bounds" in told[-1]


def test_the_log_counts_worlds_that_are_reset_by_themselves_each_time(pendulum, tmp_path):
    log = tmp_path / "daemon.log"
    faults = 0
    with tl.launch(pendulum, worlds=9, bounds={"joint_qd": 3.0}, on_fault="reset", log=log) as sim:
        push = np.zeros((9, 2))
        push[4] = 2.0
        for _ in range(200):
            faults += np.count_nonzero(sim.step(joint_f=push).status)
            sim.forward()
    told = frozen_lines(log)
    assert faults > 3 and sum(int(re.findall(r"\d+", line)[0]) for line in told) == faults
    assert all("world 4, beyond the bounds" in line and line.endswith("frozen now: 0 of 9") for line in told)


def test_bounds_freeze_a_world_and_on_fault_resets_it(pendulum):
    push = np.zeros((9, 2))
    push[4] = 2.0
    runs = {}
    for on_fault in ("freeze", "reset"):
        with tl.launch(pendulum, worlds=9, bounds={"joint_qd": 3.0}, on_fault=on_fault) as sim:
            runs[on_fault] = [(frame := sim.step(joint_f=push)).status.copy() for _ in range(30)]
            assert np.abs(frame.joint_qd).max() <= 3.0
    stays, returns = (np.array(runs[on_fault])[:, 4] for on_fault in ("freeze", "reset"))
    first = int(np.argmax(stays))
    assert stays[first] == 8 and (stays[first:] == 8).all()
    # every episode is as long as the first
    assert (np.flatnonzero(returns) == np.arange(first, 30, first + 1)).all()
    for run in runs.values():
        assert not np.delete(np.array(run), 4, axis=1).any()


def test_wrong_bounds_are_refused_by_name(pendulum):
    with pytest.raises(tl.ArgumentError, match=r"bounds has 'speed'; give joint_q and joint_qd"):
        tl.launch(pendulum, worlds=1, bounds={"speed": 1.0})
    with pytest.raises(tl.ArgumentError, match=r"bounds is 3; give a dict"):
        tl.launch(pendulum, worlds=1, bounds=3)  # pyright: ignore[reportArgumentType]
    with pytest.raises(tl.ArgumentError, match=r"bounds of joint_q is -1; it must be above 0"):
        tl.launch(pendulum, worlds=1, bounds={"joint_q": -1.0})
    with pytest.raises(tl.ArgumentError, match=r"on-fault.*`?panic`?.*use freeze or reset"):
        tl.launch(pendulum, worlds=1, on_fault="panic")
