"""The picking page in a real browser: from launch to a trusted pose by clicks, saved and estimated again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run
from made_up_worlds import made_world
from pick_pages import (
    BOARD,
    CHALKBOARD,
    DOOR,
    QUICK_DRAWS,
    SIZE,
    WAIT_MS,
    WEBGL,
    Hand,
    SharedDemo,
    needs_chromium,
    opened,
    polygon,
    saved_region,
    shared_demo,
    started,
)
from PIL import Image
from regionpose import Pose
from regionpose.app.guard import MOST_BYTES
from regionpose.datasets.demo import demo_folder
from regionpose.io.clouds import Cloud, read_cloud, write_ply
from regionpose.scene.bundle import read_truth, truth_errors
from small_searches import draw_fewer, skip_planes

pytest.importorskip("nicegui", reason="needs the extra pick")
httpx = pytest.importorskip("httpx", reason="needs the package httpx")

pytestmark = [pytest.mark.slow, needs_chromium]

MOST_CLICKS = 10

RING = [(200.0, 200.0), (320.0, 200.0), (320.0, 330.0), (200.0, 330.0)]


@pytest.fixture(scope="module")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SharedDemo]:
    """One server and one browser."""
    with shared_demo(tmp_path_factory.mktemp("demo")) as shared:
        yield shared


@pytest.fixture(autouse=True)
def browser(demo: SharedDemo) -> Iterator[Any]:
    """The browser of all tests, whose pages are closed after each."""
    yield demo.browser
    demo.close_pages()


@pytest.fixture
def unasked(tmp_path: Path) -> Iterator[str]:
    """The address of a page on the demo's files, of which nobody has said where the scanner stood."""
    files = demo_folder()
    paths = {"--image": "image.jpg", "--camera": "camera_info.yaml", "--cloud": "cloud.ply"}
    yield from started([word for key, name in paths.items() for word in (key, str(files / name))], tmp_path)


def test_a_few_clicks_give_a_trusted_pose_that_the_saved_file_gives_again(
    demo: SharedDemo, capsys: pytest.CaptureFixture[str]
) -> None:
    page, odd = demo.page()
    hand = Hand(page)
    hand.shot("1-empty")
    for row, (pixel, place) in enumerate((DOOR, BOARD, CHALKBOARD), start=1):
        hand.photo(pixel)
        hand.wait_for_rows(row)
        hand.cloud(place)
        hand.wait_for_points(row)
        if row < 3:  # The door and the board are flush with their walls: a further click takes them alone.
            hand.narrower(row, place)
        hand.shot(f"{row + 1}-pair")
    hand.wait_for_pose()
    assert "Trusted" in page.locator(".rp-verdict").inner_text()
    assert hand.clicks <= MOST_CLICKS
    page.keyboard.press("Control+s")
    page.wait_for_selector("text=Saved scene.yaml")
    hand.shot("5-saved")
    shown = np.array([float(word) for word in page.locator(".rp-matrix").inner_text().split()]).reshape(3, 4)
    matrix = estimated(demo.place, capsys)
    np.testing.assert_allclose(matrix[:3], shown, atol=6e-6)
    assert odd == []


def estimated(folder_of_scene: Path, capsys: pytest.CaptureFixture[str]) -> np.ndarray[Any, np.dtype[np.float64]]:
    """The trusted pose (4, 4) that `regionpose estimate` gives of the saved scene, which is near the true one."""
    _, said, _ = run(capsys, "estimate", folder_of_scene / "scene.yaml", "--quiet", "--json")
    result = json.loads(said)
    assert result["status"] == "trusted"
    matrix = np.array(result["camera_from_world"]["matrix"])
    assert truth_errors(Pose.from_matrix(matrix), read_truth(demo_folder() / "truth.json"))["rotation_deg"] < 1.0
    return matrix


def test_two_pages_show_one_session_and_keys_work(demo: SharedDemo) -> None:
    (first, odd), (second, _) = demo.page(), demo.page()
    one, other = Hand(first), Hand(second)
    polygon(one, [(200, 200), (320, 200), (320, 330), (200, 330)])
    one.wait_for_rows(1)
    other.wait_for_rows(1)
    one.shot("6-polygon")
    other.page.keyboard.press("Control+z")
    one.wait("document.querySelectorAll('.rp-row').length == 0")
    first.keyboard.press("Control+y")
    other.wait_for_rows(1)
    assert odd == []


