"""From photos and clouds of one rig to the camera's pose, without regions or a start (docs/math.md, section 19)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose import _core
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.odds import COMMON, DECISIVE
from regionpose.alignment.pose_search import EdgeFrame, EdgeMode, log_mass, maxima, searched
from regionpose.arguments import checked_arguments
from regionpose.arrays import KeptArrays, finite_array
from regionpose.cameras.matrix import MatrixCamera
from regionpose.estimation.answer import Alternative, PoseError, PoseEstimate
from regionpose.estimation.options import Solver, checked_solver
from regionpose.estimation.prior import Prior
from regionpose.estimation.warning import PoseWarning
from regionpose.pose import Pose
from regionpose.progress import Progress, part

Array = NDArray[np.float64]

NEAR_SIGMA_M = 0.5
"""Standard deviation, along each axis, of the camera's place about the scanner where none is given: a convention, that
of both on one vehicle's roof or one tripod."""

SAME_DEG, SAME_M = 5.0, 1.0
"""Modes within so much of one another are one place: the confidence is that of the rotation within 5 degrees, and what
moves the camera by a meter moves what it shows at 10 m by as much."""

AMBIGUOUS_SHARE = 0.02
"""Probability of another place from which on a pose is ambiguous: a convention, less than the 3 % that a trusted pose
may lack."""

FOCAL_STEP = 0.01
"""Change of the logarithm of the focal lengths over which the pose's derivative is taken: a percent."""

OTHER_FOCAL = (-0.2, -0.1, -0.05, -0.03, 0.03, 0.05, 0.1, 0.2)
"""Logarithms of focal lengths over the given ones that are tried: a lens or a photo of another size is off by more than
a tenth, and what lies between two of them by less than what either explains."""

FOCAL_CONTRADICTED = DECISIVE - float(np.log(COMMON))
"""Logarithm of the odds from which on other focal lengths are believed in spite of the calibration's: 9 to 1, of what
is 81 to 1 for the calibration beforehand (docs/math.md, eq. 18.14)."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(KeptArrays):
    """A pose by the edges of photos and clouds, and what it was found by.

    Parameters
    ----------
    estimate : PoseEstimate
        The pose with its covariance, confidence, warnings and `alternatives`: other places, likeliest first. Without
        regions it has no overlap errors (NaN).
    prior : Prior
        What was searched: the given prior, and what was assumed where that says nothing.
    assumed : tuple of str
        Names of the prior's fields that were assumed.
    log_odds : float
        Logarithm of the odds that photo and cloud agree at the pose rather than by chance anywhere in the prior.
    lead : float
        The same of the pose over the likeliest other place; infinite where there is none.
    edges : int
        How many edges of the clouds the photos show.
    modes : tuple of EdgeMode
        All maxima of the posterior that were found, of the largest mass first.
    """

    estimate: PoseEstimate
    prior: Prior
    assumed: tuple[str, ...]
    log_odds: float
    lead: float
    edges: int
    modes: tuple[EdgeMode, ...]

    @property
    def pose(self) -> Pose:
        """The camera's, `camera_from_world`."""
        return self.estimate.pose

    def __repr__(self) -> str:
        """The estimate, and how far it leads."""
        return f"Calibration({self.estimate!r}, log_odds={self.log_odds:.1f}, lead={self.lead:.1f})"


