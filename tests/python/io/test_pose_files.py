"""Poses in the files of other tools: each as its tool defines direction and order, or an error; never another pose."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pose_files import FAST_CALIB, FILES, NUSCENES, OPENCALIB, PLACE, POSE, transform
from regionpose.cameras import PinholeCamera
from regionpose.cli.app import main
from regionpose.io.calibrations.poses import PoseSource, read_pose, read_pose_file
from regionpose.io.exports import ExportedView, exported

CAMERA = PinholeCamera(700.0, 705.0, 320.0, 240.0, width=640, height=480)


@pytest.mark.parametrize("file", FILES)
def test_a_pose_is_read_as_its_tool_defines_it(file: str, tmp_path: Path) -> None:
    text, kind = FILES[file]
    (tmp_path / file).write_text(text)
    held = read_pose_file(tmp_path / file, PoseSource(image="a photo.png"))
    assert np.abs(held.pose.matrix - POSE.matrix).max() < 1e-12
    assert held.kind.startswith(kind) and held.convention


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("opencv", "pose.yml"),
        ("colmap", "images.txt"),
        ("nerfstudio", "transforms.json"),
        ("kalibr", "camchain.yaml"),
        ("nuscenes", "calibrated_sensor.json"),
    ],
)
def test_what_is_exported_is_read_back(name: str, file: str, tmp_path: Path) -> None:
    view = ExportedView(POSE, CAMERA, "photo.png", "lidar", "camera", False)
    (tmp_path / file).write_text(exported(view, name)[file])
    assert np.abs(read_pose(tmp_path / file).matrix - POSE.matrix).max() < 1e-12


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        (
            "claim.json",
            json.dumps({"extrinsics": {"translation": [0, 0, 1], "rotation": [0.5, 0.5, 0.5, 0.5]}}),
            "extrinsics.rotation: found four numbers of a quaternion, but not whether w is the first",
        ),
        (
            "tf.json",
            json.dumps({"transforms": [transform("lidar", "camera_link", PLACE)]}),
            "frames: found lidar, camera_link; needed the optical frame of a camera",
        ),
        (
            "tf.json",
            json.dumps({"transforms": [transform("base", "a_optical", PLACE), transform("base", "b_optical", PLACE)]}),
            "frames: found base, a_optical, b_optical; needed one optical frame of a camera",
        ),
        (
            "tf.json",
            json.dumps({"transforms": [transform("base", "a_optical", PLACE), transform("base", "gps", PLACE)]}),
            "frames: found base, a_optical, gps; needed the frame of a lidar",
        ),
        (
            "tf.json",
            json.dumps({"transforms": [transform("base", "a_optical", PLACE), transform("map", "lidar", PLACE)]}),
            "frames: found no transforms from lidar to a_optical",
        ),
        (
            "two.json",
            json.dumps([NUSCENES, {**NUSCENES, "token": "back"}]),
            "cameras of calibrated_sensor: found 2; needed a name, one of front, back",
        ),
        (
            "chain.yaml",
            "cam0:\n  T_cn_cnm1: [1]\n  camera_model: pinhole\n",
            "found no pose of a known kind, but the items",
        ),
        ("chain.yaml", "cam0:\n  T_cam_imu: [1, 2]\n", "T_cam_imu: found 2 numbers; needed 16"),
        (
            "chain.yaml",
            f"cam0:\n  T_cam_imu: {(2 * POSE.matrix).tolist()}\n",
            r"found \|R\^T R - 1\| = 3.0e\+00; needed a",
        ),
        ("fast.yaml", FAST_CALIB.replace("Pcl: [0.2", "Pcl: [nan"), "Pcl: found numbers that aren't finite"),
        ("n.json", json.dumps({**NUSCENES, "rotation": [0, 0, 0, 0]}), "rotation: found a quaternion of zeros"),
        ("e.json", json.dumps({**OPENCALIB, "target_sensor_name": "imu"}), "found 'imu'; needed a camera"),
        ("l.json", "[1, 2]", "found no pose of a known kind, but a list; needed result.json"),
        ("l.yaml", "a: &a [1]\nb: *a\n", "found no pose of a known kind, but the items a, b"),
    ],
)
def test_a_pose_that_is_not_told_is_refused(file: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text(text)
    with pytest.raises(ValueError, match=message):
        read_pose(tmp_path / file)


def test_the_camera_name_chooses_among_poses(tmp_path: Path) -> None:
    records = [{**NUSCENES, "token": "back", "rotation": [1, 0, 0, 0]}, NUSCENES]
    (tmp_path / "s.json").write_text(json.dumps(records))
    pose = read_pose(tmp_path / "s.json", PoseSource(camera_name="front"))
    assert np.abs(pose.matrix - POSE.matrix).max() < 1e-12


def test_a_file_of_any_tool_cut_anywhere_is_read_or_refused(tmp_path: Path) -> None:
    for file, (text, _) in FILES.items():
        refused = 0
        for end in range(0, len(text), 1 + len(text) // 60):
            (tmp_path / file).write_text(text[:end])
            try:
                read_pose(tmp_path / file)
            except ValueError:
                refused += 1
        assert refused > 5


def test_info_says_what_a_pose_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "tf.yaml").write_text(FILES["tf.yaml"][0])
    assert main(["info", str(tmp_path / "tf.yaml"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["kind"], told["written_as"]) == ("pose", "ROS tf_static")
    assert told["meaning"] == "takes points of the frame lidar to camera_optical, quaternion x y z w"
    assert np.abs(np.array(told["camera_from_world"]) - POSE.matrix).max() < 1e-12
