"""Damaged files: each is a CloudError that names the file, the item, what was found and what is needed."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from regionpose.cameras import PinholeCamera
from regionpose.io.clouds import CloudError, cloud_from_depth, read_cloud

PLY = b"ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
PLY_POINTS = struct.pack("<6f", 1, 2, 3, 4, 5, 6)
GOOD_PLY = PLY + b"end_header\n" + PLY_POINTS
FACES = PLY + b"element face 1\nproperty list uchar int vertex_indices\nend_header\n" + PLY_POINTS
TEXT_PLY = PLY.replace(b"binary_little_endian", b"ascii") + b"end_header\n"
TEXT_FACES = FACES[: -len(PLY_POINTS)].replace(b"binary_little_endian", b"ascii") + b"1 2 3\n4 5 6\n"

PCD = b"VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n"
GOOD_PCD = PCD + b"DATA binary\n" + PLY_POINTS
TEXT_PCD = PCD + b"DATA ascii\n"
PACKED = PCD + b"DATA binary_compressed\n"
LITERAL = b"\x17" + PLY_POINTS

GARBAGE = np.random.default_rng(5).integers(0, 256, 4096, dtype=np.uint8).tobytes()


def npy(array: Any) -> bytes:
    """The array as a file."""
    buffer = io.BytesIO()
    np.save(buffer, array)
    return buffer.getvalue()


def npz(**arrays: Any) -> bytes:
    """The arrays as an archive."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


NAN_POINTS = np.full((3, 3), np.nan)

