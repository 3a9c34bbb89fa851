"""Frames and commands on the GPU of a simulation, for this process's torch, CuPy or JAX.

Each frame that a client holds has a slot in device memory. The daemon writes it when it writes the frame, and gives it
to another frame only after this client dropped it. Commands have a place of their own there.

Before each command the client signals that its stream has done what it was given so far: reading dropped frames, and
writing commands. The daemon's card waits for that. Frames whose arrays were dropped go back to the daemon after the
signal: work that was queued between two signals may still read them.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np

from tightloop import system
from tightloop.errors import CommandRefused, GpuMemoryError
from tightloop.gpu.array_libraries import ArrayLibrary, Torch, array_library, check_array, gpu_of
from tightloop.gpu.cuda import Import, driver

#: Types of fields, as the daemon and as NumPy name them
_NUMPY = {"f32": "<f4", "f64": "<f8", "i32": "<i4", "u32": "<u4", "u64": "<u8", "u8": "|u1"}


class CardArray:
    """An array in device memory, ``(worlds, …)``, row-major. It keeps its frame, or the commands' memory, alive.

    It has ``__cuda_array_interface__`` and ``__dlpack__``, so that ``cupy.asarray`` and ``jax.dlpack.from_dlpack`` copy
    nothing. Do not write to an array of a frame.
    """

    def __init__(self, card: Card, owner: Any, address: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self._card, self._owner, self._is_lent = card, owner, False
        self.shape, self.dtype = shape, dtype
        size = int(np.prod(shape, dtype=np.int64))
        self.__cuda_array_interface__ = {
            "version": 3,
            "shape": shape,
            "typestr": dtype.str,
            "data": (address if size else 0, False),
            "strides": None,
            "stream": None,
        }

    def __del__(self) -> None:
        # the GPU may still read a frame: the card gives it back
        if self._owner is not None:
            self._card._dropped.append((self._owner, self._is_lent))

    def __dlpack__(self, **options: Any) -> Any:
        self._is_lent = True
        return self._card.view(self).__dlpack__(**options)

    def __dlpack_device__(self) -> tuple[int, int]:
        return (2, self._card.device)  # kDLCUDA


class Card:
    """Memory of a simulation's GPU in this process.

    Args:
        info: The daemon's description.
        there: Its description of the memory.
        memory: The memory in CUDA.
        library: Library of the arrays.

    Attributes:
        device: Index of the CUDA device.
        order: How the work of both processes is ordered: ``"timelines"`` on the card, or ``"host: …"`` with the reason.
    """

    def __init__(
        self, info: Mapping[str, Any], there: Mapping[str, Any], memory: Import, library: ArrayLibrary
    ) -> None:
        self._memory, self._library = memory, library
        self._worlds: int = info["worlds"]
        self._stride: int = there["stride"]
        self._fields = {
            field["name"]: (offset, tuple(field["shape"]), np.dtype(_NUMPY[field["dtype"]]))
            # images of cameras come last, and are in the memory of the host alone
            for field, offset in zip(info["fields"], there["offsets"], strict=False)
        }
        self._parts = {field["name"]: _parts(field["axes"]) for field in info["known_fields"]}
        self._commands = {place["name"]: (1 << bit, place) for bit, place in enumerate(there["commands"])}
        self._ready = 0
        # what keeps each frame whose array was dropped, and whether another library had it
        self._dropped: list[tuple[Any, bool]] = []
        self.device = memory.device
        self.order = "timelines" if there["host_order"] is None else f"host: {there['host_order']}"

    def view(self, array: CardArray) -> Any:
        """Return an array of torch or CuPy over the same memory."""
        return self._library.view(array, self.device)

    def array(self, sample: Any, name: str, slot: int, done: int) -> CardArray:
        """Return a field of the frame in a slot, once the daemon has written it.

        Args:
            sample: What keeps the frame.
            name: The field.
            slot: The slot.
            done: Value of the timeline of frames then.
        """
        if name not in self._fields:
            raise GpuMemoryError(
                f"`{name}` is drawn by the CPU, and is not on the GPU: copy it with `frame.{name}.copy()`"
            )
        self._memory.wait_for_frame(done, self._stream())
        offset, shape, dtype = self._fields[name]
        return CardArray(self, sample, self._memory.pointer + slot * self._stride + offset, shape, dtype)

    def torch(self, sample: Any, name: str, slot: int, done: int) -> Any:
        """Return a field of the frame in a slot as a tensor of torch; the arguments are those of `array`."""
        library = self._library if isinstance(self._library, Torch) else Torch()
        return library.view(self.array(sample, name, slot, done), self.device)

    def take(self, given: dict[str, Any]) -> tuple[int, int]:
        """Take the commands that are on the GPU out of a dict of commands by name, and leave them to the daemon.

        Returns:
            The value that the daemon's card waits for, and a bit for each command.

        Raises:
            CommandRefused: A tensor has a wrong shape or dtype, is elsewhere, or is of a command of the host.
        """
        left = 0
        for name, value in given.items():
            if value is None or gpu_of(value) is None:
                continue
            if name not in self._commands:
                taken = ", ".join(self._commands)
                raise CommandRefused(f"{name}: not taken on the GPU, which takes {taken}; give {name}.cpu()")
            bit, place = self._commands[name]
            columns = place["columns"]
            # mocap bodies come as (…, mocaps, 3), and lie in a row
            width = self._parts[name]
            is_apart = width > 1 and tuple(value.shape[-2:]) == (columns // width, width)
            flat = value.reshape(*value.shape[:-2], columns) if is_apart else value
            check_array(name, flat, self._worlds, columns, self.device)
            shape = (self._worlds, columns)
            address = self._memory.pointer + place["offset"]
            self._library.copy(self.view(CardArray(self, None, address, shape, np.dtype(np.float32))), flat)
            given[name] = None
            left |= bit
        dropped = len(self._dropped)
        self._ready += 1
        self._memory.signal(self._ready, self._stream())
        self._give_back(dropped)
        return self._ready, left

    def synchronize(self) -> None:
        """Wait until this process's stream has done what it was given so far."""
        dropped = len(self._dropped)
        self._memory.synchronize(self._stream())
        self._give_back(dropped)

    def _give_back(self, count: int) -> None:
        """Give the daemon the frames that were dropped first, which no work queued from now on reads."""
        # JAX reads on streams of its own, which no signal covers
        if any(is_lent for _, is_lent in self._dropped[:count]):
            self._memory.synchronize_device()
        del self._dropped[:count]

    def _stream(self) -> int:
        return self._library.stream(self.device)


