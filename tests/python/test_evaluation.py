"""The synthetic benchmark: templates, masks, scenes, noise and measures."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.cameras import FisheyeCamera, PinholeCamera
from regionpose.evaluation import masks, measures, noise, planar, scenes
from regionpose.evaluation.template_drawings import drawn_templates
from regionpose.evaluation.templates import Template, all_templates, load_templates, template_named
from scipy.spatial.transform import Rotation
from shapely import affinity

Array = NDArray[np.float64]
SceneMaker = Callable[..., scenes.Scene]

SCENE_KINDS: list[SceneMaker] = [scenes.perspective_scene, scenes.omnidirectional_scene, scenes.fisheye_scene]
# (planes, regions on each) of the benchmark
LAYOUTS = [(1, 1), (2, 1), (3, 1), (5, 1), (3, 2)]
SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.floats(0.01, 0.35)


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
    """A random simple ring around a centre, counter-clockwise in (x, y)."""
    angles = np.sort(rng.uniform(0, 2 * np.pi, count)) * 0.2 + np.arange(count) * (1.6 * np.pi / count)
    rays = np.column_stack([np.cos(angles), np.sin(angles)])
    ring: Array = np.asarray(center) + radius * rng.uniform(0.5, 1.0, (count, 1)) * rays
    return ring


def ring_with_hole(seed: int) -> list[Array]:
    """A random ring of radius 9 to 18 px with a hole that turns the other way, in and partly out of a 40 x 30 image."""
    rng = np.random.default_rng(seed)
    center = (rng.uniform(0, 40), rng.uniform(0, 30))
    outer = star_shaped_ring(rng, center, 18.0, 12)
    # Shrunk about the centre it lies inside, the outer ring being star-shaped.
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
def test_template_is_simple_centred_and_one_metre_long(template: Template) -> None:
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
@settings(max_examples=60, deadline=None)
def test_mask_holds_exactly_the_pixel_centres_inside(seed: int) -> None:
    rings = ring_with_hole(seed)
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    expected = shapely.contains_xy(even_odd(rings), x, y)
    assert np.array_equal(masks.binary_mask(rings, 40, 30), expected)


@given(SEEDS)
@settings(max_examples=40, deadline=None)
def test_masks_of_two_sides_of_a_cut_tile_the_whole(seed: int) -> None:
    """Corners on pixel centres make ties along every edge: no pixel may be lost or counted twice."""
    corners = np.random.default_rng(seed).integers(0, 20, (4, 2)).astype(float)
    triangles = [corners[[0, 1, 2]], corners[[0, 2, 3]]]
    halves = [masks.binary_mask([triangle], 20, 20) for triangle in triangles]
    assert np.array_equal(halves[0] ^ halves[1], masks.binary_mask(triangles, 20, 20))
    assert np.array_equal(masks.binary_mask([corners], 20, 20), halves[0] ^ halves[1])


def test_mask_counts_a_centre_on_the_left_and_upper_side_only() -> None:
    square = np.array([[1.0, 2.0], [4.0, 2.0], [4.0, 5.0], [1.0, 5.0]])
    rows, columns = np.nonzero(masks.binary_mask([square], 8, 8))
    assert (columns.min(), columns.max(), rows.min(), rows.max()) == (1, 3, 2, 4)
    assert masks.binary_mask([square - 20.0], 8, 8).sum() == 0


@given(SEEDS)
@settings(max_examples=40, deadline=None)
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
    pinhole, fisheye = scenes.perspective_camera(), scenes.fisheye_camera()
    assert np.array_equal(masks.project_ring(pinhole, square), pinhole.project(square))
    for camera in (fisheye, scenes.omnidirectional_camera()):
        ring = shapely.LinearRing(masks.project_ring(camera, square))
        steps = np.linspace(0.0, 1.0, 3001)[:, None]
        for a, b in zip(square, np.roll(square, -1, axis=0), strict=True):
            curve = shapely.points(camera.project(a + steps * (b - a)))
            assert float(np.max(shapely.distance(ring, curve))) < 1.05 * masks.BOUNDARY_TOLERANCE_PX


def test_what_cannot_be_drawn_is_named() -> None:
    behind = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, -1.0], [0.0, 1.0, 1.0]])
    with pytest.raises(masks.ProjectionError, match=r"no image, the first at \[ 1\. +0\. -1\.\] m"):
        masks.project_ring(scenes.perspective_camera(), behind)
    with pytest.raises(ValueError, match=r"ring 0 has shape \(2, 2\)"):
        masks.binary_mask([np.zeros((2, 2))], 5, 5)
    with pytest.raises(ValueError, match="ring 0 holds NaN"):
        masks.area_coverage([np.full((3, 2), np.nan)], 5, 5)
    with pytest.raises(ValueError, match="width None"):
        masks.image_size(PinholeCamera(100, 100, 0, 0))


# Scenes


@pytest.mark.parametrize("make", SCENE_KINDS, ids=lambda make: make.__name__)
def test_every_region_is_wholly_seen_from_its_front_and_hides_no_other(make: SceneMaker) -> None:
    for seed in range(100):
        planes, regions_per_plane = LAYOUTS[seed % len(LAYOUTS)]
        scene = make(seed, planes, regions_per_plane=regions_per_plane, study="test")
        assert len(scene.regions) == len(scene.names) == planes * regions_per_plane
        image = shapely.box(-0.5, -0.5, scenes.SENSOR_WIDTH_PX - 0.5, scenes.SENSOR_HEIGHT_PX - 0.5)
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
        assert mask.shape == coverage.shape == (scenes.SENSOR_HEIGHT_PX, scenes.SENSOR_WIDTH_PX)
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
        scenes.draw_scene(narrow, scenes.PERSPECTIVE_RANGE, layout, scenes.problem_generator(0))
    with pytest.raises(ValueError, match="planes is 0"):
        scenes.perspective_scene(0, 0)
    with pytest.raises(ValueError, match="'lidar'"):
        scenes.perspective_scene(0, world="lidar")  # type: ignore[arg-type]


def test_omnidirectional_camera_sees_180_degrees_within_its_image() -> None:
    camera = scenes.omnidirectional_camera()
    center = np.array(camera.center)
    edge = camera.bearings(np.array([center, center + (0, scenes.OMNIDIRECTIONAL_RADIUS_PX)]))
    assert edge[0] == pytest.approx([0, 0, 1])
    assert edge[1] == pytest.approx([0, 1, 0], abs=1e-9)
    assert center[1] + scenes.OMNIDIRECTIONAL_RADIUS_PX <= scenes.SENSOR_HEIGHT_PX - 0.5


# Noise


def small_mask(seed: int) -> NDArray[np.bool_]:
    """A template drawn at 200 px a metre, with room around it."""
    template = all_templates()[seed % 25]
    return masks.binary_mask([ring * 200.0 + 150.0 for ring in template.rings], 300, 300)


def tilted_region(seed: int) -> list[Array]:
    """A template turned and moved in space."""
    turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    return [ring @ turn.T + (1.0, 2.0, 3.0) for ring in all_templates()[seed % 25].region()]


@given(SEEDS, SHARES)
@settings(max_examples=60, deadline=None)
def test_squares_change_the_share_of_a_mask_beside_its_boundary(seed: int, share: float) -> None:
    mask = small_mask(seed)
    before, area = mask.copy(), int(mask.sum())
    disturbed = noise.squares_on_mask(mask, share, np.random.default_rng(seed))
    assert abs(int((disturbed ^ mask).sum()) - share * area) <= 0.5 + 1e-9
    assert np.array_equal(mask, before)
    assert np.array_equal(disturbed, noise.squares_on_mask(mask, share, np.random.default_rng(seed)))
    boundary = shapely.MultiLineString([np.vstack([ring, ring[:1]]) for ring in noise.mask_boundary(mask)])
    rows, columns = np.nonzero(disturbed ^ mask)
    reach = noise.square_side(share, area) * np.sqrt(0.5)
    assert float(np.max(shapely.distance(boundary, shapely.points(columns, rows)))) <= reach + 1.0


def test_squares_add_and_remove_all_along_the_boundary() -> None:
    """A square of 100 px: additions and removals come in equal parts and on every side."""
    mask = np.zeros((160, 160), dtype=np.bool_)
    mask[30:130, 30:130] = True
    added, removed = np.zeros(160), np.zeros(160)
    for seed in range(30):
        disturbed = noise.squares_on_mask(mask, 0.1, np.random.default_rng(seed))
        added += (disturbed & ~mask).sum(axis=0)
        removed += (mask & ~disturbed).sum(axis=0)
    assert added.sum() / removed.sum() == pytest.approx(1.0, abs=0.2)
    assert min(added[:30].sum(), added[130:].sum(), removed[30:40].sum(), removed[120:130].sum()) > 0.1 * added.sum()


def test_squares_too_small_for_the_share_are_refused() -> None:
    with pytest.raises(ValueError, match=r"side 1 px .* a larger side"):
        noise.squares_on_mask(small_mask(0), 0.5, np.random.default_rng(0), side=1.0)
    with pytest.raises(ValueError, match=r"side 0\.05 m .* a larger side"):
        noise.squares_on_region(tilted_region(16), 0.3, np.random.default_rng(0), side=0.05)
    for share in (-0.1, 1.0, float("nan")):
        with pytest.raises(ValueError, match="share is"):
            noise.squares_on_mask(small_mask(0), share, np.random.default_rng(0))
    with pytest.raises(ValueError, match="side is 0"):
        noise.squares_on_mask(small_mask(0), 0.1, np.random.default_rng(0), side=0.0)
    with pytest.raises(ValueError, match="mask is empty"):
        noise.occlude_mask(np.zeros((4, 4), dtype=np.bool_), 0.1, np.random.default_rng(0))
    with pytest.raises(ValueError, match="float64"):
        noise.squares_on_mask(np.ones((4, 4)), 0.1, np.random.default_rng(0))


@given(SEEDS, SHARES)
@settings(max_examples=40, deadline=None)
def test_squares_and_occlusion_change_the_share_of_a_region_in_its_plane(seed: int, share: float) -> None:
    region = tilted_region(seed)
    frame = planar.PlaneFrame.of_region(region)
    shape: Any = frame.polygon(region)
    squares = noise.squares_on_region(region, share, np.random.default_rng(seed))
    occluded = noise.occlude_region(region, share, np.random.default_rng(seed))
    for rings in (squares, occluded):
        assert changed_share(shape, frame.polygon(rings)) == pytest.approx(share, abs=1e-6)
        normal = np.cross(frame.axes[:, 0], frame.axes[:, 1])
        assert np.abs((np.concatenate(rings) - frame.origin) @ normal).max() < 1e-12
        area = np.linalg.norm(planar.area_vector(rings))
        assert planar.area_vector(rings) @ normal == pytest.approx(area)
        assert area == pytest.approx(frame.polygon(rings).area)
    kept: Any = frame.polygon(occluded)
    hidden = shape.difference(kept).buffer(-1e-6)  # without the slivers of rounding
    assert kept.convex_hull.intersection(hidden.convex_hull).area < 1e-9


@given(SEEDS, SHARES)
@settings(max_examples=40, deadline=None)
def test_occlusion_hides_the_share_behind_a_straight_line(seed: int, share: float) -> None:
    mask = small_mask(seed)
    kept = noise.occlude_mask(mask, share, np.random.default_rng(seed))
    hidden = mask & ~kept
    assert not (kept & ~mask).any()
    assert abs(int(hidden.sum()) - share * int(mask.sum())) <= 0.5 + 1e-9
    hulls = [shapely.MultiPoint(np.argwhere(part)).convex_hull for part in (kept, hidden)]
    assert hulls[0].intersection(hulls[1]).area < 1e-6


@given(SEEDS, st.floats(0.0, 0.9))
@settings(max_examples=40, deadline=None)
def test_truncation_cuts_every_mask_at_one_border(seed: int, share: float) -> None:
    mask, other = small_mask(seed), small_mask(seed + 1)
    truncated, window = noise.truncate_masks([mask, other], share, np.random.default_rng(seed))
    inside = np.zeros_like(mask)
    inside[window.top : window.bottom, window.left : window.right] = True
    assert np.array_equal(truncated[0], mask & inside)
    assert np.array_equal(truncated[1], other & inside)
    moved = (window.left > 0) + (window.top > 0) + (window.right < 300) + (window.bottom < 300)
    assert moved <= 1 or share == 0.0
    column = max(mask.sum(axis=0).max(), mask.sum(axis=1).max())
    assert abs(int((mask & ~inside).sum()) - share * int(mask.sum())) <= 0.5 * column + 1e-6


def test_lidar_beams_hit_the_region_at_their_elevations_with_the_stated_noise() -> None:
    """A wall of 1 m x 1 m, 4 m ahead: hits lie on its 64 beams' cones, the noise along the beams."""
    wall = template_named("square").region()
    position = np.array([0.3, -0.2, -4.0])
    exact = noise.SpinningLidar(range_noise_m=0.0)
    hits = noise.lidar_points(wall, position, np.random.default_rng(0), exact)
    assert np.abs(hits[:, 2]).max() < 1e-12
    assert np.abs(hits[:, :2]).max() <= 0.5
    beams = (hits - position) / np.linalg.norm(hits - position, axis=1)[:, None]
    steps = (np.degrees(np.arcsin(-beams[:, 1])) + 25.0) / (50.0 / 63.0)
    assert np.abs(steps - np.round(steps)).max() < 1e-9
    # 1 m at 4 m is 14.2 deg: 71 columns, 17 or 18 beams.
    assert len(hits) == pytest.approx(71 * 17.5, rel=0.06)
    noisy = noise.lidar_points(wall, position, np.random.default_rng(0), noise.SpinningLidar(range_noise_m=0.02))
    along = np.linalg.norm(noisy - position, axis=1) - np.linalg.norm(hits - position, axis=1)
    assert np.std(along) == pytest.approx(0.02, rel=0.1)
    assert len(noise.lidar_points(wall, (0.0, -20.0, -1.0), np.random.default_rng(0))) == 0
    with pytest.raises(ValueError, match="beams is 0"):
        noise.SpinningLidar(beams=0)


