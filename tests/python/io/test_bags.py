"""Clouds and pictures of ROS bags, written by rosbags and read back."""

from __future__ import annotations

import json
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import regionpose as rp
from bag_files import BEGIN, KINDS, PACKED, PIXELS, SCANS, Bag, filled, livox_bag, points_of
from numpy.typing import NDArray
from regionpose.cameras import PinholeCamera
from regionpose.io.bags.pictures import read_bag_picture
from regionpose.io.bags.place import BagPlace, bag_place, is_there
from regionpose.io.bags.unfolding import _install
from regionpose.io.calibrations import load_camera
from regionpose.io.clouds import CloudError, MissingExtraError, read_cloud
from regionpose.io.reading import FileError
from regionpose.scene.exposure import scene_sides
from regionpose.scene.inputs import input_values
from regionpose.scene.loading import load_scene
from regionpose.scene.sensors import read_picture
from rosbags.highlevel import AnyReader
from scene_files import scene_values, write_scene


@pytest.fixture(params=KINDS)
def bag(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """The path of such a bag, of each kind."""
    return filled(request.param).write(tmp_path)


def test_a_scan_is_the_cloud_of_its_message(bag: Path) -> None:
    cloud = read_cloud(f"{bag}#/points@0.2")
    given = points_of(2)
    np.testing.assert_array_equal(cloud.points, np.stack([given[name] for name in "xyz"], axis=1))
    assert cloud.intensity is not None and cloud.colors is not None and cloud.sensor_origin is not None
    np.testing.assert_array_equal(cloud.intensity, given["intensity"])
    assert cloud.colors[0].tolist() == [0x10, 0x20, 0x30]
    assert cloud.sensor_origin.tolist() == [0.0, 0.0, 0.0]


def test_an_organized_scan_keeps_where_nothing_came_back(tmp_path: Path) -> None:
    made, points = Bag("mcap"), points_of(1)
    for axis in "xyz":
        points[axis][4] = 0.0
    for at in (BEGIN, BEGIN + 1):
        made.scan(at, points, height=2, width=3, row_step=72)
    path = made.write(tmp_path)
    cloud = read_cloud(f"{path}#/points")
    assert (len(cloud), cloud.dropped, cloud.grid_shape) == (5, 1, (2, 3)) and cloud.grid_indices is not None
    np.testing.assert_array_equal(cloud.grid_indices, [0, 1, 2, 3, 5])
    two = read_cloud(f"{path}#/points@0x2")
    assert (len(two), two.dropped, two.grid_shape) == (10, 2, None)


@pytest.mark.parametrize(
    ("when", "first"),
    [("", 0), ("@0", 0), ("@0.14", 1), ("@0.16", 2), ("@1.3", 4), ("@1700000000.29", 3), ("@1700000000.300000001", 3)],
)
def test_the_message_nearest_to_a_time_is_read(when: str, first: int, bag: Path) -> None:
    assert read_cloud(f"{bag}#/points{when}").points[0, 0] == first


def test_scans_are_joined_and_numbered(bag: Path) -> None:
    told: list[float] = []
    cloud = read_cloud(f"{bag}#/points@0.1x3", progress=told.append)
    np.testing.assert_array_equal(cloud.fields["scan"], np.repeat([0, 1, 2], 6))
    np.testing.assert_array_equal(cloud.points[::6, 0], [1.0, 2.0, 3.0])
    assert told == pytest.approx([1 / 3, 2 / 3, 1.0])
    with pytest.raises(FileError, match="found 2 messages from there on; needed 3"):
        read_cloud(f"{bag}#/points@0.3x3")


def test_pictures_raw_and_compressed_are_the_same(bag: Path) -> None:
    np.testing.assert_array_equal(read_picture(Path(f"{bag}#/camera@0.25")), PIXELS)
    np.testing.assert_array_equal(read_picture(Path(f"{bag}#/compressed")), PIXELS)


@pytest.mark.parametrize(
    ("encoding", "pixels", "expected"),
    [
        ("bgr8", PIXELS, PIXELS[..., ::-1]),
        ("rgba8", np.dstack([PIXELS, PIXELS[..., :1]]), PIXELS),
        ("bgra8", np.dstack([PIXELS[..., ::-1], PIXELS[..., :1]]), PIXELS),
        ("mono8", PIXELS[..., 0], np.repeat(PIXELS[..., :1], 3, axis=2)),
        ("mono16", PIXELS[..., 0].astype("<u2") * 257, np.repeat(PIXELS[..., :1], 3, axis=2)),
    ],
)
def test_pictures_of_each_encoding(
    encoding: str, pixels: NDArray[Any], expected: NDArray[np.uint8], tmp_path: Path
) -> None:
    made = Bag("mcap")
    made.picture(BEGIN, pixels, encoding)
    np.testing.assert_array_equal(read_picture(Path(f"{made.write(tmp_path)}#/camera")), expected)


SMOOTH = np.stack(np.broadcast_arrays(*np.ogrid[20:140:8j, 30:200:10j], 90.0), axis=2).astype(np.uint8)
"""A picture that changes evenly, so that what lies between its pixels is known."""


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_a_bayer_mosaic_gives_the_picture_that_it_was_taken_of(pattern: str, bits: int, tmp_path: Path) -> None:
    rows, columns = np.indices(SMOOTH.shape[:2])
    channel = np.array(["rgb".index(color) for color in pattern])[2 * (rows % 2) + columns % 2]
    mosaic = np.take_along_axis(SMOOTH, channel[..., None], axis=2)[..., 0]
    made = Bag("mcap")
    made.picture(BEGIN, mosaic if bits == 8 else mosaic.astype("<u2") << 8, f"bayer_{pattern}{bits}")
    found = read_picture(Path(f"{made.write(tmp_path)}#/camera")).astype(int)
    own = np.take_along_axis(found, channel[..., None], axis=2)[..., 0]
    np.testing.assert_array_equal(own, mosaic)
    # Between whole numbers an interpolated one is off by up to one; at the border one side is missing.
    assert np.abs(found - SMOOTH)[1:-1, 1:-1].max() <= 1
    assert np.abs(found - SMOOTH).max() <= 20


@pytest.mark.parametrize(
    ("encoding", "luma", "code"),
    [("yuv422", 1, "UYVY"), ("uyvy", 1, "UYVY"), ("yuv422_yuy2", 0, "YUYV"), ("yuyv", 0, "YUYV")],
)
def test_yuv_gives_the_colors_that_opencv_finds(encoding: str, luma: int, code: str, tmp_path: Path) -> None:
    cv2 = pytest.importorskip("cv2")
    raw = np.random.default_rng(1).integers(0, 256, (6, 8, 2), dtype=np.uint8)
    raw[0, :, luma], raw[0, :, 1 - luma] = np.arange(16, 240, 28), 128
    made = Bag("mcap")
    made.picture(BEGIN, raw, encoding)
    found = read_picture(Path(f"{made.write(tmp_path)}#/camera"))
    expected = cv2.cvtColor(raw, getattr(cv2, f"COLOR_YUV2RGB_{code}")).astype(int)
    dark = raw[..., luma] < 16
    # OpenCV cuts luma off below black before it adds the chroma.
    assert np.abs(found - expected)[~dark].max() <= 2
    assert np.ptp(found[0], axis=1).max() == 0


def test_yuv_of_an_odd_width_is_refused(tmp_path: Path) -> None:
    made = Bag("mcap")
    made.picture(BEGIN, PIXELS[..., :2], "yuyv")
    with pytest.raises(FileError, match="found 7 columns of 'yuyv'; needed an even number"):
        read_picture(Path(f"{made.write(tmp_path)}#/camera"))


def test_what_is_not_there_is_named(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"#/scans: found no such topic; needed one of the bag's: /camera, /compressed"):
        read_cloud(f"{bag}#/scans")
    with pytest.raises(FileError, match=r"found sensor_msgs/msg/Image; needed PointCloud2"):
        read_cloud(f"{bag}#/camera")
    with pytest.raises(FileError, match=r"found sensor_msgs/msg/PointCloud2; needed Image or CompressedImage"):
        read_picture(Path(f"{bag}#/points"))
    with pytest.raises(FileError, match=r"found no message within a second of the time; needed a time from 0 to 0\.4"):
        read_cloud(f"{bag}#/points@20")
    with pytest.raises(FileError, match="found 'noon' after @; needed seconds"):
        read_cloud(f"{bag}#/points@noon")
    with pytest.raises(FileError, match="found no topic"):
        read_cloud(f"{bag}#/")
    with pytest.raises(FileError, match="found 2 messages selected; needed one"):
        read_picture(Path(f"{bag}#/camera@0x2"))
    with pytest.raises(FileNotFoundError):
        read_cloud(tmp_path / "none.mcap#/points")
    with pytest.raises(CloudError, match="columns: found names given"):
        read_cloud(f"{bag}#/points", columns=("x", "y", "z"))


def test_an_encoding_that_is_not_read_is_named(tmp_path: Path) -> None:
    made = Bag("ros1")
    made.picture(BEGIN, PIXELS[..., 0], "nv21")
    with pytest.raises(FileError, match=r"found the encoding 'nv21'; needed rgb8, .* or a CompressedImage"):
        read_picture(Path(f"{made.write(tmp_path)}#/camera"))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"width": 7}, "data: found 144 bytes in rows of 144; needed 1 rows of 7 points of 24 bytes"),
        ({"height": 2}, "data: found 144 bytes"),
        ({"point_step": 12}, "field intensity: found 1 values up to byte 16; needed"),
        ({"fields": []}, "columns: found none; needed x, y and z"),
    ],
)
def test_messages_that_contradict_themselves_are_refused(changed: dict[str, Any], message: str, tmp_path: Path) -> None:
    made = Bag("mcap")
    made.scan(BEGIN, points_of(0), **changed)
    with pytest.raises(CloudError, match=message):
        read_cloud(f"{made.write(tmp_path)}#/points")


