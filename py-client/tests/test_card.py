"""Commands that a client leaves on a GPU: which are taken, where they go, in which order. The host plays the GPU."""

from __future__ import annotations

import ctypes
import json
import weakref
from typing import Any, cast

import numpy as np
import pytest

import tightloop as tl
from tightloop.gpu.card import Card
from tightloop.gpu.cuda import Import

WORLDS = 3
SLOT = 4096


class Tensor(np.ndarray):
    """An array that says that it is on a CUDA device."""

    device_type, index = 2, 0

    def __dlpack_device__(self, /) -> Any:
        return (self.device_type, self.index)


def tensor(value: Any, kind: type[Tensor] = Tensor) -> Tensor:
    return np.asarray(value).view(kind)


class OnAnotherGpu(Tensor):
    index = 1


class OnAmd(Tensor):
    device_type = 10


class OnHost:
    """Memory of the host in place of a daemon's, which notes what it is asked."""

    device = 0

    def __init__(self, size: int) -> None:
        self.bytes = ctypes.create_string_buffer(size)
        self.pointer = ctypes.addressof(self.bytes)
        self.asked: list[tuple[str, int]] = []

    def wait_for_frame(self, value: int, stream: int) -> None:
        self.asked.append(("frame", value))

    def signal(self, value: int, stream: int) -> None:
        self.asked.append(("signal", value))

    def synchronize(self, stream: int) -> None:
        self.asked.append(("stream", stream))

    def synchronize_device(self) -> None:
        self.asked.append(("device", 0))


class Library:
    """NumPy in place of torch. Copies are noted beside what the memory is asked."""

    def __init__(self, memory: OnHost) -> None:
        self.memory = memory

    def stream(self, device: int) -> int:
        return 7

    def view(self, array: Any, device: int) -> Any:
        about = array.__cuda_array_interface__
        place = (ctypes.c_byte * (array.dtype.itemsize * max(1, int(np.prod(array.shape))))).from_address(
            about["data"][0]
        )
        return np.frombuffer(place, about["typestr"], int(np.prod(array.shape))).reshape(array.shape)

    def copy(self, place: Any, value: Any) -> None:
        self.memory.asked.append(("copy", place.size))
        place[...] = value


@pytest.fixture
def memory() -> OnHost:
    return OnHost(2 * SLOT + 4096)


class Sample:
    """What keeps a frame."""


INFO = {
    "adapter": "a GPU",
    "worlds": WORLDS,
    "fields": [
        {"name": "time", "shape": [WORLDS], "dtype": "f64"},
        {"name": "body_q", "shape": [WORLDS, 2, 7], "dtype": "f32"},
    ],
    "known_fields": [
        {"name": "joint_f", "axes": "(worlds, dofs)"},
        {"name": "mocap_pos", "axes": "(worlds, mocaps, 3)"},
    ],
}
THERE = {
    "stride": SLOT,
    "offsets": [0, 64],
    "host_order": None,
    "commands": [
        {"name": "joint_f", "columns": 2, "offset": 2 * SLOT},
        {"name": "mocap_pos", "columns": 6, "offset": 2 * SLOT + 256},
    ],
}


@pytest.fixture
def card(memory: OnHost) -> Card:
    return Card(INFO, THERE, cast(Import, memory), cast(Any, Library(memory)))


def left(memory: OnHost, offset: int, columns: int) -> np.ndarray:
    """Commands as the daemon finds them, ``(worlds, columns)``."""
    return np.frombuffer(memory.bytes.raw, np.float32, WORLDS * columns, 2 * SLOT + offset).reshape(WORLDS, columns)


