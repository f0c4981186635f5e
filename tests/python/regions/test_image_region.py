"""Image regions: areas and centroids of masks, contours and their bearings."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import numpy as np
import pytest
import regionpose as rp
import shapely
from flat_shapes import area, centroid, disc, polygon_of
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from numpy.typing import ArrayLike, NDArray
from regionpose import kernels
from regionpose.cameras import Camera
from regionpose.regions import pixel_edges
from regionpose.regions.pixel_edges import BEND_TOLERANCE_PX
from skimage.measure import find_contours

from benchmarks.synthetic import area_coverage, binary_mask

Array = NDArray[np.float64]

WIDTH, HEIGHT = 240, 180

SIMPLIFY_TOLERANCE_PX = 0.01
"""Vertices of a mask's contour within this distance of the line through their neighbors are left out."""

COVERAGE_EDGE_PX = 0.1
"""Distance of a coverage's contour from a straight edge: linear interpolation is off by 0.09 on some diagonals."""

CUT_CORNERS_PX2 = 12.0
"""Pixels that the contour cuts off the corners of a triangle and of its hole, at the most."""

COVERAGE_CENTROID_PX = 0.1
"""Of a coverage's contour: only the cut corners move it."""

BINARY_EDGE_PX = 0.51
"""Mean distance of a binary mask's contour from an edge: half a pixel along edges that follow the centers."""

BINARY_CENTROID_PX = 0.62
"""Of a binary mask's contour: half a pixel where all of the boundary follows the centers, and 0.6 where a hole of a
tenth
of the area does so the other way."""


@st.composite
def image_shapes(draw: st.DrawFn) -> list[Array]:
    """A disc or a convex polygon, 20 to 80 px in radius, sometimes with a hole."""
    radius = draw(st.floats(20.0, 80.0))
    center = (draw(st.floats(100.0, 140.0)), draw(st.floats(85.0, 95.0)))
    corners = draw(st.sampled_from([3, 4, 5, 6, 400]))
    outer = disc(radius, center, corners)
    hole = disc(0.3 * radius, center, corners)[::-1]
    return [outer, hole] if draw(st.booleans()) else [outer]


@settings(max_examples=40, deadline=None)
@given(image_shapes())
def test_a_coverage_keeps_area_and_centroid(rings: list[Array]) -> None:
    region = rp.ImageRegion.from_mask(area_coverage(rings, WIDTH, HEIGHT))
    assert len(region.rings) == len(rings)
    assert region.area == pytest.approx(area(rings), abs=COVERAGE_EDGE_PX * polygon_of(rings).length + CUT_CORNERS_PX2)
    assert region.area == pytest.approx(area(region.rings), rel=1e-12)
    assert np.abs(centroid(region.rings) - centroid(rings)).max() < COVERAGE_CENTROID_PX


@settings(max_examples=40, deadline=None)
@given(image_shapes())
def test_a_binary_mask_keeps_area_and_centroid(rings: list[Array]) -> None:
    """The area's error is a random part of the half pixel along the boundary."""
    region = rp.ImageRegion.from_mask(binary_mask(rings, WIDTH, HEIGHT))
    assert len(region.rings) == len(rings)
    assert abs(region.area - area(rings)) < BINARY_EDGE_PX * polygon_of(rings).length
    assert np.abs(centroid(region.rings) - centroid(rings)).max() < BINARY_CENTROID_PX


def test_a_coverage_says_more_than_a_binary_mask() -> None:
    """The contour of a disc's coverage lies five times nearer to the circle than that of its binary mask."""
    ring = disc(60.3, (120.4, 90.7))
    circle = shapely.LinearRing(ring)
    coverage, binary = (
        rp.ImageRegion.from_mask(mask).rings[0]
        for mask in (area_coverage([ring], WIDTH, HEIGHT), binary_mask([ring], WIDTH, HEIGHT))
    )
    far = [float(np.max(shapely.distance(circle, shapely.points(ring)))) for ring in (coverage, binary)]
    assert far[0] < 0.1
    assert far[1] < 0.75
    assert far[0] < far[1] / 5.0


@pytest.mark.parametrize("dtype", [np.bool_, np.uint8, np.int32, np.float32, np.float64])
def test_masks_of_every_type_are_one_region(dtype: type) -> None:
    mask = binary_mask([disc(40.0, (100.0, 80.0))], WIDTH, HEIGHT)
    given_mask = (mask * 255).astype(dtype) if dtype in (np.uint8, np.int32) else mask.astype(dtype)
    expected = rp.ImageRegion.from_mask(mask)
    region = rp.ImageRegion.from_mask(given_mask)
    assert all(np.array_equal(a, b) for a, b in zip(region.rings, expected.rings, strict=True))
    assert region.mask is not None and region.mask.coverage.dtype == np.bool_
    np.testing.assert_array_equal(region.mask.full(), mask)


