"""A film as an HTML file, opened in headless Chromium: it shows the worlds, and they move."""

from __future__ import annotations

import time
from pathlib import Path

import tightloop as tl
from browser import PATIENCE_SECONDS, SHOTS, chromium
from tightloop.view import Film


def test_the_page_of_a_film_moves_by_itself(tmp_path: Path) -> None:
    out = tmp_path / "run.html"
    scene = tl.Scene(dt=1 / 240, substeps=4, gravity=(0, 0, 0))
    cube = scene.add_body()
    scene.add_box(half_extents=(0.1, 0.2, 0.3), body=cube)
    with tl.launch(scene, worlds=4) as sim, Film(out, sim, worlds=4, fps=2) as film:
        film.add(sim.write(joint_qd=[[0, 0, 0, 0, 0, 1.0]] * 4))
        for _ in range(600):
            film.add(sim.step())
    assert film.pictures == 21
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 400, "height": 300})
        page.set_default_timeout(PATIENCE_SECONDS * 1000)
        errors: list[str] = []
        page.on("console", lambda said: errors.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.on(
            "request",
            lambda asked: None if asked.url.startswith(("file:", "data:", "blob:")) else errors.append(asked.url),
        )
        page.goto(f"{out.as_uri()}?fixedDpr=1")
        page.wait_for_selector("canvas")
        for button in page.get_by_role("alert").get_by_role("button").all():
            button.click()
        canvas = page.locator("canvas").first
        seen: list[bytes] = []
        deadline = time.monotonic() + PATIENCE_SECONDS
        # a film of ten seconds that begins anew: pictures at any three times differ
        while len(set(seen)) < 3:
            assert time.monotonic() < deadline, f"the page shows {len(set(seen))} pictures"
            seen.append(canvas.screenshot())
            page.wait_for_timeout(300)
        SHOTS.mkdir(parents=True, exist_ok=True)
        (SHOTS / "film.png").write_bytes(seen[-1])
    assert not errors
