"""The published algorithm that comparisons are made with computes what the paper describes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks import published
from benchmarks.published import __main__ as command
from benchmarks.published.compare import Outcome
from benchmarks.published.moments import (
    PLANE_EXPONENTS,
    SPHERE_EXPONENTS,
    spherical_areas,
    spherical_triangle_moments,
    subdivided,
    triangle_moments,
)
from benchmarks.published.report import Condition, details, table_row
from benchmarks.published.start import centroid_direction, facing_placement, start_placement
from benchmarks.published.system import SeenPlane, observed_moments, world_side
from benchmarks.synthetic import SyntheticScene, omnidirectional_scene, perspective_scene
from benchmarks.synthetic.measures import rotation_error, translation_error

Array = NDArray[np.float64]

MAKERS: dict[published.System, Callable[..., SyntheticScene]] = {
    "plane": perspective_scene,
    "sphere": omnidirectional_scene,
}

PAPER_ROTATION_DEG = 1.0
"""Rotation error below which the paper counts a problem as solved (section 3)."""

PAPER_TRANSLATION_M = 0.008
"""Upper end of the paper's median translation errors on perfect masks, 3 mm to 8 mm."""

OCTANT_PARTS = 100
"""Parts of an octant's edge: triangles of 16 mrad."""

OCTANT_ERROR = 3e-5
"""Error of the centroid rule on them, a tenth of their size squared."""

DIVISION_SHARE: dict[published.Integration, float] = {"pixels": 4e-3, "mesh": 1e-4, "quadrature": 4e-5}
"""Difference between two divisions of a region as a share of it: by cells at its boundary, or triangles of 40 mrad."""


def duffy_moments(triangle: Array) -> Array:
    """(13,) integrals over one (3, 2) triangle by a Gauss product rule on the square that collapses onto it."""
    nodes, weights = np.polynomial.legendre.leggauss(6)
    s, t = np.meshgrid(0.5 * (nodes + 1.0), 0.5 * (nodes + 1.0))
    share = 0.25 * np.outer(weights, weights) * s
    a, b, c = triangle
    x, y = (a[k] + s * (1.0 - t) * (b[k] - a[k]) + s * t * (c[k] - a[k]) for k in range(2))
    doubled = np.linalg.det(np.array([b - a, c - a]))
    return np.array([np.sum(share * x**i * y**j) * doubled for i, j in PLANE_EXPONENTS])


def test_thirteen_equations_on_the_plane_and_seventeen_on_the_sphere() -> None:
    assert (len(PLANE_EXPONENTS), len(SPHERE_EXPONENTS)) == (13, 17)


def test_moments_of_triangles_are_those_of_a_gauss_rule() -> None:
    triangles = np.random.default_rng(0).uniform(-1.0, 1.0, (20, 3, 2))
    expected = np.sum([duffy_moments(triangle) for triangle in triangles], axis=0)
    np.testing.assert_allclose(triangle_moments(triangles), expected, rtol=0.0, atol=1e-13)


def test_a_flipped_triangle_counts_negative() -> None:
    triangles = np.random.default_rng(1).uniform(-1.0, 1.0, (1, 3, 2))
    np.testing.assert_allclose(triangle_moments(triangles[:, ::-1]), -triangle_moments(triangles), rtol=1e-12)


def test_an_octant_of_the_sphere_has_an_eighth_of_its_moments() -> None:
    # Over an octant the integral of x is pi / 4, of x^2 pi / 6, of x y 1 / 3, of x y z 1 / 8.
    octant = subdivided(np.eye(3)[None], OCTANT_PARTS)
    moments = dict(zip(SPHERE_EXPONENTS, spherical_triangle_moments(octant), strict=True))
    expected = {(0, 0, 0): np.pi / 2, (1, 0, 0): np.pi / 4, (0, 2, 0): np.pi / 6, (1, 0, 1): 1 / 3, (1, 1, 1): 1 / 8}
    assert {e: moments[e] for e in expected} == pytest.approx(expected, abs=OCTANT_ERROR)


