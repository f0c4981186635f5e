"""Image sides of regions whose corners somebody marked in the photo."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import shapely
from numpy.typing import NDArray
from regionpose.regions.image import ImageRegion

from benchmarks.synthetic.masks import project_region, to_camera
from benchmarks.synthetic.scenes import ScenePlacementError, SyntheticScene

Array = NDArray[np.float64]
Errors = Callable[[Array], Array]
"""Errors (n, 2) of corners (n, 2), pixels."""

OUTLINE_TOLERANCE_PX = 1e-4
"""Precision of outlines that are given without pixels, where the camera bends their edges."""

CAREFUL_CORNER_PX, ROUGH_CORNER_PX = 0.5, 2.0
"""Standard deviation of each coordinate of a marked corner, and of one that is marked carelessly."""

MARKED_TIMES = 50
"""Times that corners are marked until no edges cross: a user sees where they do."""


def by_hand(rng: np.random.Generator, sigma_px: float) -> Errors:
    """Errors of a hand, normally distributed."""
    return lambda corners: rng.normal(0.0, sigma_px, size=corners.shape)


def drawn_region(scene: SyntheticScene, rings: Sequence[Array], errors: Errors) -> ImageRegion:
    """The image of a world region, (n, 3) rings, by corners with these errors."""
    for _ in range(MARKED_TIMES):
        drawn = [_drawn(scene, ring, errors) for ring in rings]
        if all(shapely.LinearRing(ring).is_simple for ring in drawn):
            return ImageRegion.from_polygon(drawn)
    raise ScenePlacementError(f"edges crossed each of {MARKED_TIMES} times that the corners were marked")


def _drawn(scene: SyntheticScene, ring: Array, errors: Errors) -> Array:
    """(m, 2) pixels of a ring (n, 3) whose corners are off, and what lies between two as far as these."""
    (seen,) = project_region(scene.camera, scene.rotation, scene.translation, [ring], OUTLINE_TOLERANCE_PX)
    corners = scene.camera.project(to_camera(ring, scene.rotation, scene.translation))
    off = errors(corners)
    places = np.linalg.norm(seen[None] - corners[:, None], axis=2).argmin(axis=1)
    ends, along = np.append(places, len(seen)), np.arange(len(seen))
    closed = np.concatenate([off, off[:1]])
    moved: Array = seen + np.column_stack([np.interp(along, ends, closed[:, axis]) for axis in (0, 1)])
    return moved
