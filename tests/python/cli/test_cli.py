from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import run
from PIL import Image
from regionpose import Pose, __version__
from regionpose.cli import main
from regionpose.datasets.demo import demo_folder
from regionpose.io.calibrations import load_camera
from regionpose.io.calibrations.poses import read_pose
from regionpose.io.clouds import read_cloud
from scene_files import POSE, scene_values, write_scene

pytestmark = pytest.mark.slow

COMMANDS = ("estimate", "calibrate", "segment", "fuse", "project", "demo", "info", "schema")


@pytest.fixture(scope="module")
def demo_out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files of the demo, from masks."""
    out = tmp_path_factory.mktemp("demo") / "out"
    assert main(["demo", "--from", "masks", "--out", str(out), "--quiet"]) == 0
    return out


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_shows_examples(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, command, "--help")
    assert code == 0
    assert "Examples:" in out and f"\n    regionpose {command} " in out


def test_help_says_the_exit_codes(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "--help")
    assert code == 0
    assert all(f"\n    {number}  " in out for number in (0, 1, 2, 3, 130))


def test_the_module_runs_as_the_command() -> None:
    def ended(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "regionpose", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=False)

    assert ended("--version").stdout == f"regionpose {__version__}\n"
    refused = ended("estimate", "nowhere.yaml")
    assert refused.returncode == 2 and "nowhere.yaml" in refused.stderr


def test_help_loads_nothing_slow() -> None:
    program = (
        "import sys; from regionpose.cli import main; code = main(['--help']); print(*sys.modules); sys.exit(code)"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    loaded = ended.stdout.split("\n")[-2].split()
    assert not {"numpy", "scipy", "skimage", "shapely", "pydantic", "PIL", "yaml"} & set(loaded)


def test_estimate_writes_all_files_and_says_the_pose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "result"
    code, said, err = run(capsys, "estimate", write_scene(tmp_path), "--out", out)
    assert code == 0
    assert sorted(path.name for path in out.iterdir()) == ["overlay.png", "report.html", "result.json"]
    assert "translation_m" in said and "floor" in said and "trusted:" in said
    assert err == "", "progress is for terminals"
    assert read_pose(out / "result.json").translation == pytest.approx(POSE.translation, abs=1e-6)


def test_json_is_all_of_standard_output_and_the_written_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, err = run(capsys, "estimate", write_scene(tmp_path), "--out", tmp_path / "out", "--json", "--quiet")
    assert (code, err) == (0, "")
    assert json.loads(said) == json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))


def test_an_initial_pose_is_compared(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = scene_values()
    values["prior"] = {"initial": {"camera_from_world": {"matrix": (POSE.matrix + 0.05 * np.eye(4, k=3)).tolist()}}}
    code, said, _ = run(capsys, "estimate", write_scene(tmp_path, values), "--out", tmp_path / "out")
    assert code == 0 and said.count(", before: ") == 2
    assert (tmp_path / "out" / "overlay_before.png").exists()


def test_what_is_taken_of_the_scanner_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = {**scene_values(), "sensor_origin": [0.5, 0.0, -4.0]}
    code, said, _ = run(capsys, "estimate", write_scene(tmp_path, values), "--out", tmp_path / "out")
    assert code == 0 and "scanner at [0.500, 0.000, -4.000] m, by the scene's sensor_origin" in said
    near = "the camera stands near [0.500, 0.000, -4.000] m, to 2 m, by sensor_origin"
    assert f"{near}; prior.camera_near: null if it doesn't" in said
    html = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    assert "Scanner at" in html and "(1 sigma 2 m), by sensor_origin." in html
    values["prior"] = {"camera_near": None}
    code, said, _ = run(capsys, "estimate", write_scene(tmp_path, values), "--out", tmp_path / "free")
    assert code == 0 and "scanner at" in said and "the camera stands near" not in said


def one_square(folder: Path, names: Sequence[str] = ("square",), **more: object) -> Path:
    """A scene of one square, which looks the same from several poses, under some names, with more keys."""
    values: dict[str, Any] = {**scene_values(), **more}
    square = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    camera = load_camera(demo_folder() / "camera_info.yaml")
    values["camera"], values["image"] = str(demo_folder() / "camera_info.yaml"), str(demo_folder() / "image.jpg")
    pixels = camera.project(POSE.transform(square))
    values["regions"] = [
        {"name": name, "image": {"polygon": pixels.tolist()}, "world": {"polygon": square.tolist()}} for name in names
    ]
    return write_scene(folder, values)


def test_a_doubtful_pose_is_written_and_ends_with_3(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = one_square(tmp_path)
    code, said, _ = run(capsys, "estimate", scene, "--out", tmp_path / "a")
    assert code == 3 and "doubtful:" in said and "warning: " in said
    code, said, _ = run(capsys, "estimate", scene, "--out", tmp_path / "b", "--strict", "--json", "--quiet")
    result = json.loads(said)
    assert code == 3 and result["warnings"][0]["code"] == "ambiguous-pose"
    assert result["status"] == "doubtful" and result["warnings"][0]["advice"]
    assert result["diagnostics"]["edges"] is None
    assert (tmp_path / "b" / "result.json").exists()


def test_strict_ends_with_1_when_there_are_warnings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    initial = {"camera_from_world": {"matrix": POSE.matrix.tolist()}}
    sigmas = {"initial_rotation_sigma_deg": 5.0, "initial_center_sigma_m": 0.2}
    # The same place twice is warned of; the pose is right.
    scene = one_square(tmp_path, ["square", "again"], prior={"initial": initial, **sigmas})
    code, said, _ = run(capsys, "estimate", scene, "--out", tmp_path / "a")
    assert code == 0 and "check: " in said and "warning: " in said
    code, said, _ = run(capsys, "estimate", scene, "--out", tmp_path / "b", "--strict", "--json", "--quiet")
    assert code == 1 and json.loads(said)["status"] == "check"


def test_no_pose_ends_with_3_and_writes_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from regionpose.scene import estimate
    from regionpose.solve.estimate import PoseError

    def no_pose(*_: object, **__: object) -> None:
        raise PoseError("no pose shows every world region where its image region is")

    monkeypatch.setattr(estimate, "estimate_pose", no_pose)
    code, _, err = run(capsys, "estimate", write_scene(tmp_path), "--out", tmp_path / "out", "--quiet")
    assert code == 3
    assert err.startswith("error: no pose shows") and err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_bad_input_is_one_line_with_exit_code_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    values = scene_values()
    values["regions"][0]["image"] = {"seed": [1, 2, 3]}
    scene = write_scene(tmp_path, values)
    line = 1 + next(k for k, row in enumerate(scene.read_text(encoding="utf-8").splitlines()) if "seed:" in row)
    code, said, err = run(capsys, "estimate", scene, "--quiet", "--out", tmp_path / "out")
    assert (code, said) == (2, "")
    assert err == f"error: {scene}:{line}: regions[0].image.seed: found 3 numbers; needed [x, y]\n"


@pytest.mark.parametrize(
    "words", [["estimate"], ["unknown"], ["demo", "--from", "nothing"], ["estimate", "a", "--loud"]]
)
def test_bad_usage_ends_with_2(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    code, said, err = run(capsys, *words)
    assert code == 2
    assert not said and "Error" in err and "Traceback" not in err


def test_the_demo_finds_its_pose_and_writes_all_files(demo_out: Path) -> None:
    result = json.loads((demo_out / "result.json").read_text(encoding="utf-8"))
    assert result["truth_errors"]["rotation_deg"] < 0.3
    assert result["truth_errors"]["camera_center_m"] < 0.03
    assert max(region["overlap_error"] for region in result["diagnostics"]["regions"]) < 0.08
    names = {path.name for path in demo_out.iterdir()}
    assert names == {"cloud.ply", "depth.png", "edges.png", "overlay.png", "report.html", "result.json"}
    assert result["diagnostics"]["edges"]["alignment"]["log_odds"] > 1.0 and result["status"] == "trusted"
    cloud = read_cloud(demo_out / "cloud.ply")
    assert cloud.colors is not None
    assert cloud.colors[cloud.fields["visible"] > 0].mean() > 40


def test_the_demos_scene_files_hold_its_seeds() -> None:
    from regionpose.datasets.demo import load_demo
    from regionpose.scene.loading import load_scene

    seeds, masks = (load_scene(demo_folder() / name).model for name in ("scene.yaml", "scene_masks.yaml"))
    for region, by_seed, by_mask in zip(load_demo().regions, seeds.regions, masks.regions, strict=True):
        assert by_seed.name == by_mask.name == region.name
        assert by_seed.image.model_dump()["seed"] == list(region.seed_pixel)
        assert by_seed.world.model_dump()["seed"] == pytest.approx(region.seed_point, abs=1e-3)
        assert by_mask.image.model_dump()["label"] == by_mask.world.model_dump()["label"] == region.label


def test_the_demo_runs_from_seeds(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = run(capsys, "demo", "--out", tmp_path / "out")
    assert code == 0
    assert "error against the truth" in said
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert result["truth_errors"]["rotation_deg"] < 0.2
    assert result["truth_errors"]["camera_center_m"] < 0.02
    assert result["diagnostics"]["overlap_error"] < 0.06


def sensors(demo_out: Path) -> list[Path | str]:
    files = demo_folder()
    pose = demo_out / "result.json"
    return [files / "cloud.ply", files / "image.jpg", "--camera", files / "camera_info.yaml", "--pose", pose, "--quiet"]


def test_fuse_colors_a_cloud_as_the_estimate_did(
    demo_out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "colored.ply"
    code, said, _ = run(capsys, "fuse", *sensors(demo_out), "--out", out, "--json")
    assert code == 0
    facts = json.loads(said)
    assert 0 < facts["visible_points"] < facts["points"]
    assert out.read_bytes() == (demo_out / "cloud.ply").read_bytes()
    assert run(capsys, "fuse", *sensors(demo_out), "--out", out)[0] == 2


def test_fuse_blends_several_images(demo_out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from regionpose.fusion.colors import PosedImage, blend_colors

    files, out = demo_folder(), tmp_path / "colored.ply"
    image = np.asarray(Image.open(files / "image.jpg"))
    Image.fromarray(255 - image).save(tmp_path / "other.png")
    camera, pose = load_camera(files / "camera_info.yaml"), read_pose(demo_out / "result.json")
    back = Pose(pose.rotation, pose.translation + np.array([0.0, 0.0, 2.0]))
    np.save(tmp_path / "back.npy", back.matrix)
    code, said, err = run(
        capsys,
        "fuse",
        *(files / "cloud.ply", files / "image.jpg", tmp_path / "other.png"),
        *("--camera", files / "camera_info.yaml", "--out", out, "--json"),
        *("--pose", demo_out / "result.json", "--pose", tmp_path / "back.npy"),
    )
    assert code == 0 and json.loads(said)["images"] == 2
    assert err == ""
    points = read_cloud(files / "cloud.ply").points
    colors, visible = blend_colors([PosedImage(camera, image, pose), PosedImage(camera, 255 - image, back)], points)
    cloud = read_cloud(out)
    np.testing.assert_array_equal(cloud.fields["visible"] > 0, visible)
    assert cloud.colors is not None
    np.testing.assert_array_equal(cloud.colors[visible], colors[visible])


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["image.jpg"], "--pose: found 1 for 2 images; needed one for each"),
        (["--pose", "a.json"], "--pose: found 2 for 1 images"),
        (["--camera", "a.yaml"], "--camera: found 2 for 1 images; needed one for all, or one for each"),
        (["--camera-name", "a", "--camera-name", "b"], "--camera-name: found 2 for 1 images"),
    ],
)
def test_fuse_needs_as_many_poses_as_images(
    more: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["cloud.ply", "image.jpg", "--camera", "c.yaml", "--pose", "p.json", *more]
    code, _, err = run(capsys, "fuse", *words, "--out", tmp_path / "a.ply")
    assert code == 2 and said in err and err.count("\n") == 1


def test_project_writes_pixels_and_a_picture(
    demo_out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table, picture = tmp_path / "pixels.csv", tmp_path / "depth.png"
    code, said, _ = run(capsys, "project", *sensors(demo_out), "--out", table, "--json")
    assert code == 0
    rows = np.loadtxt(table, delimiter=",", skiprows=1)
    assert len(rows) == json.loads(said)["points_inside"] > 1000
    cloud, camera = read_cloud(demo_folder() / "cloud.ply"), load_camera(demo_folder() / "camera_info.yaml")
    seen = read_pose(demo_out / "result.json").transform(cloud.points[rows[:, 0].astype(int)])
    np.testing.assert_allclose(rows[:, 1:3], camera.project(seen), atol=1e-4)
    np.testing.assert_allclose(rows[:, 3], seen[:, 2], atol=1e-6)
    assert run(capsys, "project", *sensors(demo_out), "--out", picture)[0] == 0
    assert picture.read_bytes() == (demo_out / "depth.png").read_bytes()
    code, _, err = run(capsys, "project", *sensors(demo_out), "--out", tmp_path / "pixels.txt")
    assert code == 2 and "needed .png or .csv" in err


def test_segmented_regions_make_a_scene_of_the_same_pose(
    demo_out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "regions"
    code, said, _ = run(capsys, "segment", demo_folder() / "scene_masks.yaml", "--out", out, "--json", "--quiet")
    assert code == 0
    assert json.loads(said)["regions"][0]["name"] == "door"
    assert {"01-door.png", "01-door.npy", "scene.yaml"} <= {path.name for path in out.iterdir()}
    assert run(capsys, "estimate", out / "scene.yaml", "--out", tmp_path / "again", "--quiet")[0] == 0
    first, again = (read_pose(path / "result.json").matrix for path in (demo_out, tmp_path / "again"))
    np.testing.assert_allclose(again, first, atol=1e-9)


def test_segment_never_replaces_single_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "regions"
    out.mkdir()
    (out / "01-door.npy").write_text("mine", encoding="utf-8")
    code, _, err = run(capsys, "segment", demo_folder() / "scene_masks.yaml", "--out", out, "--quiet")
    assert code == 2 and "01-door.npy: the file exists" in err
    assert [path.name for path in out.iterdir()] == ["01-door.npy"]


def test_segment_grows_a_plane_in_a_cloud(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from regionpose.datasets.demo import load_demo

    demo = load_demo()
    region, cloud = demo.region("chalkboard"), demo_folder() / "cloud.ply"
    seed = ",".join(str(value) for value in region.seed_point)
    code, said, _ = run(capsys, "segment", cloud, "--seed", seed, "--out", tmp_path / "a.npy", "--json", "--quiet")
    assert code == 0
    indices = np.load(tmp_path / "a.npy")
    assert json.loads(said)["points"] == len(indices)
    common = len(np.intersect1d(indices, region.point_indices))
    assert common > 0.95 * len(region.point_indices) and common > 0.9 * len(indices)
    assert run(capsys, "segment", cloud, "--seed", seed, "--out", tmp_path / "a.ply", "--quiet")[0] == 0
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply").points, demo.points[indices])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["cloud.ply"], "--seed: found nothing; needed x,y,z"),
        (["cloud.ply", "--seed", "1,2"], "--seed: found 2 numbers; needed x,y,z"),
        (["image.jpg", "--seed", "a,b"], "--seed: found 'a,b'; needed x,y"),
        (["image.jpg", "--seed", "1,2", "--out", "mask.txt"], "needed .png"),
        (["scene.yaml", "--seed", "1,2"], "its regions have their own"),
    ],
)
def test_segment_says_what_it_needs(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "segment", demo_folder() / words[0], *words[1:])
    assert code == 2 and said in err


@pytest.mark.parametrize(
    ("name", "kind", "key"),
    [
        ("cloud.ply", "cloud", "points"),
        ("camera_info.yaml", "calibration", "fx"),
        ("image.jpg", "image", "width_px"),
        ("scene.yaml", "scene file", "regions"),
    ],
)
def test_info_tells_what_a_file_holds(name: str, kind: str, key: str, capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = run(capsys, "info", demo_folder() / name, "--json")
    facts = json.loads(said)
    assert code == 0 and facts["kind"] == kind and facts[key]
    assert run(capsys, "info", demo_folder() / name)[0] == 0


def test_info_reads_results_and_refuses_the_rest(
    demo_out: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    code, said, _ = run(capsys, "info", demo_out / "result.json", "--json")
    assert code == 0 and json.loads(said)["regions"][0] == "door"
    (tmp_path / "note.yaml").write_text("hello", encoding="utf-8")
    (tmp_path / "cut.jpg").write_bytes((demo_folder() / "image.jpg").read_bytes()[:5000])
    for path in (tmp_path / "note.yaml", tmp_path / "cut.jpg", tmp_path / "nowhere.ply", tmp_path):
        code, said, err = run(capsys, "info", path)
        assert (code, said) == (2, "") and err.count("\n") == 1 and str(path) in err


def test_schema_prints_the_schema(capsys: pytest.CaptureFixture[str]) -> None:
    code, said, _ = run(capsys, "schema")
    assert code == 0 and json.loads(said)["title"] == "regionpose scene file"


def test_poses_are_read_from_every_kind_of_file(tmp_path: Path) -> None:
    inverse = POSE.inverse()
    quaternion = inverse.rotation.as_quat().tolist()
    np.save(tmp_path / "a.npy", POSE.matrix)
    np.savetxt(tmp_path / "b.txt", POSE.matrix[:3])
    calib = {"results": {"T_lidar_camera": [*inverse.translation.tolist(), *quaternion]}}
    (tmp_path / "c.json").write_text(json.dumps(calib), encoding="utf-8")
    for name in ("a.npy", "b.txt", "c.json"):
        np.testing.assert_allclose(read_pose(tmp_path / name).matrix, POSE.matrix, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "text"),
    [("a.json", "{}"), ("b.json", "{"), ("c.txt", "1 2 3"), ("d.txt", "word"), ("e.json", '{"T_lidar_camera": [1]}')],
)
def test_files_without_a_pose_are_refused(name: str, text: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=name):
        read_pose(tmp_path / name)


def test_an_image_seed_gives_a_mask(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("regionpose.segment.image")
    picture = np.full((60, 80, 3), 200, dtype=np.uint8)
    picture[20:40, 30:60] = (30, 60, 160)
    Image.fromarray(picture).save(tmp_path / "image.png")
    words: list[str | Path] = [
        "segment",
        tmp_path / "image.png",
        "--seed",
        "45,30",
        "--out",
        tmp_path / "mask.png",
        "--quiet",
        "--json",
    ]
    code, _, _ = run(capsys, *words)
    assert code == 0
    mask = np.asarray(Image.open(tmp_path / "mask.png")) > 0
    assert abs(int(mask.sum()) - 600) < 60
