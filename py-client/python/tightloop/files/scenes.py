"""Scenes of robot files, for the command line: ``serve``, ``bench`` and ``demo`` take any URDF or MJCF file."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from tightloop.files.kinds import element_of

if TYPE_CHECKING:
    from tightloop.scene.scene import Scene

_ROBOT_ENDINGS = (".urdf", ".xacro")
# Drives of a robot from URDF follow their targets with this natural frequency [rad/s], critically damped.
_FREQUENCY = 30.0


def kind_of(path: Path) -> str | None:
    """Return ``"mujoco"`` or ``"robot"``, what an MJCF or URDF file begins or is named as; None for other files."""
    element = element_of(path)
    # the reader of URDF says what is wrong with any other
    is_robot = path.suffix.lower() in _ROBOT_ENDINGS and path.is_file()
    return element if element in ("mujoco", "robot") else "robot" if is_robot else None


def scene_of(path: Path) -> Scene:
    """Return the scene of a scene file, or one with sensible defaults for a robot file.

    A robot from URDF is fixed at its root link, and its drives hold its start: zero, or the middle of a joint's range
    that does not contain zero. A MuJoCo model has its own options and actuators.

    Raises:
        SceneError: The file cannot be used.
    """
    from tightloop.scene.scene import Scene

    kind = kind_of(path)
    if kind == "mujoco":
        return Scene.from_mujoco(path)
    return _driven(path) if kind == "robot" else Scene.load(path)


def _driven(path: Path) -> Scene:
    import numpy as np

    from tightloop.planning.dynamics import Dynamics
    from tightloop.scene.scene import Scene

    scene = Scene()
    robot = scene.add_urdf(path)
    low, high = robot.joint_range.T
    leaders = robot.joint_leaders
    outside = {
        name: float(0.5 * (least + most))
        for name, least, most in zip(robot.dof_names, low, high, strict=True)
        if (least > 0.0 or most < 0.0) and name in robot.coord_names and name not in leaders
    }
    if outside:
        robot.joint_q = outside
    inertia = np.diag(Dynamics(scene).mass_matrix(robot.joint_q))
    driven = np.array(robot.dof_driven)
    robot.joint_target_ke = np.where(driven, inertia * _FREQUENCY**2, 0.0)
    robot.joint_target_kd = np.where(driven, 2.0 * inertia * _FREQUENCY, 0.0)
    return scene


def scene_file(argument: str) -> str:
    """Return a scene file for a robot file, in the user's cache; any other argument stays as it is.

    Raises:
        SystemExit: The file cannot be used; the message says why.
    """
    kind = kind_of(Path(argument))
    if kind is None:
        return argument
    from tightloop.files import cache as cache_files

    with _said():
        text = scene_of(Path(argument)).to_toml()
        name = f"{Path(argument).stem}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.toml"
        file = cache_files.keep("scenes", name, lambda part: part.write_text(text, encoding="utf-8"))
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
