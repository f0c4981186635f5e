"""Regions and edges in one posterior, in one call and in a scene file in the same way."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, cards, painted
from diagnostics import edges_of, regions_only_of
from numpy.typing import NDArray
from PIL import Image
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.headline import headline
from regionpose.solve.options import EXACT_EXPOSURE
from scipy.spatial.transform import Rotation
from small_searches import try_fewer_focal_lengths

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def few_focal_lengths(monkeypatch: pytest.MonkeyPatch) -> None:
    """Try a shorter and a longer one."""
    try_fewer_focal_lengths(monkeypatch)


Array = NDArray[np.float64]

DOOR = np.array([[-0.6, -0.8, 3.6], [0.4, -0.8, 4.6], [0.4, 1.1, 4.6], [-0.6, 1.1, 3.6]])
"""A rectangle in the camera's axes, which four poses show alike."""

NEAR_DEG = 0.1
"""How far edges may lead a pose of exact outlines: half of the deviation that half a pixel leaves."""

STRAIGHT = Rotation.identity()
TURN = Rotation.from_rotvec(np.radians([0.0, 25.0, 0.0]))
"""Of regions in the world against their cloud: what a wrong frame, or wrong pairs, come to."""


def regions(shapes: list[Array], turn: Rotation) -> tuple[list[Array], list[Array]]:
    """Outlines (n, 2) in the photo and (n, 3) in the world of shapes in the camera's axes."""
    return [CAMERA.project(shape) for shape in shapes], [turn.apply(POSE.inverse().transform(s)) for s in shapes]


def sides(shapes: list[Array], turn: Rotation = STRAIGHT) -> tuple[list[rp.ImageRegion], list[rp.WorldRegion]]:
    """The same as regions."""
    seen, world = regions(shapes, turn)
    images = [rp.ImageRegion.from_polygon(ring) for ring in seen]
    return images, [rp.WorldRegion.from_polygon(ring) for ring in world]


def judged(shapes: list[Array], turn: Rotation = STRAIGHT, **known: Any) -> rp.PoseEstimate:
    """The pose of shapes and of the edges of cards."""
    photo, points = cards(3)
    images, worlds = sides(shapes, turn)
    frame = rp.Frame(images, worlds, image=photo, points=points)
    return rp.calibrate(CAMERA, [frame], **{"solver": rp.Solver(**EXACT_EXPOSURE), **known})


def alone(shapes: list[Array]) -> rp.PoseEstimate:
    """The estimate of shapes by themselves."""
    seen, world = regions(shapes, STRAIGHT)
    return rp.estimate_pose(
        CAMERA,
        [rp.ImageRegion.from_polygon(ring) for ring in seen],
        [rp.WorldRegion.from_polygon(ring) for ring in world],
        solver=rp.Solver(**EXACT_EXPOSURE),
    )


def scene_file(
    folder: Path, shapes: list[Array], turn: Rotation = STRAIGHT, intensity: Array | None = None, wall: bool = False
) -> Path:
    """The same as a scene file; `wall`: the cards are painted on it, and the cloud may have an intensity."""
    photo, points = painted(3)[:2] if wall else cards(3)
    write_ply(folder / "cloud.ply", Cloud(points, intensity=intensity), overwrite=True)
    Image.fromarray(photo).save(folder / "photo.png")
    listed = [
        {"name": f"region {k}", "image": {"polygon": seen.tolist()}, "world": {"polygon": world.tolist()}}
        for k, (seen, world) in enumerate(zip(*regions(shapes, turn), strict=True))
    ]
    camera = {"model": "pinhole", "fx": 500.0, "fy": 500.0, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}
    values = {"camera": camera, "image": "photo.png", "cloud": "cloud.ply", "sensor_origin": None, "regions": listed}
    values["solver"] = dict(EXACT_EXPOSURE)
    (folder / "scene.yaml").write_text(to_yaml(values), encoding="utf-8")
    return folder / "scene.yaml"


def turned_deg(pose: rp.Pose, other: rp.Pose = POSE) -> float:
    return float(np.degrees((pose.rotation * other.rotation.inv()).magnitude()))


def codes(estimate: rp.PoseEstimate) -> list[str]:
    return [warning.code for warning in estimate.warnings]


SHAPES = [SHAPE + place for place in PLACES]

CASES = {"right": (SHAPES, STRAIGHT), "turned": (SHAPES, TURN), "rectangle": ([DOOR], STRAIGHT)}


@cache
def judged_case(case: str) -> rp.PoseEstimate:
    """The same of a case; tests share it."""
    return judged(*CASES[case])


def test_a_right_pose_stays_trusted() -> None:
    found = judged_case("right")
    estimate = found
    assert turned_deg(estimate.pose) < NEAR_DEG and estimate.warnings == () and estimate.confidence > 0.99
    assert edges_of(found).log_odds > 20.0 and regions_only_of(found).rank == 1 and regions_only_of(found).is_refined
    assert regions_only_of(found).rotation_deg == pytest.approx(
        turned_deg(regions_only_of(found).estimate.pose, estimate.pose)
    )
    assert np.linalg.det(estimate.covariance) < 0.1 * np.linalg.det(alone(SHAPES).covariance)


