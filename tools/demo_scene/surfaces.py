"""Flat textured surfaces and the rays that meet them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Texture = Callable[[Array, Array], Array]

NEAREST_HIT = 1e-6
"""Shortest distance of a hit in meters: a ray that starts on a surface doesn't meet that surface again."""

PARALLEL = 1e-12
"""Least |cosine| between a ray and a normal: below it the distance has no digit left in double precision."""


BALL_MARGIN = 1e-6
"""Added to a surface's ball, meters, so that rounding never hides a hit at its rim."""


@dataclass(frozen=True)
class Frame:
    """A plane's coordinates: the point `(u, v)` is `origin + u right + v up`, meters, seen upright from its front."""

    origin: Array
    right: Array
    up: Array

    @property
    def normal(self) -> Array:
        """Unit normal `right x up`, towards whoever sees the front."""
        return np.cross(self.right, self.up)

    def points(self, uv: Array) -> Array:
        """Courtyard points (n, 3) of plane points (n, 2)."""
        return np.asarray(self.origin + uv @ np.stack([self.right, self.up]))

    def lifted(self, distance: float) -> Frame:
        """The parallel frame `distance` meters before this one."""
        return Frame(self.origin + distance * self.normal, self.right, self.up)


@dataclass(frozen=True)
class Surface:
    """A polygon on a plane: closed rings (n, 2) in the frame's `(u, v)`, filled by the even-odd rule."""

    frame: Frame
    rings: tuple[Array, ...]
    texture: Texture
    region: str | None = None

    def distances(self, origins: Array, directions: Array) -> Array:
        """Distances (n,) from the origins (n, 3) at which the rays meet the polygon, inf where they don't, meters."""
        axes = np.stack([self.frame.normal, self.frame.right, self.frame.up], axis=1)
        rate, start = directions @ axes, (origins - self.frame.origin) @ axes
        reach = -start[:, 0] / np.where(np.abs(rate[:, 0]) < PARALLEL, PARALLEL, rate[:, 0])
        ahead = np.flatnonzero(reach > NEAREST_HIT)
        uv = start[ahead, 1:] + reach[ahead, None] * rate[ahead, 1:]
        met = ahead[inside(self.rings, uv)]
        distances = np.full(len(directions), np.inf)
        distances[met] = reach[met]
        return distances

    def ball(self) -> tuple[Array, float]:
        """Center (3,) and radius, meters, of a ball that holds the polygon."""
        corners = self.frame.points(np.concatenate(self.rings))
        center = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        return center, float(np.max(np.linalg.norm(corners - center, axis=1)))

    def coordinates(self, points: Array) -> Array:
        """Plane coordinates (n, 2) of courtyard points (n, 3)."""
        return np.asarray((points - self.frame.origin) @ np.stack([self.frame.right, self.frame.up], axis=1))


def inside(rings: Sequence[Array], uv: Array) -> NDArray[np.bool_]:
    """Whether each point (n, 2) lies inside the rings, by the even-odd rule."""
    corners = np.concatenate(rings)
    held = np.asarray(np.all((uv >= corners.min(axis=0)) & (uv <= corners.max(axis=0)), axis=1))
    u, v = uv[held].T
    odd = np.zeros(len(u), dtype=bool)
    for ring in rings:
        for (au, av), (bu, bv) in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            if av != bv:
                spans = (av > v) != (bv > v)
                odd ^= spans & (u < au + (v - av) * ((bu - au) / (bv - av)))
    held[held] = odd
    return held


def may_meet(surfaces: Sequence[Surface], origins: Array, directions: Array) -> NDArray[np.bool_]:
    """Whether each ray (n) passes through the ball around each surface (m): (m, n), before the exact test."""
    balls = [surface.ball() for surface in surfaces]
    centers, radii = np.array([center for center, _ in balls]), np.array([radius for _, radius in balls])[:, None]
    along = centers @ directions.T - np.sum(origins * directions, axis=1)
    squared = np.sum(centers**2, axis=1)[:, None] - 2.0 * centers @ origins.T + np.sum(origins**2, axis=1)
    return np.asarray((squared - along**2 <= (radii + BALL_MARGIN) ** 2) & (along > -radii))


def first_hits(surfaces: Sequence[Surface], origins: Array, directions: Array) -> tuple[NDArray[np.intp], Array]:
    """Index of the first surface on each ray (-1 for none) and its distance (inf for none), meters.

    `origins` is (3,) or (n, 3), `directions` (n, 3) unit.
    """
    starts = np.broadcast_to(origins, directions.shape)
    nearest = np.full(len(directions), np.inf)
    index = np.full(len(directions), -1, dtype=np.intp)
    for number, possible in enumerate(may_meet(surfaces, starts, directions)):
        tried = np.flatnonzero(possible)
        distances = surfaces[number].distances(starts[tried], directions[tried])
        closer = distances < nearest[tried]
        nearest[tried[closer]] = distances[closer]
        index[tried[closer]] = number
    return index, nearest


def are_blocked(surfaces: Sequence[Surface], origins: Array, direction: Array) -> NDArray[np.bool_]:
    """Whether anything stands between each origin (n, 3) and a light in the one direction (3,)."""
    directions = np.broadcast_to(direction, origins.shape)
    blocked = np.zeros(len(origins), dtype=bool)
    for number, possible in enumerate(may_meet(surfaces, origins, directions)):
        tried = np.flatnonzero(possible & ~blocked)
        blocked[tried] = np.isfinite(surfaces[number].distances(origins[tried], directions[tried]))
    return blocked
