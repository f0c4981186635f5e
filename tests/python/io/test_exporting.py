"""Poses in the files of other tools, read back by these tools' own conventions."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import regionpose as rp
from numpy.typing import NDArray
from regionpose import FisheyeCamera, PinholeCamera, Pose, load_camera
from regionpose.cameras import Camera, OcamCamera, UnifiedCamera
from regionpose.cli import main
from regionpose.io.exports import FORMATS, ExportedView, exported
from regionpose.io.exports.view import camera_of_values, camera_values
from regionpose.io.yaml_text import plain_value, yaml_node
from scipy.spatial.transform import Rotation

POSE = Pose(Rotation.from_euler("xyz", [100.0, -20.0, 35.0], degrees=True), np.array([0.3, -1.2, 2.5]))
PINHOLE = PinholeCamera(
    800.0, 810.0, 639.5, 355.25, width=1280, height=720, distortion=(-0.1, 0.02, 0.001, -0.002, 0.003)
)
FISHEYE = FisheyeCamera(400.0, 401.0, 639.5, 355.25, distortion=(0.1, -0.01, 0.002, 0.0), width=1280, height=720)
UNIFIED = UnifiedCamera(
    600.0, 601.0, 639.5, 355.25, xi=0.9, distortion=(-0.1, 0.02, 0.001, -0.002), width=1280, height=720
)
OCAM = OcamCamera((250.0, 0.0, -0.001), (640.0, 360.0), width=1280, height=720)
POINTS = POSE.inverse().transform(np.random.default_rng(0).uniform([-2, -1, 3], [2, 1, 8], (20, 3)))
Matrix = NDArray[np.float64]


def view(camera: Camera | None = None, **more: Any) -> ExportedView:
    return ExportedView(POSE, camera, "photo.jpg", **more)


def seen(rotation: Any, translation: Any) -> Matrix:
    """The test's points in a frame that a file places in the world."""
    return np.asarray((POINTS - np.asarray(translation)) @ np.asarray(rotation))


def optical(body: bool) -> Matrix:
    """The test's points as the camera sees them, in ROS' body axes where asked: x is the depth."""
    points = POSE.transform(POINTS)
    return np.stack([points[:, 2], -points[:, 0], -points[:, 1]], axis=1) if body else points


@pytest.mark.parametrize("body", [False, True])
def test_tf2_places_the_camera_in_the_cloud_s_frame(body: bool) -> None:
    words = shlex.split(exported(view(body=body), "tf2")["static_transform.sh"].splitlines()[1])
    value = {words[at]: words[at + 1] for at in range(4, len(words), 2)}
    assert (value["--frame-id"], value["--child-frame-id"]) == ("lidar", "camera")
    turn = Rotation.from_quat([float(value[f"--q{axis}"]) for axis in "xyzw"]).as_matrix()
    place = [float(value[f"--{axis}"]) for axis in "xyz"]
    np.testing.assert_allclose(seen(turn, place), optical(body), atol=1e-12)


def fixed_axes(roll: float, pitch: float, yaw: float) -> Matrix:
    """The rotation of URDF: about x, then y, then z, all fixed."""
    (cr, sr), (cp, sp), (cy, sy) = ((np.cos(a), np.sin(a)) for a in (roll, pitch, yaw))
    about_x = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    about_y = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    return np.asarray(np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]]) @ about_y @ about_x)


@pytest.mark.parametrize("body", [False, True])
def test_a_urdf_joint_places_the_camera_in_the_cloud_s_frame(body: bool) -> None:
    joint = ElementTree.fromstring(exported(view(body=body), "urdf")["camera_joint.urdf"].split("-->")[1])
    origin = joint.find("origin")
    assert origin is not None
    turn = fixed_axes(*map(float, origin.attrib["rpy"].split()))
    np.testing.assert_allclose(
        seen(turn, [float(word) for word in origin.attrib["xyz"].split()]), optical(body), atol=1e-12
    )


def test_autoware_gets_a_body_frame_by_roll_pitch_and_yaw() -> None:
    text = exported(view(body=True), "autoware")["sensors_calibration.yaml"]
    held = plain_value(yaml_node(text))["lidar"]["camera"]
    turn = fixed_axes(held["roll"], held["pitch"], held["yaw"])
    np.testing.assert_allclose(seen(turn, [held["x"], held["y"], held["z"]]), optical(True), atol=1e-12)


