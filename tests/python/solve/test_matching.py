"""Pairs are found whatever the order, what has no partner is left over, and what can't be told apart is said."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import regionpose as rp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import (
    SyntheticScene,
    fisheye_scene,
    omnidirectional_scene,
    perspective_scene,
    squares_on_mask,
    template_named,
)

Array = NDArray[np.float64]

DATA = Path(__file__).parents[4] / "shared" / "data"

REGIONS = 8

POSE = 1e-6
"""Rotation (rad) and translation (m) from exact contours."""

CAMERA = rp.PinholeCamera(1000.0, 1000.0, 639.5, 479.5, width=1280, height=960)
TRUE = rp.Pose(Rotation.from_euler("xyz", [10.0, -20.0, 3.0], degrees=True), np.array([0.2, 0.1, 9.0]))
"""A view of a facade in the world's plane z = 0, x right and y down."""

UP = np.array([0.0, -1.0, 0.0])


@cache
def scene_of(seed: int, draw: Callable[..., SyntheticScene] = perspective_scene) -> SyntheticScene:
    """Eight different shapes on four planes."""
    return draw(seed, 4, regions_per_plane=2, world="arbitrary", front=False)


@cache
def sides_of(
    seed: int, draw: Callable[..., SyntheticScene] = perspective_scene
) -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """Exact contours of a scene, and its world regions."""
    scene = scene_of(seed, draw)
    images = [rp.ImageRegion.from_polygon(rings) for rings in scene.image_rings]
    return images, [rp.WorldRegion.from_polygon(rings) for rings in scene.regions]


def window(x: float, y: float, width: float = 0.8, height: float = 1.2) -> Array:
    """A rectangle of the facade with its upper left corner at (x, y), meters."""
    return np.array([[x, y, 0.0], [x + width, y, 0.0], [x + width, y + height, 0.0], [x, y + height, 0.0]])


def seen(ring: Array) -> rp.ImageRegion:
    """What the camera sees of a ring."""
    return rp.ImageRegion.from_polygon(CAMERA.project(TRUE.transform(ring)))


def matched(seen_rings: Sequence[Array], rings: Sequence[Array], up: Array | None = None) -> rp.solve.RegionMatches:
    """The matches of rings seen and rings known on the facade."""
    images, worlds = [seen(ring) for ring in seen_rings], [rp.WorldRegion.from_polygon(ring) for ring in rings]
    return rp.match_regions(CAMERA, images, worlds, prior=rp.Prior(up=up))


def assert_pose(found: rp.Pose, true: rp.Pose) -> None:
    """The same pose."""
    assert (found.rotation * true.rotation.inv()).magnitude() < POSE
    assert np.linalg.norm(found.translation - true.translation) < POSE


def codes(warnings: Sequence[rp.PoseWarning]) -> list[str]:
    """Their codes."""
    return [warning.code for warning in warnings]


@pytest.mark.slow
@pytest.mark.parametrize("draw", [perspective_scene, omnidirectional_scene, fisheye_scene])
@pytest.mark.parametrize("seed", range(3))
def test_regions_in_the_same_order_are_paired_in_order(seed: int, draw: Callable[..., SyntheticScene]) -> None:
    scene = scene_of(seed, draw)
    found = rp.match_regions(scene.camera, *sides_of(seed, draw))
    assert found.pairs == tuple((k, k) for k in range(REGIONS))
    assert found.unmatched_image == found.unmatched_world == ()
    assert found.alternatives == ()
    assert found.warnings == ()


def test_the_pose_is_the_true_one_and_that_of_the_pairs() -> None:
    scene, (images, worlds) = scene_of(0), sides_of(0)
    found = rp.match_regions(scene.camera, images, worlds[::-1])
    assert_pose(found.estimate.pose, rp.Pose.from_parts(scene.rotation, scene.translation))
    paired = rp.estimate_pose(scene.camera, images, worlds)
    assert np.allclose(found.estimate.pose.matrix, paired.pose.matrix, atol=POSE)
    assert np.allclose(
        found.estimate.diagnostics.region_overlap_errors, paired.diagnostics.region_overlap_errors, atol=POSE
    )


