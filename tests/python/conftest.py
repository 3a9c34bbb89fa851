"""Fixtures of the tests against real daemons. Each test has names of its own; nothing may be left behind."""

from __future__ import annotations

import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from vulkan_layer import Layer

import tightloop as tl
from tightloop.checks import advice
from tightloop.env import VectorEnv

REPOSITORY = Path(__file__).parents[2]
# MuJoCo models and recordings beside a checkout, where there are any
SHARED = REPOSITORY.parent / "shared/reference"
URDF = REPOSITORY / "examples/assets/fr3/fr3_franka_hand.urdf"

# The lesson's start state and drives, float32 values as the recorded reference has them
START = np.array(
    [-3.6802115e-3, 2.3901723e-2, 3.6804110e-3, -2.3683236, -1.2918962e-4, 2.3922248, 7.8549200e-1, 0.05, 0.05],
    dtype=np.float32,
)
STIFFNESS = np.array([4500.0, 4500, 3500, 3500, 2000, 2000, 2000, 100, 100])

# Two links in a plane: small enough to be compiled in no time, with names that sort against the file's order
PENDULUM = """<robot name="pendulum">
  <link name="base"/>
  <link name="upper"><inertial><origin xyz="0 0 -0.5"/><mass value="1"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.01"/></inertial></link>
  <link name="lower"><inertial><origin xyz="0 0 -0.25"/><mass value="0.5"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.002"/></inertial></link>
  <joint name="shoulder" type="continuous"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 -1"/><axis xyz="0 1 0"/></joint>
</robot>
"""


@pytest.fixture(scope="session", autouse=True)
def root() -> Iterator[Path]:
    """A root folder for this run's daemons, which is empty again at the end."""
    folder = Path(tempfile.mkdtemp(prefix="tightloop-tests-"))
    os.environ["TIGHTLOOP_ROOT"] = str(folder)
    yield folder
    left = sorted(path.name for path in folder.iterdir())
    shutil.rmtree(folder)
    assert not left, f"the tests left {left} behind"


@pytest.fixture(scope="session")
def layer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Layer]:
    """Vulkan's validation layer, over all daemons of this run."""
    layer = Layer(tmp_path_factory.mktemp("layer"))
    yield layer
    said = layer.words()
    layer.close()
    assert not said, said


@pytest.fixture(autouse=True)
def validated(layer: Layer) -> Iterator[None]:
    """Vulkan's validation layer has nothing to say about the test."""
    yield
    said = layer.words()
    assert not said, said


@pytest.fixture(autouse=True)
def untold() -> None:
    """No test has seen a warning before."""
    advice.forget()


@pytest.fixture
def unique() -> Callable[[], str]:
    """Names that no other daemon has."""
    return lambda: f"test-{secrets.token_hex(6)}"


@pytest.fixture
def envs() -> Iterator[Any]:
    """Makes environments, and closes them."""
    made: list[VectorEnv] = []

    def make(*args: Any, **kwargs: Any) -> VectorEnv:
        made.append(VectorEnv(*args, **kwargs))
        return made[-1]

    yield make
    for env in made:
        env.close()


@pytest.fixture
def pendulum_urdf(tmp_path: Path) -> Path:
    path = tmp_path / "pendulum.urdf"
    path.write_text(PENDULUM)
    return path


@pytest.fixture
def pendulum(pendulum_urdf: Path) -> tl.Scene:
    """Two dofs, hanging at (0.3, -0.2)."""
    scene = tl.Scene(dt=1 / 480, substeps=4)
    scene.add_urdf(pendulum_urdf, name="arm").joint_q = [0.3, -0.2]
    return scene


@pytest.fixture
def lesson() -> Callable[..., tl.Scene]:
    """The Franka of the first lesson, with or without its drives."""

    def make(*, driven: bool, urdf: Path = URDF) -> tl.Scene:
        scene = tl.Scene(dt=1 / 480, substeps=8)
        arm = scene.add_urdf(urdf, name="arm", pos=(-0.5, -0.5, 0.1))
        arm.joint_q = START
        arm.joint_target_ke = STIFFNESS if driven else 0.0
        arm.joint_target_kd = STIFFNESS / 10 if driven else 0.0
        arm.joint_effort_limit = [87] * 4 + [12] * 3 + [100] * 2
        arm.joint_armature = [0.195] * 4 + [0.074] * 3 + [0.1] * 2
        return scene

    return make


@pytest.fixture
def targets() -> Callable[[int], NDArray[np.float32]]:
    """Drive targets of a frame of the target demo, shape ``(9,)``."""

    def at(frame: int) -> NDArray[np.float32]:
        goal = START.copy()
        goal[3] += 0.4 * np.sin(2 * np.pi * frame / 180)
        goal[7:] = 0.04
        return goal

    return at


@pytest.fixture
def torques() -> Callable[[int], NDArray[np.float32]]:
    """Joint torques of a frame of the torque demo, shape ``(9,)``."""

    def at(frame: int) -> NDArray[np.float32]:
        tau = np.zeros(9, np.float32)
        tau[2] = 35.0 * np.sin(2 * np.pi * frame / 180)
        return tau

    return at