@pytest.mark.parametrize(
    ("dtype", "wrong", "found"),
    [
        (np.float64, np.nan, "values from nan to nan"),
        (np.float32, np.inf, "values from 0.0 to inf"),
        (np.float64, -0.5, r"values from -0\.5 to 1\.0"),
        (np.uint8, 7, "3 integer values"),
        (np.int32, -1, "3 integer values"),
    ],
)
def test_a_wrong_value_far_from_the_region_is_refused(dtype: type, wrong: float, found: str) -> None:
    mask: Array = binary_mask([disc(10.0, (50.0, 40.0))], WIDTH, HEIGHT).astype(dtype)
    mask[-1, -1] = wrong
    with pytest.raises(ValueError, match=f"mask holds {found}; needed"):
        rp.ImageRegion.from_mask(mask)


def test_a_mask_is_kept_whole() -> None:
    """With coverage below a half in the far corner, where no contour runs."""
    coverage = area_coverage([disc(10.0, (50.0, 40.0))], WIDTH, HEIGHT)
    coverage[-1, -1] = 0.25
    region = rp.ImageRegion.from_mask(coverage)
    assert region.mask is not None and len(region.rings) == 1
    np.testing.assert_array_equal(region.mask.full(), coverage)


def test_a_mask_keeps_its_window_alone() -> None:
    mask = np.zeros((1000, 2000), dtype=np.float32)
    mask[300:310, 500:520] = 0.75
    window = rp.ImageRegion.from_mask(mask).mask
    assert window is not None and window.coverage.base is None and window.coverage.dtype == np.float32
    assert (window.coverage.shape, window.offset, window.shape) == ((10, 20), (500, 300), (1000, 2000))
    pixels, coverage = window.covered_pixels()
    assert len(pixels) == 200 and set(coverage) == {0.75}
    assert pixels.min(axis=0).tolist() == [500.0, 300.0] and pixels.max(axis=0).tolist() == [519.0, 309.0]


@settings(max_examples=40, deadline=None)
@given(arrays(np.bool_, st.tuples(st.integers(1, 20), st.integers(1, 20))))
def test_a_binary_window_hands_out_what_it_was_given(given_window: NDArray[np.bool_]) -> None:
    rows, columns = given_window.shape
    window = rp.regions.MaskWindow(given_window, (3, 2), (rows + 5, columns + 4))
    assert window.coverage.dtype == np.bool_ and not window.coverage.flags.writeable
    np.testing.assert_array_equal(window.coverage, given_window)
    np.testing.assert_array_equal(window.full()[2 : 2 + rows, 3 : 3 + columns], given_window)
    assert window.full().sum() == given_window.sum() == len(window.covered_pixels()[0])


@pytest.mark.parametrize("offset", [(-1, 0), (0, 7), (9, 0)])
def test_a_window_that_leaves_its_image_is_refused(offset: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match=r"leaves the image of shape \(10, 12\); needed one inside"):
        rp.regions.MaskWindow(np.ones((4, 4), dtype=np.bool_), offset, (10, 12))


LAYOUTS: dict[str, Callable[[NDArray[np.bool_]], ArrayLike]] = {
    "transposed": np.asfortranarray,
    "sliced": lambda mask: np.repeat(mask, 2, axis=1)[:, ::2],
    "turned": lambda mask: mask[::-1, ::-1].copy()[::-1, ::-1],
    "wide": lambda mask: mask.astype(np.longdouble),
    "half": lambda mask: mask.astype(np.float16),
    "foreign": lambda mask: mask.astype(">i4"),
    "negative": lambda mask: -mask.astype(np.int64),
    "listed": lambda mask: mask.astype(int).tolist(),
}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_masks_of_every_layout_are_one_region(layout: str) -> None:
    mask = binary_mask([disc(40.0, (100.0, 80.0))], WIDTH, HEIGHT)
    region, expected = rp.ImageRegion.from_mask(LAYOUTS[layout](mask)), rp.ImageRegion.from_mask(mask)
    assert all(np.array_equal(a, b) for a, b in zip(region.rings, expected.rings, strict=True))
    assert region.mask is not None and np.array_equal(region.mask.full(), mask)


COVERAGES = st.sampled_from([0.0, 0.125, 0.375, 0.5, 0.625, 1.0])


