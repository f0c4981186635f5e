from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
import shapely
from PIL import Image
from regionpose.scene import paths
from regionpose.scene.bundle import bundle, file_names
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.exposure import scene_sides
from regionpose.scene.loading import load_scene, scene_schema
from regionpose.scene.result import exports, plain, scene_result
from regionpose.scene.stages import Stages
from scene_files import CAMERA, HEIGHT, PLATES, POSE, WIDTH, scene_values, write_scene
from scipy.spatial.transform import Rotation

GOOD = """\
camera: {model: pinhole, fx: 3e2, fy: 300, cx: 159.5, cy: 119.5}
image: image.png
cloud: cloud.ply
regions:
  - name: door
    image:
      seed: [10, 20]
    world:
      seed: [1.0, 2.0, 3.0]
  - name: sign
    image:
      polygon: [[0, 0], [10, 0], [0, 10]]
    world:
      polygon: [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
"""

BAD = {
    "three numbers in a pixel": ("seed: [10, 20]", "seed: [10, 20, 3]", ":7: regions[0].image.seed: found 3 numbers"),
    "a word in a point": ("[1.0, 2.0, 3.0]", "[1.0, two, 3.0]", ":9: regions[0].world.seed: found 'two'"),
    "an unknown key": ("seed: [10, 20]", "sead: [10, 20]", ":6: regions[0].image: found the keys sead"),
    "a stray key beside a seed": (
        "seed: [10, 20]",
        "seed: [10, 20]\n      tol: 3",
        ":8: regions[0].image.tol: found an unknown key; needed one of seed, tolerance",
    ),
    "an unknown key at the top": (
        "image: image.png",
        "images: a.png\nimage: image.png",
        ":2: images: found an unknown",
    ),
    "no image": ("image: image.png\n", "", ":1: image: found nothing; needed this key"),
    "a negative focal length": ("fx: 3e2", "fx: -3e2", ":1: camera.fx: found -300.0; needed greater than 0"),
    "an unknown camera model": ("pinhole", "perspective", ":1: camera: found model 'perspective'"),
    "a polygon of two vertices": (
        "polygon: [[0, 0], [10, 0], [0, 10]]",
        "polygon: [[0, 0], [10, 0]]",
        ":12: regions[1].image.polygon: found 2 items; needed at least 3",
    ),
    "a vertex of two numbers": ("[0, 1, 0]]", "[0, 1]]", ":14: regions[1].world.polygon[2]: found 2 numbers"),
    "one name twice": ("name: sign", "name: door", ":10: regions[1].name: found 'door' twice"),
    "a key twice": ("image: image.png", "image: image.png\nimage: b.png", ":3: image: found the key twice"),
    "a seed without a cloud": ("cloud: cloud.ply\n", "", ":7: regions[0].world: found no cloud"),
    "no YAML": ("regions:", "regions: [", ":5:3: found '-'; needed a value, or the bracket that closes"),
    "a list as a key": ("image: image.png", "? [[image]]\n: image.png", ":2: found a key that is a list"),
    "a word that is not of its tag": (
        "image: image.png",
        "image: !!bool maybe",
        ":2:8: found 'maybe', which is no bool; needed one, or quotes around a text",
    ),
    "a tag of nothing": ("image: image.png", 'image: !!int ""', ":2:8: found '', which is no int"),
    "an alias": ("image: image.png", "image: *other", ":2: found an alias"),
    "an unknown solver": (
        "image: image.png",
        "solver: {system: cube}\nimage: image.png",
        ":2: solver.system: found 'cube'",
    ),
    "a number for a name": ("name: sign", "name: 7", ":10: regions[1].name: found 7; needed a string"),
    "a name of two lines": ("name: sign", 'name: "a\\nb"', ":10: regions[1].name: found the character U+000A; needed"),
    "a name that turns what follows": (
        "name: sign",
        'name: "a\\u202e"',
        ":10: regions[1].name: found the character U+202E",
    ),
    "a long name": ("name: sign", f"name: {'x' * 201}", ":10: regions[1].name: found 'xxx"),
    "an infinite number": ("[1.0, 2.0, 3.0]", "[1.0, .inf, 3.0]", ":9: regions[0].world.seed: found inf"),
}


