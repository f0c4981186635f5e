"""Planes of a cloud whose borders a photo confirms at a pose, as regions of both (docs/math.md, section 20)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, check_wanted, part, with_progress
from regionpose.regions.image import ImageRegion
from regionpose.regions.outline import sparse_sampling_handler
from regionpose.regions.world import WorldRegion
from regionpose.scene.border_fit import BorderFit, fitted, joint_log_odds
from regionpose.scene.plane_borders import Outline, View, outlines
from regionpose.segment.planes import find_planes
from regionpose.solve.estimate import PoseError, PoseEstimate
from regionpose.solve.frame import Frame
from regionpose.solve.options import Solver
from regionpose.solve.prior import Prior
from regionpose.solve.rig import rig_pose
from regionpose.solve.single import estimate_pose
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import Array, KeptArrays, finite_array

Indices = NDArray[np.intp]

LEAST_LOG_ODDS = float(np.log(9.0))
"""Logarithm of the odds from which on a border is confirmed: a convention, 90 %."""

LEAST_HELD = 0.02
"""Least that shown sides determine of a border's place and size (`BorderFit.held`): a convention, a twenty-fifth of a
circle that is shown all around. Two sides that meet in a corner determine less: size and place are not separable
then."""

LEAST_SHOWN = 0.1
"""Fraction of a border that is shown at the least."""

PARALLEL_SINE = 0.35
"""Sine of the angle between two sides below which they have no corner: 20 degrees."""


@dataclass(frozen=True, eq=False, repr=False)
class ConfirmedRegion(KeptArrays):
    """A plane of a cloud whose border a photo confirms at a pose.

    Parameters
    ----------
    name : str
        `plane 1` and so on, that of the most points first.
    image : ImageRegion
        The border, its shown sides moved onto the photo's edges; the others are hidden edges.
    world : WorldRegion
        Of the plane's points, with what the scan shows beside them.
    indices : (n,) array of int
        Of these points, ascending.
    log_odds : float
        Logarithm of the odds that the border lies on edges of the photo by more than chance.
    edge_fraction : float
        Fraction of the border where the photo shows an edge.
    """

    name: str
    image: ImageRegion
    world: WorldRegion
    indices: Indices
    log_odds: float
    edge_fraction: float

    def __repr__(self) -> str:
        """Its name, and how well it is confirmed."""
        has_edge = f"points={len(self.indices)}, log_odds={self.log_odds:.1f}, edge_fraction={self.edge_fraction:.2f}"
        return f"ConfirmedRegion({self.name!r}, {has_edge})"


@dataclass(frozen=True, eq=False, repr=False)
class ConfirmedRegions:
    """The planes of a cloud whose borders a photo confirms at a pose.

    Parameters
    ----------
    regions : tuple of ConfirmedRegion
        The confirmed ones.
    compared : int
        How many borders of planes were compared with the photo.
    log_odds : float
        Logarithm of the odds that all of these together lie on edges of the photo by more than chance; 0 where none was
        compared.
    """

    regions: tuple[ConfirmedRegion, ...]
    compared: int
    log_odds: float

    def __repr__(self) -> str:
        """How many are confirmed."""
        return f"ConfirmedRegions({len(self.regions)} of {self.compared}, log_odds={self.log_odds:.1f})"


@checked_arguments
def confirmed_regions(
    camera: Camera,
    frame: Frame,
    pose: Pose,
    *,
    sensor_origin: ArrayLike | None = None,
    planes: Sequence[ArrayLike] | None = None,
    progress: Progress | None = None,
) -> ConfirmedRegions:
    """The planes of a frame's cloud whose borders its photo confirms at a pose, as regions of both.

    A plane's border is projected with the pose. Where the surface ends there, by the points beside it, its sides are
    moved onto edges of the photo, by no more than the gap between points. The border is confirmed if it fits these
    better than at nine of ten turned poses and the shown sides determine its place and size (docs/math.md, section 20).

    Parameters
    ----------
    camera : Camera
        That took the photo.
    frame : Frame
        With `image` and `points`.
    pose : Pose
        `camera_from_world`, however it was found.
    sensor_origin : (3,) array, optional
        Where the scanner stood, meters; without it less is known of where planes end.
    planes : sequence of (n,) arrays of int, optional
        Indices of the planes' points, as of `find_planes`; by default those of the points in view.
    progress : callable, optional
        Called with the fraction of the work that is done, 0 to 1.

    Returns
    -------
    ConfirmedRegions

    Raises
    ------
    ValueError
        For a frame without `image` or `points`, for arrays of another shape, for an image of another size than the
        camera's, and for indices that are no points of the cloud.
    """
    photo_cloud = PhotoCloud.of(camera, frame)
    return confirmed_of(photo_cloud, pose, sensor_origin=sensor_origin, planes=planes, progress=progress)


def confirmed_of(
    photo_cloud: PhotoCloud,
    pose: Pose,
    *,
    sensor_origin: ArrayLike | None = None,
    planes: Sequence[ArrayLike] | None = None,
    progress: Progress | None = None,
) -> ConfirmedRegions:
    """As `confirmed_regions`, of a frame that was checked before."""
    scanner = None if sensor_origin is None else finite_array(sensor_origin, "sensor_origin", (3,))
    points = photo_cloud.points
    view, report = View(photo_cloud, pose, scanner), progress or (lambda fraction: None)
    if planes is None:
        near = points[view.numbers]
        found = find_planes(near, progress=part(progress, 0.0, 0.8)) if len(near) >= 3 else []
        members = [view.numbers[indices] for indices in found]
    else:
        members = [_checked_indices(indices, number, len(points)) for number, indices in enumerate(planes)]
    surfaces = outlines(points, members, scanner)
    pairs = [pair for pair in _fits(view, surfaces) if pair is not None]
    report(0.9)
    confirmed: list[ConfirmedRegion] = []
    for surface, fit in pairs:
        region = _region(view, surface, fit, scanner, f"plane {len(confirmed) + 1}")
        confirmed += [] if region is None else [region]
    report(1.0)
    return ConfirmedRegions(tuple(confirmed), len(pairs), joint_log_odds([fit for _, fit in pairs]))


def region_pose(
    camera: Camera,
    frames: Sequence[ConfirmedRegions],
    prior: Prior | None = None,
    solver: Solver | None = None,
) -> PoseEstimate | None:
    """The pose by the confirmed regions of one or several frames of a rig alone, as of `estimate_pose`; None where
    there are none, or no pose shows them all.
    """
    given = [
        Frame([each.image for each in found.regions], [each.world for each in found.regions], name=f"{number}")
        for number, found in enumerate(frames, start=1)
        if found.regions
    ]
    if not given:
        return None
    try:
        if len(given) == 1:
            return estimate_pose(camera, given[0].image_regions, given[0].world_regions, prior=prior, solver=solver)
        return rig_pose(camera, given, prior, solver)
    except PoseError:
        return None


def pose_distance(one: PoseEstimate, other: PoseEstimate) -> float:
    """How far apart two estimates are, in standard deviations of both together (Mahalanobis distance of six
    parameters); NaN where these are not finite.
    """
    covariance = one.covariance + other.covariance
    if not np.isfinite(covariance).all():
        return float("nan")
    way = one.pose.local_coordinates(other.pose)
    return float(np.sqrt(way @ np.linalg.solve(covariance, way)))


@dataclass(frozen=True, eq=False)
class RegionCheck:
    """A pose by edges, checked by the planes that photos confirm at it.

    `frames`: of each frame, None of one without a cloud. `estimate`: the pose by these regions alone, None without.
    `distance`: of both, in standard deviations, NaN without.
    """

    frames: tuple[ConfirmedRegions | None, ...]
    estimate: PoseEstimate | None
    distance: float

    @property
    def names(self) -> tuple[str, ...]:
        """The names of all regions, frame after frame."""
        return tuple(region.name for found in self.frames if found is not None for region in found.regions)

    def of_frame(self, index: int) -> RegionCheck:
        """What one frame shows; the pose is that of all."""
        return replace(self, frames=(self.frames[index],))


def region_check(
    camera: Camera,
    frames: Sequence[PhotoCloud | None],
    found: PoseEstimate,
    *,
    sensor_origin: ArrayLike | None = None,
    solver: Solver | None = None,
    progress: Progress | None = None,
) -> RegionCheck:
    """The check of a pose by edges; `frames` and `sensor_origin` as of `calibrate`, which found it."""
    planes = tuple(
        None if frame is None else confirmed_of(frame, found.pose, sensor_origin=sensor_origin, progress=fraction)
        for frame, fraction in with_progress(frames, progress)
    )
    prior = None if found.diagnostics.edges is None else found.diagnostics.edges.prior
    estimate = region_pose(camera, [own for own in planes if own is not None], prior, solver)
    distance = float("nan") if estimate is None else pose_distance(estimate, found)
    return RegionCheck(planes, estimate, distance)


def _checked_indices(indices: ArrayLike, number: int, count: int) -> Indices:
    given = np.asarray(indices)
    if given.ndim != 1 or given.dtype.kind not in "iu":
        raise ValueError(f"planes {number} is {given.dtype} of shape {given.shape}; needed indices (n,)")
    if len(given) and (given.min() < 0 or given.max() >= count):
        raise ValueError(f"planes {number} has indices {given.min()} to {given.max()}; needed 0 to {count - 1}")
    return np.unique(given).astype(np.intp)


def _fits(view: View, surfaces: Sequence[Outline]) -> list[tuple[Outline, BorderFit] | None]:
    """Each surface with the fit of its border, None of those that the photo shows too little of."""
    found: list[tuple[Outline, BorderFit] | None] = []
    for index, surface in enumerate(surfaces):
        check_wanted()
        border = view.border(surface, [*surfaces[:index], *surfaces[index + 1 :]])
        fit = None if border is None else fitted(view.frame.photo, view.frame.camera, border, view.gap_px)
        found.append(None if fit is None else (surface, fit))
    return found


def _region(view: View, surface: Outline, fit: BorderFit, scanner: Array | None, name: str) -> ConfirmedRegion | None:
    """The region of a border that is confirmed; None of others."""
    if fit.log_odds < LEAST_LOG_ODDS or fit.least_information < LEAST_HELD or fit.edge_fraction < LEAST_SHOWN:
        return None
    try:
        image = _image_region(view, fit)
        with sparse_sampling_handler(lambda _: None):
            world = WorldRegion.from_scan(view.frame.points, surface.members, sensor_origin=scanner)
    except ValueError:
        # Sides that cross once they are moved, or points that show no outline.
        return None
    return ConfirmedRegion(name, image, world, surface.members, fit.log_odds, fit.edge_fraction)


def _image_region(view: View, fit: BorderFit) -> ImageRegion:
    """The border with its shown sides on the photo's edges; ValueError where they cross."""
    photo, border, has_edge = view.frame.photo, fit.border, fit.has_edge
    ring, steps = border.ring, np.roll(border.ring, -1, axis=0) - border.ring
    normals = np.column_stack([steps[:, 1], -steps[:, 0]]) / np.linalg.norm(steps, axis=1)[:, None]
    offsets = np.where(has_edge[:, None], fit.offsets, 0.0)
    starts, ends = ring + offsets[:, :1] * normals, ring + steps + offsets[:, 1:] * normals
    vertices = np.array(
        [
            _corner(starts[side - 1], ends[side - 1], starts[side], ends[side])
            if has_edge[side - 1] and has_edge[side]
            else ends[side - 1]
            if has_edge[side - 1]
            else starts[side]
            for side in range(len(ring))
        ]
    )
    last = np.array(photo.luminance.shape[::-1]) - 0.5
    pixels = photo.pixels(np.clip(vertices, -0.5, last))
    # The sides of a panorama are no border of it.
    is_hidden = ~has_edge if view.frame.camera.period is not None else ~(has_edge | border.is_cut)
    return ImageRegion.from_polygon(pixels, hidden_edges=np.flatnonzero(is_hidden).tolist())


def _corner(start: Array, end: Array, following_start: Array, following_end: Array) -> Array:
    """Where two sides that follow one another meet; the middle between their ends where they are nearly parallel, or
    meet far from these.
    """
    one, other, between = end - start, following_end - following_start, following_start - start
    sine = float(one[0] * other[1] - one[1] * other[0])
    middle = np.asarray(0.5 * (end + following_start))
    if abs(sine) < PARALLEL_SINE * float(np.linalg.norm(one) * np.linalg.norm(other)):
        return middle
    corner = start + float(between[0] * other[1] - between[1] * other[0]) / sine * one
    near = 3.0 * float(np.linalg.norm(end - following_start)) + 1.0
    return corner if np.linalg.norm(corner - middle) < near else middle