def test_a_field_is_where_the_daemon_writes_it_and_waits_for_it(card, memory):
    expected = np.arange(WORLDS * 14, dtype=np.float32).reshape(WORLDS, 2, 7)
    np.frombuffer(memory.bytes, np.float32, expected.size, SLOT + 64)[:] = expected.ravel()
    array = card.array("a frame", "body_q", 1, 5)
    assert memory.asked == [("frame", 5)]
    assert (array.shape, array.dtype) == ((WORLDS, 2, 7), np.float32)
    assert np.array_equal(card.view(array), expected)
    assert array.__dlpack_device__() == (2, 0)


def test_commands_are_copied_before_the_signal_and_named_by_their_bits(card, memory):
    force = np.arange(6, dtype=np.float32).reshape(WORLDS, 2)
    host = np.ones(2)
    given = {"joint_f": tensor(force), "mocap_pos": tensor(np.arange(6.0).reshape(2, 3)), "ctrl": host, "body_f": None}
    assert card.take(given) == (1, 0b11)
    # what is on the host stays
    assert given["joint_f"] is given["mocap_pos"] is given["body_f"] is None and given["ctrl"] is host
    assert [kind for kind, _ in memory.asked] == ["copy", "copy", "signal"]
    assert np.array_equal(left(memory, 0, 2), force)
    assert np.array_equal(left(memory, 256, 6), np.tile(np.arange(6.0), (WORLDS, 1)))
    # a step without any signals, too: the stream may still read frames that were dropped
    assert card.take({"joint_f": None}) == (2, 0)
    assert memory.asked[-1] == ("signal", 2)


@pytest.mark.parametrize("shape", [(WORLDS, 2, 3), (WORLDS, 6), (2, 3), (6,)])
def test_mocap_bodies_come_in_each_shape_that_arrays_of_the_host_have(card, memory, shape):
    value = np.arange(np.prod(shape), dtype=np.float64).reshape(shape)
    assert card.take({"mocap_pos": tensor(value)}) == (1, 0b10)
    assert np.array_equal(left(memory, 256, 6), np.broadcast_to(value.reshape(-1, 6), (WORLDS, 6)))


@pytest.mark.parametrize(
    ("name", "value", "problem"),
    [
        ("joint_f", tensor(np.zeros((WORLDS, 3))), r"joint_f: expected shape \(3, 2\).*got \(3, 3\)"),
        ("joint_f", tensor(np.zeros((2, 2))), r"got \(2, 2\)"),
        ("joint_f", tensor(np.zeros(())), r"got \(\)"),
        ("mocap_pos", tensor(np.zeros((WORLDS, 3, 2))), r"mocap_pos: .*got \(3, 3, 2\)"),
        ("joint_f", tensor(np.zeros((WORLDS, 2), bool)), "dtype bool is not a real number"),
        ("joint_f", tensor(np.zeros((WORLDS, 2)), OnAnotherGpu), "CUDA device 1, the simulation on cuda:0"),
        ("joint_f", tensor(np.zeros((WORLDS, 2)), OnAmd), "ROCm device 0, the simulation on cuda:0"),
        (
            "eq_active",
            tensor(np.zeros(2)),
            r"eq_active: not taken on the GPU, which takes joint_f, mocap_pos; .*cpu\(\)",
        ),
    ],
)
def test_tensors_that_are_wrong_are_refused_by_name_and_nothing_is_signalled(card, memory, name, value, problem):
    with pytest.raises(tl.CommandRefused, match=problem):
        card.take({name: value})
    assert memory.asked == []


def array_of_a_frame(card: Card) -> tuple[Any, weakref.ref[Sample]]:
    """Return an array of a frame that the array alone keeps."""
    sample = Sample()
    return card.array(sample, "body_q", 0, 1), weakref.ref(sample)


def give_commands(card: Card) -> None:
    card.take({})


@pytest.mark.parametrize("go_on", [give_commands, Card.synchronize])
def test_a_frame_that_was_dropped_goes_back_after_the_next_signal_and_not_before(card, memory, monkeypatch, go_on):
    array, frame = array_of_a_frame(card)
    go_on(card)
    # of a step in flight: the GPU may still read what is dropped now
    del array
    assert frame() is not None
    kept = []
    for name in ("signal", "synchronize"):
        monkeypatch.setattr(memory, name, lambda *_: kept.append(frame() is not None))
    go_on(card)
    assert kept == [True] and frame() is None
    # no other library had it
    assert ("device", 0) not in memory.asked


