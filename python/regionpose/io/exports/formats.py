"""The files of each tool, by name. Each states its conventions in a comment where the format allows one."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from regionpose.cameras import (
    Camera,
    FisheyeCamera,
    OcamCamera,
    PinholeCamera,
    UnifiedCamera,
    camera_to_colmap,
)
from regionpose.cameras.colmap import CORNER_TO_CENTER
from regionpose.io.exports.view import ExportedView
from regionpose.validation.arrays import Array

Files = dict[str, str]

GRAPHICS_FROM_OPTICAL = np.diag([1.0, -1.0, -1.0])
"""Axes of OpenGL's cameras: x right, y up, looking along -z."""

SENSOR_PIXEL_MM = 0.001
"""Pixel size written to MeshLab files, mm; only its product with the focal length in pixels matters."""


@dataclass(frozen=True)
class Format:
    """A format: what it is, and how its files are made of a view."""

    meaning: str
    files: Callable[[ExportedView], Files]


def exported(view: ExportedView, name: str) -> Files:
    """The files of a format, text by file name; ValueError for an unknown one, or where it wants what isn't known."""
    if name not in FORMATS:
        raise ValueError(f"format: found {name!r}; needed one of {', '.join(FORMATS)}")
    return FORMATS[name].files(view)


def _tf2(view: ExportedView) -> Files:
    turn, place = view.world_from_frame
    x, y, z = (_number(value) for value in place)
    qx, qy, qz, qw = (_number(value) for value in turn.as_quat(canonical=True))
    line = (
        f"ros2 run tf2_ros static_transform_publisher --x {x} --y {y} --z {z} --qx {qx} --qy {qy} --qz {qz} --qw {qw}"
        f" --frame-id {view.world_frame} --child-frame-id {view.camera_frame}\n"
    )
    return {"static_transform.sh": f"# {_frames(view)}\n{line}"}


def _urdf(view: ExportedView) -> Files:
    turn, place = view.world_from_frame
    roll, pitch, yaw = turn.as_euler("xyz")
    text = f"""<!-- {_frames(view)} -->
<joint name="{view.camera_frame}_joint" type="fixed">
  <parent link="{view.world_frame}"/>
  <child link="{view.camera_frame}"/>
  <origin xyz="{_row(place)}" rpy="{_row([roll, pitch, yaw])}"/>
</joint>
"""
    return {"camera_joint.urdf": text}


def _autoware(view: ExportedView) -> Files:
    view = replace(view, body=True)
    turn, place = view.world_from_frame
    values = dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), [*place, *turn.as_euler("xyz")], strict=True))
    rows = "".join(f"    {key}: {_number(value)}\n" for key, value in values.items())
    text = f"# {_frames(view)} Meters and radians.\n{view.world_frame}:\n  {view.camera_frame}:\n{rows}"
    return {"sensors_calibration.yaml": text}


def _opencv(view: ExportedView) -> Files:
    parts = {"rvec": view.pose.rotation.as_rotvec()[:, None], "tvec": view.pose.translation[:, None]}
    if isinstance(view.camera, PinholeCamera | FisheyeCamera):
        parts |= {"camera_matrix": _matrix(view.camera), "distortion_coefficients": _opencv_coefficients(view.camera)}
    note = "# x_camera = Rodrigues(rvec) x_world + tvec, meters; x right, y down, z forward\n"
    return {"pose.yml": f"%YAML:1.0\n---\n{note}" + "".join(_opencv_matrix(*part) for part in parts.items())}


def _opencv_matrix(name: str, values: Array) -> str:
    data = ", ".join(_number(value) for value in values.ravel())
    rows, columns = values.shape
    return f"{name}: !!opencv-matrix\n   rows: {rows}\n   cols: {columns}\n   dt: d\n   data: [ {data} ]\n"