@pytest.mark.parametrize("is_stroke", [True, False])
def test_points_are_cut_out_by_a_stroke_or_by_corners(demo: SharedDemo, is_stroke: bool) -> None:
    page, odd = demo.page()
    hand = Hand(page)
    hand.photo(CHALKBOARD[0])
    hand.wait_for_rows(1)
    hand.cloud(CHALKBOARD[1])
    hand.wait_for_points(1)
    x, y = hand.range.pixels(np.array([CHALKBOARD[1]]))[0].tolist()
    corners = [(x - 10.0, y - 10.0), (x + 10.0, y - 10.0), (x + 10.0, y + 10.0), (x - 10.0, y + 10.0)]
    page.keyboard.press("x")
    hand.wait("document.querySelector('.pv-cut')")
    if is_stroke:
        hand.stroke(1, [*corners, corners[0]], hand.range.size)
    else:
        for corner in corners:
            hand._click(1, corner, hand.range.size)
        page.keyboard.press("Enter")
    hand.wait("document.querySelectorAll('.rp-row')[1].innerText.includes('cut out')")
    hand.shot("10-cut-out")
    points = np.load(demo.place / str(saved_region(hand, demo.place)["world"]["points"]))
    pixels = hand.range.pixels(read_cloud(demo_folder() / "cloud.ply").local_points[points])
    assert len(points) > 20
    assert (np.abs(pixels - [x, y]) < 11.0).all()
    assert odd == []


def test_edges_are_hidden_with_shift_as_they_are_drawn(demo: SharedDemo) -> None:
    page, odd = demo.page()
    hand = Hand(page)
    page.keyboard.press("p")
    hand.wait("document.querySelector('.pv-polygon')")
    hand.photo((200.0, 200.0))
    hand.photo((400.0, 200.0))
    page.keyboard.down("Shift")
    hand.photo((400.0, 300.0))
    page.keyboard.up("Shift")
    hand.stroke(0, [(400.0, 300.0), (350.0, 350.0), (300.0, 300.0)], SIZE)
    hand.photo((200.0, 300.0))
    hand.shot("11-hidden")
    page.keyboard.press("Enter")
    hand.wait_for_rows(1)
    hand.cloud(BOARD[1])
    hand.wait_for_points(1)
    image = saved_region(hand, demo.place)["image"]
    ring, hidden = np.array(image["polygon"]), image["hidden_edges"]
    assert len(ring) > 6
    # The edge that ends at a corner with Shift, and the stroke; not what leaves its end, nor the last edge.
    assert hidden == list(range(1, len(ring) - 2))
    low = ring[np.argmax(ring[:, 1])]
    assert np.abs(low - [350.0, 350.0]).max() < 6.0
    assert odd == []


def test_a_click_in_3d_grows_the_plane_that_its_ray_meets(demo: SharedDemo) -> None:
    with demo.in_browser(*WEBGL) as (page, odd):
        click_in_3d(page)
        assert odd == []


def click_in_3d(page: Any) -> None:
    hand = Hand(page)
    page.get_by_role("button", name="3D").click()
    page.wait_for_timeout(3000)
    box = page.locator(".cv").bounding_box()
    page.mouse.click(box["x"] + 0.85 * box["width"], box["y"] + 0.45 * box["height"])
    hand.wait_for_rows(1)
    hand.wait_for_points(1)
    hand.shot("7-solid")


def test_the_page_asks_where_the_scanner_stood_and_looks_from_there(unasked: str, browser: Any, tmp_path: Path) -> None:
    page, odd = opened(browser, unasked)
    hand = Hand(page)
    assert page.locator(".q-dialog").count() == 0, "the pose by edges needs no answer"
    hand.photo(BOARD[0])
    page.wait_for_selector("text=Where did the scanner stand?")
    assert [field.input_value() for field in page.locator(".q-dialog input").all()] == ["0", "0", "0"]
    hand.shot("8-scanner")
    page.get_by_role("button", name="There", exact=True).click()
    page.wait_for_selector("text=Scanner: 0, 0, 0")
    hand.wait("!document.querySelector('.q-dialog')")
    hand.cloud(BOARD[1])
    hand.wait_for_points(1)
    page.keyboard.press("Control+s")
    page.wait_for_selector("text=Saved scene.yaml")
    assert "sensor_origin: [0.0, 0.0, 0.0]" in (tmp_path / "scene.yaml").read_text(encoding="utf-8")
    page.get_by_role("button", name="Scanner: 0, 0, 0").click()
    page.locator(".q-dialog input").first.fill("1.5")
    before = page.locator(".pv-picture").nth(1).get_attribute("src")
    page.get_by_role("button", name="There", exact=True).click()
    page.wait_for_selector("text=Scanner: 1.5, 0, 0")
    hand.wait(f"document.querySelectorAll('.pv-picture')[1].getAttribute('src') != '{before}'")
    hand.shot("9-scanner-moved")
    assert odd == []


