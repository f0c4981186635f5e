"""Clouds in and out: every format against files written by hand or by another package."""

from __future__ import annotations

import io
import struct
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from PIL import Image

from regionpose.cameras import FisheyeCamera, PinholeCamera
from regionpose.clouds import Cloud, CloudError, MissingExtraError, cloud_from_depth, read_cloud, write_ply
from regionpose.clouds.lzf import decompress, decompress_in_python

POINTS = np.array([[1.0, 2.0, 3.0], [-4.5, 0.25, 8.0], [0.0, 0.125, -7.5], [100.5, 200.25, -3.75]])
COLOURS = np.array([[255, 0, 7], [1, 2, 3], [0, 0, 0], [10, 128, 254]], dtype=np.uint8)
INTENSITY = np.array([0.0, 0.5, 1.0, 0.25])
TRIANGLES = np.array([[0, 1, 2], [2, 1, 3]])

UTM = np.array([449_123.456, 5_411_987.123456, 117.25])
"""A place on the map: easting, northing and height in metres."""


def full_cloud() -> Cloud:
    """A cloud at map coordinates with everything a cloud can hold."""
    fields = {"gps time": np.array([1e9 + 0.125, 2.0, 3.0, 4.0]), "ring": np.array([1, 2, 3, 65535], dtype=np.uint16)}
    return Cloud.from_world_points(
        POINTS + UTM, colours=COLOURS, intensity=INTENSITY, fields=fields, triangles=TRIANGLES
    )


def assert_same(cloud: Cloud, points: Any = POINTS, colours: Any = None, intensity: Any = None) -> None:
    """The cloud holds exactly these points, colours and intensities."""
    np.testing.assert_array_equal(cloud.world_points, points)
    for found, needed in ((cloud.colours, colours), (cloud.intensity, intensity)):
        if needed is None:
            assert found is None
        else:
            np.testing.assert_array_equal(found, needed)


def written(path: Path, content: bytes | str) -> Path:
    """`path`, with `content` in it."""
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# The cloud


def test_small_coordinates_have_no_origin() -> None:
    cloud = Cloud.from_world_points(POINTS)
    assert not cloud.origin.any()
    assert len(cloud) == 4
    assert_same(cloud)


def test_map_coordinates_have_an_origin_on_the_large_axes_and_lose_nothing() -> None:
    cloud = Cloud.from_world_points(POINTS + UTM)
    np.testing.assert_array_equal(cloud.origin, [449_100.0, 5_412_000.0, 0.0])
    assert np.abs(cloud.points).max() < 300.0
    assert_same(cloud, POINTS + UTM)


def test_one_stray_point_does_not_move_the_origin() -> None:
    stray = np.vstack([np.tile(POINTS, (3, 1)), [[1e9, -1e9, 1e9]]])
    assert not Cloud.from_world_points(stray).origin.any()


def test_points_that_are_not_finite_are_dropped_with_their_colours_and_triangles() -> None:
    points = POINTS.copy()
    points[1, 2] = np.nan
    triangles = [[0, 2, 3], [0, 1, 2]]
    cloud = Cloud.from_world_points(
        points, colours=COLOURS, intensity=INTENSITY, fields={"a": np.arange(4)}, triangles=triangles
    )
    kept = [0, 2, 3]
    assert cloud.dropped == 1
    assert_same(cloud, POINTS[kept], COLOURS[kept], INTENSITY[kept])
    np.testing.assert_array_equal(cloud.fields["a"], kept)
    np.testing.assert_array_equal(cloud.triangles, [[0, 1, 2]])


def test_arrays_are_read_only_and_the_givers_own_array_is_not() -> None:
    mine = POINTS.copy()
    cloud = Cloud(mine)
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 1.0
    mine[0, 0] = 5.0


@pytest.mark.parametrize(
    ("given_colours", "needed"),
    [
        (COLOURS.astype(np.uint16) * 257, COLOURS),
        (COLOURS.astype(np.int64), COLOURS),
        (COLOURS / 255.0, COLOURS),
        (COLOURS.astype(np.float32), COLOURS),
    ],
)
def test_colours_of_16_bits_and_fractions_are_brought_to_8_bits(given_colours: Any, needed: Any) -> None:
    assert_same(Cloud.from_world_points(POINTS, colours=given_colours), POINTS, needed)


