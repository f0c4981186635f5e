"""What a scene file says is known of its pose, and the warnings of its result."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.scene.result import scene_result
from scene_files import CAMERA, POSE, scene_values, write_scene
from scipy.spatial.transform import Rotation

POSTER = np.array([[-0.8, -0.5, 0.0], [0.8, -0.5, 0.0], [0.8, 0.5, 0.0], [-0.8, 0.5, 0.0]])
"""A rectangle, seen from its side z < 0, the world's -y upward."""

FAR_AWAY = (512_300.0, 5_405_700.0, 0.0)

WEAK = {"weak-geometry"}
"""What four corners may be warned of, whatever is known beforehand: each may be off by a pixel."""


def poster(
    prior: dict[str, Any] | None = None, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), **world: object
) -> dict[str, Any]:
    """A scene of the poster alone, the world moved by `shift`, with more keys of its world side."""
    values = scene_values()
    image = {"polygon": CAMERA.project(POSE.transform(POSTER)).tolist()}
    side = {"polygon": (POSTER + shift).tolist(), **world}
    values["regions"] = [{"name": "poster", "image": image, "world": side}]
    return values if prior is None else {**values, "prior": prior}


def codes_of(result: dict[str, Any]) -> set[str]:
    return {warning["code"] for warning in result["warnings"]}


def result_of(values: dict[str, Any], folder: Path) -> dict[str, Any]:
    return scene_result(estimate_scene(load_scene(write_scene(folder, values))))


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), FAR_AWAY])
def test_up_and_a_viewpoint_leave_one_pose(shift: tuple[float, float, float], tmp_path: Path) -> None:
    viewpoint = (np.array([0.3, 0.2, -2.0]) + shift).tolist()
    assert len(result_of(poster(shift=shift), tmp_path)["diagnostics"]["alternatives"]) == 3
    assert len(result_of(poster(shift=shift, viewpoint=viewpoint), tmp_path)["diagnostics"]["alternatives"]) == 1
    up = {"up": [0.0, -1.0, 0.0], "up_sigma_deg": 10}
    result = result_of(poster(up, shift, viewpoint=viewpoint), tmp_path)
    assert result["diagnostics"]["alternatives"] == [] and codes_of(result) <= WEAK
    np.testing.assert_allclose(result["camera_center_in_world_m"], POSE.camera_center + shift, atol=1e-5)


def rough(turn_deg: float, away: float) -> dict[str, Any]:
    """A pose beside the true one, as a scene gives it."""
    turned = Rotation.from_euler("z", turn_deg, degrees=True)
    center = POSE.camera_center + np.array([away, 0.0, 0.0])
    rotation = turned * POSE.rotation
    return {"world_from_camera": {"matrix": rp.Pose(rotation, -rotation.apply(center)).inverse().matrix.tolist()}}


def test_a_rough_pose_and_how_rough_leave_one_pose(tmp_path: Path) -> None:
    prior = {"initial": rough(8.0, 0.2), "initial_rotation_sigma_deg": 5, "initial_center_sigma_m": 0.3}
    result = result_of(poster(prior), tmp_path)
    assert result["diagnostics"]["alternatives"] == [] and codes_of(result) <= WEAK
    np.testing.assert_allclose(result["camera_center_in_world_m"], POSE.camera_center, atol=1e-6)


def scanned(folder: Path, shift: tuple[float, float, float] = (0.0, 0.0, 0.0), **more: Any) -> dict[str, Any]:
    """The result of the poster with a cloud beside it, which a PCD says to be scanned from 0.3 m beside the camera."""
    place = POSE.camera_center + np.array([0.3, 0.0, 0.0]) + shift
    head = "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 4\nHEIGHT 1\n"
    viewpoint = " ".join(f"{value:.17g}" for value in place)
    rows = "\n".join(" ".join(map(repr, row)) for row in (POSTER + shift).tolist())
    (folder / "cloud.pcd").write_text(f"{head}VIEWPOINT {viewpoint} 1 0 0 0\nPOINTS 4\nDATA ascii\n{rows}\n")
    return result_of({**poster(shift=shift), "cloud": "cloud.pcd", **more}, folder)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), FAR_AWAY])
def test_the_camera_is_taken_to_be_near_the_scanner(shift: tuple[float, float, float], tmp_path: Path) -> None:
    place = POSE.camera_center + np.array([0.3, 0.0, 0.0]) + shift
    result = scanned(tmp_path, shift)
    assert result["diagnostics"]["sensor_origin"]["source"] == "the cloud's file"
    np.testing.assert_allclose(result["diagnostics"]["sensor_origin"]["place_in_world_m"], place, atol=1e-9)
    near = result["diagnostics"]["camera_near"]
    assert near["place_in_world_m"] == result["diagnostics"]["sensor_origin"]["place_in_world_m"]
    assert (near["sigma_m"], near["source"]) == (2.0, "sensor_origin")
    # The poster's other poses are 2 and 8 m away: too near for 2 m to tell.
    strict = scanned(tmp_path, shift, prior={"camera_near_sigma_m": 0.2})
    assert strict["diagnostics"]["camera_near"]["sigma_m"] == 0.2 and not strict["diagnostics"]["alternatives"]
    assert codes_of(strict) <= WEAK
    np.testing.assert_allclose(strict["camera_center_in_world_m"], POSE.camera_center + shift, atol=1e-5)


