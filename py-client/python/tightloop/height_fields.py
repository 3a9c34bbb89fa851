"""Height fields of a scene: checking elevations, and keeping them in files that daemons and recordings refer to."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tightloop.errors import SceneError
from tightloop.mujoco.export import cache_folder
from tightloop.whole_files import whole_file


def elevations(what: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return elevations [m] as float64, shape ``(rows, columns)``.

    Raises:
        SceneError: They are no array with two axes, too few, or not finite.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise SceneError(f"{what} is {type(values).__name__}; give an array of elevations, or a .npy file") from None
    if array.ndim != 2 or min(array.shape) < 2:
        raise SceneError(f"{what} has shape {array.shape}; give (rows, columns), at least two of each")
    if not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise SceneError(f"{what} is {array[place]} at {place}; give finite elevations [m]")
    return np.ascontiguousarray(array)


def checked(what: str, path: Path) -> Path:
    """Return the path of a ``.npy`` file of elevations.

    Raises:
        SceneError: The file cannot be read, or has no such elevations.
    """
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (OSError, ValueError) as error:
        raise SceneError(f"{what}: {path}: {error}; give a file that numpy.save wrote") from None
    if array.dtype not in (np.dtype("<f4"), np.dtype("<f8")) or not array.flags.c_contiguous:
        raise SceneError(f"{what}: {path} has {array.dtype}; save elevations as float32 or float64, in C order")
    elevations(f"{what}: {path}", array)
    return path


def cached(array: NDArray[np.float64]) -> Path:
    """Write elevations to a file in the user's cache, named by their content, and return the file.

    The file stays, because recordings and running daemons refer to it.
    """
    digest = hashlib.sha256(str(array.shape).encode() + array.tobytes()).hexdigest()
    folder = cache_folder().with_name("height_fields")
    path = folder / f"{digest[:32]}.npy"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if not path.is_file():
            _save(path, array)
    except OSError as error:
        message = f"{folder}: elevations cannot be kept there: {error}; set XDG_CACHE_HOME to a folder"
        raise SceneError(message) from error
    return path


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


def _save(path: Path, array: NDArray[Any]) -> None:
    # another process may write the same file
    with whole_file(path) as part, part.open("wb") as file:
        np.save(file, array)