@pytest.mark.parametrize(
    ("parts", "item"),
    [
        ({"points": np.zeros((0, 3))}, "points"),
        ({"points": np.zeros((4, 2))}, "points"),
        ({"points": [["a", "b", "c"]]}, "points"),
        ({"points": [[0.0, np.inf, 0.0]]}, "points"),
        ({"colours": COLOURS[:3]}, "colours"),
        ({"colours": COLOURS.astype(float)}, "colours"),
        ({"intensity": np.zeros(3)}, "intensity"),
        ({"fields": {"label": ["a", "b", "c", "d"]}}, "field label"),
        ({"triangles": [[0, 1, 4]]}, "triangles"),
        ({"triangles": [[0.0, 1.0, 2.0]]}, "triangles"),
        ({"origin": [np.nan, 0.0, 0.0]}, "origin"),
    ],
)
def test_parts_that_disagree_are_named(parts: dict[str, Any], item: str) -> None:
    with pytest.raises(CloudError, match=f"{item}: found .*; needed"):
        Cloud(**({"points": POINTS} | parts))


@pytest.mark.parametrize(
    ("parts", "item"),
    [
        ({"colours": COLOURS[:2]}, "colours"),
        ({"colours": -COLOURS.astype(int)}, "colours"),
        ({"colours": np.full((4, 3), 70_000)}, "colours"),
        ({"intensity": [1.0]}, "intensity"),
        ({"triangles": [[0, 1, 9]]}, "triangles"),
    ],
)
def test_parts_of_world_points_that_disagree_are_named(parts: dict[str, Any], item: str) -> None:
    with pytest.raises(CloudError, match=f"{item}: found .*; needed"):
        Cloud.from_world_points(POINTS, **parts)


# PLY


def test_a_written_ply_comes_back_whole(tmp_path: Path) -> None:
    cloud = full_cloud()
    path = write_ply(tmp_path / "cloud.ply", cloud)
    back = read_cloud(path)
    assert_same(back, POINTS + UTM, COLOURS, INTENSITY)
    assert back.source == path
    np.testing.assert_array_equal(back.triangles, TRIANGLES)
    np.testing.assert_array_equal(back.origin, cloud.origin)
    np.testing.assert_array_equal(back.fields["gps_time"], cloud.fields["gps time"])
    np.testing.assert_array_equal(back.fields["ring"], cloud.fields["ring"])


FINITE = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(points=hnp.arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=FINITE))
def test_any_cloud_survives_writing_to_the_last_bit(tmp_path: Path, points: Any) -> None:
    cloud = Cloud.from_world_points(points, fields={"value": points[:, 0]})
    back = read_cloud(write_ply(tmp_path / "any.ply", cloud, overwrite=True))
    np.testing.assert_array_equal(back.world_points, cloud.world_points)
    np.testing.assert_array_equal(back.fields["value"], points[:, 0])


def test_a_written_ply_is_read_by_trimesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(write_ply(tmp_path / "mesh.ply", full_cloud()), process=False)
    np.testing.assert_array_equal(mesh.vertices, POINTS + UTM)
    np.testing.assert_array_equal(mesh.faces, TRIANGLES)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], COLOURS)


def test_a_written_ply_is_read_by_plyfile(tmp_path: Path) -> None:
    plyfile = pytest.importorskip("plyfile")
    vertex = plyfile.PlyData.read(write_ply(tmp_path / "cloud.ply", full_cloud()))["vertex"]
    np.testing.assert_array_equal(np.stack([vertex["x"], vertex["y"], vertex["z"]], axis=1), POINTS + UTM)
    assert vertex["x"].dtype == np.float64
    np.testing.assert_array_equal(vertex["gps_time"], full_cloud().fields["gps time"])
    np.testing.assert_array_equal(vertex["red"], COLOURS[:, 0])


PLY_HEAD = """ply
format {form} 1.0
comment made by hand
obj_info nothing
element camera 1
property float view
property list uchar short sizes
element vertex 4
property double x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property float scalar_Intensity
element face 3
property list uchar int vertex_index
property uchar flag
end_header
"""

POLYGONS = [[0, 1, 2], [0, 1, 3, 2], [1, 2, 3]]
CUT = [[0, 1, 2], [0, 1, 3], [0, 3, 2], [1, 2, 3]]


