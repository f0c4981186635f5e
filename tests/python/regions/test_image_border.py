"""Regions that the border of the image cuts: traced masks, polygons, and the poses they give."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import pytest
import regionpose as rp
import shapely
from numpy.typing import NDArray
from regionpose.cameras import Camera
from regionpose.solve.contours import contours_of, distances_of
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Refine = Literal["contour"] | None

WIDTH, HEIGHT = 640, 480

CAMERAS: dict[str, Camera] = {
    "pinhole": rp.PinholeCamera(600.0, 610.0, 321.0, 238.0, width=WIDTH, height=HEIGHT),
    "distorted": rp.PinholeCamera(
        500.0, 500.0, 319.5, 239.5, distortion=(-0.25, 0.08, 0.001, -0.0005), width=WIDTH, height=HEIGHT
    ),
    "fisheye": rp.FisheyeCamera(
        250.0, 250.0, 319.5, 239.5, distortion=(0.02, -0.01, 0.002, 0.0), width=WIDTH, height=HEIGHT
    ),
}

SHAPE = np.array([[-0.9, -0.6], [0.7, -0.7], [1.0, 0.4], [0.3, 0.5], [0.2, 0.9], [-0.7, 0.6]])
"""An outline without symmetry, meters."""

BORDERS = {"left": (20.0, 240.0), "top": (320.0, 15.0), "right": (625.0, 230.0), "bottom": (310.0, 460.0)}
"""Pixels near the middle of each border, on which a region's center is seen."""

ROTATION = np.radians(1.0)
"""The paper's bound for solved."""

MASK_ROTATION = np.radians(0.5)
"""Binary masks of regions of some hundred pixels."""

EXACT_ROTATION = np.radians(0.02)
"""Polygons whose edges are exact but for the bend of the border between their vertices."""

POOR = 0.05
"""Overlap error from which a region is warned of."""


def pose_at(camera: Camera, pixel: tuple[float, float], distance: float = 3.0, spin: float = 20.0) -> rp.Pose:
    """The pose that shows the plane's origin in a pixel, the plane tilted against the ray."""
    ray = camera.bearings([pixel])[0]
    towards = Rotation.align_vectors([ray], [[0.0, 0.0, 1.0]])[0]
    return rp.Pose(towards * Rotation.from_euler("xyz", [25.0, -20.0, spin], degrees=True), distance * ray)


def world_ring(offset: tuple[float, float] = (0.0, 0.0)) -> Array:
    return np.column_stack([SHAPE + offset, np.zeros(len(SHAPE))])


def seen_polygon(camera: Camera, pose: rp.Pose, ring: Array) -> shapely.Polygon:
    """The region in pixels, its edges split where the camera bends them; as far as the image goes and 60 px beyond."""
    steps = np.linspace(0.0, 1.0, 200, endpoint=False)[:, None]
    dense = np.concatenate([a + steps * (b - a) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True)])
    return shapely.Polygon(camera.project(pose.transform(dense)))


def mask_of(polygon: shapely.Polygon) -> NDArray[np.bool_]:
    rows, columns = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(shapely.contains_xy(polygon, columns, rows))


def cut_polygon(polygon: shapely.Polygon, margin: float) -> Array:
    """What the image shows of a polygon, up to `margin` outside the outermost centers."""
    image = shapely.box(-margin, -margin, WIDTH - 1 + margin, HEIGHT - 1 + margin)
    return np.asarray(shapely.get_coordinates(shapely.intersection(polygon, image)))[:-1]


def angle_to(estimate: rp.PoseEstimate, pose: rp.Pose) -> float:
    """Rotation (rad) of the nearest answer."""
    found = [estimate.pose, *(other.pose for other in estimate.diagnostics.alternatives)]
    return min(float((pose.rotation * answer.rotation.inv()).magnitude()) for answer in found)


def estimate(camera: Camera, images: Sequence[rp.ImageRegion], *, refine: Refine, worlds: int = 1) -> rp.PoseEstimate:
    rings = [world_ring(), world_ring((2.5, 0.3))][:worlds]
    return rp.estimate_pose(
        camera, images, [rp.WorldRegion.from_polygon(ring) for ring in rings], solver=rp.Solver(refine=refine)
    )


@pytest.mark.parametrize("refine", ["contour", None])
@pytest.mark.parametrize("border", BORDERS)
@pytest.mark.parametrize("name", CAMERAS)
def test_a_mask_that_a_border_cuts_gives_the_pose(name: str, border: str, refine: Refine) -> None:
    camera = CAMERAS[name]
    # A fisheye has fewer pixels to the radian.
    pose = pose_at(camera, BORDERS[border], distance=1.8 if name == "fisheye" else 3.0)
    polygon = seen_polygon(camera, pose, world_ring())
    mask = mask_of(polygon)
    assert 0.3 < mask.sum() / polygon.area < 0.8, "the border cuts the region"
    found = estimate(camera, [rp.ImageRegion.from_mask(mask)], refine=refine)
    assert angle_to(found, pose) < MASK_ROTATION
    assert found.diagnostics.overlap_error < POOR and "poor-overlap" not in {warning.code for warning in found.warnings}


