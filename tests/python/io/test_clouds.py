"""Clouds, their writing, depth images, and the kinds of files."""

from __future__ import annotations

import io
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cloud_samples import (
    COLORS,
    INTENSITY,
    POINTS,
    TRIANGLES,
    UTM,
    ascii_pcd,
    ascii_ply,
    assert_same,
    full_cloud,
    written,
)
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from regionpose.cameras import FisheyeCamera, PinholeCamera
from regionpose.io.clouds import Cloud, CloudError, MissingExtraError, cloud_from_depth, read_cloud, write_ply
from regionpose.scene.input_checks import check_intensity


def test_small_coordinates_have_no_origin() -> None:
    cloud = Cloud.from_points(POINTS)
    assert not cloud.origin.any()
    assert len(cloud) == 4
    assert_same(cloud)


def test_map_coordinates_have_an_origin_on_the_large_axes_and_lose_nothing() -> None:
    cloud = Cloud.from_points(POINTS + UTM)
    np.testing.assert_array_equal(cloud.origin, [449_100.0, 5_412_000.0, 0.0])
    assert np.abs(cloud.local_points).max() < 300.0
    assert_same(cloud, POINTS + UTM)


def test_one_stray_point_does_not_move_the_origin() -> None:
    stray = np.vstack([np.tile(POINTS, (3, 1)), [[1e9, -1e9, 1e9]]])
    assert not Cloud.from_points(stray).origin.any()


def test_points_that_are_not_finite_are_dropped_with_their_colors_and_triangles() -> None:
    points = POINTS.copy()
    points[1, 2] = np.nan
    triangles = [[0, 2, 3], [0, 1, 2]]
    cloud = Cloud.from_points(
        points, colors=COLORS, intensity=INTENSITY, fields={"a": np.arange(4)}, triangles=triangles
    )
    kept = [0, 2, 3]
    assert cloud.dropped == 1
    assert_same(cloud, POINTS[kept], COLORS[kept], INTENSITY[kept])
    np.testing.assert_array_equal(cloud.fields["a"], kept)
    np.testing.assert_array_equal(cloud.triangles, [[0, 1, 2]])


def test_arrays_are_read_only_and_the_givers_own_array_is_not() -> None:
    mine = POINTS.copy()
    cloud = Cloud(mine)
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 1.0
    mine[0, 0] = 5.0


@pytest.mark.parametrize(
    ("given_colors", "needed"),
    [
        (COLORS.astype(np.uint16) * 257, COLORS),
        (COLORS.astype(np.int64), COLORS),
        (COLORS / 255.0, COLORS),
        (COLORS.astype(np.float32), COLORS),
    ],
)
def test_colors_of_16_bits_and_fractions_are_brought_to_8_bits(given_colors: Any, needed: Any) -> None:
    assert_same(Cloud.from_points(POINTS, colors=given_colors), POINTS, needed)


@pytest.mark.parametrize(
    ("parts", "item"),
    [
        ({"local_points": np.zeros((0, 3))}, "points"),
        ({"local_points": np.zeros((4, 2))}, "local_points"),
        ({"local_points": [["a", "b", "c"]]}, "local_points"),
        ({"local_points": [[0.0, np.inf, 0.0]]}, "local_points"),
        ({"colors": COLORS[:3]}, "colors"),
        ({"colors": COLORS.astype(float)}, "colors"),
        ({"intensity": np.zeros(3)}, "intensity"),
        ({"fields": {"label": ["a", "b", "c", "d"]}}, "field label"),
        ({"triangles": [[0, 1, 4]]}, "triangles"),
        ({"triangles": [[0.0, 1.0, 2.0]]}, "triangles"),
        ({"origin": [np.nan, 0.0, 0.0]}, "origin"),
    ],
)
def test_parts_that_disagree_are_named(parts: dict[str, Any], item: str) -> None:
    with pytest.raises(CloudError, match=f"{item}: found .*; needed"):
        Cloud(**({"local_points": POINTS} | parts))


@pytest.mark.parametrize(
    ("parts", "item"),
    [
        ({"colors": COLORS[:2]}, "colors"),
        ({"colors": -COLORS.astype(int)}, "colors"),
        ({"colors": np.full((4, 3), 70_000)}, "colors"),
        ({"intensity": [1.0]}, "intensity"),
        ({"triangles": [[0, 1, 9]]}, "triangles"),
    ],
)
def test_parts_of_world_points_that_disagree_are_named(parts: dict[str, Any], item: str) -> None:
    with pytest.raises(CloudError, match=f"{item}: found .*; needed"):
        Cloud.from_points(POINTS, **parts)


def test_a_written_ply_comes_back_whole(tmp_path: Path) -> None:
    cloud = full_cloud()
    path = write_ply(tmp_path / "cloud.ply", cloud)
    back = read_cloud(path)
    assert_same(back, POINTS + UTM, COLORS, INTENSITY)
    assert back.source == path
    np.testing.assert_array_equal(back.triangles, TRIANGLES)
    np.testing.assert_array_equal(back.origin, cloud.origin)
    np.testing.assert_array_equal(back.fields["gps_time"], cloud.fields["gps time"])
    np.testing.assert_array_equal(back.fields["ring"], cloud.fields["ring"])