def test_a_pose_that_fits_its_regions_but_not_the_scene_is_not_trusted() -> None:
    found = judged_case("turned")
    assert turned_deg(found.pose) > 20.0 and found.diagnostics.overlap_error < 1e-6
    assert codes(found) == ["edge-mismatch"] and found.confidence < 0.9
    assert regions_only_of(found).estimate.confidence == pytest.approx(alone(SHAPES).confidence, abs=0.01)
    assert edges_of(found).log_odds < 0.0 and not regions_only_of(found).is_refined


def test_edges_choose_the_answer_of_a_rectangle() -> None:
    free = alone([DOOR])
    assert len(free.diagnostics.alternatives) == 3 and "ambiguous-pose" in codes(free)
    order = [turned_deg(pose) < 1.0 for pose in (free.pose, *(other.pose for other in free.diagnostics.alternatives))]
    found = judged_case("rectangle")
    assert (
        turned_deg(found.pose) < NEAR_DEG
        and regions_only_of(found).rank == order.index(True) + 1
        and edges_of(found).log_odds_over_next > 20.0
    )
    assert found.confidence > 0.97 and codes(found) == []
    others = found.diagnostics.alternatives
    assert len(others) == 3 and max(other.confidence for other in others) < 0.01
    assert all(np.isfinite(other.overlap_error) for other in others)


def test_what_is_known_and_chosen_reaches_the_estimate() -> None:
    up = POSE.rotation.inv().apply([0.0, -1.0, 0.0])
    found = judged([DOOR], prior=rp.Prior(up=up), solver=rp.Solver(driver="native", **EXACT_EXPOSURE))
    assert len(regions_only_of(found).estimate.diagnostics.alternatives) == 1
    assert turned_deg(found.pose) < NEAR_DEG


def test_edges_find_the_pose_where_all_regions_are_wrong() -> None:
    up = POSE.rotation.inv().apply([0.0, -1.0, 0.0])
    near = POSE.camera_center + np.array([0.1, 0.0, -0.1])
    prior = rp.Prior(camera_near=near, camera_near_sigma_m=0.2, up=up, up_sigma_deg=3.0)
    found = judged(SHAPES, TURN, prior=prior)
    assert turned_deg(found.pose) < 0.3 and regions_only_of(found).rank is None and edges_of(found).log_odds > 10.0
    assert "region-edge-conflict" in codes(found)
    assert found.diagnostics.overlap_error > 0.5


@pytest.mark.parametrize(("case", "level"), [("right", "trusted"), ("turned", "doubtful"), ("rectangle", "trusted")])
def test_scene_files_judge_in_the_same_way(case: str, level: str, tmp_path: Path) -> None:
    run = rp.estimate_scene(rp.load_scene(scene_file(tmp_path, *CASES[case])))
    found = judged_case(case)
    assert run.estimate.status == found.status == level
    assert edges_of(run.estimate).log_odds == pytest.approx(edges_of(found).log_odds, abs=2.0)
    assert run.estimate.confidence == pytest.approx(found.confidence, abs=0.05)
    assert codes(run.estimate) == codes(found)
    assert turned_deg(run.estimate.pose, found.pose) < 0.02
    assert ("chosen among 4 poses" in headline(run)) == (case == "rectangle")


def test_wrong_shapes_are_named() -> None:
    images, worlds = sides(SHAPES)
    photo, points = cards(0)
    with pytest.raises(ValueError, match=r"points has shape \(5, 2\); needed \(n, 3\)"):
        rp.calibrate(CAMERA, [rp.Frame(images, worlds, image=photo, points=points[:5, :2])])
    with pytest.raises(ValueError, match=r"image has shape \(3,\)"):
        rp.calibrate(CAMERA, [rp.Frame(images, worlds, image=[1.0, 0.5, 0.25], points=points)])


def test_the_intensity_of_a_cloud_counts_in_a_call_and_in_a_scene_file(tmp_path: Path) -> None:
    photo, points, intensity = painted(3)
    images, worlds = sides(SHAPES)
    solver = rp.Solver(**EXACT_EXPOSURE)
    without = rp.calibrate(CAMERA, [rp.Frame(images, worlds, image=photo, points=points)], solver=solver)
    assert (
        edges_of(without).count == 0 and edges_of(without).log_odds == 0.0 and not regions_only_of(without).is_refined
    )
    called = rp.calibrate(
        CAMERA, [rp.Frame(images, worlds, image=photo, points=points, intensity=intensity)], solver=solver
    )
    assert edges_of(called).log_odds > 5.0
    run = rp.estimate_scene(rp.load_scene(scene_file(tmp_path, SHAPES, intensity=intensity, wall=True)))
    assert edges_of(run.estimate).count == pytest.approx(edges_of(called).count, rel=0.02)
    assert edges_of(run.estimate).log_odds == pytest.approx(edges_of(called).log_odds, rel=0.2)
