"""`regionpose calibrate`: a folder of photos and clouds as one scene, and its errors by pair."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run
from PIL import Image
from regionpose import Pose
from regionpose.cli.console import Progress
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.document import SceneError
from regionpose.scene.exposure import scene_sides
from regionpose.scene.folder import FolderOptions, folder_scene
from regionpose.scene.paths import rebased
from scene_files import CAMERA, HEIGHT, PLATES, POSE, WIDTH, scene_values
from skimage.draw import polygon2mask

SHIFTS = {"0001": (0.0, 0.0, 0.0), "0002": (0.3, -0.2, 0.5), "0003": (-0.3, 0.1, 1.0)}
"""How the plates stand in each pair, meters."""


def outlines(shift: tuple[float, float, float]) -> dict[str, np.ndarray]:
    """The plates' rings in the photo, pixels."""
    return {name: CAMERA.project(POSE.transform(plate + shift)) for name, plate in PLATES.items()}


def write_pair(folder: Path, name: str) -> None:
    """A gray photo, and the plates as a dense cloud."""
    Image.fromarray(np.full((HEIGHT, WIDTH, 3), 128, dtype=np.uint8)).save(folder / f"{name}.png")
    generator, points = np.random.default_rng(0), []
    for plate in PLATES.values():
        shares = generator.uniform(0.0, 1.0, (12_000, 2))
        shares = shares[shares.min(axis=1) < 0.4]
        points.append(plate[0] + shares[:, :1] * (plate[1] - plate[0]) + shares[:, 1:] * (plate[5] - plate[0]))
    np.save(folder / f"{name}.npy", np.concatenate(points) + SHIFTS[name])


def write_yaml(path: Path, values: dict[str, Any]) -> None:
    path.write_text(to_yaml(values), encoding="utf-8")


def filled(ring: np.ndarray) -> np.ndarray:
    """The mask (h, w) of a ring of pixels."""
    mask: np.ndarray = polygon2mask((HEIGHT, WIDTH), ring[:, ::-1])  # type: ignore[no-untyped-call]
    return mask


def write_masks(folder: Path, name: str) -> None:
    for region, ring in outlines(SHIFTS[name]).items():
        Image.fromarray(np.where(filled(ring), 255, 0).astype(np.uint8)).save(folder / f"{name}-{region}.png")


def labelme(name: str) -> dict[str, Any]:
    """A labelme file of a photo, whose pixels count from the corner."""
    rings = outlines(SHIFTS[name])
    shapes = [{"label": region, "points": (ring + 0.5).tolist()} for region, ring in rings.items()]
    return {"shapes": shapes, "imageHeight": HEIGHT, "imageWidth": WIDTH}


def coco(names: list[str]) -> dict[str, Any]:
    """A COCO file of several photos."""
    images = [{"id": k, "file_name": f"{name}.png", "height": HEIGHT, "width": WIDTH} for k, name in enumerate(names)]
    annotations = [
        {"image_id": k, "category_id": c, "segmentation": [(ring + 0.5).ravel().tolist()]}
        for k, name in enumerate(names)
        for c, ring in enumerate(outlines(SHIFTS[name]).values())
    ]
    return {
        "images": images,
        "annotations": annotations,
        "categories": [{"id": c, "name": region} for c, region in enumerate(PLATES)],
    }


def worlds(name: str) -> list[dict[str, Any]]:
    """The plates in a pair's cloud, by the middle of their long arm."""
    seeds = {region: plate[:2].mean(axis=0) + 0.2 * (plate[5] - plate[0]) for region, plate in PLATES.items()}
    return [{"name": region, "world": {"seed": (s + SHIFTS[name]).tolist()}} for region, s in seeds.items()]


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    """A folder of three pairs: by its own scene file, by labelme and seeds, and by masks and planes."""
    folder = tmp_path / "drive"
    folder.mkdir()
    for name in SHIFTS:
        write_pair(folder, name)
    values = scene_values(SHIFTS["0001"])
    write_yaml(folder / "0001.yaml", {"camera": values["camera"], "regions": values["regions"]})
    (folder / "0002.json").write_text(json.dumps(labelme("0002")), encoding="utf-8")
    write_yaml(folder / "0002.yaml", {"world_regions": worlds("0002"), "sensor_origin": None})
    write_masks(folder, "0003")
    return folder


