"""World regions: polygons, planes and outlines of points, meshes."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
import regionpose as rp
import trimesh
from flat_shapes import area, disc
from numpy.typing import NDArray
from regionpose import kernels
from scipy.spatial.transform import Rotation

from benchmarks.synthetic import load_templates

Array = NDArray[np.float64]


def any_frame(seed: int) -> tuple[Array, Array]:
    """A rotation (3, 3) and an offset (3,)."""
    rng = np.random.default_rng(seed)
    return Rotation.random(random_state=rng).as_matrix(), rng.uniform(-20.0, 20.0, 3)


@pytest.mark.parametrize("template", load_templates("all")[:6], ids=lambda template: template.name)
def test_a_world_polygon_is_the_same_however_it_is_written(template: object) -> None:
    rings = template.region()  # type: ignore[attr-defined]
    rotation, offset = any_frame(3)
    moved = [ring @ rotation.T + offset for ring in rings]
    expected = area([ring[:, :2] for ring in rings])
    for written in (moved, [ring[::-1] for ring in moved], [np.roll(ring, 3, axis=0) for ring in moved]):
        region = rp.WorldRegion.from_polygon(written)
        assert region.is_planar
        assert region.area == pytest.approx(expected, rel=1e-10)
        assert abs(region.normal @ rotation[:, 2]) == pytest.approx(1.0, abs=1e-12)
        assert np.allclose(
            sorted(map(tuple, np.vstack(region.rings))), sorted(map(tuple, np.vstack(written))), atol=1e-9
        )


def test_a_slightly_bent_polygon_is_moved_onto_its_plane() -> None:
    ring = np.array([[0.0, 0.0, 0.003], [1.0, 0.0, -0.003], [1.0, 1.0, 0.003], [0.0, 1.0, -0.003]])
    region = rp.WorldRegion.from_polygon(ring)
    assert np.ptp(region.rings[0] @ region.normal) < 1e-12
    with pytest.raises(ValueError, match=r"ring 0 leaves the region's plane by 2.* within 1"):
        rp.WorldRegion.from_polygon(ring * [1.0, 1.0, 8.0])


def scan(seed: int, spacing: tuple[float, float], noise: float) -> Array:
    """Points of a 2 m x 1 m rectangle around the origin with a hole of 0.8 m x 0.5 m, row by row."""
    x, y = (np.arange(-half, half + 1e-9, step) for half, step in zip((1.0, 0.5), spacing, strict=True))
    points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    kept = points[~((np.abs(points) < (0.4, 0.25)).all(axis=1))]
    rng = np.random.default_rng(seed)
    return np.column_stack([kept, rng.normal(0.0, noise, len(kept))])


def square_at(x: float, y: float, side: float) -> Array:
    """A square of the plane z = x / 2 about (x, y), counter-clockwise."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) * side + [x, y]
    return np.column_stack([corners, 0.5 * corners[:, 0]])


def test_polygons_are_one_region_with_their_holes() -> None:
    """Two windows of 2 m and 1 m, the larger with a pane of 1 m cut out, vertices turning either way."""
    parts = [[square_at(0.0, 0.0, 2.0), square_at(0.2, 0.0, 1.0)], [square_at(3.0, 1.0, 1.0)[::-1]]]
    region = rp.WorldRegion.from_polygons(parts)
    assert region.area == pytest.approx((4.0 - 1.0 + 1.0) * np.sqrt(1.25), rel=1e-12)
    assert np.allclose(np.abs(region.normal), np.array([0.5, 0.0, 1.0]) / np.sqrt(1.25))
    for ring, expected in zip(region.rings, (ring for rings in parts for ring in rings), strict=True):
        assert np.allclose(np.sort(ring, axis=0), np.sort(expected, axis=0))


def test_one_polygon_of_several_is_that_polygon() -> None:
    rings = [square_at(0.0, 0.0, 2.0), square_at(0.2, 0.0, 1.0)]
    one, alone = rp.WorldRegion.from_polygons([rings]), rp.WorldRegion.from_polygon(rings)
    assert one.area == pytest.approx(alone.area, rel=1e-12)
    assert all(np.allclose(np.sort(a, axis=0), np.sort(b, axis=0)) for a, b in zip(one.rings, alone.rings, strict=True))


