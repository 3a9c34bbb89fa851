"""`tightloop.mujoco.Batch` against MuJoCo: steps, writes, subsets, resets and the rows of the state."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from batch_reference import FIELDS, STATE, Lockstep, N, difference, model_of, positions

import tightloop as tl
from tightloop.mujoco import Batch

INTEGRATION = mujoco.mjtState.mjSTATE_INTEGRATION


@pytest.mark.parametrize("forward", [False, True])
@pytest.mark.parametrize(("contacts", "tolerance"), [(False, 1e-8), (True, 1e-5)])
def test_random_writes_and_steps_of_any_simulations_follow_mujoco(
    forward: bool, contacts: bool, tolerance: float
) -> None:
    model, rng = model_of(contacts=contacts), np.random.default_rng(3)
    with Batch(model, N, 1, forward, precision="f64") as batch:
        case = Lockstep(batch, [model] * N, forward=forward)
        for field in (*STATE, *FIELDS):
            batch.bind(field)
        for call in range(24):
            ids = [0, 2, 5] if call % 4 == 3 else None
            case.write("ctrl", rng.uniform(-1.5, 1.5, (N, model.nu)))
            if call == 4:
                case.write("qpos", positions(model, 1))
                case.write("qvel", rng.normal(0, 0.5, (N, model.nv)))
            if call == 8:
                case.write("qfrc_applied", rng.normal(0, 0.5, (N, model.nv)))
            if call == 12:
                case.write("xfrc_applied", rng.normal(0, 0.5, (N, model.nbody, 6)))
            case.step(ids, nstep=1 + call % 3)
            case.assert_equal((*STATE, *FIELDS), tolerance, range(N) if ids is None else ids)


def test_fields_lag_one_substep_behind_with_the_controls_of_the_step() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        ctrl, xpos, force = (batch.bind(field) for field in ("ctrl", "xpos", "actuator_force"))
        batch.forward()
        before = xpos.copy()
        ctrl[:, 0] = np.linspace(-1, 1, N)
        batch.step()
        np.testing.assert_array_equal(xpos, before)
        np.testing.assert_allclose(force[:, 0], ctrl[:, 0], atol=1e-12)
        batch.forward()
        assert not np.array_equal(xpos, before)


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_a_step_of_some_leaves_the_others_and_their_future_unchanged_bit_for_bit(precision: str) -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1, precision=precision) as batch, Batch(model, N, 1, precision=precision) as alone:
        for each in (batch, alone):
            each.bind("qpos")[:] = positions(model, 5)
            each.bind("ctrl")[:, 0] = 0.3
            each.step(nstep=40)  # until stones lie on the floor, where the solver starts warm
        qpos, qvel = batch.bind("qpos"), batch.bind("qvel")
        others, before = np.array([1, 3, 4]), (qpos.copy(), qvel.copy())
        for ids in ([0, 2, 5], [0, 2], [2]):
            batch.step(np.array(ids), nstep=3)
        for array, old in zip((qpos, qvel), before, strict=True):
            np.testing.assert_array_equal(array[others], old[others])
        assert not np.array_equal(qpos[2], before[0][2])
        batch.step(others, nstep=10)
        alone.step(nstep=10)
        np.testing.assert_array_equal(qpos[others], alone.bind("qpos")[others])
        np.testing.assert_array_equal(qvel[others], alone.bind("qvel")[others])


def test_writes_wait_for_the_simulation_s_next_call() -> None:
    with Batch(model_of(), N, 1, precision="f64") as batch:
        qpos = batch.bind("qpos")
        qpos[1, 0] = 0.1
        batch.step(np.array([0]))
        assert qpos[1, 0] == 0.1
        assert qpos[0, 1] != qpos[1, 1] == 0.0
        batch.step(np.array([1]))
        assert qpos[1, 0] == pytest.approx(0.1, abs=1e-3)
        assert qpos[1, 0] != 0.1
        assert batch.bind("qpos") is qpos or np.shares_memory(batch.bind("qpos"), qpos)


def test_float32_elements_count_only_where_they_changed() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as narrow, Batch(model, N, 1, precision="f64") as wide:
        qpos, ctrl = narrow.bind("qpos", np.float32), narrow.bind("ctrl", np.float32)
        ctrl[:, 0] = 0.3
        wide.bind("ctrl")[:, 0] = np.float32(0.3)
        for each in (narrow, wide):
            each.step(nstep=20)
            each.step(nstep=20)
        np.testing.assert_array_equal(qpos, wide.bind("qpos").astype(np.float32))
        assert qpos.dtype == np.float32
        qpos[2, 0] = 0.25
        wide.bind("qpos")[2, 0] = 0.25
        for each in (narrow, wide):
            each.step()
        np.testing.assert_array_equal(qpos, wide.bind("qpos").astype(np.float32))


def test_history_holds_the_row_after_every_step() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch, Batch(model, N, 1, precision="f64") as loop:
        ids, nstate = np.array([1, 4]), batch.nstate
        for each in (batch, loop):
            each.bind("ctrl")[:, 0] = np.linspace(-1, 1, N)
        history = np.empty((2, 5, nstate))
        batch.step(ids, nstep=5, history=history)
        for step in range(5):
            loop.step(ids)
            np.testing.assert_array_equal(history[:, step], loop.bind("state")[ids])
        np.testing.assert_allclose(history[:, :, 0], np.tile(0.004 * np.arange(1, 6), (2, 1)))
        for bad in (
            *(np.empty((2, 5)), np.empty((N, 5, nstate)), np.empty((2, 4, nstate))),
            *(np.empty((2, 5, nstate), np.float32), np.empty((2, 5, nstate + 1))[:, :, 1:]),
        ):
            with pytest.raises(ValueError, match="history"):
                batch.step(ids, nstep=5, history=bad)


def test_rows_are_mujoco_s_integration_state() -> None:
    model = model_of()
    data = mujoco.MjData(model)
    with Batch(model, N, 1, precision="f64") as batch:
        state = batch.bind("state")
        assert batch.nstate == mujoco.mj_stateSize(model, INTEGRATION) == state.shape[1]
        batch.bind("ctrl")[:] = np.linspace(-1, 1, N)[:, None]
        batch.bind("qpos")[:] = positions(model, 2)
        batch.bind("xfrc_applied")[:, 2, 0] = 0.5
        batch.step(nstep=4)
        for sim in range(N):
            mujoco.mj_setState(model, data, state[sim], INTEGRATION)
            mujoco.mj_step(model, data)
            state[sim] = state[sim].copy()
            batch.step(np.array([sim]))
            assert difference(batch.bind("qpos")[sim], data.qpos) < 1e-10
            assert batch.bind("time")[sim] == data.time


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_equal_rows_have_equal_futures_bit_for_bit(precision: str) -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1, precision=precision) as batch:
        state = batch.bind("state")
        batch.bind("qpos")[:] = positions(model, 4)
        batch.bind("ctrl")[:, 0] = np.linspace(-1, 1, N)
        batch.step(nstep=50)
        saved = state.copy()
        batch.step(nstep=7)
        once = state.copy()
        assert not np.array_equal(saved, once)
        state[:] = saved
        batch.step(nstep=7)
        np.testing.assert_array_equal(state, once)
        # a simulation becomes another one
        state[1] = state[0]
        batch.step(nstep=3)
        np.testing.assert_array_equal(state[1], state[0])


def test_a_new_field_between_calls_changes_no_motion() -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1, precision="f64") as batch, Batch(model, N, 1, precision="f64") as other:
        for each in (batch, other):
            each.bind("qpos")[:] = positions(model, 6)
            each.step(nstep=60)
        pid = batch.sim.pid
        batch.bind("qacc")
        for each in (batch, other):
            each.step(nstep=10)
        assert batch.sim.pid != pid
        np.testing.assert_array_equal(batch.bind("qpos"), other.bind("qpos"))


@pytest.mark.parametrize("precision", ["f32", "f64"])
def test_steps_of_one_call_are_those_of_many_calls_bit_for_bit(precision: str) -> None:
    model = model_of(contacts=True)
    with Batch(model, N, 1, precision=precision) as many, Batch(model, N, 1, precision=precision) as few:
        for each in (many, few):
            each.bind("qpos")[:] = positions(model, 9)
        few.step(nstep=30)
        few.step(nstep=20)
        assert few.sim.substeps == 10
        few.step(nstep=3)
        assert few.sim.substeps == 1
        for _ in range(53):
            many.step()
        for field in ("qpos", "qvel", "time"):
            np.testing.assert_array_equal(few.bind(field), many.bind(field))


def test_reset_to_the_start_or_a_keyframe_keeps_what_was_written() -> None:
    model = model_of()
    data = mujoco.MjData(model)
    with Batch(model, N, 1, precision="f64") as batch:
        qpos, ctrl, time, xpos = (batch.bind(field) for field in ("qpos", "ctrl", "time", "xpos"))
        ctrl[:] = 0.7
        batch.step(nstep=5)
        old = qpos.copy()
        qpos[2, 1] = 0.25
        batch.reset(np.array([2, 4]))
        np.testing.assert_array_equal(qpos[4], model.qpos0)
        assert qpos[2, 1] == 0.25
        np.testing.assert_array_equal(np.delete(qpos[2], 1), np.delete(model.qpos0, 1))
        np.testing.assert_array_equal(np.delete(qpos, [2, 4], axis=0), np.delete(old, [2, 4], axis=0))
        assert (time[[2, 4]] == 0).all()
        assert (ctrl[[2, 4]] == 0).all()
        batch.reset(keyframe=0)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        for field, expected in ((qpos, data.qpos), (ctrl, data.ctrl), (time, 1.5), (xpos, data.xpos)):
            np.testing.assert_allclose(field, np.broadcast_to(expected, field.shape), atol=1e-12)
        batch.step(nstep=2)
        mujoco.mj_step(model, data, 2)
        assert difference(qpos, [data.qpos] * N) < 1e-10
        for bad in (1, -2):
            with pytest.raises(ValueError, match="keyframe"):
                batch.reset(keyframe=bad)


def test_parts_count_before_the_state_and_a_reset_forgets_what_was_written_into_it() -> None:
    model = model_of()
    start = np.zeros(mujoco.mj_stateSize(model, INTEGRATION))
    mujoco.mj_getState(model, mujoco.MjData(model), start, INTEGRATION)
    with Batch(model, N, 1, precision="f64") as batch:
        state, qpos = batch.bind("state"), batch.bind("qpos")
        batch.step(nstep=5)
        saved = state[1].copy()
        batch.step(nstep=5)
        # a row as a whole, and an element of a part of it
        state[1] = saved
        qpos[1, 0] = 0.3
        batch.forward()
        saved[1] = 0.3
        np.testing.assert_array_equal(state[1], saved)
        np.testing.assert_array_equal(qpos[1], saved[1 : 1 + qpos.shape[1]])
        # an element that a call refuses may be written again
        state[2, 1] = np.nan
        with pytest.raises(ValueError, match="sim 2: qpos"):
            batch.forward()
        state[2, 1] = 0.2
        batch.forward()
        assert qpos[2, 0] == state[2, 1] == 0.2
        state[3] = saved
        qpos[3, 1] = 0.25
        batch.reset(np.array([3]))
        start[2] = 0.25
        np.testing.assert_array_equal(state[3], start)


def test_unstable_simulations_start_again_and_count_a_warning() -> None:
    model = model_of()
    with Batch(model, N, 1, precision="f64") as batch:
        warning, qpos, ctrl = (batch.bind(field) for field in ("warning", "qpos", "ctrl"))
        batch.step(nstep=3)
        qpos[2] = np.nan
        ctrl[4, 0] = np.nan
        batch.step()
        kinds = mujoco.mjtWarning
        assert warning[2, kinds.mjWARN_BADQPOS, 1] == 1
        assert warning[4, kinds.mjWARN_BADCTRL, 1] == 1
        assert warning[:, :, 1].sum() == 2
        assert np.isfinite(qpos).all()
        assert batch.bind("time")[2] == pytest.approx(0.004)
        assert np.isnan(ctrl[4, 0])
        batch.step(nstep=3)
        assert warning[4, kinds.mjWARN_BADCTRL, 1] == 4
        batch.reset(np.array([4]))
        assert warning[4].sum() == 0
        assert (ctrl[4] == 0).all()
        qpos[3] = np.inf
        with pytest.raises(ValueError, match="sim 3: qpos"):
            batch.forward()


def test_simulations_are_chosen_by_sorted_indices_or_a_mask() -> None:
    with Batch(model_of(), N, 1, precision="f64") as batch:
        time = batch.bind("time")
        batch.step(np.array([1, 3], np.int32))
        batch.step(np.arange(N) == 3)
        batch.step(np.array([], np.int64))
        np.testing.assert_allclose(time, [0, 0.004, 0, 0.008, 0, 0])
        for bad in ([N], [-1], [1, 1], [3, 1], [1.0], [True], [[1]]):
            with pytest.raises(ValueError, match="ids"):
                batch.step(np.array(bad))
        with pytest.raises(ValueError, match="nstep"):
            batch.step(nstep=0)
        np.testing.assert_allclose(time, [0, 0.004, 0, 0.008, 0, 0])


def test_the_simulation_underneath_is_a_sim() -> None:
    batch = Batch(model_of(), N, 1)
    assert isinstance(batch.sim, tl.Sim)
    assert (batch.sim.worlds, batch.sim.threads, batch.num_threads, batch.num_sims) == (N, 1, 1, N)
    batch.close()
    with pytest.raises(tl.SimClosed):
        batch.sim.forward()


def test_constructor_refuses_sleep_and_no_simulations() -> None:
    model = model_of()
    with pytest.raises(ValueError, match="num_sims"):
        Batch(model, 0)
    model.opt.enableflags |= int(mujoco.mjtEnableBit.mjENBL_SLEEP)
    with pytest.raises(ValueError, match="sleep"):
        Batch(model, N)
