"""Calibration files of more tools: one lens as each of them writes it, and what camera_info says of the photo."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from regionpose.calibration import CalibrationError, load_camera, load_lidar_pose
from regionpose.calibration.kinds import calibration_kind
from regionpose.cameras import Camera, EquirectangularCamera, FisheyeCamera, PinholeCamera, UnifiedCamera
from regionpose.cli.app import main

SIZE: dict[str, Any] = {"width": 1296, "height": 736}
LENS = PinholeCamera(812.5, 817.25, 655.4, 371.9, distortion=(-0.11, 0.035, 7e-4, -9e-4), **SIZE)
FISHEYE = FisheyeCamera(402.5, 403.25, 655.4, 371.9, distortion=(0.04, -0.01, 2e-3, -3e-4), **SIZE)
IDEAL = replace(LENS, distortion=())
K = "812.5, 0.0, 655.4, 0.0, 817.25, 371.9, 0.0, 0.0, 1.0"
NAMED = "fx: 812.5\nfy: 817.25\ncx: 655.4\ncy: 371.9\n"
RAYS = np.array([[0.31, -0.22, 1.3], [-0.6, 0.4, 1.0], [0.1, 0.35, 0.9]])

METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<calibration>
  <projection>frame</projection>
  <width>1296</width>
  <height>736</height>
  <f>817.25</f>
  <cx>7.9</cx>
  <cy>4.4</cy>
  <b1>-4.75</b1>
  <k1>-0.11</k1>
  <k2>0.035</k2>
  <p1>-0.0009</p1>
  <p2>0.0007</p2>
</calibration>
"""
SENSORS = """<document><chunk><sensors>
<sensor id="0" label="left" type="frame"><resolution width="1296" height="736"/>
<calibration type="frame" class="initial"><f>700</f></calibration>
<calibration type="fisheye" class="adjusted"><f>403.25</f><b1>-0.75</b1><cx>7.9</cx><cy>4.4</cy>
<k1>0.04</k1><k2>-0.01</k2><k3>0.002</k3><k4>-0.0003</k4></calibration></sensor>
<sensor id="1" label="pano" type="spherical"><resolution width="4000" height="2000"/>
<calibration type="spherical" class="adjusted"></calibration></sensor>
</sensors></chunk></document>
"""
PIX4D = """fileName imageWidth imageHeight
camera matrix K [3x3]
radial distortion [3x1]
tangential distortion [2x1]
camera position t [3x1]
camera rotation R [3x3]

a photo.png 1296 736
812.5 0 655.4
0 817.25 371.9
0 0 1
-0.11 0.035 0
0.0007 -0.0009
1 2 3
1 0 0
0 1 0
0 0 1
b.png 1296 736
400 0 655.4
0 400 371.9
0 0 1
0 0 0
0 0
1 2 3
1 0 0
0 1 0
0 0 1
"""
MRCAL = """# mrcal
{
    'lensmodel': 'LENSMODEL_OPENCV4',
    'extrinsics': [ 0, 0, 0, 0, 0, -0.5 ],
    'intrinsics': [ np.float64(812.5), 817.25, 655.4, 371.9, -0.11, 0.035, 7e-4, -9e-4 ],
    'imagersize': (1296, 736),
}
"""
NERFSTUDIO = {
    "camera_model": "OPENCV",
    **{"fl_x": 812.5, "fl_y": 817.25, "cx": 655.9, "cy": 372.4, "w": 1296, "h": 736},
    **{"k1": -0.11, "k2": 0.035, "p1": 7e-4, "p2": -9e-4},
    "frames": [{"file_path": "a.png", "transform_matrix": np.eye(4).tolist()}],
}
STORAGE = f"""<?xml version="1.0"?>
<opencv_storage>
<image_width>1296</image_width>
<image_height>736</image_height>
<camera_matrix type_id="opencv-matrix"><rows>3</rows><cols>3</cols><dt>d</dt>
  <data>{K.replace(",", "")}</data></camera_matrix>
<distortion_coefficients type_id="opencv-matrix"><rows>4</rows><cols>1</cols><dt>d</dt>
  <data>-0.11 0.035 7e-4 -9e-4</data></distortion_coefficients>
<camera_model>pinhole</camera_model>
<names><_>a</_><_>b</_></names>
</opencv_storage>
"""
DVLC = {"camera": {"camera_model": "plumb_bob", "intrinsics": [812.5, 817.25, 655.4, 371.9]}, "results": {}}
DVLC["camera"]["distortion_coeffs"] = [-0.11, 0.035, 7e-4, -9e-4, 0.0]
OPENCALIB = {
    "front-intrinsic": {
        "sensor_name": "front",
        "param_type": "intrinsic",
        "param": {
            **{"img_dist_w": 1296, "img_dist_h": 736},
            "cam_K": {"rows": 3, "cols": 3, "data": [[812.5, 0, 655.4], [0, 817.25, 371.9], [0, 0, 1]]},
            "cam_dist": {"rows": 1, "cols": 5, "data": [[-0.11, 0.035, 7e-4, -9e-4, 0]]},
        },
    }
}
ORB = """%YAML:1.0
Camera.type: "PinHole"
Camera1.fx: 812.5
Camera1.fy: 817.25
Camera1.cx: 655.4
Camera1.cy: 371.9
Camera1.k1: -0.11
Camera1.k2: 0.035
Camera1.p1: 0.0007
Camera1.p2: -0.0009
Camera.width: 1296
Camera.height: 736
"""
ORB_FISHEYE = """%YAML:1.0
Camera.type: "KannalaBrandt8"
Camera.fx: 402.5
Camera.fy: 403.25
Camera.cx: 655.4
Camera.cy: 371.9
Camera.k1: 0.04
Camera.k2: -0.01
Camera.k3: 0.002
Camera.k4: -0.0003
Camera.width: 1296
Camera.height: 736
"""
VINS = """%YAML:1.0
---
model_type: PINHOLE
camera_name: front
image_width: 1296
image_height: 736
distortion_parameters: {k1: -0.11, k2: 0.035, p1: 7.0e-04, p2: -9.0e-04}
projection_parameters: {fx: 812.5, fy: 817.25, cx: 655.4, cy: 371.9}
"""
VINS_FISHEYE = """%YAML:1.0
---
model_type: KANNALA_BRANDT
image_width: 1296
image_height: 736
projection_parameters: {k2: 0.04, k3: -0.01, k4: 0.002, k5: -0.0003, mu: 402.5, mv: 403.25, u0: 655.4, v0: 371.9}
"""
VINS_MEI = """%YAML:1.0
---
model_type: MEI
image_width: 1296
image_height: 736
mirror_parameters: {xi: 1.7}
distortion_parameters: {k1: -0.1, k2: 0.02, p1: 1.0e-03, p2: -2.0e-03}
projection_parameters: {gamma1: 902.5, gamma2: 903.25, u0: 655.4, v0: 371.9}
"""
LIVO = """%YAML:1.0
cam_model: Pinhole
cam_width: 1296
cam_height: 736
scale: 0.5
cam_fx: 812.5
cam_fy: 817.25
cam_cx: 655.4
cam_cy: 371.9
cam_d0: -0.11
cam_d1: 0.035
cam_d2: 0.0007
cam_d3: -0.0009
"""
LIVOX = f"camera:\n  camera_matrix: [{K}]\n  dist_coeffs: [-0.11, 0.035, 7.0e-04, -9.0e-04, 0.0]\n"
CALIB = f"K: {K.replace(',', '')}\nD: -0.11 0.035 0.0007 -0.0009 0\nT: 0 -1 0 0.1 0 0 -1 0.2 1 0 0 0.3\n"
RECORD = {"token": "a", "sensor_token": "c", "translation": [1, 2, 3], "rotation": [1, 0, 0, 0]}
NUSCENES = [
    {**RECORD, "token": "lidar", "camera_intrinsic": []},
    {**RECORD, "token": "front", "camera_intrinsic": [[812.5, 0, 655.4], [0, 817.25, 371.9], [0, 0, 1]]},
]
OPEN3D = {**SIZE, "intrinsic_matrix": [812.5, 0, 0, 0, 817.25, 0, 655.4, 371.9, 1]}
UNSIZED: dict[str, Any] = {"width": None, "height": None}

