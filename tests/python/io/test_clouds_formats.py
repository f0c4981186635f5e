"""Every format of clouds, against files written by hand or by another package."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bare_rows import scanned_rows
from cloud_samples import (
    COLORS,
    CUT,
    INTENSITY,
    POINTS,
    TRIANGLES,
    UTM,
    ascii_pcd,
    ascii_ply,
    assert_same,
    binary_ply,
    compressed_pcd,
    literal_lzf,
    pcd_head,
    pcd_rows,
    written,
)
from hypothesis import given
from hypothesis import strategies as st
from regionpose.io.clouds import MissingExtraError, e57, las, pieces, read_cloud, write_ply
from regionpose.io.clouds.lzf import decompress, decompress_in_python

DATA = Path(__file__).parents[4] / "shared" / "data"


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
    assert_same(cloud, POINTS, COLORS, INTENSITY)
    np.testing.assert_array_equal(cloud.triangles, CUT)


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_ply_of_trimesh(tmp_path: Path, form: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, vertex_colors=COLORS, process=False)
    content = mesh.export(file_type="ply", encoding=form)
    cloud = read_cloud(written(tmp_path / "mesh.ply", content))
    assert_same(cloud, POINTS, COLORS)
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
    np.testing.assert_array_equal(cloud.points, POINTS + UTM)
    np.testing.assert_array_equal(cloud.fields["label"], rows["label"])


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
    assert_same(cloud, POINTS, COLORS, INTENSITY)
    assert not cloud.fields


@pytest.mark.parametrize("hole", [np.nan, 0.0])
def test_organized_pcd_drops_its_holes_and_keeps_where_they_are(tmp_path: Path, hole: float) -> None:
    rows = pcd_rows()
    for axis in "xyz":
        rows[axis][2] = hole
    cloud = read_cloud(written(tmp_path / "a.pcd", pcd_head("binary", width=2, height=2).encode() + rows.tobytes()))
    assert cloud.dropped == 1
    assert_same(cloud, POINTS[[0, 1, 3]], COLORS[[0, 1, 3]], INTENSITY[[0, 1, 3]])
    assert cloud.grid_shape == (2, 2) and cloud.grid_indices is not None
    np.testing.assert_array_equal(cloud.grid_indices, [0, 1, 3])


def test_the_grid_of_an_e57_is_that_of_its_rows_and_columns(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS.T.copy(), strict=True))
    columns["cartesianX"][3] = columns["cartesianY"][3] = columns["cartesianZ"][3] = 0.0
    columns |= {"rowIndex": np.array([1, 0, 1, 0]), "columnIndex": np.array([2, 1, 0, 0])}
    image = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    image.write_scan_raw(columns, translation=UTM)
    image.close()
    cloud = read_cloud(tmp_path / "a.e57")
    assert (cloud.dropped, cloud.grid_shape) == (1, (2, 3)) and cloud.grid_indices is not None
    np.testing.assert_array_equal(cloud.grid_indices, [5, 1, 3])
    np.testing.assert_allclose(cloud.points, POINTS[:3] + UTM, rtol=0, atol=1e-8)


@pytest.mark.parametrize("form", ["ascii", "binary"])
def test_fields_of_no_values_take_no_bytes(tmp_path: Path, form: str) -> None:
    head = (
        "VERSION 0.7\nFIELDS x y z _ intensity _ ring _\nSIZE 4 4 4 1 4 1 2 1\nTYPE F F F U F U U U\n"
        f"COUNT 1 1 1 4 1 0 1 2\nWIDTH 4\nHEIGHT 1\nPOINTS 4\nDATA {form}\n"
    )
    if form == "ascii":
        rows = zip(POINTS, INTENSITY, strict=True)
        body = "".join(f"{x} {y} {z} 0 0 0 0 {i} {k} 0 0\n" for k, ((x, y, z), i) in enumerate(rows))
    else:
        kinds = [("xyz", "<f4", 3), ("_", "u1", 4), ("i", "<f4"), ("ring", "<u2"), ("pad", "u1", 2)]
        table = np.zeros(4, dtype=kinds)
        table["xyz"], table["i"], table["ring"], table["_"] = POINTS, INTENSITY, range(4), 9
        body = table.tobytes().decode("latin-1")
    content = head.encode() + body.encode("latin-1")
    cloud = read_cloud(written(tmp_path / "a.pcd", content))
    assert_same(cloud, POINTS, None, INTENSITY)
    assert list(cloud.fields) == ["ring"]
    np.testing.assert_array_equal(cloud.fields["ring"], range(4))


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


@pytest.mark.parametrize(("ending", "factor"), [(".las", 257), (".laz", 257), (".las", 1)])
def test_las_of_laspy(tmp_path: Path, ending: str, factor: int) -> None:
    laspy = pytest.importorskip("laspy")
    if ending == ".laz":
        pytest.importorskip("lazrs")
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 1e-4), UTM
    stored = laspy.LasData(header)
    stored.x, stored.y, stored.z = (POINTS + UTM).T
    stored.red, stored.green, stored.blue = COLORS.T.astype(np.uint16) * factor
    stored.intensity = np.array([0, 1, 40_000, 65_535])
    stored.classification = np.array([1, 2, 6, 9])
    stored.write(str(tmp_path / f"a{ending}"))
    cloud = read_cloud(tmp_path / f"a{ending}")
    np.testing.assert_allclose(cloud.points, POINTS + UTM, rtol=0, atol=0.5e-4 + 1e-9)
    np.testing.assert_array_equal(cloud.origin, [449_100.0, 5_412_000.0, 0.0])
    np.testing.assert_array_equal(cloud.colors, COLORS)
    np.testing.assert_array_equal(cloud.intensity, [0, 1, 40_000, 65_535])
    np.testing.assert_array_equal(cloud.fields["classification"], [1, 2, 6, 9])
    back = read_cloud(write_ply(tmp_path / "back.ply", cloud))
    np.testing.assert_array_equal(back.points, cloud.points)
    assert set(back.fields) == set(cloud.fields)


def test_laz_without_its_decoder_names_the_extra(tmp_path: Path, monkeypatch: Any) -> None:
    laspy = pytest.importorskip("laspy")
    pytest.importorskip("lazrs")
    stored = laspy.LasData(laspy.LasHeader(point_format=3))
    stored.x = stored.y = stored.z = np.arange(5.0)
    stored.write(str(tmp_path / "a.laz"))
    monkeypatch.setitem(sys.modules, "lazrs", None)
    with pytest.raises(MissingExtraError, match=r'LAZ needs the package lazrs.*"regionpose\[las\]"'):
        read_cloud(tmp_path / "a.laz")


def test_compressed_pcd_needs_no_c_module(tmp_path: Path, monkeypatch: Any) -> None:
    monkeypatch.setitem(sys.modules, "lzf", None)
    assert_same(read_cloud(written(tmp_path / "a.pcd", compressed_pcd(pcd_rows()))), POINTS, COLORS, INTENSITY)


def test_e57_of_pye57_places_each_scan_by_its_pose(tmp_path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    path = tmp_path / "a.e57"
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS.T.copy(), strict=True))
    shades = dict(zip(("colorRed", "colorGreen", "colorBlue"), COLORS.T.copy(), strict=True))
    strength = {"intensity": INTENSITY.astype(np.float32)}
    quarter_turn = np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
    image = pye57.E57(str(path), mode="w")
    image.write_scan_raw(columns | shades | strength)
    image.write_scan_raw(columns | shades | strength, rotation=quarter_turn, translation=UTM)
    image.close()
    cloud = read_cloud(path)
    # A quarter turn about z takes (x, y) to (-y, x).
    turned = np.column_stack([-POINTS[:, 1], POINTS[:, 0], POINTS[:, 2]]) + UTM
    np.testing.assert_allclose(cloud.points, np.vstack([POINTS, turned]), rtol=0, atol=1e-8)
    np.testing.assert_array_equal(cloud.colors, np.vstack([COLORS, COLORS]))
    np.testing.assert_array_equal(cloud.intensity, np.tile(INTENSITY, 2))
    np.testing.assert_array_equal(cloud.fields["scan"], [0, 0, 0, 0, 1, 1, 1, 1])
    assert cloud.sensor_origin is None, "two places, neither of all points"


def world_sensor_origin(cloud: Any) -> list[float] | None:
    return None if cloud.sensor_origin is None else cloud.sensor_origin.tolist()


@pytest.mark.parametrize(
    ("viewpoint", "place"),
    [
        ("0 0 0 1 0 0 0", None),
        ("1.5 -2 0.25 1 0 0 0", [1.5, -2.0, 0.25]),
        ("0 0 0 0 1 0 0", [0.0, 0.0, 0.0]),
        ("512300 5405700 102.5 1 0 0 0", [512300.0, 5405700.0, 102.5]),
    ],
)
def test_a_viewpoint_that_someone_set_is_where_the_scanner_stood(
    viewpoint: str, place: list[float] | None, tmp_path: Path
) -> None:
    content = ascii_pcd().replace("VIEWPOINT 0 0 0 1 0 0 0", f"VIEWPOINT {viewpoint}")
    cloud = read_cloud(written(tmp_path / "a.pcd", content.encode()))
    assert_same(cloud, POINTS, COLORS, INTENSITY)
    assert world_sensor_origin(cloud) == place
    assert ("scanned from" in repr(cloud)) == (place is not None)


def test_a_pcd_without_a_viewpoint_tells_no_sensor_origin(tmp_path: Path) -> None:
    content = ascii_pcd().replace("VIEWPOINT 0 0 0 1 0 0 0\n", "")
    assert read_cloud(written(tmp_path / "a.pcd", content.encode())).sensor_origin is None


@pytest.mark.parametrize(("translation", "place"), [(UTM, UTM), ((0.0, 0.0, 0.0), None)])
def test_the_pose_of_the_only_scan_of_an_e57_is_where_the_scanner_stood(
    translation: Any, place: Any, tmp_path: Path
) -> None:
    pye57 = pytest.importorskip("pye57")
    columns = dict(zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS.T.copy(), strict=True))
    image = pye57.E57(str(tmp_path / "a.e57"), mode="w")
    image.write_scan_raw(columns, translation=np.array(translation))
    image.close()
    assert world_sensor_origin(read_cloud(tmp_path / "a.e57")) == (None if place is None else list(place))


def test_columns_that_are_named_are_those_of_a_file_of_few_rows(tmp_path: Path) -> None:
    rows = np.column_stack([POINTS, INTENSITY, [0, 1, 30, 31]]).astype("<f4")
    path = written(tmp_path / "a.bin", rows[:, :4].tobytes())
    cloud = read_cloud(path, columns=("x", "y", "z", "intensity"))
    assert_same(cloud, POINTS, None, INTENSITY)
    assert world_sensor_origin(cloud) == [0.0, 0.0, 0.0]
    named = read_cloud(written(tmp_path / "b.bin", rows.tobytes()), columns=("x", "y", "z", "_", "beam"))
    assert list(named.fields) == ["beam"]
    cloud = read_cloud(written(tmp_path / "a.pcd.bin", rows.tobytes()))
    assert_same(cloud, POINTS, None, INTENSITY)
    np.testing.assert_array_equal(cloud.fields["ring"], [0, 1, 30, 31])


def las_file(path: Path) -> None:
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales = np.full(3, 1e-3)
    stored = laspy.LasData(header)
    stored.x, stored.y, stored.z = np.tile(POINTS, (25, 1)).T
    stored.write(str(path))


def e57_file(path: Path) -> None:
    pye57 = pytest.importorskip("pye57")
    image = pye57.E57(str(path), mode="w")
    for count in (4, 3):
        columns = zip(("cartesianX", "cartesianY", "cartesianZ"), POINTS[:count].T.copy(), strict=True)
        image.write_scan_raw(dict(columns))
    image.close()


def kitti_rows() -> bytes:
    return scanned_rows(1000, "intensity").tobytes()


FILES: dict[str, Callable[[Path], object]] = {
    "binary.ply": lambda path: path.write_bytes(binary_ply("<", "binary_little_endian")),
    "ascii.ply": lambda path: path.write_bytes(ascii_ply()),
    "ascii.pcd": lambda path: path.write_text(ascii_pcd()),
    "binary.pcd": lambda path: path.write_bytes(pcd_head("binary").encode() + pcd_rows().tobytes()),
    "compressed.pcd": lambda path: path.write_bytes(compressed_pcd(pcd_rows())),
    "rows.bin": lambda path: path.write_bytes(kitti_rows()),
    "rows.csv": lambda path: path.write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in POINTS)),
    "a.las": las_file,
    "a.laz": las_file,
    "a.e57": e57_file,
}
"""Writers of files that are read in pieces."""


@pytest.mark.parametrize("name", FILES)
def test_reading_in_pieces_changes_nothing_and_tells_how_much_is_read(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / name
    FILES[name](path)
    whole = read_cloud(path)
    for module, size in ((pieces, "PIECE_BYTES"), (las, "PIECE_POINTS"), (e57, "PIECE_POINTS")):
        monkeypatch.setattr(module, size, 3)
    shares: list[float] = []
    cloud = read_cloud(path, progress=shares.append)
    assert_same(cloud, whole.points, whole.colors, whole.intensity)
    for field, values in whole.fields.items():
        np.testing.assert_array_equal(cloud.fields[field], values)
    assert len(shares) > 2 and shares == sorted(shares)
    assert shares[0] >= 0.0 and shares[-1] == 1.0


@pytest.mark.skipif(not DATA.is_dir(), reason="the scenes are not here")
def test_lidar_scans_of_real_scenes() -> None:
    scans = sorted(DATA.glob("*/*/points.bin"))
    assert scans
    for scan in scans:
        cloud = read_cloud(scan)
        assert len(cloud) > 10_000
        assert cloud.intensity is not None
        assert 0.0 <= cloud.intensity.min() <= cloud.intensity.max() <= 255.0
        # The ground lies some two meters below the scanner on a car's roof.
        assert -2.2 < np.percentile(cloud.points[:, 2], 20) < -1.2


def test_npy_tables_organized_and_structured(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.column_stack([POINTS, INTENSITY]))
    assert_same(read_cloud(tmp_path / "a.npy"), POINTS, None, INTENSITY)
    np.save(tmp_path / "b.npy", np.column_stack([POINTS, COLORS]).reshape(2, 2, 6))
    assert_same(read_cloud(tmp_path / "b.npy"), POINTS, COLORS)
    assert read_cloud(tmp_path / "b.npy").grid_shape == (2, 2)
    assert read_cloud(tmp_path / "a.npy").grid_shape is None
    rows = np.zeros(4, dtype=[("X", ">f8"), ("Y", ">f8"), ("Z", ">f8"), ("t", ">i8")])
    rows["X"], rows["Y"], rows["Z"] = POINTS.T
    rows["t"] = [2**62 + 1, 0, -1, 5]
    np.save(tmp_path / "c.npy", rows)
    cloud = read_cloud(tmp_path / "c.npy")
    assert_same(cloud)
    np.testing.assert_array_equal(cloud.fields["t"], rows["t"])


def test_npz_with_names_or_one_table(tmp_path: Path) -> None:
    origin = np.array([500_000.0, 0.0, 0.0])
    arrays: dict[str, Any] = {"points": POINTS, "colors": COLORS, "intensity": INTENSITY, "label": np.arange(4)}
    np.savez_compressed(tmp_path / "a.npz", origin=origin, faces=TRIANGLES, **arrays)
    cloud = read_cloud(tmp_path / "a.npz")
    assert_same(cloud, POINTS + origin, COLORS, INTENSITY)
    np.testing.assert_array_equal(cloud.triangles, TRIANGLES)
    np.testing.assert_array_equal(cloud.fields["label"], np.arange(4))
    for name in ("colours", "rgb"):
        named: dict[str, Any] = {"points": POINTS, name: COLORS}
        np.savez(tmp_path / "named.npz", **named)
        assert_same(read_cloud(tmp_path / "named.npz"), POINTS, COLORS)
    np.savez(tmp_path / "b.npz", POINTS)
    assert_same(read_cloud(tmp_path / "b.npz"))
    np.savez(tmp_path / "c.npz", x=POINTS[:, 0], y=POINTS[:, 1], z=POINTS[:, 2])
    assert_same(read_cloud(tmp_path / "c.npz"))


def text_of(*columns: Any, delimiter: str = " ") -> str:
    """A line of numbers a point."""
    table = np.column_stack(columns)
    return "".join(delimiter.join(f"{value:.17g}" for value in row) + "\n" for row in table)


@pytest.mark.parametrize(
    ("name", "text", "colors", "intensity"),
    [
        ("a.xyz", text_of(POINTS), None, None),
        ("a.xyz", text_of(POINTS, INTENSITY), None, INTENSITY),
        ("a.txt", "\n" + text_of(POINTS, COLORS) + "\n\n", COLORS, None),
        ("a.pts", "4\n" + text_of(POINTS, INTENSITY * 100 + 0.5, COLORS), COLORS, INTENSITY * 100 + 0.5),
        ("a.txt", text_of(POINTS, COLORS, INTENSITY), COLORS, INTENSITY),
        ("a.csv", "x,y,z,Intensity\n" + text_of(POINTS, INTENSITY, delimiter=","), None, INTENSITY),
        ("a.asc", "//X Y Z R G B\n" + text_of(POINTS, COLORS), COLORS, None),
        ("a.csv", "# by hand\n" + text_of(POINTS, delimiter=";").replace("\n", "\r\n"), None, None),
        ("a.xyz", text_of(POINTS, delimiter="\t"), None, None),
    ],
)
def test_text(tmp_path: Path, name: str, text: str, colors: Any, intensity: Any) -> None:
    assert_same(read_cloud(written(tmp_path / name, text)), POINTS, colors, intensity)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.xyz", text_of(POINTS)),
        ("a.csv", "x,y,z\n" + text_of(POINTS, delimiter=",")),
        ("a.ply", ascii_ply().decode()),
        ("a.pcd", ascii_pcd()),
        ("odd", ascii_ply().decode()),
    ],
)
def test_a_byte_order_mark_before_a_text_changes_nothing(tmp_path: Path, name: str, text: str) -> None:
    cloud = read_cloud(written(tmp_path / name, "\ufeff" + text))
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_text_columns_by_name(tmp_path: Path) -> None:
    path = written(tmp_path / "a.txt", text_of(INTENSITY, POINTS))
    assert_same(read_cloud(path, columns=("intensity", "x", "y", "z")), POINTS, None, INTENSITY)


@pytest.mark.parametrize("kind", ["obj", "stl", "stl_ascii", "glb"])
def test_meshes_of_trimesh(tmp_path: Path, kind: str) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(POINTS, TRIANGLES, vertex_colors=COLORS if kind in ("obj", "glb") else None, process=False)
    exported = mesh.export(file_type=kind)
    cloud = read_cloud(written(tmp_path / f"a.{kind.partition('_')[0]}", exported))
    assert cloud.triangles is not None
    np.testing.assert_array_equal(cloud.points[cloud.triangles], POINTS[TRIANGLES])
    assert len(cloud) == len(POINTS)
    if kind in ("obj", "glb"):
        np.testing.assert_array_equal(cloud.colors, COLORS)


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