def binary_ply(order: str, form: str) -> bytes:
    """A PLY with an element before the vertices and polygons after them."""
    body = struct.pack(f"{order}fB2h", 1.5, 2, 640, 480)
    for point, colour, strength in zip(POINTS, COLOURS, INTENSITY, strict=True):
        body += struct.pack(f"{order}dff3Bf", *point, *(int(c) for c in colour), strength)
    for polygon in POLYGONS:
        body += struct.pack(f"{order}B{len(polygon)}iB", len(polygon), *polygon, 9)
    return PLY_HEAD.format(form=form).encode() + body


def ascii_ply() -> bytes:
    """The same in ASCII."""
    lines = ["1.5 2 640 480"]
    for point, colour, strength in zip(POINTS, COLOURS, INTENSITY, strict=True):
        lines.append(" ".join(str(value) for value in (*point, *colour, strength)))
    lines += [f"{len(polygon)} {' '.join(map(str, polygon))} 9" for polygon in POLYGONS]
    return (PLY_HEAD.format(form="ascii") + "\n".join(lines) + "\n").encode()


@pytest.mark.parametrize(
    "content",
    [
        binary_ply("<", "binary_little_endian"),
        binary_ply(">", "binary_big_endian"),
        ascii_ply(),
        ascii_ply().replace(b"\n", b"\r\n"),
        binary_ply("<", "binary_little_endian") + b"\n",
    ],
)
def test_ply_by_hand(tmp_path: Path, content: bytes) -> None:
    cloud = read_cloud(written(tmp_path / "hand.ply", content))
    assert_same(cloud, POINTS, COLOURS, INTENSITY)
    np.testing.assert_array_equal(cloud.triangles, CUT)


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_ply_of_trimesh(tmp_path: Path, form: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, vertex_colors=COLOURS, process=False)
    content = mesh.export(file_type="ply", encoding=form)
    cloud = read_cloud(written(tmp_path / "mesh.ply", content))
    assert_same(cloud, POINTS, COLOURS)
    np.testing.assert_array_equal(cloud.triangles, TRIANGLES)


@pytest.mark.parametrize(("text", "order"), [(True, "="), (False, "<"), (False, ">")])
def test_ply_of_plyfile(tmp_path: Path, text: bool, order: str) -> None:
    plyfile = pytest.importorskip("plyfile")
    rows = np.zeros(4, dtype=[("x", "f8"), ("y", "f8"), ("z", "f8"), ("label", "i4")])
    rows["x"], rows["y"], rows["z"] = (POINTS + UTM).T
    rows["label"] = [-1, 5, 70_000, 0]
    element = plyfile.PlyElement.describe(rows, "vertex")
    plyfile.PlyData([element], text=text, byte_order=order).write(tmp_path / "cloud.ply")
    cloud = read_cloud(tmp_path / "cloud.ply")
    # plyfile writes 18 digits of a double in ASCII.
    np.testing.assert_array_equal(cloud.world_points, POINTS + UTM)
    np.testing.assert_array_equal(cloud.fields["label"], rows["label"])


# PCD


def pcd_head(form: str, extra: str = "", width: int = 4, height: int = 1) -> str:
    """The header of a PCD with x, y, z, rgb, padding and intensity."""
    return (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS x y z rgb _ intensity\n"
        f"SIZE 4 4 4 4 1 8\nTYPE F F F F U F\nCOUNT 1 1 1 1 3 1\nWIDTH {width}\nHEIGHT {height}\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {width * height}\n{extra}DATA {form}\n"
    )


PCD_ROW = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("_", "u1", 3), ("intensity", "<f8")])


def pcd_rows() -> Any:
    """The rows of the PCD."""
    rows = np.zeros(4, dtype=PCD_ROW)
    rows["x"], rows["y"], rows["z"] = POINTS.T
    red, green, blue = COLOURS.astype(np.uint32).T
    rows["rgb"] = red << 16 | green << 8 | blue
    rows["intensity"] = INTENSITY
    return rows


def literal_lzf(plain: bytes) -> bytes:
    """`plain` as LZF that compresses nothing: runs of up to 32 bytes."""
    runs = [plain[start : start + 32] for start in range(0, len(plain), 32)]
    return b"".join(bytes([len(run) - 1]) + run for run in runs)


def compressed_pcd(rows: Any) -> bytes:
    """A compressed PCD of the rows: column after column."""
    plain = b"".join(np.ascontiguousarray(rows[name]).tobytes() for name in PCD_ROW.names or ())
    packed = literal_lzf(plain)
    return pcd_head("binary_compressed").encode() + struct.pack("<II", len(packed), len(plain)) + packed


