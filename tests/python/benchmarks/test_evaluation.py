"""The synthetic benchmark: templates, masks and scenes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.cameras import PinholeCamera
from scipy.spatial.transform import Rotation
from shapely import affinity

from benchmarks.synthetic import masks, measures, planar, scenes, setups
from benchmarks.synthetic.template_drawings import drawn_templates
from benchmarks.synthetic.templates import Template, all_templates, load_templates, template_named

Array = NDArray[np.float64]
SceneMaker = Callable[..., scenes.SyntheticScene]

SCENE_KINDS: list[SceneMaker] = [scenes.perspective_scene, scenes.omnidirectional_scene, scenes.fisheye_scene]
# (planes, regions on each) of the benchmark
LAYOUTS = [(1, 1), (2, 1), (3, 1), (5, 1), (3, 2)]
SEEDS = st.integers(0, 2**32 - 1)


def even_odd(rings: list[Array]) -> Any:
    """The rings' region; shapely's own types leave out most of its methods."""
    return planar.even_odd_shape(rings)


def template_shape(template: Template) -> Any:
    """A template as a polygon with holes."""
    return shapely.Polygon(template.rings[0], template.rings[1:])


def changed_share(shape: Any, other: Any) -> float:
    """Symmetric difference over the first shape's area."""
    return float(shape.symmetric_difference(other).area / shape.area)


def reflected(shape: Any, axis_deg: float) -> Any:
    """The shape reflected about a line through the origin."""
    return affinity.rotate(affinity.scale(shape, 1, -1, origin=(0, 0)), 2.0 * axis_deg, origin=(0, 0))


