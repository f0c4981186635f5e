"""Scenes whose regions are not paired, and scenes of several frames."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run as run_command
from diagnostics import between_frame_sigma_of
from PIL import Image, ImageDraw
from regionpose import PoseError, match_regions
from regionpose.datasets.demo import demo_folder
from regionpose.io.yaml_text import plain_value, to_yaml, yaml_node
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import estimate_scene
from regionpose.scene.loading import load_scene
from regionpose.scene.result import scene_result
from scene_files import CAMERA, HEIGHT, PLATES, POSE, WIDTH, scene_values, write_scene

pytestmark = pytest.mark.slow

SIDES = {"image": "image_regions", "world": "world_regions"}


def unpaired(*names: str, world_names: tuple[str, ...] = ("b", "a")) -> dict[str, Any]:
    """The scene with these regions unpaired, the others paired; the world's in reverse and under other names."""
    values = scene_values()
    loose = [region for region in values["regions"] if region["name"] in names]
    values["regions"] = [region for region in values["regions"] if region["name"] not in names]
    values["image_regions"] = [{"name": one["name"], "image": one["image"]} for one in loose]
    worlds = [one["world"] for one in reversed(loose)]
    values["world_regions"] = [{"name": n, "world": w} for n, w in zip(world_names, worlds, strict=False)]
    return values


def framed() -> dict[str, Any]:
    """Two frames of the scene, the second with its world elsewhere on the same pose's line of sight."""
    values = scene_values()
    frames = []
    for name, region in zip(("one", "two"), values.pop("regions"), strict=True):
        frames.append({"name": name, "image": values["image"], "regions": [region]})
    del values["image"]
    return values | {"frames": frames}


def is_right(run: Any) -> bool:
    turn = (run.estimate.pose.rotation * POSE.rotation.inv()).magnitude()
    return bool(turn < 1e-4 and np.allclose(run.estimate.pose.translation, POSE.translation, atol=1e-3))


def test_unpaired_regions_are_matched_and_told(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path, unpaired("floor", "wall"))))
    assert is_right(run)
    assert run.names == ("floor", "wall")
    result = scene_result(run)
    (held,) = result["diagnostics"]["matching"]
    assert held["pairs"] == [["floor", "a"], ["wall", "b"]]
    assert [region["world_region"] for region in result["diagnostics"]["regions"]] == ["a", "b"]


def test_pairs_that_are_known_stay_and_lead_to_the_rest(tmp_path: Path) -> None:
    values = unpaired("wall", world_names=("b",))
    values["world_regions"].append({"name": "far", "world": {"polygon": (PLATES["wall"] + 30.0).tolist()}})
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert is_right(run)
    held = run.sides.matching
    assert held is not None and held.pairs == (("wall", "b"),) and held.unmatched_world == ("far",)


def test_known_pairs_are_checked_by_index() -> None:
    image = ImageRegion.from_polygon(CAMERA.project(POSE.transform(PLATES["floor"])))
    world = WorldRegion.from_polygon(PLATES["floor"])
    for known, message in (
        ([(0, 1)], r"known names the world regions \[1\]; needed different indices from 0 to 0"),
        ([(0,)], r"known has shape \(1, 1\); needed \(n, 2\)"),
        ([0], r"known has shape \(1,\)"),
        ([(0.5, 0)], r"known has type float64; needed indices \(n, 2\)"),
        (None, "known has type object"),
    ):
        with pytest.raises(ValueError, match=message):
            match_regions(CAMERA, [image], [world], known=known)  # type: ignore[arg-type]
    assert match_regions(CAMERA, [image], [world], known=[(0, 0)]).pairs == ((0, 0),)


def test_regions_of_one_side_alone_are_left_out(tmp_path: Path) -> None:
    values = scene_values()
    values["image_regions"] = [{"name": "more", "image": {"polygon": [[10, 10], [60, 12], [55, 70]]}}]
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert is_right(run) and run.sides.matching is None


def test_nothing_that_matches_is_no_pose(tmp_path: Path) -> None:
    values = unpaired("floor", "wall")
    values["image_regions"] = [{"name": "thin", "image": {"polygon": [[10, 10], [300, 12], [300, 14], [10, 13]]}}]
    with pytest.raises(PoseError, match="looks like any"):
        estimate_scene(load_scene(write_scene(tmp_path, values)))


