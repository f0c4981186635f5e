"""Integrals of the published equations' functions over pixels, triangles and spherical triangles.

"The paper" is R. Frohlich, L. Tamas, Z. Kato, "Absolute Pose Estimation of Central Cameras Using Planar Regions", IEEE
TPAMI 2019. All moments here are vectors in the order of `PLANE_EXPONENTS` or `SPHERE_EXPONENTS`.
"""

from __future__ import annotations

from itertools import product
from math import factorial

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

PLANE_EXPONENTS = tuple((i, j) for i, j in product(range(4), repeat=2) if i + j <= 4)
"""Powers of x and y, each up to 3 and together up to 4: 13 equations a region (paper section 2.2, eq. 15)."""

SPHERE_EXPONENTS = tuple((i, j, k) for i, j, k in product(range(3), repeat=3) if i + j + k <= 3)
"""Powers of x, y and z, each up to 2 and together up to 3: 17 equations a region (paper section 2.1, eq. 8)."""


def planar_monomials(points: Array) -> Array:
    """(13, n) values of `x^i y^j` at (n, 2) normalized points."""
    x, y = _powers(points, 3)
    return np.array([x[i] * y[j] for i, j in PLANE_EXPONENTS])


def spherical_monomials(bearings: Array) -> Array:
    """(17, n) values of `x^i y^j z^k` at (n, 3) bearings."""
    x, y, z = _powers(bearings, 2)
    return np.array([x[i] * y[j] * z[k] for i, j, k in SPHERE_EXPONENTS])


def _powers(points: Array, most: int) -> list[list[Array]]:
    """Powers 0 to `most` of each coordinate, by multiplication."""
    powers = []
    for values in points.T:
        column = [np.ones_like(values)]
        for _ in range(most):
            column.append(column[-1] * values)
        powers.append(column)
    return powers


def triangle_moments(triangles: Array) -> Array:
    """(13,) exact integrals over (k, 3, 2) triangles of the normalized plane; a flipped triangle counts negative.

    `2 area i! j! / (i + j + 2)! S_ij`, S by the recursion over the corners (paper eq. 16 to 24).
    """
    a, b, c = triangles[:, 0].T, triangles[:, 1].T, triangles[:, 2].T
    twice_area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    sums = _corner_recursion(a, _corner_recursion(b, _corner_recursion(c, {})))
    shares = [factorial(i) * factorial(j) / factorial(i + j + 2) for i, j in PLANE_EXPONENTS]
    return np.array([share * (twice_area @ sums[e]) for share, e in zip(shares, PLANE_EXPONENTS, strict=True)])


def _corner_recursion(corner: Array, inner: dict[tuple[int, int], Array]) -> dict[tuple[int, int], Array]:
    """`S_ij = x S_(i-1,j) + y S_(i,j-1) + D_ij` at one corner (2, k), with D of the corners after it (eq. 22 to 24)."""
    sums: dict[tuple[int, int], Array] = {}
    for i, j in PLANE_EXPONENTS:
        if i == j == 0:
            sums[i, j] = np.ones_like(corner[0])
            continue
        value = inner.get((i, j), np.zeros_like(corner[0]))
        if i:
            value = value + corner[0] * sums[i - 1, j]
        if j:
            value = value + corner[1] * sums[i, j - 1]
        sums[i, j] = value
    return sums


def spherical_triangle_moments(triangles: Array, subdivision: int = 1) -> Array:
    """(17,) integrals over (k, 3, 3) triangles of bearings by a quadrature rule (paper eq. 9, 10).

    The centroid rule of each of the `subdivision^2` parts of each triangle: its value there times its spherical area.
    A triangle that turns clockwise seen from outside counts negative.
    """
    parts = triangles if subdivision == 1 else subdivided(triangles, subdivision)
    centroids = parts.sum(axis=1)
    centroids /= np.linalg.norm(centroids, axis=1, keepdims=True)
    moments: Array = spherical_monomials(centroids) @ spherical_areas(parts)
    return moments


def subdivided(triangles: Array, parts: int) -> Array:
    """(k parts^2, 3, 3) triangles of bearings: an even net of each flat triangle, pushed out to the sphere."""
    corners = []
    for i, j in product(range(parts), repeat=2):
        if i + j < parts:
            corners.append([(i, j), (i + 1, j), (i, j + 1)])
        if i + j < parts - 1:
            corners.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    second, third = np.moveaxis(np.array(corners) / parts, -1, 0)
    weights = np.stack([1.0 - second - third, second, third], axis=-1)
    nodes: Array = np.einsum("pcw,kwx->kpcx", weights, triangles).reshape(-1, 3, 3)
    bearings: Array = nodes / np.linalg.norm(nodes, axis=2, keepdims=True)
    return bearings


def spherical_areas(triangles: Array) -> Array:
    """(k,) signed areas, steradians, of (k, 3, 3) triangles of bearings (Van Oosterom and Strackee 1983)."""
    a, b, c = (triangles[:, corner].T for corner in range(3))
    triple = (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    dots = (a * b).sum(axis=0) + (b * c).sum(axis=0) + (c * a).sum(axis=0)
    areas: Array = 2.0 * np.arctan2(triple, 1.0 + dots)
    return areas
