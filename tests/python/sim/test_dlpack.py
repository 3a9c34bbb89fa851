"""Arrays of frames through DLPack: the same memory, still read-only, for as long as somebody holds it."""

from __future__ import annotations

import gc

import numpy as np
import pytest

import tightloop as tl

# Of every type and of sizes that leave gaps to the next multiple of 64 bytes
FIELDS = ("joint_q", "joint_qd", "body_q", "mass_matrix", "contact_pair", "contact_count", "contact_force")


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("worlds", [1, 5, 33])
def test_every_array_of_every_frame_begins_at_a_multiple_of_64_bytes(pendulum, precision, worlds):
    pendulum.add_ground()
    pendulum.add_sphere(radius=0.05, body=pendulum.add_body(pos=(2, 0, 0.05)))
    with tl.launch(pendulum, worlds=worlds, fields=FIELDS, precision=precision) as sim:
        # More frames than there are slots, of several commands, two of them held so that the slots change
        held = [sim.reset()]
        for n in range(12):
            held.append([sim.step, sim.forward, sim.reset][n % 3]())
            for name in sim.fields:
                array = getattr(held[-1], name)
                assert array.ctypes.data % 64 == 0 and array.flags.c_contiguous, name
            del held[:-2]


def test_from_dlpack_gives_the_same_memory_read_only(pendulum):
    with tl.launch(pendulum, worlds=3, fields=FIELDS) as sim:
        frame = sim.step()
        for name in sim.fields:
            array = getattr(frame, name)
            taken = np.from_dlpack(array, copy=False)
            assert taken.ctypes.data == array.ctypes.data and np.shares_memory(taken, array) == (array.size > 0), name
            assert (taken.dtype, taken.shape, taken.strides) == (array.dtype, array.shape, array.strides), name
            assert taken.tobytes() == array.tobytes(), name
            assert not taken.flags.writeable, name
            with pytest.raises(ValueError, match="read-only"):
                taken[...] = 0
            with pytest.raises(ValueError, match="WRITEABLE"):
                taken.flags.writeable = True


def test_what_knows_no_read_only_memory_is_refused(pendulum):
    # DLPack before 1.0 cannot say that memory is read-only: better an error than a writer
    with tl.launch(pendulum, worlds=3) as sim:
        array = sim.step().joint_q
        with pytest.raises(BufferError, match="readonly"):
            array.__dlpack__()
        assert array.__dlpack__(max_version=(1, 0)) is not None
        assert array.__dlpack_device__() == (1, 0), "the processor's memory"


def test_an_array_taken_through_dlpack_holds_its_frame(pendulum):
    with tl.launch(pendulum, worlds=3, frames_held=2) as sim:
        taken = np.from_dlpack(sim.step(joint_f=[0.5, 0.1]).joint_q)
        kept = taken.copy()
        for _ in range(20):
            sim.step()
        assert np.array_equal(taken, kept)
        second = np.from_dlpack(sim.step().joint_qd)
        with pytest.raises(tl.FramesHeld):
            sim.step()
        del taken, second
        gc.collect()
        assert sim.step().step.tolist() == [23] * 3
    assert kept.any()
