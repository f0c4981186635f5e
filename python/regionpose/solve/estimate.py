"""Poses and what is known of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.geometry.pose import Pose
from regionpose.solve.warning import PoseWarning
from regionpose.validation.arrays import KeptArrays, read_only

Array = NDArray[np.float64]


class PoseError(ValueError):
    """No pose shows the regions as they were observed."""


class PoseWithCovariance(KeptArrays):
    """A pose with its covariance and overlap errors, its arrays read-only."""

    pose: Pose
    covariance: Array
    region_overlap_errors: Array

    def __post_init__(self) -> None:
        """Keep arrays that nobody can write to."""
        for name in ("covariance", "region_overlap_errors"):
            object.__setattr__(self, name, read_only(np.asarray(getattr(self, name), dtype=np.float64)))

    @property
    def rotation_sigma_deg(self) -> Array:
        """Standard deviations of the rotation about the camera's axes, (3,), degrees."""
        return np.degrees(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def translation_sigma_m(self) -> Array:
        """Standard deviations of the translation along the camera's axes, (3,), meters."""
        return np.sqrt(np.diag(self.covariance)[3:])


@dataclass(frozen=True, eq=False)
class Alternative(PoseWithCovariance):
    """Another pose that fits as well.

    Parameters
    ----------
    pose : Pose
        `camera_from_world`.
    covariance : (6, 6) array
        Of the left increment `[omega (rad), tau (meters)]`, as of `PoseEstimate`.
    confidence : float
        Probability that it is within 5 degrees of the true pose.
    mode_probability : float
        Probability that it is the place, as of `PoseEstimate`.
    overlap_error : float
        Of all regions, a fraction, as of `PoseEstimate`.
    region_overlap_errors : (k,) array
        Region by region.

    """

    pose: Pose
    covariance: Array
    confidence: float
    mode_probability: float
    overlap_error: float
    region_overlap_errors: Array


@dataclass(frozen=True, eq=False)
class SharedEdge(KeptArrays):
    """A straight edge that two regions share where their planes meet.

    Parameters
    ----------
    regions : tuple of two int
        Their places in the lists.
    ends : (2, 3) array
        Of the part that both image regions show, in the world, meters; kept read-only.

    """

    regions: tuple[int, int]
    ends: Array


@dataclass(frozen=True, eq=False, repr=False)
class PoseEstimate(PoseWithCovariance):
    """The pose of a camera with its covariance, confidence, alternatives and warnings; arrays are read-only.

    Parameters
    ----------
    pose : Pose
        `camera_from_world`.
    covariance : (6, 6) array
        Of the left increment `[omega (rad), tau (meters)]`, `P' = exp(omega) P + tau`: by the noise of contours and
        samples and by what calibration, time and scan add to it (docs/math.md, eq. 10.8).
    confidence : float
        Probability that the true pose is within 5 degrees, as calibrated on synthetic problems (docs/math.md, section
        15).
    mode_probability : float
        Probability that this answer is the place, each being one of its own: answers that fit alike share what one of
        them would have. The confidence is the sum of the shares of those within 5 degrees.
    overlap_error : float
        Area of the symmetric difference of projected and observed regions over the observed area (the paper's delta, on
        the sphere), a fraction.
    region_overlap_errors : (k,) array
        The same region by region.
    boundary_noise_px : float
        Standard deviation of the contour that the fit shows, pixels, of its clean part where the pose was refined on
        it.
    outlier_fraction : float or None
        The rest of the contour, a fraction, then.
    alternatives : tuple of Alternative
        Other minima that fit as well and that the priors leave, best first.
    warnings : tuple of PoseWarning
        What to know before trusting the pose.
    converged : bool
        Whether the best minimum's iteration ended at a minimum.
    termination : str
        Why it ended.
    evaluations : int
        Of the equations, over all minima.
    distance_m : float
        Median distance of the regions from the camera, meters: what the limit of the translation's standard deviation
        is a share of.
    pixel_angle_rad : float
        The angle of a pixel where the regions are seen, radians: the root of its mean square over them. About 1 over
        the focal length.
    focal_shift : (6,) array
        The pose's derivative by the logarithm of the focal lengths, a left increment, as the regions tell it: a
        hundredth of it is what focal lengths 1 % longer do (docs/math.md, eq. 10.9). NaN where a direction is left
        free.
    shared_edges : tuple of SharedEdge
        Edges between regions that were evidence beside samples of a scan.

    """

    pose: Pose
    covariance: Array
    confidence: float
    mode_probability: float
    overlap_error: float
    region_overlap_errors: Array
    boundary_noise_px: float
    outlier_fraction: float | None
    alternatives: tuple[Alternative, ...]
    warnings: tuple[PoseWarning, ...]
    converged: bool
    termination: str
    evaluations: int
    distance_m: float
    pixel_angle_rad: float
    focal_shift: Array
    shared_edges: tuple[SharedEdge, ...] = ()

    def __post_init__(self) -> None:
        """Keep arrays that nobody can write to."""
        super().__post_init__()
        object.__setattr__(self, "focal_shift", read_only(np.asarray(self.focal_shift, dtype=np.float64)))

    def __repr__(self) -> str:
        """The pose, its confidence and overlap error, the number of alternatives and the codes of the warnings."""
        parts = [repr(self.pose), f"confidence={self.confidence:.3f}", f"overlap_error={self.overlap_error:.4f}"]
        parts += [f"{len(self.alternatives)} alternatives"] if self.alternatives else []
        parts += [f"warnings: {', '.join(warning.code for warning in self.warnings)}"] if self.warnings else []
        return f"PoseEstimate({', '.join(parts)})"


def estimate_from_core(estimate: _core.Estimate | str | None) -> PoseEstimate | PoseError:
    """What the core found, or the error that says why it found nothing."""
    if isinstance(estimate, str):
        return PoseError(estimate)
    if estimate is None:
        return PoseError(
            "no pose shows every world region where its image region is; check that the pairs belong together"
        )
    best = estimate.best
    return PoseEstimate(
        pose=pose_of(best),
        covariance=best.covariance,
        confidence=best.confidence,
        mode_probability=best.share,
        overlap_error=best.overlap_error,
        region_overlap_errors=best.region_overlap_errors,
        boundary_noise_px=estimate.boundary_noise,
        outlier_fraction=estimate.disturbed_share,
        alternatives=tuple(map(_alternative, estimate.alternatives)),
        warnings=tuple(PoseWarning(code, text, tuple(of), values) for code, text, of, values in estimate.warnings),
        converged=best.converged,
        termination=best.termination,
        evaluations=estimate.evaluations,
        distance_m=estimate.distance,
        pixel_angle_rad=estimate.pixel_angle,
        focal_shift=best.focal_shift,
        shared_edges=tuple(SharedEdge((first, second), ends) for (first, second), ends in estimate.creases),
    )


def _alternative(solution: _core.Solution) -> Alternative:
    return Alternative(
        pose=pose_of(solution),
        covariance=solution.covariance,
        confidence=solution.confidence,
        mode_probability=solution.share,
        overlap_error=solution.overlap_error,
        region_overlap_errors=solution.region_overlap_errors,
    )


def pose_of(solution: _core.Solution) -> Pose:
    """The pose of a solution."""
    return Pose.of_quaternion(solution.quaternion, solution.translation)
