"""Calibration files of more tools: one lens as each of them writes it, and what camera_info says of the photo."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calibration_files import (
    CALIB,
    FILES,
    LENS,
    METASHAPE,
    MRCAL,
    NAMED,
    NERFSTUDIO,
    NUSCENES,
    ORB,
    PIX4D,
    RAYS,
    SIZE,
    STORAGE,
    VINS,
)
from regionpose.cameras import Camera, EquirectangularCamera, FisheyeCamera, FovCamera, PinholeCamera, UnifiedCamera
from regionpose.cli.app import main
from regionpose.io.calibrations import CalibrationError, load_camera, load_lidar_pose
from regionpose.io.calibrations.kinds import calibration_kind


@pytest.mark.parametrize("file", FILES)
def test_one_lens_is_read_from_the_file_of_each_tool(file: str, tmp_path: Path) -> None:
    text, name, expected, kind = FILES[file]
    path = tmp_path / file
    path.write_text(text)
    camera = load_camera(path, name)
    assert type(camera) is type(expected)
    assert (camera.width, camera.height) == (expected.width, expected.height)
    assert np.abs(camera.project(RAYS) - expected.project(RAYS)).max() < 1e-9
    assert kind in calibration_kind(path)


@pytest.mark.parametrize("file", FILES)
def test_a_file_of_any_tool_cut_anywhere_is_read_or_refused(file: str, tmp_path: Path) -> None:
    text, name, _, _ = FILES[file]
    path = tmp_path / file
    refused = 0
    for end in range(0, len(text), 1 + len(text) // 120):
        path.write_text(text[:end])
        try:
            load_camera(path, name)
        except CalibrationError:
            refused += 1
    assert refused > 5


def dvlc(model: str, intrinsics: list[float], coefficients: list[float]) -> str:
    """A calib.json of direct_visual_lidar_calibration."""
    camera = {"camera_model": model, "intrinsics": intrinsics, "distortion_coeffs": coefficients}
    return json.dumps({"camera": camera})


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (dvlc("equirectangular", [1280, 640], []), EquirectangularCamera(width=1280, height=640)),
        (
            dvlc("fisheye", [500, 501, 640, 480], [0.1, 0, 0, 0]),
            FisheyeCamera(500, 501, 640, 480, distortion=(0.1, 0, 0, 0)),
        ),
        (dvlc("atan", [500, 501, 640, 480], [0.9]), FovCamera(500, 501, 640, 480, omega=0.9)),
        (dvlc("atan", [500, 501, 640, 480], [0.0]), PinholeCamera(500, 501, 640, 480)),
        (
            dvlc("omnidir", [900, 901, 640, 480, 1.5], [-0.1, 0.01, 1e-3, 0]),
            UnifiedCamera(900, 901, 640, 480, xi=1.5, distortion=(-0.1, 0.01, 1e-3, 0)),
        ),
    ],
)
def test_models_of_direct_visual_lidar_calibration(text: str, expected: Camera, tmp_path: Path) -> None:
    (tmp_path / "calib.json").write_text(text)
    assert load_camera(tmp_path / "calib.json") == expected


@pytest.mark.parametrize(
    ("file", "text", "message"),
    [
        ("a.json", dvlc("ds", [500, 500, 640, 480], [0.9]), "camera_model: found 'ds'; needed one of plumb_bob"),
        ("a.json", dvlc("plumb_bob", [500, 500, 640], [0.9]), "intrinsics: found 3 numbers; needed 4"),
        ("a.xml", METASHAPE.replace("<k1>", "<b2>0.5</b2><k1>"), "line 2: calibration: found b2 of 0.5; needed"),
        ("a.xml", METASHAPE.replace("frame", "cylindrical"), "projection: found 'cylindrical'; needed one of frame"),
        ("a.xml", METASHAPE.replace("<f>817.25</f>", "<f>wide</f>"), "line 6: f: found 'wide'; needed a number"),
        ("a.xml", METASHAPE.replace("</calibration>", ""), "XML: found no element found; needed XML that is whole"),
        ("a.xml", "<html><body/></html>", "found XML with the root html; needed one of these: COLMAP"),
        ("a.xml", "<!DOCTYPE a [<!ENTITY b 'c'>]><a>&b;</a>", "XML: found a document type; needed none"),
        ("a.xml", "<a>" * 60, "XML: found more than 50 levels"),
        (
            "a.xml",
            STORAGE.replace("-9e-4", "x"),
            r"line 8: distortion_coefficients.data\[3\]: found 'x'; needed a number",
        ),
        ("a.txt", PIX4D, "camera name: found none for 2 cameras; needed name= one of a photo.png, b.png"),
        ("a.cameramodel", MRCAL.replace("OPENCV4", "SPLINED"), "lensmodel: found LENSMODEL_SPLINED; needed one of"),
        ("a.cameramodel", MRCAL.replace("OPENCV4", "OPENCV8"), "intrinsics: found 8 numbers; needed 12 numbers"),
        ("a.cameramodel", MRCAL.replace("655.4", "open('x', 'w')"), "cameramodel: found Call; needed numbers, texts"),
        ("a.cameramodel", MRCAL.replace("655.4", "[" * 5000), "cameramodel: found .*; needed"),
        (
            "a.yaml",
            NAMED + "d0: 0.1\nd1: 0.2\n",
            "found coefficients d0, d1, ... and no model; needed model=pinhole or",
        ),
        (
            "a.yaml",
            NAMED + "k1: 0.1\nk2: 0.2\nk3: 0.1\nk4: 0.1\n",
            "found the coefficients k1, k2, k3, k4 and no model",
        ),
        ("a.yaml", VINS.replace("PINHOLE", "SCARAMUZZA"), "model_type: found 'SCARAMUZZA'; needed one of PINHOLE"),
        ("a.yaml", ORB.replace("PinHole", "Magic"), "found the model 'Magic'; needed one of pinhole"),
        ("a.txt", CALIB.replace("-0.0009 0", "-0.0009"), "D: found 4 coefficients and no model: a pinhole's"),
        ("a.json", json.dumps({**NERFSTUDIO, "k4": 0.1}), "found k4 other than 0 without a fisheye model"),
        ("a.json", json.dumps([*NUSCENES, {**NUSCENES[1], "token": "b"}]), "needed name= one of front, b"),
    ],
)
def test_what_is_refused_says_why(file: str, text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text(text)
    with pytest.raises(CalibrationError, match=message):
        load_camera(tmp_path / file)


def test_coefficients_without_a_model_are_read_in_the_model_that_the_caller_says(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(NAMED + "d0: 0.04\nd1: -0.01\nd2: 0.002\nd3: -0.0003\n")
    assert load_camera(path, model="pinhole").distortion == (0.04, -0.01, 0.002, -0.0003)  # type: ignore[attr-defined]
    assert isinstance(load_camera(path, model="fisheye"), FisheyeCamera)


INFO = """height: 736
width: 1296
distortion_model: {model}
D: [{d}]
K: [812.5, 0.0, 655.4, 0.0, 817.25, 371.9, 0.0, 0.0, 1.0]
R: [1, 0, 0, 0, 1, 0, 0, 0, 1]
P: [790.5, 0.0, 650.25, 0.0, 0.0, 795.0, 366.75, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: {binning}
binning_y: {binning}
roi: {{x_offset: {x}, y_offset: {y}, height: {rows}, width: {columns}, do_rectify: false}}
"""


def info(folder: Path, *, model: str = "plumb_bob", d: str = "-0.11, 0.035, 7.0e-4, -9.0e-4", **window: int) -> Path:
    """A camera_info, as `ros2 topic echo` prints it."""
    values = {"binning": 0, "x": 0, "y": 0, "rows": 0, "columns": 0, **window}
    path = folder / "info.yaml"
    path.write_text(INFO.format(model=model, d=d, **values))
    return path


@pytest.mark.parametrize(
    ("model", "d", "distortion"),
    [
        ("plumb_bob", "-0.11, 0.035, 0.001, 0.002, 0.01, 0, 0, 0", (-0.11, 0.035, 0.001, 0.002, 0.01)),
        (
            "rational_polynomial",
            "4.6, 1.3, 0.001, 0.002, 0.03, 5.0, 2.9, 0.2, 0, 0, 0, 0, 0, 0",
            (4.6, 1.3, 0.001, 0.002, 0.03, 5.0, 2.9, 0.2),
        ),
        (
            "rational_polynomial",
            "4.6, 1.3, 0.001, 0.002, 0.03, 5.0, 2.9, 0.2, 0.01, 0, 0, 0.02",
            (4.6, 1.3, 0.001, 0.002, 0.03, 5.0, 2.9, 0.2, 0.01, 0, 0, 0.02),
        ),
        ("''", "", ()),
    ],
)
def test_camera_infos_of_drivers(model: str, d: str, distortion: tuple[float, ...], tmp_path: Path) -> None:
    assert load_camera(info(tmp_path, model=model, d=d)) == replace(LENS, distortion=distortion)


def test_what_opencv_calibrates_with_all_coefficients_is_read(tmp_path: Path) -> None:
    """cv2.calibrateCamera gives 14 with CALIB_TILTED_MODEL: read, and projected as OpenCV does."""
    cv2 = pytest.importorskip("cv2")
    d = np.array([0.3, 0.1, 1e-3, -2e-3, 0.02, 0.4, 0.1, 0.01, 0.01, -0.02, 0.03, 0.005, 0.07, -0.11])
    storage = cv2.FileStorage(str(tmp_path / "c.yml"), cv2.FILE_STORAGE_WRITE)
    storage.write("camera_matrix", LENS.matrix)
    storage.write("distortion_coefficients", d[None])
    storage.release()
    expected, _ = cv2.projectPoints(RAYS, np.zeros(3), np.zeros(3), LENS.matrix, d)
    assert np.abs(load_camera(tmp_path / "c.yml").project(RAYS) - expected[:, 0]).max() < 1e-9


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"d": "-0.11, 0.035, 0, 0, 0, 0.1, 0, 0"},
            "D: found 8 numbers with k4, k5 or k6 other than 0; needed 5 numbers",
        ),
        ({"model": "''"}, "distortion_model: found ''; needed one of plumb_bob"),
    ],
)
def test_camera_infos_that_contradict_themselves_are_refused(
    changes: dict[str, str], message: str, tmp_path: Path
) -> None:
    with pytest.raises(CalibrationError, match=message):
        load_camera(info(tmp_path, **changes))  # type: ignore[arg-type]


def test_a_camera_that_is_not_calibrated_says_so(tmp_path: Path) -> None:
    """Drivers publish zeros, no model and no coefficients until they are given a calibration."""
    path = tmp_path / "info.yaml"
    path.write_text(f"height: 736\nwidth: 1296\ndistortion_model: ''\nd:\nk: [{', '.join(['0.0'] * 9)}]\n")
    with pytest.raises(CalibrationError, match="line 5: k: found zeros: the camera is not calibrated"):
        load_camera(path)


def test_a_binned_photo_has_the_scaled_camera(tmp_path: Path) -> None:
    """K is of the full picture; a pixel of the photo holds 2 x 2 of its pixels, whose corners stay corners."""
    camera = load_camera(info(tmp_path, binning=2))
    assert camera == replace(LENS, fx=406.25, fy=408.625, cx=327.45, cy=185.7, width=648, height=368)


def test_a_window_of_the_sensor_moves_the_center(tmp_path: Path) -> None:
    camera = load_camera(info(tmp_path, x=100, y=40, columns=1000, rows=600))
    assert camera == replace(LENS, cx=555.4, cy=331.9, width=1000, height=600)
    camera = load_camera(info(tmp_path, x=100, y=40, columns=1000, rows=600, binning=4))
    assert camera.project([[0, 0, 1.0]])[0] == pytest.approx([(555.9 / 4) - 0.5, (332.4 / 4) - 0.5])
    assert (camera.width, camera.height) == (250, 150)


def test_a_matrix_of_the_binned_picture_is_refused(tmp_path: Path) -> None:
    path = info(tmp_path, binning=4)
    path.write_text(path.read_text().replace("812.5", "203.1").replace("655.4", "163.4").replace("371.9", "92.6"))
    with pytest.raises(CalibrationError, match=r"binning_x: found binning beside a matrix .* of 324 x 184"):
        load_camera(path)


def test_a_rectified_photo_has_the_projection_matrix_and_no_distortion(tmp_path: Path) -> None:
    path = info(tmp_path)
    rectified = PinholeCamera(790.5, 795.0, 650.25, 366.75, **SIZE)
    assert load_camera(path, rectified=True) == rectified
    assert load_camera(info(tmp_path, model="equidistant", d="0.1, 0, 0, 0"), rectified=True) == rectified
    binned = load_camera(info(tmp_path, binning=2), rectified=True)
    assert binned == rectified.resized(648, 368)
    path.write_text(path.read_text().partition("P:")[0])
    with pytest.raises(CalibrationError, match="needed an item projection_matrix or P or p"):
        load_camera(path, rectified=True)


def test_a_file_that_knows_no_rectified_photos_says_so(tmp_path: Path) -> None:
    (tmp_path / "vins.yaml").write_text(VINS)
    with pytest.raises(
        CalibrationError, match="rectified: found a file of the kind VINS YAML; needed a ROS camera_info"
    ):
        load_camera(tmp_path / "vins.yaml", rectified=True)


CAMERAS = """S_02: 1392 512
K_02: 957.1 0 693.2 0 955.8 251.4 0 0 1
D_02: -0.37 0.2 0.0014 0.0003 -0.07
R_02: 0 -1 0 1 0 0 0 0 1
T_02: 0.06 0.01 -0.02
S_rect_02: 1242 375
R_rect_00: 0 0 1 0 1 0 -1 0 0
R_rect_02: 1 0 0 0 1 0 0 0 1
P_rect_02: 720 0 610 72 0 720 170 36 0 0 1 0.5
"""
VELO = "calib_time: now\nR: 0 -1 0 0 0 -1 1 0 0\nT: -0.004 -0.076 -0.27\ndelta_f: 0 0\n"


def test_raw_cameras_of_kitti_are_chosen_by_name(tmp_path: Path) -> None:
    path = tmp_path / "calib_cam_to_cam.txt"
    path.write_text(CAMERAS)
    rectified = PinholeCamera(720, 720, 610, 170, width=1242, height=375)
    distortion = (-0.37, 0.2, 0.0014, 0.0003, -0.07)
    raw = PinholeCamera(957.1, 955.8, 693.2, 251.4, distortion=distortion, width=1392, height=512)
    assert load_camera(path) == load_camera(path, "P_rect_02", rectified=True) == rectified
    assert load_camera(path, "K_02") == raw
    with pytest.raises(CalibrationError, match="camera name: found 'K_02'; needed one of P_rect_02"):
        load_camera(path, "K_02", rectified=True)


def test_the_lidars_place_of_kittis_raw_data_needs_both_files(tmp_path: Path) -> None:
    lidar, cameras = tmp_path / "calib_velo_to_cam.txt", tmp_path / "calib_cam_to_cam.txt"
    lidar.write_text(VELO)
    with pytest.raises(CalibrationError, match=r"calib_cam_to_cam.txt: found no such file; needed .*R_rect_00"):
        load_lidar_pose(lidar)
    cameras.write_text(CAMERAS)
    point = np.array([7.0, 2.0, -0.5])
    first = np.array([[0, -1, 0], [0, 0, -1], [1, 0, 0]]) @ point + [-0.004, -0.076, -0.27]
    rotation, translation = load_lidar_pose(lidar)
    turned = np.array([[0, 0, 1], [0, 1, 0], [-1, 0, 0]]) @ first
    pixel = np.array([[720, 0, 610, 72], [0, 720, 170, 36], [0, 0, 1, 0.5]]) @ [*turned, 1.0]
    seen = np.array([[720, 0, 610], [0, 720, 170], [0, 0, 1]]) @ (rotation @ point + translation)
    assert seen == pytest.approx(pixel)
    rotation, translation = load_lidar_pose(lidar, "K_02", cameras=cameras)
    expected = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ first + [0.06, 0.01, -0.02]
    assert rotation @ point + translation == pytest.approx(expected)


def test_info_says_which_tool_wrote_a_calibration(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "metashape.xml").write_text(METASHAPE)
    assert main(["info", str(tmp_path / "metashape.xml"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["kind"] == "calibration" and told["written_as"] == "Metashape XML"