def ascii_pcd() -> str:
    """An ASCII PCD, its packed colours written as the floats that they claim to be."""
    lines = [
        f"{row['x']} {row['y']} {row['z']} {row['rgb'].view(np.float32):.9g} 0 0 0 {row['intensity']}"
        for row in pcd_rows()
    ]
    return pcd_head("ascii") + "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    "content",
    [
        pcd_head("binary").encode() + pcd_rows().tobytes(),
        compressed_pcd(pcd_rows()),
        ascii_pcd().encode(),
        ascii_pcd().replace("\n", "\r\n").encode(),
        pcd_head("binary").replace("\nPOINTS 4", "").encode() + pcd_rows().tobytes() + bytes(7),
    ],
)
def test_pcd_by_hand(tmp_path: Path, content: bytes) -> None:
    cloud = read_cloud(written(tmp_path / "hand.pcd", content))
    assert_same(cloud, POINTS, COLOURS, INTENSITY)
    assert not cloud.fields


def test_organized_pcd_drops_its_holes(tmp_path: Path) -> None:
    rows = pcd_rows()
    rows["x"][2] = np.nan
    cloud = read_cloud(written(tmp_path / "a.pcd", pcd_head("binary", width=2, height=2).encode() + rows.tobytes()))
    assert cloud.dropped == 1
    assert_same(cloud, POINTS[[0, 1, 3]], COLOURS[[0, 1, 3]], INTENSITY[[0, 1, 3]])


@pytest.mark.parametrize("encoding", ["ASCII", "BINARY", "BINARY_COMPRESSED"])
def test_pcd_of_pypcd4(tmp_path: Path, encoding: str) -> None:
    pypcd4 = pytest.importorskip("pypcd4")
    points = np.column_stack([np.tile(POINTS, (50, 1)), np.arange(200) % 7])
    stored = pypcd4.PointCloud.from_points(
        points.astype(np.float32), ("x", "y", "z", "label"), (np.float32, np.float32, np.float32, np.float32)
    )
    stored.save(tmp_path / "a.pcd", encoding=pypcd4.Encoding[encoding])
    cloud = read_cloud(tmp_path / "a.pcd")
    assert_same(cloud, points[:, :3])
    np.testing.assert_array_equal(cloud.fields["label"], points[:, 3])


def test_lzf_repeats_what_it_refers_to() -> None:
    # Three literals, 9 bytes from 3 back, 300 bytes from 1 back through the long form, in overlapping copies.
    packed = b"\x02abc" + bytes([7 << 5, 0, 2]) + bytes([7 << 5, 255, 0]) + b"\x00z"
    plain = b"abc" + b"abcabcabc" + b"c" * 264 + b"z"
    assert decompress_in_python(packed, len(plain)) == plain
    assert decompress(packed, len(plain)) == plain


@given(st.binary(min_size=1, max_size=400), st.integers(1, 40))
def test_lzf_in_python_equals_the_c_module(block: bytes, repeats: int) -> None:
    lzf = pytest.importorskip("lzf")
    plain = block * repeats
    packed = lzf.compress(plain, 2 * len(plain) + 64)
    assert decompress_in_python(packed, len(plain)) == plain
    assert decompress_in_python(literal_lzf(plain), len(plain)) == plain


@given(st.binary(max_size=60), st.integers(0, 100))
def test_damaged_lzf_is_a_value_error_or_as_long_as_stated(packed: bytes, size: int) -> None:
    try:
        assert len(decompress_in_python(packed, size)) == size
    except ValueError as error:
        assert str(error)


# LAS, LAZ, E57