def star_shaped_ring(rng: np.random.Generator, center: tuple[float, float], radius: float, count: int = 9) -> Array:
    """A random simple ring around a center, counter-clockwise in (x, y)."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, count)) * 0.2 + np.arange(count) * (1.6 * np.pi / count)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    ring: Array = np.asarray(center) + radius * rng.uniform(0.5, 1.0, (count, 1)) * rays
    return ring


def ring_with_hole(seed: int) -> list[Array]:
    """A random ring of radius 9 to 18 px with a hole that turns the other way, in and partly out of a 40 x 30 image."""
    rng = np.random.default_rng(seed)
    center = (rng.uniform(0, 40), rng.uniform(0, 30))
    outer = star_shaped_ring(rng, center, 18.0, 12)
    # Shrunk about the center it lies inside, the outer ring being star-shaped.
    hole = (np.asarray(center) + 0.4 * (outer - center))[::-1]
    return [outer, hole]


# Templates


def test_there_are_25_templates_of_every_promised_kind() -> None:
    assert len({template.name for template in all_templates()}) == 25
    assert len(load_templates("asymmetric")) >= 10
    assert len(load_templates("symmetric")) >= 6
    assert sum(len(template.rings) > 1 for template in all_templates()) >= 2
    # A thin part vanishes when the shape is opened by a disc of 6 cm radius.
    opened = [changed_share(s, s.buffer(-0.06).buffer(0.06)) for s in map(template_shape, all_templates())]
    assert sum(share > 0.2 for share in opened) >= 2


@pytest.mark.parametrize("template", all_templates(), ids=lambda template: template.name)
def test_template_is_simple_centered_and_one_meter_long(template: Template) -> None:
    shape = template_shape(template)
    assert shape.is_valid
    assert np.ptp(template.rings[0], axis=0).max() == pytest.approx(1.0, abs=1e-12)
    assert np.allclose(shape.centroid.coords[0], 0.0, atol=1e-12)
    assert [shapely.LinearRing(ring).is_ccw for ring in template.rings] == [True] + [False] * (len(template.rings) - 1)
    assert planar.region_centroid(template.region()) == pytest.approx(np.zeros(3), abs=1e-12)
    assert planar.area_vector(template.region()) == pytest.approx([0.0, 0.0, shape.area])


@pytest.mark.parametrize("template", all_templates(), ids=lambda template: template.name)
def test_template_has_the_symmetry_it_claims_and_no_other(template: Template) -> None:
    shape = template_shape(template)
    for order in range(2, 25):
        difference = changed_share(shape, affinity.rotate(shape, 360.0 / order, origin=(0, 0)))
        assert (difference < 1e-9) == (template.symmetry_order % order == 0), (
            f"rotation by 1/{order} turn: {difference}"
        )
        assert difference < 1e-9 or difference > 0.01
    outer = template.rings[0]
    marks = np.concatenate([outer, 0.5 * (outer + np.roll(outer, -1, axis=0))])
    axes = np.degrees(np.arctan2(marks[:, 1], marks[:, 0])) if template.mirror else np.arange(0.0, 180.0, 0.5)
    least = min(changed_share(shape, reflected(shape, axis)) for axis in axes.tolist())
    assert least < 1e-9 if template.mirror else least > 0.05


def test_data_file_holds_the_drawings() -> None:
    for template, record in zip(all_templates(), drawn_templates(), strict=True):
        assert (template.name, template.symmetry_order, template.mirror) == (
            record["name"],
            record["symmetry_order"],
            record["mirror"],
        )
        for ring, drawn in zip(template.rings, record["rings"], strict=True):
            assert np.allclose(ring, drawn, atol=1e-12)


def test_unknown_templates_are_named_in_the_error() -> None:
    assert template_named("nut").symmetry_order == 6
    with pytest.raises(ValueError, match=r"nutt.*letter_f"):
        template_named("nutt")
    with pytest.raises(ValueError, match="round"):
        load_templates("round")  # type: ignore[arg-type]


# Masks


@given(SEEDS)
@settings(max_examples=25, deadline=None)
def test_mask_holds_exactly_the_pixel_centers_inside(seed: int) -> None:
    rings = ring_with_hole(seed)
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    expected = shapely.contains_xy(even_odd(rings), x, y)
    assert np.array_equal(masks.binary_mask(rings, 40, 30), expected)


@given(SEEDS)
@example(602)
@settings(max_examples=20, deadline=None)
def test_masks_of_two_sides_of_a_cut_tile_the_whole(seed: int) -> None:
    """Corners on pixel centers make ties along every edge: no pixel may be lost or counted twice."""
    corners = np.random.default_rng(seed).integers(0, 20, (4, 2)).astype(float)
    triangles = [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    halves = [masks.binary_mask([triangle], 20, 20) for triangle in triangles]
    assert np.array_equal(halves[0] ^ halves[1], masks.binary_mask(triangles, 20, 20))
    assert np.array_equal(masks.binary_mask([corners], 20, 20), halves[0] ^ halves[1])


def test_mask_counts_a_center_on_the_left_and_upper_side_only() -> None:
    square = np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 5.0], [1.0, 5.0]])
    rows, columns = np.nonzero(masks.binary_mask([square], 8, 8))
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (1, 3, 2, 4)
    assert masks.binary_mask([square - 20.0], 8, 8).sum() == 0


@given(SEEDS)
@settings(max_examples=20, deadline=None)
def test_coverage_is_the_area_inside_each_pixel(seed: int) -> None:
    rings = ring_with_hole(seed)
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    pixels = shapely.box(x - 0.5, y - 0.5, x + 0.5, y + 0.5)
    expected = shapely.area(shapely.intersection(even_odd(rings), pixels))
    assert np.abs(masks.area_coverage(rings, 40, 30) - expected).max() < 1e-12
    assert np.allclose(masks.area_coverage([ring[::-1] for ring in rings], 40, 30), expected, atol=1e-12)


def test_coverage_agrees_with_supersampling() -> None:
    """32 x 32 samples a pixel are off by under 1/32 of the boundary's length in it, about 0.1 of a pixel."""
    rings, factor = ring_with_hole(5), 32
    fine = masks.binary_mask([(ring + 0.5) * factor - 0.5 for ring in rings], 40 * factor, 30 * factor)
    sampled = fine.reshape(30, factor, 40, factor).mean(axis=(1, 3))
    coverage = masks.area_coverage(rings, 40, 30)
    assert np.abs(coverage - sampled).max() < 0.05
    assert coverage.sum() == pytest.approx(sampled.sum(), rel=2e-3)