ORDERS = st.permutations(range(REGIONS))


@settings(max_examples=10, deadline=None)
@given(ORDERS, ORDERS, st.integers(2, REGIONS), st.integers(2, REGIONS))
def test_any_choice_in_any_order_gives_the_pairs_that_both_sides_hold(
    image_order: list[int], world_order: list[int], image_count: int, world_count: int
) -> None:
    """Regions keep their partner wherever they stand, and have none where it is not there."""
    scene, (images, worlds) = scene_of(1), sides_of(1)
    shown, known = image_order[:image_count], world_order[:world_count]
    pairs = tuple((i, known.index(k)) for i, k in enumerate(shown) if k in known)
    if len(pairs) < 2:
        return
    found = rp.match_regions(scene.camera, [images[k] for k in shown], [worlds[k] for k in known])
    assert found.pairs == pairs or pairs in found.alternatives
    assert found.pairs == pairs or "ambiguous-matching" in codes(found.warnings)
    assert {i for i, _ in found.pairs} | {*found.unmatched_image} == {*range(image_count)}
    assert {j for _, j in found.pairs} | {*found.unmatched_world} == {*range(world_count)}


def test_distractors_of_either_side_are_left_over() -> None:
    """Three contours of another scene, and three of its regions elsewhere in the world."""
    scene, (images, worlds) = scene_of(2), sides_of(2)
    other_images, other_worlds = sides_of(3)
    found = rp.match_regions(scene.camera, [*other_images[:3], *images], [*worlds, *other_worlds[5:]])
    assert found.pairs == tuple((k + 3, k) for k in range(REGIONS))
    assert found.unmatched_image == (0, 1, 2)
    assert found.unmatched_world == (8, 9, 10)
    assert found.warnings == ()


def test_a_region_that_is_half_hidden_is_left_over() -> None:
    scene, (images, worlds) = scene_of(0), sides_of(0)
    rows = scene.masks()[2]
    rows[: int(np.median(np.flatnonzero(rows.any(axis=1))))] = False
    found = rp.match_regions(scene.camera, [*images[:2], rp.ImageRegion.from_mask(rows), *images[3:]], worlds)
    assert found.unmatched_image == found.unmatched_world == (2,)
    assert found.pairs == tuple((k, k) for k in range(REGIONS) if k != 2)


def test_what_only_the_refined_pose_covers_is_completed_there() -> None:
    """A thin cross of 30 pixels, among contours of which squares along the boundary change 5 % of the area."""
    scene, rng = scene_of(3, omnidirectional_scene), np.random.default_rng(3)
    images = [rp.ImageRegion.from_mask(squares_on_mask(mask, 0.05, rng)) for mask in scene.masks()]
    worlds = sides_of(3, omnidirectional_scene)[1]
    by_moments = rp.match_regions(scene.camera, images, worlds, solver=rp.Solver(refine=None))
    refined = rp.match_regions(scene.camera, images, worlds)
    assert by_moments.unmatched_image == (scene.names.index("thin_cross"),)
    assert refined.pairs == tuple((k, k) for k in range(REGIONS))


def test_two_equal_windows_can_be_either() -> None:
    found = matched([window(-2.0, 0.0), window(1.0, 0.0)], [window(-2.0, 0.0), window(1.0, 0.0)])
    assert {found.pairs, *found.alternatives} == {((0, 0), (1, 1)), ((0, 1), (1, 0))}
    assert codes(found.warnings) == ["ambiguous-matching"]
    assert "1 other assignment(s) explain the image about as well" in str(found.warnings[0])


def test_an_equal_window_out_of_line_tells_them_apart() -> None:
    """The arrangement of three equal windows with no symmetry of its own has one reading."""
    rings = [window(-2.0, 0.0), window(1.0, 0.0), window(1.9, -1.6)]
    found = matched(rings, [rings[k] for k in (2, 0, 1)])
    assert found.pairs == ((0, 1), (1, 2), (2, 0))
    assert found.warnings == ()
    assert_pose(found.estimate.pose, TRUE)