@pytest.mark.parametrize(("ending", "factor"), [(".las", 257), (".laz", 257), (".las", 1)])
def test_las_of_laspy(tmp_path: Path, ending: str, factor: int) -> None:
    laspy = pytest.importorskip("laspy")
    if ending == ".laz":
        pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-4), UTM
    stored = laspy.LasData(header)
    stored.x, stored.y, stored.z = (POINTS + UTM).T
    stored.red, stored.green, stored.blue = COLOURS.T.astype(np.uint16) * factor
    stored.intensity = np.array([0, 1, 40_000, 65_535])
    stored.classification = np.array([1, 2, 6, 9])
    stored.write(str(tmp_path / f"a{ending}"))
    cloud = read_cloud(tmp_path / f"a{ending}")
    np.testing.assert_allclose(cloud.world_points, POINTS + UTM, rtol=0, atol=0.5e-4 + 1e-9)
    np.testing.assert_array_equal(cloud.origin, [449_100.0, 5_412_000.0, 0.0])
    np.testing.assert_array_equal(cloud.colours, COLOURS)
    np.testing.assert_array_equal(cloud.intensity, [0, 1, 40_000, 65_535])
    np.testing.assert_array_equal(cloud.fields["classification"], [1, 2, 6, 9])
    back = read_cloud(write_ply(tmp_path / "back.ply", cloud))
    np.testing.assert_array_equal(back.world_points, cloud.world_points)
    assert set(back.fields) == set(cloud.fields)