@settings(max_examples=200, deadline=None)
@given(arrays(np.float64, array_shapes(min_dims=2, max_dims=2, max_side=8), elements=COVERAGES))
def test_every_coverage_has_simple_rings_around_the_pixels_above_a_half(mask: Array) -> None:
    """With the level itself among the values, where a contour that passes a center could touch itself."""
    if mask.max() <= 0.5:
        with pytest.raises(ValueError, match="mask is empty"):
            rp.ImageRegion.from_mask(mask)
        return
    region = rp.ImageRegion.from_mask(mask)
    assert all(shapely.LinearRing(ring).is_simple for ring in region.rings)
    assert region.mask is not None and np.array_equal(region.mask.full(), mask)
    rows, columns = np.mgrid[: mask.shape[0], : mask.shape[1]]
    inside = shapely.contains_xy(polygon_of(region.rings), columns, rows)
    assert np.array_equal(inside | (mask == 0.5), mask >= 0.5)


@settings(max_examples=200, deadline=None)
@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12)))
def test_the_contour_of_a_binary_mask_is_that_of_scikit_image(mask: NDArray[np.bool_]) -> None:
    padded = np.pad(mask, 1).astype(np.float64)
    contours = [contour[:, ::-1] - 1.0 for contour in find_contours(padded, 0.5)]  # type: ignore[no-untyped-call]
    if not contours:
        return
    # Far from the border of the array nothing is cut.
    region = rp.ImageRegion.from_mask(np.pad(mask, 3))
    traced = polygon_of([ring - 3.0 for ring in region.rings])
    assert len(region.rings) == len(contours)
    assert traced.symmetric_difference(polygon_of(contours)).area < 1e-9


def test_a_region_at_the_border_is_closed_half_a_pixel_outside() -> None:
    mask = np.ones((30, 50), dtype=bool)
    region = rp.ImageRegion.from_mask(mask)
    low, high = region.rings[0].min(axis=0), region.rings[0].max(axis=0)
    assert np.allclose(low, [-0.5, -0.5]) and np.allclose(high, [49.5, 29.5])
    cut = binary_mask([disc(40.0, (0.0, 20.0))], 50, 60)
    edge = rp.ImageRegion.from_mask(cut).rings[0]
    assert edge[:, 0].min() == pytest.approx(-0.5) and edge[:, 1].min() == pytest.approx(-0.5)


def test_holes_and_parts_are_kept() -> None:
    parts = [
        disc(30.0, (50.0, 60.0)),
        disc(10.0, (50.0, 60.0))[::-1],
        disc(20.0, (150.0, 90.0)),
        disc(4.0, (52.0, 60.0)),
    ]
    region = rp.ImageRegion.from_mask(binary_mask(parts, WIDTH, HEIGHT))
    areas = sorted(_signed(ring) for ring in region.rings)
    expected = sorted(np.array([-1.0, 1.0, 1.0, 1.0]) * np.pi * np.square([10.0, 4.0, 20.0, 30.0]))
    assert np.allclose(areas, expected, rtol=0.0, atol=25.0)
    assert region.area == pytest.approx(sum(areas), rel=1e-12)


def _signed(ring: Array) -> float:
    following = np.roll(ring, -1, axis=0)
    return float(0.5 * np.sum(ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]))


def test_pixels_that_touch_at_a_corner_are_two_parts_or_one_simple_ring() -> None:
    mask = np.zeros((8, 8), dtype=bool)
    mask[2, 2] = mask[3, 3] = True
    region = rp.ImageRegion.from_mask(mask)
    assert all(shapely.LinearRing(ring).is_simple for ring in region.rings)
    assert 0.9 < region.area < 2.1


@settings(max_examples=15, deadline=None)
@given(image_shapes(), st.booleans())
def test_simplification_stays_within_its_tolerance(rings: list[Array], binary: bool) -> None:
    """Every vertex of the full contour is near the simplified one, and the other way round."""
    mask = binary_mask(rings, WIDTH, HEIGHT) if binary else area_coverage(rings, WIDTH, HEIGHT)
    full = [contour[:, ::-1] for contour in find_contours(np.asarray(mask, dtype=float), 0.5)]  # type: ignore[no-untyped-call]
    region = rp.ImageRegion.from_mask(mask)
    assert sum(map(len, region.rings)) < sum(map(len, full))
    outline = shapely.MultiLineString([shapely.LinearRing(ring) for ring in region.rings])
    assert shapely.distance(outline, shapely.points(np.vstack(full))).max() <= SIMPLIFY_TOLERANCE_PX + 1e-9
    assert shapely.distance(shapely.MultiLineString(full), shapely.points(np.vstack(region.rings))).max() < 1e-9


def test_a_polygon_turns_counter_clockwise_and_its_hole_the_other_way() -> None:
    outer, hole = disc(40.0, (60.0, 60.0), 20), disc(10.0, (60.0, 60.0), 20)
    for rings in ([outer, hole], [outer[::-1], hole], [outer, hole[::-1]]):
        region = rp.ImageRegion.from_polygon(rings)
        assert _signed(region.rings[0]) > 0.0 > _signed(region.rings[1])
        assert region.area == pytest.approx(area(rings), rel=1e-12)
    assert region.mask is None


