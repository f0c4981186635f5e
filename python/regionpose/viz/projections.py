"""Outlines as a camera sees them at a pose: lines of pixels, split where they leave its view."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.world import WorldRegion
from regionpose.validation.arrays import Array

ARC_STEP = np.radians(0.2)
"""Radians between neighboring points on a projected edge: distortion bends it by far less than a pixel in between."""

MOST_PARTS = 2000
"""Parts of an edge at the most, which passes the camera closely then."""


def projected_lines(camera: Camera, region: WorldRegion, pose: Pose) -> list[Array]:
    """The parts of a region's outline that the camera sees at a pose, as open lines (m, 2) of pixels."""
    return visible_pieces(projected_rings(camera, region, pose))


def projected_rings(camera: Camera, region: WorldRegion, pose: Pose) -> list[Array]:
    """The rings of a region at a pose, (m, 2) each, pixels: closed, and NaN where the camera doesn't see them."""
    return repeated(camera, [_projected_ring(ring, camera, pose) for ring in region.rings])


def visible_pieces(rings: Sequence[Array]) -> list[Array]:
    """The runs of finite pixels of rings (n, 2), at least two long."""
    return [piece for ring in rings for piece in _pieces(ring)]


def repeated(camera: Camera, lines: list[Array]) -> list[Array]:
    """The lines, those that leave a panorama by one side again where they come in by the other."""
    if camera.period is None or camera.width is None:
        return lines
    copies = list(lines)
    for line in lines:
        left, right = float(np.nanmin(line[:, 0])), float(np.nanmax(line[:, 0]))
        for shift in (camera.period, -camera.period):
            if left + shift < camera.width and right + shift > 0.0:
                copies.append(line + np.array([shift, 0.0]))
    return copies


def _projected_ring(ring: Array, camera: Camera, pose: Pose) -> Array:
    """Pixels (m, 2) of a closed ring (n, 3), its edges split into short arcs, the first point repeated; NaN where not
    seen.
    """
    start = pose.transform(ring)
    end = np.roll(start, -1, axis=0)
    lengths = np.linalg.norm(end - start, axis=1)
    fraction = np.clip(-np.sum(start * (end - start), axis=1) / np.maximum(lengths**2, 1e-300), 0.0, 1.0)[:, None]
    closest = np.linalg.norm(start + fraction * (end - start), axis=1)
    parts = np.clip(np.ceil(lengths / np.maximum(closest * ARC_STEP, 1e-300)), 1, MOST_PARTS).astype(np.int64)
    edge = np.repeat(np.arange(len(ring)), parts)
    within = (np.arange(len(edge)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[edge]
    points = start[edge] + within[:, None] * (end - start)[edge]
    pixels = camera.project(np.concatenate([points, start[:1]]))
    if camera.period is not None:
        pixels[:, 0] = np.unwrap(pixels[:, 0], period=camera.period)
    return pixels


def _pieces(ring: Array) -> list[Array]:
    is_visible = np.isfinite(ring).all(axis=1)
    cuts = np.flatnonzero(np.diff(is_visible)) + 1
    return [piece for piece in np.split(ring, cuts) if len(piece) >= 2 and np.isfinite(piece[0]).all()]
