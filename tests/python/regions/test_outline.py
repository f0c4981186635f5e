"""Outlines of sampled planar patches: area and shape against the patch that was sampled."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose._core import robust_plane
from regionpose.regions.outline import Outline, SparseSamplingWarning, flat_outline, outline_of_points
from scipy.spatial.transform import Rotation

from benchmarks.synthetic.lidar import SpinningLidar, lidar_points
from benchmarks.synthetic.planar import PlaneFrame
from benchmarks.synthetic.setups import perspective_setup
from benchmarks.synthetic.studies.conditions import Condition
from benchmarks.synthetic.studies.problems import draw_problem
from benchmarks.synthetic.templates import all_templates

Array = NDArray[np.float64]

# A template slanted by 25 and 20 deg, so that its edges run at all angles to the scan lines.
SLANT = Rotation.from_euler("xyz", [25.0, 20.0, 10.0], degrees=True)


def area(rings: list[Array]) -> float:
    return float(shapely.Polygon(rings[0], rings[1:]).area)


def overlap(first: list[Array], second: list[Array]) -> float:
    """Intersection over union of two regions given by an outer ring and holes."""
    one, other = (shapely.Polygon(rings[0], rings[1:]) for rings in (first, second))
    return float(one.intersection(other).area / one.union(other).area)


def grid(width: int, height: int, step: tuple[float, float]) -> Array:
    """Samples at the centers of width x height cells of a size, the first cell's corner at the origin."""
    columns, rows = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    return np.column_stack([columns.ravel() * step[0], rows.ravel() * step[1]])


def scan(
    name: str, lidar: SpinningLidar, distance: float, seed: int = 0, size: float = 1.0
) -> tuple[list[Array], Array]:
    """The (n, 3) rings of a slanted template before the lidar at the origin, and the points where it hits."""
    template = next(template for template in all_templates() if template.name == name)
    rings = [SLANT.apply(size * ring) + np.array([0.0, 0.0, distance]) for ring in template.region()]
    return rings, lidar_points(rings, [0.0, 0.0, 0.0], np.random.default_rng(seed), lidar)


def true_rings(rings: list[Array], outline: Outline) -> list[Array]:
    return [(ring - outline.origin) @ outline.axes.T for ring in rings]


@pytest.mark.parametrize("step", [(0.05, 0.05), (0.02, 0.02)])
def test_grid_of_samples_stands_for_its_cells(step: tuple[float, float]) -> None:
    # 20 x 12 cells: through the outer samples only 19 x 11 are seen.
    points = grid(20, 12, step)
    assert area(flat_outline(points, correct_sampling=False)) == pytest.approx(19 * 11 * step[0] * step[1])
    assert area(flat_outline(points)) == pytest.approx(20 * 12 * step[0] * step[1], rel=1e-3)


def test_grown_square_keeps_its_corners() -> None:
    rings = flat_outline(grid(20, 20, (0.05, 0.05)))
    square = [np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])]
    assert overlap(rings, square) > 0.999


def test_hole_shrinks_where_the_outline_grows() -> None:
    # A window of 10 x 8 cells in a wall of 40 x 30: through the samples around it, it spans 11 x 9.
    points = grid(40, 30, (0.05, 0.05))
    u, v = points.T / 0.05
    points = points[~((u > 15) & (u < 25) & (v > 11) & (v < 19))]
    rings = flat_outline(points)
    assert len(rings) == 2
    hole = shapely.Polygon(rings[1]).area
    assert hole == pytest.approx(80 * 0.0025, rel=0.05)
    assert area(rings) == pytest.approx(len(points) * 0.0025, rel=1e-3)


def test_lines_far_apart_extend_half_a_step_and_half_a_gap() -> None:
    # 12 lines 7 cm apart with a return every 1 cm: the patch they stand for is 1.2 m x 0.84 m.
    points = grid(120, 12, (0.01, 0.07))
    rings = flat_outline(points)
    rectangle = [np.array([[0.0, 0.0], [1.2, 0.0], [1.2, 0.84], [0.0, 0.84]])]
    assert overlap(rings, rectangle) > 0.9999


