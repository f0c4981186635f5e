"""`regionpose calibrate` of a bag: which of its photos and clouds are taken, and the pose that they give."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from bag_files import BEGIN, MATRICES, SECOND, Bag
from commands import run
from made_up_worlds import CAMERA, World
from numpy.typing import NDArray
from regionpose.scene.loading import Scene, load_scene
from small_searches import draw_fewer, skip_planes, two_worlds

pytestmark = pytest.mark.slow

PHOTOS, CLOUDS, INFO = "/rig/front/image_raw", "/lidar/points", "/rig/front/camera_info"
STANDS_S = ((0.0, 2.0), (5.0, 6.0))
"""When the rig stands at the first place and at the second one, seconds; it moves in between."""

LAST_S, STEP_NS, LATER_NS = 6.0, SECOND // 5, 30_000_000
"""The time of the last photo, the time between two, and by how much clouds are later."""

SEEN = {**MATRICES, "d": np.zeros(5), "k": CAMERA.matrix.ravel()}


@pytest.fixture(scope="module")
def worlds() -> list[World]:
    return two_worlds()


@pytest.fixture(autouse=True)
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer poses are looked at than a search of all needs."""
    draw_fewer(monkeypatch, 6_000, (200, 40, 8))
    skip_planes(monkeypatch)


def scan_of(world: World) -> NDArray[np.void]:
    kind = np.dtype([(name, "<f4") for name in ("x", "y", "z", "intensity")])
    rows = np.zeros(len(world.points), dtype=kind)
    for axis, name in enumerate("xyz"):
        rows[name] = world.points[:, axis]
    rows["intensity"] = world.intensity
    return rows


def recorded(worlds: list[World], kind: str = "mcap file", stride: int = 40) -> Bag:
    """A rig that stands at one place, moves, and stands at another: at both ends it gives a pose, in between not.

    Clouds are of each `stride`-th point: all of them are needed for a pose alone.
    """
    bag, rng = Bag(kind), np.random.default_rng(0)
    scans = [scan_of(world)[::stride] for world in worlds]
    bag.camera_info(BEGIN, INFO, SEEN, (320, 480))
    for number, at in enumerate(range(0, int(LAST_S * SECOND) + 1, STEP_NS)):
        place = int(at >= STANDS_S[1][0] * SECOND)
        moves = STANDS_S[0][1] * SECOND < at < STANDS_S[1][0] * SECOND
        photo = np.roll(worlds[place].photo, 17 * number if moves else 0, axis=1).astype(float)
        noisy = np.clip(photo + rng.normal(0.0, 1.0, photo.shape), 0, 255).astype(np.uint8)
        bag.picture(BEGIN + at, noisy, "mono8", topic=PHOTOS)
        bag.scan(BEGIN + at + LATER_NS, scans[place], topic=CLOUDS)
    return bag


