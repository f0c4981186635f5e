"""A spinning lidar before planar regions: range noise, beams of some width, wrong labels.

Each function returns a new object, changes none of its inputs, and draws only from the generator it is given.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from benchmarks.synthetic.masks import Array
from benchmarks.synthetic.planar import PlaneFrame, axes_across

# Range at which beams end that meet no region: a wall of a large yard.
BACKDROP_M = 30.0
# The scenes' "first" world frame has y down.
UP = (0.0, -1.0, 0.0)
# Directions around the axis that stand for a beam's cone, each for as much of it as the axis.
RING_PARTS = 6
# Length of a pulse: what a beam meets within it gives one return.
PULSE_M = 1.0


@dataclass(frozen=True)
class SpinningLidar:
    """A lidar that turns a fan of beams about its axis.

    `beams` elevations from `lowest_deg` to `highest_deg` above the plane of rotation, one column of points every
    `azimuth_step_deg`, ranges disturbed by a normal error of standard deviation `range_noise_m` along the beam. A beam
    is a cone of `divergence_mrad` across, which may meet two surfaces at once.
    """

    beams: int = 64
    lowest_deg: float = -25.0
    highest_deg: float = 25.0
    azimuth_step_deg: float = 0.2
    range_noise_m: float = 0.01
    divergence_mrad: float = 0.0

    def __post_init__(self) -> None:
        """Check that the beams and steps are positive."""
        for name in ("beams", "azimuth_step_deg"):
            if not getattr(self, name) > 0:
                raise ValueError(f"lidar {name} is {getattr(self, name)}; it must be positive")
        for name in ("range_noise_m", "divergence_mrad"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"lidar {name} is {getattr(self, name)}; it must be 0 or more")

    def below(self, elevation_deg: float) -> SpinningLidar:
        """The lidar without the beams above an elevation, at least its lowest one."""
        elevations = np.linspace(self.lowest_deg, self.highest_deg, self.beams)
        kept = max(int((elevations <= elevation_deg).sum()), 1)
        return replace(self, beams=kept, highest_deg=float(elevations[kept - 1]))

    def directions(self, up: ArrayLike, phase: float) -> Array:
        """(n, 3) unit beams of one turn about the axis `up`, the first column at angle `phase` (rad)."""
        axis = np.asarray(up, dtype=np.float64)
        axis = axis / np.linalg.norm(axis)
        forward, side = axes_across(axis).T
        elevation = np.radians(np.linspace(self.lowest_deg, self.highest_deg, self.beams))[:, None, None]
        azimuth = phase + np.radians(np.arange(0.0, 360.0, self.azimuth_step_deg))[None, :, None]
        flat = np.cos(azimuth) * forward + np.sin(azimuth) * side
        beams: Array = (np.cos(elevation) * flat + np.sin(elevation) * axis).reshape(-1, 3)
        return beams


def lidar_points(
    rings: Sequence[Array],
    position: ArrayLike,
    rng: np.random.Generator,
    lidar: SpinningLidar | None = None,
    up: ArrayLike = UP,
) -> Array:
    """(n, 3) world points where the beams of a lidar at `position` (3,) hit a planar region, with range noise, meters.

    The turn starts at a random angle. `up`: the axis of rotation in the world.
    """
    scan = lidar_scan([rings], position, rng, lidar, up)
    points: Array = scan.points[scan.regions == 0]
    return points


class LidarScan(NamedTuple):
    """Returns (n, 3) of one turn of a lidar at `origin` (3,), meters, and the region that each fell on.

    `regions` (n,) holds -1 for the backdrop.
    """

    points: Array
    regions: NDArray[np.intp]
    origin: Array


def lidar_scan(
    regions: Sequence[Sequence[Array]],
    position: ArrayLike,
    rng: np.random.Generator,
    lidar: SpinningLidar | None = None,
    up: ArrayLike = UP,
) -> LidarScan:
    """All returns of a lidar at `position` (3,) before planar regions, given by their (n, 3) rings, and a backdrop.

    A beam ends on the nearest region that it meets, or on a sphere of `BACKDROP_M` around the lidar. One that is a cone
    ends on what sends most of it back; what else it meets within a pulse's length of that moves the range to the mean.
    The turn starts at a random angle. `up`: the axis of rotation in the world.
    """
    sensor = SpinningLidar() if lidar is None else lidar
    origin = np.asarray(position, dtype=np.float64)
    beams = sensor.directions(up, rng.uniform(0.0, 2.0 * np.pi))
    parts = [_ends(regions, origin, part) for part in _footprint(beams, sensor.divergence_mrad)]
    ranges, hit = _mixed(np.array([part[0] for part in parts]), np.array([part[1] for part in parts]))
    noisy = ranges + rng.normal(0.0, sensor.range_noise_m, size=len(ranges))
    return LidarScan(origin + noisy[:, None] * beams, hit, origin)


def mislabeled(scan: LidarScan, region: int, share: float, rng: np.random.Generator) -> NDArray[np.intp]:
    """Indices of the returns (k,) that pass for a region's.

    A `share` of its own is left out, each by chance, and for each of these the return beside the region that is seen
    nearest to it is taken in.
    """
    own = np.flatnonzero(scan.regions == region)
    wrong = rng.random(len(own)) < share
    others = np.flatnonzero(scan.regions != region)
    if not wrong.any() or not len(others):
        return own
    beside = cKDTree(_sights(scan, others)).query(_sights(scan, own[wrong]))[1]
    return np.unique(np.concatenate([own[~wrong], others[beside]]))


def _sights(scan: LidarScan, returns: NDArray[np.intp]) -> Array:
    """Unit vectors (k, 3) from the lidar to some of its returns."""
    ways = scan.points[returns] - scan.origin
    sights: Array = ways / np.linalg.norm(ways, axis=1, keepdims=True)
    return sights


def _footprint(beams: Array, divergence_mrad: float) -> list[Array]:
    """The beams (n, 3), or directions that stand for equal parts of their cones: the axis, and six around it."""
    if divergence_mrad == 0.0:
        return [beams]
    # On the ring that halves the area of what lies around the inner seventh.
    radius = 0.5e-3 * divergence_mrad * np.sqrt((1.0 + 1.0 / (RING_PARTS + 1)) / 2.0)
    across = np.cross(beams, np.eye(3)[np.argmin(np.abs(beams).max(axis=0))])
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    other = np.cross(beams, across)
    turns = 2.0 * np.pi * np.arange(RING_PARTS) / RING_PARTS
    return [beams, *(beams + radius * (np.cos(turn) * across + np.sin(turn) * other) for turn in turns)]


def _ends(regions: Sequence[Sequence[Array]], origin: Array, beams: Array) -> tuple[Array, NDArray[np.intp]]:
    """Range (n,) at which each beam (n, 3) ends, and the region, -1 for the backdrop."""
    ranges = np.full(len(beams), BACKDROP_M)
    hit = np.full(len(beams), -1, dtype=np.intp)
    for index, rings in enumerate(regions):
        met = _ranges(rings, origin, beams)
        nearer = met < ranges
        ranges[nearer], hit[nearer] = met[nearer], index
    return ranges, hit


def _mixed(ranges: Array, hit: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Range and region (n,) of beams of which parts (p, n) end so far away, on these regions.

    What a surface sends back falls with the square of the range.
    """
    if len(ranges) == 1:
        return ranges[0], hit[0]
    power = ranges**-2
    most = np.argmax([((hit == own) * power).sum(axis=0) for own in hit], axis=0)
    each = np.arange(ranges.shape[1])
    power *= np.abs(ranges - ranges[most, each]) <= 0.5 * PULSE_M
    mean: Array = (ranges * power).sum(axis=0) / power.sum(axis=0)
    return mean, hit[most, each]


def _ranges(rings: Sequence[Array], origin: Array, beams: Array) -> Array:
    """Range (n,) at which each beam (n, 3) meets a planar region; infinite where it doesn't."""
    frame = PlaneFrame.of_region(rings)
    normal = np.cross(frame.axes[:, 0], frame.axes[:, 1])
    with np.errstate(divide="ignore"):
        ranges: Array = ((frame.origin - origin) @ normal) / (beams @ normal)
    ahead = np.flatnonzero(np.isfinite(ranges) & (ranges > 0.0))
    flat = frame.flat(origin + ranges[ahead, None] * beams[ahead])
    missed = np.ones(len(beams), dtype=np.bool_)
    missed[ahead] = ~shapely.contains_xy(frame.polygon(rings), flat[:, 0], flat[:, 1])
    ranges[missed] = np.inf
    return ranges
