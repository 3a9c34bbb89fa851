"""torch and JAX on the memory of a frame: the calls that the documentation of `Frame` names, by address."""

from __future__ import annotations

import gc
import signal
import subprocess
import sys
from collections.abc import Iterator

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import torch

import tightloop as tl

SCENE = """
import tightloop as tl
scene = tl.Scene(dt=1 / 480, substeps=4)
scene.add_sphere(radius=0.05, body=scene.add_body(pos=(0, 0, 1)))
scene.add_ground()
"""
FIELDS = ("joint_q", "joint_qd", "body_q", "contact_pair", "contact_force")


def launch(**options) -> tl.Sim:
    names: dict[str, tl.Scene] = {}
    exec(SCENE, names)
    return tl.launch(names["scene"], worlds=7, **options)


@pytest.fixture
def sim() -> Iterator[tl.Sim]:
    with launch(fields=FIELDS, frames_held=2) as sim:
        yield sim


@pytest.mark.parametrize("take", [torch.from_dlpack, torch.from_numpy, torch.as_tensor], ids=lambda take: take.__name__)
@pytest.mark.filterwarnings("ignore:The given NumPy array is not writable")
def test_torch_takes_every_field_where_it_lies(sim, take):
    frame = sim.step()
    for name in sim.fields:
        array = getattr(frame, name)
        tensor = take(array)
        assert tensor.data_ptr() == array.ctypes.data, name
        assert tuple(tensor.shape) == array.shape and tensor.is_contiguous(), name
        assert np.array_equal(tensor.numpy(), array), name


def test_jax_takes_every_field_where_it_lies(sim):
    frame = sim.step()
    for name in sim.fields:
        array = getattr(frame, name)
        taken = jax.device_put(array)
        if array.itemsize == 8:
            # Without x64 JAX has no such type
            assert taken.dtype.itemsize == 4 and taken.unsafe_buffer_pointer() != array.ctypes.data, name
        else:
            assert taken.unsafe_buffer_pointer() == array.ctypes.data and taken.dtype == array.dtype, name
        assert np.array_equal(np.asarray(taken), array.astype(taken.dtype)), name


def test_jax_with_x64_takes_double_precision_where_it_lies():
    with launch(fields=("joint_q", "body_q"), precision="f64") as sim, jax.enable_x64(True):
        frame = sim.step()
        for name in sim.fields:
            array = getattr(frame, name)
            taken = jax.device_put(array)
            assert taken.unsafe_buffer_pointer() == array.ctypes.data and taken.dtype == array.dtype, name


def test_the_calls_of_jax_that_do_not_take_a_field_as_it_is(sim):
    # What the documentation warns of: if a release of JAX learns it, so should the documentation
    array = sim.step().joint_q
    with pytest.raises(BufferError, match="readonly"):
        jax.dlpack.from_dlpack(array)
    assert jnp.asarray(array).unsafe_buffer_pointer() != array.ctypes.data


@pytest.mark.parametrize("take", [torch.from_dlpack, jax.device_put], ids=["torch", "jax"])
def test_what_was_taken_holds_its_frame_and_stays_as_it_is(sim, take):
    first = take(sim.step().body_q)
    kept = np.array(np.from_dlpack(first))
    for _ in range(20):
        sim.step()
    assert np.array_equal(np.from_dlpack(first), kept)
    second = take(sim.step().body_q)
    with pytest.raises(tl.FramesHeld):
        sim.step()
    del first, second
    gc.collect()
    assert sim.step().step.tolist() == [23] * 7


def test_what_was_taken_outlives_the_simulation():
    with launch() as sim:
        frame = sim.step()
        expected = frame.body_q.copy()
        taken = torch.from_dlpack(frame.body_q), jax.device_put(frame.body_q)
        del frame
    for array in taken:
        assert np.array_equal(np.from_dlpack(array), expected)


WRITER = (
    SCENE
    + """
import torch
with tl.launch(scene, worlds=7) as sim:
    frame = sim.step()
    torch.from_dlpack(frame.joint_q).clone().add_(1)
    print("cloned", flush=True)
    torch.from_dlpack(frame.joint_q).add_(1)
    print("written", flush=True)
"""
)


def test_writing_to_a_frame_through_torch_ends_the_process_and_a_clone_may_be_written():
    done = subprocess.run([sys.executable, "-c", WRITER], capture_output=True, text=True, check=False)
    assert done.stdout == "cloned\n" and done.returncode == -signal.SIGSEGV


def test_tensors_of_torch_and_jax_are_commands(sim):
    # The free body has six dofs
    for values in (np.linspace(0, 1, 42, dtype=np.float32).reshape(7, 6), np.linspace(0, 1, 42).reshape(7, 6)):
        sim.reset()
        expected = sim.step(joint_f=values).joint_qd.copy()
        for given in (torch.from_numpy(values), jax.device_put(values)):
            sim.reset()
            rounded = expected if given.dtype.itemsize == values.itemsize else None
            found = sim.step(joint_f=given).joint_qd
            if rounded is not None:
                assert np.array_equal(found, rounded)
            else:
                assert np.allclose(found, expected, rtol=1e-6, atol=1e-9), "JAX has rounded the command to float32"