def write(folder: Path, text: str, name: str = "scene.yaml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", BAD)
def test_a_bad_scene_is_refused_with_its_line(kind: str, tmp_path: Path) -> None:
    old, new, said = BAD[kind]
    assert old in GOOD
    path = write(tmp_path, GOOD.replace(old, new, 1))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert str(caught.value).startswith(f"{path}{said}"), str(caught.value)


def test_a_good_scene_is_read_with_numbers_of_yaml_1_2(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path, GOOD))
    assert scene.model.camera.model_dump()["fx"] == 300.0  # type: ignore[union-attr]
    assert [region.name for region in scene.model.regions] == ["door", "sign"]
    assert scene.file("image.png") == tmp_path / "image.png"


def test_json_scenes_name_their_lines_too(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][1]["image"] = {"seed": [1.0]}
    text = json.dumps(values, indent="\t")
    path = write(tmp_path, text, "scene.json")
    line = 1 + next(number for number, row in enumerate(text.splitlines()) if '"seed"' in row)
    with pytest.raises(SceneError, match=rf"scene\.json:{line}: regions\[1\]\.image\.seed: found 1 numbers"):
        load_scene(path)


@pytest.mark.parametrize("text", ["", "[]", "scene", "{", "\0", "a: !!python/object:os.system {}"])
def test_text_that_is_no_scene_is_refused(text: str, tmp_path: Path) -> None:
    for name in ("scene.yaml", "scene.json"):
        with pytest.raises(SceneError):
            load_scene(write(tmp_path, text, name))


def test_a_missing_scene_is_named(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"nowhere\.yaml: no such file"):
        load_scene(tmp_path / "nowhere.yaml")


def test_the_schema_knows_every_key_and_refuses_others() -> None:
    schema = scene_schema()
    lists = {"regions", "image_regions", "world_regions", "frames"}
    assert set(schema["properties"]) == {"camera", "image", "cloud", "sensor_origin", *lists, "prior", "solver"}
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["camera"]
    mappings = [item for item in schema["$defs"].values() if item["type"] == "object"]
    assert mappings and all(item["additionalProperties"] is False for item in mappings)
    json.dumps(schema, allow_nan=False)


def test_a_scene_of_polygons_gives_the_known_pose(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path)))
    assert (run.estimate.pose.rotation * POSE.rotation.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)
    assert set(run.seconds) == {"read files", "image regions", "world regions", "checks", "pose"}


@pytest.mark.parametrize("planes", [False, True])
def test_stages_tell_how_much_of_files_and_regions_is_done(planes: bool, tmp_path: Path) -> None:
    told: dict[str, list[float]] = {}
    stages = Stages(lambda name: told.setdefault(name, []), lambda share: told[next(reversed(told))].append(share))
    values = scene_values()
    across, along = np.meshgrid(np.arange(0.0, 1.0, 0.02), np.arange(0.0, 0.6, 0.02))
    np.savetxt(tmp_path / "cloud.xyz", np.column_stack([across.ravel(), along.ravel(), np.zeros(across.size)]))
    values["cloud"] = "cloud.xyz"
    values["regions"].append(values["regions"][0] | {"name": "plate", "world": {"seed": [0.5, 0.3, 0.0]}})
    if planes:
        values["world_regions"] = "planes"
        values["image_regions"] = [{"name": "some", "image": values["regions"][0]["image"]}]
    scene_sides(load_scene(write_scene(tmp_path, values)), stages)
    for name in ("read files", "image regions", "world regions"):
        assert told[name] == sorted(told[name]) and told[name][-1] == 1.0, name
    assert told["image regions"] == pytest.approx(np.arange(1, 4 + planes) / (3 + planes))
    assert len(told["world regions"]) > 4


def test_map_coordinates_lose_no_accuracy(tmp_path: Path) -> None:
    shift = (512_345.25, 5_405_678.5, 240.0)
    run = estimate_scene(load_scene(write_scene(tmp_path, scene_values(shift))))
    np.testing.assert_allclose(run.local_pose.camera_center + run.sides.origin, POSE.camera_center + shift, atol=1e-6)
    # The translation of a world that starts 5000 km away rounds to a nanometer.
    np.testing.assert_allclose(run.estimate.pose.camera_center, POSE.camera_center + shift, atol=1e-5)
    np.testing.assert_allclose(run.sides.origin, [512_300.0, 5_405_700.0, 0.0])


