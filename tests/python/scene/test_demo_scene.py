"""The shipped scene agrees with itself and with the generator that made it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from regionpose.datasets.demo import DemoRegion, DemoScene, demo_folder, load_demo
from scipy.ndimage import distance_transform_edt

from tools.demo_scene import courtyard, generate, rendering
from tools.demo_scene.surfaces import Frame, Surface, are_blocked, first_hits, inside
from tools.demo_scene.textures import plain

Array = NDArray[np.float64]

BOUNDARY_PIXELS = 1.0
"""Distance between the centers of a border pixel and of the nearest pixel on the other side."""

TIP_PIXELS = 3.0
"""As far as this an acute corner may reach beyond the last pixel center that it holds."""

NOISE_BOUND = 6.0 * generate.RANGE_NOISE
"""Meters: of 10^5 normal errors none is expected beyond 6 deviations (chance 2e-4)."""

IMAGE_LEVELS = 3.0
"""Mean difference in levels that sensor noise (1.3 each in two pictures) and JPEG leave."""

SAME = 1e-9
"""Meters or unitless: a different processor may round the last digits of a rotation otherwise."""

FLOAT32_STEP = 2e-6
"""Meters: one step of float32 at 20 m."""


@pytest.fixture(scope="module")
def scene() -> DemoScene:
    return load_demo()


@pytest.fixture(scope="module")
def surfaces() -> list[Surface]:
    return courtyard.surfaces()


@pytest.fixture(scope="module")
def scan(surfaces: list[Surface]) -> generate.Scan:
    return generate.scanned(surfaces)


def in_camera(scene: DemoScene, points: Array) -> Array:
    return np.asarray(points @ scene.rotation.T + scene.translation)


def along_ring(ring: Array, count: int) -> Array:
    share = (np.arange(count) / count)[None, :, None]
    following = np.roll(ring, -1, axis=0)
    return np.asarray((ring[:, None] * (1.0 - share) + following[:, None] * share).reshape(-1, 3))


def plane_of(region: DemoRegion) -> tuple[Array, Array, Array]:
    """Origin, in-plane axes (2, 3) and unit normal; exact for coplanar rings."""
    ring = region.rings[0]
    origin = ring.mean(axis=0)
    axes = np.linalg.svd(ring - origin)[2]
    return origin, axes[:2], axes[2]


def distance_to_edges(ring: Array, points: Array) -> Array:
    """Distance (n,) from plane points (n, 2) to the nearest edge."""
    start, step = ring, np.roll(ring, -1, axis=0) - ring
    share = np.sum((points[:, None] - start) * step, axis=2) / np.sum(step**2, axis=1)
    nearest = start + np.clip(share, 0.0, 1.0)[..., None] * step
    return np.asarray(np.linalg.norm(points[:, None] - nearest, axis=2).min(axis=1))


def test_the_scene_has_the_promised_sizes(scene: DemoScene) -> None:
    assert scene.image.shape == (960, 1280, 3)
    assert scene.labels.shape == (960, 1280)
    assert scene.image.dtype == scene.labels.dtype == scene.intensities.dtype == np.uint8
    assert 80_000 <= len(scene.points) == len(scene.intensities) <= 150_000
    assert sum(file.stat().st_size for file in demo_folder().iterdir()) <= 2_500_000
    assert set(np.unique(scene.labels)) == {0, *(region.label for region in scene.regions)}


def test_the_truth_is_a_rigid_motion_of_a_meter_and_a_quarter_turn(scene: DemoScene) -> None:
    assert np.allclose(scene.rotation @ scene.rotation.T, np.eye(3), atol=SAME)
    assert np.linalg.det(scene.rotation) == pytest.approx(1.0)
    angle = np.degrees(np.arccos(0.5 * (np.trace(scene.rotation) - 1.0)))
    assert 30.0 < angle < 120.0
    assert 0.5 < np.linalg.norm(scene.translation) < 1.5


def test_the_planes_take_at_least_three_orientations(scene: DemoScene) -> None:
    normals = np.array([plane_of(region)[2] for region in scene.regions])
    gram = np.abs(normals @ normals.T)
    apart = [k for k in range(len(normals)) if np.all(gram[k, :k] < np.cos(np.radians(10.0)))]
    assert len(scene.regions) >= 5
    assert len(apart) >= 3


def test_projected_rings_lie_on_the_label_borders(scene: DemoScene) -> None:
    for region in scene.regions:
        within = scene.labels == region.label
        outline = scene.camera.project(in_camera(scene, along_ring(region.rings[0], 40)))
        column, row = np.round(outline).astype(int).T
        to_border = np.maximum(distance_transform_edt(within), distance_transform_edt(~within))
        assert np.percentile(to_border[row, column], 98) <= BOUNDARY_PIXELS, region.name
        assert to_border[row, column].max() < TIP_PIXELS, region.name


def test_labels_fill_the_projected_rings_and_nothing_hides_them(scene: DemoScene) -> None:
    pixels = rendering.pixel_grid(1280, 960)
    for region in scene.regions:
        outline = scene.camera.project(in_camera(scene, along_ring(region.rings[0], 20)))
        expected = inside([outline], pixels).reshape(960, 1280)
        differing = np.count_nonzero(expected != (scene.labels == region.label))
        assert differing <= 2, f"{region.name}: {differing} pixels differ"


def test_rings_turn_counter_clockwise_seen_from_both_sensors(scene: DemoScene) -> None:
    for region in scene.regions:
        ring = region.rings[0]
        area = 0.5 * np.sum(np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]), axis=0)
        camera_center = -scene.rotation.T @ scene.translation
        assert area @ -ring[0] > 0.0, region.name
        assert area @ (camera_center - ring[0]) > 0.0, region.name


def test_cloud_points_lie_on_their_region_within_the_noise(scene: DemoScene) -> None:
    for region in scene.regions:
        origin, axes, normal = plane_of(region)
        points = scene.points[region.point_indices] - origin
        assert len(points) > 500, region.name
        assert np.abs(points @ normal).max() < NOISE_BOUND, region.name
        assert 0.3 * generate.RANGE_NOISE < np.std(points @ normal) < 1.1 * generate.RANGE_NOISE, region.name
        ring, flat = (region.rings[0] - origin) @ axes.T, points @ axes.T
        outside = flat[~inside([ring], flat)]
        assert len(outside) < 0.05 * len(points), region.name
        assert len(outside) == 0 or distance_to_edges(ring, outside).max() < NOISE_BOUND, region.name


def test_no_two_regions_share_a_cloud_point(scene: DemoScene) -> None:
    indices = np.concatenate([region.point_indices for region in scene.regions])
    assert len(np.unique(indices)) == len(indices)


def test_seeds_lie_inside_their_regions(scene: DemoScene) -> None:
    for region in scene.regions:
        column, row = region.seed_pixel
        assert scene.labels[row, column] == region.label
        assert np.any(np.all(scene.points[region.point_indices] == region.seed_point, axis=1))


def test_a_region_differs_in_color_from_what_surrounds_it(scene: DemoScene) -> None:
    for region in scene.regions:
        within = scene.labels == region.label
        column, row = region.seed_pixel
        contrast = np.linalg.norm(scene.image.astype(float) - scene.image[row, column], axis=2)
        away = distance_transform_edt(~within)
        around = (away > 2.0) & (away < 5.0)
        assert np.percentile(contrast[within], 90) < 30.0, region.name
        assert np.percentile(contrast[around], 10) > 30.0, region.name


def test_an_unknown_region_is_named(scene: DemoScene) -> None:
    assert scene.region("door").label == 1
    with pytest.raises(ValueError, match="no region 'gate'; it has door, "):
        scene.region("gate")


def test_the_generator_makes_the_shipped_truth_and_camera(scene: DemoScene) -> None:
    rotation, translation = generate.camera_from_lidar()
    assert np.allclose(scene.rotation, rotation, rtol=0.0, atol=SAME)
    assert np.allclose(scene.translation, translation, rtol=0.0, atol=SAME)
    assert (demo_folder() / "camera_info.yaml").read_text(encoding="utf-8") == generate.camera_info()
    pixels = rendering.pixel_grid(1280, 960)[::997]
    assert np.allclose(scene.camera.bearings(pixels), generate.demo_camera().bearings(pixels), atol=SAME)


def test_the_generator_makes_the_shipped_cloud(scene: DemoScene, scan: generate.Scan) -> None:
    assert np.allclose(scene.points, scan.points, rtol=0.0, atol=FLOAT32_STEP)
    assert np.abs(scene.intensities.astype(int) - scan.intensities).max() <= 1


def test_the_generator_makes_the_shipped_regions(
    scene: DemoScene, surfaces: list[Surface], scan: generate.Scan
) -> None:
    made = generate.demo_regions(surfaces, generate.demo_camera(), scan)
    for shipped, again in zip(scene.regions, made, strict=True):
        assert (shipped.name, shipped.label, shipped.seed_pixel) == (again.name, again.label, again.seed_pixel)
        assert np.array_equal(shipped.point_indices, again.point_indices)
        assert np.allclose(shipped.seed_point, again.seed_point, rtol=0.0, atol=FLOAT32_STEP)
        for ring, other in zip(shipped.rings, again.rings, strict=True):
            assert np.allclose(ring, other, rtol=0.0, atol=SAME)


def test_the_generator_makes_the_shipped_labels_and_image(scene: DemoScene, surfaces: list[Surface]) -> None:
    pixels = np.random.default_rng(5).permutation(rendering.pixel_grid(1280, 960))[:4000]
    column, row = pixels.astype(int).T
    camera = generate.demo_camera()
    assert np.array_equal(scene.labels[row, column], rendering.region_labels(surfaces, camera, pixels))
    levels = rendering.developed(rendering.rendered(surfaces, camera, pixels))
    difference = scene.image[row, column] - levels
    assert np.abs(difference).mean() < IMAGE_LEVELS
    assert np.abs(difference.mean(axis=0)).max() < 0.3


def test_a_reduced_picture_is_the_shipped_one_made_smaller(scene: DemoScene, surfaces: list[Surface]) -> None:
    factor = 20
    centers = rendering.pixel_grid(1280 // factor, 960 // factor) * factor + 0.5 * (factor - 1)
    small = rendering.developed(rendering.rendered(surfaces, generate.demo_camera(), centers, pitch=float(factor)))
    shrunk = Image.fromarray(scene.image).resize((1280 // factor, 960 // factor), Image.Resampling.BOX)
    assert np.median(np.abs(small - np.asarray(shrunk, dtype=float).reshape(-1, 3))) < IMAGE_LEVELS


def test_a_ray_meets_the_nearer_of_two_squares_and_misses_beside_them() -> None:
    square = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    axes = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    squares = [Surface(Frame(np.array([0.0, 0.0, z]), *axes), (square,), plain("#ffffff")) for z in (5.0, 3.0)]
    directions = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0), (0.6, 0.0, 0.8)])
    index, distance = first_hits(squares, np.zeros(3), directions)
    assert index.tolist() == [1, -1, -1, -1]
    assert distance[0] == pytest.approx(3.0)
    origins = np.array([(0.0, 0.0, 4.0), (0.0, 0.0, 6.0), (3.0, 0.0, 4.0)])
    assert are_blocked(squares, origins, directions[0]).tolist() == [True, False, False]


def test_a_hole_is_outside() -> None:
    outer = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0)])
    hole = np.array([(1.0, 1.0), (1.0, 3.0), (3.0, 3.0), (3.0, 1.0)])
    held = inside([outer, hole], np.array([(0.5, 2.0), (2.0, 2.0), (3.5, 2.0), (5.0, 2.0)]))
    assert held.tolist() == [True, False, True, False]
