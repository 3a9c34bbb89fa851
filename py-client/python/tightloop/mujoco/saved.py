"""Arrays of exported models, read without MuJoCo and without the package safetensors."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.errors import SceneError
from tightloop.files import named as named_files
from tightloop.mujoco.texts import texts

# as sim-model's reader of these files, and as safetensors [bytes]
_FILE_MAX, _HEADER_MAX = 1 << 31, 100_000_000
_TYPES = {"F64": np.float64, "I32": np.int32, "U8": np.uint8}


def read(path: str | os.PathLike[str], names: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Return arrays of an exported file by their names; those that it lacks are left out.

    Args:
        path: The file, as `tightloop.mujoco.export` writes it.
        names: Names of arrays.

    Raises:
        SceneError: The file cannot be read.
    """
    found = {}
    try:
        with named_files.opened("an exported model", Path(path), SceneError, limit=_FILE_MAX) as file:
            length = int.from_bytes(file.read(8), "little")
            if length > _HEADER_MAX:
                raise ValueError(f"a header of {length} bytes")
            header = json.loads(file.read(length))
            for name in names:
                if name in header:
                    entry = header[name]
                    first, end = entry["data_offsets"]
                    file.seek(8 + length + first)
                    found[name] = np.frombuffer(file.read(end - first), _TYPES[entry["dtype"]]).reshape(entry["shape"])
    except SceneError:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SceneError(f"{os.fspath(path)}: is no exported model; save the scene again: {error}") from error
    return found


def kinds(found: dict[str, NDArray[Any]], name: str) -> list[str]:
    """Return the members of an enumeration, such as ``mjWRAP_SITE``, that an array and its names stand for."""
    members = texts(found[f"{name}.names"])
    return [members[place] for place in found[name].ravel()]