def test_tips_beyond_the_last_line_are_cut_off() -> None:
    # A square on its tip, 1 m from tip to tip: no line passes through the tips.
    points = grid(200, 14, (0.01, 0.075)) - [1.0, 0.525]
    points = points[np.abs(points).sum(axis=1) < 0.5]
    diamond = [np.array([[0.5, 0.0], [0.0, 0.5], [-0.5, 0.0], [0.0, -0.5]])]
    rings = flat_outline(points)
    assert overlap(rings, diamond) > 0.93
    assert area(rings) == pytest.approx(0.5, rel=0.06)


@settings(max_examples=15, deadline=None)
@given(angle=st.floats(0.0, 360.0), shift=st.floats(-50.0, 50.0))
def test_outline_moves_with_the_points(angle: float, shift: float) -> None:
    points = grid(80, 10, (0.01, 0.07))
    turn = Rotation.from_euler("z", angle, degrees=True).as_matrix()[:2, :2]
    assert area(flat_outline(points @ turn.T + shift)) == pytest.approx(0.8 * 0.7, rel=1e-3)


def test_lost_returns_leave_no_holes() -> None:
    points = grid(120, 14, (0.01, 0.07))
    kept = np.random.default_rng(3).random(len(points)) > 0.3
    rings = flat_outline(points[kept])
    assert len(rings) == 1
    assert area(rings) == pytest.approx(1.2 * 0.98, rel=0.02)


LIDARS = {
    "HDL-64": (SpinningLidar(64, -13.4, 13.4, 0.17, 0.02), 10.0, 2.0, 0.03),
    "VLP-16": (SpinningLidar(16, -15.0, 15.0, 0.2, 0.01), 3.0, 1.0, 0.04),
    "dense": (SpinningLidar(128, -9.0, 9.0, 0.12, 0.002), 4.0, 1.0, 0.008),
}


@pytest.mark.slow
@pytest.mark.parametrize("lidar", LIDARS)
def test_correction_removes_most_of_the_bias(lidar: str) -> None:
    scanner, distance, size, bound = LIDARS[lidar]
    plain: list[tuple[float, float]] = []
    corrected: list[tuple[float, float]] = []
    for name in ("rectangle", "triangle", "hexagon", "letter_l"):
        for seed in range(2):
            rings, points = scan(name, scanner, distance, seed, size)
            for outline, found in (
                (outline_of_points(points, correct_sampling=False), plain),
                (outline_of_points(points), corrected),
            ):
                truth = true_rings(rings, outline)
                found.append((area(outline.rings) / area(truth) - 1.0, overlap(outline.rings, truth)))
    (bias_before, overlap_before), (bias_after, overlap_after) = np.mean(plain, axis=0), np.mean(corrected, axis=0)
    assert abs(bias_after) < bound
    assert abs(bias_after) < 0.5 * abs(bias_before)
    assert 1.0 - overlap_after < 0.8 * (1.0 - overlap_before)


def test_sensor_position_takes_out_range_noise() -> None:
    # At 60 deg of incidence 2 cm along the beam move a sample by 3.5 cm on the plane if it is dropped along the normal.
    square = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
    rings = [Rotation.from_euler("x", 60.0, degrees=True).apply(square) + np.array([0.0, 0.0, 4.0])]
    points = lidar_points(rings, np.zeros(3), np.random.default_rng(0), SpinningLidar(128, -15, 15, 0.2, 0.02))
    dropped, along = outline_of_points(points), outline_of_points(points, sensor_origin=[0.0, 0.0, 0.0])
    assert overlap(along.rings, true_rings(rings, along)) > overlap(dropped.rings, true_rings(rings, dropped))
    assert overlap(along.rings, true_rings(rings, along)) > 0.95