def test_what_is_known_is_asked_until_it_can_be_used(demo: SharedDemo) -> None:
    page, odd = demo.page()
    page.get_by_role("button", name="Prior …").click()
    within = page.locator(".q-dialog input[type=number]").nth(3)
    within.fill("-1")
    page.get_by_role("button", name="Use it").click()
    page.wait_for_selector("text=prior.camera_near_sigma_m: found -1.0")
    Hand(page).shot("12-known")
    assert within.is_visible()
    within.fill("0.5")
    page.get_by_role("button", name="Use it").click()
    Hand(page).wait("!document.querySelector('.q-dialog')")
    page.wait_for_selector("text=about the scanner")
    assert odd == []


@pytest.fixture
def edges(tmp_path: Path) -> Iterator[str]:
    """The address of a page on a made-up photo and cloud."""
    world = made_world(5)
    Image.fromarray(world.photo).save(tmp_path / "photo.png")
    write_ply(tmp_path / "scan.ply", Cloud.from_points(world.points, intensity=world.intensity))
    (tmp_path / "cameras.txt").write_text("1 PINHOLE 480 320 260 260 240 160\n", encoding="utf-8")
    yield from started(["--image", "photo.png", "--camera", "cameras.txt", "--cloud", "scan.ply"], tmp_path)


def test_a_pose_without_a_region_is_seen_over_the_photo_and_saved(
    edges: str, browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page, odd = opened(browser, edges)
    hand = Hand(page)
    hand.wait_for_pose()
    page.locator(".rp-up").get_by_role("button", name="z", exact=True).click()
    page.wait_for_selector("text=every heading")
    hand.wait_for_pose()
    hand.wait("document.querySelector('.pv-over') && document.querySelector('.pv-over').naturalWidth == 480")
    assert page.locator(".pv-over").get_attribute("src").startswith("files/depth.jpg")
    hand.shot("13-edges")
    opacity = "getComputedStyle(document.querySelector('.pv-over')).opacity"
    before = float(page.evaluate(opacity))
    box = page.locator(".rp-depth .q-slider").bounding_box()
    page.mouse.click(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    hand.wait(f"{opacity} < {before - 0.1}")
    page.keyboard.press("d")
    hand.wait("!document.querySelector('.pv-over')")
    page.keyboard.press("Control+s")
    page.wait_for_selector("text=Saved scene.yaml")
    shown = np.array([float(word) for word in page.locator(".rp-matrix").inner_text().split()]).reshape(3, 4)
    draw_fewer(monkeypatch, *QUICK_DRAWS)
    skip_planes(monkeypatch)
    _, said, _ = run(capsys, "estimate", tmp_path / "scene.yaml", "--quiet", "--json")
    matrix = np.array(json.loads(said)["camera_from_world"]["matrix"])
    np.testing.assert_allclose(matrix[:3], shown, atol=6e-6)
    np.testing.assert_allclose(matrix, made_world(5).pose.matrix, atol=0.05)
    assert odd == []


def test_the_server_answers_nobody_else(demo: SharedDemo) -> None:
    home, port = demo.home.rstrip("/"), demo.home.split(":")[2].rstrip("/")
    own = {cookie["name"]: cookie["value"] for cookie in demo.context.cookies()}
    with httpx.Client(base_url=home, cookies=own) as client:
        assert client.get("/").status_code == 200
        assert client.get("/", headers={"host": f"evil.example:{port}"}).status_code == 421
        assert client.get("/", headers={"origin": "https://evil.example"}).status_code == 403
        assert client.get("/files/photo.jpg").headers["content-type"] == "image/jpeg"
        assert client.get("/files/scene.yaml").status_code == 404
        assert client.get("/files/%2e%2e/%2e%2e/etc/passwd").status_code == 404
        assert client.post("/_nicegui_ws/socket.io/", content=b"x" * (2 * MOST_BYTES)).status_code == 413
        assert client.get("/files/photo.jpg").status_code == 200
    assert httpx.get(home + "/").status_code == 403
    assert httpx.get(home + "/files/photo.jpg").status_code == 403
    # Its token leads one browser to the page.
    assert httpx.get(demo.address).status_code == 403


# Clicks that the page once swallowed.


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
