"""Height fields of a scene: checking elevations, and keeping them in files that daemons and recordings refer to."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.errors import SceneError
from tightloop.files import cache as cache_files
from tightloop.files import named as named_files
from tightloop.whole_files import whole_file

#: Most elevations of a field; `sim-core/model/src/geometry/height_field.rs` has the same limit.
SAMPLES_MAX = 1 << 24
#: Most bytes of a file: its elevations in double precision, and a head.
_FILE_MAX = 8 * SAMPLES_MAX + (1 << 16)


def elevations(what: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return elevations [m] as float64, shape ``(rows, columns)``.

    Raises:
        SceneError: They are no array with two axes, too few or too many, or not finite.
    """
    # what is too large is not converted to find out
    _check_shape(what, getattr(values, "shape", None))
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{what} is {type(values).__name__}; give an array of elevations, or a .npy file") from None
    _check_shape(what, array.shape)
    if not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise SceneError(f"{what} is {array[place]} at {place}; give finite elevations [m]")
    return np.ascontiguousarray(array)


def _check_shape(what: str, shape: tuple[int, ...] | None) -> None:
    if shape is None:
        return
    if len(shape) != 2 or min(shape) < 2:
        raise SceneError(f"{what} has shape {shape}; give (rows, columns), at least two of each")
    if shape[0] * shape[1] > SAMPLES_MAX:
        count = shape[0] * shape[1]
        raise SceneError(f"{what} has {count} elevations, more than {SAMPLES_MAX}; make it coarser or smaller")


def checked(what: str, path: Path) -> Path:
    """Return the path of a ``.npy`` file of elevations.

    Raises:
        SceneError: The file cannot be read, or has no such elevations.
    """
    try:
        with named_files.opened("a file that numpy.save wrote", path, SceneError, limit=_FILE_MAX) as file:
            array = np.load(file, allow_pickle=False)
    except (OSError, ValueError, EOFError, MemoryError, BadZipFile) as error:
        raise SceneError(f"{what}: {path}: {error}; give a file that numpy.save wrote") from None
    if not isinstance(array, np.ndarray):
        raise SceneError(f"{what}: {path} has several arrays; give a file that numpy.save wrote")
    if array.dtype not in (np.dtype("<f4"), np.dtype("<f8")) or not array.flags.c_contiguous:
        raise SceneError(f"{what}: {path} has {array.dtype}; save elevations as float32 or float64, in C order")
    elevations(f"{what}: {path}", array)
    return path


def cached(array: NDArray[np.float64]) -> Path:
    """Write elevations to a file in the user's cache, named by their content, and return the file.

    Raises:
        SceneError: The file cannot be written.
    """

    def write(part: Path) -> None:
        with part.open("wb") as file:
            np.save(file, array)

    digest = hashlib.sha256(str(array.shape).encode() + array.tobytes()).hexdigest()
    return cache_files.keep("height_fields", f"{digest[:32]}.npy", write)


def keep_beside(scene_file: Path, name: str, source: Path) -> Path:
    """Copy the file of a height field into a folder beside a scene file, and return the copy."""
    folder = scene_file.parent / f"{scene_file.stem}_fields"
    kept = folder / f"{name}.npy"
    try:
        folder.mkdir(exist_ok=True)
        if not (kept.exists() and kept.samefile(source)):
            with whole_file(kept) as part:
                shutil.copyfile(source, part)
    except OSError as error:
        raise SceneError(f"save: height field `{name}` cannot be written to {kept}: {error}") from error
    return kept
