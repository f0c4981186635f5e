"""The published algorithm as a careful reader of the paper would write it: the yardstick of every comparison.

R. Frohlich, L. Tamas, Z. Kato, "Absolute Pose Estimation of Central Cameras Using Planar Regions", IEEE TPAMI 2019: its
monomials as they are, its initial pose, Levenberg-Marquardt with finite differences, integrals over pixels or a mesh.

    pose, info = published.estimate(camera, image_regions, world_regions, system="plane", integration="mesh")

`python -m benchmarks.published` prints what it reaches beside `regionpose.estimate_pose` on the same scenes.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import regionpose as rp
from numpy.typing import ArrayLike
from regionpose.cameras import Camera

from benchmarks.published.moments import Array
from benchmarks.published.solve import Minimum, Pair, minimum_from
from benchmarks.published.start import Placement, Start, facing_placement, start_placement
from benchmarks.published.system import SCHEMES, Integration, SeenPlane, System, observed_moments, world_side
from benchmarks.synthetic.planar import region_centroid

__all__ = ["SCHEMES", "Info", "Integration", "Start", "System", "estimate"]


class Info(NamedTuple):
    """How an estimate came about: evaluations of the equations, wall time in seconds, the initial pose."""

    evaluations: int
    seconds: float
    converged: bool
    start: rp.Pose


def estimate(
    camera: Camera,
    image_regions: Sequence[rp.ImageRegion],
    world_regions: Sequence[Sequence[Array]],
    *,
    system: System,
    integration: Integration,
    up: ArrayLike | None = None,
    start: Start = "parallel",
) -> tuple[rp.Pose, Info]:
    """The pose `camera_from_world` and how it was found (paper sections 2.1, 2.2).

    `world_regions`: for each image region the (n, 3) rings of its 3D side in meters, the outer one first and
    counter-clockwise as the image shows it. The first region is solved alone, then all together. `up`: the world
    direction (3,) that is up in the image. `start`: the reading of the initial pose. ValueError for a scheme that isn't
    in `SCHEMES`.
    """
    if (system, integration) not in SCHEMES:
        raise ValueError(f"scheme is {(system, integration)}; needed one of {SCHEMES}")
    begin = time.perf_counter()
    pairs = [
        Pair(observed_moments(camera, image, system, integration), world_side(rings, system, integration))
        for image, rings in zip(image_regions, world_regions, strict=True)
    ]
    first = [np.asarray(ring, dtype=np.float64) for ring in world_regions[0]]
    facing = facing_placement(SeenPlane.of_rings(first), region_centroid(first), up)
    placement = start_placement(*pairs[0], facing, system, start)
    minima = _minima(pairs, placement, facing, system)
    info = Info(
        sum(minimum.evaluations for minimum in minima),
        time.perf_counter() - begin,
        minima[-1].converged,
        rp.Pose.from_parts(*placement.after(facing)),
    )
    return rp.Pose.from_parts(*minima[-1].placement.after(facing)), info


def _minima(pairs: Sequence[Pair], start: Placement, facing: Placement, system: System) -> list[Minimum]:
    """The minimum of the first region alone, and from there the one of all."""
    minima = [minimum_from(start, pairs[:1], facing, system)]
    if len(pairs) > 1:
        minima.append(minimum_from(minima[0].placement, pairs, facing, system))
    return minima
