"""A pose judged by the rest of photo and cloud in one call, and by a scene file in the same way."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, cards, painted
from numpy.typing import NDArray
from PIL import Image
from regionpose.clouds import Cloud, write_ply
from regionpose.estimation.options import EXACT_EXPOSURE
from regionpose.scene.verdict import DOUBTFUL, TRUSTED, verdict
from regionpose.yaml_text import to_yaml
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

DOOR = np.array([[-0.6, -0.8, 3.6], [0.4, -0.8, 4.6], [0.4, 1.1, 4.6], [-0.6, 1.1, 3.6]])
"""A rectangle in the camera's axes, which four poses show alike."""

NEAR_DEG = 0.05
"""How far edges may lead a pose of exact outlines: a quarter of the deviation that half a pixel leaves."""

STRAIGHT = Rotation.identity()
TURN = Rotation.from_rotvec(np.radians([0.0, 25.0, 0.0]))
"""Of regions in the world against their cloud: what a wrong frame, or wrong pairs, come to."""


def regions(shapes: list[Array], turn: Rotation) -> tuple[list[Array], list[Array]]:
    """Outlines (n, 2) in the photo and (n, 3) in the world of shapes in the camera's axes."""
    return [CAMERA.project(shape) for shape in shapes], [turn.apply(POSE.inverse().transform(s)) for s in shapes]


def judged(shapes: list[Array], turn: Rotation = STRAIGHT, **known: Any) -> rp.Witnessed:
    """The estimate of shapes, judged by cards."""
    seen, world = regions(shapes, turn)
    images = [rp.ImageRegion.from_polygon(ring) for ring in seen]
    worlds = [rp.WorldRegion.from_polygon(ring) for ring in world]
    return rp.estimate_with_scene(CAMERA, images, worlds, *cards(3), **{"solver": rp.Solver(**EXACT_EXPOSURE), **known})


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


def test_a_right_pose_stays_trusted() -> None:
    estimate, witness = judged(SHAPES)
    assert turned_deg(estimate.pose) < NEAR_DEG and estimate.warnings == () and estimate.confidence > 0.97
    assert witness.log_odds > 2.0 and (witness.place, witness.answers) == (0, 1)
    assert witness.refinement is not None and witness.refinement.refined
    assert estimate.confidence > witness.confidence_before
    assert np.linalg.det(estimate.covariance) < 0.1 * np.linalg.det(alone(SHAPES).covariance)


def test_a_pose_that_fits_its_regions_but_not_the_scene_is_not_trusted() -> None:
    estimate, witness = judged(SHAPES, TURN)
    assert turned_deg(estimate.pose) > 20.0 and estimate.overlap_error < 1e-6
    assert codes(estimate) == ["scene-disagrees"] and estimate.confidence < 0.9
    assert witness.confidence_before == pytest.approx(alone(SHAPES).confidence, abs=0.01)
    assert witness.refinement is not None and not witness.refinement.refined


def test_the_scene_chooses_the_answer_of_a_rectangle() -> None:
    free = alone([DOOR])
    assert len(free.alternatives) == 3 and "ambiguous" in codes(free)
    order = [turned_deg(pose) < 1.0 for pose in (free.pose, *(other.pose for other in free.alternatives))]
    estimate, witness = judged([DOOR])
    assert turned_deg(estimate.pose) < NEAR_DEG
    assert (witness.place, witness.answers) == (order.index(True), 4)
    assert estimate.confidence > 0.9 and codes(estimate) == []
    assert len(estimate.alternatives) == 3 and max(other.confidence for other in estimate.alternatives) < 0.1


def test_what_is_known_and_chosen_reaches_the_estimate() -> None:
    up = POSE.rotation.inv().apply([0.0, -1.0, 0.0])
    estimate, witness = judged([DOOR], prior=rp.Prior(up=up), solver=rp.Solver(driver="native", **EXACT_EXPOSURE))
    assert witness.answers == 2 and turned_deg(estimate.pose) < NEAR_DEG


@pytest.mark.parametrize(
    ("shapes", "turn", "level"),
    [(SHAPES, STRAIGHT, TRUSTED), (SHAPES, TURN, DOUBTFUL), ([DOOR], STRAIGHT, TRUSTED)],
    ids=["right", "turned", "rectangle"],
)
def test_scene_files_judge_in_the_same_way(shapes: list[Array], turn: Rotation, level: str, tmp_path: Path) -> None:
    run = rp.estimate_scene(rp.load_scene(scene_file(tmp_path, shapes, turn)))
    estimate, witness = judged(shapes, turn)
    assert verdict(run).level == level
    assert run.witness is not None and run.witness.log_odds == pytest.approx(witness.log_odds, abs=0.3)
    assert run.estimate.confidence == pytest.approx(estimate.confidence, abs=0.02)
    assert codes(run.estimate) == codes(estimate)
    assert turned_deg(run.estimate.pose, estimate.pose) < 0.01
    assert ("choose this pose of 4" in verdict(run).headline) == (witness.answers == 4)


def test_wrong_shapes_are_named() -> None:
    seen, world = regions(SHAPES, STRAIGHT)
    sides = [rp.ImageRegion.from_polygon(seen[0])], [rp.WorldRegion.from_polygon(world[0])]
    photo, points = cards(0)
    with pytest.raises(ValueError, match=r"points has shape \(5, 2\); needed \(n, 3\)"):
        rp.estimate_with_scene(CAMERA, *sides, photo, points[:5, :2])
    with pytest.raises(ValueError, match=r"image has shape \(3,\)"):
        rp.estimate_with_scene(CAMERA, *sides, [1.0, 0.5, 0.25], points)


def test_the_intensity_of_a_cloud_testifies_in_a_call_and_in_a_scene_file(tmp_path: Path) -> None:
    photo, points, intensity = painted(3)
    seen, world = regions(SHAPES, STRAIGHT)
    sides = [rp.ImageRegion.from_polygon(ring) for ring in seen], [rp.WorldRegion.from_polygon(ring) for ring in world]
    (by_depth,) = rp.estimate_with_scene(CAMERA, *sides, photo, points).witness.told
    assert len(by_depth.places) == 0
    (called,) = rp.estimate_with_scene(CAMERA, *sides, photo, points, intensity=intensity).witness.told
    assert called.log_odds > 2.0
    run = rp.estimate_scene(rp.load_scene(scene_file(tmp_path, SHAPES, intensity=intensity, wall=True)))
    assert run.witness is not None
    (filed,) = run.witness.told
    assert len(filed.places) == pytest.approx(len(called.places), rel=0.02)
    assert filed.log_odds == pytest.approx(called.log_odds, abs=1.0)