@pytest.fixture(scope="module")
def bag(worlds: list[World], tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(worlds, stride=1).write(tmp_path_factory.mktemp("bag"))


def chosen_in(scene: Scene) -> list[tuple[float, float]]:
    """The times of photos and clouds that a scene names, seconds."""
    held: Any = scene.document.value
    times = [[re.search(r"@([\d.]+)$", frame[key]) for key in ("image", "cloud")] for frame in held["frames"]]
    return [(float(photo[1]), float(cloud[1])) for photo, cloud in times if photo and cloud]


def stands(time_s: float) -> bool:
    return any(start <= time_s <= end for start, end in STANDS_S)


def calibrated(capsys: pytest.CaptureFixture[str], bag: Path, out: Path, *words: str | Path) -> dict[str, Any]:
    code, said, errors = run(capsys, "calibrate", bag, "--up", "z", "--out", out, "--json", *words)
    assert code in (0, 3), errors
    result: dict[str, Any] = json.loads(said)
    return result


def test_frames_of_both_places_give_the_pose(
    bag: Path, worlds: list[World], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    result = calibrated(capsys, bag, tmp_path / "out", "--frames", "2", "--near", "0.3", "--mount", "front")
    pose = rp.Pose.from_matrix(result["camera_from_world"]["matrix"])
    assert np.degrees((pose.rotation * worlds[0].pose.rotation.inv()).magnitude()) < 0.5
    assert np.linalg.norm(pose.camera_center - worlds[0].pose.camera_center) < 0.15
    times = chosen_in(load_scene(tmp_path / "out" / "scene.yaml"))
    assert [stands(photo) for photo, _ in times] == [True, True]
    assert times[0][0] <= STANDS_S[0][1] and times[1][0] >= STANDS_S[1][0]
    assert [cloud - photo for photo, cloud in times] == pytest.approx([0.03, 0.03])
    assert {"camera", "image of 0.000 s"} & {role for one in result["inputs"] for role in one["roles"]}


def test_what_was_taken_is_said_and_written(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ("--times", "0.4,5.2", "--mount", "front", "--up", "z")
    code, _, errors = run(capsys, "calibrate", bag, *words, "--out", tmp_path / "out")
    assert code in (0, 3), errors
    for text in (errors, (tmp_path / "out" / "scene.yaml").read_text(encoding="utf-8")):
        assert re.search(r"0\.400 s\b.*\b30 ms later", text) and re.search(r"5\.200 s\b.*\b30 ms later", text)
    code, again, _ = run(capsys, "estimate", tmp_path / "out" / "scene.yaml", "--out", tmp_path / "again", "--json")
    result = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))
    assert json.loads(again)["camera_from_world"] == result["camera_from_world"]


@pytest.fixture
def scene_by(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    """The scene that the command would run, by its words."""

    def scene_of(*words: str | Path) -> Scene:
        scenes: list[Scene] = []
        monkeypatch.setattr("regionpose.cli.calibrate.run_scene", lambda scene, *_, **__: scenes.append(scene))
        code, _, errors = run(capsys, "calibrate", *words, "--quiet", "--out", tmp_path / "out")
        assert code == 0, errors
        return scenes[0]

    return scene_of


@pytest.mark.parametrize("count", [1, 3, 4, 8])
def test_photos_are_of_a_rig_that_stands_where_it_does(bag: Path, scene_by: Any, count: int) -> None:
    """While it moves every part of the recording that shows something new has a photo, too."""
    times = [photo for photo, _ in chosen_in(scene_by(bag, "--frames", str(count)))]
    assert len(times) == count and times == sorted(set(times))
    assert stands(times[0])
    # In all, the rig stands half of the time, but shows next to nothing new meanwhile.
    assert sum(map(stands, times)) <= 4


def test_a_recording_of_few_photos_gives_them_all(worlds: list[World], tmp_path: Path, scene_by: Any) -> None:
    made = recorded(worlds)
    kept = [0, *range(1, 7)]
    made.written = [made.written[index] for index in kept]
    times = chosen_in(scene_by(made.write(tmp_path), "--frames", "9"))
    assert [photo for photo, _ in times] == pytest.approx([0.0, 0.2, 0.4])


def test_of_still_photos_the_one_with_the_most_edges_is_taken(
    worlds: list[World], tmp_path: Path, scene_by: Any
) -> None:
    made, scan = Bag("mcap"), scan_of(worlds[0])
    made.camera_info(BEGIN, INFO, SEEN, (320, 480))
    for number in range(12):
        # A lamp goes on for a while.
        lit = worlds[0].photo if 4 <= number < 8 else worlds[0].photo // 8
        made.picture(BEGIN + number * SECOND, lit, "mono8", topic=PHOTOS)
        made.scan(BEGIN + number * SECOND, scan, topic=CLOUDS)
    ((photo, _),) = chosen_in(scene_by(made.write(tmp_path), "--frames", "1"))
    assert photo in (4.0, 5.0, 6.0)


def shifted(worlds: list[World], stamp_ns: int) -> Bag:
    """A photo each 0.2 s and a cloud recorded 30 ms after it, whose header says another time."""
    made = recorded(worlds)
    for index, (topic, at, message) in enumerate(made.written):
        if topic == CLOUDS:
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(at + stamp_ns, SECOND)
            made.written[index] = (topic, at, message)
    return made


@pytest.mark.parametrize(("stamp_ns", "later_s"), [(-150_000_000, 0.23), (-1_600_000_000 * SECOND, 0.03)])
def test_headers_count_where_their_clock_is_that_of_the_recording(
    worlds: list[World], tmp_path: Path, scene_by: Any, stamp_ns: int, later_s: float
) -> None:
    """A cloud whose header is 150 ms before its recording belongs to the photo before; one of 1973 says nothing."""
    times = chosen_in(scene_by(shifted(worlds, stamp_ns).write(tmp_path), "--times", "1.0,5.4"))
    assert [photo for photo, _ in times] == pytest.approx([1.0, 5.4])
    assert [cloud - photo for photo, cloud in times] == pytest.approx([later_s, later_s])


@pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
def test_bags_of_each_kind_are_read(worlds: list[World], tmp_path: Path, scene_by: Any, kind: str) -> None:
    path = recorded(worlds, kind).write(tmp_path)
    scene = scene_by(path, "--times", "5.4,1700000001.0")
    assert chosen_in(scene) == [(5.4, 5.43), (1.0, 1.03)]
    assert scene.document.value["camera"] == {"file": f"../{path.name}#{INFO}"}


def test_names_of_topics_say_whether_photos_are_rectified(worlds: list[World], tmp_path: Path, scene_by: Any) -> None:
    made = recorded(worlds)
    made.written = [(topic.replace("image_raw", "image_rect_color"), at, one) for topic, at, one in made.written]
    made.camera_info(BEGIN, "/camera_info", SEEN, (320, 480))
    path = made.write(tmp_path)
    assert scene_by(path, "--frames", "1").document.value["camera"]["rectified"] is True
    given = scene_by(path, "--frames", "1", "--camera", f"{path}#/camera_info").document.value["camera"]
    assert given == "../bag/" + f"{path.name}#/camera_info"


def two_cameras(made: Bag, worlds: list[World]) -> None:
    made.picture(BEGIN, worlds[0].photo, "mono8", topic="/rig/left/image_raw")


def no_calibration(made: Bag, worlds: list[World]) -> None:
    made.written = [one for one in made.written if one[0] != INFO]


def no_clouds(made: Bag, worlds: list[World]) -> None:
    made.written = [one for one in made.written if one[0] != CLOUDS]


def late_clouds(made: Bag, worlds: list[World]) -> None:
    held = [one for one in made.written if one[0] != CLOUDS]
    made.written = [*held, (CLOUDS, BEGIN + 30 * SECOND, next(one for one in made.written if one[0] == CLOUDS)[2])]
    made.written[-1][2].header.stamp.sec += 30


def short_photo(made: Bag, worlds: list[World]) -> None:
    photo = next(one[2] for one in made.written if one[0] == PHOTOS)
    photo.data = photo.data[:100]


def nothing(made: Bag, worlds: list[World]) -> None:
    pass


BAD: dict[str, tuple[Any, list[str], str]] = {
    "two topics of photos": (
        two_cameras,
        [],
        r"found 2 topics of photos; needed photos, one of "
        r"/rig/front/image_raw \(sensor_msgs/msg/Image\), /rig/left/image_raw \(sensor_msgs/msg/Image\)",
    ),
    "no such topic": (
        nothing,
        ["--clouds", "/scan"],
        r"clouds: found /scan; needed a topic of .*: /lidar/points \(sensor_msgs/msg/PointCloud2\)",
    ),
    "a topic of another type": (nothing, ["--photos", CLOUDS], "photos: found /lidar/points; needed a topic"),
    "no clouds": (no_clouds, [], r"found no topic of clouds, but /rig/front/camera_info .*; needed .*PointCloud2"),
    "late clouds": (late_clouds, [], "found no photo with a cloud within a second"),
    "late clouds at a time": (late_clouds, ["--times", "1"], "times: found no photo and cloud within a second of 1;"),
    "no calibration": (no_calibration, [], r"found no calibration .* beside /rig/front/image_raw; needed camera"),
    "a short photo": (short_photo, [], "/rig/front/image_raw: found 100 bytes"),
    "times in words": (nothing, ["--times", "1,noon"], "times: found 'noon'; needed seconds"),
    "a time below": (nothing, ["--times=-1"], "times: found -1; needed seconds"),
    "a late time": (
        nothing,
        ["--times", "60"],
        "times: .* within a second of 60; needed photos from 0.000 to 6.000 s",
    ),
    "a time without end": (nothing, ["--times", "inf"], "times: found inf; needed seconds"),
    "times and frames": (nothing, ["--times", "1", "--frames", "2"], "--frames: found it beside --times"),
    "regions": (nothing, ["--coco", "all.json"], "--coco: found it with .*; needed a folder"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_a_recording_lacks_is_named(
    worlds: list[World], tmp_path: Path, capsys: pytest.CaptureFixture[str], case: str
) -> None:
    spoil, words, message = BAD[case]
    made = recorded(worlds)
    spoil(made, worlds)
    code, out, errors = run(capsys, "calibrate", made.write(tmp_path), *words, "--quiet", "--out", tmp_path / "out")
    assert code == 2 and out == ""
    assert re.search(message, errors), errors
    assert errors.count("\n") == 1 and not (tmp_path / "out").exists()


@pytest.mark.parametrize("word", ["--photos", "--clouds", "--times", "--frames"])
def test_options_of_recordings_need_one(tmp_path: Path, capsys: pytest.CaptureFixture[str], word: str) -> None:
    code, _, errors = run(capsys, "calibrate", tmp_path, word, "3")
    assert code == 2 and f"{word}: found it with" in errors


def test_a_recording_that_is_not_there_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, errors = run(capsys, "calibrate", tmp_path / "none.mcap")
    assert code == 2 and "none.mcap" in errors