def test_lidar_skips_the_holes() -> None:
    window = template_named("uneven_window")
    hits = noise.lidar_points(
        window.region(), (0.0, 0.0, -3.0), np.random.default_rng(1), noise.SpinningLidar(range_noise_m=0.0)
    )
    assert len(hits) > 500
    assert shapely.contains_xy(template_shape(window), hits[:, 0], hits[:, 1]).all()


def test_a_miscalibrated_pinhole_is_the_pinhole_with_the_wrong_numbers() -> None:
    true = PinholeCamera(1000, 900, 320, 240, width=640, height=480)
    wrong = noise.MiscalibratedCamera(true, 1.02, np.array([3.0, -2.0]))
    expected = PinholeCamera(1020, 918, 323, 238, width=640, height=480)
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3)) + (0, 0, 3)
    assert np.allclose(wrong.project(points), expected.project(points), atol=1e-9)
    pixels = expected.project(points)
    assert np.allclose(wrong.bearings(pixels), expected.bearings(pixels), atol=1e-12)
    assert (wrong.width, wrong.height, wrong.straight_lines) == (640, 480, True)
    assert wrong.max_angle == true.max_angle


def test_calibration_errors_have_the_stated_spread_and_stay_consistent() -> None:
    camera: FisheyeCamera = scenes.fisheye_camera()
    drawn = [noise.miscalibrate(camera, 0.01, 2.0, np.random.default_rng(seed)) for seed in range(300)]
    assert np.std([wrong.focal_scale for wrong in drawn]) == pytest.approx(0.01, rel=0.15)
    assert np.std([wrong.shift for wrong in drawn]) == pytest.approx(2.0, rel=0.15)
    pixels = np.random.default_rng(1).uniform((400, 100), (1900, 1400), (30, 2))
    assert np.allclose(drawn[0].project(drawn[0].bearings(pixels)), pixels, atol=1e-6)
    exact = noise.miscalibrate(camera, 0.0, 0.0, np.random.default_rng(0))
    assert np.allclose(exact.bearings(pixels), camera.bearings(pixels), atol=1e-12)
    with pytest.raises(ValueError, match="centre_px is -1"):
        noise.miscalibrate(camera, 0.0, -1.0, np.random.default_rng(0))


