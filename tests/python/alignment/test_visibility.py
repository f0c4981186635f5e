"""Regions that a cloud hides at a pose, though the photo shows them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, POSE
from diagnostics import edges_of, focal_of, regions_only_of
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.bundle import bundle
from regionpose.scene.result import scene_result
from regionpose.scene.stages import Stages

Array = NDArray[np.float64]

SIGN = np.array([[-1.0, -1.0, 6.0], [1.0, -1.0, 6.0], [1.0, 1.0, 6.0], [-1.0, 1.0, 6.0]])
"""A square across the optical axis, in the camera's axes."""

WALL = 6.0
BLANK = np.full((480, 640), 128, dtype=np.uint8)
"""A photo without edges."""


class Board(NamedTuple):
    """A part of a plane at a depth before the camera, between left and right, top and bottom as seen on the wall."""

    depth: float
    left: float
    right: float
    top: float = -3.0
    bottom: float = 3.0

    def points(self, step: float = 0.05) -> Array:
        """Points (n, 3) of it in the camera's axes, so far apart as seen on the wall."""
        x, y = (
            np.arange(start + 0.5 * step, end, step)
            for start, end in ((self.left, self.right), (self.top, self.bottom))
        )
        x, y = np.meshgrid(x, y)
        flat = np.stack([x, y, np.full_like(x, WALL)], axis=-1).reshape(-1, 3)
        return flat * (self.depth / WALL)


WHOLE = Board(WALL, -4.0, 4.0)


def occlusion(*parts: Array, world: rp.WorldRegion | None = None, shown: Array = SIGN) -> rp.solve.Occlusion:
    """What points in the camera's axes hide of a region of the world, where the photo shows `shown`."""
    points = POSE.inverse().transform(np.concatenate(parts))
    image = rp.ImageRegion.from_polygon(CAMERA.project(shown))
    world = world or rp.WorldRegion.from_polygon(POSE.inverse().transform(SIGN))
    alignment = rp.check_alignment(CAMERA, rp.Frame([image], [world], image=BLANK, points=points), POSE)
    (found,) = alignment.occlusions
    return found


@pytest.mark.parametrize("share", [0.2, 0.45, 0.55, 0.8, 1.0])
def test_the_share_is_that_of_what_stands_before_the_region(share: float) -> None:
    found = occlusion(WHOLE.points(), Board(3.0, -4.0, -1.0 + 2.0 * share).points())
    assert found.hidden_fraction == pytest.approx(share, abs=0.05)
    assert found.distance_m == pytest.approx(3.0, abs=0.15) and found.region_distance_m == pytest.approx(6.0, abs=0.01)
    assert found.is_hidden == (share > 0.5)


def test_what_is_behind_on_the_region_or_beside_it_hides_nothing() -> None:
    noisy = WHOLE.points() * (1.0 + np.random.default_rng(0).normal(0.0, 0.02, (len(WHOLE.points()), 1)))
    found = occlusion(
        noisy, Board(9.0, -4.0, 4.0).points(), Board(3.0, 1.0, 4.0).points(), Board(2.0, -9, 9, 1).points()
    )
    assert found.hidden_fraction < 0.06 and not found.is_hidden


def test_single_points_and_posts_hide_no_more_than_themselves() -> None:
    rng = np.random.default_rng(1)
    strewn = np.column_stack([rng.uniform(-1.0, 1.0, (20, 2)), np.full(20, WALL)]) * rng.uniform(0.1, 0.8, (20, 1))
    assert occlusion(WHOLE.points(), strewn).hidden_fraction < 0.15
    posts = [Board(2.0, x, x + 0.1).points() for x in (-0.95, -0.05, 0.85)]
    assert occlusion(WHOLE.points(), *posts).hidden_fraction == pytest.approx(0.15, abs=0.1)


