"""Device memory of a daemon in CUDA. Alone in this package, it calls the driver, through ``cuda-bindings``.

The daemon allocates by Vulkan and exports opaque file descriptors. CUDA imports them: `Import` maps the memory, waits
for the daemon's frames, and tells the daemon when a stream is done. Sources: "External Resource Interoperability" in
NVIDIA's CUDA Driver API, ``VK_KHR_external_memory_fd`` and ``VK_KHR_external_semaphore_fd``.
"""

from __future__ import annotations

import contextlib
import os
import weakref
from collections.abc import Iterator, Sequence
from typing import Any

from tightloop.errors import GpuMemoryError
from tightloop.optional_imports import optional_import

#: ``CUDA_EXTERNAL_MEMORY_DEDICATED`` of cuda.h
_DEDICATED = 1


def driver() -> Any:
    """Return the module of the driver's functions, initialised.

    Raises:
        MissingLibrary: ``cuda-bindings`` is not installed.
        GpuMemoryError: There is no CUDA driver.
    """
    problem = "tensors on the GPU need the library `{}`: pip install cuda-bindings"
    library = optional_import("cuda.bindings.driver", problem)
    try:
        called(library, "cuInit", 0)
    except (OSError, RuntimeError) as error:
        if isinstance(error, GpuMemoryError):
            raise
        raise GpuMemoryError(f"there is no CUDA driver here: {error}; install NVIDIA's driver") from error
    return library


def called(library: Any, name: str, *arguments: Any) -> Any:
    """Call a function of the driver and return its result: nothing, a value, or a tuple.

    Raises:
        GpuMemoryError: The driver reports an error.
    """
    code, *results = getattr(library, name)(*arguments)
    if int(code):
        _, text = library.cuGetErrorString(code)
        told = text.decode() if isinstance(text, bytes) else "unknown error"
        raise GpuMemoryError(f"{name}: {told} ({int(code)})")
    return results[0] if len(results) == 1 else tuple(results) or None


def device_of(library: Any, uuid: str) -> int:
    """Return the index of the CUDA device that has a UUID, given as hexadecimal digits.

    Raises:
        GpuMemoryError: CUDA sees no such device.
    """
    seen = []
    for index in range(called(library, "cuDeviceGetCount")):
        device = called(library, "cuDeviceGet", index)
        seen.append(bytes(called(library, "cuDeviceGetUuid", device).bytes).hex())
        if seen[-1] == uuid:
            return index
    there = ", ".join(seen) or "none"
    raise GpuMemoryError(
        f"the simulation's GPU has the UUID {uuid}, and CUDA sees {there}: launch on an adapter that CUDA sees (see "
        "`tightloop devices`), and look at CUDA_VISIBLE_DEVICES"
    )


@contextlib.contextmanager
def current(library: Any, context: Any) -> Iterator[None]:
    """Make the primary context of a device, which torch and CuPy use too, that of this thread."""
    called(library, "cuCtxPushCurrent", context)
    try:
        yield
    finally:
        called(library, "cuCtxPopCurrent")


