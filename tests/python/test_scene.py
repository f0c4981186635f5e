from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from PIL import Image
from regionpose.clouds import Cloud
from regionpose.scene import SceneError, estimate_scene, load_scene, scene_result, scene_schema, scene_sides
from regionpose.scene.colours import coloured_cloud, overlay_depth, seen_pixels
from regionpose.scene.mask_files import read_mask
from regionpose.scene.result import exports, plain
from regionpose.scene.verdict import with_names
from scene_files import HEIGHT, PLATES, POSE, WIDTH, scene_values, write_scene
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
    "no YAML": ("regions:", "regions: [", ":5: "),
    "an alias": ("image: image.png", "image: *other", ":2: found an alias"),
    "an unknown solver": (
        "image: image.png",
        "solver: {system: cube}\nimage: image.png",
        ":2: solver.system: found 'cube'",
    ),
    "a number for a name": ("name: sign", "name: 7", ":10: regions[1].name: found 7; needed a string"),
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
    assert set(schema["properties"]) == {"camera", "image", "cloud", "regions", "prior", "solver"}
    assert schema["additionalProperties"] is False
    assert schema["required"] == ["camera", "image", "regions"]
    mappings = [item for item in schema["$defs"].values() if item["type"] == "object"]
    assert mappings and all(item["additionalProperties"] is False for item in mappings)
    json.dumps(schema, allow_nan=False)


def test_a_scene_of_polygons_gives_the_known_pose(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path)))
    assert (run.estimate.pose.rotation * POSE.rotation.inv()).magnitude() < 1e-6
    np.testing.assert_allclose(run.estimate.pose.translation, POSE.translation, atol=1e-6)
    assert set(run.seconds) == {"read files", "image regions", "world regions", "pose"}


def test_map_coordinates_lose_no_accuracy(tmp_path: Path) -> None:
    shift = (512_345.25, 5_405_678.5, 240.0)
    run = estimate_scene(load_scene(write_scene(tmp_path, scene_values(shift))))
    np.testing.assert_allclose(run.local_pose.camera_center + run.sides.origin, POSE.camera_center + shift, atol=1e-6)
    # The translation of a world that starts 5000 km away rounds to a nanometre.
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
        ({"image": "missing.png"}, r":9: image: .*missing\.png: no such file"),
        ({"image": "scene.yaml"}, r":9: image: .*found no picture"),
        ({"camera": "missing.yaml"}, r":1: camera: .*no such file"),
        ({"camera": {"file": "scene.yaml"}}, r":2: camera\.file: "),
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
    with pytest.raises(SceneError, match=r"image: found 20 x 10 pixels; needed 320 x 240"):
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
    ids=str,
)
def test_a_plate_of_points_is_found_in_every_way(world: dict[str, Any], tmp_path: Path) -> None:
    region = region_from_cloud(tmp_path, world)
    # The lattice ends half a spacing inside the outline at the most.
    assert 0.98 * 0.58 - 1e-6 <= region.area <= 1.0 * 0.6 + 0.02
    assert abs(region.normal[2]) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("world", "said"),
    [
        ({"points": [0, 1, 99_999]}, "found 3 indices from 0 to 99999; needed at least 3 from 0 to 1699"),
        ({"points": "labels.npy", "label": 9}, "found no point of the label 9"),
        ({"points": "missing.npy"}, "no such file"),
        ({"points": "cloud.xyz.npy"}, "no such file"),
        ({"seed": [0.5, 0.3, 0.0], "intensity_tolerance": 5}, "cloud without intensity"),
        ({"seed": [50.0, 30.0, 9.0]}, r"regions\[0\]\.world\.seed: "),
    ],
)
def test_points_that_give_no_region_are_named(world: dict[str, Any], said: str, tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=said):
        region_from_cloud(tmp_path, world)


def test_masks_are_read_by_value_and_by_label(tmp_path: Path) -> None:
    labels = np.zeros((6, 8), dtype=np.uint8)
    labels[1:3, 1:4], labels[4:, 5:] = 2, 7
    Image.fromarray(labels).save(tmp_path / "labels.png")
    Image.fromarray(np.where(labels == 2, 255, 0).astype(np.uint8)).convert("RGB").save(tmp_path / "mask.png")
    assert (read_mask(tmp_path / "labels.png", 7) == (labels == 7)).all()
    assert (read_mask(tmp_path / "mask.png") == (labels == 2)).all()
    with pytest.raises(ValueError, match=r"found 2 values besides 0; needed one, or the key label \(2, 7\)"):
        read_mask(tmp_path / "labels.png")
    with pytest.raises(ValueError, match=r"no pixel of the label 5; needed one of 2, 7"):
        read_mask(tmp_path / "labels.png", 5)