@pytest.mark.parametrize("margin", [0.0, 0.5, 1.0], ids=["centers", "border", "corners"])
@pytest.mark.parametrize("border", BORDERS)
def test_a_polygon_drawn_along_the_border_is_cut_there(border: str, margin: float) -> None:
    camera = CAMERAS["pinhole"]
    pose = pose_at(camera, BORDERS[border])
    ring = cut_polygon(seen_polygon(camera, pose, world_ring()), margin)
    region = rp.ImageRegion.from_polygon(ring)
    assert sum(int(edges.sum()) for edges in region.on_border(camera)) == 1
    assert angle_to(estimate(camera, [region], refine=None), pose) < (EXACT_ROTATION if margin == 0.5 else ROTATION)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_polygon_beyond_the_border_is_taken_at_its_word(name: str) -> None:
    camera = CAMERAS[name]
    pose = pose_at(camera, BORDERS["left"])
    ring = np.asarray(seen_polygon(camera, pose, world_ring()).exterior.coords)[:-1]
    region = rp.ImageRegion.from_polygon(ring)
    assert ring[:, 0].min() < -20.0 and region.border_bearings(camera) == []
    assert angle_to(estimate(camera, [region], refine=None), pose) < EXACT_ROTATION


@pytest.mark.parametrize("refine", ["contour", None])
@pytest.mark.parametrize("name", CAMERAS)
def test_two_regions_of_which_one_is_cut(name: str, refine: Refine) -> None:
    camera = CAMERAS[name]
    pose = pose_at(camera, (40.0, 200.0), distance=4.0, spin=0.0)
    masks = [mask_of(seen_polygon(camera, pose, ring)) for ring in (world_ring(), world_ring((2.5, 0.3)))]
    assert masks[0][:, 0].any() and not masks[1][[0, -1]].any() and not masks[1][:, [0, -1]].any()
    found = estimate(camera, [rp.ImageRegion.from_mask(mask) for mask in masks], refine=refine, worlds=2)
    assert angle_to(found, pose) < MASK_ROTATION
    assert found.diagnostics.region_overlap_errors.max() < POOR


@pytest.mark.parametrize("integration", ["boundary", "mesh", "pixels"])
def test_the_sphere_system_and_every_integral_are_cut_too(integration: Literal["boundary", "mesh", "pixels"]) -> None:
    camera = CAMERAS["fisheye"]
    pose = pose_at(camera, BORDERS["bottom"])
    image = rp.ImageRegion.from_mask(mask_of(seen_polygon(camera, pose, world_ring())))
    world = rp.WorldRegion.from_polygon(world_ring())
    found = rp.estimate_pose(
        camera, [image], [world], solver=rp.Solver(system="sphere", integration=integration, refine=None)
    )
    assert angle_to(found, pose) < MASK_ROTATION


def test_a_mask_is_traced_up_to_the_border() -> None:
    mask = np.zeros((60, 80), dtype=np.bool_)
    mask[:20, 50:] = True
    region = rp.ImageRegion.from_mask(mask)
    assert region.border == (-0.5, -0.5, 79.5, 59.5)
    (ring,) = region.rings
    assert ring.min(axis=0) == pytest.approx([49.5, -0.5]) and ring.max(axis=0) == pytest.approx([79.5, 19.5])
    # Where the boundary turns inside the image, half a square of half a pixel is missing.
    assert region.area == pytest.approx(20.0 * 30.0 - 0.125)
    on_border = region.on_border(CAMERAS["pinhole"])[0]
    lengths = np.hypot(*(np.roll(ring, -1, axis=0) - ring).T)
    assert lengths[on_border].sum() == pytest.approx(20.0 + 30.0)


def test_lines_of_the_border_follow_the_sides_that_cut() -> None:
    camera = rp.PinholeCamera(100.0, 100.0, 39.5, 29.5, width=80, height=60)
    corner, strip, inside = (np.zeros((60, 80), dtype=np.bool_) for _ in range(3))
    corner[:20, 50:], strip[20:40], inside[20:30, 20:30] = True, True, True
    lines = [
        [camera.project(line) for line in rp.ImageRegion.from_mask(mask).border_bearings(camera)]
        for mask in (corner, strip, inside)
    ]
    assert [len(found) for found in lines] == [1, 2, 0]
    np.testing.assert_allclose(lines[0][0], [[49.5 - 30.0, -0.5], [79.5, -0.5], [79.5, 19.5 + 30.0]], atol=1e-9)
    right, left = sorted(lines[1], key=lambda line: -float(line[0, 0]))
    assert np.allclose(right[:, 0], 79.5) and np.allclose(left[:, 0], -0.5)
    assert right[0, 1] < right[-1, 1] and left[0, 1] > left[-1, 1], "counter-clockwise in (x, y)"


def test_a_region_that_fills_the_image_is_refused() -> None:
    image = rp.ImageRegion.from_mask(np.ones((HEIGHT, WIDTH), dtype=np.bool_))
    with pytest.raises(ValueError, match=r"region 0.*inside the image.*0\.0 %"):
        estimate(CAMERAS["pinhole"], [image], refine=None)


@pytest.mark.parametrize("name", CAMERAS)
def test_pieces_of_a_rigs_contours_keep_off_the_border(name: str) -> None:
    camera = CAMERAS[name]
    pose = pose_at(camera, BORDERS["right"])
    image = rp.ImageRegion.from_mask(mask_of(seen_polygon(camera, pose, world_ring())))
    contours = contours_of(camera, [image], [rp.WorldRegion.from_polygon(world_ring())], pose)
    distances = distances_of(camera, contours, pose)
    assert sum(contours.rings) == len(contours.pieces) and distances is not None
    assert np.abs(distances.values).max() < 1.5
    assert contours.pieces[:, 0].max() < WIDTH - 1
