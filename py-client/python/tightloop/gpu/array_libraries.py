"""What torch and CuPy each call arrays of a GPU: views, the current stream, copies."""

from __future__ import annotations

from typing import Any, Protocol

from tightloop.errors import CommandRefused, GpuMemoryError, MissingLibrary
from tightloop.optional_imports import optional_import

#: ``kDLCUDA``, ``kDLROCM`` and ``kDLCUDAManaged`` of dlpack.h: memory that the processor does not read
_ON_GPU = {2: "CUDA", 10: "ROCm", 13: "CUDA"}


class ArrayLibrary(Protocol):
    """A library with arrays on a GPU."""

    def stream(self, device: int) -> int:
        """Return the handle of its current stream on a device."""
        ...

    def view(self, array: Any, device: int) -> Any:
        """Return an array of this library over the memory of another with ``__cuda_array_interface__``."""
        ...

    def copy(self, place: Any, value: Any) -> None:
        """Copy any array on the same device into a view, on the current stream."""
        ...


class Torch:
    """Arrays of torch."""

    def __init__(self) -> None:
        self._torch = optional_import("torch", "tensors on the GPU need the library `{}`: pip install torch")
        if getattr(self._torch.version, "hip", None):
            raise GpuMemoryError(
                "this torch computes on AMD cards through ROCm, and tightloop imports memory only through CUDA; ROCm's "
                "hipImportExternalMemory is not called yet. Use the arrays of frames, such as frame.joint_q"
            )

    def stream(self, device: int) -> int:
        return int(self._torch.cuda.current_stream(device).cuda_stream)

    def view(self, array: Any, device: int) -> Any:
        return self._torch.as_tensor(array, device=f"cuda:{device}")

    def copy(self, place: Any, value: Any) -> None:
        torch = self._torch
        tensor = value if isinstance(value, torch.Tensor) else torch.from_dlpack(value)
        with torch.no_grad():
            place.copy_(tensor)


class Cupy:
    """Arrays of CuPy."""

    def __init__(self) -> None:
        self._cupy = optional_import(
            "cupy", "arrays on the GPU need torch or the library `{}`: pip install cupy-cuda12x"
        )

    def stream(self, device: int) -> int:
        with self._cupy.cuda.Device(device):
            return int(self._cupy.cuda.get_current_stream().ptr)

    def view(self, array: Any, device: int) -> Any:
        with self._cupy.cuda.Device(device):
            return self._cupy.asarray(array)

    def copy(self, place: Any, value: Any) -> None:
        with place.device:
            place[...] = self._cupy.from_dlpack(value)


def array_library() -> ArrayLibrary:
    """Return torch, or CuPy where torch is not installed.

    Raises:
        MissingLibrary: None of them is installed.
        GpuMemoryError: torch computes on cards of another maker.
    """
    try:
        return Torch()
    except MissingLibrary:
        return Cupy()


def gpu_of(value: Any) -> tuple[str, int] | None:
    """Return the platform and the index of the GPU that holds an array, or None of anything else."""
    asked = getattr(value, "__dlpack_device__", None)
    if asked is None:
        return None
    kind, index = asked()
    return (_ON_GPU[int(kind)], int(index)) if int(kind) in _ON_GPU else None


def check_array(name: str, value: Any, worlds: int, columns: int, device: int) -> None:
    """Check an array on a GPU that is to be a command.

    Raises:
        CommandRefused: Another GPU holds it, or its shape or dtype is wrong.
    """
    platform, index = gpu_of(value) or ("", -1)
    if (platform, index) != ("CUDA", device):
        raise CommandRefused(f"{name}: the tensor is on {platform} device {index}, the simulation on cuda:{device}")
    shape = tuple(value.shape)
    if shape not in ((worlds, columns), (columns,)):
        expected = f"expected shape {(worlds, columns)}, or {(columns,)} for all worlds"
        raise CommandRefused(f"{name}: {expected}; got {shape}")
    if "bool" in str(value.dtype) or "complex" in str(value.dtype):
        raise CommandRefused(f"{name}: dtype {value.dtype} is not a real number; give float32")