FLOAT, BYTE = 7, 2


@pytest.mark.parametrize(
    ("offset", "datatype", "count", "step"),
    [
        (2**31 - 1, 6, 1, 24),
        (2**31 - 4, FLOAT, 1, 24),
        (2**32 - 1, FLOAT, 1, 24),
        (12, BYTE, 2**31 - 13, 2**31 - 1),
        (16, BYTE, 2**31 - 1, 24),
        (12, BYTE, 65537, 70_000),
        (21, FLOAT, 1, 24),
    ],
)
@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_fields_beyond_their_point_are_refused(
    kind: str, offset: int, datatype: int, count: int, step: int, tmp_path: Path
) -> None:
    made = Bag(kind)
    described = [("x", 0, FLOAT, 1), ("y", 4, FLOAT, 1), ("z", 8, FLOAT, 1), ("odd", offset, datatype, count)]
    fields = [
        made.make("sensor_msgs/msg/PointField", name=name, offset=at, datatype=of, count=many)
        for name, at, of, many in described
    ]
    made.scan(BEGIN, points_of(0), fields=fields, point_step=step)
    with pytest.raises(CloudError, match=rf"field odd: found \d+ values up to byte \d+; needed .* within {step} bytes"):
        read_cloud(f"{made.write(tmp_path)}#/points")