def test_frame_before_its_picture_is_part_of_the_region() -> None:
    # A picture of 1.2 m x 0.9 m, its frame 15 mm in front of the glass: the outline is the frame's.
    flat = grid(120, 90, (0.01, 0.01))
    frame = (np.abs(flat - [0.6, 0.45]) > [0.52, 0.37]).any(axis=1)
    noise = np.random.default_rng(0).normal(0.0, 2e-4, len(flat))
    outline = outline_of_points(np.column_stack([flat, np.where(frame, 0.015, 0.0) + noise]))
    assert area(outline.rings) == pytest.approx(1.08, rel=0.01)


def test_plane_holds_against_outliers() -> None:
    generator = np.random.default_rng(0)
    flat = generator.uniform(-0.5, 0.5, (300, 2))
    points = np.column_stack([flat, generator.normal(0.0, 0.005, 300)])
    outliers = generator.uniform(-0.5, 0.5, (120, 3)) + np.array([0.0, 0.0, 0.7])
    _, axes, inliers = robust_plane(np.concatenate([points, outliers]))
    assert abs(axes[2][2]) > np.cos(np.radians(0.5))
    assert (inliers < 300).mean() > 0.97


def test_plane_is_not_that_of_one_scan_line() -> None:
    # Two thirds of the points on one line across a narrow patch: its beams' plane holds them without any error.
    generator = np.random.default_rng(1)
    beams = [(x, y) for y in (0.0, 0.04, 0.08) for x in np.linspace(-0.4, 0.4, 60 if y == 0.0 else 15)]
    points = np.array([[x, y, 3.0] for x, y in beams])
    points *= (1.0 + generator.normal(0.0, 0.002, len(points)))[:, None]
    assert abs(robust_plane(points)[1][2][2]) > np.cos(np.radians(5.0))


def test_plane_is_not_that_of_a_short_noisy_scan_line() -> None:
    # Half of the points on one line 0.5 m long, which noise of 1 cm along the beams widens to a twentieth of that.
    generator = np.random.default_rng(0)
    lines = [(np.linspace(-0.25, 0.25, 24), 0.0), (np.linspace(-0.1, 0.1, 8), 0.18), (np.linspace(-0.1, 0.1, 8), -0.18)]
    for _ in range(20):
        points = np.concatenate([np.column_stack([x, np.full_like(x, y), 5.0 + 0.7 * x + y]) for x, y in lines])
        points += generator.normal(0.0, 0.01, len(points))[:, None] * points / np.linalg.norm(points, axis=1)[:, None]
        normal = np.array([0.7, 1.0, -1.0]) / np.sqrt(2.49)
        assert abs(robust_plane(points)[1][2] @ normal) > np.cos(np.radians(8.0))


@pytest.mark.filterwarnings("ignore::regionpose.regions.outline.SparseSamplingWarning")
@pytest.mark.parametrize("distance", [3.0, 5.5])
def test_correction_has_no_bias_over_where_the_rings_fall(distance: float) -> None:
    # Rings 2 deg apart: a single scan errs by half a gap at either end, their mean by neither.
    lidar, biases = SpinningLidar(16, -15.0, 15.0, 0.2, 0.01), []
    square = 0.5 * np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
    for phase in np.linspace(-0.5, 0.5, 20, endpoint=False):
        shifted = square + np.array([0.0, phase * distance * np.tan(np.radians(2.0)), distance])
        points = lidar_points([shifted], np.zeros(3), np.random.default_rng(1), lidar)
        biases.append(area(outline_of_points(points, sensor_origin=[0.0, 0.0, 0.0]).rings) - 1.0)
    assert abs(np.mean(biases)) < 0.02
    assert np.ptp(biases) > 0.05


def test_few_rows_of_samples_are_warned_of() -> None:
    with pytest.warns(SparseSamplingWarning, match=r"about 4 rows of samples, 0\.2 m apart.* known to 10 %"):
        flat_outline(grid(100, 4, (0.01, 0.2)))


