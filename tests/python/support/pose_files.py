"""One pose as each tool writes it, with numbers of its own."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
from regionpose.geometry.pose import Pose

POSE = Pose.from_quat(np.array([0.43, -0.51, 0.52, 0.53]) / np.linalg.norm([0.43, -0.51, 0.52, 0.53]), [0.2, -0.3, 0.5])
PLACE = POSE.inverse()
X, Y, Z, W = PLACE.rotation.as_quat().tolist()
ROWS = POSE.matrix.tolist()
RECORD = {"token": "front", "sensor_token": "s", "camera_intrinsic": [[700, 0, 320], [0, 700, 240], [0, 0, 1]]}
NUSCENES = {**RECORD, "translation": PLACE.translation.tolist(), "rotation": [W, X, Y, Z]}


def transform(parent: str, child: str, pose: Pose) -> dict[str, Any]:
    """A transform of tf: the place of the frame `child` in its parent."""
    x, y, z, w = pose.rotation.as_quat().tolist()
    shift = dict(zip("xyz", pose.translation.tolist(), strict=True))
    turn = {"x": x, "y": y, "z": z, "w": w}
    return {
        "header": {"frame_id": parent},
        "child_frame_id": child,
        "transform": {"translation": shift, "rotation": turn},
    }


def matrix_text(values: Any, between: str) -> str:
    """Rows of numbers."""
    return "".join(between.join(str(value) for value in row) + "\n" for row in values)


BASE = Pose.from_quat([0.0, 0.0, 1.0, 0.0], [1.0, 2.0, 0.0])
FAST_CALIB = f"cam_fx: 700\nRcl: {POSE.matrix[:3, :3].ravel().tolist()}\nPcl: {POSE.translation.tolist()}\n"
OPENCALIB = {
    "sensor_name": "top_lidar",
    "target_sensor_name": "front_camera",
    "param": {"sensor_calib": {"rows": 4, "cols": 4, "data": ROWS}},
}
FILES: dict[str, tuple[str, str]] = {
    "commas.txt": (matrix_text(ROWS, ", "), "matrix"),
    "brackets.txt": (str(ROWS), "matrix"),
    "calib.txt": (
        f"K: 700 0 320 0 700 240 0 0 1\nD: 0 0 0 0 0\nT: {' '.join(str(value) for value in POSE.matrix[:3].ravel())}\n",
        "OpenCalib calib.txt",
    ),
    "record.json": (json.dumps([NUSCENES]), "nuScenes calibrated_sensor"),
    "one.json": (json.dumps(NUSCENES), "nuScenes calibrated_sensor"),
    "camchain.yaml": (f"cam0:\n  T_cam_imu: {ROWS}\n  camera_model: pinhole\n", "Kalibr camchain with T_cam_imu"),
    "fast.txt": (FAST_CALIB, "FAST-Calib Rcl and Pcl"),
    "nested.yaml": (
        f"extrin_calib:\n  Rcl: {POSE.matrix[:3, :3].tolist()}\n  Pcl: {POSE.translation.tolist()}\n",
        "FAST",
    ),
    "tf.yaml": (json.dumps({"transforms": [transform("lidar", "camera_optical", PLACE)]}), "ROS tf_static"),
    "tf_other_way.json": (json.dumps({"transforms": [transform("camera_optical", "lidar", POSE)]}), "ROS tf_static"),
    "tf_one.json": (json.dumps(transform("map", "cam_optical_frame", PLACE)), "ROS tf_static"),
    "tf_tree.json": (
        json.dumps(
            {
                "transforms": [
                    transform("base", "camera_optical", BASE @ PLACE),
                    transform("base", "velodyne", BASE),
                    transform("base", "imu", POSE),
                ]
            }
        ),
        "ROS tf_static",
    ),
    "open3d.json": (json.dumps({"extrinsic": POSE.matrix.T.ravel().tolist(), "intrinsic": {}}), "Open3D"),
    "extrinsic.json": (json.dumps({"top_lidar-to-front_camera-extrinsic": OPENCALIB}), "OpenCalib extrinsic.json"),
    "images.txt": (
        "# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n1 1 0 0 0 0 0 0 1 other.png\n1 2 3 4 5 6 7 8 9 10\n"
        f"2 {' '.join(str(value) for value in np.roll(POSE.rotation.as_quat(), 1))}"
        f" {' '.join(str(value) for value in POSE.translation)} 1 a photo.png\n\n",
        "COLMAP images.txt",
    ),
}