@checked_arguments
def calibrate(
    frames: Sequence[SceneFrame],
    *,
    prior: Prior | None = None,
    sensor_origin: ArrayLike | None = None,
    solver: Solver | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """The pose of a camera in the frame of a scanner, from photos and clouds alone.

    The edges of the clouds, of depth and intensity, are laid on those of the photos at tens of thousands of poses that
    the prior allows; the likeliest are maximized, and how far the best leads chance and the others gives the
    confidence (docs/math.md, section 19). Frames of one rig share the pose, and their evidence adds up.

    Parameters
    ----------
    frames : sequence of SceneFrame
        Photos and clouds of one rig, the clouds in the scanner's frame.
    prior : Prior, optional
        Where the camera stands (`camera_near`), which direction is up, a rough pose. Without a place the camera is
        taken to be near the scanner, within 0.5 m along each axis; without `up` or `initial` with its deviations every
        rotation is searched.
    sensor_origin : (3,) array, optional
        Where the scanner stands in the clouds' frame, meters; by default where the prior has the camera, else (0, 0,
        0).
    solver : Solver, optional
        Its limits, and what a frame and the focal lengths are off by.
    progress : callable, optional
        Called with the share of the work that is done, 0 to 1.

    Returns
    -------
    Calibration

    Raises
    ------
    ValueError
        For no frames, and arrays of another shape.
    PoseError
        A ValueError, where clouds and photos show no edges in common that the prior allows.
    """
    if not frames:
        raise ValueError("frames is empty; needed at least one photo and cloud")
    options = checked_solver(solver)
    known, assumed, place = _assumed(prior, sensor_origin)
    local, edge_frames = known.about(place), [EdgeFrame(frame, place) for frame in frames]
    starts = [] if local.initial is None else [local.initial]
    modes = searched(edge_frames, local, starts, progress=part(progress, 0.0, 0.95))
    if not modes:
        raise PoseError(_nothing_shown(edge_frames))
    found = _judged(modes, edge_frames, local, assumed, options)
    if progress is not None:
        progress(1.0)
    return replace(_about(found, -place), prior=known)


def _nothing_shown(frames: Sequence[EdgeFrame]) -> str:
    edges, points = sum(frame.edge_count for frame in frames), sum(frame.point_count for frame in frames)
    found = f"{points} points have {edges} edges as seen from sensor_origin"
    found += ", none of which a photo shows at the likeliest poses of the prior" * bool(edges)
    return f"no pose was found: {found}; needed photos and dense clouds of one scene"


def _about(found: Calibration, origin: Array) -> Calibration:
    """The same for world points that are taken relative to an origin (3,), but for its prior."""
    alternatives = tuple(replace(other, pose=other.pose.about(origin)) for other in found.estimate.alternatives)
    estimate = replace(found.estimate, pose=found.pose.about(origin), alternatives=alternatives)
    return replace(found, estimate=estimate, modes=tuple(replace(m, pose=m.pose.about(origin)) for m in found.modes))


def _assumed(prior: Prior | None, sensor_origin: ArrayLike | None) -> tuple[Prior, tuple[str, ...], Array]:
    """The prior with what it needs to be searched, the names of what was assumed, and the scanner's place."""
    known, assumed = prior or Prior(), []
    has_pose = known.initial is not None and known.initial_rotation_sigma_deg is not None
    place = np.zeros(3)
    if sensor_origin is not None:
        place = finite_array(sensor_origin, "sensor_origin", (3,))
    elif known.camera_near is not None:
        place = np.asarray(known.camera_near, dtype=np.float64)
    elif has_pose and known.initial is not None:
        place = known.initial.camera_center
    if known.camera_near is None and not has_pose:
        known, assumed = replace(known, camera_near=place), ["camera_near"]
    if known.camera_near is not None and known.camera_near_sigma_m is None:
        known = replace(known, camera_near_sigma_m=NEAR_SIGMA_M)
        assumed.append("camera_near_sigma_m")
    return known, tuple(assumed), place


def _judged(
    modes: Sequence[EdgeMode], frames: Sequence[EdgeFrame], prior: Prior, assumed: tuple[str, ...], solver: Solver
) -> Calibration:
    """The first mode as an estimate, with the others as its alternatives."""
    places = _places(modes)
    best = places[0][0]
    masses = np.array([log_mass(place) for place in places])
    lead = float(masses[0] - masses[1]) if len(masses) > 1 else np.inf
    confidences = _confidences(masses)
    focal = _Focal.of(frames, best, prior)
    shift = focal.shift
    pixel = float(np.mean([frame.pixel_angle_rad for frame in frames]))
    own = _covariance_of(places[0]) + _frame_covariance(solver, len(frames))
    own += solver.calibration_covariance(shift, pixel)
    estimate = PoseEstimate(
        pose=best.pose,
        covariance=own,
        confidence=float(confidences[0]) * _core.nearness(own),
        share=float(confidences[0]),
        overlap_error=np.nan,
        region_overlap_errors=np.empty(0),
        boundary_noise_px=np.nan,
        disturbed_share=None,
        alternatives=tuple(
            _alternative(place[0], share) for place, share in zip(places[1:], confidences[1:], strict=True)
        ),
        warnings=(),
        converged=True,
        termination="a maximum of the posterior",
        evaluations=0,
        distance_m=float(np.median([frame.distance_m(best.pose) for frame in frames])),
        focal_shift=shift,
        pixel_angle_rad=pixel,
    )
    estimate = replace(estimate, warnings=(*focal.warnings, *_warnings(estimate, solver)))
    return Calibration(estimate, prior, assumed, float(masses[0]), lead, best.edges, tuple(modes))


def _places(modes: Sequence[EdgeMode]) -> list[list[EdgeMode]]:
    """The modes by the places that they belong to, each with its likeliest first."""
    places: list[list[EdgeMode]] = []
    for mode in modes:
        own = next((place for place in places if _is_same(place[0].pose, mode.pose)), None)
        if own is None:
            places.append([mode])
        else:
            own.append(mode)
    return sorted(places, key=log_mass, reverse=True)


def _is_same(pose: Pose, other: Pose) -> bool:
    turn = np.degrees((pose.rotation * other.rotation.inv()).magnitude())
    return bool(turn <= SAME_DEG and np.linalg.norm(pose.camera_center - other.camera_center) <= SAME_M)


def _confidences(masses: Array) -> Array:
    """Probabilities (n,) that places are right: of one another and of chance, which none of them leads."""
    return np.asarray(np.exp(masses - np.logaddexp(np.logaddexp.reduce(masses), 0.0)))


def _covariance_of(place: Sequence[EdgeMode]) -> Array:
    """The covariance (6, 6) about the first of a place's modes, each of which counts by its mass."""
    best = place[0]
    shares = np.exp(np.array([mode.log_mass for mode in place]) - log_mass(place))
    ways = [best.pose.increment_to(mode.pose) for mode in place]
    parts = zip(shares, place, ways, strict=True)
    return np.asarray(sum(share * (mode.covariance + np.outer(way, way)) for share, mode, way in parts))


def _frame_covariance(solver: Solver, frames: int) -> Array:
    """Covariance (6, 6) of the mean error of so many whole exposures."""
    sigma = np.repeat([np.radians(solver.frame_sigma_deg), solver.frame_sigma_m], 3)
    return np.diag(np.square(sigma)) / frames


class _Focal(NamedTuple):
    """What focal lengths do to a pose: its derivative (6,) by their logarithm, zero of a camera without them; the
    factor by which they would have to be longer for the likeliest pose, and by how much the logarithm of the mass is
    larger then.
    """

    shift: Array
    factor: float = 1.0
    gain: float = 0.0

    @classmethod
    def of(cls, frames: Sequence[EdgeFrame], best: EdgeMode, prior: Prior) -> _Focal:
        """That of the pose at a maximum, by other maxima near it."""
        if not all(isinstance(frame.camera, MatrixCamera) for frame in frames):
            return cls(np.zeros(6))
        density = _core.Density.of_prior(prior.core)

        def maximum(log_focal: float, start: Pose) -> EdgeMode | None:
            modes = maxima([frame.zoomed(log_focal) for frame in frames], density, [start, best.pose])
            return modes[0] if modes else None

        low, given, high = (maximum(step * FOCAL_STEP, best.pose) for step in (-1.0, 0.0, 1.0))
        if low is None or given is None or high is None:
            return cls(np.full(6, np.nan))
        ends = [best.pose.increment_to(mode.pose) for mode in (low, high)]
        shift = (ends[1] - ends[0]) / (2.0 * FOCAL_STEP)
        others = {log_focal: maximum(log_focal, best.pose.moved(log_focal * shift)) for log_focal in OTHER_FOCAL}
        found = {log_focal: mode.log_mass - given.log_mass for log_focal, mode in others.items() if mode is not None}
        likeliest = max(found, key=lambda log_focal: found[log_focal], default=0.0)
        return cls(shift, float(np.exp(likeliest)), found.get(likeliest, 0.0))

    @property
    def warnings(self) -> tuple[PoseWarning, ...]:
        """That other focal lengths are likelier, in spite of what a calibration counts."""
        if self.gain <= FOCAL_CONTRADICTED:
            return ()
        text = (
            "photo and cloud agree better with focal lengths {factor:.2f} times as long, by odds of e^{log_odds:.0f} to"
            " 1"
        )
        return (PoseWarning("focal-contradicted", text, (), {"factor": self.factor, "log_odds": self.gain}),)


def _alternative(mode: EdgeMode, share: float) -> Alternative:
    return Alternative(
        pose=mode.pose,
        covariance=mode.covariance,
        confidence=share,
        share=share,
        overlap_error=np.nan,
        region_overlap_errors=np.empty(0),
    )


def _warnings(estimate: PoseEstimate, solver: Solver) -> tuple[PoseWarning, ...]:
    """What speaks against trusting an estimate by edges."""
    found: list[PoseWarning] = []
    others = [other for other in estimate.alternatives if other.share > AMBIGUOUS_SHARE]
    if others:
        turns = [np.degrees((other.pose.rotation * estimate.pose.rotation.inv()).magnitude()) for other in others]
        moves = [float(np.linalg.norm(other.pose.camera_center - estimate.pose.camera_center)) for other in others]
        text = (
            "photo and cloud agree about as well at {count:.0f} other poses, turned by {turned_deg:.0f} deg and moved"
            " by {moved_m:.1f} m or more"
        )
        values = {"count": float(len(others)), "turned_deg": float(min(turns)), "moved_m": min(moves)}
        found.append(PoseWarning("ambiguous", text, (), values))
    most_deg, share = solver.limits
    turn, shift = float(estimate.rotation_sigma_deg.max()), float(estimate.translation_sigma_m.max())
    # So, for NaN, too.
    if not (turn <= most_deg and shift <= share * estimate.distance_m):
        text = (
            "standard deviations of {rotation_deg:.2f} deg and {translation_mm:.0f} mm exceed the limits of"
            " {most_deg:.2f} deg and {most_mm:.0f} mm"
        )
        values = {
            "rotation_deg": turn,
            "translation_mm": 1000.0 * shift,
            "most_deg": most_deg,
            "most_mm": 1000.0 * share * estimate.distance_m,
        }
        found.append(PoseWarning("weak-geometry", text, (), values))
    if estimate.confidence < _core.TRUSTED and not others:
        text = "too few edges of photo and cloud agree: confidence {percent:.0f} %"
        found.append(PoseWarning("low-confidence", text, (), {"percent": 100.0 * estimate.confidence}))
    return tuple(found)