def test_a_field_that_ends_with_its_point_is_read(tmp_path: Path) -> None:
    made = Bag("mcap")
    made.scan(BEGIN, points_of(1), point_step=20, row_step=120)
    points = points_of(1)[:1]
    cloud = read_cloud(f"{made.write(tmp_path)}#/points")
    assert cloud.points[0].tolist() == [points[axis][0] for axis in "xyz"] and cloud.colors is not None


def test_values_that_a_small_database_computes_are_refused(tmp_path: Path) -> None:
    path = filled("sqlite file").write(tmp_path)
    database = sqlite3.connect(path)
    database.executescript(
        "ALTER TABLE messages RENAME TO held;"
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, "
        "head BLOB, data BLOB GENERATED ALWAYS AS (head || zeroblob(3000000)) VIRTUAL);"
        "INSERT INTO messages(id, topic_id, timestamp, head) SELECT id, topic_id, timestamp, data FROM held;"
        "DROP TABLE held;"
    )
    database.commit()
    database.close()
    assert path.stat().st_size < 100_000
    with pytest.raises(FileError, match=r"found damage .*too big"):
        read_cloud(f"{path}#/points@0x2")


def test_scans_of_several_frames_are_not_joined(tmp_path: Path) -> None:
    made = Bag("mcap")
    made.scan(BEGIN, points_of(0))
    made.scan(BEGIN + 1, points_of(1), frame="map")
    with pytest.raises(CloudError, match="frames: found lidar, map; needed scans in one frame"):
        read_cloud(f"{made.write(tmp_path)}#/points@0x2")