def test_a_frame_that_is_dropped_while_the_stream_is_signalled_waits_for_the_next_signal(card, memory, monkeypatch):
    held = [array_of_a_frame(card)]
    frame = held[0][1]
    with monkeypatch.context() as patched:
        patched.setattr(memory, "signal", lambda *_: held.clear())
        card.take({})
    assert frame() is not None
    card.take({})
    assert frame() is None


def test_a_signal_that_fails_gives_no_frame_back(card, memory, monkeypatch):
    array, frame = array_of_a_frame(card)
    del array

    def fail(*_: object) -> None:
        raise tl.GpuMemoryError("cuSignalExternalSemaphoresAsync: unknown error (999)")

    with monkeypatch.context() as patched:
        patched.setattr(memory, "signal", fail)
        with pytest.raises(tl.GpuMemoryError, match="999"):
            card.take({})
    assert frame() is not None
    card.take({})
    assert frame() is None


def test_a_frame_that_another_library_had_goes_back_once_the_device_is_done(card, memory, monkeypatch):
    array, frame = array_of_a_frame(card)
    array.__dlpack__()
    card.take({})
    # it may be read for long: nothing waits as long as it is there
    assert ("device", 0) not in memory.asked
    del array
    kept = []
    monkeypatch.setattr(memory, "synchronize_device", lambda: kept.append(frame() is not None))
    card.take({})
    assert kept == [True] and frame() is None
    card.take({})
    assert kept == [True], "once"


class Connection:
    """A daemon's client, which notes the card of the frames to come."""

    def __init__(self, memory: OnHost) -> None:
        self.memory, self.card = memory, cast(Any, None)
        self.problem: Exception | None = None

    def land(self) -> None:
        if self.problem is not None:
            raise self.problem

    def device_memory(self) -> tuple[str, list[int]]:
        return json.dumps(THERE), []

    def keep_on(self, card: Any) -> None:
        self.card = card


class Simulation(tl.Sim):
    def __init__(self, client: Connection) -> None:
        self.info = INFO
        self._client = cast(Any, client)


def test_a_second_card_that_fails_leaves_frames_without_tensors_until_one_succeeds(memory, monkeypatch):
    problem: Exception | None = None

    def mapped(there: dict[str, Any], descriptors: list[int]) -> OnHost:
        if problem is not None:
            raise problem
        return memory

    monkeypatch.setattr("tightloop.gpu.card.array_library", lambda: Library(memory))
    monkeypatch.setattr("tightloop.gpu.card.driver", lambda: None)
    monkeypatch.setattr("tightloop.gpu.card.Import", mapped)
    client = Connection(memory)
    sim = Simulation(client)
    first = sim.keep_on_gpu()
    assert client.card is sim._card is first
    # the daemon was not asked: it still writes what the card maps
    client.problem = tl.CommandRefused("a step is in flight")
    with pytest.raises(tl.CommandRefused, match="in flight"):
        sim.keep_on_gpu()
    assert client.card is sim._card is first
    client.problem, problem = None, tl.GpuMemoryError("cuImportExternalMemory: out of memory (2)")
    with pytest.raises(tl.GpuMemoryError, match="out of memory"):
        sim.keep_on_gpu()
    assert sim._card is None
    for method in (client.card.array, client.card.torch):
        with pytest.raises(tl.GpuMemoryError, match=r"the last `sim.keep_on_gpu\(\)` failed: call it again"):
            method(Sample(), "body_q", 0, 1)
    client.card.synchronize()
    problem = None
    assert sim.keep_on_gpu() is client.card is sim._card
    assert client.card is not first
