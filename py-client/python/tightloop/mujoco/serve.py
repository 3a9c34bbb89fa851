"""Files of MuJoCo models for the command line: ``tightloop serve robot.xml`` and ``tightloop inspect robot.xml``."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def scene_file(path: str) -> str:
    """Return the scene file of an MJCF file, beside the exported model in the user's cache.

    Raises:
        SystemExit: The model cannot be read; the message says why.
    """
    from tightloop.scene import Scene
    from tightloop.whole_files import whole_file

    with _said():
        scene = Scene.from_mujoco(path)
        (model,) = scene.models.values()
        file = Path(model.file).with_suffix(f".{model.name}.toml")
        with whole_file(file) as part:
            part.write_text(scene.to_toml())
    return str(file)


def exported_file(path: str) -> str:
    """Return the exported model of an MJCF file, in the user's cache; the model may have what is not supported.

    Raises:
        SystemExit: MuJoCo cannot compile it; the message says why.
    """
    from tightloop.mujoco import export

    with _said():
        return str(export.cached(path))


@contextmanager
def _said() -> Iterator[None]:
    """Print an error and end the process with exit code 1."""
    from tightloop.errors import TightloopError

    try:
        yield
    except TightloopError as error:
        print(f"tightloop: {error}", file=sys.stderr)
        raise SystemExit(1) from None
