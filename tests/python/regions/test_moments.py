"""Moments of regions: against quadrature that shares nothing with the package, exact cases, and laws."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
import regionpose as rp
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from regionpose import _core, kernels
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

PLANAR_TOLERANCE = 1e-12
"""Of the largest moment: the boundary sums are exact up to some hundred roundings."""

SPHERICAL_TOLERANCE = 1e-9
"""Absolute, order 3: the package's Gauss rule on an arc of 60 deg; shorter arcs are far more exact."""

REFERENCE_TOLERANCE = 1e-12
"""Of the quadrature below, on the sphere, for edges that stay clear of the axis."""

LONGEST_ARC = np.radians(60.0)
MAX_ORDER = 8
OUTER_GAUSS, INNER_GAUSS = np.polynomial.legendre.leggauss(40), np.polynomial.legendre.leggauss(24)


def star(radii: Array, turn: float = 0.0) -> Array:
    """A ring around the origin with these radii at even angles, counter-clockwise."""
    angles = turn + 2.0 * np.pi * np.arange(len(radii)) / len(radii)
    return np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def planar_quadrature(rings: list[Array], order: int) -> Array:
    """Moments of oriented rings by signed triangles from one apex, each by a product Gauss rule."""
    nodes, weights = np.polynomial.legendre.leggauss(order // 2 + 2)
    s, t = np.meshgrid(0.5 + 0.5 * nodes, 0.5 + 0.5 * nodes)
    weight = 0.25 * np.outer(weights, weights) * t
    moments, apex = np.zeros((order + 1, order + 1)), rings[0].mean(axis=0)
    for ring in rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            points = apex + t[..., None] * ((a - apex) * (1.0 - s[..., None]) + (b - apex) * s[..., None])
            area = (a - apex)[0] * (b - apex)[1] - (a - apex)[1] * (b - apex)[0]
            for i, j in product(range(order + 1), repeat=2):
                if i + j <= order:
                    moments[i, j] += area * np.sum(weight * points[..., 0] ** i * points[..., 1] ** j)
    return moments


def spherical_quadrature(rings: list[Array], order: int) -> Array:
    """Moments of oriented rings around the z axis, in azimuth and polar angle up to each arc's `tan(theta)`."""
    moments = np.zeros((order + 1,) * 3)
    for ring in rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            start = np.arctan2(a[1], a[0])
            span = (np.arctan2(b[1], b[0]) - start + np.pi) % (2.0 * np.pi) - np.pi
            normal = np.cross(a, b)
            azimuth = start + 0.5 * span * (1.0 + OUTER_GAUSS[0])
            limit = np.arctan2(abs(normal[2]), abs(normal[0] * np.cos(azimuth) + normal[1] * np.sin(azimuth)))
            theta = 0.5 * limit[:, None] * (1.0 + INNER_GAUSS[0])
            element = 0.25 * span * np.outer(OUTER_GAUSS[1] * limit, INNER_GAUSS[1]) * np.sin(theta)
            bearing = np.sin(theta) * np.cos(azimuth)[:, None], np.sin(theta) * np.sin(azimuth)[:, None], np.cos(theta)
            for exponents in exponents_to(order):
                moments[exponents] += np.sum(
                    element * np.prod([r**e for r, e in zip(bearing, exponents, strict=True)], 0)
                )
    return moments


def exponents_to(order: int) -> list[tuple[int, int, int]]:
    """All (l, m, n) up to an order."""
    every = product(range(order + 1), repeat=3)
    return [(a, b, c) for a, b, c in every if a + b + c <= order]


def longest_arc(ring: Array) -> float:
    """Longest angle between neighbors, radians."""
    return float(np.arccos(np.clip((ring * np.roll(ring, -1, axis=0)).sum(axis=1), -1.0, 1.0)).max())


def cap(angles: Array, turn: float = 0.0) -> Array:
    """A ring of bearings around z at these polar angles, counter-clockwise seen from outside."""
    flat = star(np.sin(angles), turn)
    return np.column_stack([flat, np.cos(angles)])


@st.composite
def planar_regions(draw: st.DrawFn) -> list[Array]:
    """An outer ring, 0 to 2 holes of their own side by side, and sometimes a second part; oriented."""
    radii = draw(st.lists(st.floats(1.0, 3.0), min_size=3, max_size=24))
    scale, turn = 10.0 ** draw(st.floats(-3.0, 3.0)), draw(st.floats(0.0, 6.0))
    rings = [star(np.array(radii), turn)]
    for center in [(-0.2, 0.0), (0.2, 0.0)][: draw(st.integers(0, 2))]:
        hole = draw(st.lists(st.floats(0.05, 0.15), min_size=3, max_size=8))
        rings.append(star(np.array(hole))[::-1] + center)
    if draw(st.booleans()):
        part = star(np.array(draw(st.lists(st.floats(0.5, 1.0), min_size=3, max_size=9))))
        rings.append(part + np.array([5.0, 1.0]))
    offset = np.array([draw(st.floats(-5.0, 5.0)), draw(st.floats(-5.0, 5.0))])
    return [scale * (ring + offset) for ring in rings]


def rewritten(rings: list[Array], seed: int) -> list[Array]:
    """The same region: rings in another order, each from another vertex on, perhaps all turning the other way."""
    rng = np.random.default_rng(seed)
    turn = int(rng.choice([-1, 1]))
    return [np.roll(rings[k], rng.integers(len(rings[k])), axis=0)[::turn] for k in rng.permutation(len(rings))]


@settings(max_examples=60, deadline=None)
@given(planar_regions(), st.integers(0, MAX_ORDER))
def test_planar_moments_are_the_quadratures(rings: list[Array], order: int) -> None:
    expected = planar_quadrature(rings, order)
    found = kernels.planar_moments(rings, order)
    for degree in range(order + 1):
        i = np.arange(degree + 1)
        largest = np.abs(expected[i, degree - i]).max() + rings_size(rings) ** (degree + 2)
        assert np.abs((found - expected)[i, degree - i]).max() <= PLANAR_TOLERANCE * largest


def rings_size(rings: list[Array]) -> float:
    """Largest coordinate: moments of odd order may cancel to nothing."""
    return float(max(np.abs(ring).max() for ring in rings))


@settings(max_examples=40, deadline=None)
@given(planar_regions(), st.integers(0, 100))
def test_planar_moments_do_not_depend_on_how_the_rings_are_written(rings: list[Array], seed: int) -> None:
    expected, found = kernels.planar_moments(rings, 4), kernels.planar_moments(rewritten(rings, seed), 4)
    size = rings_size(rings)
    scale = size ** (2.0 + np.add.outer(np.arange(5), np.arange(5)))
    assert (np.abs(found - expected) <= PLANAR_TOLERANCE * scale).all()
    closed = [np.vstack([ring, ring[:1]]) for ring in rings]
    assert (np.abs(kernels.planar_moments(closed, 4) - expected) <= PLANAR_TOLERANCE * scale).all()


def test_the_unit_square_has_reciprocals() -> None:
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    i, j = np.indices((9, 9))
    expected = np.where(i + j <= 8, 1.0 / ((i + 1.0) * (j + 1.0)), 0.0)
    assert np.allclose(kernels.planar_moments([square], 8), expected, rtol=1e-14, atol=0.0)


def test_a_ring_in_a_hole_is_a_region_again() -> None:
    square = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    moments = kernels.planar_moments([square, 3.0 * square, 2.0 * square], 2)
    assert moments[0, 0] == pytest.approx(36.0 - 16.0 + 4.0, rel=1e-14)
    assert moments[2, 0] == pytest.approx((81.0 - 16.0 + 1.0) * 4.0 / 3.0, rel=1e-14)


@settings(max_examples=60, deadline=None)
@given(
    st.floats(np.log10(0.001), np.log10(6.0)),
    st.lists(st.floats(0.9, 1.0), min_size=7, max_size=30),
    st.floats(0.0, 6.0),
    st.booleans(),
)
def test_spherical_moments_are_the_quadratures(
    log_solid_angle: float, shape: list[float], turn: float, hole: bool
) -> None:
    """A star around an axis anywhere on the sphere, 0.001 to 6 sr, sometimes with a hole half its size."""
    widest = np.arccos(1.0 - 10.0**log_solid_angle / (2.0 * np.pi))
    outer = cap(widest * np.array(shape), turn)
    rings = [outer, cap(0.5 * widest * np.array(shape), turn)[::-1]] if hole else [outer]
    assert longest_arc(outer) < LONGEST_ARC
    expected = spherical_quadrature(rings, 3)
    assert np.abs(kernels.spherical_moments(rings, 3) - expected).max() <= SPHERICAL_TOLERANCE
    rotation = Rotation.from_rotvec([turn, 1.0 - turn, 0.5 * turn]).as_matrix()
    turned = kernels.spherical_moments([ring @ rotation.T for ring in rings[::-1]], 1)
    assert turned[0, 0, 0] == pytest.approx(expected[0, 0, 0], abs=SPHERICAL_TOLERANCE)
    first = np.array([turned[1, 0, 0], turned[0, 1, 0], turned[0, 0, 1]])
    expected_first = np.array([expected[1, 0, 0], expected[0, 1, 0], expected[0, 0, 1]])
    assert np.abs(first - rotation @ expected_first).max() <= SPHERICAL_TOLERANCE


def test_spherical_moments_of_short_arcs_are_exact_to_order_8() -> None:
    """Three degrees an arc: what is left is rounding."""
    rings = [cap(0.6 + 0.1 * np.cos(3.0 * np.linspace(0.0, 2.0 * np.pi, 120, endpoint=False)))]
    assert np.abs(kernels.spherical_moments(rings, 8) - spherical_quadrature(rings, 8)).max() <= REFERENCE_TOLERANCE


def test_octants_make_up_the_sphere() -> None:
    """Eight triangles of right angles: together 4 pi, no first moments, and a third of it for each square."""
    total = np.zeros((4, 4, 4))
    for signs in product([-1.0, 1.0], repeat=3):
        octant = kernels.spherical_moments([np.diag(signs)], 3)
        assert octant[0, 0, 0] == pytest.approx(np.pi / 2.0, abs=1e-14)
        total += octant
    assert total[0, 0, 0] == pytest.approx(4.0 * np.pi, abs=1e-13)
    squares = [total[2, 0, 0], total[0, 2, 0], total[0, 0, 2]]
    assert np.allclose(squares, 4.0 * np.pi / 3.0, rtol=0.0, atol=1e-7)
    assert np.abs([total[1, 0, 0], total[0, 1, 0], total[0, 0, 1], total[1, 1, 1]]).max() < 1e-7


def test_squares_sum_to_the_solid_angle() -> None:
    ring = cap(np.array([0.3, 0.5, 0.4, 0.6, 0.5, 0.4, 0.3]))
    moments = kernels.spherical_moments([ring], 3)
    assert moments[2, 0, 0] + moments[0, 2, 0] + moments[0, 0, 2] == pytest.approx(moments[0, 0, 0], abs=1e-13)


def test_the_length_of_directions_does_not_matter() -> None:
    ring = cap(np.array([0.3, 0.5, 0.4, 0.6]))
    lengths = np.array([0.1, 7.0, 100.0, 1.0])[:, None]
    assert np.allclose(
        kernels.spherical_moments([ring * lengths], 3), kernels.spherical_moments([ring], 3), rtol=0.0, atol=1e-14
    )


@settings(max_examples=30, deadline=None)
@given(planar_regions(), st.integers(0, MAX_ORDER))
def test_a_mesh_has_the_moments_of_its_region(rings: list[Array], order: int) -> None:
    vertices, triangles = kernels.triangulate(rings)
    size = rings_size(rings)
    scale = size ** (2.0 + np.add.outer(np.arange(order + 1), np.arange(order + 1)))
    difference = _core.mesh_planar_moments(vertices, triangles, order) - kernels.planar_moments(rings, order)
    assert (np.abs(difference) <= 1e-11 * scale).all()


def test_a_flipped_triangle_counts_negative() -> None:
    vertices = [[0.0, 0.0], [2.0, 0.0], [0.0, 1.0], [2.0, 1.0]]
    both = _core.mesh_planar_moments(vertices, [[0, 1, 2], [1, 2, 3]], 1)
    assert both[0, 0] == pytest.approx(0.0, abs=1e-15)
    assert both[1, 0] == pytest.approx(2.0 / 3.0 - 4.0 / 3.0, rel=1e-14)


@pytest.mark.parametrize("shift", [0.0, 0.7])
def test_a_mesh_on_the_sphere_has_the_moments_of_its_region(shift: float) -> None:
    """The plane z = 2 seen from the origin, holes too; the quadrature falls with the sixth power of the pieces."""
    outline = [star(np.array([1.0, 1.3, 0.8, 1.1, 0.9])) + shift, 0.3 * star(np.ones(4)) + shift]
    vertices, triangles = kernels.triangulate(outline, max_area=0.05)
    bearings = [np.column_stack([ring, np.full(len(ring), 2.0)]) for ring in outline]
    expected = kernels.spherical_moments(bearings, 3)
    points = np.column_stack([vertices, np.full(len(vertices), 2.0)])
    coarse, fine = (
        np.abs(_core.mesh_spherical_moments(points, triangles, 3, subdivision=pieces) - expected).max()
        for pieces in (1, 4)
    )
    assert fine < 1e-10
    assert fine < coarse / 100.0


def test_pixels_have_the_moments_of_their_square() -> None:
    """A square of 40 x 40 pixels tiles exactly, its moments to the square of a pixel's size."""
    camera = rp.PinholeCamera(100.0, 100.0, 31.5, 31.5, width=64, height=64)
    mask = np.zeros((64, 64), dtype=bool)
    mask[10:50, 12:52] = True
    bearings, solid_angles = rp.ImageRegion.from_mask(mask).pixel_bearings(camera)
    corners = np.array([[11.5, 9.5], [51.5, 9.5], [51.5, 49.5], [11.5, 49.5]])
    expected = kernels.spherical_moments([camera.bearings(corners)], 3)
    found = _core.pixel_moments(bearings, solid_angles, 3)
    assert found[0, 0, 0] == pytest.approx(expected[0, 0, 0], rel=1e-12)
    assert np.abs(found - expected).max() < 100.0**-2 * expected[0, 0, 0]


@pytest.mark.parametrize(
    "function", [kernels.planar_moments, kernels.spherical_moments, kernels.triangulate, kernels.alpha_shape]
)
def test_help_says_what_comes_back(function: object) -> None:
    lines = (function.__doc__ or "").splitlines()
    assert len(lines) > 5
    assert "ValueError" in "".join(lines)