@pytest.mark.parametrize("key", ["camera_from_world", "world_from_camera"])
@pytest.mark.parametrize("form", ["quaternion", "matrix"])
def test_an_initial_pose_is_read_either_way(key: str, form: str, tmp_path: Path) -> None:
    pose = POSE if key == "camera_from_world" else POSE.inverse()
    item: dict[str, Any] = {"matrix": pose.matrix.tolist()}
    if form == "quaternion":
        item = {"quat_xyzw": pose.rotation.as_quat().tolist(), "translation_m": pose.translation.tolist()}
    values = scene_values()
    values["prior"] = {"up": [0.0, -1.0, 0.0], "initial": {key: item}}
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)


def test_a_matrix_that_is_no_pose_is_refused_with_its_line(tmp_path: Path) -> None:
    values = scene_values()
    values["prior"] = {"initial": {"camera_from_world": {"matrix": (2.0 * np.eye(4)).tolist()}}}
    with pytest.raises(SceneError, match=r"scene\.yaml:\d+: prior\.initial\.camera_from_world: "):
        estimate_scene(load_scene(write_scene(tmp_path, values)))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"image": "missing.png"}, r":2: image: .*missing\.png: no such file"),
        ({"image": "scene.yaml"}, r":2: image: .*found no picture"),
        ({"camera": "missing.yaml"}, r":1: camera: .*no such file"),
        ({"camera": {"file": "scene.yaml"}}, r":1: camera\.file: "),
        ({"cloud": "image.png"}, r":\d+: cloud: .*needed one of"),
    ],
)
def test_files_that_cannot_be_used_are_named_with_the_line(change: dict[str, Any], said: str, tmp_path: Path) -> None:
    path = write_scene(tmp_path, {**scene_values(), **change})
    with pytest.raises(SceneError, match=r"scene\.yaml" + said):
        scene_sides(load_scene(path))


def test_an_image_of_another_size_than_the_calibration_is_refused(tmp_path: Path) -> None:
    path = write_scene(tmp_path)
    Image.fromarray(np.zeros((10, 20, 3), dtype=np.uint8)).save(tmp_path / "image.png")
    with pytest.raises(SceneError, match=r"image: found 20 x 10 pixels .cut, .*; needed the calibrated 320 x 240"):
        scene_sides(load_scene(path))


def region_from_cloud(folder: Path, world: dict[str, Any]) -> rp.WorldRegion:
    """The world side of a scene whose cloud is a plate of points on a 2 cm lattice, beside stray points."""
    lattice = np.stack(np.meshgrid(np.arange(0.0, 1.0, 0.02), np.arange(0.0, 0.6, 0.02)), axis=-1).reshape(-1, 2)
    plate = np.column_stack([lattice, np.zeros(len(lattice))])
    points = np.concatenate([plate, plate[:200] + np.array([0.0, 0.0, 3.0])])
    np.savetxt(folder / "cloud.xyz", points)
    labels = np.r_[np.full(len(plate), 4), np.zeros(200, dtype=int)]
    np.save(folder / "labels.npy", labels)
    np.savez(folder / "labels.npz", labels=labels)
    np.save(folder / "mask.npy", labels == 4)
    np.save(folder / "indices.npy", np.arange(len(plate)))
    np.save(folder / "points.npy", plate)
    np.save(folder / "column.npy", np.arange(9)[:, None])
    np.save(folder / "pairs.npy", plate[:9, :2])
    values = {**scene_values(), "cloud": "cloud.xyz"}
    values["regions"][0]["world"] = world
    return scene_sides(load_scene(write_scene(folder, values))).world_sides[0].region