def plates_cloud(folder: Path) -> None:
    """The plates and the wall around one of them as a dense cloud."""
    generator = np.random.default_rng(0)
    points = []
    for plate in PLATES.values():
        corner, along, across = plate[0], plate[1] - plate[0], plate[5] - plate[0]
        shares = generator.uniform(0.0, 1.0, (12_000, 2))
        shares = shares[(shares.min(axis=1) < 0.4)]
        points.append(corner + shares[:, :1] * along + shares[:, 1:] * across)
    np.save(folder / "cloud.npy", np.concatenate(points))


def test_planes_of_the_cloud_are_matched(tmp_path: Path) -> None:
    plates_cloud(tmp_path)
    values = unpaired("floor", "wall") | {"cloud": "cloud.npy", "world_regions": "planes"}
    values["solver"] = {"edges": False}
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    assert (run.estimate.pose.rotation * POSE.rotation.inv()).magnitude() < np.radians(0.5)
    held = run.sides.matching
    assert held is not None and {image for image, _ in held.pairs} == {"floor", "wall"}
    assert all(world.startswith("plane ") for _, world in held.pairs)


def test_frames_give_one_pose(tmp_path: Path) -> None:
    run = estimate_scene(load_scene(write_scene(tmp_path, framed())))
    assert is_right(run)
    assert run.names == ("one: floor", "two: wall")
    result = scene_result(run)
    assert [frame["name"] for frame in result["diagnostics"]["rig"]["frames"]] == ["one", "two"]
    sigma = between_frame_sigma_of(run.estimate)
    assert result["diagnostics"]["rig"]["between_frame_sigma"] == {
        "rotation_sigma_deg": sigma.rotation_sigma_deg,
        "center_sigma_m": sigma.center_sigma_m,
    }
    assert [region["name"] for region in result["diagnostics"]["regions"]] == ["one: floor", "two: wall"]
    assert result["image"] is None
    json.dumps(result, allow_nan=False)


def test_the_result_names_the_files_of_every_frame(tmp_path: Path) -> None:
    values = framed()
    values["frames"][1]["image"] = "second.png"
    path = write_scene(tmp_path, values)
    (tmp_path / "second.png").write_bytes((tmp_path / "image.png").read_bytes())
    inputs = {entry["path"]: entry["roles"] for entry in scene_result(estimate_scene(load_scene(path)))["inputs"]}
    assert inputs == {"scene.yaml": ["scene"], "image.png": ["image of one"], "second.png": ["image of two"]}


def test_a_single_frame_is_a_scene(tmp_path: Path) -> None:
    values = scene_values()
    frame = {"name": "only", "image": values.pop("image"), "regions": values.pop("regions")}
    run = estimate_scene(load_scene(write_scene(tmp_path, values | {"frames": [frame]})))
    result = scene_result(run)
    assert is_right(run) and result["diagnostics"]["rig"] is None and result["image"] == frame["image"]


def test_frames_of_map_coordinates_share_an_origin(tmp_path: Path) -> None:
    values = framed()
    shift = np.array([512_345.25, 5_405_678.5, 240.0])
    for frame in values["frames"]:
        ring = np.asarray(frame["regions"][0]["world"]["polygon"]) + shift
        frame["regions"][0]["world"]["polygon"] = ring.tolist()
    run = estimate_scene(load_scene(write_scene(tmp_path, values)))
    np.testing.assert_allclose(run.estimate.pose.camera_center, POSE.camera_center + shift, atol=1e-3)
    assert np.array_equal(run.frames[0].origin, run.frames[1].origin)


def test_the_command_writes_the_files_of_every_frame(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_scene(tmp_path, framed())
    _, said, errors = run_command(capsys, "estimate", path, "--out", tmp_path / "out", "--quiet")
    assert "frames: contours at the pose" in said, errors
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"result.json", "report.html", "overlay_1.png", "overlay_2.png"}
    assert "<h2>Frames</h2>" in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def loose_sides(folder: Path) -> dict[str, Any]:
    """The scene on a cloud, with a pair, and one plate whose sides, a mask and a seed, are not paired."""
    plates_cloud(folder)
    plate = PLATES["wall"]
    picture = Image.new("L", (WIDTH, HEIGHT))
    ImageDraw.Draw(picture).polygon([tuple(pixel) for pixel in CAMERA.project(POSE.transform(plate))], fill=255)
    picture.save(folder / "mask.png")
    values = unpaired("wall", world_names=("b",)) | {"cloud": "cloud.npy"}
    values["image_regions"][0]["image"] = {"mask": "mask.png"}
    values["world_regions"][0]["world"] = {"seed": (0.6 * plate[0] + 0.2 * (plate[1] + plate[5])).tolist()}
    return values