def test_scan_lines_are_a_surface() -> None:
    lines = [Board(3.0, -2.0, 2.0, y, y + 0.02).points(0.02) for y in np.arange(-2.0, 2.0, 0.3)]
    assert occlusion(WHOLE.points(), *lines).hidden_fraction > 0.95


def test_only_what_the_photo_shows_of_the_region_counts() -> None:
    left = SIGN * [0.5, 1.0, 1.0] - [0.5, 0.0, 0.0]
    before = Board(3.0, 0.0, 4.0).points()
    assert occlusion(before).hidden_fraction == pytest.approx(0.5, abs=0.05)
    assert occlusion(before, shown=left).hidden_fraction < 0.06
    assert occlusion(Board(3.0, -4.0, 0.0).points(), shown=left).hidden_fraction > 0.95
    away = occlusion(before, shown=SIGN + np.array([2.5, 0.0, 0.0]))
    assert np.isnan([away.hidden_fraction, away.distance_m, away.region_distance_m]).all() and not away.is_hidden


def test_holes_are_not_the_region() -> None:
    ring, hole = SIGN, 0.6 * SIGN * [1.0, 1.0, 1.0 / 0.6]
    world = rp.WorldRegion.from_polygon([POSE.inverse().transform(each) for each in (ring, hole)])
    assert occlusion(Board(3.0, -0.55, 0.55, -0.55, 0.55).points(), world=world).hidden_fraction < 0.02


def test_a_curved_surface_does_not_hide_itself() -> None:
    angles, heights = np.meshgrid(np.linspace(-1.2, 1.2, 13), np.linspace(-1.0, 1.0, 5))
    places = np.stack([2.0 * np.sin(angles), heights, 6.0 - 2.0 * np.cos(angles)], axis=-1).reshape(-1, 3)
    index = np.arange(65).reshape(5, 13)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))

    faces = np.concatenate([np.c_[a, b, c], np.c_[a, c, d]])
    world = rp.WorldRegion.from_mesh(SimpleNamespace(vertices=POSE.inverse().transform(places), faces=faces))
    outline = places[np.r_[index[0], index[1:, -1], index[-1, -2::-1], index[-2:0:-1, 0]]]
    dense = np.repeat(places, 2, axis=0)
    assert occlusion(dense, world=world, shown=outline).hidden_fraction == 0.0
    assert (
        occlusion(dense, Board(2.0, -9.0, 9.0, -9.0, 9.0).points(), world=world, shown=outline).hidden_fraction > 0.95
    )


def test_a_region_on_the_seam_of_a_panorama() -> None:
    camera = rp.cameras.EquirectangularCamera(1000, 500)
    sign = SIGN * [1.0, 1.0, -1.0]
    pixels = camera.project(sign)
    pixels[pixels[:, 0] < 500.0, 0] += 1000.0
    image, world = rp.ImageRegion.from_polygon(pixels), rp.WorldRegion.from_polygon(sign)
    here = rp.Pose.from_parts(np.eye(3), np.zeros(3))
    board = Board(3.0, -4.0, 0.0).points() * [1.0, 1.0, -1.0]
    photo = np.full((500, 1000), 128, dtype=np.uint8)
    alignment = rp.check_alignment(camera, rp.Frame([image], [world], image=photo, points=board), here)
    (found,) = alignment.occlusions
    assert found.hidden_fraction == pytest.approx(0.5, abs=0.05)


def test_clouds_without_points_hide_nothing() -> None:
    for points in (np.zeros((0, 3)), np.full((9, 3), np.nan), np.array([POSE.camera_center])):
        world = [rp.WorldRegion.from_polygon(POSE.inverse().transform(SIGN))]
        shown = [rp.ImageRegion.from_polygon(CAMERA.project(SIGN))]
        alignment = rp.check_alignment(CAMERA, rp.Frame(shown, world, image=BLANK, points=points), POSE)
        assert alignment.occlusions[0].hidden_fraction == 0.0 and alignment.log_odds == 0.0


