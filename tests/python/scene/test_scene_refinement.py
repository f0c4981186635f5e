"""Scene files whose pose is refined by the edges of the rest of photo and cloud."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from card_scenes import CAMERA, PLACES, POSE, SHAPE, cards
from diagnostics import focal_of, regions_only_of
from numpy.typing import NDArray
from PIL import Image
from regionpose.geometry.units import length_text
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.bundle import bundle
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.headline import headline
from regionpose.scene.loading import load_scene
from regionpose.scene.stages import Stages
from scene_files import scene_values, write_scene

pytestmark = pytest.mark.slow

ORIGIN = np.array([431_999.0, 5_400_000.0, 119.0])
"""Where the world lies: far away, as maps have it."""


def rough_scene(folder: Path, *, other_photo: bool = False, focal: float = 500.0, **solver: str | bool) -> Path:
    """A scene of cards with two regions whose polygons in the photo are some pixels off; `focal`: what is given."""
    rng = np.random.default_rng(4)
    photo, points = cards(3)
    if other_photo:
        photo, _ = cards(9)
    write_ply(folder / "cloud.ply", Cloud(points + ORIGIN), overwrite=True)
    regions = []
    for name, place in zip(("left", "right"), PLACES, strict=True):
        world = POSE.inverse().transform(SHAPE + place)
        seen = CAMERA.project(POSE.transform(world)) + rng.normal(0.0, 1.5, (len(SHAPE), 2))
        regions.append(
            {"name": name, "image": {"polygon": seen.tolist()}, "world": {"polygon": (world + ORIGIN).tolist()}}
        )
    camera = {"model": "pinhole", "fx": focal, "fy": focal, "cx": 319.5, "cy": 239.5, "width": 640, "height": 480}
    values: dict[str, Any] = {"camera": camera, "image": "photo.png", "cloud": "cloud.ply", "regions": regions}
    values["solver"] = solver
    Image.fromarray(np.repeat(photo[..., None], 3, axis=2)).save(folder / "photo.png")
    path = folder / "scene.yaml"
    path.write_text(to_yaml(values), encoding="utf-8")
    return path


def errors(pose: rp.Pose) -> NDArray[np.float64]:
    """Degrees and meters from the true pose."""
    turn = np.degrees((pose.rotation * POSE.rotation.inv()).magnitude())
    return np.array([turn, np.linalg.norm(pose.camera_center - ORIGIN - POSE.camera_center)])


def test_edges_refine_a_rough_pose(tmp_path: Path) -> None:
    rough = estimate_scene(load_scene(rough_scene(tmp_path, edges=False)))
    run = estimate_scene(load_scene(rough_scene(tmp_path)))
    found = regions_only_of(run.estimate)
    assert rough.estimate.diagnostics.edges is None and found.is_refined
    assert (errors(run.estimate.pose) < 0.7 * errors(rough.estimate.pose)).all()
    assert run.estimate.confidence > 0.99
    assert found.estimate.pose.camera_center == pytest.approx(rough.estimate.pose.camera_center, abs=1e-6)
    whole, each = run.sides.overlap_errors(run.estimate.pose)
    assert [run.estimate.diagnostics.overlap_error, *run.estimate.diagnostics.region_overlap_errors] == pytest.approx(
        [whole, *each], rel=1e-6
    )
    result = json.loads(json.dumps(bundle(run, Stages()).result))
    said = result["diagnostics"]["edges"]["regions_only"]
    assert said["rank"] == said["solutions"] == 1 and said["rotation_deg"] == pytest.approx(found.rotation_deg)
    assert said["confidence"] == pytest.approx(rough.estimate.confidence)
    assert result["solver"]["edges"] is True and result["diagnostics"]["edges"]["alignment"]["log_odds"] > 5.0


def test_another_photo_does_not(tmp_path: Path) -> None:
    rough = estimate_scene(load_scene(rough_scene(tmp_path, edges=False, other_photo=True)))
    run = estimate_scene(load_scene(rough_scene(tmp_path, other_photo=True)))
    assert not regions_only_of(run.estimate).is_refined and run.estimate.confidence <= rough.estimate.confidence
    np.testing.assert_allclose(run.estimate.pose.matrix, rough.estimate.pose.matrix, atol=1e-8)


def test_the_edges_of_no_cloud_are_not_looked_at(tmp_path: Path) -> None:
    path = write_scene(tmp_path, {**scene_values(), "solver": {"edges": True}})
    assert estimate_scene(load_scene(path)).estimate.diagnostics.edges is None


def test_what_was_refined_before_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"scene.yaml:\d+: solver.refine: found 'scene'"):
        load_scene(rough_scene(tmp_path, refine="scene"))


def test_wrong_focal_lengths_make_a_pose_doubtful(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(rough_scene(tmp_path, focal=580.0)))
    focal = focal_of(run.estimate)
    assert focal.factor == pytest.approx(500.0 / 580.0, abs=0.01)
    assert run.estimate.status == rp.PoseStatus.DOUBTFUL
    assert rp.WarningCode.FOCAL_LENGTH_CONFLICT in {warning.code for warning in run.estimate.warnings}
    result = json.loads(json.dumps(bundle(run, Stages()).result))
    expected = {"log_odds": focal.log_odds, "factor": focal.factor, "shift_m": focal.shift_m}
    assert result["diagnostics"]["edges"]["focal"] == expected


def test_right_focal_lengths_are_not_contradicted(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(rough_scene(tmp_path)))
    focal = focal_of(run.estimate)
    assert focal.log_odds > np.log(9.0)
    assert all(warning.code != "focal-length-conflict" for warning in run.estimate.warnings)
    # What is 3 to 6 m away comes nearer by a percent of that.
    assert 0.025 < focal.shift_m < 0.06
    assert f"; focal lengths 1 % off would move it by {length_text(focal.shift_m)}." in headline(run)