def test_the_scene_says_where_the_scanner_stood_and_whether_the_camera_is_near(tmp_path: Path) -> None:
    elsewhere = scanned(tmp_path, sensor_origin=[5.0, 0.0, -2.0])
    assert elsewhere["diagnostics"]["sensor_origin"] == {
        "place_in_world_m": [5.0, 0.0, -2.0],
        "source": "the scene's sensor_origin",
    }
    unknown = scanned(tmp_path, sensor_origin=None)
    assert unknown["diagnostics"]["sensor_origin"] is None and unknown["diagnostics"]["camera_near"] is None
    free = scanned(tmp_path, prior={"camera_near": None})
    assert free["diagnostics"]["sensor_origin"] is not None and free["diagnostics"]["camera_near"] is None
    assert len(free["diagnostics"]["alternatives"]) == len(unknown["diagnostics"]["alternatives"]) == 3
    given = scanned(tmp_path, prior={"camera_near": [0.0, 1.0, -3.0], "camera_near_sigma_m": 5})
    assert given["diagnostics"]["camera_near"] == {
        "place_in_world_m": [0.0, 1.0, -3.0],
        "sigma_m": 5.0,
        "source": "prior.camera_near",
    }


def test_a_camera_far_from_the_scanner_is_warned_of_with_advice(tmp_path: Path) -> None:
    values = {**scene_values(), "sensor_origin": [30.0, 0.0, 0.0]}
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert [warning["code"] for warning in scene_result(run)["warnings"]] == ["camera-position-conflict"]
    assert run.estimate.status == "doubtful" and run.estimate.warnings[0].advice
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)


CONTRADICTED: list[tuple[dict[str, Any], str]] = [
    (
        {"initial": rough(0.0, 2.0), "initial_rotation_sigma_deg": 5, "initial_center_sigma_m": 0.2},
        "initial-pose-conflict",
    ),
    ({"initial": rough(60.0, 0.0)}, "initial-pose-conflict"),
    ({"up": [0.0, 1.0, 0.0]}, "up-direction-conflict"),
    ({"camera_near": [0.0, 9.0, 0.0], "camera_near_sigma_m": 1}, "camera-position-conflict"),
]


@pytest.mark.parametrize(("prior", "code"), CONTRADICTED)
def test_a_contradicted_prior_makes_a_pose_doubtful(prior: dict[str, Any], code: str, tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path, {**scene_values(), "prior": prior})))
    assert [warning["code"] for warning in scene_result(run)["warnings"]] == [code]
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)
    assert run.estimate.status == "doubtful" and run.estimate.warnings[0].advice


def test_a_contradicted_side_names_its_region(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["world"]["viewpoint"] = [0.0, 0.0, 3.0]
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert [warning["code"] for warning in scene_result(run)["warnings"]] == ["viewpoint-conflict"]
    assert run.estimate.warnings[0].regions == (0,)


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        poster({"initial_rotation_sigma_deg": 5, "initial_center_sigma_m": 1}),
        r"prior\.initial_rotation_sigma_deg: found a deviation of nothing; needed the key initial",
    ),
    (poster({"initial": "paper"}), r"prior\.initial: found 'paper'; needed camera_from_world or world_from_camera"),
    (
        poster({"initial": rough(0.0, 0.0), "initial_rotation_sigma_deg": 0, "initial_center_sigma_m": 1}),
        r"prior\.initial_rotation_sigma_deg: found 0; needed greater than 0",
    ),
    (poster({"up_sigma_deg": 5}), r"prior\.up_sigma_deg: found a deviation of nothing; needed the key up"),
    (
        poster({"camera_near_sigma_m": 1}),
        r"prior: camera_near_sigma_m is 1.0 without camera_near; it needs camera_near",
    ),
    (poster({"camera_near": [1.0, 2.0]}), r"prior\.camera_near: found 2 numbers; needed \[x, y, z\]"),
    (poster({"camera_near_sigma_m": -1}), r"prior\.camera_near_sigma_m: found -1; needed greater than 0"),
    ({**poster(), "sensor_origin": "zero"}, r"sensor_origin: found 'zero'; needed \[x, y, z\]"),
    (poster({"up": [0.0, 0.0, 0.0]}), r"prior: up is a zero vector; it needs to be a direction"),
    (poster(viewpoint=[1.0, 2.0]), r"regions\[0\]\.world\.viewpoint: found 2 numbers; needed \[x, y, z\]"),
    (poster(viewpoint=[3.0, 0.0, 0.0]), r"regions\[0\]\.world\.viewpoint: the viewpoint is .* off the region's plane"),
]


@pytest.mark.parametrize(("values", "said"), REFUSED)
def test_what_cannot_be_known_is_refused_with_its_line(values: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=rf"scene\.yaml:\d+: {said}"):
        estimate_scene(load_scene(write_scene(tmp_path, values)))
