"""The installed version of MuJoCo; `make mujoco-versions` tries several."""

from __future__ import annotations

import sys

from conftest import REPOSITORY
from tightloop.mujoco import export

sys.path.insert(0, str(REPOSITORY / "tests/python/mujoco_versions"))
import smoke
from environments import versions


def test_models_batches_files_and_refusals_work_with_the_installed_version(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    failed = smoke.main(tmp_path, [])
    assert not failed, capsys.readouterr().out


def test_the_oldest_and_the_newest_supported_version_are_tried():
    numbers = [tuple(int(part) for part in version.split(".")[:2]) for version in versions()]
    oldest, end = export.VERSIONS
    assert numbers == sorted(numbers) and numbers[0] == oldest
    assert numbers[-1][0] == end[0] and numbers[-1] < end
