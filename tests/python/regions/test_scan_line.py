"""Regions that a single scan line crosses: where they begin and end along it, whatever their plane."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import regionpose as rp
from diagnostics import rig_of
from numpy.typing import NDArray
from regionpose import _core
from rig_frames import RIG

from benchmarks.synthetic.setups import perspective_setup
from benchmarks.synthetic.studies.conditions import Condition
from benchmarks.synthetic.studies.problems import draw_problem

Array = NDArray[np.float64]

CENTER = np.array([0.2, 0.3, 6.0])
WIDTH = 1.3


def one_line(tilt: float, noise: float = 0.0, window: bool = False) -> tuple[Array, NDArray[np.intp]]:
    """The scan of 3 lines, 2 degrees apart, of a scanner at the origin that turns about y; the middle one crosses a
    board that turns about the horizontal line through `CENTER` by `tilt`, in rad, before a wall at 9 m.
    """
    rng = np.random.default_rng(4)
    azimuth = np.radians(np.arange(-20.0, 20.0, 0.2))
    middle = np.arctan2(CENTER[1], CENTER[2])
    points, members = [], []
    for elevation in (middle - np.radians(2.0), middle, middle + np.radians(2.0)):
        slope = np.tan(elevation)
        # Flat fans of beams, so that the middle one meets any board about that line along the line.
        beams = np.column_stack([np.tan(azimuth), np.full(azimuth.size, slope), np.ones(azimuth.size)])
        normal = np.array([0.0, np.sin(tilt), np.cos(tilt)])
        on_board = beams * (normal @ CENTER / (beams @ normal))[:, None]
        beside = np.abs(on_board[:, 0] - CENTER[0])
        met = (elevation == middle) & (beside < 0.5 * WIDTH) & ~(window & (beside < 0.2))
        found = np.where(met[:, None], on_board, 9.0 * beams)
        points.append(
            found * (1.0 + noise * rng.standard_normal((azimuth.size, 1)) / np.linalg.norm(found, axis=1)[:, None])
        )
        members.append(met)
    return np.concatenate(points), np.flatnonzero(np.concatenate(members))


def line_region(tilt: float = 0.4, extends: bool = False, **how: float | bool) -> rp.WorldRegion:
    points, members = one_line(tilt, **how)  # type: ignore[arg-type]
    return rp.WorldRegion.from_scan(points, members, sensor_origin=[0, 0, 0], extends=extends)


def from_middle(places: Array) -> Array:
    """How far along the line places lie from its middle."""
    off: Array = np.linalg.norm((places - CENTER)[:, 1:], axis=1)
    assert off.max() < 0.05
    along: Array = np.abs(places[:, 0] - CENTER[0])
    return along


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_places_lie_on_the_line_inside_and_outside(noise: float) -> None:
    region = line_region(noise=noise)
    assert region.is_line and region.samples is not None
    inside, outside = region.samples
    assert len(inside) > 40 and len(outside) > 20
    # A place is as far off along the line as the line turns by range noise.
    assert from_middle(inside).max() < 0.5 * WIDTH + 0.3 * noise
    assert from_middle(outside).min() > 0.5 * WIDTH - 0.3 * noise
    way = np.linalg.svd(inside - inside.mean(axis=0))[2][0]
    assert np.abs(np.cross(np.concatenate([inside, outside]) - inside.mean(axis=0), way)).max() < 1e-9


def test_the_plane_counts_for_nothing() -> None:
    flat, tilted = (line_region(tilt).samples for tilt in (0.0, 0.9))
    assert flat is not None and tilted is not None
    for some, others in zip(flat, tilted, strict=True):
        np.testing.assert_allclose(np.sort(some, axis=0), np.sort(others, axis=0), atol=1e-9)


def test_returns_on_the_line_are_outside_unless_the_region_extends() -> None:
    points, members = one_line(0.0)
    kept = members[from_middle(points[members]) < 0.4 * WIDTH]
    region = rp.WorldRegion.from_scan(points, kept, sensor_origin=[0, 0, 0])
    assert region.samples is not None
    assert from_middle(region.samples[1]).min() < 0.43 * WIDTH
    longer = rp.WorldRegion.from_scan(points, kept, sensor_origin=[0, 0, 0], extends=True)
    assert longer.samples is not None
    assert from_middle(longer.samples[1]).min() > 0.5 * WIDTH


def test_a_window_is_enclosed() -> None:
    known = line_region(window=True).core.samples
    assert known is not None
    assert from_middle(known[2]).max() < 0.21
    assert from_middle(known[1]).min() > 0.5 * WIDTH


def test_many_places_leave_those_at_the_ends() -> None:
    x = np.arange(-4.0, 4.0, 0.0005)
    met = np.abs(x) < 2.0
    points = np.column_stack([x, np.zeros(x.size), np.full(x.size, 5.0)])
    points[~met] *= 1.5
    region = rp.WorldRegion.from_scan(points, np.flatnonzero(met), sensor_origin=[0, 0, 0])
    assert region.is_line and region.samples is not None
    places = np.concatenate(region.samples)
    assert len(places) <= 1000
    assert np.sum(np.abs(np.abs(places[:, 0]) - 2.0) < 0.15) > 600


def test_it_survives_pickling_and_is_seen_from_anywhere() -> None:
    region = line_region().with_viewpoint([0, 0, 0])
    again = pickle.loads(pickle.dumps(region))
    assert again.is_line and "is_line=True" in repr(again)
    for given, kept in zip(region.samples or (), again.samples, strict=True):
        np.testing.assert_allclose(kept, given, atol=1e-12)


def test_three_returns_are_a_line_and_those_of_one_beam_are_not() -> None:
    points, members = one_line(0.4, noise=0.01)
    kept = members[np.abs(points[members, 0] - CENTER[0]) < 0.03]
    assert len(kept) == 3
    assert rp.WorldRegion.from_scan(points, kept, sensor_origin=[0, 0, 0]).is_line
    ray = np.outer([1.0, 2.0, 3.0, 4.0], CENTER)
    with pytest.raises(ValueError, match="4 points that are identical or on one line"):
        rp.WorldRegion.from_scan(ray, np.arange(4), sensor_origin=[0, 0, 0])


def test_without_the_scanner_or_what_is_outside_it_is_refused() -> None:
    points, members = one_line(0.4, noise=0.01)
    with pytest.raises(ValueError, match="62 points that are identical or on one line"):
        rp.WorldRegion.from_scan(*one_line(0.4))
    with pytest.raises(ValueError, match="62 points lie on one scan line; needed points on lines across the patch"):
        rp.WorldRegion.from_scan(points[members], np.arange(len(members)), sensor_origin=[0, 0, 0])


@pytest.mark.parametrize("seed", [22, 28, 42, 98])
def test_a_line_makes_a_pose_more_exact(seed: int) -> None:
    condition = Condition(planes=3, templates="asymmetric", lidar_beams=16, range_noise_m=0.01, scan="samples")
    problem = draw_problem(perspective_setup(), condition, seed)
    lines = np.array([world.is_line for world in problem.world_regions])
    assert lines.sum() == 1
    true = rp.Pose.from_parts(problem.scene.rotation, problem.scene.translation)
    deviations = []
    for kept in (np.full(3, True), ~lines):
        pairs = zip(problem.image_regions, problem.world_regions, kept, strict=True)
        images, worlds = zip(*((image, world) for image, world, is_kept in pairs if is_kept), strict=True)
        estimate = rp.estimate_pose(problem.camera, images, worlds)
        way = estimate.pose.local_coordinates(true)
        # One in a hundred poses is farther off (chi-squared of 6 degrees of freedom: 16.8).
        assert way @ np.linalg.solve(estimate.covariance, way) < 16.8
        deviations.append(np.sqrt(np.trace(estimate.covariance[:3, :3])))
    assert deviations[0] < 0.8 * deviations[1]


def moved(world: rp.WorldRegion, motion: rp.Pose) -> rp.WorldRegion:
    """The region of a line elsewhere."""
    core = world.core
    assert core.samples is not None
    axes = [motion.rotation.apply(axis) for axis in core.axes[:2]]
    strip = _core.WorldRegion.from_outline(motion.transform(core.origin), axes, core.outline)
    return rp.WorldRegion(strip.with_samples(*(motion.transform(places) for places in core.samples), is_line=True), ())


@pytest.mark.slow
def test_the_lines_of_many_frames_give_a_pose() -> None:
    """Three lines hold a pose weakly, six well: what a scanner of a single line sees in six places."""
    condition = Condition(planes=3, templates="asymmetric", lidar_beams=16, range_noise_m=0.01, scan="samples")
    frames = []
    for seed in (20, 22, 28, 42, 98):
        problem = draw_problem(perspective_setup(), condition, seed)
        own = rp.Pose.from_parts(problem.scene.rotation, problem.scene.translation)
        pairs = zip(problem.image_regions, problem.world_regions, strict=True)
        lines = [(image, moved(world, RIG.inverse() @ own)) for image, world in pairs if world.is_line]
        images, worlds = zip(*lines, strict=True)
        frames.append(rp.Frame(images, worlds))
    together = rp.estimate_rig(
        problem.camera, frames, solver=rp.Solver(max_rotation_sigma_deg=2.0, max_translation_sigma_percent=4.0)
    )
    way = together.pose.local_coordinates(RIG)
    assert way @ np.linalg.solve(together.covariance, way) < 16.8
    assert np.linalg.norm(way[:3]) < np.radians(1.0)
    # What six lines leave open of their regions confirms nothing.
    assert {warning.code for warning in together.warnings} <= {rp.WarningCode.LOW_CONFIDENCE}
    assert together.confidence > 0.8
    assert np.isnan([frame.residual_px for frame in rig_of(together).frames]).all()
    with pytest.raises(ValueError, match="refine_camera found regions sampled along one scan line"):
        rp.estimate_rig(problem.camera, frames, refine_camera=("focal",))


def test_a_line_has_no_shape_to_match() -> None:
    condition = Condition(planes=3, templates="asymmetric", lidar_beams=16, range_noise_m=0.01, scan="samples")
    problem = draw_problem(perspective_setup(), condition, 28)
    images, worlds = problem.image_regions, problem.world_regions
    lines = [number for number, world in enumerate(worlds) if world.is_line]
    assert len(lines) == 1
    matches = rp.match_regions(problem.camera, images, worlds)
    assert lines[0] in matches.unmatched_world


def test_lines_alone_leave_a_weak_pose_that_is_told() -> None:
    condition = Condition(planes=3, templates="asymmetric", lidar_beams=16, range_noise_m=0.01, scan="samples")
    problem = draw_problem(perspective_setup(), condition, 38)
    sides = [pair for pair in zip(problem.image_regions, problem.world_regions, strict=True) if pair[1].is_line]
    assert len(sides) == 2
    images, worlds = zip(*sides, strict=True)
    estimate = rp.estimate_pose(problem.camera, images, worlds)
    values = {warning.code.value: warning.values for warning in estimate.warnings}
    assert values["weak-geometry"]["line_regions"] == 2
    assert estimate.confidence < 0.5