@pytest.mark.parametrize("camera", [None, PINHOLE, FISHEYE])
def test_opencv_gets_rvec_and_tvec(camera: Camera | None, tmp_path: Path) -> None:
    text = exported(view(camera), "opencv")["pose.yml"]
    held = {
        name: np.array([float(word) for word in data.split(",")])
        for name, data in re.findall(r"(\w+): !!opencv-matrix\n.*\n.*\n.*\n   data: \[ (.*) \]", text)
    }
    x, y, z = held["rvec"]
    angle = float(np.linalg.norm(held["rvec"]))
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) / angle
    rodrigues = np.eye(3) + np.sin(angle) * skew + (1.0 - np.cos(angle)) * skew @ skew
    np.testing.assert_allclose(POINTS @ rodrigues.T + held["tvec"], optical(False), atol=1e-12)
    if camera is not None:
        (tmp_path / "pose.yml").write_text(text, encoding="utf-8")
        model = "fisheye" if isinstance(camera, FisheyeCamera) else "pinhole"
        read = load_camera(tmp_path / "pose.yml", model=model)
        np.testing.assert_allclose(read.project(optical(False)), camera.project(optical(False)), atol=1e-9)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE])
def test_colmap_s_text_model_projects_as_the_camera_does(camera: Camera, tmp_path: Path) -> None:
    files = exported(view(camera), "colmap")
    line = files["images.txt"].splitlines()[1].split()
    assert (line[0], line[8], line[9]) == ("1", "1", "photo.jpg")
    w, x, y, z = map(float, line[1:5])
    points = Rotation.from_quat([x, y, z, w]).apply(POINTS) + np.array(line[5:8], dtype=float)
    np.testing.assert_allclose(points, optical(False), atol=1e-12)
    (tmp_path / "cameras.txt").write_text(files["cameras.txt"], encoding="utf-8")
    read = load_camera(tmp_path / "cameras.txt")
    np.testing.assert_allclose(read.project(points), camera.project(points), atol=1e-9)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE])
def test_nerfstudio_s_camera_looks_along_minus_z_with_y_up(camera: PinholeCamera | FisheyeCamera) -> None:
    held = json.loads(exported(view(camera), "nerfstudio")["transforms.json"])
    matrix = np.array(held["frames"][0]["transform_matrix"])
    points = seen(matrix[:3, :3], matrix[:3, 3]) * [1.0, -1.0, -1.0]
    np.testing.assert_allclose(points, optical(False), atol=1e-12)
    assert held["cx"] == camera.cx + 0.5
    assert held["camera_model"] == ("OPENCV_FISHEYE" if isinstance(camera, FisheyeCamera) else "OPENCV")


@pytest.mark.parametrize(
    "camera",
    [
        PinholeCamera(800.0, 810.0, 639.5, 355.25, width=1280, height=720, distortion=(-0.1, 0.02, 0.001, -0.002)),
        FISHEYE,
        UNIFIED,
    ],
)
def test_kalibr_s_camchain_is_read_back(camera: Camera, tmp_path: Path) -> None:
    text = exported(view(camera), "kalibr")["camchain.yaml"]
    (tmp_path / "camchain.yaml").write_text(text, encoding="utf-8")
    matrix = np.array(plain_value(yaml_node(text))["cam0"]["T_cam_imu"])
    np.testing.assert_allclose(matrix, POSE.matrix, atol=0)
    read = load_camera(tmp_path / "camchain.yaml")
    np.testing.assert_allclose(read.project(optical(False)), camera.project(optical(False)), atol=1e-9)


def test_nuscenes_places_the_sensor_with_the_quaternion_s_real_part_first() -> None:
    ideal = PinholeCamera(800.0, 810.0, 639.5, 355.25, width=1280, height=720)
    (held,) = json.loads(exported(view(ideal), "nuscenes")["calibrated_sensor.json"])
    w, x, y, z = held["rotation"]
    turn = Rotation.from_quat([x, y, z, w]).as_matrix()
    points = seen(turn, held["translation"])
    np.testing.assert_allclose(points, optical(False), atol=1e-12)
    pixels = points @ np.array(held["camera_intrinsic"]).T
    np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], ideal.project(points), atol=1e-9)


def test_meshlab_s_camera_projects_as_vcglib_does() -> None:
    camera = PinholeCamera(800.0, 810.0, 639.5, 355.25, width=1280, height=720)
    text = exported(view(camera), "meshlab")["camera.xml"].split("\n", 1)[1]
    held = next(iter(ElementTree.fromstring(text))).attrib
    rows = np.array(held["RotationMatrix"].split(), dtype=float).reshape(4, 4)[:3, :3]
    center = -np.array(held["TranslationVector"].split(), dtype=float)[:3]
    # Shot::Project: local = R (p - c); focal * local / -z over the pixel's size, plus the center, from the lower left.
    local = (POINTS - center) @ rows.T
    size, middle = (np.array(held[key].split(), dtype=float) for key in ("PixelSizeMm", "CenterPx"))
    across, up = (float(held["FocalMm"]) * local[:, :2] / -local[:, 2:] / size + middle).T
    pixels = np.stack([across - 0.5, 720.0 - up - 0.5], axis=1)
    np.testing.assert_allclose(pixels, camera.project(optical(False)), atol=1e-9)