FILES: dict[str, tuple[str, str | None, Camera, str]] = {
    "metashape.xml": (METASHAPE, None, LENS, "Metashape"),
    "sensors.xml": (SENSORS, "left", FISHEYE, "Metashape"),
    "panorama.xml": (SENSORS, "pano", EquirectangularCamera(width=4000, height=2000), "Metashape"),
    "pix4d.txt": (PIX4D, "a photo.png", LENS, "Pix4D"),
    "cam.cameramodel": (MRCAL, None, LENS, "mrcal"),
    "transforms.json": (json.dumps(NERFSTUDIO), None, LENS, "nerfstudio"),
    "opencv.xml": (STORAGE, None, LENS, "OpenCV XML"),
    "open3d.json": (json.dumps(OPEN3D), None, IDEAL, "Open3D"),
    "view.json": (json.dumps({"intrinsic": OPEN3D, "extrinsic": []}), None, IDEAL, "Open3D"),
    "calib.json": (json.dumps(DVLC), None, replace(LENS, **UNSIZED), "direct_visual"),
    "front-intrinsic.json": (json.dumps(OPENCALIB), "front", LENS, "OpenCalib"),
    "calib.txt": (CALIB, None, replace(LENS, **UNSIZED), "OpenCalib"),
    "livox.yaml": (LIVOX, None, replace(LENS, **UNSIZED), "OpenCV"),
    "qr_params.yaml": (NAMED + "k1: -0.11\nk2: 0.035\np1: 7e-4\np2: -9e-4\n", None, replace(LENS, **UNSIZED), "FAST"),
    "livo.txt": (LIVO, None, LENS, "FAST"),
    "orb.yaml": (ORB, "Camera1", LENS, "ORB"),
    "orb_fisheye.yaml": (ORB_FISHEYE, None, FISHEYE, "ORB"),
    "vins.yaml": (VINS, "front", LENS, "VINS"),
    "vins_fisheye.yaml": (VINS_FISHEYE, None, FISHEYE, "VINS"),
    "vins_mei.yaml": (
        VINS_MEI,
        None,
        UnifiedCamera(902.5, 903.25, 655.4, 371.9, xi=1.7, distortion=(-0.1, 0.02, 1e-3, -2e-3), **SIZE),
        "VINS",
    ),
    "calibrated_sensor.json": (json.dumps(NUSCENES), "front", replace(IDEAL, **UNSIZED), "nuScenes"),
}


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
        ("a.json", dvlc("atan", [500, 500, 640, 480], [0.9]), "camera_model: found 'atan'; needed one of plumb_bob"),
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