def test_one_array_a_list_of_vertices_and_a_stack_are_rings() -> None:
    ring = disc(40.0, (60.0, 60.0), 10)
    for given_rings in (ring, ring.tolist(), [ring], ring[None], tuple(ring)):
        assert np.array_equal(rp.ImageRegion.from_polygon(given_rings).rings[0], ring)
    lifted = np.column_stack([ring, np.ones(len(ring))])
    assert rp.WorldRegion.from_polygon(lifted.tolist()).area == pytest.approx(area([ring]), rel=1e-12)


CAMERAS = [
    rp.PinholeCamera(300.0, 305.0, 320.0, 240.0, width=640, height=480, distortion=(-0.3, 0.1, 1e-3, -2e-3)),
    rp.FisheyeCamera(180.0, 181.0, 320.0, 240.0, distortion=(0.02, -0.003, 0.0, 0.0), width=640, height=480),
    rp.cameras.OcamCamera((200.0, 0.0, -1.1e-3, 1.2e-6), (320.0, 240.0), width=640, height=480),
    rp.cameras.UnifiedCamera(
        400.0, 400.0, 320.0, 240.0, xi=1.2, distortion=(-0.1, 0.02, 1e-3, 0.0), width=640, height=480
    ),
]


@pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: type(camera).__name__)
@pytest.mark.parametrize("corners", [3, 4, 20, 400])
def test_arcs_between_bearings_stay_on_the_pixel_edges(camera: Camera, corners: int) -> None:
    """The middles and quarters of the arcs, projected back, are within the tolerance of the polygon."""
    ring = disc(180.0, (330.0, 235.0), corners)
    [bearings] = rp.ImageRegion.from_polygon(ring).bearings(camera)
    assert np.allclose(np.linalg.norm(bearings, axis=1), 1.0, rtol=0.0, atol=1e-14)
    edges = shapely.LinearRing(ring)
    following = np.roll(bearings, -1, axis=0)
    for share in (0.25, 0.5, 0.75):
        pixels = camera.project(bearings + share * (following - bearings))
        assert shapely.distance(edges, shapely.points(pixels)).max() <= BEND_TOLERANCE_PX
    assert shapely.distance(shapely.points(camera.project(bearings)), edges).max() < 1e-8


@pytest.mark.parametrize("camera", [rp.PinholeCamera(300.0, 300.0, 320.0, 240.0), *CAMERAS[:2]], ids=str)
@pytest.mark.parametrize("most", [1, 7, 1000])
def test_rings_that_are_mapped_at_once_have_the_bearings_of_each_alone(
    camera: Camera, most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pixel_edges, "MOST_VERTICES", most)
    rings = [disc(radius, (330.0, 235.0), corners) for radius, corners in ((180.0, 4), (20.0, 3), (90.0, 400))]
    at_once = pixel_edges.bearings_of_rings(camera, rings)
    assert at_once is not None
    for ring, bearings in zip(rings, at_once, strict=True):
        assert np.array_equal(bearings, rp.ImageRegion.from_polygon(ring).bearings(camera)[0])


def test_rings_beyond_a_camera_s_rays_are_not_mapped() -> None:
    camera = rp.FisheyeCamera(180.0, 181.0, 320.0, 240.0)
    assert pixel_edges.bearings_of_rings(camera, []) is None
    assert pixel_edges.bearings_of_rings(camera, [disc(9.0, (3e4, 0.0), 5)]) is None


def test_an_ideal_pinhole_needs_no_more_bearings_than_vertices() -> None:
    ring = disc(180.0, (330.0, 235.0), 8)
    camera = rp.PinholeCamera(300.0, 300.0, 320.0, 240.0)
    assert len(rp.ImageRegion.from_polygon(ring).bearings(camera)[0]) == len(ring)


def test_the_pixels_of_a_mask_fill_its_solid_angle() -> None:
    ring = disc(150.3, (300.0, 240.0))
    region = rp.ImageRegion.from_mask(area_coverage([ring], 640, 480))
    for camera in CAMERAS:
        bearings, solid_angles = region.pixel_bearings(camera)
        expected = kernels.spherical_moments(region.bearings(camera), 0)[0, 0, 0]
        assert solid_angles.min() > 0.0 and bearings.shape == (len(solid_angles), 3)
        assert solid_angles.sum() == pytest.approx(expected, rel=1e-4)


def test_image_regions_come_back_from_a_pickle() -> None:
    image = rp.ImageRegion.from_mask(np.pad(np.ones((4, 5)), 2))
    assert np.array_equal(pickle.loads(pickle.dumps(image)).rings[0], image.rings[0])