def test_subdivision_keeps_the_area_of_a_spherical_triangle() -> None:
    corners = np.random.default_rng(2).normal(size=(5, 3, 3))
    triangles = corners / np.linalg.norm(corners, axis=2, keepdims=True)
    parts = spherical_areas(subdivided(triangles, 3)).reshape(5, 9).sum(axis=1)
    np.testing.assert_allclose(parts, spherical_areas(triangles), rtol=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_residual_on_the_plane_vanishes_at_the_true_pose_on_exact_outlines(seed: int) -> None:
    scene = perspective_scene(seed, 1)
    observed = observed_moments(scene.camera, rp.ImageRegion.from_polygon(scene.image_rings[0]), "plane", "mesh")
    side = world_side(scene.regions[0], "plane", "mesh")
    predicted = side.moments(scene.rotation, scene.translation, "plane")
    np.testing.assert_allclose(predicted, observed, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize(("system", "integration"), published.SCHEMES)
def test_residual_at_the_true_pose_is_the_error_of_the_division(
    system: published.System, integration: published.Integration
) -> None:
    for seed in range(4):
        scene = MAKERS[system](seed, 1)
        image = rp.ImageRegion.from_mask(scene.coverages()[0])
        if integration != "pixels":
            image = rp.ImageRegion.from_polygon(scene.image_rings[0])
        observed = observed_moments(scene.camera, image, system, integration)
        side = world_side(scene.regions[0], system, integration)
        predicted = side.moments(scene.rotation, scene.translation, system)
        np.testing.assert_allclose(predicted, observed, rtol=0.0, atol=DIVISION_SHARE[integration] * observed[0])


@pytest.mark.parametrize("system", ["plane", "sphere"])
@pytest.mark.parametrize("start", ["parallel", "turned"])
def test_the_start_shows_area_and_direction_as_observed(system: published.System, start: published.Start) -> None:
    scene = MAKERS[system](5, 1)
    observed = observed_moments(scene.camera, rp.ImageRegion.from_polygon(scene.image_rings[0]), system, "mesh")
    side = world_side(scene.regions[0], system, "mesh")
    facing = facing_placement(SeenPlane.of_rings(scene.regions[0]), scene.anchor)
    placement = start_placement(observed, side, facing, system, start).after(facing)
    predicted = side.moments(*placement, system)
    assert predicted[0] == pytest.approx(observed[0], rel=1e-5)
    center = placement.rotation @ scene.anchor + placement.translation
    sight = centroid_direction(observed, system)
    np.testing.assert_allclose(center / np.linalg.norm(center), sight, atol=1e-12)
    normal = placement.rotation @ SeenPlane.of_rings(scene.regions[0]).normal
    np.testing.assert_allclose(normal, sight if start == "turned" else [0.0, 0.0, 1.0], atol=1e-12)


def test_a_known_up_direction_is_up_in_the_image_at_the_start() -> None:
    scene = perspective_scene(6, 1)
    world_from_scene = Rotation.from_rotvec([0.7, -1.9, 0.4]).as_matrix()
    rings = [ring @ world_from_scene.T for ring in scene.regions[0]]
    up = world_from_scene @ np.array([0.2, -1.0, 0.0])
    facing = facing_placement(SeenPlane.of_rings(rings), np.zeros(3), up)
    across, along, _ = facing.rotation @ up
    assert across == pytest.approx(0.0, abs=1e-12)
    assert along < 0.0


@pytest.mark.parametrize("system", ["plane", "sphere"])
def test_three_planes_are_solved_within_the_paper_s_bounds(system: published.System) -> None:
    scene = MAKERS[system](0, 3)
    images = [rp.ImageRegion.from_mask(mask) for mask in scene.masks()]
    pose, info = published.estimate(scene.camera, images, scene.regions, system=system, integration="mesh")
    rotation = pose.rotation.as_matrix()
    shift = translation_error(rotation, pose.translation, scene.rotation, scene.translation, scene.anchor)
    assert rotation_error(rotation, scene.rotation) < PAPER_ROTATION_DEG
    assert shift < PAPER_TRANSLATION_M
    # The start is far off, so that the solver has done it.
    assert rotation_error(info.start.rotation.as_matrix(), scene.rotation) > 10.0 * PAPER_ROTATION_DEG


def test_a_scheme_that_the_paper_does_not_have_is_refused() -> None:
    scene = perspective_scene(0, 1)
    with pytest.raises(ValueError, match="needed one of"):
        published.estimate(scene.camera, [], [], system="plane", integration="quadrature")


METHODS = ("published pixels", "published mesh", "regionpose", "regionpose any")


def two_rows() -> list[dict[str, Outcome]]:
    """Two problems: the first is solved by all, the second by our nearest answer alone."""
    solved = {name: Outcome(0.1, 0.002, 0.01, 0.2 * (k + 1), 10) for k, name in enumerate(METHODS)}
    lost = {name: Outcome(5.0, 1.0, float("inf"), 0.2 * (k + 1), 10) for k, name in enumerate(METHODS[:-1])}
    return [solved, {**lost, METHODS[-1]: solved[METHODS[-1]]}]


def test_the_table_of_a_comparison_holds_solved_shares_and_the_ratio_of_medians() -> None:
    row = table_row(Condition("plane", 1, 0.05), two_rows())
    assert row == "| plane, 1 | 5 % | 50 / 50 % | 501.00 | 200 / 400 | 50 / 100 % | 2.00 | 600 | 1.50 |"
    lines = details(Condition("plane", 1, 0.05), two_rows()).split("\n")
    assert [line.split()[-1] for line in lines] == ["3.000", "1.500", "1.000", "0.750"]


def test_a_comparison_goes_on_from_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    solved = []

    def drawn(system: str, seed: int, *_: object) -> int:
        solved.append((system, seed))
        return seed

    monkeypatch.setattr(command, "drawn_problem", drawn)
    monkeypatch.setattr(command, "outcomes", lambda seed, *_: two_rows()[seed % 2])
    given = ["--planes", "1", "--systems", "plane", "--keep", str(tmp_path / "kept.jsonl")]
    for scenes in ("1", "2"):
        monkeypatch.setattr(sys, "argv", ["published", "--scenes", scenes, *given])
        command.main()
    assert solved == [("plane", 0), ("plane", 1)]
    assert capsys.readouterr().out.endswith(f"{table_row(Condition('plane', 1, 0.0), two_rows())}\n")