DAMAGED: list[tuple[str, bytes, str]] = [
    ("empty.ply", b"", "file: found 0 bytes"),
    ("empty.bin", b"", "file: found 0 bytes"),
    # PLY
    ("kind.ply", GARBAGE, "first line"),
    ("no_end.ply", PLY, "header: found no end"),
    ("no_format.ply", GOOD_PLY.replace(b"format binary_little_endian 1.0\n", b""), "header: found format ''"),
    ("format.ply", GOOD_PLY.replace(b"binary_little", b"binary_middle"), "header: found 'format binary_middle"),
    ("no_vertex.ply", GOOD_PLY.replace(b"vertex", b"vertices"), "element vertex"),
    ("count.ply", GOOD_PLY.replace(b"vertex 2", b"vertex -2"), "header: found 'element vertex -2'"),
    ("twice.ply", GOOD_PLY.replace(b"property float y", b"property float x"), "property: found x twice"),
    ("type.ply", GOOD_PLY.replace(b"float z", b"quad z"), "property: found 'quad z'"),
    ("no_z.ply", GOOD_PLY.replace(b"float z", b"float w"), "columns: found x, y, w; needed .*missing: z"),
    ("short.ply", GOOD_PLY[:-1], "element vertex: found 23 bytes; needed 24"),
    ("huge.ply", GOOD_PLY.replace(b"vertex 2", b"vertex 999999999999999"), "element vertex: found 24 bytes"),
    ("none.ply", GOOD_PLY.replace(b"vertex 2", b"vertex 0")[:-24], "columns: found none"),
    ("more.ply", GOOD_PLY + b"\x01\x02", "end of file: found 2 bytes"),
    ("nan.ply", PLY + b"end_header\n" + struct.pack("<6f", *[float("nan")] * 6), "2 points, none with finite"),
    ("no_face.ply", FACES, "element face: found 0 bytes"),
    ("short_face.ply", FACES + b"\x03" + bytes(11), "element face"),
    ("corner.ply", FACES + struct.pack("<B3i", 3, 0, 1, 2), "triangles: found .* needed indices from 0 to 1"),
    ("float_corner.ply", FACES.replace(b"uchar int", b"uchar float") + struct.pack("<B3f", 3, 0, 1, 1), "element face"),
    ("float_count.ply", FACES.replace(b"uchar int", b"float int"), "property: found 'list float int"),
    ("text_word.ply", TEXT_PLY + b"1 2 3\n4 five 6\n", "data: found 'five'"),
    ("text_short.ply", TEXT_PLY + b"1 2 3\n4 5\n", "element vertex: found 5 numbers; needed 6"),
    ("text_none.ply", TEXT_PLY + b"\n \n", "element vertex: found 0 numbers"),
    ("text_more.ply", TEXT_PLY + b"1 2 3\n4 5 6\n7 8 9\n", "end of file: found 3 numbers"),
    ("text_corner.ply", TEXT_FACES + b"3 0 1 0.5\n", "property vertex_indices: found 0.5"),
    ("text_count.ply", TEXT_FACES + b"2.5 0 1 1\n", "list vertex_indices: found a count of 2.5"),
    ("text_negative.ply", TEXT_FACES + b"-3 0 1 1\n", "list vertex_indices: found a count of -3"),
    # PCD
    ("kind.pcd", GARBAGE, "header: found"),
    ("no_data.pcd", PCD, "needed a PCD header that ends with a DATA line"),
    ("storage.pcd", PCD + b"DATA zipped\n", "DATA: found zipped"),
    ("sizes.pcd", GOOD_PCD.replace(b"SIZE 4 4 4", b"SIZE 4 4"), "3 names, 2 sizes"),
    ("size_word.pcd", GOOD_PCD.replace(b"SIZE 4 4 4", b"SIZE 4 4 four"), "SIZE: found 4 4 four"),
    ("type.pcd", GOOD_PCD.replace(b"TYPE F F F", b"TYPE F F Q"), "field z: found TYPE Q"),
    ("viewpoint.pcd", GOOD_PCD.replace(b"WIDTH 2", b"VIEWPOINT 0 0 0\nWIDTH 2"), "VIEWPOINT: found 0 0 0; needed 7"),
    (
        "viewpoint_word.pcd",
        GOOD_PCD.replace(b"WIDTH 2", b"VIEWPOINT 0 0 0 1 0 0 x\nWIDTH 2"),
        "VIEWPOINT: found 0 0 0 1",
    ),
    ("viewpoint_nan.pcd", GOOD_PCD.replace(b"WIDTH 2", b"VIEWPOINT 0 0 nan 1 0 0 0\nWIDTH 2"), "needed 7 finite"),
    ("no_z.pcd", GOOD_PCD.replace(b"x y z", b"x y w"), "missing: z"),
    ("twice.pcd", GOOD_PCD.replace(b"x y z", b"x y y"), "FIELDS: found y twice"),
    ("area.pcd", GOOD_PCD.replace(b"WIDTH 2", b"WIDTH 3"), "POINTS: found 2; needed 3"),
    ("no_count.pcd", GOOD_PCD.replace(b"WIDTH 2\nHEIGHT 1\nPOINTS 2\n", b""), "POINTS: found None"),
    ("none.pcd", GOOD_PCD.replace(b"WIDTH 2", b"WIDTH 0").replace(b"POINTS 2", b"POINTS 0")[:-24], "points: found no"),
    ("short.pcd", GOOD_PCD[:-3], "points: found 21 bytes; needed 24"),
    (
        "huge.pcd",
        GOOD_PCD.replace(b"POINTS 2", b"POINTS 77777777777").replace(b"WIDTH 2", b"WIDTH 77777777777"),
        "needed 9",
    ),
    ("more.pcd", GOOD_PCD + b"\x01", "points: found 25 bytes; needed 24"),
    ("text_short.pcd", TEXT_PCD + b"1 2 3\n", "points: found 1 lines; needed 2"),
    ("text_narrow.pcd", TEXT_PCD + b"1 2 3\n4 5\n", "line 11: found 2 numbers after rows of 3"),
    ("text_word.pcd", TEXT_PCD + b"1 2 3\n4 five 6\n", "line 11: found 'five'"),
    ("text_none.pcd", TEXT_PCD, "points: found 0 lines"),
    ("no_sizes.pcd", PACKED + b"\x01", "compressed data: found 1 bytes"),
    (
        "packed_short.pcd",
        PACKED + struct.pack("<II", 25, 24) + LITERAL[:-2],
        "compressed data: found 23 bytes; needed 25",
    ),
    ("plain.pcd", PACKED + struct.pack("<II", 25, 23) + LITERAL, "plain size: found 23 bytes; needed 24"),
    (
        "lzf.pcd",
        PACKED + struct.pack("<II", 4, 24) + b"\xff\xff\xff\xff",
        "compressed data: found .*needed a whole LZF",
    ),
    ("lzf_less.pcd", PACKED + struct.pack("<II", 24, 24) + b"\x16" + LITERAL[1:-1], "needed a whole LZF"),
    ("lzf_none.pcd", PACKED + struct.pack("<II", 0, 24), "compressed data: found 0 bytes; needed 1"),
    # Arrays
    ("kind.npy", GARBAGE, "array: found"),
    ("short.npy", npy(np.ones((9, 3)))[:-5], "array: found"),
    ("header.npy", npy(np.ones((9, 3)))[:40], "array: found"),
    ("flat.npy", npy(np.ones(9)), r"table: found float64 of shape \(9,\)"),
    ("narrow.npy", npy(np.ones((9, 2))), "table: found"),
    ("words.npy", npy(np.array([["a", "b", "c"]])), "table: found"),
    ("nan.npy", npy(NAN_POINTS), "3 points, none with finite"),
    ("none.npy", npy(np.ones((0, 3))), "points: found no points"),
    ("hollow.npy", npy(np.ones((2, 3))).replace(b"'<f8'", b"'0f8'"), r"shape \(2, 3, 0\)"),
    ("objects.npy", npy(np.array([None, 1], dtype=object)), "array: found"),
    ("short.npz", npz(points=np.ones((9, 3)))[:-30], "archive: found"),
    ("crc.npz", npz(points=np.ones((9, 3))).replace(b"\x93", b"\x94"), "archive: found|table: found"),
    ("objects.npz", npz(points=np.array([None])), "points.npy: found object values"),
    ("columns.npz", npz(a=np.ones(3), b=np.ones(3)), "missing: x, y, z"),
    ("points.npz", npz(points=np.ones((3, 4)), b=np.ones(3)), "points: found"),
    ("colors.npz", npz(points=np.ones((3, 3)), colors=np.ones((2, 3))), "colors: found"),
    ("intensity.npz", npz(points=np.ones((3, 3)), intensity=np.ones(2)), "intensity: found"),
    ("origin.npz", npz(points=np.ones((3, 3)), origin=np.ones(2)), "origin: found"),
    ("words.npz", npz(points=np.ones((3, 3)), origin=np.array(["a", "b", "c"])), "origin: found <U1 of shape"),
    (
        "lengths.npz",
        npz(x=np.ones(3), y=np.ones(4), z=np.ones(3)),
        r"y: found shape \(4,\); needed columns \(n,\) of one",
    ),
    ("rows.npz", npz(x=np.ones((3, 1)), y=np.ones(3), z=np.ones(3)), r"x: found shape \(3, 1\)"),
    ("wide.npy", npy(np.zeros(4, [("x", "f4", 3), ("y", "f4"), ("z", "f4")])), r"y: found shape \(4,\)"),
    ("zip.npz", b"PK\x03\x04" + GARBAGE, "archive: found"),
    ("garbage.bin", GARBAGE, "columns: found 1024 numbers, in which no rows of 3 to 7 stand out"),
    ("garbage.pcd.bin", GARBAGE[:4000], "coordinates: found|none with finite"),
    ("size.bin", bytes(30), "size: found 30 bytes; needed a multiple of 4"),
    ("few.bin", bytes(32), "columns: found 8 numbers, .* rows of 4, 8 would fit; needed the names of the columns"),
    ("size.pcd.bin", bytes(32), "size: found 32 bytes; needed a multiple of 20"),
    # Text
    ("garbage.xyz", GARBAGE, "line 1: found"),
    ("blank.xyz", b"\n\n", "points: found no line of numbers"),
    ("comments.txt", b"# x y z\n", "points: found no line of numbers"),
    ("narrow.xyz", b"1 2\n3 4\n", "line 1: found '1 2'"),
    ("ragged.xyz", b"1 2 3\n4 5 6 7\n", "line 2: found 4 numbers after rows of 3"),
    ("word.csv", b"1,2,3\n4,five,6\n", "line 2: found 'five'"),
    ("gap.csv", b"1,2,3\n4,,6\n", "line 2: found an empty column; needed"),
    ("stated.pts", b"3\n1 2 3\n4 5 6\n", "rows: found 2; needed 3"),
    ("nan.xyz", b"nan 2 3\n4 inf 6\n", "2 points, none with finite"),
    # Other kinds
    ("a.jpeg", GARBAGE, "kind: found ending '.jpeg'"),
    ("noending", GARBAGE, "kind: found ending ''"),
]