# Measures


def random_pose(rng: np.random.Generator) -> tuple[Array, Array]:
    """Any rotation and a translation of a few metres."""
    return Rotation.random(rng=rng).as_matrix(), rng.normal(0.0, 3.0, 3)


@given(SEEDS, st.floats(1e-6, 179.0))
def test_rotation_error_is_the_angle_between_the_poses(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    true, _ = random_pose(rng)
    axis = scenes.random_direction(3, rng)
    estimated = Rotation.from_rotvec(np.radians(angle) * axis).as_matrix() @ true
    assert measures.rotation_error(estimated, true) == pytest.approx(angle, abs=1e-9)
    assert measures.rotation_error(true, estimated) == pytest.approx(angle, abs=1e-9)
    assert measures.rotation_errors_by_axis(estimated, true) == pytest.approx(angle * axis, abs=1e-6)


@given(SEEDS)
def test_errors_do_not_depend_on_the_world_frame(seed: int) -> None:
    rng = np.random.default_rng(seed)
    (rotation, translation), (true_rotation, true_translation), (turn, offset) = (random_pose(rng) for _ in range(3))
    anchor = rng.normal(0.0, 3.0, 3)
    here = measures.pose_errors(rotation, translation, true_rotation, true_translation, anchor)
    moved, true_moved = rotation @ turn.T, true_rotation @ turn.T
    there = measures.pose_errors(
        moved,
        translation - moved @ offset,
        true_moved,
        true_translation - true_moved @ offset,
        turn @ anchor + offset,
    )
    assert there.rotation_deg == pytest.approx(here.rotation_deg, abs=1e-5)
    assert there.translation_m == pytest.approx(here.translation_m, abs=1e-9)
    assert there.camera_center_m == pytest.approx(here.camera_center_m, abs=1e-9)
    expected = rotation @ anchor + translation - true_rotation @ anchor - true_translation
    assert here.translation_m == pytest.approx(float(np.linalg.norm(expected)))


def test_overlap_error_of_a_shifted_square_is_twice_the_strip() -> None:
    square = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]])
    hole = (2.0 + 0.2 * square)[::-1]
    assert measures.overlap_error([square + (1.0, 0.0)], [square]) == pytest.approx(0.2)
    assert measures.overlap_error([square], [square, hole]) == pytest.approx(4.0 / 96.0)
    with pytest.raises(ValueError, match="no area"):
        measures.overlap_error([square], [square * (1.0, 0.0)])


def test_solved_needs_both_bounds_and_an_estimate() -> None:
    solved = measures.is_solved([0.5, 1.5, 0.5, np.nan], [0.01, 0.01, 0.06, 0.01])
    assert solved.tolist() == [True, False, False, False]
    assert measures.solved_share(solved) == 0.25


@given(st.lists(st.floats(0.0, 1e3), min_size=1, max_size=40))
def test_summary_is_numpys_percentiles(errors: list[float]) -> None:
    summary = measures.summarize(errors)
    expected = np.percentile(errors, [25, 50, 75, 95])
    found = [summary.lower_quartile, summary.median, summary.upper_quartile, summary.percentile_95]
    assert found == pytest.approx(expected, abs=1e-9)
    assert summary.count == len(errors)


def test_missing_estimates_count_as_infinitely_wrong() -> None:
    summary = measures.summarize([1.0, 2.0, 3.0, np.nan, np.inf])
    assert (summary.lower_quartile, summary.median, summary.upper_quartile) == (2.0, 3.0, np.inf)
    with pytest.raises(ValueError, match="n >= 1"):
        measures.summarize([])