def test_parts_that_the_outline_misses_are_warned_of() -> None:
    # Two fields a meter apart, hardly joined by two points.
    fields = np.concatenate(
        [grid(20, 20, (0.02, 0.02)), grid(10, 20, (0.02, 0.02)) + np.array([1.4, 0.0]), [[0.7, 0.2], [1.0, 0.2]]]
    )
    with pytest.warns(SparseSamplingWarning, match=r"\d+ % of 602 points lie outside"):
        flat_outline(fields)


def test_many_samples_give_the_outline_of_their_even_part() -> None:
    # A wall of 3 m x 2 m with a door of 0.8 m x 1.6 m, in 200 000 samples.
    samples = np.random.default_rng(0).uniform(0.0, 1.0, (200_000, 2)) * [3.0, 2.0]
    door = (np.abs(samples[:, 0] - 1.5) < 0.4) & (np.abs(samples[:, 1] - 1.0) < 0.8)
    rings = flat_outline(samples[~door])
    assert len(rings) == 2
    assert area(rings) == pytest.approx(6.0 - 1.28, rel=1e-2)


@pytest.mark.filterwarnings("ignore::regionpose.regions.outline.SparseSamplingWarning")
@pytest.mark.parametrize(("seed", "beams", "noise"), [(22, 16, 0.03), (66, 16, 0.03), (70, 16, 0.01), (75, 32, 0.0)])
def test_outlines_of_few_samples_never_cross_themselves(seed: int, beams: int, noise: float) -> None:
    setup = perspective_setup()
    problem = draw_problem(setup, Condition(planes=1, lidar_beams=beams, range_noise_m=noise), seed)
    (ring, *_) = problem.world_regions[0].rings
    assert shapely.Polygon(PlaneFrame.of_region([ring]).flat(ring)).is_valid


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_a_single_scan_line_is_no_patch(noise: float) -> None:
    # One ring of a lidar across a wall 1 m high: nothing tells how far it reaches above and below.
    wall = np.array([[-2.0, -0.5, 4.0], [2.0, -0.5, 4.6], [2.0, 0.5, 4.6], [-2.0, 0.5, 4.0]])
    lidar = SpinningLidar(1, 5.0, 5.0, 0.2, noise)
    points = lidar_points([wall], np.zeros(3), np.random.default_rng(0), lidar)
    with pytest.raises(ValueError, match=r"2\d\d points lie on one scan line; needed"):
        outline_of_points(points, sensor_origin=[0.0, 0.0, 0.0])


def test_single_scan_line_of_a_patch_shows_without_the_sensor() -> None:
    # A conic of a ring 10 deg above the horizon on a wall 1 m wide, 5 m away: it bends by 9 mm.
    x = np.linspace(-0.5, 0.5, 60)
    points = np.column_stack([x, np.tan(np.radians(10.0)) * np.hypot(x, 5.0), np.full(60, 5.0)])
    with pytest.raises(ValueError, match="60 points lie on one scan line"):
        outline_of_points(points)


def test_points_that_span_flat_triangles_alone_have_their_hull() -> None:
    # Sides of 1.04 m and 2 m: the circle through the corners is wider than 1.5 of the gaps that join them.
    corners = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 0.3, 0.0]])
    assert area(outline_of_points(corners).rings) == pytest.approx(0.3)


def test_four_corners_are_their_own_outline() -> None:
    corners = np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 1.0, 1.0], [0.0, 1.0, 1.0]])
    assert area(outline_of_points(corners).rings) == pytest.approx(2.0)


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (np.zeros((5, 2)), {}, "shape"),
        ([[0.0, 0.0, 0.0], [1.0, 0.0, np.nan], [0.0, 1.0, 0.0]], {}, "point 1"),
        ([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]], {}, "at least 3"),
        (np.outer(np.arange(9.0), [1.0, 2.0, 3.0]), {}, "on one line"),
        (np.eye(3), {"radius_m": -1.0}, "radius_m"),
        (np.random.default_rng(0).random((50, 3)), {"sensor_origin": [0.0, 1.0]}, "sensor_origin"),
    ],
)
def test_bad_input_is_named(points: object, options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        outline_of_points(points, **options)  # type: ignore[arg-type]
