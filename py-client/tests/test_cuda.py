"""Imports of device memory through CUDA's driver, which a stand-in plays: what it is asked, and what is closed."""

from __future__ import annotations

import gc
import os
import sys
from types import SimpleNamespace
from typing import Any
from unittest.mock import MagicMock, call

import pytest

import tightloop as tl
from tightloop.gpu.cuda import Import, driver

UUID = bytes(range(16))
THERE = {"uuid": UUID.hex(), "allocated": 8192, "dedicated": True}
RESULTS = {
    "cuCtxPopCurrent": "context",
    "cuDeviceGet": "device",
    "cuDeviceGetCount": 1,
    "cuDeviceGetUuid": SimpleNamespace(bytes=UUID),
    "cuDevicePrimaryCtxRetain": "context",
    "cuExternalMemoryGetMappedBuffer": 4096,
    "cuImportExternalMemory": "memory",
    "cuImportExternalSemaphore": "timeline",
}
ASKED = (
    "cuCtxPushCurrent cuCtxSynchronize cuDestroyExternalMemory cuDestroyExternalSemaphore cuDevicePrimaryCtxRelease "
    "cuInit cuMemFree cuSignalExternalSemaphoresAsync cuStreamSynchronize cuWaitExternalSemaphoresAsync"
).split()


def stand_in(fails: str = "") -> MagicMock:
    """Return a driver with one device; a call of one name fails."""
    cuda = MagicMock()
    for name in (*RESULTS, *ASKED):
        results = (RESULTS[name],) if name in RESULTS else ()
        getattr(cuda, name).return_value = (2,) if name == fails else (0, *results)
    cuda.cuGetErrorString.return_value = (0, b"out of memory")
    return cuda


@pytest.fixture
def cuda(monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> MagicMock:
    made = stand_in(getattr(request, "param", ""))
    monkeypatch.setitem(sys.modules, "cuda.bindings.driver", made)
    return made


@pytest.fixture
def descriptors() -> Any:
    """Three of them; those that are left open are closed."""
    opened = [os.open("/dev/null", os.O_RDONLY) for _ in range(3)]
    yield opened
    for descriptor in filter(is_open, opened):
        os.close(descriptor)


def is_open(descriptor: int) -> bool:
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True


def closing(cuda: MagicMock) -> list[Any]:
    """Return the calls that close something."""
    return [one for one in cuda.mock_calls if "Destroy" in one[0] or "Free" in one[0] or "Release" in one[0]]


def test_memory_and_timelines_are_mapped_and_closed_in_the_other_order(cuda, descriptors):
    imported = Import(THERE, descriptors)
    assert (imported.device, imported.pointer) == (0, 4096)
    wanted = cuda.cuImportExternalMemory.call_args.args[0]
    assert (wanted.size, wanted.flags, wanted.handle.fd) == (8192, 1, descriptors[0])
    assert cuda.cuImportExternalSemaphore.call_count == 2
    # CUDA took them over: they are not ours to close
    assert all(map(is_open, descriptors))
    imported.wait_for_frame(5, 7)
    ((timeline,), (wanted,), count, stream) = cuda.cuWaitExternalSemaphoresAsync.call_args.args
    assert (timeline, wanted.params.fence.value, count, stream) == ("timeline", 5, 1, 7)
    imported.signal(6, 7)
    assert cuda.cuSignalExternalSemaphoresAsync.call_args.args[1][0].params.fence.value == 6
    assert not cuda.cuStreamSynchronize.called and closing(cuda) == []
    assert not cuda.cuCtxSynchronize.called
    imported.synchronize_device()
    assert cuda.cuCtxSynchronize.call_count == 1
    del imported
    timelines = [call.cuDestroyExternalSemaphore("timeline")] * 2
    memory = [call.cuMemFree(4096), call.cuDestroyExternalMemory("memory")]
    assert closing(cuda) == [*timelines, *memory, call.cuDevicePrimaryCtxRelease("device")]
    assert cuda.cuCtxPushCurrent.call_count == cuda.cuCtxPopCurrent.call_count


def test_without_timelines_a_step_waits_for_the_stream_and_a_frame_for_nothing(cuda, descriptors):
    imported = Import(THERE, descriptors[:1])
    imported.wait_for_frame(5, 7)
    assert not cuda.cuWaitExternalSemaphoresAsync.called and not cuda.cuStreamSynchronize.called
    imported.signal(6, 7)
    assert cuda.cuStreamSynchronize.mock_calls == [call(7)]


@pytest.mark.parametrize(
    ("cuda", "taken", "closed"),
    [
        ("cuDeviceGetCount", 0, []),
        ("cuImportExternalMemory", 0, ["cuDevicePrimaryCtxRelease"]),
        ("cuExternalMemoryGetMappedBuffer", 1, ["cuDestroyExternalMemory", "cuDevicePrimaryCtxRelease"]),
        ("cuImportExternalSemaphore", 1, ["cuMemFree", "cuDestroyExternalMemory", "cuDevicePrimaryCtxRelease"]),
    ],
    indirect=["cuda"],
)
def test_an_import_that_fails_is_named_and_leaves_nothing_open(cuda, descriptors, taken, closed, request):
    with pytest.raises(tl.GpuMemoryError, match=rf"{request.node.callspec.params['cuda']}: out of memory \(2\)"):
        Import(THERE, descriptors)
    assert [is_open(descriptor) for descriptor in descriptors] == [place < taken for place in range(3)]
    gc.collect()
    assert [name for name, *_ in closing(cuda)] == closed


def test_a_gpu_that_cuda_does_not_see_is_named_with_those_that_it_sees(cuda, descriptors):
    with pytest.raises(
        tl.GpuMemoryError, match=f"UUID {'ff' * 16}, and CUDA sees {UUID.hex()}: .*CUDA_VISIBLE_DEVICES"
    ):
        Import(THERE | {"uuid": "ff" * 16}, descriptors)
    assert not any(map(is_open, descriptors)) and closing(cuda) == []


def test_a_machine_without_cudas_driver_is_named(cuda):
    cuda.cuInit.side_effect = RuntimeError('"cuda" is an NVIDIA driver library')
    with pytest.raises(tl.GpuMemoryError, match=r"there is no CUDA driver here: .*; install NVIDIA's driver"):
        driver()