class Import:
    """Memory of a daemon, mapped, with the timelines that order the work of both.

    Args:
        there: The daemon's description of the memory: `DeviceMemory` of the protocol.
        descriptors: Of the memory, then of the timelines of frames and of commands, if any. They are taken over.

    Attributes:
        device: Index of the CUDA device.
        pointer: Address of the first byte on the device.

    Raises:
        GpuMemoryError: CUDA does not see that GPU, or refuses the import.
    """

    def __init__(self, there: dict[str, Any], descriptors: Sequence[int]) -> None:
        left = list(descriptors)
        opened: list[tuple[str, Any]] = []
        try:
            self._cuda = cuda = driver()
            self.device = device_of(cuda, there["uuid"])
            handle = called(cuda, "cuDeviceGet", self.device)
            self._context = called(cuda, "cuDevicePrimaryCtxRetain", handle)
            # nothing here may hold this object, or it would never go
            self._end = weakref.finalize(self, _close, cuda, self._context, handle, opened)
            self._end.atexit = False  # the end of the process closes all of it, after the last tensor
            with current(cuda, self._context):
                memory = self._memory(there, left)
                opened.append(("cuDestroyExternalMemory", memory))
                mapped = self._mapped(memory, there["allocated"])
                opened.append(("cuMemFree", mapped))
                self.pointer = int(mapped)
                self._timelines = []
                while left:
                    self._timelines.append(self._timeline(left))
                    opened.append(("cuDestroyExternalSemaphore", self._timelines[-1]))
        finally:
            for descriptor in left:  # what CUDA has not taken over
                os.close(descriptor)

    def _memory(self, there: dict[str, Any], descriptors: list[int]) -> Any:
        cuda = self._cuda
        wanted = cuda.CUDA_EXTERNAL_MEMORY_HANDLE_DESC()
        wanted.type = cuda.CUexternalMemoryHandleType.CU_EXTERNAL_MEMORY_HANDLE_TYPE_OPAQUE_FD
        wanted.handle.fd = descriptors[0]
        wanted.size = there["allocated"]
        wanted.flags = _DEDICATED if there["dedicated"] else 0
        memory = called(cuda, "cuImportExternalMemory", wanted)
        del descriptors[0]
        return memory

    def _mapped(self, memory: Any, size: int) -> Any:
        wanted = self._cuda.CUDA_EXTERNAL_MEMORY_BUFFER_DESC()
        wanted.offset, wanted.size, wanted.flags = 0, size, 0
        return called(self._cuda, "cuExternalMemoryGetMappedBuffer", memory, wanted)

    def _timeline(self, descriptors: list[int]) -> Any:
        cuda = self._cuda
        wanted = cuda.CUDA_EXTERNAL_SEMAPHORE_HANDLE_DESC()
        kinds = cuda.CUexternalSemaphoreHandleType
        wanted.type = kinds.CU_EXTERNAL_SEMAPHORE_HANDLE_TYPE_TIMELINE_SEMAPHORE_FD
        wanted.handle.fd = descriptors[0]
        timeline = called(cuda, "cuImportExternalSemaphore", wanted)
        del descriptors[0]
        return timeline

    def wait_for_frame(self, value: int, stream: int) -> None:
        """Let a stream wait until the daemon has written a frame."""
        if not self._timelines:
            return  # the daemon waited before it sent the frame
        wanted = self._cuda.CUDA_EXTERNAL_SEMAPHORE_WAIT_PARAMS()
        wanted.params.fence.value = value
        with current(self._cuda, self._context):
            called(self._cuda, "cuWaitExternalSemaphoresAsync", [self._timelines[0]], [wanted], 1, stream)

    def signal(self, value: int, stream: int) -> None:
        """Let the daemon's card go on once a stream has done what it was given so far."""
        if not self._timelines:
            self.synchronize(stream)
            return
        wanted = self._cuda.CUDA_EXTERNAL_SEMAPHORE_SIGNAL_PARAMS()
        wanted.params.fence.value = value
        with current(self._cuda, self._context):
            called(self._cuda, "cuSignalExternalSemaphoresAsync", [self._timelines[1]], [wanted], 1, stream)

    def synchronize(self, stream: int) -> None:
        """Wait on the host until a stream has done what it was given so far."""
        with current(self._cuda, self._context):
            called(self._cuda, "cuStreamSynchronize", stream)

    def synchronize_device(self) -> None:
        """Wait on the host until the device has done what this process gave it on any stream."""
        with current(self._cuda, self._context):
            called(self._cuda, "cuCtxSynchronize")


def _close(library: Any, context: Any, device: Any, opened: list[tuple[str, Any]]) -> None:
    """Close what an import has opened, the last first, once the device has done all of its work."""
    with current(library, context):
        called(library, "cuCtxSynchronize")
        for name, handle in reversed(opened):
            called(library, name, handle)
    called(library, "cuDevicePrimaryCtxRelease", device)