def test_fisheye_ring_follows_the_curved_boundary_and_pinhole_ring_stays() -> None:
    square = np.array([[-1.0, -1.0, 1.2], [1.0, -1.0, 0.9], [1.0, 1.0, 1.1], [-1.0, 1.0, 1.4]])
    pinhole, fisheye = setups.perspective_camera(), setups.fisheye_camera()
    assert np.array_equal(masks.project_ring(pinhole, square), pinhole.project(square))
    for camera in (fisheye, setups.omnidirectional_camera()):
        ring = shapely.LinearRing(masks.project_ring(camera, square))
        steps = np.linspace(0.0, 1.0, 3001)[:, None]
        for a, b in zip(square, np.roll(square, -1, axis=0), strict=True):
            curve = shapely.points(camera.project(a + steps * (b - a)))
            assert float(np.max(shapely.distance(ring, curve))) < 1.05 * masks.BOUNDARY_TOLERANCE_PX


def test_what_cannot_be_drawn_is_named() -> None:
    behind = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 1.0, 1.0]])
    with pytest.raises(masks.ProjectionError, match=r"no image, the first at \[ 1\. +0\. -1\.\] m"):
        masks.project_ring(setups.perspective_camera(), behind)
    with pytest.raises(ValueError, match=r"ring 0 has shape \(2, 2\)"):
        masks.binary_mask([np.zeros((2, 2))], 5, 5)
    with pytest.raises(ValueError, match="ring 0 holds NaN"):
        masks.area_coverage([np.full((3, 2), np.nan)], 5, 5)
    with pytest.raises(ValueError, match="width None"):
        masks.image_size(PinholeCamera(100, 100, 0, 0))


# Scenes


@pytest.mark.slow
@pytest.mark.parametrize("make", SCENE_KINDS, ids=lambda make: make.__name__)
def test_every_region_is_wholly_seen_from_its_front_and_hides_no_other(make: SceneMaker) -> None:
    for seed in range(100):
        planes, regions_per_plane = LAYOUTS[seed % len(LAYOUTS)]
        scene = make(seed, planes, regions_per_plane=regions_per_plane, study="test")
        assert len(scene.regions) == len(scene.names) == planes * regions_per_plane
        image = shapely.box(-0.5, -0.5, setups.SENSOR_WIDTH_PX - 0.5, setups.SENSOR_HEIGHT_PX - 0.5)
        outlines = [shapely.Polygon(rings[0]) for rings in scene.image_rings]
        assert all(image.contains(outline) and outline.exterior.is_ccw for outline in outlines)
        assert shapely.union_all(outlines).area == pytest.approx(sum(outline.area for outline in outlines))
        assert scene.view_angles().max() < scenes.MAX_VIEW_ANGLE_DEG
        depths = [(ring @ scene.rotation.T + scene.translation)[:, 2] for rings in scene.regions for ring in rings]
        assert np.concatenate(depths).min() > 0.0


@pytest.mark.parametrize("make", SCENE_KINDS, ids=lambda make: make.__name__)
def test_masks_and_coverages_hold_the_regions_area(make: SceneMaker) -> None:
    scene = make(1, 3)
    pairs = zip(scene.masks(), scene.coverages(), scene.image_rings, strict=True)
    for mask, coverage, rings in pairs:
        area = even_odd(rings).area
        assert coverage.sum() == pytest.approx(area, rel=1e-12)
        assert int(mask.sum()) == pytest.approx(area, rel=5e-3)
        assert mask.shape == coverage.shape == (setups.SENSOR_HEIGHT_PX, setups.SENSOR_WIDTH_PX)
        assert not mask[coverage == 0.0].any()
        assert mask[coverage == 1.0].all()
    assert np.sum(scene.masks(), axis=0).max() == 1


def test_a_scene_depends_on_its_seed_and_study_alone() -> None:
    first, again = scenes.perspective_scene(7, 3, study="a"), scenes.perspective_scene(7, 3, study="a")
    assert np.array_equal(first.rotation, again.rotation)
    assert first.names == again.names
    assert all(
        np.array_equal(a, b)
        for rings, others in zip(first.regions, again.regions, strict=True)
        for a, b in zip(rings, others, strict=True)
    )
    for other in (scenes.perspective_scene(8, 3, study="a"), scenes.perspective_scene(7, 3, study="b")):
        assert not np.allclose(first.rotation, other.rotation)
    with pytest.raises(ValueError, match="seed is -1"):
        scenes.perspective_scene(-1)


