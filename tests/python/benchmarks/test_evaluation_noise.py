"""The synthetic benchmark: noise models and error measures."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose.cameras import FisheyeCamera, PinholeCamera
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import lidar, masks, measures, noise, planar, setups
from benchmarks.synthetic.templates import all_templates, template_named

Array = NDArray[np.float64]

SEEDS = st.integers(0, 2**32 - 1)
SHARES = st.floats(0.01, 0.35)


def changed_share(shape: Any, other: Any) -> float:
    """Symmetric difference over the first shape's area."""
    return float(shape.symmetric_difference(other).area / shape.area)


# Noise


def small_mask(seed: int) -> NDArray[np.bool_]:
    """A template drawn at 200 px a meter, with room around it."""
    template = all_templates()[seed % 25]
    return masks.binary_mask([ring * 200.0 + 150.0 for ring in template.rings], 300, 300)


def tilted_region(seed: int) -> list[Array]:
    """A template turned and moved in space."""
    turn = setups.any_rotation(np.random.default_rng(seed))
    return [ring @ turn.T + (1.0, 2.0, 3.0) for ring in all_templates()[seed % 25].region()]


@pytest.mark.slow
@given(SEEDS, SHARES)
@settings(max_examples=25, deadline=None)
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


def test_painted_squares_leave_nothing_of_a_boundary_that_they_cover() -> None:
    """A square of 100 px, its sides painted by squares of 10 px until nearly half of what they reach has changed."""
    mask = np.zeros((160, 160), dtype=np.bool_)
    mask[30:130, 30:130] = True
    painted = noise.squares_painted(mask, 0.19, np.random.default_rng(3), 10.0)
    assert 0.19 <= (painted ^ mask).sum() / mask.sum() < 0.2
    # Across a side neighbors inside and outside of the true boundary are alike, but where nothing was painted.
    inner, outer = painted[30, 35:125], painted[29, 35:125]
    assert (inner == outer).mean() > 0.9
    beside = noise.squares_on_mask(mask, 0.19, np.random.default_rng(3), side=10.0)
    assert (beside[30, 35:125] == beside[29, 35:125]).mean() < 0.6
    assert not (painted ^ mask)[40:120, 40:120].any()


@pytest.mark.slow
def test_squares_too_small_for_the_share_are_refused() -> None:
    with pytest.raises(ValueError, match=r"side 1 px .* a larger side"):
        noise.squares_painted(small_mask(0), 0.5, np.random.default_rng(0), 1.0)
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
@example(6237511, 1.0 / 3.0)  # Touching squares leave a line.
@example(12831, 0.2980993251968411)  # Their union without a grid lacks a part.
@settings(max_examples=20, deadline=None)
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
@settings(max_examples=20, deadline=None)
def test_occlusion_hides_the_share_behind_a_straight_line(seed: int, share: float) -> None:
    mask = small_mask(seed)
    kept = noise.occlude_mask(mask, share, np.random.default_rng(seed))
    hidden = mask & ~kept
    assert not (kept & ~mask).any()
    assert abs(int(hidden.sum()) - share * int(mask.sum())) <= 0.5 + 1e-9
    hulls = [shapely.MultiPoint(np.argwhere(part)).convex_hull for part in (kept, hidden)]
    assert hulls[0].intersection(hulls[1]).area < 1e-6


@given(SEEDS, st.floats(0.0, 0.9))
@settings(max_examples=20, deadline=None)
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
    exact = lidar.SpinningLidar(range_noise_m=0.0)
    hits = lidar.lidar_points(wall, position, np.random.default_rng(0), exact)
    assert np.abs(hits[:, 2]).max() < 1e-12
    assert np.abs(hits[:, :2]).max() <= 0.5
    beams = (hits - position) / np.linalg.norm(hits - position, axis=1)[:, None]
    steps = (np.degrees(np.arcsin(-beams[:, 1])) + 25.0) / (50.0 / 63.0)
    assert np.abs(steps - np.round(steps)).max() < 1e-9
    # 1 m at 4 m is 14.2 deg: 71 columns, 17 or 18 beams.
    assert len(hits) == pytest.approx(71 * 17.5, rel=0.06)
    noisy = lidar.lidar_points(wall, position, np.random.default_rng(0), lidar.SpinningLidar(range_noise_m=0.02))
    along = np.linalg.norm(noisy - position, axis=1) - np.linalg.norm(hits - position, axis=1)
    assert np.std(along) == pytest.approx(0.02, rel=0.1)
    assert len(lidar.lidar_points(wall, (0.0, -20.0, -1.0), np.random.default_rng(0))) == 0
    with pytest.raises(ValueError, match="beams is 0"):
        lidar.SpinningLidar(beams=0)


def test_lidar_skips_the_holes() -> None:
    window = template_named("uneven_window")
    hits = lidar.lidar_points(
        window.region(), (0.0, 0.0, -3.0), np.random.default_rng(1), lidar.SpinningLidar(range_noise_m=0.0)
    )
    assert len(hits) > 500
    assert shapely.contains_xy(planar.even_odd_shape(list(window.rings)), hits[:, 0], hits[:, 1]).all()


def test_a_miscalibrated_pinhole_is_the_pinhole_with_the_wrong_numbers() -> None:
    true = PinholeCamera(1000, 900, 320, 240, width=640, height=480)
    wrong = noise.MiscalibratedCamera(true, 1.02, np.array([3.0, -2.0]))
    expected = PinholeCamera(1020, 918, 323, 238, width=640, height=480)
    points = np.random.default_rng(0).uniform(-1, 1, (20, 3)) + np.array([0, 0, 3])
    assert np.allclose(wrong.project(points), expected.project(points), atol=1e-9)
    pixels = expected.project(points)
    assert np.allclose(wrong.bearings(pixels), expected.bearings(pixels), atol=1e-12)
    assert (wrong.width, wrong.height, wrong.straight_lines) == (640, 480, True)
    assert wrong.max_angle == true.max_angle


def test_calibration_errors_have_the_stated_spread_and_stay_consistent() -> None:
    camera: FisheyeCamera = setups.fisheye_camera()
    drawn = [noise.miscalibrate(camera, 0.01, 2.0, np.random.default_rng(seed)) for seed in range(300)]
    assert np.std([wrong.focal_scale for wrong in drawn]) == pytest.approx(0.01, rel=0.15)
    assert np.std([wrong.shift for wrong in drawn]) == pytest.approx(2.0, rel=0.15)
    pixels = np.random.default_rng(1).uniform((400, 100), (1900, 1400), (30, 2))
    assert np.allclose(drawn[0].project(drawn[0].bearings(pixels)), pixels, atol=1e-6)
    exact = noise.miscalibrate(camera, 0.0, 0.0, np.random.default_rng(0))
    assert np.allclose(exact.bearings(pixels), camera.bearings(pixels), atol=1e-12)
    with pytest.raises(ValueError, match="center_px is -1"):
        noise.miscalibrate(camera, 0.0, -1.0, np.random.default_rng(0))


# Measures


def random_pose(rng: np.random.Generator) -> tuple[Array, Array]:
    """Any rotation and a translation of a few meters."""
    return setups.any_rotation(rng), rng.normal(0.0, 3.0, 3)


@given(SEEDS, st.floats(1e-6, 179.0))
def test_rotation_error_is_the_angle_between_the_poses(seed: int, angle: float) -> None:
    rng = np.random.default_rng(seed)
    true, _ = random_pose(rng)
    axis = setups.random_direction(3, rng)
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
    assert measures.overlap_error([square + np.array([1.0, 0.0])], [square]) == pytest.approx(0.2)
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