def no_zeros(points: Any) -> bool:
    """Whether no point is at zero to the rounding of the cloud's coordinates: it would be a beam without a return."""
    return bool(points.any(axis=1).all()) and bool(Cloud.from_points(points).points.any(axis=1).all())


FINITE = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e12, max_value=1e12)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
@given(points=hnp.arrays(np.float64, st.tuples(st.integers(1, 20), st.just(3)), elements=FINITE).filter(no_zeros))
@example(points=np.array([[1.0, 0.0, 0.0], [20001.0, 0.0, 0.0]]))
def test_any_cloud_survives_writing_to_the_last_bit(tmp_path: Path, points: Any) -> None:
    cloud = Cloud.from_points(points, fields={"value": points[:, 0]})
    back = read_cloud(write_ply(tmp_path / "any.ply", cloud, overwrite=True))
    np.testing.assert_array_equal(back.points, cloud.points)
    np.testing.assert_array_equal(back.fields["value"], points[:, 0])


def test_a_written_ply_is_read_by_trimesh(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.load(write_ply(tmp_path / "mesh.ply", full_cloud()), process=False)
    np.testing.assert_array_equal(mesh.vertices, POINTS + UTM)
    np.testing.assert_array_equal(mesh.faces, TRIANGLES)
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], COLORS)


def test_a_written_ply_is_read_by_plyfile(tmp_path: Path) -> None:
    plyfile = pytest.importorskip("plyfile")
    vertex = plyfile.PlyData.read(write_ply(tmp_path / "cloud.ply", full_cloud()))["vertex"]
    np.testing.assert_array_equal(np.stack([vertex["x"], vertex["y"], vertex["z"]], axis=1), POINTS + UTM)
    assert vertex["x"].dtype == np.float64
    np.testing.assert_array_equal(vertex["gps_time"], full_cloud().fields["gps time"])
    np.testing.assert_array_equal(vertex["red"], COLORS[:, 0])


def test_depth_along_the_axis_puts_a_wall_on_a_plane() -> None:
    camera = PinholeCamera(100.0, 110.0, 3.0, 2.0, width=8, height=6)
    cloud = cloud_from_depth(camera, np.full((6, 8), 2.5))
    np.testing.assert_allclose(cloud.points[:, 2], 2.5, rtol=1e-15)
    # The pixel (7, 5) is 4 right and 3 below the principal point.
    np.testing.assert_allclose(cloud.points[-1], [2.5 * 4 / 100, 2.5 * 3 / 110, 2.5], rtol=1e-14)


def test_range_of_a_fisheye_puts_a_bowl_on_a_sphere_and_projects_back() -> None:
    camera = FisheyeCamera(20.0, 20.0, 15.5, 15.5, width=32, height=32)
    cloud = cloud_from_depth(camera, np.full((32, 32), 3.0), distance="range")
    np.testing.assert_allclose(np.linalg.norm(cloud.points, axis=1), 3.0, rtol=1e-14)
    rows, columns = np.divmod(np.arange(32 * 32), 32)
    np.testing.assert_allclose(camera.project(cloud.points), np.column_stack([columns, rows]), atol=1e-9)


def test_rays_beside_the_camera_have_no_depth_along_the_axis() -> None:
    camera = FisheyeCamera(5.0, 5.0, 15.5, 15.5)
    ahead = camera.bearings([[x, y] for y in range(32) for x in range(32)])[:, 2] > 0.0
    cloud = cloud_from_depth(camera, np.full((32, 32), 3.0))
    assert 0 < len(cloud) == np.count_nonzero(ahead) < 32 * 32
    assert cloud.dropped == 32 * 32 - len(cloud)


class CountingCamera(PinholeCamera):
    """A camera that keeps how many pixels it was asked for."""

    asked = 0

    def bearings(self, pixels: ArrayLike) -> NDArray[np.float64]:
        """As of a pinhole."""
        type(self).asked += len(np.asarray(pixels))
        return super().bearings(pixels)


def test_only_pixels_with_a_depth_are_given_bearings() -> None:
    depth = np.zeros((2000, 32))
    depth[7, 3:6] = 2.0
    cloud = cloud_from_depth(CountingCamera(20.0, 20.0, 15.5, 15.5), depth)
    assert (CountingCamera.asked, len(cloud), cloud.dropped) == (3, 3, 2000 * 32 - 3)


def test_depth_png_with_holes_and_colors(tmp_path: Path) -> None:
    camera = PinholeCamera(50.0, 50.0, 1.0, 1.0)
    millimeters = np.array([[1000, 0, 2000], [65535, 1500, 1]], dtype=np.uint16)
    Image.fromarray(millimeters).save(tmp_path / "depth.png")
    shades = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    cloud = cloud_from_depth(camera, tmp_path / "depth.png", unit_m=1e-3, colors=shades)
    np.testing.assert_allclose(cloud.points[:, 2], [1.0, 2.0, 65.535, 1.5, 0.001], rtol=1e-14)
    np.testing.assert_array_equal(cloud.colors, np.delete(shades.reshape(-1, 3), 1, axis=0))
    assert (cloud.dropped, cloud.source) == (1, tmp_path / "depth.png")