@pytest.mark.parametrize(("name", "content", "message"), DAMAGED, ids=[name for name, _, _ in DAMAGED])
def test_damage_is_named(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CloudError, match=message) as caught:
        read_cloud(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert ": found " in text
    assert "; needed " in text
    assert len(text) < 800


def las(compressed: bool) -> bytes:
    """A file of 100 points."""
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    stored = laspy.LasData(laspy.LasHeader(point_format=3))
    stored.x = stored.y = stored.z = np.arange(100.0)
    buffer = io.BytesIO()
    stored.write(buffer, do_compress=compressed)
    return buffer.getvalue()


def e57(tmp_path: Path) -> bytes:
    """A file of 100 points."""
    pye57 = pytest.importorskip("pye57")
    image = pye57.E57(str(tmp_path / "whole.e57"), mode="w")
    image.write_scan_raw({f"cartesian{axis}": np.arange(100.0) for axis in "XYZ"})
    image.close()
    return (tmp_path / "whole.e57").read_bytes()


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kept", [20, 110, 300, 0.5, 0.97])
def test_cut_las(tmp_path: Path, compressed: bool, kept: float) -> None:
    whole = las(compressed)
    path = tmp_path / "cut.las"
    path.write_bytes(whole[: int(kept if kept > 1 else kept * len(whole))])
    with pytest.raises(CloudError, match=r"cut\.las: [a-z ]+: found .*; needed"):
        read_cloud(path)


def test_las_sizes_that_no_file_of_its_length_can_hold(tmp_path: Path) -> None:
    path = tmp_path / "sizes.las"
    huge = struct.pack("<I", 2**32 - 1)
    plain, packed = las(False), las(True)
    points_at = struct.unpack_from("<I", packed, 96)[0]
    table_at = struct.unpack_from("<q", packed, points_at)[0]
    for whole, place, item in (
        (plain, 100, "size"),
        (plain, 107, "size"),
        (packed, table_at + 4, "chunk table"),
        (packed, points_at, "chunk table"),
    ):
        path.write_bytes(whole[:place] + huge + whole[place + 4 :])
        with pytest.raises(CloudError, match=rf"sizes\.las: {item}: found .*; needed"):
            read_cloud(path)


def test_a_panic_of_the_laz_decoder_is_a_cloud_error(tmp_path: Path) -> None:
    packed = bytearray(las(True))
    # The list of compressed items begins 32 bytes into the content of the only record, which follows the header of 227.
    packed[227 + 54 + 32 : 227 + 54 + 34] = bytes(2)
    (tmp_path / "items.laz").write_bytes(packed)
    with pytest.raises(CloudError, match=r"items\.laz: points: found .*; needed"):
        read_cloud(tmp_path / "items.laz")


def test_las_without_points(tmp_path: Path) -> None:
    laspy = pytest.importorskip("laspy")
    laspy.LasData(laspy.LasHeader(point_format=3)).write(str(tmp_path / "none.las"))
    with pytest.raises(CloudError, match="points: found"):
        read_cloud(tmp_path / "none.las")


@pytest.mark.parametrize("kept", [30, 0.3, 0.9])
def test_cut_e57_is_named_and_left_in_place(tmp_path: Path, kept: float) -> None:
    whole = e57(tmp_path)
    path = tmp_path / "cut.e57"
    path.write_bytes(whole[: int(kept if kept > 1 else kept * len(whole))])
    with pytest.raises(CloudError, match=r"cut\.e57: scans: found .*; needed a whole E57"):
        read_cloud(path)
    assert path.exists()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("garbage.stl", GARBAGE),
        ("cut.stl", bytes(80) + struct.pack("<I", 10) + bytes(120)),
        ("garbage.glb", b"glTF" + GARBAGE),
        ("cut.glb", b"glTF" + struct.pack("<II", 2, 1000)),
        ("garbage.obj", GARBAGE),
        ("empty.obj", b"# nothing\n"),
        ("corner.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
    ],
)
def test_damaged_meshes(tmp_path: Path, name: str, content: bytes) -> None:
    pytest.importorskip("trimesh")
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CloudError, match=r": found .*; needed"):
        read_cloud(path)