def pose_of(result: dict[str, Any]) -> Pose:
    return Pose.from_matrix(result["camera_from_world"]["matrix"])


def turn_from_truth(pose: Pose) -> float:
    return float(np.degrees((pose.rotation * POSE.rotation.inv()).magnitude()))


@pytest.mark.slow
def test_a_folder_gives_the_pose_that_its_scene_file_gives(
    rig: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    out, again, stages = tmp_path / "out", tmp_path / "again", list[str]()
    monkeypatch.setattr(Progress, "begin", lambda _, stage: stages.append(stage))
    code, said, errors = run(capsys, "calibrate", rig, "--out", out, "--json")
    assert code in (0, 3) and errors == "", errors
    assert {"frame 2 of 3, 0002: world regions", "frame 3 of 3, 0003: matching"} < set(stages)
    result = json.loads(said)
    assert turn_from_truth(pose_of(result)) < 0.3
    assert np.linalg.norm(pose_of(result).camera_center - POSE.camera_center) < 0.03
    names = [region["name"] for region in result["diagnostics"]["regions"]]
    assert names == ["0001: floor", "0001: wall", "0002: floor", "0002: wall", "0003: floor", "0003: wall"]
    assert {"scene.yaml", "overlay_3.png", "report.html"} <= {path.name for path in out.iterdir()}
    code_again, said, _ = run(capsys, "estimate", out / "scene.yaml", "--out", again, "--json", "--quiet")
    repeated = json.loads(said)
    assert code_again == code
    assert repeated["scene"] == "../out/scene.yaml" and result["scene"] == "scene.yaml"
    assert {"../drive/0001.png", "../drive/0001.npy"} <= {entry["path"] for entry in result["inputs"]}
    assert all((out / entry["path"]).is_file() for entry in result["inputs"])
    repeated["inputs"][0]["path"] = result["inputs"][0]["path"]
    different = {"seconds", "scene"}
    assert {k: v for k, v in repeated.items() if k not in different} == {
        k: v for k, v in result.items() if k not in different
    }


def frames_of(folder: Path, **options: Any) -> list[dict[str, Any]]:
    """The frames of a folder's scene, as its file will hold them."""
    scene, _ = folder_scene(folder, folder / "scene.yaml", FolderOptions(**options))
    held = scene.document.value
    assert isinstance(held, dict)
    frames: list[dict[str, Any]] = held["frames"]
    return frames


def test_regions_of_one_name_are_pairs_and_the_others_are_matched(rig: Path) -> None:
    write_yaml(
        rig / "0002.yaml", {"world_regions": [*worlds("0002")[:1], {"name": "far", "world": {"seed": [9, 9, 9]}}]}
    )
    _, second, third = frames_of(rig)
    assert [one["name"] for one in second["regions"]] == ["floor"]
    assert second["regions"][0]["image"] == {"mask": "0002.json", "label": "floor"}
    assert [one["name"] for one in second["image_regions"]] == ["wall"]
    assert [one["name"] for one in second["world_regions"]] == ["far"]
    assert [one["image"] for one in third["image_regions"]] == [{"mask": "0003-floor.png"}, {"mask": "0003-wall.png"}]
    assert third["world_regions"] == "planes"


@pytest.mark.slow
def test_one_coco_file_holds_the_regions_of_all_photos(rig: Path) -> None:
    file = rig.parent / "all.json"
    file.write_text(json.dumps(coco(list(SHIFTS))), encoding="utf-8")
    (rig / "0002.json").unlink()
    for mask in rig.glob("0003-*.png"):
        mask.unlink()
    (rig.parent / "out").mkdir()
    scene, _ = folder_scene(rig, rig.parent / "out" / "scene.yaml", FolderOptions(coco=file))
    third = scene.frames[2].model.image_regions
    assert [one.image.model_dump(exclude_unset=True) for one in third] == [
        {"mask": "../all.json", "label": name, "image": "0003.png"} for name in PLATES
    ]
    ring = scene_sides(scene.frames[2]).unpaired.image_regions[0].rings[0]
    assert np.abs(ring[:, None] - outlines(SHIFTS["0003"])["floor"]).sum(axis=2).min(axis=1).max() < 1e-6


def test_what_segment_made_of_a_pair_is_taken(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Masks and indices, which may be mended by hand, in place of the seeds that they were grown from."""
    values = {"camera": scene_values()["camera"], "image": "0003.png", "cloud": "0003.npy", "regions": []}
    for one in worlds("0003"):
        values["regions"].append({**one, "image": {"mask": f"0003-{one['name']}.png"}})
    write_yaml(rig / "0003.yaml", values)
    code, _, errors = run(capsys, "segment", rig / "0003.yaml", "--out", rig / "0003-regions", "--quiet")
    assert code == 0, errors
    third = frames_of(rig)[2]
    assert third["image"] == "0003.png" and third["cloud"] == "0003.npy"
    held = [(one["image"]["mask"], one["world"]["points"]) for one in third["regions"]]
    assert held == [(f"0003-regions/0{k}-{n}.png", f"0003-regions/0{k}-{n}.npy") for k, n in enumerate(PLATES, start=1)]


def test_the_image_of_a_coco_file_is_no_path() -> None:
    held = {"image": "a.png", "regions": [{"image": {"mask": "all.json", "image": "a.png", "unknown": "b.json"}}]}
    own = rebased(held, Path("drive"), Path())
    assert own["image"] == "drive/a.png"
    assert own["regions"][0]["image"] == {"mask": "drive/all.json", "image": "a.png", "unknown": "drive/b.json"}


def test_a_label_image_holds_several_regions(rig: Path) -> None:
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    for value, (name, ring) in enumerate(outlines(SHIFTS["0003"]).items(), start=4):
        labels[filled(ring)] = value
        (rig / f"0003-{name}.png").unlink()
    Image.fromarray(labels).save(rig / "0003-faces.png")
    held = [(one["name"], one["image"]["label"]) for one in frames_of(rig)[2]["image_regions"]]
    assert held == [("faces 4", 4), ("faces 5", 5)]


def test_a_place_of_the_scanner_holds_for_pairs_that_say_none(rig: Path) -> None:
    first, second, third = frames_of(rig, sensor_origin=[0.0, 1.0, 2.0])
    assert first["sensor_origin"] == third["sensor_origin"] == [0.0, 1.0, 2.0]
    assert second["sensor_origin"] is None


def test_a_camera_that_is_given_goes_before_the_pairs(
    rig: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    scene, _ = folder_scene(
        rig, tmp_path / "out" / "scene.yaml", FolderOptions({"file": "calib.yaml", "model": "pinhole"})
    )
    assert scene.document.value["camera"] == {"file": "../calib.yaml", "model": "pinhole"}  # type: ignore[index]


def test_a_photo_without_a_cloud_is_left_out_and_told(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (rig / "0002.npy").unlink()
    code, _, errors = run(capsys, "calibrate", rig, "--out", rig / "out")
    assert code in (0, 3)
    assert errors == "left out, no cloud of the name: 0002.png\n"


def test_nothing_is_replaced_or_left_behind(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = rig / "out"
    out.mkdir()
    (out / "scene.yaml").write_text("mine", encoding="utf-8")
    code, _, errors = run(capsys, "calibrate", rig, "--out", out, "--quiet")
    assert code == 2 and "scene.yaml: the file exists" in errors
    assert [path.name for path in out.iterdir()] == ["scene.yaml"]


def no_camera(rig: Path) -> None:
    write_yaml(rig / "0001.yaml", {"regions": scene_values()["regions"]})


def other_camera(rig: Path) -> None:
    write_yaml(
        rig / "0002.yaml", {"world_regions": worlds("0002"), "camera": {**scene_values()["camera"], "fx": 310.0}}
    )


def no_regions(rig: Path) -> None:
    for mask in rig.glob("0003-*.png"):
        mask.unlink()


def two_clouds(rig: Path) -> None:
    (rig / "0003.xyz").write_text("0 0 0\n", encoding="utf-8")


def two_photos(rig: Path) -> None:
    Image.new("RGB", (WIDTH, HEIGHT)).save(rig / "0003.jpg")


def other_photo(rig: Path) -> None:
    write_yaml(rig / "0002.yaml", {"world_regions": worlds("0002"), "image": "0001.png"})


def unknown_key(rig: Path) -> None:
    (rig / "0002.yaml").write_text("# seeds\nworld_region: planes\n", encoding="utf-8")


def far_seed(rig: Path) -> None:
    write_yaml(rig / "0002.yaml", {"world_regions": [{"name": "wall", "world": {"seed": [90.0, 0.0, 0.0]}}]})


def damaged_mask(rig: Path) -> None:
    (rig / "0003-wall.png").write_bytes((rig / "0003-wall.png").read_bytes()[:60])


def small_mask(rig: Path) -> None:
    Image.fromarray(np.full((10, 10), 255, dtype=np.uint8)).save(rig / "0003-wall.png")


def damaged_cloud(rig: Path) -> None:
    (rig / "0003.npy").write_bytes(b"\x93NUMPY")


def no_list(rig: Path) -> None:
    (rig / "0002.yaml").write_text("- 1\n", encoding="utf-8")


def nothing(rig: Path) -> None:
    for cloud in rig.glob("*.npy"):
        cloud.unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (no_camera, r"drive: found no camera; needed camera, the key camera in a pair's scene file, or calib"),
        (other_camera, r"0002.yaml:\d+: camera: found another than that of \S*0001.yaml; needed one camera for all"),
        (no_regions, r"0003.png: found no region of the photo; needed 0003.yaml, 0003.json or masks 0003-\*.png"),
        (two_clouds, r"0003.npy: found 0003.xyz, too; needed one cloud of the name, or the key cloud in 0003.yaml"),
        (two_photos, r"0003.jpg: found 0003.png, too; needed one photo of the name"),
        (other_photo, r"0002.yaml:\d+: image: found '0001.png'; needed 0002.png, or no such key"),
        (unknown_key, r"0002.yaml:2: world_region: found an unknown key; needed one of"),
        (far_seed, r"0002.yaml:\d+: world_regions\[0\].world.seed: .*88.8 m from the nearest"),
        (damaged_mask, r"0003-wall.png"),
        (small_mask, r"0003-wall.png: found masks of 10 x 10 pixels; needed 320 x 240, as the image"),
        (damaged_cloud, r"0003.npy: "),
        (no_list, r"0002.yaml:1: found a list of 1; needed a mapping with the pair's regions"),
        (nothing, r"drive: found no photo with a cloud of its name; needed such as 0001.png and 0001.pcd"),
    ],
)
def test_errors_name_the_file_of_their_pair(
    rig: Path, tmp_path: Path, spoil: Any, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    spoil(rig)
    code, _, errors = run(capsys, "calibrate", rig, "--out", tmp_path / "out", "--quiet")
    assert code == 2
    assert re.search(message, errors), errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--camera-name", "cam0"], "--camera-name: found it without --camera; needed both"),
        (["--sensor-origin", "1,2"], "--sensor-origin: found 2 numbers; needed x,y,z"),
        (["--coco", "nowhere.json"], "nowhere.json isn't there"),
    ],
)
def test_words_that_fit_nothing_are_named(
    rig: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    no_regions(rig)
    code, _, errors = run(capsys, "calibrate", rig, *words, "--quiet")
    assert code == 2 and message in errors


def test_a_folder_that_is_none_is_named(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="nowhere: found nothing; needed a folder"):
        folder_scene(tmp_path / "nowhere", tmp_path / "scene.yaml")
