"""Calibration files: each format read right, the choice of a camera, and what a bad file says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from regionpose.cameras import Camera, FisheyeCamera, OcamCamera, PinholeCamera, UnifiedCamera
from regionpose.io.calibrations import CalibrationError, load_camera, load_lidar_pose

SAMPLES = Path(__file__).parents[1] / "samples"
DATA = Path(__file__).parents[4] / "shared" / "data"

EXPECTED = [
    (
        "opencv.yml",
        None,
        PinholeCamera(
            1020.5, 1018.5, 639.5, 479.5, width=1280, height=960, distortion=(-0.25, 0.1, 5e-4, -7.5e-4, -0.02)
        ),
    ),
    (
        "opencv_fisheye.yml",
        None,
        FisheyeCamera(310, 311, 512, 384, distortion=(2e-2, -4e-3, 1e-3, -2e-4), width=1024, height=768),
    ),
    (
        "opencv_stereo.yml",
        "M1",
        PinholeCamera(
            530, 530, 320, 240, width=None, height=None, distortion=(-0.28, 0.05, 0, 0, 0, 0.01, 0.02, 0.003)
        ),
    ),
    (
        "opencv_stereo.yml",
        "M2",
        PinholeCamera(535, 536, 321, 241, width=None, height=None, distortion=(-0.3, 0.1, 1e-3, 0, 0, 0, 0, 0)),
    ),
    (
        "ros_camera_info.yaml",
        None,
        PinholeCamera(458.5, 457.25, 367.25, 248.5, width=752, height=480, distortion=(-0.28, 0.074, 2e-4, 1e-5, 0)),
    ),
    (
        "ros_camera_info.yaml",
        "left",
        PinholeCamera(458.5, 457.25, 367.25, 248.5, width=752, height=480, distortion=(-0.28, 0.074, 2e-4, 1e-5, 0)),
    ),
    (
        "ros_message.yaml",
        None,
        PinholeCamera(
            610, 611, 640.5, 360.25, width=1280, height=720, distortion=(0.5, -0.2, 1e-3, -2e-4, 0.01, 0.8, -0.1, 0.02)
        ),
    ),
    (
        "kalibr_camchain.yaml",
        "cam0",
        PinholeCamera(458.5, 457.25, 367.25, 248.5, width=752, height=480, distortion=(-0.28, 0.07, 2e-4, 1e-5)),
    ),
    (
        "kalibr_camchain.yaml",
        "cam1",
        FisheyeCamera(460, 461, 376, 240, distortion=(-0.01, 0.02, -0.015, 0.004), width=752, height=480),
    ),
    (
        "kalibr_camchain.yaml",
        "cam2",
        UnifiedCamera(900, 901, 640, 512, xi=1.7, distortion=(-0.2, 0.04, 1e-4, -3e-4), width=1280, height=1024),
    ),
    ("colmap_cameras.txt", "1", PinholeCamera(2559.8, 2559.8, 1535.5, 1151.5, width=3072, height=2304)),
    ("colmap_cameras.txt", "2", PinholeCamera(2560.5, 2560.25, 1535.5, 1151.5, width=3072, height=2304)),
    (
        "colmap_cameras.txt",
        "3",
        PinholeCamera(2559.7, 2559.7, 1535.5, 1151.5, width=3072, height=2304, distortion=(-0.0218, 0, 0, 0)),
    ),
    (
        "colmap_cameras.txt",
        "4",
        PinholeCamera(2559.7, 2559.7, 1535.5, 1151.5, width=3072, height=2304, distortion=(-0.02, 0.015, 0, 0)),
    ),
    (
        "colmap_cameras.txt",
        "5",
        PinholeCamera(2559, 2560, 1535.5, 1151.5, width=3072, height=2304, distortion=(-0.02, 0.015, 1e-4, -2e-4)),
    ),
    (
        "colmap_cameras.txt",
        "6",
        FisheyeCamera(400, 401, 499.5, 500, distortion=(0.01, -0.002, 3e-4, -1e-5), width=1000, height=1000),
    ),
    (
        "colmap_cameras.txt",
        "7",
        PinholeCamera(
            2559,
            2560,
            1535.5,
            1151.5,
            width=3072,
            height=2304,
            distortion=(0.1, 0.02, 1e-4, -2e-4, 0.003, 0.11, 0.01, 0.001),
        ),
    ),
    (
        "colmap_cameras.txt",
        "9",
        FisheyeCamera(400, 400, 499.5, 499.5, distortion=(0.01, -0.002, 0, 0), width=1000, height=1000),
    ),
    (
        "ocam_calib_results.txt",
        None,
        OcamCamera(
            (320, 0, -1.1e-3, 1.2e-6, -2.5e-9),
            (511.75, 383.25),
            stretch=((1, 7e-4), (-4e-4, 1.002)),
            width=1024,
            height=768,
        ),
    ),
    ("kitti_object.txt", None, PinholeCamera(710, 710, 610, 170)),
    ("kitti_object.txt", "P0", PinholeCamera(700, 700, 600, 180)),
    ("kitti_odometry.txt", "P1", PinholeCamera(700, 700, 600, 180)),
    ("kitti_raw.txt", None, PinholeCamera(720, 720, 610, 170, width=1242, height=375)),
]


@pytest.mark.parametrize(("file", "name", "camera"), EXPECTED, ids=lambda value: str(value)[:40])
def test_each_format_gives_its_camera(file: str, name: str | None, camera: Camera) -> None:
    assert load_camera(SAMPLES / file, name) == camera
    assert load_camera(str(SAMPLES / file), name) == camera


@pytest.mark.parametrize(("file", "name", "camera"), EXPECTED, ids=lambda value: str(value)[:40])
def test_the_extension_and_the_line_ends_do_not_matter(
    file: str, name: str | None, camera: Camera, tmp_path: Path
) -> None:
    copy = tmp_path / "calibration.data"
    copy.write_bytes(b"\xef\xbb\xbf" + (SAMPLES / file).read_bytes().replace(b"\n", b"\r\n"))
    assert load_camera(copy, name) == camera


@pytest.mark.parametrize(
    ("file", "name", "message"),
    [
        ("opencv_stereo.yml", None, "camera name: found none for 2 cameras; needed name= one of M1, M2"),
        ("kalibr_camchain.yaml", None, "needed name= one of cam0, cam1, cam2, cam3"),
        ("kalibr_camchain.yaml", "cam9", "camera name: found 'cam9'; needed one of cam0, cam1, cam2, cam3"),
        ("kalibr_camchain.yaml", "cam3", r"line 32: cam3.camera_model: found ds \+ none; needed one of omni \+ none"),
        ("colmap_cameras.txt", None, "needed name= one of 1, 2, 3"),
        ("colmap_cameras.txt", "8", "line 11: camera 8: found the model FOV; needed one of SIMPLE_PINHOLE"),
        ("kitti_odometry.txt", None, "needed name= one of P0, P1"),
        ("ros_camera_info.yaml", "right", "found 'right'; needed one of left"),
        ("ocam_calib_results.txt", "1", "found '1'; needed one of ocam"),
    ],
)
def test_a_choice_that_cannot_be_made_lists_the_names(file: str, name: str | None, message: str) -> None:
    with pytest.raises(CalibrationError, match=message) as raised:
        load_camera(SAMPLES / file, name)
    assert str(SAMPLES / file) in str(raised.value)


OPENCV = (SAMPLES / "opencv.yml").read_text()
ROS = (SAMPLES / "ros_camera_info.yaml").read_text()
MESSAGE = (SAMPLES / "ros_message.yaml").read_text()
OCAM = (SAMPLES / "ocam_calib_results.txt").read_text()
KITTI = (SAMPLES / "kitti_object.txt").read_text()
CAM0 = (SAMPLES / "kalibr_camchain.yaml").read_text().partition("cam1:")[0]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "found an empty file"),
        (" \n\n", "found an empty file"),
        (b"\x89PNG\r\n\x1a\n\x00\x01", "found a binary file"),
        (b"abc\x00def", "found a binary file"),
        (b"#" * (5 * 2**20), "found 5242880 bytes; needed a calibration file of at most"),
        ("hello world", "found text that starts with 'hello world'; needed one of these: COLMAP"),
        ("a: 1\nb: 2\n", "found the items a, b; needed one of these: COLMAP"),
        ("# only a comment\n", "found text that starts with"),
        ("[" * 5000, "found brackets nested too deep; needed fewer"),
        (
            OPENCV[: OPENCV.index("4.795e+02")],
            "line 1[0-9], column 1: found the end of the text; needed a value, or the bracket that closes",
        ),
        (OPENCV[: OPENCV.index("distortion_coeff")], "needed an item distortion_coefficients"),
        (OPENCV.replace("0., 0., 1. ]", "0., 1. ]"), "line 11: camera_matrix.data: found 8 numbers; needed 9 numbers"),
        (OPENCV.replace("1.0185e+03", "abc"), r"camera_matrix.data\[4\]: found 'abc'; needed a number"),
        (OPENCV.replace("1.0185e+03", ".nan"), r"camera_matrix.data\[4\]: found '.nan'; needed a number"),
        (OPENCV.replace("1.0185e+03", "-1"), "camera camera_matrix: fy: found -1.0; needed a number above 0"),
        (OPENCV.replace("rows: 5", "rows: -5").replace("cols: 1", "cols: -1"), "found -5 rows and -1 columns; needed"),
        (OPENCV.replace("rows: 5", "rows: 3"), "distortion_coefficients.data: found 5 numbers; needed 3 numbers"),
        (
            OPENCV.replace("image_width: 1280", "image_width: [1]"),
            "line 4: image_width: found a sequence; needed a single",
        ),
        (OPENCV + "image_width: 5\n", "image_width: found a second item of this name; needed one"),
        (
            f"a: &a [{'1, ' * 999}1]\n" + OPENCV.partition("---")[2].replace("data: [", f"data: [{'*a, ' * 999}", 1),
            "more numbers than characters in the file; needed numbers written out",
        ),
        (ROS.replace("plumb_bob", "magic"), "distortion_model: found 'magic'; needed one of plumb_bob, rational"),
        (ROS.replace("plumb_bob", "equidistant"), "distortion_coefficients: found 5 numbers; needed 4 numbers"),
        (MESSAGE.replace("binning_x: 0", "binning_x: 5000"), "line 14: binning_x: found 5000 x 1 pixels in one"),
        (MESSAGE.replace("binning_x: 0", "binning_x: -2"), "line 14: binning_x: found -2; needed a number of at least"),
        (MESSAGE.replace("x_offset: 0", "x_offset: 8"), "roi: found the offset 8, 0 without width and height; needed"),
        (MESSAGE.replace("K: [610.0, ", "K: ["), "line 11: K: found 8 numbers; needed 9 numbers"),
        (CAM0.replace("458.5, ", ""), "cam0.intrinsics: found 3 numbers; needed 4 numbers"),
        (
            CAM0.replace("  resolution: [752, 480]\n", ""),
            "cam0: found the items cam_overlaps, .*; needed an item resolution",
        ),
        ("1 PINHOLE 640 480 500 500 320\n", "line 1: camera 1 PINHOLE: found 3 numbers; needed 4 numbers"),
        ("1 PINHOLE 640\n", "camera 1: found 3 words"),
        ("1 PINHOLE 640 480 500 500 320 x\n", r"camera 1 PINHOLE\[3\]: found 'x'; needed a number"),
        ("1 PINHOLE 640.5 480 500 500 320 240\n", "camera 1 size: found '640.5'; needed a whole number"),
        ("1 PINHOLE 9 9 5 5 3 2\n" * 2, "line 2: camera 1: found a second line of this id"),
        (OCAM[: OCAM.index("#affine")], "affine parameters: found no section with numbers"),
        (OCAM.replace("5 -3.2e+02", "6 -3.2e+02"), "line 3: polynomial: found 5 numbers; needed 6 numbers"),
        (OCAM.replace("-3.2e+02", "3.2e+02"), "polynomial: found 320.0; needed a first coefficient below 0"),
        (OCAM.replace("383.25 511.75", "383.25"), "line 11: center: found 1 numbers; needed 2 numbers"),
        (OCAM + "#center\n1 2\n", "line 24: center: found a second section"),
        (
            KITTI.replace("7.1e+02 0.0e+00 6.1e+02", "7.1e+02 6.1e+02"),
            "line 2: P2: found 11 numbers; needed 12 numbers",
        ),
        (KITTI.replace("7.1e+02 0.0e+00 6.1e+02", "7.1e+02 x 6.1e+02"), r"line 2: P2\[1\]: found 'x'; needed a number"),
        (KITTI + "P2: 1\n", "P2: found a second line of this name"),
    ],
)
def test_a_bad_file_says_what_and_where(content: str | bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "calibration.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(CalibrationError, match=message) as raised:
        load_camera(path)
    assert str(path) in str(raised.value)


@pytest.mark.parametrize("file", sorted({file for file, _, _ in EXPECTED}))
def test_a_file_cut_anywhere_is_read_or_refused(file: str, tmp_path: Path) -> None:
    """Every prefix of every sample: a camera or a CalibrationError, no other exception."""
    content = (SAMPLES / file).read_bytes()
    path = tmp_path / file
    refused = 0
    for end in range(0, len(content), 1 + len(content) // 150):
        path.write_bytes(content[:end])
        try:
            load_camera(path)
        except CalibrationError:
            refused += 1
    assert refused > 5


@settings(deadline=None)
@given(content=st.one_of(st.binary(max_size=200), st.text(alphabet="P0: \n#[]{}&*!camer_lK1.5e-D,", max_size=80)))
def test_any_bytes_are_read_or_refused(content: bytes | str, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "any.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(CalibrationError):
        load_camera(path)


def test_a_missing_file_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_camera(tmp_path / "nowhere.yml")
    with pytest.raises(FileNotFoundError):
        load_lidar_pose(tmp_path / "nowhere.txt")


def test_ocamcalib_rays_become_ours() -> None:
    """OCamCalib's own formulas, x along rows, y along columns and z backward, give the pixels of our rays.

    `(row, column) = center + [[c, d], [e, 1]] (x, y)` is seen along `(x, y, ss(rho))`; in our axes that direction is
    `(y, x, -ss(rho))`.
    """
    ss, (row, column), (c, d, e) = (-320.0, 0.0, 1.1e-3, -1.2e-6, 2.5e-9), (383.25, 511.75), (1.002, -0.0004, 0.0007)
    x, y = np.random.default_rng(5).uniform(-350.0, 350.0, (2, 200))
    z = sum(coefficient * np.hypot(x, y) ** power for power, coefficient in enumerate(ss))
    pixels = np.stack([e * x + y + column, c * x + d * y + row], axis=1)
    camera = load_camera(SAMPLES / "ocam_calib_results.txt")
    rays = np.stack([y, x, -z], axis=1)
    assert np.allclose(camera.bearings(pixels), rays / np.linalg.norm(rays, axis=1, keepdims=True), atol=1e-13)
    assert np.allclose(camera.project(rays), pixels, rtol=0.0, atol=1e-9)
    assert camera.bearings([[column, row - 100.0]])[0, 1] < 0.0


def test_the_lidar_pose_projects_as_the_kitti_matrices_do() -> None:
    """`P2 R0_rect Tr x`, the formula of KITTI's development kit."""
    lidar = np.array([[10.0, 1.0, -0.5], [20.0, -3.0, 1.0]])
    entries = dict(line.split(":") for line in KITTI.splitlines() if ":" in line)
    values = {key: np.array(text.split(), dtype=float) for key, text in entries.items()}
    tr, r0, p2 = values["Tr_velo_to_cam"].reshape(3, 4), values["R0_rect"].reshape(3, 3), values["P2"].reshape(3, 4)
    rectified = (lidar @ tr[:, :3].T + tr[:, 3]) @ r0.T
    homogeneous = rectified @ p2[:, :3].T + p2[:, 3]
    rotation, translation = load_lidar_pose(SAMPLES / "kitti_object.txt")
    camera = load_camera(SAMPLES / "kitti_object.txt")
    projected = camera.project(lidar @ rotation.T + translation)
    assert np.allclose(projected, homogeneous[:, :2] / homogeneous[:, 2:], rtol=0.0, atol=1e-6)
    assert np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)