@given(SEEDS)
@settings(max_examples=15, deadline=None)
def test_an_arbitrary_world_frame_changes_no_pixel(seed: int) -> None:
    plain, turned = (scenes.perspective_scene(seed, 2, world=world) for world in ("first", "arbitrary"))
    assert plain.anchor == pytest.approx(np.zeros(3), abs=1e-12)
    assert measures.rotation_error(plain.rotation, turned.rotation) > 0.1
    assert np.linalg.det(turned.rotation) == pytest.approx(1.0)
    seen = turned.rotation @ turned.anchor + turned.translation
    assert seen == pytest.approx(plain.translation, abs=1e-12)
    for rings, others in zip(plain.image_rings, turned.image_rings, strict=True):
        assert np.allclose(np.concatenate(rings), np.concatenate(others), atol=1e-8)


@given(SEEDS)
@settings(max_examples=15, deadline=None)
def test_planes_and_poses_lie_in_the_stated_ranges(seed: int) -> None:
    scene = scenes.perspective_scene(seed, 3, regions_per_plane=2)
    angles = np.abs(Rotation.from_matrix(scene.rotation).as_euler("xyz", degrees=True))
    lateral, depth = np.abs(scene.translation[:2]), scene.translation[2]
    assert angles.max() <= 40.0
    assert 0.5 <= lateral.min() <= lateral.max() <= 2.0
    assert 4.0 <= depth <= 6.0
    assert scene.planes == [0, 0, 1, 1, 2, 2]
    centroids = np.array([planar.region_centroid(rings) for rings in scene.regions])
    distances = [*np.linalg.norm(centroids[[2, 4]], axis=1), *np.linalg.norm(centroids[1::2] - centroids[::2], axis=1)]
    assert 1.0 - 1e-9 <= min(distances) <= max(distances) <= 2.0 + 1e-9
    for first, second in zip(scene.regions[::2], scene.regions[1::2], strict=True):
        normal = planar.area_vector(first) / np.linalg.norm(planar.area_vector(first))
        assert np.abs((np.concatenate(first + second) - first[0][0]) @ normal).max() < 1e-12


def test_scenes_use_the_chosen_templates_without_repetition() -> None:
    for which in ("asymmetric", "symmetric"):
        known = {template.name for template in load_templates(which)}
        scene = scenes.omnidirectional_scene(3, 5, templates=which)
        assert set(scene.names) <= known
        assert len(set(scene.names)) == 5


def test_a_region_may_be_seen_from_behind_when_asked_for() -> None:
    behind = 0
    for seed in range(20):
        scene = scenes.perspective_scene(seed, front=False)
        turned = scene.view_angles()[0] > 90.0
        assert shapely.LinearRing(scene.image_rings[0][0]).is_ccw != turned
        behind += turned
    assert 3 <= behind <= 17


def test_an_impossible_scene_says_what_could_not_be_placed() -> None:
    narrow = PinholeCamera(50_000, 50_000, 100, 100, width=200, height=200)
    layout = scenes.Layout(planes=2, templates="symmetric")
    with pytest.raises(scenes.ScenePlacementError, match=r"plane 1 of 2 \(\w+\) could not be placed"):
        scenes.draw_scene(narrow, setups.perspective_setup().poses, layout, scenes.problem_generator(0))
    with pytest.raises(ValueError, match="planes is 0"):
        scenes.perspective_scene(0, 0)
    with pytest.raises(ValueError, match="'lidar'"):
        scenes.perspective_scene(0, world="lidar")  # type: ignore[arg-type]


def test_omnidirectional_camera_sees_180_degrees_within_its_image() -> None:
    camera = setups.omnidirectional_camera()
    center = np.array(camera.center)
    edge = camera.bearings(np.array([center, center + np.array([0, setups.OMNIDIRECTIONAL_RADIUS_PX])]))
    assert edge[0] == pytest.approx([0, 0, 1])
    assert edge[1] == pytest.approx([0, 1, 0], abs=1e-9)
    assert center[1] + setups.OMNIDIRECTIONAL_RADIUS_PX <= setups.SENSOR_HEIGHT_PX - 0.5
