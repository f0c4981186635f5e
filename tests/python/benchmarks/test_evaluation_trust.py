"""Whether an estimate can be trusted: wrong regions, drawn conditions, verdicts, confidence, coverage and bounds."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from regionpose import PoseWarning, Solver, WarningCode, estimate_pose
from regionpose._core import retract_pose
from small_study import PERSPECTIVE, QUICK, comparable

from benchmarks.synthetic import noise, planar
from benchmarks.synthetic.measures import translation_error
from benchmarks.synthetic.setups import perspective_setup
from benchmarks.synthetic.studies import (
    Condition,
    Results,
    Study,
    StudyProblem,
    draw_problem,
    results_table,
    run_study,
)
from benchmarks.synthetic.studies.bounds import anchor_shift, pose_bound, undisturbed_pieces
from benchmarks.synthetic.studies.catalog import STUDIES
from benchmarks.synthetic.studies.conditions import NoiseModel
from benchmarks.synthetic.studies.confidence import ranking, reliability
from benchmarks.synthetic.studies.coverage import bound_ratios, coverage, coverage_curve
from benchmarks.synthetic.studies.mixes import DRAWN, MOST_HIDDEN, PLANES_WITH_WRONG, draw_mixed_problem
from benchmarks.synthetic.studies.rows import Row, failed_row, outlier_named, whole_row
from benchmarks.synthetic.studies.trust import Verdicts, silent_rows
from benchmarks.synthetic.templates import template_named

Array = NDArray[np.float64]


def made_row(**values: Any) -> Row:
    """A row that holds these values and nothing else."""
    return whole_row(Condition(), 0, {**failed_row(ValueError()), "error": "", "warnings": "", **values})


# Wrong regions


@pytest.mark.parametrize("seed", range(3))
def test_another_shape_takes_the_place_of_a_region(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tilted = [ring @ np.linalg.qr(rng.normal(size=(3, 3)))[0] + 1.0 for ring in template_named("hook").region()]
    other = template_named("uneven_window").region()
    placed = noise.another_shape(tilted, other, rng)
    np.testing.assert_allclose(planar.area_vector(placed), planar.area_vector(tilted), atol=1e-12)
    np.testing.assert_allclose(planar.region_centroid(placed), planar.region_centroid(tilted), atol=1e-12)
    scales = [
        np.linalg.norm(a - a[0], axis=1)[1:] / np.linalg.norm(b - b[0], axis=1)[1:]
        for a, b in zip(placed, other, strict=True)
    ]
    np.testing.assert_allclose(np.concatenate(scales), scales[0][0])


def test_a_region_elsewhere_is_the_same_shape_in_its_plane() -> None:
    rings = template_named("house").region()
    moved = noise.elsewhere(rings, np.random.default_rng(1))
    np.testing.assert_allclose(planar.area_vector(moved), planar.area_vector(rings), atol=1e-12)
    shift = planar.region_centroid(moved) - planar.region_centroid(rings)
    assert np.linalg.norm(shift) == pytest.approx(0.5 * np.sqrt(np.linalg.norm(planar.area_vector(rings))))
    lengths = [np.linalg.norm(np.diff(ring, axis=0), axis=1) for ring in (rings[0], moved[0])]
    np.testing.assert_allclose(*lengths)


@pytest.mark.parametrize("wrong", ["shape", "place"])
@pytest.mark.parametrize("side", ["2d", "3d"])
def test_one_region_is_wrong_on_one_side(side: Any, wrong: Any) -> None:
    right = draw_problem(PERSPECTIVE, Condition(planes=3, side=side), 1)
    problem = draw_problem(PERSPECTIVE, Condition(planes=3, side=side, wrong=wrong), 1)
    assert len(problem.wrong) == 1 and not right.wrong
    changed = {
        "2d": [not same(a.rings, b.rings) for a, b in zip(problem.image_regions, right.image_regions, strict=True)],
        "3d": [not same(a.rings, b.rings) for a, b in zip(problem.world_regions, right.world_regions, strict=True)],
    }
    assert np.flatnonzero(changed.pop(side)).tolist() == list(problem.wrong)
    assert not any(*changed.values())
    assert problem.scene.names == right.scene.names, "the scene stays the true one"


def same(rings: Any, others: Any) -> bool:
    """Whether rings are the same to rounding."""
    return len(rings) == len(others) and all(
        a.shape == b.shape and np.allclose(a, b) for a, b in zip(rings, others, strict=True)
    )


def test_a_wrong_region_is_named() -> None:
    problem = draw_problem(perspective_setup(), Condition(planes=4, wrong="shape"), 0)
    estimate = estimate_pose(problem.camera, problem.image_regions, problem.world_regions)
    assert outlier_named(problem, estimate) == "right"
    others = [place for place in range(4) if place not in problem.wrong]
    named = PoseWarning(WarningCode.OUTLIER_REGION, (others[0],))
    assert outlier_named(problem, replace(estimate, warnings=(*estimate.warnings, named))) == "wrong"
    poor = PoseWarning(WarningCode.POOR_OVERLAP, (others[0],))
    assert outlier_named(problem, replace(estimate, warnings=(poor,))) == "none"


# Drawn conditions


def test_seeds_draw_the_strength_of_a_disturbance() -> None:
    condition = Condition(model="occlusion")
    problems = [draw_mixed_problem(PERSPECTIVE, condition, seed) for seed in range(6)]
    again = draw_mixed_problem(PERSPECTIVE, condition, 3)
    assert again.drawn == problems[3].drawn and again.scene.names == problems[3].scene.names
    assert all(set(problem.drawn) == set(DRAWN) for problem in problems)
    shares = [float(problem.drawn["noise"] or 0.0) for problem in problems]
    assert len(set(shares)) == 6 and min(shares) > 0.0 and max(shares) < MOST_HIDDEN
    for problem, share in zip(problems, shares, strict=True):
        change = problem.image_change if problem.drawn["side"] == "2d" else problem.world_change
        assert change == pytest.approx(share, abs=0.02), "pixels are whole"
    other = draw_mixed_problem(PERSPECTIVE, Condition(model="exact"), 3)
    assert other.drawn["noise"] == 0.0 and not np.allclose(other.scene.rotation, again.scene.rotation)


def test_a_wrong_region_has_others_beside_it() -> None:
    drawn = [draw_mixed_problem(PERSPECTIVE, Condition(model="wrong-region"), seed).drawn for seed in range(6)]
    assert all(values["planes"] in PLANES_WITH_WRONG and values["wrong"] != "none" for values in drawn)


def test_rows_hold_what_was_drawn_and_tables_are_not_divided_by_it() -> None:
    trust = replace(STUDIES["trust"], setups={"perspective": PERSPECTIVE}, grids=[{"model": ("exact", "calibration")}])
    results = run_study(trust, 3)
    drawn = [draw_mixed_problem(PERSPECTIVE, Condition(model="calibration"), seed).drawn for seed in range(3)]
    assert [row["focal_error"] for row in results.rows[3:]] == [values["focal_error"] for values in drawn]
    assert results.varying() == ["model"]
    with pytest.raises(ValueError, match="draws planes"):
        trust.with_values({"planes": (1,)})


def test_one_condition_is_run_again_alone() -> None:
    whole = run_study(QUICK, 2)
    alone = run_study(QUICK.only({"noise": "0.05", "planes": "2"}), 1, seed=1)
    assert comparable(alone.rows) == comparable([row for row in whole.rows if row["noise"] == 0.05][1:])


def test_warnings_of_the_regions_are_kept_in_the_row() -> None:
    study = Study("lidar", "", [{"lidar_beams": (16,)}], setups={"perspective": perspective_setup()})
    (row,) = run_study(study, 1).rows
    assert row["input_warnings"] == "SparseSamplingWarning"


# Verdicts


def test_verdicts_count_right_and_wrong_poses_by_their_warnings() -> None:
    rows = [
        made_row(rotation_deg=0.1, templates_right="hook", error_sigmas=0.5),
        made_row(rotation_deg=0.1, templates_right="hook;star", warnings="ambiguous-pose"),
        made_row(rotation_deg=0.1, templates_right="square;star", warnings="ambiguous-pose"),
        made_row(
            rotation_deg=0.1, templates_right="hook", warnings="outlier-region", outlier_named="right", regions_wrong=1
        ),
        made_row(rotation_deg=0.1, templates_right="hook", warnings="outlier-region", outlier_named="wrong"),
        made_row(
            rotation_deg=0.1,
            templates_right="hook",
            warnings="ambiguous-pose;ambiguous-region;outlier-region",
            regions_wrong=1,
        ),
        made_row(rotation_deg=3.0, templates_right="hook", error_sigmas=2.9),
        made_row(rotation_deg=3.0, templates_right="hook", warnings="weak-geometry"),
        made_row(rotation_deg=9.0, templates_right="hook", warnings="ambiguous-pose;poor-overlap"),
        made_row(rotation_deg=90.0, templates_right="hook", error_sigmas=3.1),
        made_row(error="PoseError: none", rotation_deg=float("nan")),
    ]
    assert Verdicts.of(Results({}, rows)) == Verdicts(
        scenes=11,
        right=6,
        right_warned=5,
        false_alarms=2,
        between=2,
        between_silent=1,
        wrong=2,
        wrong_silent=1,
        unanswered=1,
        named_right=1,
        named_wrong=1,
        trusted=3,
        trusted_beyond=1,
    )


def test_what_is_silently_wrong_is_listed_with_its_command() -> None:
    settings = {"study": "trust", "drawn": DRAWN}
    rows = [made_row(rotation_deg=angle, templates_right="hook", seed=7) for angle in (0.1, 20.0)]
    results = Results(settings, [{**row, "model": model} for row, model in zip(rows, ("exact", "lidar"), strict=True)])
    assert silent_rows(results) == [results.rows[1]]
    table = results_table(results)
    assert "1 of 2 problems;" in table and "--seed 7 --scenes 1 --only 'model=lidar'`" in table


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"planes": 0}, "planes is 0; needed 1 or more"),
        ({"regions_per_plane": 0}, "regions_per_plane is 0; needed 1 or more"),
        ({"noise": -0.05}, "noise is -0.05; needed a share"),
        ({"noise": 1.2}, "noise is 1.2; needed a share"),
        ({"noise": float("nan")}, "noise is nan; needed a share"),
    ],
)
def test_a_condition_that_no_scene_can_meet_is_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        Condition(**fields)


def test_a_sparse_scan_of_a_single_region_comes_to_an_end() -> None:
    """Few rows near the camera leave almost everything open: factors ran away, to evidence of e to the 46 million."""
    problem = draw_mixed_problem(perspective_setup(), Condition(model="lidar"), 90)
    estimate = estimate_pose(problem.camera, problem.image_regions, problem.world_regions)
    assert np.isfinite(estimate.pose.translation).all()
    assert estimate.warnings
    assert estimate.confidence < 0.5


# Confidence


def test_poses_are_counted_by_their_confidence_and_by_how_near_the_truth_they_are() -> None:
    sure = [made_row(confidence=0.95, rotation_deg=9.0 if k < 2 else 0.1) for k in range(40)]
    shared = [made_row(confidence=0.1, rotation_deg=3.0 if k < 5 else 90.0) for k in range(50)]
    certain = [made_row(confidence=1.0, rotation_deg=0.1)]
    unsolved = {**made_row(confidence=0.5, rotation_deg=0.1), "error": "PoseError"}
    results = Results({}, [*sure, *shared, *certain, unsolved])
    found = reliability(results)
    assert [(one.least, one.most, one.count) for one in found] == [(0.05, 0.15, 50), (0.9, 0.97, 40), (0.99, 1.0, 1)]
    np.testing.assert_allclose([one.stated for one in found], [0.1, 0.95, 1.0])
    np.testing.assert_allclose([one.held for one in found], [0.1, 0.95, 1.0])
    np.testing.assert_allclose([one.right for one in found], [0.0, 0.95, 1.0])
    assert "| 90 to 97 % | 40 | 95.0 % | 95.0 % | 95.0 % |" in results_table(results)


def test_confidences_rank_poses_as_they_say_if_they_are_right_as_often() -> None:
    sure = [made_row(confidence=0.75, rotation_deg=9.0 if k < 1 else 0.1) for k in range(4)]
    doubtful = [made_row(confidence=0.25, rotation_deg=0.1 if k < 1 else 90.0) for k in range(4)]
    found = ranking(Results({}, [*sure, *doubtful]))
    # Of the 16 pairs 9 are in order and 6 tie.
    assert found is not None and found.found == found.expected == 12.0 / 16.0
    text = results_table(Results({}, [*sure, *doubtful]))
    assert "in 75.0 % (area under the ROC curve); in 75.0 % if each" in text
    better = ranking(Results({}, [*sure[1:], *doubtful[1:]]))
    assert better is not None and better.found == 1.0 and better.expected < 0.8
    assert ranking(Results({}, sure[1:])) is None


@pytest.mark.parametrize("side", ["2d", "3d"])
def test_answers_that_fit_alike_share_the_confidence(side: Literal["2d", "3d"]) -> None:
    problem = draw_problem(perspective_setup(), Condition(templates="symmetric", side=side, noise=0.05), 3)
    estimate = estimate_pose(problem.camera, problem.image_regions, problem.world_regions)
    shares = [
        estimate.diagnostics.mode_probability,
        *(other.mode_probability for other in estimate.diagnostics.alternatives),
    ]
    assert len(shares) >= 2 and 0.8 < sum(shares) <= 1.0 and max(shares) < 0.8


@pytest.mark.slow
@pytest.mark.parametrize("model", ["lidar", "combined", "wrong-region", "squares-3d"])
def test_no_pose_of_little_confidence_goes_without_a_warning(model: NoiseModel) -> None:
    found = []
    for seed in range(6):
        problem = draw_mixed_problem(perspective_setup(), Condition(model=model), seed)
        estimate = estimate_pose(
            problem.camera, problem.image_regions, problem.world_regions, solver=Solver(driver="native")
        )
        stated = estimate.diagnostics.mode_probability + sum(
            other.mode_probability for other in estimate.diagnostics.alternatives
        )
        assert stated > 0.97 or estimate.warnings, f"seed {seed}: {stated}"
        found.append(stated)
    assert max(found) > 0.97


# Coverage


def covered(scale: float, seed: int = 0) -> Results:
    """Rows whose errors have `scale` times the variance that they are said to have, and some that do not count."""
    rng = np.random.default_rng(seed)
    errors = np.sqrt(scale) * rng.normal(size=(4000, 6))
    sigmas = {f"sigma_rotation_{axis}_deg": 0.5 for axis in "xyz"}
    rows = [
        made_row(
            solved=True,
            mahalanobis_squared=float(error @ error),
            **sigmas,
            **{f"nearest_rotation_{axis}_deg": 0.5 * float(e) for axis, e in zip("xyz", error[:3], strict=True)},
        )
        for error in errors
    ]
    unsolved = made_row(solved=False, mahalanobis_squared=1e6, **sigmas)
    other = made_row(solved=True, nearest_rank=1, mahalanobis_squared=1e6, **sigmas)
    unknown = made_row(solved=True, mahalanobis_squared=float("nan"), **sigmas)
    return Results({}, [*rows, unsolved, other, unknown])


def test_coverage_is_nominal_where_the_covariance_is_right() -> None:
    found = coverage(covered(1.0))
    assert found.count == 4000
    np.testing.assert_allclose(found.inside, (0.5, 0.9, 0.99), atol=0.025)
    assert found.median_ratio == pytest.approx(1.0, abs=0.05) and found.rotation_ratio == pytest.approx(1.0, abs=0.02)
    nominal, observed = coverage_curve(covered(1.0))
    assert len(nominal) == 4000
    np.testing.assert_allclose(observed, nominal, atol=0.03)


def test_coverage_tells_a_variance_that_is_too_small() -> None:
    found = coverage(covered(2.0))
    assert found.median_ratio == pytest.approx(2.0, rel=0.05)
    assert found.rotation_ratio == pytest.approx(np.sqrt(2.0), rel=0.03)
    assert found.inside[1] < 0.7
    assert coverage(Results({}, [made_row(solved=False)])).count == 0


# Bounds


def moved(problem: StudyProblem, increment: Array) -> StudyProblem:
    """The problem with its scene at a pose moved by a left increment."""
    scene = problem.scene
    rotation, translation = retract_pose(scene.rotation, scene.translation, increment)
    return replace(problem, scene=replace(scene, rotation=rotation, translation=translation))


@pytest.mark.parametrize("study_setup", ["perspective", "omnidirectional"])
def test_derivatives_of_undisturbed_pieces_are_those_of_the_left_increment(study_setup: str) -> None:
    setup = STUDIES["trust"].setups[study_setup]
    problem = draw_problem(setup, Condition(camera=study_setup, masks="coverage"), 2)
    increment = 1e-5 * np.array([1.0, -2.0, 1.5, 0.5, 1.0, -1.0])
    distances, jacobian = undisturbed_pieces(problem)
    after, _ = undisturbed_pieces(moved(problem, increment))
    assert len(after) == len(distances)
    np.testing.assert_allclose(np.median(np.abs(after - distances - jacobian @ increment)), 0.0, atol=1e-4)
    assert np.median(np.abs(after - distances)) > 1e-3


def test_the_anchor_moves_as_its_derivative_says() -> None:
    problem = draw_problem(PERSPECTIVE, Condition(), 0)
    increment = 1e-6 * np.array([1.0, 2.0, -1.0, 0.5, -0.5, 1.0])
    scene, other = problem.scene, moved(problem, increment).scene
    error = translation_error(other.rotation, other.translation, scene.rotation, scene.translation, scene.anchor)
    assert np.linalg.norm(anchor_shift(problem) @ increment) == pytest.approx(error, rel=1e-4)


def test_what_disturbs_a_boundary_widens_its_bound() -> None:
    setup = perspective_setup()
    exact, hidden = (
        draw_problem(setup, Condition(planes=2, noise=share, disturbance="occlusion"), 1) for share in (0.0, 0.4)
    )
    all_pieces, left = len(undisturbed_pieces(exact)[0]), len(undisturbed_pieces(hidden)[0])
    assert 0.4 * all_pieces < left < 0.85 * all_pieces
    assert pose_bound(hidden).rotation_deg > 1.1 * pose_bound(exact).rotation_deg
    assert pose_bound(hidden).translation_m > 1.1 * pose_bound(exact).translation_m
    squares = [draw_problem(setup, Condition(planes=2, noise=0.2, side=side), 1) for side in ("2d", "3d")]
    assert all(0.3 * all_pieces < len(undisturbed_pieces(problem)[0]) < 0.8 * all_pieces for problem in squares)


def test_a_wrong_region_and_a_lost_boundary_bound_nothing() -> None:
    setup = perspective_setup()
    right = draw_problem(setup, Condition(planes=2), 1)
    wrong = draw_problem(setup, Condition(planes=2, wrong="place", side="2d"), 1)
    (first,) = wrong.wrong
    other = 1 - first
    one = replace(
        right, kept=[other], image_regions=[right.image_regions[other]], world_regions=[right.world_regions[other]]
    )
    np.testing.assert_array_equal(undisturbed_pieces(wrong)[0], undisturbed_pieces(one)[0])
    none = replace(wrong, kept=[first], image_regions=[wrong.image_regions[first]], wrong=(0,))
    assert pose_bound(none).rotation_deg == pose_bound(none).translation_m == float("inf")


def test_errors_are_divided_by_their_bounds() -> None:
    rows = [
        made_row(nearest_solved=True, nearest_rotation_deg=0.2, bound_rotation_deg=0.1),
        made_row(nearest_solved=True, nearest_rotation_deg=0.2, bound_rotation_deg=float("inf")),
        made_row(nearest_solved=False, nearest_rotation_deg=9.0, bound_rotation_deg=0.1),
        made_row(nearest_solved=True, nearest_rotation_deg=0.2, bound_rotation_deg=None),
    ]
    assert bound_ratios(Results({}, rows), "rotation_deg").tolist() == [2.0]
    shown = [{**row, **dict.fromkeys(("nearest_translation_m", "bound_translation_m"), 1.0)} for row in rows[:1]]
    assert "| 1 | 2.00 | 2.00 | 1.00 | 1.00 |" in results_table(Results({}, shown))
    failed = made_row(error="PoseError: none", nearest_solved=False)
    assert "over bound" not in results_table(Results({}, [rows[3], failed])), "no bound was asked for"


def test_the_errors_of_exact_masks_are_about_their_bound() -> None:
    study = Study("bounds", "", [{"planes": (3,)}], setups={"perspective": perspective_setup()}, bounds=True)
    ratios = bound_ratios(run_study(study, 6), "rotation_deg")
    assert len(ratios) == 6 and 0.3 < np.median(ratios) < 2.0