@pytest.mark.parametrize(
    "world",
    [
        {"points": list(range(1500))},
        {"points": "labels.npy", "label": 4},
        {"points": "labels.npz", "label": 4},
        {"points": "mask.npy"},
        {"points": "indices.npy"},
        {"points": "points.npy"},
        {"seed": [0.5, 0.3, 0.0]},
    ],
    ids=lambda world: str(world)[:50],
)
def test_a_plate_of_points_is_found_in_every_way(world: dict[str, Any], tmp_path: Path) -> None:
    region = region_from_cloud(tmp_path, world)
    # The lattice ends half a spacing inside the outline at the most.
    assert 0.98 * 0.58 - 1e-6 <= region.area <= 1.0 * 0.6 + 0.02
    assert abs(region.normal[2]) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ({"points": [0, 1, 99_999]}, "indices: found 3 from 0 to 99999; needed indices from 0 to 1699"),
        ({"points": "labels.npy", "label": 9}, "found no point of the label 9"),
        ({"points": [0, 1, 2], "label": 4}, "found label 4 beside indices in the scene file; needed it with a file"),
        ({"points": "points.npy", "label": 4}, r"found label 4 beside the points of .*points\.npy; needed it with"),
        ({"points": "missing.npy"}, "no such file"),
        ({"points": "column.npy"}, r"column.npy: found int64 of shape \(9, 1\); needed points \(n, 3\), or indices"),
        ({"points": "pairs.npy"}, r"pairs.npy: found float64 of shape \(9, 2\); needed points \(n, 3\)"),
        ({"points": "cloud.xyz.npy"}, "no such file"),
        ({"seed": [0.5, 0.3, 0.0], "intensity_tolerance": 5}, "cloud without intensity"),
        ({"seed": [50.0, 30.0, 9.0]}, r"regions\[0\]\.world\.seed: "),
    ],
)
def test_points_that_give_no_region_are_named(world: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=said):
        region_from_cloud(tmp_path, world)


def label_files(folder: Path) -> np.ndarray[Any, Any]:
    """Labels (h, w), in a picture, a COCO and a labelme file of the same two rectangles."""
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    labels[20:100, 30:150], labels[120:200, 160:300] = 2, 7
    Image.fromarray(labels).save(folder / "labels.png")
    rings = {
        "door": [[30, 20], [150, 20], [150, 100], [30, 100]],
        "sign": [[160, 120], [300, 120], [300, 200], [160, 200]],
    }
    shapes = [{"label": name, "shape_type": "polygon", "points": ring} for name, ring in rings.items()]
    size = {"imageHeight": HEIGHT, "imageWidth": WIDTH}
    (folder / "labelme.json").write_text(json.dumps({"shapes": shapes, **size}), encoding="utf-8")
    names = list(rings)
    coco = {
        "images": [{"id": 1, "file_name": "image.png", "height": HEIGHT, "width": WIDTH}],
        "categories": [{"id": k, "name": name} for k, name in enumerate(names)],
        "annotations": [
            {"id": 10 + k, "image_id": 1, "category_id": k, "segmentation": [np.ravel(rings[name]).tolist()]}
            for k, name in enumerate(names)
        ],
    }
    (folder / "coco.json").write_text(json.dumps(coco), encoding="utf-8")
    return labels


@pytest.mark.parametrize(
    "image",
    [
        {"mask": "labels.png", "label": 7},
        {"mask": "labels.png", "label": "7"},
        {"mask": "labelme.json", "label": "sign"},
        {"mask": "coco.json", "label": "sign"},
        {"mask": "coco.json", "label": 11},
        {"mask": "coco.json", "label": "sign", "image": "image.png"},
    ],
    ids=str,
)
def test_masks_are_read_from_label_images_coco_and_labelme_files(image: dict[str, Any], tmp_path: Path) -> None:
    label_files(tmp_path)
    values = scene_values()
    values["regions"][0]["image"] = image
    region = scene_sides(load_scene(write_scene(tmp_path, values))).image_regions[0]
    low, high = (function(region.rings[0], axis=0) for function in (np.min, np.max))
    assert region.area == pytest.approx(140 * 80, rel=0.001)
    np.testing.assert_allclose([low, high], [[159.5, 119.5], [299.5, 199.5]], atol=0.5)