def test_a_wall_hides_what_is_behind_it_until_the_camera_is_within() -> None:
    """Points 2 cm apart are a wall half a meter off; those a millimeter off stand alone."""
    x, y = np.meshgrid(np.arange(-1.0, 1.0, 0.02), np.arange(-1.0, 1.0, 0.02))
    for depth, share in ((0.5, 1.0), (0.001, 0.0)):
        wall = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, depth)])
        assert occlusion(WHOLE.points(), wall).hidden_fraction == pytest.approx(share, abs=0.05)


def test_hidden_regions_speak_nine_to_one_against_a_pose() -> None:
    world = [rp.WorldRegion.from_polygon(POSE.inverse().transform(SIGN))] * 2
    shown = [rp.ImageRegion.from_polygon(CAMERA.project(SIGN))] * 2
    board = POSE.inverse().transform(Board(3.0, -4.0, 4.0).points())
    alignment = rp.check_alignment(CAMERA, rp.Frame(shown, world, image=BLANK, points=board), POSE)
    assert alignment.edge_log_odds == 0.0 and alignment.log_odds == pytest.approx(-np.log(9.0))
    assert "hidden=2" in repr(alignment)


def test_regions_come_in_pairs() -> None:
    world = [rp.WorldRegion.from_polygon(POSE.inverse().transform(SIGN))]
    with pytest.raises(ValueError, match="there are 1 world regions; needed 0, one for each image region"):
        rp.check_alignment(CAMERA, rp.Frame([], world, image=BLANK, points=np.zeros((5, 3))), POSE)


SLOPED = np.array([[-0.9, -2.4, 5.0], [0.5, -2.4, 6.2], [0.5, -0.6, 6.2], [-0.9, -0.6, 5.0]])
"""A rectangle on a wall, above the optical axis, which two poses show alike from one side."""


def room() -> Array:
    """Points of a floor, of a ceiling just above the rectangle, and of its wall, in the world."""
    x, z = (part.ravel() for part in np.meshgrid(np.arange(-6.0, 6.0, 0.05), np.arange(-2.0, 9.0, 0.05)))
    level = [np.column_stack([x, np.full_like(x, y), z]) for y in (1.5, -2.5)]
    along, up = np.meshgrid(np.arange(-3.0, 4.0, 0.04), np.arange(-2.5, 1.5, 0.04))
    wall = np.stack([-0.9 + 1.4 * along, up, 5.0 + 1.2 * along], axis=-1).reshape(-1, 3)
    return POSE.inverse().transform(np.concatenate([*level, wall + np.array([0.0, 0.0, 0.02])]))


def sides(*shapes: Array) -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """Image and world regions of shapes in the camera's axes."""
    images = [rp.ImageRegion.from_polygon(CAMERA.project(shape)) for shape in shapes]
    return images, [rp.WorldRegion.from_polygon(POSE.inverse().transform(shape)) for shape in shapes]


@pytest.mark.slow
def test_the_pose_that_hides_nothing_is_chosen_where_a_photo_has_no_edges() -> None:
    """Half a turn about the middle of the rectangle takes the camera above the ceiling."""
    images, (world,) = sides(SLOPED)
    worlds = [world.with_viewpoint(POSE.camera_center)]
    free = rp.estimate_pose(CAMERA, images, worlds)
    answers = [free.pose, *(other.pose for other in free.diagnostics.alternatives)]
    right = [bool((pose.rotation * POSE.rotation.inv()).magnitude() < 0.01) for pose in answers]
    assert sorted(right) == [False, True]
    found = rp.calibrate(CAMERA, [rp.Frame(images, worlds, image=BLANK, points=room())])
    estimate = found
    assert (
        edges_of(found).log_odds == pytest.approx(0.0, abs=0.5) and regions_only_of(found).rank == right.index(True) + 1
    )
    assert (estimate.pose.rotation * POSE.rotation.inv()).magnitude() < 0.01
    assert "occluded-region" not in [warning.code for warning in estimate.warnings]
    assert estimate.confidence > 8.0 * estimate.diagnostics.alternatives[0].confidence


