"""The picking page in a real browser, and a hand that clicks on it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from regionpose.app.range_view import RangeView
from regionpose.datasets.demo import demo_folder
from regionpose.io.clouds import read_cloud
from regionpose.io.yaml_text import plain_value, yaml_node

playwright = pytest.importorskip("playwright.sync_api", reason="needs the package playwright")

CHROMIUM = next(
    (path for name in ("chromium", "chromium-browser", "google-chrome") if (path := shutil.which(name))), None
)
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs the browser chromium")

WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
"""What the view in 3D needs where there is no graphics card: each picture of a page takes several times as long."""

QUICK_DRAWS = (6_000, (200, 40, 8))
QUICK = f"""
import sys
from regionpose.alignment import focal, pose_search
from regionpose.cli import main
pose_search.draws_of = lambda _: {QUICK_DRAWS}
focal.GROUPS, focal.CLOSER = ((-1,), (1,)), 1
sys.exit(main())
"""
"""The command, whose search by edges draws fewer poses and tries fewer focal lengths, as of `small_searches`."""

SIZE = (1280, 960)
WAIT_MS = 120_000
POLL_MS = 50
"""Between two looks at a page: at each of its frames, as by default, would keep it drawing."""

CONNECTED = """
window.socket?.connected && document.querySelector('.pv img')
&& [...document.querySelectorAll('.pv img')].every(picture => picture.complete)
"""
"""Whether a page shows its pictures, and its server receives clicks."""

STILL_MS = 500
STILL = f"""
() => {{
    const parts = [...document.querySelectorAll('.pv-stage, .pv img, .rp-row')];
    const shown = JSON.stringify(parts.map(part => [part.getBoundingClientRect(), part.src]));
    if (window.lastShown?.shown !== shown) window.lastShown = {{shown, since: Date.now()}};
    return Date.now() - window.lastShown.since > {STILL_MS};
}}
"""
"""Whether its pictures and regions have stayed the same, and where they are, for a while: a click into what is about to
move, or to be drawn anew, may go elsewhere."""

DOOR = ((463, 498), (4.629, 5.132, 0.972))
BOARD = ((159, 501), (2.676, 6.081, 0.842))
CHALKBOARD = ((850, 769), (4.190, 2.048, -0.997))

SHOTS = os.environ.get("REGIONPOSE_SHOTS")
"""A folder for pictures of the page at each step, where somebody wants to look at them."""


def started(words: list[str], place: Path) -> Iterator[str]:
    """The address of a page of `regionpose pick` with these words, started in a folder; see QUICK."""
    command = [sys.executable, "-c", QUICK, "pick", *words, "--no-browser"]
    with subprocess.Popen(command, cwd=place, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        found = re.search(r"http://\S+", process.stdout.readline())
        assert found is not None
        yield found.group()
        process.terminate()


class Hand:
    """A page and the clicks on it."""

    def __init__(self, page: Any) -> None:
        self.page, self.clicks = page, 0
        cloud = read_cloud(demo_folder() / "cloud.ply")
        self.range = RangeView.of(cloud, np.zeros(3))

    def photo(self, pixel: tuple[float, float]) -> None:
        self._click(0, pixel, SIZE)

    def cloud(self, place: tuple[float, float, float]) -> None:
        x, y = self.range.pixels(np.array([place]))[0].tolist()
        self._click(1, (x, y), self.range.size)

    def stroke(self, view: int, pixels: list[tuple[float, float]], size: tuple[int, int]) -> None:
        """Shift-drag from pixel to pixel."""
        self.clicks += 1
        mouse = self.page.mouse
        self.page.keyboard.down("Shift")
        mouse.move(*self._place(view, pixels[0], size))
        mouse.down()
        for pixel in pixels[1:]:
            mouse.move(*self._place(view, pixel, size), steps=5)
        mouse.up()
        self.page.keyboard.up("Shift")

    def _click(self, view: int, pixel: tuple[float, float], size: tuple[int, int]) -> None:
        self.clicks += 1
        self.page.mouse.click(*self._place(view, pixel, size))

    def _place(self, view: int, pixel: tuple[float, float], size: tuple[int, int]) -> tuple[float, float]:
        box = self.page.locator(".pv-stage").nth(view).bounding_box()
        across, down = ((at + 0.5) / length for at, length in zip(pixel, size, strict=True))
        return box["x"] + across * box["width"], box["y"] + down * box["height"]

    def wait(self, script: str) -> None:
        self.page.wait_for_function(script, polling=POLL_MS)

    def wait_for_rows(self, count: int) -> None:
        self.wait(f"document.querySelectorAll('.rp-row').length == {count + 1}")

    def wait_for_points(self, row: int) -> None:
        self.wait(f"document.querySelectorAll('.rp-row')[{row}].innerText.includes('points')")

    def narrower(self, row: int, place: tuple[float, float, float]) -> None:
        said = f"document.querySelectorAll('.rp-row')[{row}].innerText"
        while "like intensity" not in self.page.evaluate(said):
            before = self.page.evaluate(said).split("points")[0]
            self.cloud(place)
            self.wait(f"{said}.split('points')[0] != {before!r}")

    def wait_for_pose(self) -> None:
        self.wait("document.querySelector('.rp-verdict') && !document.querySelector('.rp-spin')")

    def shot(self, name: str) -> None:
        if SHOTS is not None:
            self.page.mouse.move(2, 2)
            self.page.wait_for_timeout(600)
            self.page.screenshot(path=f"{SHOTS}/{name}.png")


def opened(browser: Any, address: str) -> tuple[Any, list[str]]:
    """An open page, and what it asked of other places than its server or complained of."""
    page, odd = watched(new_context(browser), address)
    led_on(page, address)
    return page, odd


def new_context(browser: Any, state: Any = None) -> Any:
    """Where pages share cookies, those of a state to begin with."""
    context = browser.new_context(viewport={"width": 1440, "height": 900}, storage_state=state, reduced_motion="reduce")
    context.set_default_timeout(WAIT_MS)
    return context


def watched(context: Any, address: str) -> tuple[Any, list[str]]:
    """A page, and what it asked of other places than its server or complained of."""
    page = context.new_page()
    odd: list[str] = []
    page.on(
        "request", lambda r: None if r.url.startswith((address.split("?")[0], "data:", "blob:")) else odd.append(r.url)
    )
    page.on("pageerror", lambda error: odd.append(str(error)))
    return page, odd


def led_on(page: Any, address: str) -> None:
    """Open an address that leads on, and wait for the page that it leads to."""
    page.goto(address, wait_until="commit")
    page.wait_for_url(re.compile(r"^http://[^/]*/$"))
    page.wait_for_function(CONNECTED, polling=POLL_MS)
    page.wait_for_function(STILL, polling=POLL_MS)


def saved_region(hand: Hand, folder_of_scene: Path) -> dict[str, Any]:
    """The only region of the scene file, after it is saved."""
    hand.page.keyboard.press("Control+s")
    hand.page.wait_for_selector("text=Saved scene.yaml")
    value: Any = plain_value(yaml_node((folder_of_scene / "scene.yaml").read_text(encoding="utf-8")))
    return dict(value["regions"][0])


def polygon(hand: Hand, corners: list[tuple[float, float]]) -> None:
    """Draw a polygon with the keyboard's help."""
    hand.page.keyboard.press("p")
    hand.wait("document.querySelector('.pv-polygon')")
    for corner in corners:
        hand.photo(corner)
    hand.page.keyboard.press("Enter")


