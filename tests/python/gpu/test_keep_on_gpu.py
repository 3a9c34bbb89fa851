"""Frames and commands on a GPU, as far as a machine without NVIDIA's driver shows: what is missing is named.

The memory itself is tested by ``tests/protocol/on_device.rs``, where a second process imports it by Vulkan.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import tightloop as tl

WORLDS = 5


class Mapped:
    """In place of an import by CUDA, which maps no memory of the software driver."""

    device, pointer = 0, 0

    def __init__(self, there: dict[str, Any], descriptors: list[int]) -> None:
        for descriptor in descriptors:
            os.close(descriptor)

    def wait_for_frame(self, *_: object) -> None: ...
    def signal(self, *_: object) -> None: ...
    def synchronize(self, *_: object) -> None: ...


class OnGpu:
    """What torch's tensors on a GPU do when NumPy asks for them."""

    shape, ndim, dtype = (WORLDS, 2), 2, "float32"

    def __array__(self, *_: object, **__: object) -> np.ndarray:
        raise TypeError("can't convert cuda:0 device type tensor to numpy")

    def __dlpack_device__(self) -> tuple[int, int]:
        return (2, 0)


@pytest.fixture
def on_gpu(pendulum):
    with tl.launch(pendulum, worlds=WORLDS, device="gpu:0") as sim:
        yield sim


@pytest.fixture
def torch(monkeypatch):
    """What is asked of torch before there is a GPU; torch itself may not be installed."""
    stand_in = SimpleNamespace(version=SimpleNamespace(hip=None))
    monkeypatch.setitem(sys.modules, "torch", stand_in)
    return stand_in


@pytest.fixture
def mapped(monkeypatch):
    """Imports of memory, all of which succeed."""
    monkeypatch.setattr("tightloop.gpu.card.driver", lambda: None)
    monkeypatch.setattr("tightloop.gpu.card.array_library", lambda: SimpleNamespace(stream=lambda device: 0))
    monkeypatch.setattr("tightloop.gpu.card.Import", Mapped)
    return monkeypatch


def descriptors_open() -> int:
    return len([*Path("/proc/self/fd").iterdir()])


def test_worlds_on_the_cpu_are_named(pendulum):
    with tl.launch(pendulum, worlds=WORLDS, device="cpu") as sim:
        with pytest.raises(tl.GpuMemoryError, match='on the CPU; launch with device="gpu"'):
            sim.keep_on_gpu()
        with pytest.raises(tl.GpuMemoryError, match='on the CPU; launch with device="gpu"'):
            sim._client.device_memory()
        assert sim.step().step.tolist() == [1] * WORLDS


def test_a_gpu_that_cuda_does_not_see_is_named_and_the_simulation_continues(on_gpu, torch):
    # the software driver is no device of CUDA, whether there is one or not; its library may not be installed
    before = descriptors_open()
    with pytest.raises((tl.GpuMemoryError, tl.MissingLibrary), match=r"CUDA|cuda-bindings"):
        on_gpu.keep_on_gpu()
    assert descriptors_open() == before
    frame = on_gpu.step(joint_f=[0.5, 0.1])
    assert frame.step.tolist() == [1] * WORLDS
    with pytest.raises(tl.GpuMemoryError, match=r"sim\.keep_on_gpu\(\)"):
        frame.torch("joint_q")
    with pytest.raises(tl.GpuMemoryError, match=r"sim\.keep_on_gpu\(\)"):
        frame.cuda("joint_q")
    with pytest.raises(tl.UnknownField, match="joint_qq"):
        frame.torch("joint_qq")


def test_after_a_second_call_that_fails_later_frames_have_no_tensors_and_say_why(on_gpu, mapped):
    on_gpu.keep_on_gpu()
    earlier = on_gpu.step()
    with mapped.context() as failing:

        def fail(there: dict[str, Any], descriptors: list[int]) -> None:
            Mapped(there, descriptors)
            raise tl.GpuMemoryError("cuImportExternalMemory: out of memory (2)")

        failing.setattr("tightloop.gpu.card.Import", fail)
        with pytest.raises(tl.GpuMemoryError, match="out of memory"):
            on_gpu.keep_on_gpu()
    for frame in (on_gpu.step(), on_gpu.reset()):
        for method in (frame.cuda, frame.torch):
            with pytest.raises(tl.GpuMemoryError, match=r"the last `sim.keep_on_gpu\(\)` failed: call it again"):
                method("joint_q")
    assert earlier.cuda("joint_q").shape == (WORLDS, 2)
    on_gpu.keep_on_gpu()
    assert on_gpu.step().cuda("joint_q").shape == (WORLDS, 2)


def test_frames_whose_arrays_were_dropped_go_back_with_the_next_command(pendulum, mapped):
    with tl.launch(pendulum, worlds=WORLDS, device="gpu:0", frames_held=1) as sim:
        sim.keep_on_gpu()
        for command in (sim.step, sim.reset, sim.forward) * 2:
            frame = command()
            array = frame.cuda("joint_q")
            del frame
            # a command that is refused leaves the array its frame
            with pytest.raises(tl.FramesHeld):
                command()
            del array


@pytest.mark.parametrize(
    ("missing", "cure"),
    [(("cuda.bindings.driver",), "pip install cuda-bindings"), (("torch", "cupy"), "pip install cupy")],
)
def test_a_library_that_is_missing_is_named(on_gpu, torch, monkeypatch, missing, cure):
    for module in missing:
        monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(tl.MissingLibrary, match=cure):
        on_gpu.keep_on_gpu()


def test_a_torch_for_rocm_is_refused_by_name(on_gpu, torch):
    torch.version.hip = "6.4"
    with pytest.raises(tl.GpuMemoryError, match="hipImportExternalMemory"):
        on_gpu.keep_on_gpu()


def test_a_tensor_on_a_gpu_is_refused_with_the_cure(on_gpu):
    with pytest.raises(tl.CommandRefused, match=r"joint_f is on a GPU.*sim.keep_on_gpu()"):
        on_gpu.step(joint_f=OnGpu())
    with pytest.raises(tl.CommandRefused, match=r"joint_q is on a GPU.*tensor.cpu()"):
        on_gpu.write(joint_q=OnGpu())


def test_descriptors_come_with_the_places_of_fields_and_commands(on_gpu):
    before = descriptors_open()
    text, descriptors = on_gpu._client.device_memory()
    there = json.loads(text)
    assert len(descriptors) == (1 if there["host_order"] else 3)
    assert descriptors_open() == before + len(descriptors)
    assert os.fstat(descriptors[0]).st_size >= there["allocated"]
    for descriptor in descriptors:
        os.close(descriptor)
    sizes = [np.prod(field["shape"]) * 4 for field in on_gpu.info["fields"]]
    assert there["stride"] >= max(offset + size for offset, size in zip(there["offsets"], sizes, strict=True))
    names = [command["name"] for command in there["commands"]]
    assert names == ["joint_f", "joint_target_q", "joint_target_qd"]
    last = there["commands"][-1]
    assert last["offset"] + 4 * WORLDS * last["columns"] <= there["allocated"]
