"""Scenes without regions, and `regionpose calibrate` of a photo and a cloud or a folder of these."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import regionpose as rp
from commands import run
from diagnostics import edges_of
from made_up_worlds import CAMERA, World, pose_of
from PIL import Image
from regionpose.io.clouds import Cloud, write_ply
from regionpose.io.yaml_text import to_yaml
from regionpose.progress import UnwantedError, while_wanted
from regionpose.scene.bundle import bundle, file_names
from regionpose.scene.document import SceneError
from regionpose.scene.estimate import SceneEstimate, estimate_scene
from regionpose.scene.exposure import SceneData
from regionpose.scene.folder import FolderOptions, pair_scene
from regionpose.scene.headline import headline
from regionpose.scene.loading import load_scene
from regionpose.scene.result import scene_result
from regionpose.scene.stages import Stages
from scene_files import PLATES
from scene_files import write_scene as write_plates
from small_searches import draw_fewer, skip_planes, two_worlds

pytestmark = pytest.mark.slow

LENS = {"model": "pinhole", "fx": 260.0, "fy": 260.0, "cx": 239.5, "cy": 159.5, "width": 480, "height": 320}
COLMAP = "1 PINHOLE 480 320 260 260 240 160\n"
"""The same, whose pixels count from the corner."""

PRIOR = {
    "camera_near": [0.0, 0.0, 0.0],
    "camera_near_sigma_m": 0.3,
    "up": [0.0, 0.0, 1.0],
    "up_sigma_deg": 3.0,
    "initial": {"camera_from_world": {"matrix": pose_of(45.0).matrix.tolist()}},
    "initial_rotation_sigma_deg": 5.0,
    "initial_center_sigma_m": 0.3,
}
"""With which few poses are enough to find the true one."""

FAR = np.array([431_000.0, 5_230_000.0, 440.0])


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return two_worlds()


@pytest.fixture(scope="module", autouse=True)
def few() -> Iterator[None]:
    """Far fewer poses are looked at than a search needs."""
    with pytest.MonkeyPatch.context() as patched:
        draw_fewer(patched)
        yield


@pytest.fixture
def no_planes(monkeypatch: pytest.MonkeyPatch) -> None:
    """No planes are confirmed at the pose."""
    skip_planes(monkeypatch)


class Solved(NamedTuple):
    """A scene without regions, estimated, and its stages."""

    run: SceneEstimate
    stages: Stages


@pytest.fixture(scope="module")
def solved(worlds: list[World], tmp_path_factory: pytest.TempPathFactory) -> Solved:
    """The scene of the pair 0001, estimated once for all tests that look at it."""
    folder, stages = tmp_path_factory.mktemp("solved"), Stages()
    write_pair(folder, worlds[0], "0001")
    return Solved(estimate_scene(load_scene(write_scene(folder)), stages), stages)


def write_pair(folder: Path, world: World, name: str, shift: Any = (0.0, 0.0, 0.0)) -> None:
    Image.fromarray(world.photo).save(folder / f"{name}.png")
    write_ply(folder / f"{name}.ply", Cloud.from_points(world.points + shift, intensity=world.intensity))


def write_scene(folder: Path, **values: Any) -> Path:
    """A scene file of the pair 0001, or of frames."""
    own = {} if "frames" in values else {"image": "0001.png", "cloud": "0001.ply"}
    held = {"camera": LENS, **own, "prior": PRIOR, **values}
    path = folder / "scene.yaml"
    path.write_text(to_yaml({key: value for key, value in held.items() if value is not None}), encoding="utf-8")
    return path


@pytest.fixture
def pair(worlds: list[World], tmp_path: Path) -> Path:
    """A folder with the photo and the cloud 0001, and a calibration."""
    write_pair(tmp_path, worlds[0], "0001")
    (tmp_path / "cameras.txt").write_text(COLMAP, encoding="utf-8")
    return tmp_path


@pytest.fixture
def drive(worlds: list[World], tmp_path: Path) -> Path:
    """A folder of two pairs."""
    folder = tmp_path / "drive"
    folder.mkdir()
    for number, world in enumerate(worlds, start=1):
        write_pair(folder, world, f"000{number}")
    (tmp_path / "cameras.txt").write_text(COLMAP, encoding="utf-8")
    return folder


def numbers_in(value: Any) -> Iterator[float]:
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            yield from numbers_in(item)
    elif isinstance(value, float):
        yield value


def assert_right(matrix: Any, truth: rp.Pose) -> None:
    pose = rp.Pose.from_matrix(matrix)
    assert np.degrees((pose.rotation * truth.rotation.inv()).magnitude()) < 0.5
    assert np.linalg.norm(pose.camera_center - truth.camera_center) < 0.15


def test_a_scene_without_regions_gives_the_pose(solved: Solved, worlds: list[World]) -> None:
    scene, stages = solved
    assert_right(scene.estimate.pose.matrix, worlds[0].pose)
    edges = edges_of(scene.estimate)
    assert edges.assumed == () and scene.names == ()
    assert "edges" in stages.seconds
    result = scene_result(scene)
    assert all(map(math.isfinite, numbers_in(result)))
    json.dumps(result, allow_nan=False)
    found = result["diagnostics"]
    assert found["overlap_error"] is None and found["regions"] == [] and found["rig"] is None
    search = found["edges"]
    assert search["regions_only"] is None and found["matching"] is None
    assert search["alignment"]["edges"] > 100 and search["alignment"]["log_odds"] > 3.0
    assert search["count"] == edges.count and search["log_odds"] == edges.log_odds
    assert search["log_odds_over_next"] is None or search["log_odds_over_next"] > 0.0
    assert search["assumed"] == []
    prior = search["prior"]
    assert prior["camera_near_m"] == [0.0, 0.0, 0.0] and prior["camera_near_sigma_m"] == 0.3
    assert prior["up"] == [0.0, 0.0, 1.0] and prior["up_sigma_deg"] == 3.0
    assert prior["initial_rotation_sigma_deg"] == 5.0 and prior["initial_center_sigma_m"] == 0.3
    assert np.allclose(prior["initial_camera_from_world"]["matrix"], pose_of(45.0).matrix)


def test_the_verdict_speaks_of_edges(solved: Solved) -> None:
    run_ = solved.run
    assert run_.estimate.status in {"trusted", "check"}
    assert re.match(r"The edges of the cloud lie on those of the photo at this pose, by odds of e\^\d+", headline(run_))
    assert "regions" not in headline(run_)


def test_the_verdict_of_a_wrong_photo_is_doubtful(no_planes: None, pair: Path, worlds: list[World]) -> None:
    Image.fromarray(worlds[1].photo[:, ::-1]).save(pair / "0001.png")
    estimate = estimate_scene(load_scene(write_scene(pair))).estimate
    assert estimate.status == rp.PoseStatus.DOUBTFUL and estimate.warnings


def test_all_files_of_a_scene_without_regions_are_written(pair: Path) -> None:
    scene = load_scene(write_scene(pair, prior={key: PRIOR[key] for key in ("camera_near", "up")}))
    run_, out = estimate_scene(scene), pair / "out"
    out.mkdir()
    files = bundle(run_, Stages(), folder=out)
    assert run_.estimate.diagnostics.alternatives
    assert run_.regions_found is not None
    planes = {"planes.png", "regions.png", "regions.npy"}
    assert files.writers.keys() == set(file_names(scene)) - (set() if run_.regions_found.names else planes)
    pictures = ["depth.png", "edges.png", "runner_up.png", "planes.png"]
    assert file_names(scene) == ["result.json", "report.html", *pictures, "regions.png", "regions.npy", "cloud.ply"]
    for name, write in files.writers.items():
        write(out / name)
    for name in ("depth.png", "edges.png", "runner_up.png"):
        # Depths have a legend beside the photo.
        height, width, _ = np.asarray(Image.open(out / name)).shape
        assert height == 320 and width >= 480
    cloud = rp.read_cloud(out / "cloud.ply")
    assert cloud.colors is not None and len(cloud) == 38_400
    report = (out / "report.html").read_text(encoding="utf-8")
    assert "edges of clouds in view" in report and "<h2>Regions</h2>" not in report
    assert "noise of the contours" not in report and report.count("data:image/jpeg") >= 3
    assert json.loads((out / "result.json").read_text(encoding="utf-8"))["status"] in {"check", "doubtful"}


def test_confirmed_planes_are_regions_of_a_scene_file(solved: Solved, pair: Path) -> None:
    run_ = solved.run
    assert run_.names == () and run_.regions_found is not None
    files = bundle(run_, Stages(), folder=pair)
    for name in ("planes.png", "regions.png", "regions.npy"):
        files.writers[name](pair / name)
    held = json.loads(json.dumps(files.result["diagnostics"]["confirmed_regions"], allow_nan=False))
    [frame] = held["frames"]
    assert len(frame["regions"]) >= 3 and frame["compared"] >= len(frame["regions"])
    assert frame["log_odds"] >= np.log(9.0)
    labels, points = np.asarray(Image.open(pair / "regions.png")), np.load(pair / "regions.npy")
    assert labels.shape == (320, 480) and points.shape == (38_400,)
    for number, region in enumerate(frame["regions"], start=1):
        assert np.count_nonzero(points == number) == region["cloud_points"]
        assert np.count_nonzero(labels == number) > 0.5 * region["image_area_px"]
        assert region["world"] == {"points": "regions.npy", "label": number}
    items = [{key: region[key] for key in ("name", "image", "world")} for region in frame["regions"]]
    again = load_scene(write_scene(pair, regions=items, sensor_origin=[0.0, 0.0, 0.0], solver={"edges": False}))
    found = estimate_scene(again)
    assert found.names == tuple(region["name"] for region in frame["regions"])
    matrix = held["pose"]["camera_from_world"]["matrix"]
    assert np.allclose(found.estimate.pose.matrix, matrix, atol=0.02)
    assert 0.0 <= held["pose"]["distance_sigmas"] < 4.5
    assert held["pose"]["warnings"] == [] or all(one["code"] for one in held["pose"]["warnings"])


def drawn(run_: Any) -> list[dict[str, Any]]:
    """The confirmed regions of a run as regions of its image alone."""
    held = scene_result(run_)["diagnostics"]["confirmed_regions"]["frames"][0]["regions"]
    return [{"name": f"face {number}", "image": one["image"]} for number, one in enumerate(held, start=1)]


def test_planes_are_matched_at_the_pose_by_edges(solved: Solved, pair: Path) -> None:
    given = solved.run
    assert given.regions_found is not None
    known = {"sensor_origin": [0.0, 0.0, 0.0], "image_regions": drawn(given), "world_regions": "planes"}
    run_ = estimate_scene(load_scene(write_scene(pair, **known)))
    matching = run_.sides.matching
    assert matching is not None and len(matching.pairs) >= 3 and matching.alternatives == ()
    [found] = given.regions_found.frames
    assert found is not None
    faces = {f"face {number}": one.indices for number, one in enumerate(found.regions, start=1)}
    planes = [side.indices for side in run_.sides.world_sides if side.indices is not None]
    right = [
        len(np.intersect1d(faces[name], plane)) > 0.5 * len(plane)
        for name, plane in zip(run_.names, planes, strict=True)
    ]
    assert sum(right) >= len(right) - 1
    assert {*matching.unmatched_image, *(image for image, _ in matching.pairs)} == set(faces)


def test_planes_are_not_matched_by_edges_that_tell_no_pose(
    solved: Solved, pair: Path, worlds: list[World], monkeypatch: pytest.MonkeyPatch
) -> None:
    given = solved.run
    Image.fromarray(worlds[1].photo[:, ::-1]).save(pair / "0001.png")
    asked: list[int] = []

    def matcher(sides: SceneData) -> SceneData:
        asked.append(len(sides.names))
        raise rp.PoseError("asked")

    monkeypatch.setattr("regionpose.scene.estimate.matched", matcher)
    known = {"sensor_origin": [0.0, 0.0, 0.0], "image_regions": drawn(given), "world_regions": "planes"}
    with pytest.raises(rp.PoseError, match="asked"):
        estimate_scene(load_scene(write_scene(pair, **known)))
    # The matcher by regions is asked of all of them.
    assert asked == [0]


def test_confirmed_planes_do_not_change_the_verdict(solved: Solved) -> None:
    run_ = solved.run
    assert headline(run_) == headline(replace(run_, regions_found=None))


def test_scenes_with_regions_confirm_no_planes(tmp_path: Path) -> None:
    run_ = estimate_scene(load_scene(write_plates(tmp_path)))
    assert run_.regions_found is None and scene_result(run_)["diagnostics"]["confirmed_regions"] is None


def test_what_was_assumed_is_in_the_result(no_planes: None, pair: Path) -> None:
    result = scene_result(estimate_scene(load_scene(write_scene(pair, prior=None))))
    assert result["diagnostics"]["edges"]["assumed"] == ["camera_near", "camera_near_sigma_m"]
    assert result["diagnostics"]["edges"]["prior"]["camera_near_m"] == [0.0, 0.0, 0.0]
    assert result["diagnostics"]["camera_near"] == {
        "place_in_world_m": [0.0, 0.0, 0.0],
        "sigma_m": 0.5,
        "source": "assumption",
    }
    known = scene_result(estimate_scene(load_scene(write_scene(pair, prior=None, sensor_origin=[0.0, 0.0, 0.0]))))
    assert known["diagnostics"]["edges"]["assumed"] == ["camera_near_sigma_m"]
    assert known["diagnostics"]["camera_near"]["source"] == "sensor_origin"
    assert (
        known["diagnostics"]["camera_near"]["sigma_m"]
        == known["diagnostics"]["edges"]["prior"]["camera_near_sigma_m"]
        == 0.5
    )


def test_a_scene_of_a_map_s_grid_gives_its_pose_there(no_planes: None, worlds: list[World], tmp_path: Path) -> None:
    write_pair(tmp_path, worlds[0], "0001", FAR)
    prior = {
        "up": [0.0, 0.0, 1.0],
        "initial": {"camera_from_world": {"matrix": pose_of(45.0).rebase(-FAR).matrix.tolist()}},
        "initial_rotation_sigma_deg": 5.0,
        "initial_center_sigma_m": 0.3,
    }
    run_ = estimate_scene(load_scene(write_scene(tmp_path, prior=prior, sensor_origin=FAR.tolist())))
    assert_right(run_.estimate.pose.rebase(FAR).matrix, worlds[0].pose)
    result = scene_result(run_)
    held = result["diagnostics"]["edges"]["prior"]
    assert np.allclose(held["camera_near_m"], FAR, atol=1e-6)
    assert np.allclose(held["initial_camera_from_world"]["matrix"], pose_of(45.0).rebase(-FAR).matrix, atol=1e-6)
    for other in run_.estimate.diagnostics.alternatives:
        assert np.linalg.norm(other.pose.camera_center - FAR) < 5.0


def test_frames_share_a_pose(no_planes: None, drive: Path, worlds: list[World]) -> None:
    frames = [{"name": name, "image": f"{name}.png", "cloud": f"{name}.ply"} for name in ("0001", "0002")]
    scene, stages = load_scene(write_scene(drive, frames=frames)), Stages()
    run_ = estimate_scene(scene, stages)
    assert_right(run_.estimate.pose.matrix, worlds[0].pose)
    files = bundle(run_, stages, folder=drive)
    json.dumps(files.result, allow_nan=False)
    assert [frame["name"] for frame in files.result["diagnostics"]["rig"]["frames"]] == ["0001", "0002"]
    for frame in files.result["diagnostics"]["rig"]["frames"]:
        assert frame["leave_one_out"] is None and frame["overlap_error"] is None
        assert frame["alignment"]["edges"] > 100
    assert "edges of 2 clouds lie on those of their photos" in files.result["headline"]
    # Not in all results: a runner-up, confirmed planes.
    kinds = ("runner_up", "planes", "regions")
    written = {name for name in files.writers if not name.startswith(kinds)}
    assert written == {name for name in file_names(scene) if not name.startswith(kinds)}
    assert {"depth_1.png", "depth_2.png", "edges_2.png", "cloud_2.ply"} <= written
    files.writers["report.html"](drive / "report.html")
    assert "<h2>Frames</h2>" not in (drive / "report.html").read_text(encoding="utf-8")


def test_an_estimate_that_nobody_waits_for_ends(pair: Path) -> None:
    with while_wanted(lambda: False), pytest.raises(UnwantedError):
        estimate_scene(load_scene(write_scene(pair)))


PLATE = {
    "name": "floor",
    "image": {"polygon": [[10.0, 10.0], [90.0, 10.0], [50.0, 80.0]]},
    "world": {"polygon": PLATES["floor"].tolist()},
}


def frame(name: str, **values: Any) -> dict[str, Any]:
    return {"name": name, "image": "0001.png", "cloud": "0001.ply", **values}


REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "no cloud": ({"cloud": None}, "image: 0001.png", "found no region; needed one with both sides"),
    "no edges": ({"solver": {"edges": False}}, "image: 0001.png", "found no region; .*solver.edges"),
    "a frame without a region": (
        {"frames": [frame("first", regions=[PLATE]), frame("second")]},
        "name: second",
        r"frames\[1\]: found no region, but some in other frames; needed some in all, or in none",
    ),
    "a frame without a cloud": (
        {"frames": [frame("first"), {"name": "second", "image": "0001.png"}]},
        "name: second",
        "found no region; needed one with both sides",
    ),
    "regions of one side": (
        {"image_regions": [{"name": "sign", "image": PLATE["image"]}]},
        "",
        "found regions of one side; needed some with both sides",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_scenes_that_tell_nothing_are_refused(tmp_path: Path, case: str) -> None:
    values, at, message = REFUSED[case]
    path = write_scene(tmp_path, **values)
    with pytest.raises(SceneError, match=message) as failed:
        load_scene(path)
    found = re.match(r".*scene\.yaml:(\d+): ", str(failed.value))
    assert found is not None, failed.value
    if at.startswith("name"):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert at in lines[int(found[1]) - 1], failed.value


def test_clouds_without_edges_are_named_as_such(pair: Path) -> None:
    write_ply(pair / "0001.ply", Cloud.from_points(np.ones((4, 3))), overwrite=True)
    with pytest.raises(rp.PoseError, match="no pose was found: 4 points have 0 edges"):
        estimate_scene(load_scene(write_scene(pair)))


# The command.


def said(code_out_err: tuple[int, str, str]) -> str:
    """What a command that gave a pose said."""
    code, out, errors = code_out_err
    assert code in (0, 3) and errors == "", errors
    return out


def written_scene(folder: Path) -> dict[str, Any]:
    value = load_scene(folder / "scene.yaml").document.value
    assert isinstance(value, dict)
    return value


def test_a_photo_and_a_cloud_in_either_order_give_one_result(
    no_planes: None, pair: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words: list[str | Path] = ["--camera", pair / "cameras.txt", "--up", "z", "--json", "--quiet"]
    results = []
    # Of another name, in a folder of its own.
    scans = pair / "scans"
    scans.mkdir()
    (pair / "0001.ply").rename(scans / "scan.ply")
    for order in ((pair / "0001.png", scans / "scan.ply"), (scans / "scan.ply", pair / "0001.png")):
        results.append(json.loads(said(run(capsys, "calibrate", *order, *words))))
        out = pair / "0001-result"
        assert {"scene.yaml", "result.json", "report.html", "depth.png", "edges.png", "cloud.ply"} <= {
            path.name for path in out.iterdir()
        }
        assert not list(scans.glob("*-result"))
        words += ["--force"]
    first, second = ({key: value for key, value in result.items() if key != "seconds"} for result in results)
    assert first == second
    again = json.loads(said(run(capsys, "estimate", out / "scene.yaml", "--out", pair / "again", "--json", "--quiet")))
    assert again["camera_from_world"] == first["camera_from_world"]


def test_a_folder_without_regions_is_calibrated(drive: Path, capsys: pytest.CaptureFixture[str]) -> None:
    camera, out = drive.parent / "cameras.txt", drive.parent / "out"
    told = said(run(capsys, "calibrate", drive, "--camera", camera, "--up", "z", "--near", "0.3", "--out", out))
    assert re.search(r"searched: within 0\.3 m \(1 sigma\) of \[0\.00, 0\.00, 0\.00\] m; every heading", told)
    assert re.search(r"\d+ edges; odds e\^-?\d+\.\d over chance, ", told)
    assert "overlap error" not in told and "The edges of 2 clouds lie on those of their photos" in told
    assert re.search(r"planes confirmed in 0001: \d+ of \d+; odds of all borders e\^", told)
    assert {"depth_1.png", "depth_2.png", "edges_1.png", "cloud_2.ply", "report.html", "regions_2.npy"} <= {
        p.name for p in out.iterdir()
    }
    held = written_scene(out)
    assert [one["name"] for one in held["frames"]] == ["0001", "0002"]
    assert all(not {"regions", "image_regions", "world_regions"} & one.keys() for one in held["frames"])


def test_what_was_searched_by_a_mount_alone_is_said(
    no_planes: None, pair: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--camera", pair / "cameras.txt", "--mount", "front")
    told = said(run(capsys, "calibrate", pair / "0001.png", pair / "0001.ply", *words))
    assert "searched: within 0.5 m (1 sigma) of [0.00, 0.00, 0.00] m" in told
    assert "rotations within 20 deg (1 sigma) of the initial one" in told


def test_what_was_assumed_is_said(no_planes: None, pair: Path, capsys: pytest.CaptureFixture[str]) -> None:
    told = said(run(capsys, "calibrate", pair / "0001.png", pair / "0001.ply", "--camera", pair / "cameras.txt"))
    assert "searched: within 0.5 m (1 sigma) of [0.00, 0.00, 0.00] m (assumed); every rotation" in told


def prior_by(pair: Path, monkeypatch: pytest.MonkeyPatch, *words: str) -> dict[str, Any]:
    """The prior of the scene that the command would run."""
    scenes: list[Any] = []
    monkeypatch.setattr("regionpose.cli.calibrate.run_scene", lambda scene, *_, **__: scenes.append(scene))
    from regionpose.cli import main

    paths = [str(pair / "0001.png"), str(pair / "0001.ply"), "--camera", str(pair / "cameras.txt")]
    assert main(["calibrate", *paths, "--quiet", *words]) == 0
    held = scenes[0].document.value
    return dict(held.get("prior", {}))


@pytest.mark.parametrize(
    ("words", "up"),
    [
        ("z", [0, 0, 1]),
        ("-z", [0, 0, -1]),
        ("+y", [0, 1, 0]),
        ("-x", [-1, 0, 0]),
        ("0,0,1", [0, 0, 1]),
        ("0.1,-0.2,0.9", [0.1, -0.2, 0.9]),
    ],
)
def test_up_is_an_axis_or_a_direction(pair: Path, monkeypatch: pytest.MonkeyPatch, words: str, up: list[float]) -> None:
    assert prior_by(pair, monkeypatch, "--up", words) == {"up": up, "up_sigma_deg": 5.0}
    assert prior_by(pair, monkeypatch, f"--up={words}")["up"] == up


def test_near_is_a_deviation_or_a_place_with_one(pair: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert prior_by(pair, monkeypatch) == {}
    assert prior_by(pair, monkeypatch, "--near", "0.3") == {
        "camera_near_sigma_m": 0.3,
    }
    assert prior_by(pair, monkeypatch, "--near", "1,-2,0.5,0.2") == {
        "camera_near": [1.0, -2.0, 0.5],
        "camera_near_sigma_m": 0.2,
    }
    about_scanner = prior_by(pair, monkeypatch, "--near", "0.3", "--sensor-origin", "4,5,6")
    assert about_scanner == {"camera_near_sigma_m": 0.3}


AXES = {"front": [1, 0, 0], "left": [0, 1, 0], "rear": [-1, 0, 0], "right": [0, -1, 0]}


@pytest.mark.parametrize("mount", AXES)
def test_a_mount_is_a_level_camera_that_looks_there(pair: Path, monkeypatch: pytest.MonkeyPatch, mount: str) -> None:
    prior = prior_by(pair, monkeypatch, "--mount", mount, "--near", "1,2,3,0.4")
    pose = rp.Pose.from_matrix(prior["initial"]["camera_from_world"]["matrix"])
    right, down, forward = pose.rotation.as_matrix()
    assert forward == pytest.approx(AXES[mount]) and down == pytest.approx([0.0, 0.0, -1.0])
    assert right == pytest.approx(np.cross([0.0, 0.0, -1.0], AXES[mount]))
    assert pose.camera_center == pytest.approx([1.0, 2.0, 3.0])
    assert (prior["initial_rotation_sigma_deg"], prior["initial_center_sigma_m"]) == (20.0, 0.4)
    # The place counts once.
    assert prior["camera_near"] is None and "camera_near_sigma_m" not in prior
    alone = prior_by(pair, monkeypatch, "--mount", mount)
    assert alone["initial_center_sigma_m"] == 0.5 and alone["camera_near"] is None
    assert rp.Pose.from_matrix(alone["initial"]["camera_from_world"]["matrix"]).camera_center == pytest.approx(
        [0, 0, 0]
    )


BAD: dict[str, tuple[list[str], str]] = {
    "two photos": (["0001.png", "0002.png"], r"0002\.png: found a second photo; needed a cloud"),
    "three paths": (
        ["0001.png", "0001.ply", "0002.ply"],
        "found 3 paths; needed a folder, a bag, or a photo and a cloud",
    ),
    "no such cloud": (["0001.png", "0009.ply"], r"0009\.ply: found nothing; needed a photo and a cloud"),
    "no such photo": (["0009.png", "0001.ply"], r"0009\.png: found nothing; needed a photo and a cloud"),
    "one file": (["0001.png"], r"0001\.png: found a file; needed a folder"),
    "near in words": (["0001.png", "0001.ply", "--near", "close"], "--near: found 'close'; needed meters, or x,y,z,si"),
    "near of two": (
        ["0001.png", "0001.ply", "--near", "1,2"],
        "--near: found 2 numbers; needed meters, or x,y,z,sigma",
    ),
    "near of none": (["0001.png", "0001.ply", "--near", "0"], "--near.*found 0"),
    "near below": (["0001.png", "0001.ply", "--near=-0.5"], "--near.*found -0.5"),
    "near at nan": (["0001.png", "0001.ply", "--near", "nan"], "--near.*found nan"),
    "near endless": (["0001.png", "0001.ply", "--near", "inf"], "--near.*found inf"),
    "near a place at nan": (["0001.png", "0001.ply", "--near", "nan,0,0,1"], "--near.*place is .nan"),
    "up in words": (
        ["0001.png", "0001.ply", "--up", "north"],
        "--up: found 'north'; needed x, y, z, -x, -y, -z or x,y",
    ),
    "up of two": (
        ["0001.png", "0001.ply", "--up", "0,1"],
        "--up: found 2 numbers; needed x, y, z, -x, -y, -z or x,y,z",
    ),
    "up with two signs": (["0001.png", "0001.ply", "--up=--z"], "--up: found '--z'; needed x, y, z"),
    "up nowhere": (["0001.png", "0001.ply", "--up", "0,0,0"], "--up"),
    "no such mount": (["0001.png", "0001.ply", "--mount", "top"], "--mount.*top"),
    "a place of two": (["0001.png", "0001.ply", "--sensor-origin", "1,2"], "--sensor-origin: found 2 numbers"),
}


@pytest.mark.parametrize("case", BAD)
def test_words_that_are_wrong_are_named(pair: Path, capsys: pytest.CaptureFixture[str], case: str) -> None:
    words, message = BAD[case]
    Image.new("L", (480, 320)).save(pair / "0002.png")
    paths = [str(pair / word) if re.match(r"\d{4}\.", word) else word for word in words]
    code, out, errors = run(capsys, "calibrate", *paths, "--camera", pair / "cameras.txt", "--quiet")
    assert code == 2 and out == ""
    # Typer draws a box about its own errors.
    assert re.search(message, " ".join(errors.split())), errors
    assert "Traceback" not in errors and not list(pair.glob("*-result"))


def test_two_clouds_are_refused(pair: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ply(pair / "0002.ply", Cloud.from_points(np.ones((4, 3))))
    code, _, errors = run(
        capsys, "calibrate", pair / "0001.ply", pair / "0002.ply", "--camera", pair / "cameras.txt", "--quiet"
    )
    assert code == 2 and re.search(r"0001\.ply: found .*; needed ", errors), errors


def test_a_camera_is_needed(pair: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, errors = run(capsys, "calibrate", pair / "0001.png", pair / "0001.ply", "--quiet")
    assert code == 2 and "found no camera; needed camera" in errors


def test_clouds_without_edges_end_with_the_code_of_no_pose(pair: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_ply(pair / "0001.ply", Cloud.from_points(np.ones((4, 3))), overwrite=True)
    words = ("--camera", pair / "cameras.txt", "--quiet")
    code, out, errors = run(capsys, "calibrate", pair / "0001.png", pair / "0001.ply", *words)
    assert code == 3 and out == "" and "no pose was found: 4 points have 0 edges" in errors
    assert not list(pair.glob("*-result"))


def test_the_scene_file_beside_a_photo_counts(pair: Path) -> None:
    beside = {"camera": LENS, "sensor_origin": [0.0, 0.0, 0.1], "cloud": "0001.ply"}
    (pair / "0001.yaml").write_text(to_yaml(beside), encoding="utf-8")
    scene = pair_scene(pair / "0001.png", pair / "0001.ply", pair / "out" / "scene.yaml", FolderOptions())
    held = scene.document.value
    assert isinstance(held, dict)
    assert held["frames"] == [
        {"name": "0001", "image": "../0001.png", "cloud": "../0001.ply", "sensor_origin": [0.0, 0.0, 0.1]}
    ]
    write_ply(pair / "other.ply", Cloud.from_points(np.ones((4, 3))))
    with pytest.raises(
        SceneError, match=r"0001\.yaml:\d+: cloud: found '0001\.ply'; needed other\.ply, or no such key"
    ):
        pair_scene(pair / "0001.png", pair / "other.ply", pair / "out" / "scene.yaml", FolderOptions())


def test_options_go_before_the_priors_of_pairs(pair: Path) -> None:
    (pair / "0001.yaml").write_text(to_yaml({"camera": LENS, "prior": PRIOR}), encoding="utf-8")
    place = (pair / "0001.png", pair / "0001.ply", pair / "out" / "scene.yaml")
    assert pair_scene(*place, FolderOptions()).model.prior.up_sigma_deg == 3.0
    given = pair_scene(*place, FolderOptions(prior={"up": [0.0, 1.0, 0.0]})).model.prior
    assert given.up == [0.0, 1.0, 0.0] and given.up_sigma_deg is None
    assert given.camera_near is None


def test_the_camera_of_the_command_is_that_of_the_scene(pair: Path) -> None:
    assert rp.load_camera(pair / "cameras.txt") == CAMERA