def test_an_odometry_file_holds_the_rectified_lidar_pose() -> None:
    """Camera 1 lies 0.54 m to the right of camera 0: x is 378 / 700 m less."""
    rotation, translation = load_lidar_pose(SAMPLES / "kitti_odometry.txt", "P1")
    assert np.array_equal(rotation, [[0, -1, 0], [0, 0, -1], [1, 0, 0]])
    assert np.allclose(translation, [-0.01 - 0.54, -0.05, -0.29])


@pytest.mark.parametrize(
    ("file", "name", "message"),
    [
        ("kitti_raw.txt", None, "lidar's pose: found the cameras of raw data; needed calib_velo_to_cam.txt"),
        ("kitti_odometry.txt", None, "needed name= one of P0, P1"),
        ("opencv.yml", None, "projection matrices: found none"),
    ],
)
def test_a_file_without_a_lidar_pose_says_so(file: str, name: str | None, message: str) -> None:
    with pytest.raises(CalibrationError, match=message):
        load_lidar_pose(SAMPLES / file, name)


def test_a_lidar_pose_must_be_a_rotation(tmp_path: Path) -> None:
    path = tmp_path / "calibration.txt"
    path.write_text(KITTI.replace("Tr_velo_to_cam: 0.0e+00", "Tr_velo_to_cam: 5.0e-01"))
    with pytest.raises(CalibrationError, match=r"lidar rotation: found a matrix .* off orthonormal"):
        load_lidar_pose(path)


