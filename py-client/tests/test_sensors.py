"""Sites and contact sensors of a scene: what they take, refuse, and write to a file."""

from __future__ import annotations

from pathlib import Path

import pytest

import tightloop as tl


@pytest.fixture
def scene() -> tl.Scene:
    scene = tl.Scene()
    cube = scene.add_body(name="cube", pos=(0, 0, 1))
    scene.add_box(half_extents=(0.1, 0.1, 0.1), body=cube)
    scene.add_ground()
    return scene


def test_sites_and_sensors_are_named_in_order(scene: tl.Scene):
    first = scene.add_site()
    scene.add_site(body=scene.bodies["cube"], pos=(0, 0, 0.1), relative_to=first)
    scene.add_site(body="cube", relative_to="cube", name="tip")
    assert [*scene.sites] == ["site", "site_2", "tip"]
    assert first == tl.Site(name="site", body=None, pos=(0, 0, 0), quat=(0, 0, 0, 1), relative_to=None, damping=0.05)
    assert scene.sites["site_2"].relative_to == "site"
    scene.add_contact_sensor(of="cube")
    scene.add_contact_sensor(of=scene.shapes["box"], against="ground")
    assert [(s.of, s.against) for s in scene.contact_sensors.values()] == [("cube", None), ("cube/box", "ground")]


def test_a_file_keeps_them(scene: tl.Scene, tmp_path: Path):
    scene.add_site(pos=(1, 2, 3), quat=(0, 0, 0.6, 0.8), name="camera")
    scene.add_site(body="cube", relative_to="camera", damping=0.2)
    scene.add_contact_sensor(of="cube", against="ground", name="load")
    scene.command_delay_max = 24
    scene.save(tmp_path / "scene.toml")
    loaded = tl.Scene.load(tmp_path / "scene.toml")
    assert loaded.sites == scene.sites
    assert [site.damping for site in loaded.sites.values()] == [0.05, 0.2]
    assert loaded.contact_sensors == scene.contact_sensors
    assert loaded.command_delay_max == 24
    assert loaded.to_toml() == scene.to_toml()


def test_wrong_ones_are_refused_by_name_and_leave_nothing(scene: tl.Scene):
    other = tl.Scene()
    far = other.add_site()
    for wrong, message in [
        ({"body": "cup"}, r"site `site`: body is 'cup', which is no body of this scene; there are: `cube`"),
        (
            {"relative_to": "cup"},
            r"site `site`: relative_to is 'cup', which is no site or body .* there are: `cube`, and",
        ),
        ({"relative_to": far}, r"site `site`: site `site` is of another scene"),
        ({"pos": (1, 2)}, r"site `site`: pos"),
        ({"quat": (0, 0, 0, 2)}, r"site `site`: quat .* has length 2"),
        ({"name": "a/b"}, r"site name 'a/b': use letters"),
        ({"body": 3}, r"site `site`: body is 3"),
        ({"damping": 0}, r"site `site`: damping is 0; it must be above 0"),
        ({"damping": float("nan")}, r"site `site`: damping is nan; give a finite number"),
        ({"damping": "little"}, r"site `site`: damping is 'little'; give a number"),
    ]:
        with pytest.raises(tl.SceneError, match=message):
            scene.add_site(**wrong)
    scene.add_site(name="tip")
    with pytest.raises(tl.SceneError, match=r"site name `tip` is taken"):
        scene.add_site(name="tip")
    for wrong, message in [
        ({"of": "cup"}, r"contact sensor `contact`: of is 'cup', which is no shape"),
        ({"of": "cube", "against": "cup"}, r"against is 'cup', which is no shape"),
        ({"of": "cube", "name": ""}, r"contact sensor name ''"),
    ]:
        with pytest.raises(tl.SceneError, match=message):
            scene.add_contact_sensor(**wrong)
    assert [*scene.sites] == ["tip"]
    assert not scene.contact_sensors


def test_a_file_that_names_what_is_not_there_is_refused(tmp_path: Path):
    head = "dt = 0.002\nsubsteps = 1\n[[body]]\nname = 'cube'\nmass = 1.0\n"
    for text, message in [
        ("[[site]]\nname = 'tip'\nbody = 'cup'\n", "cup"),
        ("[[site]]\nname = 'tip'\nbodie = 'cube'\n", "bodie"),
        ("[[site]]\nname = 'tip'\ndamping = -1.0\n", "damping is -1"),
        ("[[contact_sensor]]\nname = 'load'\nof = 'cup'\n", "cup"),
    ]:
        (tmp_path / "scene.toml").write_text(head + text)
        with pytest.raises(tl.SceneError, match=message):
            tl.Scene.load(tmp_path / "scene.toml")