def _opencv_coefficients(camera: PinholeCamera | FisheyeCamera) -> Array:
    coefficients = camera.distortion or (0.0,) * 5
    return np.array([coefficients], dtype=np.float64)


def _colmap(view: ExportedView) -> Files:
    camera, image = view.required_camera("COLMAP"), view.required_image("COLMAP")
    model, _, _, parameters = camera_to_colmap(camera)
    x, y, z, w = view.pose.rotation.as_quat(canonical=True)
    placed = _row([w, x, y, z, *view.pose.translation])
    cameras = "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]; pixels from the first one's corner\n"
    cameras += f"1 {model} {camera.width} {camera.height} {_row(parameters)}\n"
    images = f"# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ (camera_from_world), CAMERA_ID, NAME\n1 {placed} 1 {image}\n\n"
    return {"cameras.txt": cameras, "images.txt": images, "points3D.txt": ""}


def _corner_intrinsics(camera: PinholeCamera | FisheyeCamera) -> list[float]:
    return [camera.fx, camera.fy, camera.cx + CORNER_TO_CENTER, camera.cy + CORNER_TO_CENTER]


def _nerfstudio(view: ExportedView) -> Files:
    camera, image = view.required_camera("nerfstudio"), view.required_image("nerfstudio")
    model = camera_to_colmap(camera)[0]
    assert isinstance(camera, PinholeCamera | FisheyeCamera)
    fx, fy, cx, cy = _corner_intrinsics(camera)
    coefficients = camera.distortion
    names = ("k1", "k2", "k3", "k4") if isinstance(camera, FisheyeCamera) else ("k1", "k2", "p1", "p2", "k3")
    if any(coefficients[len(names) :]):
        raise ValueError(f"nerfstudio: found {len(coefficients)} distortion coefficients; needed at most {len(names)}")
    inverse = view.pose.inverse()
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = inverse.rotation.as_matrix() @ GRAPHICS_FROM_OPTICAL, inverse.translation
    values = {
        "camera_model": "OPENCV_FISHEYE" if model == "OPENCV_FISHEYE" else "OPENCV",
        **{"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": camera.width, "h": camera.height},
        **dict(zip(names, coefficients, strict=False)),
        "frames": [{"file_path": image, "transform_matrix": placed.tolist()}],
    }
    return {"transforms.json": json.dumps(values, indent=2) + "\n"}


KALIBR_MODELS: dict[type[Camera], str] = {PinholeCamera: "pinhole", FisheyeCamera: "pinhole", UnifiedCamera: "omni"}


def _kalibr(view: ExportedView) -> Files:
    camera = view.required_camera("Kalibr")
    if isinstance(camera, OcamCamera) or not isinstance(camera, PinholeCamera | FisheyeCamera | UnifiedCamera):
        raise ValueError(f"Kalibr: found a {type(camera).__name__}; needed a pinhole, fisheye or unified camera")
    fisheye = isinstance(camera, FisheyeCamera)
    coefficients = list(camera.distortion or (0.0,) * 4)
    if any(coefficients[4:]):
        raise ValueError(f"Kalibr: found {len(coefficients)} distortion coefficients; needed at most 4")
    xi = [camera.xi] if isinstance(camera, UnifiedCamera) else []
    rows = "".join(f"  - [{', '.join(_number(value) for value in row)}]\n" for row in view.pose.matrix)
    text = (
        f"# T_cam_imu takes points of {view.world_frame} to the camera: x right, y down, z forward; meters\n"
        f"cam0:\n  camera_model: {KALIBR_MODELS[type(camera)]}\n"
        f"  intrinsics: [{_row([*xi, camera.fx, camera.fy, camera.cx, camera.cy], ', ')}]\n"
        f"  distortion_model: {'equidistant' if fisheye else 'radtan'}\n"
        f"  distortion_coeffs: [{_row(coefficients[:4], ', ')}]\n"
        f"  resolution: [{camera.width}, {camera.height}]\n  T_cam_imu:\n{rows}"
    )
    return {"camchain.yaml": text}