def test_e57_of_pye57_places_each_scan_by_its_pose(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS.T.copy(), strict=True))
    shades = dict(zip(("colorRed", "colorGreen", "colorBlue"), COLOURS.T.copy(), strict=True))
    strength = {"intensity": INTENSITY.astype(np.float32)}
    quarter_turn = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    image = pye57.E57(str(path), mode="w")
    image.write_scan_raw(columns | shades | strength)
    image.write_scan_raw(columns | shades | strength, rotation=quarter_turn, translation=UTM)
    image.close()
    cloud = read_cloud(path)
    # A quarter turn about z takes (x, y) to (-y, x).
    turned = np.column_stack([-POINTS[:, 1], POINTS[:, 0], POINTS[:, 2]]) + UTM
    np.testing.assert_allclose(cloud.world_points, np.vstack([POINTS, turned]), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(cloud.colours, np.vstack([COLOURS, COLOURS]))
    np.testing.assert_array_equal(cloud.intensity, np.tile(INTENSITY, 2))
    np.testing.assert_array_equal(cloud.fields["scan"], [0, 0, 0, 0, 1, 1, 1, 1])


# Bare arrays and text


def test_kitti_and_nuscenes_rows(tmp_path: Path) -> None:
    rows = np.column_stack([POINTS, INTENSITY, [0, 1, 30, 31]]).astype("<f4")
    assert_same(read_cloud(written(tmp_path / "a.bin", rows[:, :4].tobytes())), POINTS, None, INTENSITY)
    cloud = read_cloud(written(tmp_path / "a.pcd.bin", rows.tobytes()))
    assert_same(cloud, POINTS, None, INTENSITY)
    np.testing.assert_array_equal(cloud.fields["ring"], [0, 1, 30, 31])
    named = read_cloud(written(tmp_path / "b.bin", rows.tobytes()), columns=("x", "y", "z", "_", "beam"))
    assert list(named.fields) == ["beam"]


def test_npy_tables_organized_and_structured(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([POINTS, INTENSITY]))
    assert_same(read_cloud(tmp_path / "a.npy"), POINTS, None, INTENSITY)
    np.save(tmp_path / "b.npy", np.column_stack([POINTS, COLOURS]).reshape(2, 2, 6))
    assert_same(read_cloud(tmp_path / "b.npy"), POINTS, COLOURS)
    rows = np.zeros(4, dtype=[("X", ">f8"), ("Y", ">f8"), ("Z", ">f8"), ("t", ">i8")])
    rows["X"], rows["Y"], rows["Z"] = POINTS.T
    rows["t"] = [2**62 + 1, 0, -1, 5]
    np.save(tmp_path / "c.npy", rows)
    cloud = read_cloud(tmp_path / "c.npy")
    assert_same(cloud)
    np.testing.assert_array_equal(cloud.fields["t"], rows["t"])


def test_npz_with_names_or_one_table(tmp_path: Path) -> None:
    origin = np.array([500_000.0, 0.0, 0.0])
    arrays: dict[str, Any] = {"points": POINTS, "colors": COLOURS, "intensity": INTENSITY, "label": np.arange(4)}
    np.savez_compressed(tmp_path / "a.npz", origin=origin, faces=TRIANGLES, **arrays)
    cloud = read_cloud(tmp_path / "a.npz")
    assert_same(cloud, POINTS + origin, COLOURS, INTENSITY)
    np.testing.assert_array_equal(cloud.triangles, TRIANGLES)
    np.testing.assert_array_equal(cloud.fields["label"], np.arange(4))
    np.savez(tmp_path / "b.npz", POINTS)
    assert_same(read_cloud(tmp_path / "b.npz"))
    np.savez(tmp_path / "c.npz", x=POINTS[:, 0], y=POINTS[:, 1], z=POINTS[:, 2])
    assert_same(read_cloud(tmp_path / "c.npz"))


def text_of(*columns: Any, delimiter: str = " ") -> str:
    """A line of numbers a point."""
    table = np.column_stack(columns)
    return "".join(delimiter.join(f"{value:.17g}" for value in row) + "\n" for row in table)


@pytest.mark.parametrize(
    ("name", "text", "colours", "intensity"),
    [
        ("a.xyz", text_of(POINTS), None, None),
        ("a.xyz", text_of(POINTS, INTENSITY), None, INTENSITY),
        ("a.txt", "\n" + text_of(POINTS, COLOURS) + "\n\n", COLOURS, None),
        ("a.pts", "4\n" + text_of(POINTS, INTENSITY * 100 + 0.5, COLOURS), COLOURS, INTENSITY * 100 + 0.5),
        ("a.txt", text_of(POINTS, COLOURS, INTENSITY), COLOURS, INTENSITY),
        ("a.csv", "x,y,z,Intensity\n" + text_of(POINTS, INTENSITY, delimiter=","), None, INTENSITY),
        ("a.asc", "//X Y Z R G B\n" + text_of(POINTS, COLOURS), COLOURS, None),
        ("a.csv", "# by hand\n" + text_of(POINTS, delimiter=";").replace("\n", "\r\n"), None, None),
        ("a.xyz", text_of(POINTS, delimiter="\t"), None, None),
    ],
)
def test_text(tmp_path: Path, name: str, text: str, colours: Any, intensity: Any) -> None:
    assert_same(read_cloud(written(tmp_path / name, text)), POINTS, colours, intensity)


def test_text_columns_by_name(tmp_path: Path) -> None:
    path = written(tmp_path / "a.txt", text_of(INTENSITY, POINTS))
    assert_same(read_cloud(path, columns=("intensity", "x", "y", "z")), POINTS, None, INTENSITY)


# Meshes


@pytest.mark.parametrize("kind", ["obj", "stl", "stl_ascii", "glb"])
def test_meshes_of_trimesh(tmp_path: Path, kind: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, vertex_colors=COLOURS if kind in ("obj", "glb") else None, process=False)
    exported = mesh.export(file_type=kind)
    cloud = read_cloud(written(tmp_path / f"a.{kind.partition('_')[0]}", exported))
    assert cloud.triangles is not None
    np.testing.assert_array_equal(cloud.points[cloud.triangles], POINTS[TRIANGLES])
    assert len(cloud) == len(POINTS)
    if kind in ("obj", "glb"):
        np.testing.assert_array_equal(cloud.colours, COLOURS)


def test_the_parts_of_a_scene_are_placed_and_joined(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, process=False)
    scene = trimesh.Scene()
    scene.add_geometry(mesh)
    scene.add_geometry(mesh, transform=trimesh.transformations.translation_matrix([1.0, 2.0, 3.0]))
    cloud = read_cloud(written(tmp_path / "a.glb", scene.export(file_type="glb")))
    found = {tuple(point) for point in cloud.points}
    assert found == {tuple(point) for point in np.vstack([POINTS, POINTS + np.array([1.0, 2.0, 3.0])])}
    assert cloud.triangles is not None
    assert len(cloud.triangles) == 4


def test_obj_by_hand(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    text = "mtllib none.mtl\n" + "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS) + "f 1 2 3\nf 3 2 4\n"
    cloud = read_cloud(written(tmp_path / "a.obj", text))
    assert_same(cloud)
    np.testing.assert_array_equal(cloud.triangles, TRIANGLES)


# Depth images


def test_depth_along_the_axis_puts_a_wall_on_a_plane() -> None:
    camera = PinholeCamera(100.0, 110.0, 3.0, 2.0, width=8, height=6)
    cloud = cloud_from_depth(np.full((6, 8), 2.5), camera)
    np.testing.assert_allclose(cloud.points[:, 2], 2.5, rtol=1e-15)
    # The pixel (7, 5) is 4 right and 3 below the principal point.
    np.testing.assert_allclose(cloud.points[-1], [2.5 * 4 / 100, 2.5 * 3 / 110, 2.5], rtol=1e-14)


def test_range_of_a_fisheye_puts_a_bowl_on_a_sphere_and_projects_back() -> None:
    camera = FisheyeCamera(20.0, 20.0, 15.5, 15.5, width=32, height=32)
    cloud = cloud_from_depth(np.full((32, 32), 3.0), camera, distance="range")
    np.testing.assert_allclose(np.linalg.norm(cloud.points, axis=1), 3.0, rtol=1e-14)
    rows, columns = np.divmod(np.arange(32 * 32), 32)
    np.testing.assert_allclose(camera.project(cloud.points), np.column_stack([columns, rows]), atol=1e-9)


def test_rays_beside_the_camera_have_no_depth_along_the_axis() -> None:
    camera = FisheyeCamera(5.0, 5.0, 15.5, 15.5)
    ahead = camera.bearings([[x, y] for y in range(32) for x in range(32)])[:, 2] > 0.0
    cloud = cloud_from_depth(np.full((32, 32), 3.0), camera)
    assert 0 < len(cloud) == np.count_nonzero(ahead) < 32 * 32
    assert cloud.dropped == 32 * 32 - len(cloud)


def test_depth_png_with_holes_and_colours(tmp_path: Path) -> None:
    camera = PinholeCamera(50.0, 50.0, 1.0, 1.0)
    millimetres = np.array([[1000, 0, 2000], [65535, 1500, 1]], dtype=np.uint16)
    Image.fromarray(millimetres).save(tmp_path / "depth.png")
    shades = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    cloud = cloud_from_depth(tmp_path / "depth.png", camera, scale=1e-3, colours=shades)
    np.testing.assert_allclose(cloud.points[:, 2], [1.0, 2.0, 65.535, 1.5, 0.001], rtol=1e-14)
    np.testing.assert_array_equal(cloud.colours, np.delete(shades.reshape(-1, 3), 1, axis=0))
    assert (cloud.dropped, cloud.source) == (1, tmp_path / "depth.png")


# Writing, extras, kinds


def test_a_file_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    path = written(tmp_path / "a.ply", "precious")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        write_ply(path, full_cloud())
    assert path.read_bytes() == b"precious"
    write_ply(path, full_cloud(), overwrite=True)
    assert_same(read_cloud(path), POINTS + UTM, COLOURS, INTENSITY)
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_leaves_nothing_and_keeps_what_was_there(tmp_path: Path, monkeypatch: Any) -> None:
    path = written(tmp_path / "a.ply", "precious")

    def fail(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("regionpose.clouds.ply_writer._rows", fail)
    with pytest.raises(OSError, match="no space"):
        write_ply(path, full_cloud(), overwrite=True)
    assert path.read_bytes() == b"precious"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    "fields",
    [
        {"x": np.zeros(4)},
        {"a b": np.zeros(4), "a_b": np.zeros(4)},
        {"höhe": np.zeros(4)},
        {"": np.zeros(4)},
        {"stamp": np.array([2**53 + 1, 0, 0, 0])},
    ],
)
def test_fields_that_ply_cannot_hold_are_refused(tmp_path: Path, fields: dict[str, Any]) -> None:
    with pytest.raises(CloudError, match=r"field .*: found .*; needed"):
        write_ply(tmp_path / "a.ply", replace(full_cloud(), fields=fields))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "content", "module", "extra"),
    [
        ("a.las", b"LASF" + bytes(400), "laspy", "las"),
        ("a.e57", b"ASTM-E57" + bytes(400), "pye57", "e57"),
        ("a.stl", b"solid\n", "trimesh", "mesh"),
    ],
)
def test_a_missing_package_names_its_extra(
    tmp_path: Path, monkeypatch: Any, name: str, content: bytes, module: str, extra: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(MissingExtraError, match=rf'pip install "regionpose\[{extra}\]"'):
        read_cloud(written(tmp_path / name, content))


def test_the_content_tells_the_kind_before_the_name(tmp_path: Path) -> None:
    assert_same(read_cloud(written(tmp_path / "a.xyz", ascii_ply())), POINTS, COLOURS, INTENSITY)
    buffer = io.BytesIO()
    np.save(buffer, POINTS)
    assert_same(read_cloud(written(tmp_path / "b.ply", buffer.getvalue())))
    assert_same(read_cloud(written(tmp_path / "c", ascii_pcd())), POINTS, COLOURS, INTENSITY)
