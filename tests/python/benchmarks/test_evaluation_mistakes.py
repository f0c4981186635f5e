"""The study of mistakes: random polygons, what is wrong with them, and whether that is told."""

from __future__ import annotations

import typing

import numpy as np
import pytest
import shapely

from benchmarks.synthetic.planar import area_vector, region_centroid
from benchmarks.synthetic.polygons import VERTICES, random_polygon
from benchmarks.synthetic.setups import perspective_setup
from benchmarks.synthetic.studies import Condition, Results, StudyProblem, results_table, run_study
from benchmarks.synthetic.studies.catalog import STUDIES
from benchmarks.synthetic.studies.conditions import Mistake
from benchmarks.synthetic.studies.mistakes import FOCAL_ERROR, FRONTAL_DEG, draw_mistaken_problem, mirrored
from benchmarks.synthetic.studies.rows import failed_row, whole_row
from benchmarks.synthetic.studies.trust import is_false_alarm, untold_rows
from benchmarks.synthetic.templates import is_symmetric

MISTAKES = typing.get_args(Mistake)


def drawn(mistake: Mistake, seed: int) -> StudyProblem:
    """A problem of the pinhole camera."""
    return draw_mistaken_problem(perspective_setup(), Condition(mistake=mistake), seed)


@pytest.mark.parametrize("seed", range(20))
def test_random_polygons_are_simple_and_centered(seed: int) -> None:
    ring = random_polygon(np.random.default_rng(seed), 2.0)
    polygon = shapely.Polygon(ring)
    assert VERTICES[0] <= len(ring) <= VERTICES[1] and polygon.is_valid
    assert shapely.LinearRing(ring).is_ccw and np.ptp(ring, axis=0).max() == pytest.approx(2.0)
    np.testing.assert_allclose(polygon.centroid.coords[0], (0.0, 0.0), atol=1e-12)
    assert not is_symmetric("polygon") and is_symmetric("square")


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_problem_has_its_mistake_and_no_other(mistake: Mistake) -> None:
    first, again = drawn(mistake, 3), drawn(mistake, 3)
    np.testing.assert_array_equal(first.image_regions[0].rings[0], again.image_regions[0].rings[0])
    count = {"mirrored": 1, "replaced": 2}.get(mistake, 2 if mistake.startswith("swapped") else 0)
    assert len(first.wrong) == count and first.drawn["planes"] == len(first.world_regions)
    scale = np.diff(first.camera.project(np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]])), axis=0)[0, 0] / 190.0
    assert abs(scale - 1.0) == pytest.approx(FOCAL_ERROR if mistake == "focal" else 0.0, abs=1e-9)
    if mistake == "frontal":
        angle = float(first.scene.view_angles()[0])
        assert min(angle, 180.0 - angle) < FRONTAL_DEG


def test_rounded_corners_are_whole_pixels_and_small_regions_small() -> None:
    problem = drawn("rounded", 1)
    for region in problem.image_regions:
        (ring,) = region.rings
        np.testing.assert_allclose(ring, np.round(ring), atol=1e-9)
        assert 5.0 < np.ptp(ring, axis=0).max() < 100.0


def test_swapped_regions_have_one_another_s_images() -> None:
    problem = drawn("swapped-3", 2)
    first, second = problem.wrong
    right = [ring.mean(axis=0) for (ring,) in problem.scene.image_rings]
    seen = [region.rings[0].mean(axis=0) for region in problem.image_regions]
    assert np.linalg.norm(seen[first] - right[second]) < 5.0 and np.linalg.norm(seen[second] - right[first]) < 5.0


def test_a_mirrored_region_is_the_same_shape_the_other_way_round() -> None:
    rings = drawn("none", 5).scene.regions[0]
    other = mirrored(rings, np.random.default_rng(0))
    np.testing.assert_allclose(region_centroid(other), region_centroid(rings), atol=1e-9)
    np.testing.assert_allclose(area_vector(other), area_vector(rings), atol=1e-9)
    lengths = [np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1) for ring in (rings[0], other[0])]
    np.testing.assert_allclose(np.sort(lengths[0]), np.sort(lengths[1]))


def test_the_study_counts_what_is_not_told() -> None:
    made = {**failed_row(ValueError()), "error": "", "rotation_deg": 0.1, "templates_right": "polygon"}
    untold = whole_row(Condition(mistake="mirrored"), 0, {**made, "regions_wrong": 1, "regions_untold": 1})
    named = whole_row(Condition(), 0, {**made, "regions_wrong": 1, "warnings": "poor-overlap"})
    accused = whole_row(Condition(), 1, {**named, "regions_accused": 1})
    rows = Results({}, [untold, named, accused])
    assert untold_rows(rows) == [untold]
    assert [is_false_alarm(row) for row in rows.rows] == [False, False, True]
    shown = results_table(rows)
    assert "| mirrored | 1 | 0.0 | 0.0 | 1000.0 | 1000.0 | 0.0 |" in shown


def test_the_study_runs() -> None:
    study = STUDIES["mistakes"].only({"camera": "perspective", "mistake": "swapped-2"})
    (row,) = run_study(study, 1).rows
    assert not row["error"] and row["regions_wrong"] == 2 and row["warnings"]
