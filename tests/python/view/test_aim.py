"""Cameras of the viewer's page: they move along with robots that leave the picture, until the user moves them."""

from __future__ import annotations

import contextlib
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tightloop.view.browser.aim import Aim
from tightloop.view.cameras import Camera, camera, kept

CUBE = np.stack(np.meshgrid([-0.2, 0.2], [-0.2, 0.2], [0.0, 0.4]), axis=-1).reshape(-1, 3)


def browser() -> Any:
    """Return what stands for a browser's handle."""
    seen = SimpleNamespace(position=np.zeros(3), look_at=np.ones(3), fov=0.0, up_direction=np.zeros(3), aspect=1.5)
    return SimpleNamespace(camera=seen, atomic=contextlib.nullcontext)


def away(along_x: float) -> NDArray[np.float64]:
    return np.add(CUBE, [along_x, 0.0, 0.0])


def sees(client: Any, points: NDArray[np.float64]) -> bool:
    now = Camera(tuple(client.camera.position), tuple(client.camera.look_at), client.camera.fov)
    moved = kept(now, points, aspect=client.camera.aspect)
    return bool(np.linalg.norm(np.subtract(moved.position, now.position)) < 0.05)


def aimed() -> tuple[Any, Aim]:
    client = browser()
    aim = Aim(client)
    aim.point(camera("three-quarter", CUBE, aspect=1.5))
    return client, aim


def test_the_camera_moves_along_with_what_leaves_the_picture_and_keeps_its_direction() -> None:
    client, aim = aimed()
    line = np.subtract(client.camera.look_at, client.camera.position)
    start = client.camera.position
    aim.keep(away(0.01))
    assert client.camera.position == start, "it is still in the picture"
    for step in range(400):
        aim.keep(away(min(0.02 * step, 7.98 / 1.5)))
    assert sees(client, away(5.32))
    now = np.subtract(client.camera.look_at, client.camera.position)
    np.testing.assert_allclose(now / np.linalg.norm(now), line / np.linalg.norm(line), atol=1e-9)


def test_a_camera_that_the_user_moved_stays_where_it_is() -> None:
    client, aim = aimed()
    client.camera.position = np.add(client.camera.position, [0.5, 0.0, 0.0])
    mine = client.camera.position.copy()
    for step in range(50):
        aim.keep(away(0.2 * step))
    np.testing.assert_array_equal(client.camera.position, mine)
    aim.point(camera("side", CUBE, aspect=1.5))
    for _ in range(100):
        aim.keep(away(9.0))
    assert sees(client, away(9.0)), "a preset that was chosen is kept again"


def test_a_browser_that_answers_late_did_not_move_its_camera() -> None:
    client, aim = aimed()
    late: list[tuple[Any, Any]] = []
    for step in range(400):
        late.append((client.camera.position, client.camera.look_at))
        # the browser reports what it had three frames ago
        client.camera.position, client.camera.look_at = (np.array(part) for part in late[max(step - 3, 0)])
        aim.keep(away(min(0.02 * step, 7.98 / 1.5)))
    assert sees(client, away(5.32))


def test_a_browser_that_still_reports_the_camera_before_the_aim_did_not_move_it() -> None:
    client = browser()
    before, aim = (client.camera.position, client.camera.look_at), Aim(client)
    for _ in range(2):  # once when it connects, once when the page is made
        aim.point(camera("three-quarter", CUBE, aspect=1.5))
    for step in range(400):
        reported = client.camera.position, client.camera.look_at
        if step < 20:
            client.camera.position, client.camera.look_at = (np.array(part) for part in before)
        else:
            client.camera.position, client.camera.look_at = (np.array(part) for part in reported)
        aim.keep(away(min(0.02 * step, 7.98 / 1.5)))
    assert sees(client, away(5.32))


def test_a_report_between_a_position_and_its_target_is_no_move_of_the_user() -> None:
    client, aim = aimed()
    for step in range(400):
        before = client.camera.position
        aim.keep(away(min(0.02 * step, 7.98 / 1.5)))
        if step % 5 == 4:
            client.camera.position = before
    assert sees(client, away(5.32))