REAL_FILES = {
    "calibrations/kitti_object.txt": PinholeCamera(721.5377, 721.5377, 609.5593, 172.854),
    "calibrations/ros_camera_info_fisheye.yaml": FisheyeCamera(
        1176.93,
        1177.72,
        962.275,
        612.725,
        distortion=(-0.0540096, -0.0784275, 0.0959641, -0.0515253),
        width=1920,
        height=1208,
    ),
    "calibrations/ocam_calib_results.txt": OcamCamera(
        (471.4441, 0.0, -7.356108e-04, 3.773045e-07, -5.800006e-10),
        (798.175741, 794.308657),
        stretch=((1.0, -0.000925), (-0.000277, 1.000305)),
        width=1600,
        height=1600,
    ),
    "opencv_checkerboard/left_intrinsics.yml": PinholeCamera(
        535.91573396163199,
        535.91573396163199,
        342.28315473308373,
        235.57082909788173,
        width=640,
        height=480,
        distortion=(
            -0.26637260909660682,
            -0.038588898922304653,
            0.0017831947042852964,
            -0.00028122100441115472,
            0.23839153080878486,
        ),
    ),
}


@pytest.mark.parametrize("file", REAL_FILES)
def test_files_written_by_the_tools_themselves(file: str) -> None:
    if not (DATA / file).exists():
        pytest.skip(f"the shared file {file} is not here")
    assert load_camera(DATA / file) == REAL_FILES[file]


def test_ocamcalibs_inverse_polynomial_agrees_with_the_inverted_one() -> None:
    """The file's own approximate inverse, rho as a polynomial of the elevation, is good to a pixel or so."""
    path = DATA / "calibrations" / "ocam_calib_results.txt"
    if not path.exists():
        pytest.skip("the shared OCamCalib file is not here")
    lines = path.read_text().splitlines()
    inverse = [float(word) for word in lines[6].split()[1:]]
    angles = np.linspace(0.1, 1.6, 50)
    rho = sum(coefficient * (angles - np.pi / 2.0) ** power for power, coefficient in enumerate(inverse))
    camera = load_camera(path)
    assert isinstance(camera, OcamCamera)
    pixels = camera.project(np.stack([np.sin(angles), np.zeros(50), np.cos(angles)], axis=1))
    assert np.abs(pixels[:, 0] - camera.center[0] - rho).max() < 1.0