@pytest.mark.parametrize(
    ("image", "said"),
    [
        ({"mask": "labels.png"}, "labels.png"),
        ({"mask": "labels.png", "label": 5}, "5"),
        ({"mask": "labelme.json", "label": "window"}, "window"),
        ({"mask": "small.png"}, "found masks of 8 x 6 pixels; needed 320 x 240"),
        ({"mask": "labels.png", "label": 1.5}, r"found 1\.5; needed "),
    ],
)
def test_masks_that_give_no_region_are_named_with_their_line(image: dict[str, Any], said: str, tmp_path: Path) -> None:
    label_files(tmp_path)
    Image.fromarray(np.eye(6, 8, dtype=np.uint8)).save(tmp_path / "small.png")
    values = scene_values()
    values["regions"][0]["image"] = image
    with pytest.raises(SceneError, match=rf"scene\.yaml:\d+: regions\[0\]\.image\.(mask|label): .*{said}"):
        scene_sides(load_scene(write_scene(tmp_path, values)))


def turned(degrees: float, shift: float) -> rp.Pose:
    """The scene's pose, off by a turn and a shift."""
    rotation = Rotation.from_euler("y", degrees, degrees=True) * POSE.rotation
    return rp.Pose(rotation, POSE.translation + np.array([shift, 0.0, 0.0]))


def test_overlap_errors_at_the_estimate_are_the_estimates(tmp_path: Path) -> None:
    values = scene_values()
    values["regions"][0]["image"]["polygon"][0][0] += 3.0
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    whole, errors = run.sides.overlap_errors(run.estimate.pose)
    np.testing.assert_allclose(errors, run.estimate.diagnostics.region_overlap_errors, rtol=1e-9)
    assert whole == pytest.approx(run.estimate.diagnostics.overlap_error, rel=1e-9)
    assert (errors > 1e-4).any()


def test_overlap_errors_at_another_pose_are_the_area_that_differs(tmp_path: Path) -> None:
    sides = scene_sides(load_scene(write_scene(tmp_path)))
    pose = turned(0.6, 0.05)
    _, errors = sides.overlap_errors(pose)
    for error, observed, plate in zip(errors, sides.image_regions, PLATES.values(), strict=True):
        truth = shapely.Polygon(observed.rings[0])
        other = shapely.Polygon(CAMERA.project(pose.transform(plate)))
        # The solver's areas are solid angles; within a small region they are in proportion to the pixels'.
        assert error == pytest.approx(truth.symmetric_difference(other).area / truth.area, rel=0.05)
    # Behind the camera nothing is shown: all of each region is missed.
    whole, errors = sides.overlap_errors(rp.Pose(POSE.rotation, POSE.translation - [0.0, 0.0, 9.0]))
    assert whole == 1.0 and (errors == 1.0).all()


def test_an_initial_pose_adds_the_errors_before_and_its_picture(tmp_path: Path) -> None:
    values = scene_values((20_000.0, 0.0, 0.0))
    start = turned(2.0, 0.1)
    moved = rp.Pose(start.rotation, start.translation - start.rotation.apply([20_000.0, 0.0, 0.0]))
    values["prior"] = {"initial": {"camera_from_world": {"matrix": moved.matrix.tolist()}}}
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    made = bundle(run, Stages())
    assert set(made.writers) == set(file_names(run.sides.scene)) >= {"overlay.png", "overlay_before.png"}
    for region, error in zip(made.result["diagnostics"]["regions"], run.sides.overlap_errors(moved)[1], strict=True):
        assert region["overlap_error_before"] == pytest.approx(error, rel=1e-6)
        assert region["overlap_error_before"] > 0.05 > region["overlap_error"]
    for name in ("overlay.png", "overlay_before.png", "report.html"):
        made.writers[name](tmp_path / name)
    assert (tmp_path / "overlay.png").read_bytes() != (tmp_path / "overlay_before.png").read_bytes()
    html = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.count("<figure>") == 2 and "overlap error before" in html


@pytest.mark.parametrize("start", ["global", "paper"])
def test_without_an_initial_pose_there_is_no_before(start: str, tmp_path: Path) -> None:
    scene = load_scene(write_scene(tmp_path, {**scene_values(), "solver": {"start": start}}))
    assert "overlay_before.png" not in file_names(scene)
    regions = scene_result(estimate_scene(scene))["diagnostics"]["regions"]
    assert all("overlap_error_before" not in region for region in regions)


