"""What a scene file says is known of its pose, and the warnings of its result."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from regionpose.scene import SceneError, estimate_scene, load_scene, scene_result
from regionpose.scene.verdict import ADVICE, verdict
from scene_files import CAMERA, POSE, scene_values, write_scene
from scipy.spatial.transform import Rotation

POSTER = np.array([[-0.8, -0.5, 0.0], [0.8, -0.5, 0.0], [0.8, 0.5, 0.0], [-0.8, 0.5, 0.0]])
"""A rectangle, seen from its side z < 0, the world's -y upward."""

FAR_AWAY = (512_300.0, 5_405_700.0, 0.0)


def poster(
    prior: dict[str, Any] | None = None, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), **world: object
) -> dict[str, Any]:
    """A scene of the poster alone, the world moved by `shift`, with more keys of its world side."""
    values = scene_values()
    image = {"polygon": CAMERA.project(POSE.transform(POSTER)).tolist()}
    side = {"polygon": (POSTER + shift).tolist(), **world}
    values["regions"] = [{"name": "poster", "image": image, "world": side}]
    return values if prior is None else {**values, "prior": prior}


def result_of(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    return scene_result(estimate_scene(load_scene(write_scene(folder, values))))


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), FAR_AWAY])
def test_up_and_a_viewpoint_leave_one_pose(shift: tuple[float, float, float], tmp_path: Path) -> None:
    viewpoint = (np.array([0.3, 0.2, -2.0]) + shift).tolist()
    assert len(result_of(poster(shift=shift), tmp_path)["alternatives"]) == 3
    assert len(result_of(poster(shift=shift, seen_from=viewpoint), tmp_path)["alternatives"]) == 1
    up = {"up": [0.0, -1.0, 0.0], "up_sigma_deg": 10}
    result = result_of(poster(up, shift, seen_from=viewpoint), tmp_path)
    assert result["alternatives"] == [] and result["warnings"] == []
    np.testing.assert_allclose(result["camera_center_in_world_m"], POSE.camera_center + shift, atol=1e-5)


def rough(turn_deg: float, away: float) -> dict[str, Any]:
    """A pose beside the true one, as a scene gives it."""
    turned = Rotation.from_euler("z", turn_deg, degrees=True)
    centre = POSE.camera_center + np.array([away, 0.0, 0.0])
    rotation = turned * POSE.rotation
    return {"world_from_camera": {"matrix": rp.Pose(rotation, -rotation.apply(centre)).inverse().matrix.tolist()}}


def test_a_rough_pose_and_how_rough_leave_one_pose(tmp_path: Path) -> None:
    prior = {"initial": rough(8.0, 0.2), "initial_sigma": {"rotation_deg": 5, "camera_center_m": 0.3}}
    result = result_of(poster(prior), tmp_path)
    assert result["alternatives"] == [] and result["warnings"] == []
    np.testing.assert_allclose(result["camera_center_in_world_m"], POSE.camera_center, atol=1e-6)


CONTRADICTED: list[tuple[dict[str, Any], str]] = [
    (
        {"initial": rough(0.0, 2.0), "initial_sigma": {"rotation_deg": 5, "camera_center_m": 0.2}},
        "initial-contradicted",
    ),
    ({"initial": rough(60.0, 0.0)}, "initial-contradicted"),
    ({"up": [0.0, 1.0, 0.0]}, "up-contradicted"),
]


@pytest.mark.parametrize(("prior", "code"), CONTRADICTED)
def test_a_contradicted_prior_makes_a_pose_doubtful(prior: dict[str, Any], code: str, tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path, {**scene_values(), "prior": prior})))
    assert [warning["code"] for warning in scene_result(run)["warnings"]] == [code]
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)
    assert verdict(run).level == "doubtful" and verdict(run).remarks[0][1] == ADVICE[code]


def test_a_contradicted_side_names_its_region(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["world"]["seen_from"] = [0.0, 0.0, 3.0]
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert [warning["code"] for warning in scene_result(run)["warnings"]] == ["side-contradicted"]
    assert verdict(run).remarks[0][0].startswith("region 0 (floor) is seen from behind")


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        poster({"initial_sigma": {"rotation_deg": 5, "camera_center_m": 1}}),
        r"prior\.initial_sigma: found a deviation of nothing; needed the key initial",
    ),
    (poster({"initial": "paper"}), r"prior\.initial: found 'paper'; needed camera_from_world or world_from_camera"),
    (
        poster({"initial": rough(0.0, 0.0), "initial_sigma": {"rotation_deg": 0, "camera_center_m": 1}}),
        r"prior\.initial_sigma\.rotation_deg: found 0; needed greater than 0",
    ),
    (poster({"up_sigma_deg": 5}), r"prior\.up_sigma_deg: found a deviation of nothing; needed the key up"),
    (poster({"up": [0.0, 0.0, 0.0]}), r"prior: up is a zero vector; it needs to be a direction"),
    (poster(seen_from=[1.0, 2.0]), r"regions\[0\]\.world\.seen_from: found 2 numbers; needed \[x, y, z\]"),
    (poster(seen_from=[3.0, 0.0, 0.0]), r"regions\[0\]\.world\.seen_from: the viewpoint is .* off the region's plane"),
]


@pytest.mark.parametrize(("values", "said"), REFUSED)
def test_what_cannot_be_known_is_refused_with_its_line(values: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=rf"scene\.yaml:\d+: {said}"):
        estimate_scene(load_scene(write_scene(tmp_path, values)))
