"""Studies of the synthetic benchmark: problems, rows, runs on several processes, resuming, files and pictures."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from matplotlib.container import ErrorbarContainer
from matplotlib.patches import Rectangle
from numpy.typing import NDArray
from regionpose.cameras import Camera, PinholeCamera, UnifiedCamera
from regionpose.geometry.pose import Pose
from scipy.spatial.transform import Rotation
from small_study import HEIGHT, PERSPECTIVE, QUICK, SMALL, WIDTH, comparable

from benchmarks.synthetic import setups
from benchmarks.synthetic.measures import summarize
from benchmarks.synthetic.scenes import Layout, draw_scene, problem_generator
from benchmarks.synthetic.studies import (
    STUDIES,
    Chart,
    Condition,
    Results,
    Study,
    draw_problem,
    read_rows,
    results_table,
    run_study,
    study_named,
    write_rows,
)
from benchmarks.synthetic.studies.conditions import Grid, changed_grid, grid_conditions, solver_options, solver_text
from benchmarks.synthetic.studies.plots import drawn_charts
from benchmarks.synthetic.studies.problems import image_patches, image_region
from benchmarks.synthetic.studies.rows import COLUMN_TYPES, judged, mahalanobis_squared
from benchmarks.synthetic.studies.study import estimate_options


@pytest.fixture(scope="module")
def quick_rows() -> Results:
    """12 problems of each condition, by this process."""
    return run_study(QUICK, 12)


# Conditions


def test_a_grid_lists_every_combination_once() -> None:
    grid = {"planes": (1, 2), "noise": (0.0, 0.1)}
    conditions = grid_conditions([grid, {"planes": (2, 3)}])
    assert [(c.planes, c.noise) for c in conditions] == [(1, 0.0), (1, 0.1), (2, 0.0), (2, 0.1), (3, 0.0)]


def test_values_and_solver_options_change_a_grid() -> None:
    grid = changed_grid({"planes": (1, 2), "solver": ("", "integration=mesh")}, {"planes": (3,)}, ["driver=native"])
    assert grid == {"planes": (3,), "solver": ["driver=native", "driver=native integration=mesh"]}


def test_solver_options_are_read_as_they_are_written() -> None:
    options = {"system": "sphere", "prior": {"up": [0.0, -1.0, 0.0]}, "refine": None}
    assert solver_options(solver_text(options)) == options
    assert solver_options("") == {}


def test_what_solver_options_say_of_the_prior_is_added_to_what_is_known() -> None:
    known = rp.Prior(camera_near=[1.0, 2.0, 3.0])
    problem = replace(draw_problem(PERSPECTIVE, Condition(masks="polygon"), 0), prior=known)
    told = estimate_options(problem, 'prior={"up":[0,-1,0]} start=paper', exact_exposure=True)
    assert told == (
        rp.Prior(up=[0.0, -1.0, 0.0], camera_near=[1.0, 2.0, 3.0]),
        rp.Solver(start="paper", frame_sigma_deg=0.0, frame_sigma_m=0.0, focal_sigma_percent=0.0, center_sigma_px=0.0),
    )
    assert estimate_options(problem, "", exact_exposure=False) == (known, rp.Solver())


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Condition(masks="blurred"), ["masks", "blurred", "binary, coverage"]),  # type: ignore[arg-type]
        (lambda: Condition(grazing_deg=5.0, turn_deg=5.0), ["grazing_deg", "turn_deg"]),
        (lambda: Condition(disturbance="truncation", side="3d"), ["2d"]),
        (lambda: Condition(masks="polygon", noise=0.1), ["mask", "binary"]),
        (lambda: Condition(masks="drawn", cut="box"), ["drawn", "binary"]),
        (lambda: Condition(solver="mesh"), ["mesh", "name=value"]),
        (lambda: grid_conditions([{"plains": (1,)}]), ["plains", "planes"]),
        (lambda: grid_conditions([{"planes": ()}]), ["planes", "at least one"]),
        (lambda: study_named("peers"), ["peers", "perspective"]),
        (lambda: Study("x", "", [{"camera": ("mine",)}]), ["mine", "perspective"]),
        (lambda: run_study(QUICK, 0), ["scenes", "0", "1"]),
        (lambda: setups.PoseRange((0.0, 1.0), (4.0, 2.0)), ["depth", "(4.0, 2.0)"]),
    ],
)
def test_bad_values_are_named(make: Callable[[], object], words: list[str]) -> None:
    with pytest.raises(ValueError) as error:
        make()
    assert all(word in str(error.value) for word in words)


# Problems


def test_corners_that_a_hand_marked_are_off_by_two_pixels() -> None:
    def pixels(seed: int, masks: Any) -> NDArray[np.float64]:
        condition = Condition(planes=3, templates="polygons", masks=masks)
        regions = draw_problem(PERSPECTIVE, condition, seed).image_regions
        return np.concatenate([ring for region in regions for ring in region.rings])

    off = np.concatenate([pixels(seed, "drawn") - pixels(seed, "polygon") for seed in range(8)])
    assert 1.7 < float(np.sqrt(np.mean(off**2))) < 2.3


@pytest.mark.parametrize("masks", ["binary", "coverage"])
@pytest.mark.parametrize(
    "condition", [Condition(noise=0.1), Condition(noise=0.2, disturbance="occlusion"), Condition(planes=2)]
)
def test_a_mask_in_its_window_bounds_the_region_of_the_whole_mask(condition: Condition, masks: Any) -> None:
    scene = draw_scene(PERSPECTIVE.camera, PERSPECTIVE.poses, Layout(condition.planes), problem_generator(4))
    rng = np.random.default_rng(0)
    for patch in image_patches(scene, replace(condition, masks=masks), rng)[1]:
        whole = rp.ImageRegion.from_mask(patch.whole(WIDTH, HEIGHT))
        windowed = image_region(patch, scene.camera)
        assert len(windowed.rings) == len(whole.rings)
        for ring, other in zip(windowed.rings, whole.rings, strict=True):
            np.testing.assert_allclose(ring, other, atol=1e-9)
        assert windowed.mask is not None and whole.mask is not None
        np.testing.assert_array_equal(windowed.mask.full(), whole.mask.full())


@pytest.mark.parametrize(
    ("condition", "image", "world"),
    [
        (Condition(), 0.0, 0.0),
        (Condition(noise=0.1, masks="binary"), 0.1, 0.0),
        (Condition(noise=0.1, masks="coverage"), 0.1, 0.0),
        (Condition(noise=0.1, side="3d"), 0.0, 0.1),
        (Condition(noise=0.2, disturbance="occlusion"), 0.2, 0.0),
        (Condition(noise=0.2, disturbance="occlusion", side="3d"), 0.0, 0.2),
        (Condition(noise=0.2, disturbance="truncation"), 0.2, 0.0),
    ],
)
def test_the_disturbance_is_measured_as_it_was_asked_for(condition: Condition, image: float, world: float) -> None:
    for seed in range(3):
        problem = draw_problem(PERSPECTIVE, condition, seed)
        # Pixels are whole: a column of the mask is some per cent of a region of about 60 px.
        assert problem.image_change == pytest.approx(image, abs=0.03 if image else 0.0)
        assert problem.world_change == pytest.approx(world, abs=1e-5)


@pytest.mark.parametrize(("noise", "seed"), [(0.2, 167), (0.12, 406)])
def test_a_last_square_that_touches_the_others_along_a_line_still_fits(noise: float, seed: int) -> None:
    condition = Condition(camera="omnidirectional", side="3d", planes=3, noise=noise)
    problem = draw_problem(STUDIES["omnidirectional"].setups["omnidirectional"], condition, seed)
    assert problem.world_change == pytest.approx(noise, abs=1e-5)


def test_scenes_of_a_seed_are_the_same_whatever_disturbs_them() -> None:
    plain, noisy = (draw_problem(PERSPECTIVE, Condition(noise=share), 5).scene for share in (0.0, 0.2))
    np.testing.assert_array_equal(plain.rotation, noisy.rotation)
    assert plain.names == noisy.names
    assert draw_problem(PERSPECTIVE, Condition(), 6).scene.names != plain.names


def test_a_border_that_cuts_most_of_a_region_leaves_it_out() -> None:
    condition = Condition(planes=3, noise=0.4, disturbance="truncation")
    problems = [draw_problem(PERSPECTIVE, condition, seed) for seed in range(8)]
    assert all(0 in problem.kept for problem in problems), "the first region keeps 60 %"
    assert any(len(problem.kept) < 3 for problem in problems)
    assert all(len(p.image_regions) == len(p.world_regions) == len(p.kept) for p in problems)


def test_a_lidar_and_a_wrong_calibration_reach_the_estimate() -> None:
    condition = Condition(lidar_beams=128, range_noise_m=0.005, focal_error=0.01, center_error_px=2.0)
    problem = draw_problem(PERSPECTIVE, condition, 1)
    assert 0.0 < problem.world_change < 0.5
    axis = problem.camera.project(np.array([[0.0, 0.0, 1.0]]))
    assert 0.1 < np.linalg.norm(axis - (179.5, 119.5)) < 10.0


def test_a_region_that_a_lidar_hits_by_one_line_is_left_out() -> None:
    sparse = Condition(planes=2, lidar_beams=8)
    problem = draw_problem(PERSPECTIVE, sparse, 11)
    assert problem.kept == [0] and len(problem.image_regions) == len(problem.world_regions) == 1
    alone = run_study(replace(QUICK, grids=[{"planes": (1,), "lidar_beams": (8,)}]), 1, seed=2)
    assert "lie on one scan line" in str(alone.rows[0]["error"])


@pytest.mark.parametrize("name", ["perspective", "omnidirectional"])
def test_polygons_hold_no_error_of_pixels(name: str) -> None:
    study = replace(QUICK, grids=[{"camera": (name,), "masks": ("polygon",), "planes": (1, 2)}])
    rows = run_study(study, 4)
    assert (rows.column("nearest_rotation_deg") < 1e-6).all()
    assert (rows.column("nearest_translation_m") < 1e-8).all()


@pytest.mark.parametrize(
    "camera",
    [
        PinholeCamera(288.0, 280.0, 170.0, 125.0, width=WIDTH, height=HEIGHT, distortion=(-0.2, 0.05, 0.001, -0.001)),
        UnifiedCamera(300.0, 300.0, 179.5, 119.5, xi=1.1, width=WIDTH, height=HEIGHT),
    ],
)
def test_any_camera_draws_and_solves_problems(camera: Camera) -> None:
    study = QUICK.with_setup("mine", setups.Setup(camera, setups.PoseRange((0.0, 0.5), (2.0, 3.0))))
    rows = run_study(study.with_values({"noise": (0.0,)}), 3)
    assert rows.column("nearest_solved").all()


@pytest.mark.parametrize("grazing", [1.0, 20.0])
def test_grazing_poses_see_the_first_plane_at_that_angle(grazing: float) -> None:
    for seed in range(4):
        scene = draw_problem(setups.perspective_setup(), Condition(grazing_deg=grazing, world="first"), seed).scene
        assert scene.view_angles()[0] == pytest.approx(90.0 - grazing, abs=1e-6)
        assert np.linalg.det(scene.rotation) == pytest.approx(1.0)


def test_turned_poses_turn_the_first_plane_in_itself() -> None:
    straight, turned = (
        draw_problem(PERSPECTIVE, Condition(turn_deg=turn, world="first"), 2).scene.rotation for turn in (0.0, 90.0)
    )
    np.testing.assert_allclose(straight[:, 0], -turned[:, 1], atol=1e-12)
    np.testing.assert_allclose(straight[:, 2], turned[:, 2], atol=1e-12)


# Rows


def test_the_true_pose_has_no_error_and_the_nearest_answer_is_judged_apart() -> None:
    problem = draw_problem(PERSPECTIVE, Condition(planes=2), 0)
    true = Pose(Rotation.from_matrix(problem.scene.rotation), problem.scene.translation)
    row = judged(problem, true)
    assert row["solved"] is True
    assert [row[k] for k in ("rotation_deg", "translation_m", "overlap_error")] == pytest.approx([0.0] * 3, abs=2e-3)
    moved = judged(problem, Pose(true.rotation, true.translation + np.array([0.0, 0.0, 0.3])))
    assert moved["translation_m"] == pytest.approx(0.3) and moved["solved"] is False


def test_the_squared_mahalanobis_distance_is_that_of_the_left_increment() -> None:
    problem = draw_problem(PERSPECTIVE, Condition(), 0)
    omega, tau = np.array([0.01, -0.02, 0.03]), np.array([0.1, 0.2, -0.1])
    step = Rotation.from_rotvec(omega)
    found = step.inv() * Rotation.from_matrix(problem.scene.rotation)
    shift = step.inv().apply(problem.scene.translation - tau)
    variances = np.array([1.0, 4.0, 9.0, 1.0, 4.0, 9.0]) * 1e-4
    expected = float(np.sum(np.concatenate([omega, tau]) ** 2 / variances))
    assert mahalanobis_squared(problem, Pose(found, shift), np.diag(variances)) == pytest.approx(expected)
    assert math.isnan(mahalanobis_squared(problem, Pose(found, shift), np.zeros((6, 6))))


def test_a_symmetric_shape_is_solved_by_an_alternative() -> None:
    study = replace(STUDIES["degeneracy"], grids=[{"templates": ("symmetric",)}])
    rows = run_study(study, 6)
    assert rows.column("nearest_solved").all()
    assert rows.column("ambiguous").any()
    assert (rows.column("nearest_rank") < rows.column("answers")).all()


def test_a_problem_that_cannot_be_placed_is_a_row_with_its_error() -> None:
    narrow = replace(PERSPECTIVE, camera=PinholeCamera(2000.0, 2000.0, 179.5, 119.5, width=WIDTH, height=HEIGHT))
    one = replace(QUICK, grids=[{"planes": (2,)}])
    rows = run_study(one.with_setup("narrow", narrow), 1)
    assert all(str(text).startswith("ScenePlacementError: plane 1 of 2") for text in rows.column("error"))
    assert not rows.column("solved").any() and np.isnan(rows.column("rotation_deg")).all()
    assert "1 of 1 problems" in results_table(rows)


# Studies


@pytest.mark.slow
@pytest.mark.parametrize("name", STUDIES)
def test_every_study_runs_and_is_drawn(name: str) -> None:
    study = replace(STUDIES[name], setups=SMALL)
    ends = [study.conditions[0], study.conditions[-1]]
    short = replace(study, grids=[{key: [getattr(c, key)] for key in COLUMN_TYPES if hasattr(c, key)} for c in ends])
    results = run_study(short, 2)
    assert [row["seed"] for row in results.rows] == [0, 1, 0, 1]
    assert all(list(row) == list(COLUMN_TYPES) for row in results.rows)
    assert sum(not row["error"] for row in results.rows) >= 2
    # Half a pixel at corners, a rare beam or a free direction are much on so small an image.
    assert name in {"lidar", "degeneracy", "mistakes"} or results.rows[0]["nearest_solved"]
    table = results_table(results, name)
    before, _, rest = table.partition("## Confidence")
    lines = (before + rest.partition("## Coverage")[2]).count("\n| ")
    tables = 5 if name == "mistakes" else 4
    assert lines == 4 * tables + 1, "tables of a head, a rule and two conditions, and the verdict of all"
    assert len(drawn_charts(results, study.charts)) >= 1


# Files and pictures


@pytest.mark.parametrize("name", ["rows.csv", "rows.parquet"])
def test_rows_are_read_as_they_were_written(quick_rows: Results, name: str, tmp_path: Path) -> None:
    if name.endswith("parquet"):
        pytest.importorskip("pyarrow", reason="the extra `studies` is not installed")
    write_rows(tmp_path / name, quick_rows)
    assert comparable(read_rows(tmp_path / name).rows) == comparable(quick_rows.rows)


def test_another_table_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y\n1,2\n", encoding="utf-8")
    with pytest.raises(ValueError, match="no column camera"):
        read_rows(tmp_path / "a.csv")


def test_the_table_holds_the_quantiles_of_the_rows(quick_rows: Results) -> None:
    noisy = quick_rows.where(noise=0.05)
    summary = summarize(noisy.column("nearest_rotation_deg"))
    line = next(line for line in results_table(quick_rows).split("## Nearest")[1].split("\n") if "| 5 % | 12 |" in line)
    numbers = (summary.median, summary.lower_quartile, summary.upper_quartile, summary.percentile_95)
    expected = [f"{number:#.3g}".rstrip(".") for number in numbers]
    assert "{} ({} to {}; {})".format(*expected) in line
    assert f"{100.0 * noisy.column('nearest_solved').mean():.1f} %" in line


def test_curves_show_the_sorted_errors(quick_rows: Results) -> None:
    figures = drawn_charts(quick_rows, [Chart("sorted", lines="noise")])
    assert list(figures) == ["sorted"]
    rotation, translation, _ = figures["sorted"].axes
    exact = quick_rows.where(noise=0.0)
    drawn = np.asarray(rotation.get_lines()[0].get_ydata(), dtype=np.float64)
    np.testing.assert_allclose(drawn, np.sort(exact.column("nearest_rotation_deg")))
    drawn = np.asarray(translation.get_lines()[0].get_ydata(), dtype=np.float64)
    np.testing.assert_allclose(drawn, 1000.0 * np.sort(exact.column("nearest_translation_m")))


@pytest.mark.parametrize(("across", "bars"), [("noise", 2), ("seed", 0)])
def test_solved_shares_are_bars_or_a_line(quick_rows: Results, across: str, bars: int) -> None:
    shown = quick_rows if bars else quick_rows.where(noise=0.05)
    panel = drawn_charts(shown, [Chart("solved", lines="planes", across=across)])[f"solved-by-{across}"].axes[0]
    heights = [patch.get_height() for patch in panel.patches if isinstance(patch, Rectangle)]
    assert len(heights) == bars
    drawn = heights if bars else panel.get_lines()[0].get_ydata()
    groups = [shown.where(**{across: value}) for value in shown.values(across)]
    shares = [100.0 * group.column("nearest_solved").mean() for group in groups]
    assert len(set(shares)) > 1
    np.testing.assert_allclose(np.asarray(drawn, dtype=np.float64), shares)


def test_other_columns_that_vary_make_a_picture_each(quick_rows: Results) -> None:
    figures = drawn_charts(quick_rows, [Chart("sorted", lines="planes"), Chart("solved", "planes", across="turn_deg")])
    assert list(figures) == ["sorted-noise-0pc", "sorted-noise-5pc"], "no turned plane, no picture of turns"


def test_columns_that_the_lines_decide_make_no_further_picture() -> None:
    grids: list[Grid] = [{"planes": (1, 2)}, {"planes": (1,), "regions_per_plane": (3,)}]
    rows = run_study(replace(QUICK, grids=grids), 2)
    figures = drawn_charts(rows, [Chart("sorted", lines="regions_given")])
    assert list(figures) == ["sorted"]
    assert len(figures["sorted"].axes[0].get_lines()) == 3


def test_costs_are_medians_joined_by_the_size_of_the_mesh() -> None:
    sizes = ["integration=mesh mesh_size=0.5", "integration=mesh mesh_size=0.2"]
    rows = run_study(replace(QUICK, grids=[{"solver": ("", *sizes)}]), 3)
    panel = drawn_charts(rows, [Chart("cost", lines="solver")])["cost"].axes[0]
    lines = [container.lines[0] for container in panel.containers if isinstance(container, ErrorbarContainer)]
    drawn = np.concatenate([line.get_xydata() for line in lines])
    groups = [rows.where(solver=value) for value in ("", *sizes)]
    medians = [
        (1000.0 * np.median(g.column("estimate_s")), np.median(g.column("nearest_rotation_deg"))) for g in groups
    ]
    np.testing.assert_allclose(drawn, medians)
    assert len(lines) == 2, "the two sizes are joined"
    assert [text.get_text() for text in panel.texts if text.get_text()] == ["0.5", "0.2"]