def test_three_windows_of_a_row_of_four_can_be_shifted_and_turned() -> None:
    row = [window(x, 0.0) for x in (-3.4, -1.4, 0.6, 2.6)]
    found = matched(row[:3], row)
    readings = {((0, 0), (1, 1), (2, 2)), ((0, 1), (1, 2), (2, 3)), ((0, 2), (1, 1), (2, 0)), ((0, 3), (1, 2), (2, 1))}
    assert {found.pairs, *found.alternatives} == readings
    assert codes(found.warnings) == ["ambiguous-matching"]


def test_six_equal_boards_before_a_real_fisheye_are_told_apart_by_where_they_are() -> None:
    """Chessboards of 610 x 850 mm in six places of one rig, as a lidar measured them: shape tells nothing."""
    folders = sorted((DATA / "acfr_fisheye").glob("pose*"))
    if not folders:
        pytest.skip("the shared scenes are not here")
    boards = [json.loads((folder / "regions.json").read_text())[0] for folder in folders]
    calibration = json.loads((folders[0] / "calib.json").read_text())
    (fx, _, cx), (_, fy, cy), _ = calibration["K"]
    camera = rp.FisheyeCamera(fx, fy, cx, cy, distortion=calibration["D"])
    images = [rp.ImageRegion.from_polygon(board["image_polygon"]) for board in boards]
    worlds = [rp.WorldRegion.from_polygon(board["rectangle3d"]) for board in boards]
    found = rp.match_regions(camera, images, worlds[::-1])
    assert found.pairs == tuple((k, len(boards) - 1 - k) for k in range(len(boards)))
    assert found.warnings == ()
    turn = found.estimate.pose.rotation * Rotation.from_matrix(calibration["R"]).inv()
    assert np.degrees(turn.magnitude()) < 1.0


def test_the_direction_up_decides_between_the_readings_of_a_column() -> None:
    column = [window(-0.4, y) for y in (-3.0, -0.6, 1.8)]
    open_to_both = matched(column, column)
    assert {open_to_both.pairs, *open_to_both.alternatives} == {((0, 0), (1, 1), (2, 2)), ((0, 2), (1, 1), (2, 0))}
    assert codes(open_to_both.warnings) == ["ambiguous-matching"]
    upright, upside_down = matched(column, column, UP), matched(column, column, -UP)
    assert upright.pairs == ((0, 0), (1, 1), (2, 2))
    assert upside_down.pairs == ((0, 2), (1, 1), (2, 0))
    assert not upright.alternatives and not upright.warnings
    assert UP @ upright.estimate.pose.rotation.as_matrix().T @ UP > 0.9


def test_a_place_that_the_camera_is_near_decides_too() -> None:
    column = [window(-0.4, y) for y in (-3.0, -0.6, 1.8)]
    images, worlds = [seen(ring) for ring in column], [rp.WorldRegion.from_polygon(ring) for ring in column]
    near = rp.Prior(camera_near=TRUE.camera_center + 0.1, camera_near_sigma_m=0.3)
    found = rp.match_regions(CAMERA, images, worlds, prior=near)
    assert found.pairs == ((0, 0), (1, 1), (2, 2)) and not found.alternatives and not found.warnings
    assert_pose(found.estimate.pose, TRUE)


def facade_letter(name: str = "letter_f") -> Array:
    """The outline of a template on the facade."""
    ring: Array = template_named(name).region()[0]
    return ring


def test_one_region_each_is_a_pair_with_the_pose_of_the_pair() -> None:
    found = matched([facade_letter()], [facade_letter()])
    assert found.pairs == ((0, 0),)
    assert found.warnings == ()
    assert_pose(found.estimate.pose, TRUE)


def test_a_single_pair_among_several_regions_is_unconfirmed() -> None:
    found = matched([facade_letter()], [window(3.0, 0.0), facade_letter(), window(-3.0, 1.0)])
    assert found.pairs == ((0, 1),)
    assert found.unmatched_world == (0, 2)
    assert codes(found.warnings) == ["unconfirmed-matching"]
    assert "a single pair of 1 image and 3 world regions" in str(found.warnings[0])