def test_the_result_says_the_pose_both_ways_and_is_json(tmp_path: Path) -> None:
    result = json.loads(json.dumps(scene_result(estimate_scene(load_scene(write_scene(tmp_path)))), allow_nan=False))
    forward, back = (np.array(result[key]["matrix"]) for key in ("camera_from_world", "world_from_camera"))
    np.testing.assert_allclose(forward @ back, np.eye(4), atol=1e-12)
    np.testing.assert_allclose(result["camera_center_in_world_m"], back[:3, 3], atol=1e-12)
    quaternion = Rotation.from_quat(result["camera_from_world"]["quat_xyzw"]).as_matrix()
    np.testing.assert_allclose(quaternion, forward[:3, :3], atol=1e-12)
    np.testing.assert_allclose(np.sqrt(np.diag(result["covariance"]))[3:], result["translation_sigma_m"], rtol=1e-12)
    assert [region["name"] for region in result["regions"]] == list(PLATES)
    assert {entry["path"] for entry in result["inputs"]} == {"scene.yaml", "image.png"}
    assert all(len(entry["sha256"]) == 64 for entry in result["inputs"])


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


def test_warnings_name_regions() -> None:
    assert with_names("region 1 misses, region 9 too", ("door", "sign")) == "region 1 (sign) misses, region 9 too"


def two_walls() -> NDArrayPair:
    """Points on a near patch, and on a far wall of which the patch hides the middle."""
    axis = np.linspace(-1.0, 1.0, 61)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    far = np.column_stack([2.5 * x, 1.8 * y, np.full(x.size, 6.0)])
    near = np.column_stack([0.4 * x, 0.4 * y, np.full(x.size, 2.0)])
    return near, far


NDArrayPair = tuple[np.ndarray[Any, np.dtype[np.float64]], np.ndarray[Any, np.dtype[np.float64]]]
CAMERA = rp.PinholeCamera(300.0, 300.0, 159.5, 119.5, width=WIDTH, height=HEIGHT)
AT_ORIGIN = rp.Pose(Rotation.identity(), np.zeros(3))


def test_points_behind_others_are_not_seen() -> None:
    near, far = two_walls()
    _, visible = seen_pixels(np.concatenate([near, far]), (HEIGHT, WIDTH), CAMERA, AT_ORIGIN)
    hidden = (np.abs(far[:, :2]) < 3.0 * 0.4 - 0.15).all(axis=1)
    clear = (np.abs(far[:, :2]) > 3.0 * 0.4 + 0.25).any(axis=1) & (np.abs(far[:, 0]) < 3.1) & (np.abs(far[:, 1]) < 2.3)
    assert visible[: len(near)].all()
    assert not visible[len(near) :][hidden].any()
    assert visible[len(near) :][clear].all()


def test_a_cloud_takes_the_colours_it_projects_to() -> None:
    near, _ = two_walls()
    behind = np.array([[0.0, 0.0, -2.0]])
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    picture = np.stack([columns * 0.7, rows, np.full((HEIGHT, WIDTH), 9)], axis=-1).astype(np.uint8)
    before = np.full((len(near) + 1, 3), 77, dtype=np.uint8)
    cloud = Cloud(np.concatenate([near, behind]), colours=before)
    coloured, visible = coloured_cloud(cloud, picture, CAMERA, AT_ORIGIN)
    pixels = CAMERA.project(near)
    assert coloured.colours is not None
    np.testing.assert_allclose(coloured.colours[:-1, 1], pixels[:, 1], atol=0.51)
    np.testing.assert_allclose(coloured.colours[:-1, 0], 0.7 * pixels[:, 0], atol=1.51)
    assert not visible[-1] and coloured.colours[-1].tolist() == [77, 77, 77]
    assert coloured.fields["visible"].sum() == len(near)


def test_the_depth_picture_marks_near_points_yellow_and_far_ones_violet() -> None:
    near, far = two_walls()
    picture = overlay_depth(np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.concatenate([near, far]), CAMERA, AT_ORIGIN)
    red, green, blue = picture[119, 159].astype(int)
    assert red > 200 and green > 200 and blue < 100
    x, y = np.rint(CAMERA.project(far[:1] * [0.9, 0.9, 1.0])[0]).astype(int)
    around = picture[y - 5 : y + 6, x - 5 : x + 6].reshape(-1, 3).max(axis=0)
    assert around[2] > around[1]


def test_the_documents_example_is_a_scene(tmp_path: Path) -> None:
    document = Path(__file__).resolve().parents[2] / "docs" / "scene-file.md"
    example = document.read_text(encoding="utf-8").partition("```yaml\n")[2].partition("```")[0]
    assert [region.name for region in load_scene(write(tmp_path, example)).model.regions] == ["door", "sign", "window"]


def test_every_public_name_is_found_when_first_used() -> None:
    import importlib

    fresh = importlib.reload(rp)
    assert all(getattr(fresh, name) is not None for name in fresh.__all__)
    assert set(fresh._HOMES) | {"__version__"} == set(fresh.__all__)
    assert fresh.cameras.PinholeCamera is rp.PinholeCamera
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        fresh.nothing  # noqa: B018