def _nuscenes(view: ExportedView) -> Files:
    camera = _undistorted(view, "nuScenes")
    inverse = view.pose.inverse()
    x, y, z, w = inverse.rotation.as_quat(canonical=True)
    values = {
        "token": view.camera_frame,
        "sensor_token": view.camera_frame,
        "translation": inverse.translation.tolist(),
        "rotation": [w, x, y, z],
        "camera_intrinsic": _matrix(camera).tolist(),
    }
    return {"calibrated_sensor.json": json.dumps([values], indent=2) + "\n"}


def _meshlab(view: ExportedView) -> Files:
    camera = _undistorted(view, "MeshLab")
    rows = np.eye(4)
    rows[:3, :3] = GRAPHICS_FROM_OPTICAL @ view.pose.rotation.as_matrix()
    center = np.append(-view.pose.camera_center, 1.0)
    attributes = {
        "TranslationVector": _row(center),
        "RotationMatrix": _row(rows.ravel()),
        "FocalMm": _number(camera.fx * SENSOR_PIXEL_MM),
        "PixelSizeMm": _row([SENSOR_PIXEL_MM, SENSOR_PIXEL_MM * camera.fx / camera.fy]),
        "ViewportPx": f"{camera.width} {camera.height}",
        # Counted from the lower left corner.
        "CenterPx": _row([camera.cx + CORNER_TO_CENTER, (camera.height or 0) - camera.cy - CORNER_TO_CENTER]),
        "LensDistortion": "0 0",
        "CameraType": "0",
        "BinaryData": "0",
    }
    written = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return {"camera.xml": f"<!DOCTYPE ViewState>\n<project>\n <VCGCamera {written}/>\n</project>\n"}


def _undistorted(view: ExportedView, tool: str) -> PinholeCamera:
    """The camera of a tool that knows no distortion; ValueError for one that has some."""
    camera = view.required_camera(tool)
    if not isinstance(camera, PinholeCamera):
        raise ValueError(f"{tool}: found a {type(camera).__name__}; needed a pinhole camera")
    if any(camera.distortion):
        raise ValueError(f"{tool}: found a camera with distortion; needed that of an undistorted photo")
    return camera


def _matrix(camera: PinholeCamera | FisheyeCamera) -> Array:
    return np.array([[camera.fx, 0.0, camera.cx], [0.0, camera.fy, camera.cy], [0.0, 0.0, 1.0]])


def _frames(view: ExportedView) -> str:
    axes = "x forward, y left, z up (body)" if view.body else "x right, y down, z forward (optical)"
    return f"The place of {view.camera_frame} in {view.world_frame}; axes of {view.camera_frame}: {axes}."


def _row(values: object, between: str = " ") -> str:
    return between.join(_number(value) for value in np.asarray(values, dtype=np.float64).ravel())


def _number(value: float) -> str:
    """A number that reads back to the same one."""
    return repr(float(value))


FORMATS: dict[str, Format] = {
    "tf2": Format("ROS 2: a line that publishes the static transform", _tf2),
    "urdf": Format("a fixed joint for a robot's description", _urdf),
    "autoware": Format("Autoware: x y z roll pitch yaw", _autoware),
    "opencv": Format("OpenCV: rvec and tvec, with the camera where it is known", _opencv),
    "colmap": Format("COLMAP: cameras.txt, images.txt, points3D.txt", _colmap),
    "nerfstudio": Format("nerfstudio: transforms.json", _nerfstudio),
    "kalibr": Format("Kalibr: camchain.yaml, the world in the IMU's place", _kalibr),
    "nuscenes": Format("nuScenes: calibrated_sensor, the world in the vehicle's place", _nuscenes),
    "meshlab": Format("MeshLab: a camera that its raster layers load", _meshlab),
}
"""The formats by name."""
