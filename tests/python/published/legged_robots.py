"""Published quadrupeds stand in `QuadrupedVelocityFlat`, and a published humanoid starts; `make published` runs it."""

from __future__ import annotations

from pathlib import Path

import pytest
from standing_robots import check_stands, check_starts

PUBLISHED = Path(__file__).parents[3] / "out/published"
DATA = PUBLISHED / "pybullet-3.2.7/pybullet_data"
QUADRUPEDS = """
    a1/a1.urdf laikago/laikago_toes_zup.urdf mini_cheetah/mini_cheetah.urdf aliengo/aliengo.urdf
    quadruped/spirit40.urdf quadruped/spirit40newer.urdf quadruped/vision60.urdf
""".split()
HUMANOID = PUBLISHED / "rtb-data-1.1.0/rtbdata/xacro/val_description/model/robots/valkyrie_sim.urdf"


@pytest.mark.parametrize("file", QUADRUPEDS)
def test_it_stands(file: str) -> None:
    check_stands(DATA / file)


def test_a_humanoid_starts_on_its_feet() -> None:
    check_starts(HUMANOID)