LEFT = np.array(
    [[-1.5, -0.8, 5.5], [-0.3, -0.8, 5.5], [-0.3, 0.0, 5.8], [-1.0, 0.0, 5.8], [-1.0, 0.6, 6.0], [-1.5, 0.6, 6.0]]
)
RIGHT = LEFT * [1.0, 1.0, 0.9] + [1.9, 0.2, 0.0]


def board() -> Array:
    """Points of a board before the second of two regions, in the world."""
    x, y = (part.ravel() for part in np.meshgrid(np.arange(0.1, 0.9, 0.01), np.arange(-0.5, 0.6, 0.01)))
    return POSE.inverse().transform(np.column_stack([x, y, np.full_like(x, 3.0)]))


def test_a_pose_that_hides_a_region_is_warned_of_by_name() -> None:
    images, worlds = sides(LEFT, RIGHT)
    found = rp.calibrate(CAMERA, [rp.Frame(images, worlds, image=BLANK, points=board())])
    estimate = found
    (warning,) = [each for each in estimate.warnings if each.code == "occluded-region"]
    assert warning.regions == (1,) and warning.values["hidden_fraction"] == pytest.approx(0.95, abs=0.05)
    assert warning.values["distance_m"] == pytest.approx(3.0, abs=0.05)
    assert warning.values["region_distance_m"] == pytest.approx(5.2, abs=0.05)
    assert warning.text_with(["door", "sign"]).count("(sign)") == 1
    alone = rp.estimate_pose(CAMERA, *sides(LEFT, RIGHT))
    focal, probability = 1.0 / (1.0 + np.exp(-focal_of(found).log_odds)), alone.diagnostics.mode_probability
    hidden = probability / (probability + 9.0 * (1.0 - probability))
    assert estimate.confidence == pytest.approx(focal * hidden, abs=0.03)


def test_a_scene_file_with_a_hidden_region_is_doubtful(tmp_path: Path) -> None:
    write_ply(tmp_path / "cloud.ply", Cloud(board()))
    Image.fromarray(BLANK).save(tmp_path / "photo.png")
    regions = [
        {"name": name, "image": {"polygon": CAMERA.project(s).tolist()}, "world": {"polygon": world.tolist()}}
        for name, s, world in ((n, s, POSE.inverse().transform(s)) for n, s in (("door", LEFT), ("sign", RIGHT)))
    ]
    camera = {"model": "pinhole", "fx": 500.0, "fy": 500.0, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}
    scene = {"camera": camera, "image": "photo.png", "cloud": "cloud.ply", "sensor_origin": None, "regions": regions}
    (tmp_path / "scene.yaml").write_text(to_yaml(scene), encoding="utf-8")
    run = rp.estimate_scene(rp.load_scene(tmp_path / "scene.yaml"))
    assert run.estimate.status == rp.PoseStatus.DOUBTFUL
    assert (rp.WarningCode.OCCLUDED_REGION, (1,)) in [(each.code, each.regions) for each in run.estimate.warnings]
    shares = [region["hidden_fraction"] for region in scene_result(run)["diagnostics"]["regions"]]
    assert shares[0] == 0.0 and shares[1] > 0.9
    assert "depth.png" in bundle(run, Stages()).writers


def test_regions_are_counted_over_all_frames() -> None:
    images, worlds = sides(LEFT, RIGHT)
    far = np.full((1, 3), 50.0)
    frames = [rp.Frame(images, worlds, image=BLANK, points=points) for points in (far, board())]
    found = rp.calibrate(CAMERA, frames)
    assert [warning.regions for warning in found.warnings if warning.code == "occluded-region"] == [(3,)]