CAMERA = PinholeCamera(10.0, 10.0, 1.0, 1.0)


@pytest.mark.parametrize(
    ("depth", "options", "message"),
    [
        (np.ones(4), {}, r"depth: found float64 of shape \(4,\)"),
        (np.ones((2, 2, 3)), {}, "depth: found"),
        (np.ones((2, 2), dtype=np.uint16), {}, "unit_m: found none"),
        (np.ones((2, 2)), {"unit_m": -1.0}, "unit_m: found -1.0"),
        (np.ones((2, 2)), {"colors": np.zeros((2, 3, 3))}, "colors: found"),
        (np.zeros((2, 2)), {}, "4 points, none with finite"),
        (np.ones((2, 2)), {"distance": "depth"}, "distance: found 'depth'"),
    ],
)
def test_depths_that_cannot_be_used(depth: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        cloud_from_depth(CAMERA, depth, **options)


def test_depth_of_another_size_than_the_camera() -> None:
    with pytest.raises(CloudError, match="2 x 2 pixels; needed the camera's 4 x 3"):
        cloud_from_depth(PinholeCamera(10.0, 10.0, 1.0, 1.0, width=4, height=3), np.ones((2, 2)))


def test_damaged_depth_images(tmp_path: Path) -> None:
    path = tmp_path / "depth.png"
    Image.fromarray(np.ones((30, 30), dtype=np.uint16)).save(path)
    whole = path.read_bytes()
    for content in (whole[:40], b"", GARBAGE, zlib.compress(whole)):
        path.write_bytes(content)
        with pytest.raises(CloudError, match=r"depth\.png: found no picture"):
            cloud_from_depth(CAMERA, path, unit_m=1e-3)
    Image.fromarray(np.ones((3, 3, 3), dtype=np.uint8)).save(path)
    with pytest.raises(CloudError, match="mode RGB"):
        cloud_from_depth(CAMERA, path, unit_m=1e-3)


def test_missing_files(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_cloud(tmp_path / "none.ply")
    with pytest.raises(FileNotFoundError):
        cloud_from_depth(CAMERA, tmp_path / "none.png", unit_m=1.0)
    with pytest.raises(CloudError, match="path: found a directory"):
        read_cloud(tmp_path)


@pytest.mark.parametrize(
    ("name", "content", "columns", "message"),
    [
        ("a.xyz", b"1 2 3 4\n", ("x", "y", "z"), r"columns: found 3 names \(x, y, z\); needed 4"),
        ("a.xyz", b"1 2 3\n", ("x", "y", "w"), "columns: found .*; needed different names"),
        ("a.xyz", b"1 2 3 4\n", ("x", "y", "z", "X"), "columns: found .*; needed different names"),
        ("a.bin", bytes(16), "xyz", "columns: found"),
        ("a.bin", bytes(48), ("x", "y", "z", "_", "t"), "size: found 48 bytes; needed a multiple of 20"),
        ("a.ply", GOOD_PLY, ("x", "y", "z"), "columns: found names given"),
        ("a.npz", npz(points=np.ones((3, 3)), b=np.ones(3)), ("x", "y", "z"), "columns: found names given"),
    ],
)
def test_columns_that_do_not_fit(tmp_path: Path, name: str, content: bytes, columns: Any, message: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CloudError, match=message):
        read_cloud(path, columns=columns)


WHOLE = {
    "a.ply": FACES + struct.pack("<B3i", 3, 0, 1, 1),
    "b.ply": TEXT_FACES + b"3 0 1 1\n",
    "a.pcd": GOOD_PCD,
    "b.pcd": TEXT_PCD + b"1 2 3\n4 5 6\n",
    "c.pcd": PACKED + struct.pack("<II", 25, 24) + LITERAL,
    "a.npy": npy(np.ones((4, 3))),
    "a.npz": npz(points=np.ones((4, 3)), intensity=np.ones(4)),
    "a.csv": b"x,y,z\n1,2,3\n4,5,6\n",
}


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(data=st.data())
def test_any_few_bytes_changed_give_a_cloud_or_a_cloud_error(tmp_path: Path, data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(sorted(WHOLE)))
    content = bytearray(WHOLE[name])
    for _ in range(data.draw(st.integers(1, 3))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path / name
    path.write_bytes(content[: data.draw(st.integers(1, len(content)))])
    try:
        assert np.isfinite(read_cloud(path).points).all()
    except CloudError as error:
        assert str(error).startswith(f"{path}: ")