def test_the_result_says_the_pose_both_ways_and_is_json(tmp_path: Path) -> None:
    result = json.loads(json.dumps(scene_result(estimate_scene(load_scene(write_scene(tmp_path)))), allow_nan=False))
    forward, back = (np.array(result[key]["matrix"]) for key in ("camera_from_world", "world_from_camera"))
    np.testing.assert_allclose(forward @ back, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(result["camera_center_in_world_m"], back[:3, 3], atol=1e-12)
    quaternion = Rotation.from_quat(result["camera_from_world"]["quat_xyzw"]).as_matrix()
    np.testing.assert_allclose(quaternion, forward[:3, :3], atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(result["covariance"]))[3:], result["sigma"]["translation_m"], rtol=1e-12)
    assert [region["name"] for region in result["diagnostics"]["regions"]] == list(PLATES)
    assert {entry["path"] for entry in result["inputs"]} == {"scene.yaml", "image.png"}
    assert all(len(entry["sha256"]) == 64 for entry in result["inputs"])


def test_the_paths_of_a_result_lead_from_its_file(tmp_path: Path) -> None:
    """Wherever it is written, and by whatever path the scene was named; links keep their names."""
    store, photos, out = tmp_path / "store", tmp_path / "photos", tmp_path / "deep" / "out"
    for folder in (store, photos, out):
        folder.mkdir(parents=True)
    scene = write_scene(photos)
    (photos / "image.png").rename(store / "0f3a")
    (photos / "image.png").symlink_to(store / "0f3a")
    run = estimate_scene(load_scene(photos / ".." / "photos" / scene.name))
    made = bundle(run, Stages(), folder=out).result
    assert (made["scene"], made["image"]) == ("../../photos/scene.yaml", "../../photos/image.png")
    assert [entry["path"] for entry in made["inputs"]] == [made["scene"], made["image"]]
    beside = scene_result(run)
    assert (beside["scene"], beside["image"]) == ("scene.yaml", "image.png")


def test_a_path_to_another_drive_is_absolute(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def apart(*_: object) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr("os.path.relpath", apart)
    assert paths.relative(tmp_path / "a.png", tmp_path / "out") == (tmp_path.resolve() / "a.png").as_posix()


def test_exports_are_the_pose_in_other_tools_words() -> None:
    held = exports(POSE)
    numbers = np.asarray(held["direct_visual_lidar_calibration"]["T_lidar_camera"])
    lidar_from_camera = rp.Pose(Rotation.from_quat(numbers[3:]), numbers[:3])
    np.testing.assert_allclose(lidar_from_camera.inverse().matrix, POSE.matrix, atol=1e-12)
    words = held["kitti_Tr_velo_to_cam"].removeprefix("Tr_velo_to_cam: ").split()
    np.testing.assert_allclose(np.array(words, dtype=float).reshape(3, 4), POSE.matrix[:3], atol=1e-11)


def test_numbers_that_json_lacks_become_null() -> None:
    given = {"a": np.array([1.0, np.nan]), "b": (np.float64("inf"), np.int64(3)), "c": True}
    assert plain(given) == {"a": [1.0, None], "b": [None, 3], "c": True}


def test_warnings_name_their_regions_whatever_these_are_called() -> None:
    warning = rp.PoseWarning(rp.WarningCode.DUPLICATE_REGIONS, (1, 0), {"fraction": 0.5, "side": "{all}"})
    assert str(warning).startswith("duplicate-regions: region 1 and region 0 are one region on the {all} side")
    assert warning.text_with(("{0}", "region 0")).startswith("region 1 (region 0) and region 0 ({0}) are")
    assert hash(warning) == hash(replace(warning)) and warning == replace(warning)


def test_the_documents_example_is_a_scene(tmp_path: Path) -> None:
    document = Path(__file__).resolve().parents[3] / "docs" / "scene-file.md"
    example = document.read_text(encoding="utf-8").partition("```yaml\n")[2].partition("```")[0]
    assert [region.name for region in load_scene(write(tmp_path, example)).model.regions] == ["door", "sign", "window"]


def test_every_public_name_is_found_when_first_used() -> None:
    import importlib

    fresh = importlib.reload(rp)
    assert all(getattr(fresh, name) is not None for name in fresh.__all__)
    with pytest.raises(AttributeError, match="attribute nothing"):
        fresh.nothing  # noqa: B018
