"""`regionpose calibrate` of a folder with several cameras of one scanner."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from commands import run
from made_up_worlds import World, made_world
from PIL import Image
from regionpose.cli.console import Progress
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.yaml_text import to_yaml
from regionpose.scene.loading import load_scene
from small_searches import draw_fewer, skip_planes

pytestmark = pytest.mark.slow

LENS = "1 PINHOLE 480 320 260 260 240 160\n"
HEADINGS_DEG = {"front": 10.0, "left": 100.0}
MOUNTS = ("--mount", "front=front", "--mount", "left=left", "--up", "z", "--near", "0.3")


@pytest.fixture(scope="module")
def worlds() -> dict[str, World]:
    """What each camera of the rig sees of one cloud."""
    return {name: made_world(5, heading) for name, heading in HEADINGS_DEG.items()}


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer poses are looked at than a search of all needs."""
    draw_fewer(monkeypatch, 4_000, (120, 30, 6))
    skip_planes(monkeypatch)


@pytest.fixture
def rig(worlds: dict[str, World], tmp_path: Path) -> Path:
    """A folder with a folder for each camera, and one for their clouds."""
    folder = tmp_path / "rig"
    for name, world in worlds.items():
        (folder / name).mkdir(parents=True)
        Image.fromarray(world.photo).save(folder / name / "0001.png")
        (folder / name / "calib.txt").write_text(LENS, encoding="utf-8")
    (folder / "clouds").mkdir()
    world = worlds["front"]
    write_ply(folder / "clouds" / "0001.ply", Cloud.from_points(world.points, intensity=world.intensity))
    return folder


def assert_right(result: dict[str, Any], world: World) -> None:
    pose = rp.Pose.from_matrix(result["camera_from_world"]["matrix"])
    assert np.degrees((pose.rotation * world.pose.rotation.inv()).magnitude()) < 0.5
    assert np.linalg.norm(pose.camera_center - world.pose.camera_center) < 0.15


