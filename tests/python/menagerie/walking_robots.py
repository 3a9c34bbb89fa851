"""Quadrupeds of MuJoCo stand in `QuadrupedVelocityFlat`, and humanoids start; `make menagerie` runs it."""

from __future__ import annotations

from pathlib import Path

import pytest
from standing_robots import check_stands, check_starts

MODELS = Path(__file__).parents[3] / "out/menagerie"
QUADRUPEDS = """
    mjlab-1.6.0/mjlab/asset_zoo/robots/unitree_go1/xmls/go1.xml
    dm_control-1.0.50/dm_control/suite/quadruped.xml
    dm_control-1.0.50/dm_control/third_party/ant/ant.xml
    gymnasium-1.4.0/gymnasium/envs/mujoco/assets/ant.xml
    mujoco-mjx-3.17.0/mujoco/mjx/test_data/barkour_v0/assets/barkour_v0_mjx.xml
""".split()
HUMANOIDS = """
    mjlab-1.6.0/mjlab/asset_zoo/robots/unitree_g1/xmls/g1.xml
    gymnasium-1.4.0/gymnasium/envs/mujoco/assets/humanoid.xml
    dm_control-1.0.50/dm_control/suite/humanoid.xml
""".split()


@pytest.mark.parametrize("file", QUADRUPEDS)
def test_it_stands(file: str) -> None:
    check_stands(MODELS / file)


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> None:
    """As if mjlab was installed."""
    monkeypatch.syspath_prepend(MODELS / "mjlab-1.6.0")


@pytest.mark.usefixtures("installed")
def test_robots_are_known_by_name() -> None:
    check_stands("unitree_go1")
    check_starts("unitree_g1")


@pytest.mark.parametrize("file", HUMANOIDS)
def test_a_humanoid_starts_on_its_feet(file: str) -> None:
    check_starts(MODELS / file)
