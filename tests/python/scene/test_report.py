from __future__ import annotations

import re
import shutil
from base64 import b64decode
from html.parser import HTMLParser
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from markupsafe import escape
from PIL import Image
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import SceneEstimate, estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.scene.report import Figure, Report, data_url, report_html
from regionpose.scene.result import scene_result
from regionpose.viz.splat import BACKGROUND, Viewpoint, splatted, viewpoints
from scene_files import scene_values, write_scene


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> SceneEstimate:
    return estimate_scene(load_scene(write_scene(tmp_path_factory.mktemp("scene"))))


def page(run: SceneEstimate, title: str = "A title") -> str:
    picture = np.full((20, 30, 3), 90, dtype=np.uint8)
    warning = {"text": "<b>weak</b> & poor", "advice": "look"}
    result = {**scene_result(run), "status": "check", "headline": "Head < line", "warnings": [warning]}
    return report_html(Report(title, result, [Figure(picture, "one")], []))


class Balance(HTMLParser):
    """Collects tags that are opened and not closed, and the resources that a page loads."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loaded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.loaded += [value or "" for name, value in attrs if name in {"src", "href", "srcset", "data"}]
        if tag not in {"meta", "img", "br", "link"}:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_report_is_whole_html_that_loads_nothing(run: SceneEstimate) -> None:
    html, balance = page(run), Balance()
    balance.feed(html)
    assert balance.open == []
    assert balance.loaded and all(url.startswith("data:image/jpeg;base64,") for url in balance.loaded)
    assert not re.search(r"https?://|@import|url\(", html)


def test_text_from_files_is_escaped(run: SceneEstimate) -> None:
    html = page(run, "<script>alert(1)</script>")
    assert "<script>" not in html and "<b>weak" not in html
    assert "&lt;b&gt;weak&lt;/b&gt; &amp; poor" in html


@pytest.mark.parametrize("name", ["<script>alert(1)</script>", "\"'><img src=x>", "&lt;", "\u200frtl\u200f", "x" * 200])
def test_region_names_are_text_alone(name: str, tmp_path: Path) -> None:
    """A page with any name holds the same elements as one with a plain name."""
    values = scene_values()
    elements = []
    for given in ("plain", name):
        values["regions"][0]["name"] = given
        html = page(estimate_scene(load_scene(write_scene(tmp_path, values))))
        elements.append([tag for tag in re.findall(r"<[^>]*>", html) if "base64" not in tag])
        assert escape(given) in html
    assert elements[0] == elements[1]


@pytest.mark.parametrize(("name", "said"), [("a\nb", r"U\+000A"), ("\u202egpj.exe", r"U\+202E"), ("x" * 10_000, "200")])
def test_region_names_that_no_line_holds_are_refused(name: str, said: str, tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["name"] = name
    with pytest.raises(SceneError, match=said):
        load_scene(write_scene(tmp_path, values))


@pytest.mark.parametrize("name", ["<img src=x onerror=alert(1)>.png", "\"'&lt;\n\u202egpj.png", "9" * 240 + ".png"])
def test_file_names_are_text_alone(name: str, tmp_path: Path) -> None:
    elements = []
    for given in ("plain.png", name):
        path = write_scene(tmp_path, scene_values() | {"image": given})
        shutil.copy(tmp_path / "image.png", tmp_path / given)
        html = page(estimate_scene(load_scene(path)))
        elements.append([tag for tag in re.findall(r"<[^>]*>", html) if "base64" not in tag])
    assert elements[0] == elements[1]


def test_the_report_says_what_the_result_holds(run: SceneEstimate) -> None:
    html, result = page(run), scene_result(run)
    for region in result["diagnostics"]["regions"]:
        assert f"<td>{region['name']}</td><td>{100 * region['overlap_error']:.2f} %</td>" in html
    for entry in result["inputs"]:
        assert entry["sha256"] in html
    assert "camera_from_world" in html and "world_from_camera" in html and "T_lidar_camera" in html
    assert f"{result['sigma']['translation_m'][2] * 1000:.2f}" in html


def test_a_result_with_an_initial_pose_shows_both_errors(run: SceneEstimate) -> None:
    result = scene_result(run)
    for region, before in zip(result["diagnostics"]["regions"], (0.25, None), strict=True):
        region["overlap_error_before"] = before
    html = report_html(Report("t", result, []))
    first, second = result["diagnostics"]["regions"]
    assert "<th>overlap error before</th><th>overlap error after</th>" in html
    assert f"<td>{first['name']}</td><td>25.00 %</td><td>{100 * first['overlap_error']:.2f} %</td>" in html
    assert f"<td>{second['name']}</td><td>unknown</td>" in html
    assert "overlap error before" not in page(run)


def test_the_page_prints_dark_on_white_without_cutting_tables_and_pictures(run: SceneEstimate) -> None:
    rules = page(run).partition("@media print{")[2].partition("</style>")[0]
    assert "--ink:#000" in rules and "--paper:#fff" in rules
    assert "break-inside:avoid" in rules and "overflow-wrap:anywhere" in rules


def test_unknown_numbers_are_said_to_be_unknown(run: SceneEstimate) -> None:
    result = scene_result(run)
    result["covariance"] = [[None] * 6] * 6
    result["sigma"] = {"rotation_deg": [None] * 3, "translation_m": [None] * 3}
    result["diagnostics"] |= {"overlap_error": None, "boundary_noise_px": None}
    html = report_html(Report("t", result, []))
    assert html.count("unknown") >= 9


def test_large_pictures_are_scaled_down() -> None:
    url = data_url(np.zeros((900, 3200, 3), dtype=np.uint8))
    held = Image.open(BytesIO(b64decode(url.partition(",")[2])))
    assert held.size == (1600, 450)


def test_a_splat_lies_where_a_pinhole_camera_sees_it_and_hides_what_is_behind() -> None:
    view = Viewpoint(np.array([0.0, -5.0, 0.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]), field_deg=90.0)
    points = np.array([[0.0, 0.0, 0.0], [0.0, 3.0, 0.0], [2.5, 0.0, 1.0], [0.0, -9.0, 0.0]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [9, 9, 9]], dtype=np.uint8)
    picture = splatted(points, colors, view, 200, 100)
    assert picture[51, 101].tolist() == [255, 0, 0]
    assert picture[31, 151].tolist() == [0, 0, 255]
    drawn = {tuple(color) for color in picture.reshape(-1, 3).tolist()}
    assert drawn == {BACKGROUND, (255, 0, 0), (0, 0, 255)}


def test_viewpoints_look_at_the_points_from_two_sides() -> None:
    rng = np.random.default_rng(5)
    points = rng.uniform(-1.0, 1.0, (400, 3)) + np.array([0.0, 6.0, 0.0])
    left, right = viewpoints(points, np.zeros(3), np.array([0.0, 0.0, 1.0]))
    for view in (left, right):
        np.testing.assert_allclose(view.rotation @ view.rotation.T, np.eye(3), atol=1e-12)
        assert view.eye[2] > view.target[2], "raised"
        seen = (points - view.eye) @ view.rotation.T
        assert (seen[:, 2] > 0).all()
    # The camera looks along y with z up, so its left is at negative x.
    assert left.eye[0] < 0 < right.eye[0]


def test_views_work_without_points_and_straight_from_above() -> None:
    view = Viewpoint(np.array([0.0, 0.0, 5.0]), np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert np.isfinite(view.rotation).all()
    empty = splatted(np.empty((0, 3)), np.empty((0, 3), dtype=np.uint8), view, 40, 30)
    assert (empty == BACKGROUND).all()


def test_the_report_is_written_beside_the_result(tmp_path: Path, run: SceneEstimate) -> None:
    from regionpose.scene.bundle import bundle
    from regionpose.scene.stages import Stages

    made = bundle(run, Stages())
    made.writers["report.html"](tmp_path / "report.html")
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.startswith("<!doctype html>") and html.count("<figure>") == 1