def test_each_camera_has_its_pose_and_its_files(
    rig: Path, worlds: dict[str, World], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert np.array_equal(worlds["front"].points, worlds["left"].points)
    stages: list[str] = []
    monkeypatch.setattr(Progress, "begin", lambda _, stage: stages.append(stage))
    code, said, errors = run(capsys, "calibrate", rig, *MOUNTS, "--json")
    assert code in (0, 3) and errors == ""
    results = json.loads(said)["cameras"]
    assert list(results) == ["front", "left"]
    for name, world in worlds.items():
        assert_right(results[name], world)
        out = rig.parent / "rig-result" / name
        assert json.loads((out / "result.json").read_text(encoding="utf-8")) == results[name]
        assert {"scene.yaml", "report.html", "depth.png", "cloud.ply"} <= {path.name for path in out.iterdir()}
        held: Any = load_scene(out / "scene.yaml").document.value
        assert held["camera"] == f"../../rig/{name}/calib.txt"
        assert held["frames"][0]["cloud"] == "../../rig/clouds/0001.ply"
    levels = {result["status"] for result in results.values()}
    assert code == (3 if "doubtful" in levels else 0)
    assert any(re.fullmatch(r"camera 2 of 2, left: .*edges", stage) for stage in stages)


def test_a_table_says_what_each_camera_has(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ply(rig / "left" / "0001.ply", Cloud.from_points(np.ones((4, 3))))
    code, said, errors = run(capsys, "calibrate", rig, *MOUNTS, "--quiet")
    lines = {line.split()[0]: line for line in said.splitlines()[:3]}
    assert re.match(r"front +(trusted|check|doubtful) +\[.*\] +\[.*\] +\d\.\d+ +\d\.\d+$", lines["front"])
    # A cloud without edges gives none; the other camera is none the worse for it.
    assert code == 3 and lines["left"].split() == ["left", "no", "pose"]
    assert re.match("error: left: .*no pose was found: ", errors)
    assert (rig.parent / "rig-result" / "front" / "result.json").is_file()
    assert not (rig.parent / "rig-result" / "left").exists()


def test_a_damaged_file_counts_more_than_a_doubt(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (rig / "front" / "0001.png").write_bytes((rig / "front" / "0001.png").read_bytes()[:300])
    write_ply(rig / "left" / "0001.ply", Cloud.from_points(np.ones((4, 3))))
    code, said, errors = run(capsys, "calibrate", rig, *MOUNTS, "--quiet", "--json")
    assert code == 2 and "error: front: " in errors and "0001.png" in errors
    assert {name: list(held) for name, held in json.loads(said)["cameras"].items()} == {
        "front": ["error"],
        "left": ["error"],
    }


@pytest.fixture
def scenes_by(monkeypatch: pytest.MonkeyPatch, rig: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """The scenes that the command would run, by its words."""

    def scenes_of(*words: str | Path) -> dict[str, Any]:
        found: dict[str, Any] = {}
        monkeypatch.setattr("regionpose.cli.calibrate.run_cameras", lambda scenes, *_, **__: found.update(scenes))
        code, _, errors = run(capsys, "calibrate", rig, *words, "--quiet")
        assert code == 0, errors
        return {name: scene.document.value for name, scene in found.items()}

    return scenes_of


def test_clouds_may_stand_beside_the_cameras_or_with_one(rig: Path, scenes_by: Any) -> None:
    (rig / "clouds" / "0001.ply").rename(rig / "0001.ply")
    (rig / "clouds").rmdir()
    own = rig / "left" / "0001.ply"
    own.write_bytes((rig / "0001.ply").read_bytes())
    clouds = {name: held["frames"][0]["cloud"] for name, held in scenes_by().items()}
    assert clouds == {"front": "../../rig/0001.ply", "left": "../../rig/left/0001.ply"}


def test_a_mount_without_a_name_is_that_of_all_others(scenes_by: Any) -> None:
    priors = {name: held["prior"] for name, held in scenes_by("--mount", "rear", "--mount", "left=left").items()}
    forward = {name: prior["initial"]["camera_from_world"]["matrix"][2][:3] for name, prior in priors.items()}
    assert forward["front"] == pytest.approx([-1.0, 0.0, 0.0])
    assert forward["left"] == pytest.approx([0.0, 1.0, 0.0])


def test_one_calibration_of_all_names_cameras_by_their_folders(rig: Path, scenes_by: Any) -> None:
    camchain = rig.parent / "camchain.yaml"
    lens = {
        "camera_model": "pinhole",
        "intrinsics": [260.0, 260.0, 239.5, 159.5],
        "distortion_model": "radtan",
        "distortion_coeffs": [0.0, 0.0, 0.0, 0.0],
        "resolution": [480, 320],
    }
    camchain.write_text(to_yaml({"front": lens, "left": lens}), encoding="utf-8")
    cameras = {name: held["camera"] for name, held in scenes_by("--camera", camchain).items()}
    assert cameras == {name: {"file": "../../camchain.yaml", "name": name} for name in HEADINGS_DEG}
    one = scenes_by("--camera", camchain, "--camera-name", "left")
    assert {held["camera"]["name"] for held in one.values()} == {"left"}


def no_calibration(rig: Path) -> None:
    (rig / "left" / "calib.txt").unlink()


def two_calibrations(rig: Path) -> None:
    (rig / "left" / "calib.yaml").write_text("{}", encoding="utf-8")


def no_cloud(rig: Path) -> None:
    (rig / "clouds" / "0001.ply").unlink()


def written_before(rig: Path) -> None:
    (rig.parent / "rig-result" / "left").mkdir(parents=True)
    (rig.parent / "rig-result" / "left" / "report.html").write_text("mine", encoding="utf-8")


def nothing(rig: Path) -> None:
    pass


BAD: dict[str, tuple[Any, list[str], str]] = {
    "no calibration": (no_calibration, [], r"rig/left: found no camera; needed camera, .*, or calib.yaml in the fol"),
    "two calibrations": (two_calibrations, [], r"left/calib.txt: found calib.yaml, too; needed one calibration"),
    "no cloud": (no_cloud, [], r"rig/front: found no photo with a cloud of its name; .*, or in \S*clouds or \S*rig"),
    "an older result": (written_before, [], r"left/report.html: the file exists"),
    "another camera": (nothing, ["--mount", "rear=rear"], "--mount: found one of rear; needed a mount of front, left"),
    "another mount": (nothing, ["--mount", "left=up"], "--mount: found 'left=up'; needed front, left, rear, right"),
    "no name": (nothing, ["--mount", "=left"], "--mount: found '=left'; needed front"),
    "two mounts": (nothing, ["--mount", "left=left", "--mount", "left=rear"], "--mount: found 'left=rear' beside an"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_a_rig_lacks_is_named_before_the_work(rig: Path, capsys: pytest.CaptureFixture[str], case: str) -> None:
    spoil, words, message = BAD[case]
    spoil(rig)
    code, out, errors = run(capsys, "calibrate", rig, *words, "--quiet")
    assert code == 2 and out == "" and errors.count("\n") == 1
    assert re.search(message, errors), errors
    assert not (rig.parent / "rig-result" / "front").exists()


def test_a_mount_of_a_camera_needs_several(rig: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, errors = run(capsys, "calibrate", rig / "front", "--mount", "front=front", "--quiet")
    assert code == 2 and "--mount: found one of front; needed front, left, rear or right alone" in errors