@pytest.mark.parametrize(
    ("polygons", "message"),
    [
        (5, "polygons is a int; needed a list of polygons"),
        ([], "polygons is empty; needed at least one"),
        ([[square_at(0.0, 0.0, 1.0)], [square_at(3.0, 0.0, 1.0)[:2]]], "polygon 1: ring 0 has 2 distinct vertices"),
        ([[square_at(0.0, 0.0, 1.0), square_at(3.0, 0.0, 1.0)]], "polygon 0: "),
        ([[square_at(0.0, 0.0, 1.0)], [square_at(0.5, 0.5, 1.0)]], "crosses"),
        ([[square_at(0.0, 0.0, 2.0)], [square_at(0.0, 0.0, 1.0)]], "apart from one another"),
        (
            [[square_at(0.0, 0.0, 1.0)], [square_at(3.0, 0.0, 1.0) + np.array([0.0, 0.0, 0.5])]],
            r"polygon \d lies .* m off the common plane",
        ),
    ],
)
def test_polygons_that_are_no_region_are_refused(polygons: list[list[Array]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        rp.WorldRegion.from_polygons(polygons)


@pytest.mark.parametrize("seed", range(5))
def test_the_plane_withstands_a_fifth_of_outliers(seed: int) -> None:
    """Outliers all on one side and far out would tilt a least squares plane by tens of degrees."""
    rng = np.random.default_rng(seed)
    points = scan(seed, (0.02, 0.02), 0.002)
    outliers = rng.uniform([-1.0, -0.5, 0.05], [1.0, 0.5, 2.0], (len(points) // 4, 3)) * [1.0, 1.0, 1.0]
    outliers[:, 2] += outliers[:, 0].clip(0.0)
    rotation, offset = any_frame(seed)
    region = rp.WorldRegion.from_points(rng.permutation(np.vstack([points, outliers])) @ rotation.T + offset)
    tilt = np.degrees(np.arccos(np.clip(abs(region.normal @ rotation[:, 2]), 0.0, 1.0)))
    assert tilt < 0.1
    assert abs((region.rings[0][0] - offset) @ rotation[:, 2]) < 0.002


@pytest.mark.parametrize("spacing", [(0.02, 0.02), (0.004, 0.08), (0.1, 0.005)])
def test_the_radius_bridges_scan_lines(spacing: tuple[float, float]) -> None:
    """Points twenty times as far apart across the scan lines as along them are still one region with its hole."""
    region = rp.WorldRegion.from_points(scan(0, spacing, 1e-4))
    widest = float(np.max(spacing))
    assert len(region.rings) == 2
    assert region.area == pytest.approx(2.0 - 0.4, abs=(2.0 * 3.0 + 2.6) * widest)
    assert np.allclose(np.ptp(region.rings[0], axis=0), [2.0, 1.0, 0.0], atol=1.1 * widest)


def test_a_given_radius_is_used() -> None:
    points = scan(0, (0.02, 0.02), 0.0)
    assert len(rp.WorldRegion.from_points(points, radius_m=0.02).rings) == 2
    assert len(rp.WorldRegion.from_points(points, radius_m=np.inf).rings) == 1
    with pytest.raises(ValueError, match=r"radius .* keeps none of the triangles; it needs to be at least"):
        rp.WorldRegion.from_points(points, radius_m=1e-3)


def test_points_do_not_depend_on_order_or_frame() -> None:
    points = scan(1, (0.02, 0.03), 0.001)
    rotation, offset = any_frame(5)
    expected = rp.WorldRegion.from_points(points)
    region = rp.WorldRegion.from_points(np.random.default_rng(0).permutation(points) @ rotation.T + offset)
    assert region.area == pytest.approx(expected.area, rel=1e-2)
    assert abs(region.normal @ rotation @ expected.normal) == pytest.approx(1.0, abs=1e-6)


def bent_sheet() -> trimesh.Trimesh:
    """A patch of a cylinder of radius 2 m, 1 m high."""
    angle, height = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(0.0, 1.0, 6))
    vertices = np.column_stack([2.0 * np.sin(angle).ravel(), height.ravel(), 2.0 * np.cos(angle).ravel()])
    corner = (np.arange(5)[:, None] * 9 + np.arange(8)).ravel()
    faces = np.vstack(
        [np.column_stack([corner, corner + 1, corner + 10]), np.column_stack([corner, corner + 10, corner + 9])]
    )
    return trimesh.Trimesh(vertices, faces, process=False)


def test_a_flat_trimesh_is_a_planar_region() -> None:
    outline = [disc(1.0, (0.0, 0.0), 20), disc(0.4, (0.1, 0.0), 20)]
    vertices, faces = kernels.triangulate(outline)
    rotation, offset = any_frame(7)
    mesh = trimesh.Trimesh(np.column_stack([vertices, np.zeros(len(vertices))]) @ rotation.T + offset, faces)
    region = rp.WorldRegion.from_mesh(mesh)
    assert region.is_planar
    assert len(region.rings) == 2
    assert region.area == pytest.approx(area(outline), rel=1e-12)


def test_a_bent_trimesh_keeps_its_boundary() -> None:
    region = rp.WorldRegion.from_mesh(bent_sheet())
    assert not region.is_planar
    assert len(region.rings) == 1 and len(region.rings[0]) == 2 * (8 + 5)
    assert region.area == pytest.approx(4.0 * np.sin(0.4), rel=1e-9)


def test_world_regions_come_back_from_a_pickle() -> None:
    planar = rp.WorldRegion.from_polygon([disc_in_space(1.0), disc_in_space(0.3)])
    for region in (planar, rp.WorldRegion.from_mesh(bent_sheet())):
        copy = pickle.loads(pickle.dumps(region))
        assert copy.is_planar == region.is_planar
        assert copy.area == pytest.approx(region.area, rel=1e-14)
        assert all(np.allclose(a, b, rtol=0.0, atol=1e-14) for a, b in zip(copy.rings, region.rings, strict=True))


def disc_in_space(radius: float) -> Array:
    """A circle in a plane that is not one of the axes'."""
    rotation, offset = any_frame(11)
    flat = disc(radius, (0.0, 0.0), 40)
    return np.column_stack([flat, np.zeros(len(flat))]) @ rotation.T + offset


def test_a_closed_mesh_and_flipped_triangles_are_refused() -> None:
    with pytest.raises(ValueError, match="a closed surface"):
        rp.WorldRegion.from_mesh(trimesh.creation.box())
    sheet = bent_sheet()
    sheet.faces[3] = sheet.faces[3][::-1]
    with pytest.raises(ValueError, match=r"the mesh has edge .* in the same direction; it needs triangles"):
        rp.WorldRegion.from_mesh(sheet)