@pytest.mark.parametrize("kind", ["ros1", "mcap file"])
def test_damaged_bags_are_refused(kind: str, tmp_path: Path) -> None:
    path = filled(kind).write(tmp_path)
    content = path.read_bytes()
    for size in (0, 10, len(content) // 3, len(content) // 2):
        path.write_bytes(content[:size])
        with pytest.raises(FileError, match=r"found damage .* needed a whole bag"):
            read_cloud(f"{path}#/points")


@pytest.mark.parametrize(("kind", "packed"), PACKED)
def test_compressed_bags_are_read(kind: str, packed: str, tmp_path: Path) -> None:
    path = filled(kind, packed).write(tmp_path)
    assert read_cloud(f"{path}#/points@0x{SCANS}").points.shape == (6 * SCANS, 3)
    np.testing.assert_array_equal(read_picture(Path(f"{path}#/camera")), PIXELS)


@pytest.mark.parametrize(("kind", "packed"), PACKED)
def test_a_small_bag_that_unfolds_to_very_much_is_refused(
    kind: str, packed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("regionpose.io.reading.FREE_BYTES", 10**6)
    bag = filled(kind, packed)
    bag.picture(BEGIN, np.zeros((3000, 4000), np.uint8), "mono8", topic="/large")
    path = bag.write(tmp_path)
    with pytest.raises(FileError, match=r"found a chunk of \d+ bytes that holds more than \d+; needed"):
        read_picture(Path(f"{path}#/large"))


def test_other_readers_of_rosbags_keep_its_own_limits(tmp_path: Path) -> None:
    path = filled("ros1", "BZ2").write(tmp_path)
    read_cloud(f"{path}#/points")
    with AnyReader([path]) as reader:
        assert sum(1 for _ in reader.messages()) == SCANS + 2


def test_messages_that_a_bag_defines_otherwise_are_refused(tmp_path: Path) -> None:
    path = filled("mcap file").write(tmp_path)
    content = path.read_bytes()
    assert b"uint32 offset" in content and b"uint32 height" in content
    path.write_bytes(content.replace(b"uint32 offset", b"uint32 orfset"))
    with pytest.raises(FileError, match=r"#/points: found a message of other fields \(.*offset.*\); needed those"):
        read_cloud(f"{path}#/points")
    path.write_bytes(content.replace(b"uint32 height", b"uint32 hright"))
    with pytest.raises(FileError, match=r"#/camera: found a message of other fields \(.*height.*\); needed those"):
        read_picture(Path(f"{path}#/camera"))


def test_paths_that_name_no_bag_are_files(tmp_path: Path) -> None:
    assert bag_place("scan.ply") is None and bag_place("odd#/scan.ply") is None
    (tmp_path / "a.bag#").mkdir()
    (tmp_path / "a.bag#" / "scan.ply").write_text("")
    assert bag_place(tmp_path / "a.bag#" / "scan.ply") is None
    assert bag_place("a.mcap#/os/points@1.5x20") == BagPlace(Path("a.mcap"), "/os/points", 1_500_000_000, 20)
    assert not is_there("a.mcap#/points") and is_there(tmp_path)


def test_without_rosbags_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rosbags", None)
    for name in [name for name in sys.modules if name.startswith("rosbags.")]:
        monkeypatch.delitem(sys.modules, name)
    with pytest.raises(MissingExtraError, match=r'ROS needs the package rosbags.*"regionpose\[ros\]"'):
        read_bag_picture(BagPlace(Path("a.bag"), "/camera"))


def test_a_version_of_rosbags_whose_decompressors_are_elsewhere_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = filled("ros1").write(tmp_path)
    _install.cache_clear()
    monkeypatch.delattr("rosbags.rosbag1.reader.decompressors")
    with pytest.raises(MissingExtraError, match=r'found another version of rosbags .* needed pip install "regionpose'):
        read_cloud(f"{path}#/points")


def test_a_scene_file_names_messages(tmp_path: Path) -> None:
    made = Bag("mcap file")
    made.scan(BEGIN, points_of(0))
    scene = write_scene(tmp_path)
    pixels = read_picture(tmp_path / "image.png")
    made.picture(BEGIN, pixels, "rgb8")
    path = made.write(tmp_path)
    name = path.relative_to(tmp_path)
    values = scene_values() | {"image": f"{name}#/camera", "cloud": f"{name}#/points@0"}
    scene = write_scene(tmp_path, values)
    sides = scene_sides(load_scene(scene))
    np.testing.assert_array_equal(sides.image, pixels)
    assert sides.cloud is not None and sides.sensor_origin is not None
    assert sides.sensor_origin.place.tolist() == [0.0, 0.0, 0.0]
    held = {entry["path"]: entry for entry in input_values(load_scene(scene), scene.parent)}
    assert held[f"{name}#/points@0"]["bytes"] > 144 and len(held[f"{name}#/camera"]["sha256"]) == 64


@pytest.mark.slow
def test_commands_take_messages(tmp_path: Path) -> None:
    made, plain = filled("mcap"), np.zeros((60, 80, 3), dtype=np.uint8)
    plain[15:45, 20:60] = 200
    made.picture(BEGIN, plain, "rgb8", topic="/plain")
    path = made.write(tmp_path)

    def said(*words: str) -> dict[str, Any]:
        command = [sys.executable, "-m", "regionpose", *words, "--json"]
        ended = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
        return dict(json.loads(ended.stdout))

    cloud = said("info", f"{path}#/points@0x2")
    assert cloud["points"] == 12 and cloud["sensor_origin_m"] == [0.0, 0.0, 0.0]
    assert said("info", f"{path}#/camera") == {"kind": "image of a bag", "width_px": 7, "height_px": 5}
    assert said("segment", f"{path}#/plain", "--seed", "40,30")["pixels"] == pytest.approx(30 * 40, abs=60)
    assert rp.read_cloud(f"{path}#/points").source == path


@pytest.mark.parametrize("kind", ["ros1", "mcap", "sqlite"])
def test_scans_of_a_livox_driver_are_read(kind: str, tmp_path: Path) -> None:
    given, cloud = points_of(1), read_cloud(f"{livox_bag(tmp_path, kind=kind)}#/livox/lidar")
    np.testing.assert_array_equal(cloud.points, np.stack([given[name] for name in "xyz"], axis=1))
    assert cloud.intensity is not None and cloud.sensor_origin is not None
    np.testing.assert_array_equal(cloud.intensity, 200 - np.arange(6))
    assert sorted(cloud.fields) == ["line", "offset_time", "tag"]
    np.testing.assert_array_equal(cloud.fields["line"], np.arange(6) % 4)


def test_a_livox_scan_that_states_another_number_of_points_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CloudError, match="points: found 6; needed 2147483647, as the message states"):
        read_cloud(f"{livox_bag(tmp_path, stated=2**31 - 1)}#/livox/lidar")


@pytest.mark.parametrize("kind", ["ros1", "mcap"])
def test_the_camera_info_of_a_bag_is_a_calibration(kind: str, tmp_path: Path) -> None:
    bag = livox_bag(tmp_path, kind=kind)
    camera = load_camera(f"{bag}#/camera/camera_info")
    assert camera == PinholeCamera(
        500.0, 501.25, 320.5, 240.25, distortion=(0.1, -0.2, 1e-3, -2e-3, 0.0), width=640, height=480
    )
    with pytest.raises(FileError, match="found 2 messages selected; needed one of a camera"):
        load_camera(f"{bag}#/camera/camera_info@0x2")
    with pytest.raises(FileError, match=r"found livox_ros_driver2/msg/CustomMsg; needed CameraInfo"):
        load_camera(f"{bag}#/livox/lidar")