def test_a_file_is_not_overwritten_unless_asked(tmp_path: Path) -> None:
    path = written(tmp_path / "a.ply", "precious")
    with pytest.raises(FileExistsError, match="overwrite=True"):
        write_ply(path, full_cloud())
    assert path.read_bytes() == b"precious"
    write_ply(path, full_cloud(), overwrite=True)
    assert_same(read_cloud(path), POINTS + UTM, COLORS, INTENSITY)
    assert list(tmp_path.iterdir()) == [path]


def test_a_failed_write_leaves_nothing_and_keeps_what_was_there(tmp_path: Path, monkeypatch: Any) -> None:
    path = written(tmp_path / "a.ply", "precious")

    def fail(*_: object) -> None:
        raise OSError("no space left")

    monkeypatch.setattr("regionpose.io.clouds.ply_writer._rows", fail)
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
    assert_same(read_cloud(written(tmp_path / "a.xyz", ascii_ply())), POINTS, COLORS, INTENSITY)
    buffer = io.BytesIO()
    np.save(buffer, POINTS)
    assert_same(read_cloud(written(tmp_path / "b.ply", buffer.getvalue())))
    assert_same(read_cloud(written(tmp_path / "c", ascii_pcd())), POINTS, COLORS, INTENSITY)


ZERO = [[0.0, 0.0, 0.0]]


def test_zeros_are_no_points_of_a_scan_and_the_indices_of_the_file_hold() -> None:
    cloud = Cloud.from_points(np.vstack([ZERO, POINTS[:2], ZERO, POINTS[2:]]), intensity=np.arange(6.0))
    assert_same(cloud, POINTS, None, [1.0, 2.0, 4.0, 5.0])
    assert cloud.dropped == 2 and cloud.file_indices is not None
    np.testing.assert_array_equal(cloud.file_indices, [1, 2, 4, 5])
    np.testing.assert_array_equal(cloud.to_file_indices([3, 0]), [5, 1])
    np.testing.assert_array_equal(cloud.from_file_indices([5, 3, 1, 0]), [3, 0])
    with pytest.raises(CloudError, match="indices: found 1 from 6 to 6; needed indices from 0 to 5"):
        cloud.from_file_indices([6])
    with pytest.raises(CloudError, match="points: found 3 points, none"):
        Cloud.from_points(ZERO * 3)


def test_a_mesh_keeps_its_vertex_at_zero() -> None:
    cloud = Cloud.from_points(np.vstack([ZERO, POINTS]), triangles=[[0, 1, 2]])
    assert (len(cloud), cloud.dropped) == (5, 0)


def test_a_whole_cloud_names_its_points_as_its_file_does() -> None:
    cloud = Cloud.from_points(POINTS)
    assert cloud.file_indices is None
    np.testing.assert_array_equal(cloud.from_file_indices(cloud.to_file_indices([2, 1])), [2, 1])


def test_a_grid_keeps_where_nothing_came_back() -> None:
    points = np.vstack([ZERO, POINTS, [[np.nan, 1.0, 1.0]]])
    cloud = Cloud.from_points(points, grid_shape=(2, 3))
    assert cloud.grid_shape == (2, 3) and cloud.grid_indices is not None
    np.testing.assert_array_equal(cloud.grid_indices, [1, 2, 3, 4])
    assert Cloud.from_points(points).grid_indices is None
    absent = np.setdiff1d(np.arange(6), cloud.grid_indices)
    np.testing.assert_array_equal(np.stack(np.divmod(absent, 3), axis=1), [[0, 0], [1, 2]])


@pytest.mark.parametrize("cells", [[0, 1, 2, 2], [0, 1, 2, 4], [-1, 0, 1, 2], [0, 1, 2]])
def test_a_grid_that_does_not_hold_the_points_is_refused(cells: list[int]) -> None:
    with pytest.raises(CloudError, match="grid_indices: found"):
        Cloud(POINTS, grid_shape=(2, 2), grid_indices=np.array(cells))
    with pytest.raises(CloudError, match="grid_shape: found None"):
        Cloud(POINTS, grid_indices=np.arange(4))


def test_an_intensity_without_a_number_is_left_out_and_named() -> None:
    cloud = Cloud.from_points(POINTS, intensity=np.full(4, np.nan))
    assert cloud.intensity is None and cloud.empty == ("intensity",)
    assert [warning.code for warning in check_intensity(cloud)] == ["no-intensity"]
    some = Cloud.from_points(POINTS, intensity=[np.nan, 1.0, 2.0, np.nan])
    assert some.intensity is not None and not some.empty and not check_intensity(some)
    np.testing.assert_array_equal(some.intensity, [np.nan, 1.0, 2.0, np.nan])