@pytest.mark.parametrize("name", ["colmap", "nerfstudio", "kalibr", "nuscenes", "meshlab"])
def test_a_format_without_its_camera_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="found no camera"):
        exported(ExportedView(POSE), name)
    with pytest.raises(ValueError, match="OcamCamera"):
        exported(view(OCAM), name)


@pytest.mark.parametrize("name", ["nuscenes", "meshlab"])
def test_a_format_without_distortion_refuses_a_camera_that_has_some(name: str) -> None:
    with pytest.raises(ValueError, match="undistorted"):
        exported(view(PINHOLE), name)


@pytest.mark.parametrize("camera", [PINHOLE, FISHEYE, UNIFIED, OCAM])
def test_a_camera_written_out_is_read_back(camera: Camera) -> None:
    assert camera_of_values(json.loads(json.dumps(camera_values(camera)))) == camera


@pytest.mark.parametrize("name", sorted(FORMATS))
def test_the_command_writes_every_format_of_a_result(name: str, tmp_path: Path) -> None:
    result = {"camera_from_world": {"matrix": POSE.matrix.tolist()}, "image": "photo.jpg"}
    plain = PinholeCamera(800.0, 810.0, 639.5, 355.25, width=1280, height=720)
    (tmp_path / "result.json").write_text(json.dumps(result | {"camera": camera_values(plain)}), encoding="utf-8")
    arguments = ["export", str(tmp_path / "result.json"), "--format", name]
    assert main([*arguments, "--out", str(tmp_path / "made")]) == 0
    assert main([*arguments, "--out", str(tmp_path / "made")]) == 2
    assert main(arguments) == 0
    body = exported(ExportedView(POSE, plain, "../photo.jpg", body=name == "autoware"), name)
    assert {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "made").iterdir()} == body


def written_photo(folder: Path, *words: str) -> str:
    """The path of the photo in nerfstudio's file of a folder's result."""
    assert main(["export", str(folder / "result.json"), "--format", "nerfstudio", *words]) == 0
    return str(json.loads((folder.parent / "made" / "transforms.json").read_text())["frames"][0]["file_path"])


def test_the_photo_s_path_leads_from_the_written_file_to_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A result in one folder, its photo in a second one, the export in a third."""
    folder, photo = tmp_path / "result", tmp_path / "photos" / "photo.jpg"
    folder.mkdir()
    photo.parent.mkdir()
    plain = PinholeCamera(800.0, 810.0, 639.5, 355.25, width=1280, height=720)
    result = {"camera_from_world": {"matrix": POSE.matrix.tolist()}, "image": "../photos/photo.jpg"}
    (folder / "result.json").write_text(json.dumps(result | {"camera": camera_values(plain)}), encoding="utf-8")
    words = "--out", str(tmp_path / "made")
    path = written_photo(folder, *words)
    assert (tmp_path / "made" / path).resolve() == photo.resolve() and path == "../photos/photo.jpg"
    (tmp_path / "made" / "deep").mkdir()
    colmap = tmp_path / "made" / "deep" / "sparse"
    assert main(["export", str(folder / "result.json"), "--format", "colmap", "--out", str(colmap)]) == 0
    assert "1 ../../../photos/photo.jpg\n" in (colmap / "images.txt").read_text()
    assert written_photo(folder, *words, "--image", "photo.jpg", "--force") == "photo.jpg"
    monkeypatch.chdir(tmp_path / "photos")
    capsys.readouterr()
    assert main(["export", str(folder / "result.json"), "--format", "nerfstudio"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"][0]["file_path"] == "photo.jpg"


def test_a_frame_s_name_cannot_carry_a_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "result.json").write_text(json.dumps({"camera_from_world": {"matrix": POSE.matrix.tolist()}}))
    arguments = ["export", str(tmp_path / "result.json"), "--format", "tf2", "--camera-frame", "a; rm -rf /"]
    assert main(arguments) == 2
    assert "--camera-frame" in capsys.readouterr().err


def test_a_pose_is_written_from_python_as_by_the_command(tmp_path: Path) -> None:
    (path,) = rp.io.write_pose(tmp_path / "ros", POSE, "autoware", world_frame="base")
    assert path.read_text(encoding="utf-8") == exported(view(body=True, world_frame="base"), "autoware")[path.name]
    with pytest.raises(FileExistsError):
        rp.io.write_pose(tmp_path / "ros", POSE, "autoware", world_frame="base")
    with pytest.raises(ValueError, match="camera_frame"):
        rp.io.write_pose(tmp_path, POSE, "tf2", camera_frame="a; rm -rf /")
    with pytest.raises(ValueError, match="tf2"):
        rp.io.write_pose(tmp_path, POSE, "no-such-tool")


def test_autoware_has_a_body_frame_in_any_case() -> None:
    assert exported(view(), "autoware") == exported(view(body=True), "autoware")