def test_regions_of_one_side_are_segmented_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = loose_sides(tmp_path)
    for count, scene in enumerate((values, {key: value for key, value in values.items() if key != "regions"})):
        path, out = write_scene(tmp_path, scene), tmp_path / f"out{count}"
        code, said, errors = run_command(capsys, "segment", path, "--out", out, "--json", "--quiet")
        assert code == 0, errors
        sizes = {region["name"]: region for region in json.loads(said)["regions"]}
        assert sizes["wall"]["image_area_px"] > 0.0 and sizes["b"]["cloud_points"] > 1000
        written = plain_value(yaml_node((out / "scene.yaml").read_text(encoding="utf-8")))
        mask, points = written["image_regions"][0]["image"]["mask"], written["world_regions"][0]["world"]["points"]
        assert {mask, points, "scene.yaml"} == {path.name for path in out.iterdir()}
        assert len(np.load(out / points)) == sizes["b"]["cloud_points"]
        assert run_command(capsys, "segment", path, "--out", tmp_path / f"again{count}", "--quiet")[0] == 0


@pytest.mark.parametrize("values", [framed(), {**unpaired("floor", "wall"), "regions": []}], ids=["frames", "loose"])
def test_info_knows_scenes_of_every_kind(
    values: dict[str, Any], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write_scene(tmp_path, {key: value for key, value in values.items() if value != []})
    code, said, errors = run_command(capsys, "info", path, "--json")
    assert code == 0, errors
    assert json.loads(said)["kind"] == "scene file" and len(json.loads(said)["regions"]) >= 2


def nested(frame: dict[str, Any]) -> dict[str, Any]:
    return framed() | {"frames": [*framed()["frames"], frame]}


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({**scene_values(), "regions": []}, "regions: found no region; needed one with both sides"),
        ({**framed(), "image": "image.png"}, "image: found it beside frames; needed it in each frame"),
        (
            {key: value for key, value in scene_values().items() if key != "image"},
            "image: found nothing; needed this key, or frames with a photo each",
        ),
        (nested(framed()["frames"][0]), r"frames\[2\].name: found 'one' twice; needed names that differ"),
        (nested({"name": "x", "image": "image.png"}), r"frames\[2\].regions: found no region"),
        (nested({"name": "x"}), r"frames\[2\].image: found nothing; needed this key"),
        (
            {**unpaired("floor", "wall"), "world_regions": "planes"},
            "world_regions: found planes without a cloud; needed the key cloud",
        ),
        (
            {**unpaired("floor", "wall"), "world_regions": "walls"},
            "world_regions: found 'walls'; needed a list of regions, or planes",
        ),
        (
            {**scene_values(), "image_regions": [{"name": "wall", "image": {"seed": [1, 1]}}]},
            r"image_regions\[0\].name: found 'wall' twice",
        ),
        (
            {**scene_values(), "world_regions": [{"name": "x", "world": {"seed": [1, 1, 1]}}]},
            r"world_regions\[0\].world: found no cloud to look in",
        ),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, values: dict[str, Any], message: str) -> None:
    with pytest.raises(SceneError, match=message):
        load_scene(write_scene(tmp_path, values))


def test_an_error_in_a_frame_names_its_place(tmp_path: Path) -> None:
    values = framed()
    values["frames"][1]["regions"][0]["image"] = {"seed": [1000, 5]}
    with pytest.raises(SceneError, match=r"frames\[1\].regions\[0\].image.seed: found \[1000, 5\] outside the image"):
        estimate_scene(load_scene(write_scene(tmp_path, values)))


def test_the_demo_needs_no_pairs(tmp_path: Path) -> None:
    scene = plain_value(yaml_node((demo_folder() / "scene.yaml").read_text(encoding="utf-8")))
    for key in ("camera", "image", "cloud"):
        scene[key] = str(demo_folder() / scene[key])
    scene["solver"] = {"edges": False}
    paired = tmp_path / "paired.yaml"
    paired.write_text(to_yaml(scene), encoding="utf-8")
    regions = scene.pop("regions")
    scene["image_regions"] = [{"name": one["name"], "image": one["image"]} for one in regions]
    scene["world_regions"] = [{"name": f"{one['name']} there", "world": one["world"]} for one in reversed(regions)]
    path = tmp_path / "scene.yaml"
    path.write_text(to_yaml(scene), encoding="utf-8")
    found, known = estimate_scene(load_scene(path)), estimate_scene(load_scene(paired))
    held = found.sides.matching
    assert held is not None and len(held.pairs) >= len(regions) - 1
    assert all(world == f"{image} there" for image, world in held.pairs)
    assert (found.estimate.pose.rotation * known.estimate.pose.rotation.inv()).magnitude() < np.radians(0.2)
