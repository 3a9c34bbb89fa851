"""A page of the viewer in headless Chromium: its pixels, its controls, and what its console says."""

from __future__ import annotations

import io
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Browser, Page, sync_playwright

CHROMIUM = "/usr/bin/chromium"
# Screenshots are kept: test output for people.
SHOTS = Path(__file__).parents[3] / "out" / "viewer"
# Its software renderer needs seconds for a picture where other programs have the cores.
PATIENCE_SECONDS = 120.0
# What viser 1.1.1 itself makes Chromium say when something is dragged; it does no harm.
_OF_VISER = "Unable to preventDefault inside passive event listener invocation."
_FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
# A canvas without a picture has one colour; a box far away, shaded and with smooth edges, has 80 and more.
DRAWN_COLOURS = 20
# The panel is at the right of a page, with its frame; the scene is seen in the rest.
WIDTH, WIDE, HEIGHT, PANEL_WIDTH = 840, 1200, 520, 360


@contextmanager
def chromium() -> Iterator[Browser]:
    """A browser without a display."""
    assert Path(CHROMIUM).exists(), "the viewer's tests need Chromium: apt install chromium"
    # it brings a Vulkan of its own, whose use is none of ours to check
    own: dict[str, str | float | bool] = {
        name: value for name, value in os.environ.items() if not name.startswith("VK_")
    }
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=_FLAGS, env=own)
        try:
            yield browser
        finally:
            browser.close()


class View:
    """The viewer's page, open."""

    def __init__(self, browser: Browser, url: str, width: int = WIDTH) -> None:
        self.page: Page = browser.new_page(viewport={"width": width, "height": HEIGHT})
        self.scene_width = width - PANEL_WIDTH
        self.page.set_default_timeout(PATIENCE_SECONDS * 1000)
        self.errors: list[str] = []
        # everything that the console said, for the message of an error
        self.console: list[str] = []
        self.page.on("console", lambda said: self._hear(said.type, said.text))
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        # viser would lower its resolution while it is slow, and pictures could not be compared
        self.page.goto(f"{url}?fixedDpr=1")
        self.wait(lambda: "world" in self.text, "the panel shows text")

    def _hear(self, kind: str, text: str) -> None:
        self.console.append(f"{kind}: {text}")
        if kind == "error" and text != _OF_VISER:
            self.errors.append(text)

    @property
    def text(self) -> str:
        return self.page.inner_text("body")

    def shot(self, name: str | None = None) -> NDArray[np.int16]:
        """The pixels of the scene, the panel left out; kept as a file if it has a name."""
        clip: Any = {"x": 0, "y": 0, "width": self.scene_width, "height": HEIGHT}
        data = self.page.screenshot(clip=clip)
        if name is not None:
            SHOTS.mkdir(parents=True, exist_ok=True)
            self.page.screenshot(path=SHOTS / f"{name}.png")
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), np.int16)

    def still(self, name: str | None = None) -> NDArray[np.int16]:
        """The pixels once they do not change any more."""
        before = self.shot()
        deadline = time.monotonic() + PATIENCE_SECONDS
        while True:
            self.page.wait_for_timeout(500)
            now = self.shot()
            moved, colours = differing(before, now), len(np.unique(now.reshape(-1, 3), axis=0))
            if moved == 0 and colours >= DRAWN_COLOURS:
                return self.shot(name)
            resting = f"the page does not come to rest: {moved} pixels differ, there are {colours} colours"
            assert time.monotonic() < deadline, resting
            before = now

    @property
    def scene(self) -> tuple[float, float]:
        """Width and height of the scene, which begins at the upper left of the page [pixels]."""
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None and (box["x"], box["y"]) == (0, 0)
        return box["width"], box["height"]

    def wait(self, condition: Callable[[], Any], what: str) -> Any:
        """Wait for something to be true in the page."""
        deadline = time.monotonic() + PATIENCE_SECONDS
        while not (found := condition()):
            assert time.monotonic() < deadline, f"waited in vain until {what}; the page says: {self.text[:600]}"
            self.page.wait_for_timeout(100)
        return found

    def close_notices(self) -> None:
        """Close what lies over the scene: Chromium renders in software, and viser warns of it."""
        for button in self.page.get_by_role("alert").get_by_role("button").all():
            button.click()

    def press(self, button: str) -> None:
        self.page.get_by_role("button", name=button, exact=True).click()

    def choose(self, dropdown: str, option: str) -> None:
        self.page.get_by_role("combobox", name=dropdown, exact=True).click()
        self.page.get_by_role("option", name=option, exact=True).click()


def differing(a: NDArray[np.int16], b: NDArray[np.int16]) -> int:
    """How many pixels differ by more than a shade."""
    return int(np.count_nonzero(np.abs(a - b).max(axis=-1) > 12))


def spots(mask: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """The connected parts of a mask: rows and columns of each, shape ``(pixels, 2)``."""
    left = {(int(row), int(column)) for row, column in np.argwhere(mask)}
    found = []
    while left:
        edge = [left.pop()]
        spot = list(edge)
        while edge:
            row, column = edge.pop()
            for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
                if near in left:
                    left.remove(near)
                    edge.append(near)
                    spot.append(near)
        found.append(np.array(spot))
    return found