def test_pairs_that_no_one_pose_explains_are_two_readings() -> None:
    """Two shapes seen side by side of which one has been carried off: either may be where it was."""
    aside, away = np.array([2.0, 0.0, 0.0]), np.array([-9.0, 4.0, 3.0])
    found = matched([facade_letter(), facade_letter("key") + aside], [facade_letter(), facade_letter("key") + away])
    assert {found.pairs, *found.alternatives} == {((0, 0),), ((1, 1),)}
    assert codes(found.warnings) == ["ambiguous-matching", "unconfirmed-matching"]


def test_no_pair_at_all_is_an_error_with_the_least_overlap_error() -> None:
    with pytest.raises(
        rp.PoseError, match=r"none of 1 image .* any of 2 world .*error of \d+\.\d %; needed up to 15 %"
    ):
        matched([facade_letter()], [facade_letter("star"), window(0.0, 0.0)])


def test_the_number_of_threads_changes_nothing() -> None:
    scene, sides = scene_of(0), sides_of(0)
    one, two = (rp.match_regions(scene.camera, *sides, threads=threads) for threads in (1, 2))
    assert one.pairs == two.pairs
    assert np.array_equal(one.estimate.pose.matrix, two.estimate.pose.matrix)


def test_iterators_are_taken_and_the_result_is_plain_and_frozen() -> None:
    ring = facade_letter()
    found = rp.match_regions(CAMERA, iter([seen(ring)]), iter([rp.WorldRegion.from_polygon(ring)]))  # type: ignore[arg-type]
    assert isinstance(found, rp.solve.RegionMatches) and isinstance(found.estimate, rp.PoseEstimate)
    assert all(type(index) is int for pair in found.pairs for index in pair)
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.pairs = ()  # type: ignore[misc]


def test_bad_input_is_named() -> None:
    image, world = seen(facade_letter()), rp.WorldRegion.from_polygon(facade_letter())
    with pytest.raises(ValueError, match="there are 0 image and 1 world regions; needed at least one each"):
        rp.match_regions(CAMERA, [], [world])
    with pytest.raises(ValueError, match=r"world_regions\[1\] is a str; needed a WorldRegion"):
        rp.match_regions(CAMERA, [image], [world, "wall"])  # type: ignore[list-item]
    with pytest.raises(ValueError, match="camera is a NoneType"):
        rp.match_regions(None, [image], [world])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="prior is a tuple; needed a Prior or None"):
        rp.match_regions(CAMERA, [image], [world], prior=(0.0, 1.0, 0.0))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="threads is 0; it needs to be at least 1"):
        rp.match_regions(CAMERA, [image], [world], threads=0)


def test_an_image_region_of_half_the_sphere_is_named() -> None:
    camera = rp.FisheyeCamera(300.0, 300.0, 599.5, 599.5, width=1200, height=1200)
    turn = np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    images = [rp.ImageRegion.from_polygon(599.5 + radius * circle) for radius in (50.0, 466.0)]
    with pytest.raises(ValueError, match=r"image region 1: the observed region reaches 87\.1 deg or more"):
        rp.match_regions(camera, images, [rp.WorldRegion.from_polygon(facade_letter())])


def test_what_is_seen_from_behind_has_no_partner() -> None:
    """Both faces of every sign of a scene: those that the camera sees are the pairs."""
    scene = scene_of(3)
    images, worlds = sides_of(3)
    camera_center = -scene.rotation.T @ scene.translation
    front, back = [], []
    for world in worlds:
        middle = world.rings[0].mean(axis=0)
        front.append(world.with_viewpoint(camera_center))
        back.append(world.with_viewpoint(middle + (middle - camera_center)))
    matches = rp.match_regions(scene.camera, images, [*back, *front])
    assert matches.pairs == tuple((index, index + REGIONS) for index in range(REGIONS))
    assert matches.unmatched_world == tuple(range(REGIONS)) and not matches.alternatives
    assert_pose(matches.estimate.pose, rp.Pose.from_parts(scene.rotation, scene.translation))
