"""What is told before any pose is looked for: photos, calibrations, clouds and regions that don't belong together."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from PIL import Image
from regionpose.cameras import Camera, FisheyeCamera, PinholeCamera
from regionpose.cli.app import main
from regionpose.datasets.demo import demo_folder
from regionpose.io.yaml_text import plain_value, to_yaml, yaml_node
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.exposure import scene_sides
from regionpose.scene.input_checks import check_camera, unit_remark
from regionpose.scene.loading import load_scene
from scene_files import CAMERA, HEIGHT, PLATES, POSE, WIDTH, scene_values, write_scene

DEMO = demo_folder()
SHARED = Path(__file__).parents[4] / "shared" / "data"


def codes(path: Path) -> set[str]:
    """The codes of what a scene is warned of."""
    return {warning.code for warning in estimate_scene(load_scene(path)).estimate.warnings}


def told(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """The exit code of a command and all it says."""
    code = main(arguments)
    said = capsys.readouterr()
    return code, said.out + said.err


def halved(folder: Path) -> None:
    """Put the scene's photo in half its size in the place of the photo."""
    with Image.open(folder / "image.png") as picture:
        picture.resize((WIDTH // 2, HEIGHT // 2)).save(folder / "image.png")


def without_size(values: dict[str, Any]) -> dict[str, Any]:
    """The scene's values with a camera that doesn't say its photos' size."""
    camera = {key: value for key, value in values["camera"].items() if key not in ("width", "height")}
    return {**values, "camera": camera}


def test_a_sound_scene_is_warned_of_nothing(tmp_path: Path) -> None:
    assert codes(write_scene(tmp_path)) == set()


def test_a_photo_of_half_the_calibrated_size_is_refused_with_the_factor(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_scene(tmp_path)
    halved(tmp_path)
    code, said = told(["estimate", str(path), "--out", str(tmp_path / "result"), "--quiet"], capsys)
    assert code == 2
    assert "image: found 160 x 120 pixels, 0.5 of the camera's; needed the calibrated 320 x 240" in said
    assert "or camera.resized: true for a resized copy" in said
    assert not (tmp_path / "result").exists()


def test_a_resized_photo_gives_the_same_pose_where_the_scene_says_so(tmp_path: Path) -> None:
    """Polygons are drawn on the photo as it is: a pixel u of the calibrated size is (u + 0.5) / 2 - 0.5."""
    values = scene_values()
    values["camera"]["resized"] = True
    values["solver"] = {"max_rotation_sigma_deg": 2.0}
    for region in values["regions"]:
        region["image"]["polygon"] = (0.5 * (np.array(region["image"]["polygon"]) + 0.5) - 0.5).tolist()
    path = write_scene(tmp_path, values)
    halved(tmp_path)
    run = estimate_scene(load_scene(path))
    assert (run.estimate.pose.rotation * POSE.rotation.inv()).magnitude() < 1e-6
    assert np.allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)
    assert not run.estimate.warnings


@pytest.mark.parametrize(
    ("size", "said"),
    [((HEIGHT, WIDTH), "turned by a quarter"), ((WIDTH, HEIGHT - 60), "cut, or another camera's")],
)
def test_a_turned_or_cut_photo_is_refused_as_such(size: tuple[int, int], said: str, tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    Image.fromarray(np.zeros((size[1], size[0], 3), dtype=np.uint8)).save(tmp_path / "image.png")
    with pytest.raises(SceneError, match=said) as caught:
        scene_sides(load_scene(path))
    assert "resized" not in str(caught.value)


def test_a_photo_that_is_no_copy_cannot_be_called_resized(tmp_path: Path) -> None:
    values = scene_values()
    values["camera"]["resized"] = True
    path = write_scene(tmp_path, values)
    Image.fromarray(np.zeros((HEIGHT - 60, WIDTH, 3), dtype=np.uint8)).save(tmp_path / "image.png")
    with pytest.raises(SceneError, match=r"camera\.resized: size: found 320 x 180 pixels for 320 x 240; needed both"):
        scene_sides(load_scene(path))


def test_a_polygon_that_leaves_the_photo_is_refused_with_what_to_do(tmp_path: Path) -> None:
    """Without a size in the calibration, the polygons are what tells that the photo is smaller."""
    path = write_scene(tmp_path, without_size(scene_values()))
    halved(tmp_path)
    with pytest.raises(SceneError, match=r"regions\[0\]\.image\.polygon.*: found .* outside the photo of 160 x 120"):
        scene_sides(load_scene(path))


def test_a_polygon_drawn_along_the_border_is_kept(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["image"]["polygon"] = [[-1.0, -1.0], [WIDTH, -1.0], [WIDTH, HEIGHT / 2], [-1.0, HEIGHT / 2]]
    assert len(scene_sides(load_scene(write_scene(tmp_path, values))).image_regions) == 2


def test_a_calibration_whose_axis_leaves_the_middle_of_the_photo_is_warned_of(tmp_path: Path) -> None:
    values = without_size(scene_values())
    assert codes(write_scene(tmp_path, values)) == set()
    values["camera"] |= {"fx": 600.0, "fy": 600.0, "cx": 319.5, "cy": 239.5}
    sides = scene_sides(load_scene(write_scene(tmp_path, values)))
    (warning,) = sides.warnings
    assert warning.code == "off-center-principal-point"
    assert warning.values["calibrated_width_px"] == pytest.approx(640.0)
    assert warning.values["calibrated_height_px"] == pytest.approx(480.0)


FISHEYE = {
    "K": [[310.0, 0.0, 512.0], [0.0, 311.0, 384.0], [0.0, 0.0, 1.0]],
    "D": [2e-2, -4e-3, 1e-3, -2e-4],
    "width": 1024,
    "height": 768,
}
AS_FISHEYE = rp.FisheyeCamera(310, 311, 512, 384, distortion=(2e-2, -4e-3, 1e-3, -2e-4), width=1024, height=768)
AS_PINHOLE = rp.PinholeCamera(310, 311, 512, 384, width=1024, height=768, distortion=(2e-2, -4e-3, 1e-3, -2e-4))


SIZE: dict[str, Any] = {"width": 1280, "height": 960}


@pytest.mark.parametrize(
    ("camera", "angle_deg", "percent"),
    [
        (PinholeCamera(900, 900, 639.5, 479.5, **SIZE), None, 0.0),
        (PinholeCamera(900, 900, 639.5, 479.5, distortion=(-0.3, 0.11, 4e-4, -6e-4, -0.02), **SIZE), None, 0.0),
        # r (1 - r^2 / (3 r0^2)) folds at r0 and is 2 r0 / 3 there.
        (PinholeCamera(900, 900, 639.5, 479.5, distortion=(-1 / (3 * 0.75**2), 0, 0, 0), **SIZE), 36.87, 48.2),
        (PinholeCamera(900, 900, 639.5, 479.5, distortion=(9.0, -700.0, 90.0, -110.0, 2900.0), **SIZE), 0.067, 100.0),
        (FisheyeCamera(300, 300, 639.5, 479.5, distortion=(-0.1, -0.05, 0, 0), **SIZE), None, 0.0),
        (FisheyeCamera(900, 900, 639.5, 479.5, distortion=(-1 / (3 * 0.5**2), 0, 0, 0), **SIZE), 28.65, 77.0),
    ],
)
def test_a_lens_that_folds_inside_the_photo_is_warned_of(
    camera: Camera, angle_deg: float | None, percent: float
) -> None:
    """Nothing is said of a lens that folds beyond the corners, nor of a fisheye's circle inside the photo."""
    warnings = check_camera(camera, (960, 1280))
    assert [warning.code for warning in warnings] == ([] if angle_deg is None else ["non-invertible-distortion"])
    for warning in warnings:
        assert warning.values["angle_deg"] == pytest.approx(angle_deg, rel=0.01)
        assert warning.values["pixel_fraction"] == pytest.approx(percent / 100.0, abs=0.02)


def calibration(folder: Path, **more: object) -> Path:
    """A JSON file with a matrix, four coefficients, and more keys."""
    path = folder / "calib.json"
    path.write_text(json.dumps({**FISHEYE, **more}, indent="\t"))
    return path


@pytest.mark.parametrize(
    ("more", "camera"),
    [
        ({"model": "opencv_fisheye"}, AS_FISHEYE),
        ({"model": "Kannala-Brandt"}, AS_FISHEYE),
        ({"camera_model": "pinhole", "distortionModel": "equidistant"}, AS_FISHEYE),
        ({"cv2_fisheye_flags": 10}, AS_FISHEYE),
        ({"model": "pinhole"}, AS_PINHOLE),
        ({"fisheye": False}, AS_PINHOLE),
        (
            {"xi": 1.2},
            rp.cameras.UnifiedCamera(
                310, 311, 512, 384, xi=1.2, distortion=(2e-2, -4e-3, 1e-3, -2e-4), width=1024, height=768
            ),
        ),
    ],
)
def test_a_calibration_is_read_in_the_model_that_it_names(
    more: dict[str, object], camera: object, tmp_path: Path
) -> None:
    assert rp.load_camera(calibration(tmp_path, **more)) == camera


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({}, r"D: found 4 coefficients and no model: .* needed model=pinhole or model=fisheye"),
        ({"model": "ocam_taylor"}, r"model: found the model 'ocam_taylor'; needed one of pinhole, fisheye, unified"),
        ({"model": "fisheye", "lens_model": "omni"}, "camera model: found fisheye and unified; needed one of them"),
        ({"model": "fisheye", "D": [0.1] * 5}, "D: found 5 numbers; needed 4 numbers"),
    ],
)
def test_a_calibration_of_an_unknown_or_untold_model_is_refused(
    more: dict[str, object], said: str, tmp_path: Path
) -> None:
    with pytest.raises(ValueError, match=said):
        rp.load_camera(calibration(tmp_path, **more))


def test_a_caller_may_say_the_model_but_not_against_the_file(tmp_path: Path) -> None:
    path = calibration(tmp_path)
    assert rp.load_camera(path, model="fisheye") == AS_FISHEYE
    assert rp.load_camera(path, model="pinhole") == AS_PINHOLE
    colmap = tmp_path / "cameras.txt"
    colmap.write_text("1 PINHOLE 640 480 500 500 320 240\n")
    with pytest.raises(ValueError, match="camera model: found pinhole; needed fisheye, or another model="):
        rp.load_camera(colmap, model="fisheye")
    with pytest.raises(ValueError, match="model: found 'wide'; needed one of pinhole, fisheye, unified, fov, ocam"):
        rp.load_camera(path, model="wide")


def test_no_distortion_needs_no_model(tmp_path: Path) -> None:
    assert isinstance(rp.load_camera(calibration(tmp_path, D=[0, 0, 0, 0])), rp.PinholeCamera)


def test_scenes_and_commands_say_the_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = calibration(tmp_path)
    code, said = told(["info", str(path)], capsys)
    assert (code, "no model" in said) == (2, True)
    code, said = told(["info", str(path), "--camera-model", "fisheye"], capsys)
    assert (code, "FisheyeCamera" in said) == (0, True)
    values = scene_values() | {"camera": {"file": "calib.json", "model": "fisheye"}}
    scene = write_scene(tmp_path, values)
    Image.fromarray(np.zeros((768, 1024, 3), dtype=np.uint8)).save(tmp_path / "image.png")
    assert scene_sides(load_scene(scene)).camera == AS_FISHEYE


RECTIFIED_INFO = f"""image_width: {WIDTH}
image_height: {HEIGHT}
distortion_model: plumb_bob
D: [-0.2, 0.05, 0, 0, 0]
K: [310.0, 0, 160.0, 0, 311.0, 119.0, 0, 0, 1]
P: [300.0, 0, 159.5, 0, 0, 300.0, 119.5, 0, 0, 0, 1, 0]
"""


@pytest.mark.parametrize(
    ("photo", "warned"), [("image_rect.png", True), ("direct.png", False), ("unrectified.png", False)]
)
def test_a_rectified_photo_has_another_camera_where_the_scene_says_so(
    photo: str, warned: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its pose is right to what polygons allow; without a word, and called rectified, it is warned of."""
    (tmp_path / "info.yaml").write_text(RECTIFIED_INFO)
    values = scene_values() | {"camera": {"file": "info.yaml", "rectified": True}, "image": photo}
    scene = write_scene(tmp_path, values)
    (tmp_path / "image.png").rename(tmp_path / photo)
    run = estimate_scene(load_scene(scene))
    assert np.abs(run.estimate.pose.translation - POSE.translation).max() < 1e-6
    assert "rectified-photo" not in codes(scene)
    assert ("rectified-photo" in codes(write_scene(tmp_path, values | {"camera": "info.yaml"}))) == warned
    code, said = told(["info", str(tmp_path / "info.yaml"), "--rectified", "--json"], capsys)
    assert (code, json.loads(said)["fx"], json.loads(said)["distortion"]) == (0, 300.0, [])


def test_commands_take_the_camera_of_rectified_photos(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One point, by P and by K with D; the latter is warned of, as the photo is called rectified."""
    (tmp_path / "info.yaml").write_text(RECTIFIED_INFO)
    (tmp_path / "pose.txt").write_text("1 0 0 0\n0 1 0 0\n0 0 1 0\n")
    (tmp_path / "cloud.xyz").write_text("0.4 -0.2 2\n0.1 0.1 2\n")
    Image.fromarray(np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)).save(tmp_path / "image_rect.png")
    files = [str(tmp_path / name) for name in ("cloud.xyz", "image_rect.png", "info.yaml", "pose.txt", "p.csv")]
    cloud, photo, info, pose, out = files
    command = ["project", cloud, photo, "--camera", info, "--pose", pose, "--out", out, "--force"]
    for option, pixel, warned in ((["--rectified"], [219.5, 89.5], False), ([], [221.38775, 88.2071125], True)):
        code, said = told([*command, *option], capsys)
        assert (code, "rectified-photo" in said) == (0, warned)
        rows = np.loadtxt(out, delimiter=",", skiprows=1)
        assert rows[0, 1:3] == pytest.approx(pixel, abs=1e-4)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared scenes are not here")
def test_a_fisheye_calibration_of_a_real_scene_is_read_as_one() -> None:
    camera = rp.load_camera(SHARED / "acfr_fisheye" / "pose13" / "calib.json")
    assert isinstance(camera, rp.FisheyeCamera)


def test_a_world_in_millimeters_is_told_with_the_factor(tmp_path: Path) -> None:
    values = scene_values()
    for region in values["regions"]:
        region["world"]["polygon"] = (1000.0 * np.array(region["world"]["polygon"])).tolist()
    (warning,) = scene_sides(load_scene(write_scene(tmp_path, values))).warnings
    assert warning.code == "suspicious-unit"
    assert warning.values["unit_m"] == 0.001 and warning.regions


def test_a_cloud_in_millimeters_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The demo's, in a scene and alone."""
    cloud = rp.read_cloud(DEMO / "cloud.ply")
    rp.io.write_ply(tmp_path / "cloud.ply", replace(cloud, local_points=1000.0 * cloud.local_points))
    values = plain_value(yaml_node((DEMO / "scene.yaml").read_text()))
    values |= {"camera": str(DEMO / values["camera"]), "image": str(DEMO / values["image"]), "cloud": "cloud.ply"}
    values.pop("sensor_origin", None)
    region, *_ = values["regions"]
    region["world"]["seed"] = [1000.0 * value for value in region["world"]["seed"]]
    values["regions"] = [region]
    path = tmp_path / "scene.yaml"
    path.write_text(to_yaml(values))
    found = {warning.code for warning in scene_sides(load_scene(path)).warnings}
    assert "suspicious-unit" in found
    code, said = told(["info", str(tmp_path / "cloud.ply")], capsys)
    assert code == 0
    assert "look like millimeters: multiply the coordinates by 0.001 for meters" in said
    assert "millimeters" not in told(["info", str(DEMO / "cloud.ply")], capsys)[1]


WKT = 'COMPD_CS["x",PROJCS["p",GEOGCS["g",UNIT["degree",0.0174]],UNIT["{}",{}]],VERT_CS["v",UNIT["metre",1.0]]]'


@pytest.mark.parametrize(
    ("name", "factor", "is_told"),
    [("US survey foot", 1200.0 / 3937.0, True), ("metre", 1.0, False)],
)
def test_a_cloud_whose_file_states_feet_is_told(
    name: str, factor: float, is_told: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(version="1.4", point_format=6)
    header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(WKT.format(name, factor)))
    stored = laspy.LasData(header)
    stored.x, stored.y, stored.z = np.random.default_rng(0).uniform(0.0, 9.0, (3, 50))
    stored.write(tmp_path / "cloud.las")
    assert rp.read_cloud(tmp_path / "cloud.las").unit_m == pytest.approx(factor)
    code, said = told(["info", str(tmp_path / "cloud.las")], capsys)
    assert code == 0
    assert ("a unit of 0.3048006 m" in said) == is_told
    sides = scene_sides(load_scene(write_scene(tmp_path, scene_values() | {"cloud": "cloud.las"})))
    assert [warning.code for warning in sides.warnings] == ["suspicious-unit"] * is_told


def test_wide_scans_in_meters_are_not_taken_for_millimeters() -> None:
    """A terrestrial scan of 1 km, an airborne one of 5 km, a few far points."""
    for spacing, extent in ((0.3, 1000.0), (0.7, 7000.0), (5.0, 40.0)):
        assert unit_remark(spacing, extent) is None


def test_two_masks_of_one_surface_are_named(tmp_path: Path) -> None:
    values = scene_values()
    first = np.array(values["regions"][0]["image"]["polygon"])
    values["regions"][1]["image"]["polygon"] = (first + 0.2).tolist()
    found = [warning for warning in scene_sides(load_scene(write_scene(tmp_path, values))).warnings]
    assert [warning.code for warning in found] == ["duplicate-regions"]
    assert found[0].regions == (0, 1) and found[0].values["side"] == "image"


def test_two_clicks_on_one_surface_are_never_trusted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The photo is gray all over: both clicks grow all of it."""
    values = scene_values()
    for region, seed in zip(values["regions"], ([20.0, 20.0], [200.0, 100.0]), strict=True):
        region["image"] = {"seed": seed}
    path = write_scene(tmp_path, values)
    assert {warning.code for warning in scene_sides(load_scene(path)).warnings} == {"duplicate-regions", "leaked-mask"}
    code, said = told(["estimate", str(path), "--out", str(tmp_path / "result"), "--quiet"], capsys)
    assert "trusted:" not in said
    assert code in {2, 3} and "region 0 (floor) and region 1 (wall)" in said


def test_a_doubled_polygon_is_never_trusted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = scene_values()
    values["regions"].append({**deepcopy(values["regions"][0]), "name": "again"})
    path = write_scene(tmp_path, values)
    code, said = told(["estimate", str(path), "--out", str(tmp_path / "result"), "--quiet"], capsys)
    assert (code, "trusted:" in said) == (0, False)
    assert said.count("region 0 (floor) and region 2 (again)") == 2
    held = json.loads((tmp_path / "result" / "result.json").read_text())
    assert [warning["code"] for warning in held["warnings"]] == ["duplicate-regions"] * 2


def test_two_world_regions_of_one_place_are_named() -> None:
    plate = PLATES["wall"]
    image = [rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(each))) for each in PLATES.values()]
    turned = np.roll(plate[::-1], 2, axis=0) + np.array([0.0, 0.0, 0.004])
    (warning,) = rp.scene.check_regions(image, [rp.WorldRegion.from_polygon(ring) for ring in (plate, turned)])
    assert warning.code == "duplicate-regions" and warning.regions == (0, 1) and warning.values["side"] == "world"


def test_a_parallel_plate_and_a_framed_one_are_other_regions() -> None:
    plate = PLATES["floor"]
    image = [rp.ImageRegion.from_polygon(CAMERA.project(POSE.transform(each))) for each in PLATES.values()]
    middle = plate.mean(axis=0)
    for other in (plate + np.array([0.0, 0.0, 0.3]), middle + 0.9 * (plate - middle)):
        assert rp.scene.check_regions(image, [rp.WorldRegion.from_polygon(ring) for ring in (plate, other)]) == ()


@pytest.mark.parametrize(
    ("rows", "columns", "values"),
    [
        (slice(0, 80), slice(5, 95), {"fraction": 0.72, "sides": 1}),
        (slice(60, 100), slice(0, 100), {"fraction": 0.4, "sides": 3}),
        (slice(10, 70), slice(10, 70), None),
        (slice(0, 50), slice(0, 50), None),
    ],
)
def test_a_mask_that_leaked_is_named(rows: slice, columns: slice, values: dict[str, float] | None) -> None:
    mask = np.zeros((100, 100), dtype=bool)
    mask[rows, columns] = True
    found = rp.scene.check_regions([rp.ImageRegion.from_mask(mask)], [rp.WorldRegion.from_polygon(PLATES["wall"])])
    if values is None:
        assert found == ()
    else:
        (warning,) = found
        assert (warning.code, warning.regions) == ("leaked-mask", (0,))
        assert warning.values == pytest.approx(values, abs=5e-3)


def test_a_mask_that_leaked_is_told_where_regions_are_grown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = scene_values()
    values["regions"][0]["image"] = {"seed": [20.0, 20.0]}
    path = write_scene(tmp_path, values)
    code, said = told(["segment", str(path), "--out", str(tmp_path / "grown"), "--quiet"], capsys)
    assert code == 0
    assert "leaked-mask: the mask of region 0 (floor) covers 100 % of the photo" in said


def test_a_seed_in_the_air_is_refused() -> None:
    """A wall of 0.1 m spacing: 3 m before it there is nothing, 3 cm beside a point is the wall."""
    side = np.arange(0.0, 10.0, 0.1)
    wall = np.stack(np.meshgrid(side, [0.0], side), axis=-1).reshape(-1, 3)
    with pytest.raises(ValueError, match=r"is 3 m from the nearest point .*; needed a seed on a surface of the cloud"):
        rp.segment.grow_plane(wall, [5.0, 3.0, 5.0])
    assert len(rp.segment.grow_plane(wall, [5.03, 0.02, 5.03])) == len(wall)


@pytest.mark.skipif(not SHARED.exists(), reason="the shared scenes are not here")
@pytest.mark.parametrize("frame", ["kitti/000001", "kitti/000114", "kitti/sfnd32", "natural/kitti_000741"])
def test_a_seed_in_the_air_of_a_real_scan_is_refused(frame: str) -> None:
    points = np.fromfile(SHARED / frame / "points.bin", "<f4").reshape(-1, 4)[:, :3]
    for seed in ([70, -20, 30], [10, 5, 20]):
        with pytest.raises(ValueError, match="needed a seed on a surface of the cloud"):
            rp.segment.grow_plane(points, seed)