class SharedDemo:
    """One server of the demo's files and one browser for many tests, each with a page of its own and no region yet."""

    def __init__(self, player: Any, address: str, place: Path) -> None:
        self.player, self.address, self.place = player, address, place
        self.browser = self._launched("--disable-gpu")
        first, _ = opened(self.browser, address)
        self.home, self.context = first.url, first.context
        first.close()

    def _launched(self, *words: str) -> Any:
        return self.player.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox", *words])

    def page(self, context: Any = None) -> tuple[Any, list[str]]:
        """A new page, and what it asked of other places than its server or complained of."""
        page, odd = watched(context or self.context, self.home)
        led_on(page, self.home)
        while page.locator(".rp-row").count():
            page.keyboard.press("Control+z")
            page.wait_for_function(STILL, polling=POLL_MS)
        return page, odd

    def close_pages(self) -> None:
        """Close all pages of the browser: an open one draws and asks its server again, also when that has ended."""
        for context in self.browser.contexts:
            for page in context.pages:
                page.close()

    @contextmanager
    def in_browser(self, *words: str) -> Iterator[tuple[Any, list[str]]]:
        """The same in a browser of its own, started with these words."""
        browser = self._launched(*words)
        yield self.page(new_context(browser, self.context.storage_state()))
        browser.close()


@contextmanager
def shared_demo(place: Path) -> Iterator[SharedDemo]:
    """The server saves to a folder."""
    with playwright.sync_playwright() as player:
        for address in started(["--demo"], place):
            demo = SharedDemo(player, address, place)
            yield demo
            demo.browser.close()