def _parts(axes: str) -> int:
    """Return the columns of each entry of a command, of axes such as ``(worlds, mocaps, 3)``."""
    last = axes.strip("()").split(", ")[2:]
    return int(last[0]) if last and last[0].isdecimal() else 1


class NoCard:
    """In place of a card while the daemon has memory that this process could not map."""

    def synchronize(self) -> None:
        """Do nothing: this process's GPU reads no frame in that memory."""

    def array(self, *_: Any) -> Any:
        """Raise `GpuMemoryError`."""
        raise GpuMemoryError(
            "this frame is not on a GPU that this process sees, since the last `sim.keep_on_gpu()` failed: call it "
            "again, and take the tensors of frames that come after it"
        )

    torch = array


def library_for(info: Mapping[str, Any]) -> ArrayLibrary:
    """Return the array library for frames on the GPU of a simulation, given its `Sim.info`.

    Raises:
        GpuMemoryError: The worlds are on the CPU, CUDA is not there, or the system is not Linux.
        MissingLibrary: ``cuda-bindings``, or both torch and CuPy, are not installed.
    """
    if not system.shares_gpu_memory():
        raise GpuMemoryError(
            "keep_on_gpu: processes share GPU memory on Linux only; read frames as NumPy arrays, or run on Linux"
        )
    if not info["adapter"]:
        raise GpuMemoryError('keep_on_gpu: the worlds are on the CPU; launch with device="gpu"')
    library = array_library()
    driver()  # before the daemon takes memory
    return library


def open_card(info: Mapping[str, Any], client: Any, library: ArrayLibrary) -> Card:
    """Map the daemon's device memory, and let the client keep frames there.

    Args:
        info: `Sim.info`.
        client: The compiled client of the simulation, which is in a layer above.
        library: The array library of the frames.

    Raises:
        GpuMemoryError: The driver exports no memory, or CUDA does not see that GPU.
    """
    client.keep_on(NoCard())
    text, descriptors = client.device_memory()
    there = json.loads(text)
    card = Card(info, there, Import(there, descriptors), library)
    client.keep_on(card)
    return card
