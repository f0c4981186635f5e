"""Edges of an image region that are not its own: marked on polygons, beside unknown pixels of masks, in scene files."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
import shapely
from numpy.typing import NDArray
from PIL import Image
from regionpose.cameras import Camera
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.scene.result import scene_result
from regionpose.solve.contours import contours_of
from scene_files import CAMERA as SMALL_CAMERA
from scene_files import PLATES, scene_values, write_scene
from scene_files import POSE as SMALL_POSE
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

WIDTH, HEIGHT = 640, 480
CAMERAS: dict[str, Camera] = {
    "pinhole": rp.PinholeCamera(600.0, 610.0, 321.0, 238.0, width=WIDTH, height=HEIGHT),
    "fisheye": rp.FisheyeCamera(
        350.0, 350.0, 319.5, 239.5, distortion=(0.02, -0.01, 0.002, 0.0), width=WIDTH, height=HEIGHT
    ),
}
POSE = rp.Pose(Rotation.from_euler("xyz", [25.0, -20.0, 12.0], degrees=True), np.array([0.1, -0.05, 3.2]))

SHAPE = np.array([[-0.9, -0.6], [0.7, -0.7], [1.0, 0.4], [0.3, 0.5], [0.2, 0.9], [-0.7, 0.6]])
"""An outline without symmetry, meters."""

RING = np.column_stack([SHAPE, np.zeros(len(SHAPE))])
WORLD = rp.WorldRegion.from_polygon(RING)

OCCLUDERS = {"pinhole": 240.0, "fisheye": 270.0}
"""Column to the left of which something stands before the region."""

EXACT_ROTATION = np.radians(0.02)
"""Of polygons; pieces of a contour round its corners."""

MASK_ROTATION = np.radians(0.5)
"""Of binary masks of some hundred pixels."""


def seen(camera: Camera) -> shapely.Polygon:
    """The whole region in pixels, its edges split where the camera bends them."""
    steps = np.linspace(0.0, 1.0, 200, endpoint=False)[:, None]
    dense = np.concatenate([a + steps * (b - a) for a, b in zip(RING, np.roll(RING, -1, axis=0), strict=True)])
    return shapely.Polygon(camera.project(POSE.transform(dense)))


def left_by_occluder(name: str) -> tuple[Array, list[int]]:
    """What the occluder leaves of it, vertices (n, 2), and the edges along it."""
    camera, occluder = CAMERAS[name], OCCLUDERS[name]
    left = shapely.intersection(seen(camera), shapely.box(occluder, 0.0, WIDTH, HEIGHT))
    assert 0.5 < left.area / seen(camera).area < 0.95
    ring = np.asarray(shapely.get_coordinates(left))[:-1]
    on_it = np.isclose(ring[:, 0], occluder) & np.isclose(np.roll(ring[:, 0], -1), occluder)
    return ring, np.flatnonzero(on_it).tolist()


def mask_of(polygon: shapely.Polygon) -> NDArray[np.bool_]:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(shapely.contains_xy(polygon, columns, rows))


def rotation_error(estimate: rp.PoseEstimate) -> float:
    """Rotation (rad) of the nearest answer."""
    answers = [estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)]
    return min(float((POSE.rotation * answer.rotation.inv()).magnitude()) for answer in answers)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_polygon_with_a_hidden_edge_gives_the_pose(name: str, turned: bool) -> None:
    camera = CAMERAS[name]
    ring, hidden = left_by_occluder(name)
    if turned:
        # Edge i of the ring turned round goes from its vertex i: the former one n - 2 - i.
        ring, hidden = ring[::-1], [(len(ring) - 2 - edge) % len(ring) for edge in hidden]
    image = rp.ImageRegion.from_polygon(ring, hidden_edges=hidden)
    assert image.hidden is not None and image.hidden[0].sum() == 1
    marked = image.rings[0][image.hidden[0]][0], np.roll(image.rings[0], -1, axis=0)[image.hidden[0]][0]
    np.testing.assert_allclose([vertex[0] for vertex in marked], OCCLUDERS[name])
    found = rp.estimate_pose(camera, [image], [WORLD])
    assert rotation_error(found) < EXACT_ROTATION * (10.0 if name == "fisheye" else 1.0)
    assert found.diagnostics.overlap_error < 0.01
    assert not {"poor-overlap", "outlier-region"} & {warning.code for warning in found.warnings}


@pytest.mark.parametrize("coverage", [False, True])
@pytest.mark.parametrize("name", CAMERAS)
def test_a_mask_beside_unknown_pixels_gives_the_pose(name: str, coverage: bool) -> None:
    camera, occluder = CAMERAS[name], OCCLUDERS[name]
    mask: NDArray[Any] = mask_of(seen(camera))
    unknown = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    unknown[:, : int(occluder)] = 255
    image = rp.ImageRegion.from_mask(mask.astype(np.float32) if coverage else mask, unknown=unknown)
    assert image.hidden is not None
    ends = np.roll(image.rings[0], -1, axis=0)
    along = np.abs(image.rings[0][:, 0] - occluder) + np.abs(ends[:, 0] - occluder) < 4.0
    assert image.hidden[0].any() and along[image.hidden[0]].all(), "what is hidden runs along the unknown pixels"
    lengths = np.linalg.norm(ends - image.rings[0], axis=1)
    assert lengths[along & ~image.hidden[0]].sum() < 4.0
    found = rp.estimate_pose(camera, [image], [WORLD])
    assert rotation_error(found) < MASK_ROTATION
    assert not {"poor-overlap", "outlier-region"} & {warning.code for warning in found.warnings}


def test_what_the_mask_says_of_unknown_pixels_does_not_count() -> None:
    mask, unknown = np.zeros((40, 60), dtype=bool), np.zeros((40, 60), dtype=bool)
    mask[10:30, 10:40], unknown[:, 30:] = True, True
    told = rp.ImageRegion.from_mask(mask, unknown=unknown)
    mask[:, 30:] = False
    other = rp.ImageRegion.from_mask(mask, unknown=unknown)
    for one, two in ((told.rings, other.rings), (told.hidden, other.hidden)):
        assert one is not None and two is not None
        assert [part.tolist() for part in one] == [part.tolist() for part in two]
    assert told.area == pytest.approx(20 * 20, abs=1.0)
    assert rp.ImageRegion.from_mask(mask, unknown=np.zeros((40, 60))).hidden is None


def test_an_edge_is_split_where_the_unknown_pixels_begin() -> None:
    """A square whose right side has unknown pixels beside its lower half."""
    mask, unknown = np.zeros((60, 60), dtype=bool), np.zeros((60, 60), dtype=bool)
    mask[10:50, 10:50], unknown[30:50, 50:] = True, True
    image = rp.ImageRegion.from_mask(mask, unknown=unknown)
    assert image.hidden is not None
    hidden = image.hidden[0]
    length = np.linalg.norm(np.roll(image.rings[0], -1, axis=0) - image.rings[0], axis=1)[hidden].sum()
    assert length == pytest.approx(20.0, abs=1.5)
    assert np.abs(image.rings[0][hidden][:, 0] - 49.5).max() <= 0.5
    whole = rp.ImageRegion.from_mask(mask)
    assert image.area == pytest.approx(whole.area, rel=1e-12)


def test_hidden_edges_are_no_pieces_of_the_contour() -> None:
    camera = CAMERAS["pinhole"]
    ring, hidden = left_by_occluder("pinhole")
    image = rp.ImageRegion.from_polygon(ring, hidden_edges=hidden)
    pieces = contours_of(camera, [image], [WORLD], POSE).pieces
    assert np.abs(pieces[:, 0] - OCCLUDERS["pinhole"]).min() > 0.5
    whole = contours_of(camera, [rp.ImageRegion.from_polygon(ring)], [WORLD], POSE).pieces
    assert len(pieces) < len(whole) and np.abs(whole[:, 0] - OCCLUDERS["pinhole"]).min() < 0.01


def test_holes_have_lists_of_their_own_and_pickles_keep_them() -> None:
    outer = np.array([[0.0, 0.0], [100.0, 0.0], [100.0, 80.0], [0.0, 80.0]])
    hole = np.array([[40.0, 20.0], [60.0, 20.0], [60.0, 40.0]])
    image = pickle.loads(pickle.dumps(rp.ImageRegion.from_polygon([outer, hole], hidden_edges=[[1, 2], [0]])))
    assert [marks.sum() for marks in image.hidden] == [2, 1]
    assert [len(line) for line in image.hidden_bearings(CAMERAS["pinhole"])] == [3, 2]
    assert [marks.sum() for marks in image.excluded_edges(CAMERAS["pinhole"])] == [4, 1], (
        "two sides are the image's border"
    )
    outline = rp.ImageRegion.from_polygon([outer, hole], hidden_edges=[3])
    assert outline.hidden is not None and [marks.sum() for marks in outline.hidden] == [1, 0]
    assert rp.ImageRegion.from_polygon(outer).hidden is None
    all_of_it = rp.ImageRegion.from_polygon(outer, hidden_edges=range(4))
    assert [len(line) for line in all_of_it.hidden_bearings(CAMERAS["pinhole"])] == [5]


SQUARE = [[100.0, 100.0], [200.0, 100.0], [200.0, 200.0], [100.0, 200.0]]
MASK = np.zeros((HEIGHT, WIDTH), dtype=bool)
MASK[100:200, 100:200] = True

REFUSED: list[tuple[Callable[[], object], str]] = [
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges=[4]), "hidden_edges holds 4; ring 0 has edges 0 to 3"),
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges=[-1]), "hidden_edges holds -1; ring 0 has edges 0 to 3"),
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges=[0.5]), "holds what is no index; needed a list of edge"),  # type: ignore[arg-type]
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges="0"), "hidden_edges is a str; needed a list of edge"),  # type: ignore[arg-type]
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges=2), "hidden_edges is a int; needed a list of edge"),  # type: ignore[arg-type]
    (lambda: rp.ImageRegion.from_polygon(SQUARE, hidden_edges=[[0], [1]]), "has 2 lists; needed one for each ring, 1"),
    (
        lambda: rp.estimate_pose(
            CAMERAS["pinhole"], [rp.ImageRegion.from_polygon(SQUARE, hidden_edges=range(4))], [WORLD]
        ),
        r"region 0: the share of the observed outline that is the region's own is 0.0 %, the rest of it hidden",
    ),
    (lambda: rp.ImageRegion.from_mask(MASK, unknown=MASK[:9]), r"unknown has shape \(9, 640\); needed the mask's"),
    (lambda: rp.ImageRegion.from_mask(MASK, unknown=MASK), "no pixel of the mask is known to be the region's"),
    (lambda: rp.ImageRegion.from_mask(MASK, unknown="hidden"), r"unknown has type <U6 and shape \(\)"),
    (lambda: rp.ImageRegion.from_mask(MASK, unknown=[[1], [1, 2]]), "unknown has rows of unequal length"),
]


@pytest.mark.parametrize(("make", "said"), REFUSED)
def test_what_is_no_edge_is_refused(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()


def scene_with(image: dict[str, Any]) -> dict[str, Any]:
    """The small scene, its first region seen so."""
    values = scene_values()
    values["regions"][0]["image"] = image
    return values


def test_a_scene_file_names_hidden_edges_and_unknown_pixels(tmp_path: Path) -> None:
    ring = SMALL_CAMERA.project(SMALL_POSE.transform(PLATES["floor"]))
    edge = float(ring[:, 0].min()) + 12.0
    left = shapely.intersection(shapely.Polygon(ring), shapely.box(edge, 0.0, 400.0, 300.0))
    polygon = np.asarray(shapely.get_coordinates(left))[:-1]
    hidden = np.flatnonzero(np.isclose(polygon[:, 0], edge) & np.isclose(np.roll(polygon[:, 0], -1), edge)).tolist()
    assert hidden
    values = scene_with({"polygon": polygon.tolist(), "hidden_edges": hidden})
    result = scene_result(estimate_scene(load_scene(write_scene(tmp_path, values))))
    # Few corners are left beside the hidden edge.
    assert {warning["code"] for warning in result["warnings"]} <= {"low-confidence"}
    np.testing.assert_allclose(result["camera_from_world"]["translation_m"], SMALL_POSE.translation, atol=1e-3)

    rows, columns = np.mgrid[:240, :320]
    whole = shapely.contains_xy(shapely.Polygon(ring), columns, rows)
    labels = np.where(columns < edge, 200, np.where(whole, 50, 0)).astype(np.uint8)
    Image.fromarray(labels).save(tmp_path / "labels.png")
    side = {"mask": "labels.png", "label": 50, "unknown": "labels.png", "unknown_label": 200}
    masked = scene_result(estimate_scene(load_scene(write_scene(tmp_path, scene_with(side)))))
    assert not {"poor-overlap", "outlier-region"} & {warning["code"] for warning in masked["warnings"]}
    np.testing.assert_allclose(masked["camera_from_world"]["translation_m"], SMALL_POSE.translation, atol=0.05)
    assert {role for entry in masked["inputs"] for role in entry["roles"]} >= {
        "mask of floor",
        "unknown pixels of floor",
    }


@pytest.mark.parametrize(
    ("image", "said"),
    [
        ({"polygon": SQUARE, "hidden_edges": [7]}, r"hidden_edges: hidden_edges holds 7; ring 0 has edges 0 to 3"),
        ({"polygon": SQUARE, "hidden_edges": [-1]}, r"hidden_edges\[0\]: found -1; needed greater than or equal to 0"),
        ({"polygon": SQUARE, "hidden_edges": 1}, r"hidden_edges: found 1; needed a list of edge indices, or one for"),
        (
            {"mask": "labels.png", "unknown_label": 3},
            r"unknown_label: found a label without its file; needed the key unknown",
        ),
    ],
)
def test_a_scene_file_is_told_which_line_is_wrong(image: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=rf"scene\.yaml:\d+: regions\[0\]\.image\.{said}"):
        estimate_scene(load_scene(write_scene(tmp_path, scene_with(image))))
