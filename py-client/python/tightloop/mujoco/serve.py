"""Scene files of MuJoCo models, for ``tightloop serve robot.xml``."""

from __future__ import annotations

import sys
from pathlib import Path


def scene_file(path: str) -> str:
    """Return the scene file of an MJCF file, beside the exported model in the user's cache.

    Raises:
        SystemExit: The model cannot be read; the message says why.
    """
    from tightloop.errors import TightloopError
    from tightloop.scene import Scene

    try:
        scene = Scene.from_mujoco(path)
        (model,) = scene.models.values()
        file = Path(model.file).with_suffix(f".{model.name}.toml")
        file.write_text(scene.to_toml())
    except TightloopError as error:
        print(f"tightloop: {error}", file=sys.stderr)
        raise SystemExit(1) from None
    return str(file)
