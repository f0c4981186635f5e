"""Clicks that the picking page once swallowed, in a real browser."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pick_pages import DOOR, WAIT_MS, Hand, SharedDemo, needs_chromium, polygon, saved_region, shared_demo

pytest.importorskip("nicegui", reason="needs the extra pick")
pytest.importorskip("httpx", reason="needs the package httpx")
pytestmark = [pytest.mark.slow, needs_chromium]

RING = [(200.0, 200.0), (320.0, 200.0), (320.0, 330.0), (200.0, 330.0)]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedDemo]:
    """One server and one browser."""
    with shared_demo(tmp_path_factory.mktemp("demo")) as shared:
        yield shared


@pytest.fixture
def hand(demo: SharedDemo) -> Iterator[Hand]:
    """An open page of the demo's files."""
    page, odd = demo.page()
    yield Hand(page)
    assert odd == []
    page.close()


def ring_of(hand: Hand, place: Path) -> Any:
    return np.array(saved_region(hand, place)["image"]["polygon"])


def test_corners_on_the_selected_polygon_are_corners(hand: Hand) -> None:
    """The second polygon shares an edge, its vertices and the middle of it with the first one."""
    polygon(hand, RING)
    hand.wait_for_rows(1)
    hand.page.keyboard.press("n")
    polygon(hand, RING)
    hand.wait_for_rows(2)
    row = hand.page.locator(".rp-row").nth(1)
    row.click()
    hand.wait("document.querySelectorAll('.pv-vertex').length == 4")
    polygon(hand, [(320.0, 200.0), (320.0, 265.0), (320.0, 330.0), (420.0, 330.0), (420.0, 200.0)])
    hand.wait_for_rows(3)
    hand.shot("20-beside")
    hand.wait("document.querySelectorAll('.pv-vertex').length == 5")


def test_a_click_on_a_handle_alone_adds_no_vertex(hand: Hand) -> None:
    polygon(hand, RING)
    hand.wait_for_rows(1)
    hand.wait("document.querySelectorAll('.pv-middle').length == 4")
    hand.photo((260.0, 200.0))
    hand.page.wait_for_timeout(300)
    assert hand.page.locator(".pv-vertex").count() == 4
    assert hand.page.locator(".rp-row").count() == 2


def test_corners_beside_the_photo_lie_on_its_border(hand: Hand, demo: SharedDemo) -> None:
    polygon(hand, [(-6.0, 300.0), (200.0, 300.0), (200.0, 500.0), (-6.0, 500.0)])
    hand.wait_for_rows(1)
    hand.cloud(DOOR[1])
    hand.wait_for_points(1)
    ring = ring_of(hand, demo.place)
    assert ring[[0, 3], 0] == pytest.approx(-0.5)
    assert ring[[1, 2], 0] == pytest.approx(200.0, abs=1.5)


@pytest.mark.parametrize("pixel", [(-1.5, 500.0), (1280.5, 500.0)])
def test_clicks_on_the_border_of_the_photo_are_heard(hand: Hand, pixel: tuple[float, float]) -> None:
    hand.photo(pixel)
    hand.wait("document.querySelectorAll('.rp-row').length == 2 || document.querySelector('.q-notification')")


def test_a_lasso_may_begin_outside_the_range_image(hand: Hand) -> None:
    place = hand.page.locator(".pv-stage").nth(1)
    before = place.bounding_box()
    width, height = hand.range.size
    hand.page.keyboard.press("x")
    hand.wait("document.querySelector('.pv-cut')")
    x, y = hand.range.pixels(np.array([DOOR[1]]))[0].tolist()
    above = -0.04 * height
    ring = [(x - 20.0, above), (x + 20.0, above), (x + 20.0, y + 10.0), (x - 20.0, y + 10.0), (x - 20.0, above)]
    hand.stroke(1, ring, (width, height))
    hand.wait("document.querySelectorAll('.rp-row').length == 2 || document.querySelector('.q-notification')")
    hand.shot("21-lasso")
    assert place.bounding_box() == before


def test_a_click_on_a_name_selects(hand: Hand) -> None:
    polygon(hand, RING)
    hand.wait_for_rows(1)
    hand.page.keyboard.press("n")
    polygon(hand, [(500.0, 200.0), (600.0, 200.0), (600.0, 300.0)])
    hand.wait_for_rows(2)
    selected = "document.querySelectorAll('.rp-row')[{}].classList.contains('rp-on')"
    hand.wait(selected.format(2))
    hand.page.locator(".pv-name", has_text="region 1").first.click()
    hand.wait(selected.format(1))
    assert hand.page.locator(".rp-row").count() == 3
    hand.page.locator(".rp-row").nth(2).locator("input").click()
    hand.wait(selected.format(2))
    hand.page.keyboard.press("End")
    hand.page.keyboard.type(" door", delay=60)
    assert hand.page.locator(".rp-row").nth(2).locator("input").input_value() == "region 2 door"
    hand.page.keyboard.press("Tab")
    hand.page.wait_for_selector(".pv-name:has-text('region 2 door')", timeout=WAIT_MS)


def test_messages_cover_no_tool(hand: Hand) -> None:
    hand.page.keyboard.press("Control+s")
    hand.page.wait_for_selector(".q-notification", timeout=WAIT_MS)
    hand.shot("22-message")
    toast = hand.page.locator(".q-notification").first.bounding_box()
    heads = [head.bounding_box() for head in hand.page.locator(".rp-bar, .rp-head").all()]
    assert all(head["y"] + head["height"] <= toast["y"] for head in heads)
