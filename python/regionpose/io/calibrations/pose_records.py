"""Poses in the YAML and JSON of other tools: how each is recognized, its direction, and its quaternion's order."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from regionpose.geometry.pose import Pose
from regionpose.io.calibrations.frames import tf_pose, transforms_of
from regionpose.io.calibrations.pose_values import (
    LEAST_NORM,
    Names,
    Read,
    chosen,
    numbers_of,
    pose_of_matrix,
    pose_of_quaternion,
)

GRAPHICS_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0, 1.0])
"""Axes of OpenGL's cameras: x right, y up, looking along -z."""


@dataclass(frozen=True)
class PoseRecord:
    """A kind of record: its name, the test that recognizes it, and its reader."""

    label: str
    describes: Callable[[Any], bool]
    read: Callable[[Path, Any, Names], Read]


def _has(*keys: str) -> Callable[[Any], bool]:
    """Whether a value is a mapping with these keys."""
    return lambda value: isinstance(value, dict) and all(key in value for key in keys)


def _is_result(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and isinstance(value.get("camera_from_world"), dict)
        and "matrix" in value["camera_from_world"]
    )


def _result(path: Path, value: Any, names: Names) -> Read:
    matrix = numbers_of(path, "camera_from_world.matrix", value["camera_from_world"]["matrix"])
    return matrix, "takes points of the world to the camera: x right, y down, z forward"


def _dvlc(path: Path, value: Any, names: Names) -> Read:
    numbers = numbers_of(path, "T_lidar_camera", value["T_lidar_camera"])
    if numbers.shape != (7,) or np.linalg.norm(numbers[3:]) < LEAST_NORM:
        found = numbers.tolist()
        raise ValueError(f"{path}: T_lidar_camera: found {found}; needed [tx, ty, tz, qx, qy, qz, qw]")
    pose = pose_of_quaternion(path, "T_lidar_camera", numbers[3:], numbers[:3])
    return pose.inverse(), "the camera's place in the lidar's frame, quaternion x y z w"


def _is_nuscenes(value: Any) -> bool:
    records = value if isinstance(value, list) else [value]
    return bool(records) and all(_has("token", "translation", "rotation")(one) for one in records)


def _nuscenes(path: Path, value: Any, names: Names) -> Read:
    records = value if isinstance(value, list) else [value]
    cameras = {str(one["token"]): one for one in records if one.get("camera_intrinsic")}
    if not cameras:
        raise ValueError(f"{path}: calibrated_sensor: found no record with camera_intrinsic; needed a camera's")
    record = chosen(path, cameras, names, "cameras of calibrated_sensor")
    w, x, y, z = numbers_of(path, "rotation", record["rotation"], 4)
    place = numbers_of(path, "translation", record["translation"], 3)
    pose = pose_of_quaternion(path, "rotation", np.array([x, y, z, w]), place)
    return pose.inverse(), "the sensor's place in the vehicle's frame, quaternion w x y z: the cloud is in that frame"


def _is_camchain(value: Any) -> bool:
    return isinstance(value, dict) and any(_has("T_cam_imu")(one) for one in value.values())


def _kalibr(path: Path, value: Any, names: Names) -> Read:
    cameras = {str(key): one for key, one in value.items() if _has("T_cam_imu")(one)}
    camera = chosen(path, cameras, names, "cameras with T_cam_imu")
    matrix = numbers_of(path, "T_cam_imu", camera["T_cam_imu"], 16)
    return matrix, "T_cam_imu takes points of the IMU's frame to the camera: the cloud is in that frame"


def _opencv(path: Path, value: Any, names: Names) -> Read:
    from scipy.spatial.transform import Rotation

    turn, shift = (numbers_of(path, key, value[key], 3) for key in ("rvec", "tvec"))
    return Pose(Rotation.from_rotvec(turn), shift), "rvec and tvec take points of the world to the camera"


def _fast_calib(path: Path, value: Any, names: Names) -> Read:
    turn = numbers_of(path, "Rcl", value["Rcl"], 9).reshape(3, 3)
    return np.column_stack(
        [turn, numbers_of(path, "Pcl", value["Pcl"], 3)]
    ), "Rcl, Pcl take the lidar's points to the camera"


def _is_open3d(value: Any) -> bool:
    return _has("extrinsic", "intrinsic")(value)


def _open3d(path: Path, value: Any, names: Names) -> Read:
    columns = numbers_of(path, "extrinsic", value["extrinsic"], 16).reshape(4, 4)
    return columns.T, "extrinsic takes points of the world to the camera, column by column"


def _is_nerfstudio(value: Any) -> bool:
    frames = value.get("frames") if isinstance(value, dict) else None
    return isinstance(frames, list) and any(_has("transform_matrix")(one) for one in frames)


def _nerfstudio(path: Path, value: Any, names: Names) -> Read:
    frames = [one for one in value["frames"] if _has("transform_matrix")(one)]
    paths = {str(one.get("file_path", index)): one for index, one in enumerate(frames)}
    files = {Path(key).name: one for key, one in paths.items()}
    candidates = files if any(name in files for name in names) else paths
    frame = chosen(path, candidates, names, "frames with transform_matrix")
    placed = pose_of_matrix(path, numbers_of(path, "transform_matrix", frame["transform_matrix"], 16), "a matrix")
    turned = GRAPHICS_FROM_OPTICAL @ placed.inverse().matrix
    return turned, "transform_matrix is the camera's place in the world, with OpenGL's axes"


def _is_opencalib(value: Any) -> bool:
    return _has("sensor_name", "target_sensor_name", "param")(value) and _has("sensor_calib")(value["param"])


def _opencalib(path: Path, value: Any, names: Names) -> Read:
    first, second = str(value["sensor_name"]), str(value["target_sensor_name"])
    if "cam" not in second.lower():
        raise ValueError(
            f"{path}: target_sensor_name: found {second!r}; needed a camera: the matrix takes points of {first} to it"
        )
    return numbers_of(path, "sensor_calib", value["param"]["sensor_calib"], 16), f"takes points of {first} to {second}"


def is_unordered(value: Any) -> bool:
    """Whether there are extrinsics by a quaternion whose order, real part first or last, is not stated."""
    extrinsics = value.get("extrinsics") if isinstance(value, dict) else None
    turn = extrinsics.get("rotation") if isinstance(extrinsics, dict) else None
    return isinstance(turn, Sequence) and len(turn) == 4


RECORDS: tuple[PoseRecord, ...] = (
    PoseRecord("camera_from_world of result.json", _is_result, _result),
    PoseRecord("T_lidar_camera of direct_visual_lidar_calibration", _has("T_lidar_camera"), _dvlc),
    PoseRecord("nuScenes calibrated_sensor", _is_nuscenes, _nuscenes),
    PoseRecord("Kalibr camchain with T_cam_imu", _is_camchain, _kalibr),
    PoseRecord("ROS tf_static", lambda value: bool(transforms_of(value)), tf_pose),
    PoseRecord("OpenCV rvec and tvec", _has("rvec", "tvec"), _opencv),
    PoseRecord("FAST-Calib Rcl and Pcl", _has("Rcl", "Pcl"), _fast_calib),
    PoseRecord("nerfstudio transforms.json", _is_nerfstudio, _nerfstudio),
    PoseRecord("Open3D PinholeCameraParameters", _is_open3d, _open3d),
    PoseRecord("OpenCalib extrinsic.json", _is_opencalib, _opencalib),
)
