"""Pose estimates: what every estimator returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.geometry.pose import Pose
from regionpose.geometry.units import angle_text, length_text
from regionpose.solve.edge_diagnostics import Alignment, EdgeMode, FocalEvidence
from regionpose.solve.prior import Prior
from regionpose.solve.rig_diagnostics import RigDiagnostics
from regionpose.solve.status import PoseStatus, pose_status
from regionpose.solve.warning import PoseWarning, warning_from_core
from regionpose.validation.arrays import KeptArrays, read_only

Array = NDArray[np.float64]


class PoseError(ValueError):
    """No pose shows the regions as they were observed."""


class PoseSigma(NamedTuple):
    """Standard deviations of a pose.

    Parameters
    ----------
    rotation_deg : (3,) array
        About the camera's axes, degrees.
    translation_m : (3,) array
        Along the camera's axes, meters.
    """

    rotation_deg: Array
    translation_m: Array

    def __repr__(self) -> str:
        """The largest of both."""
        return f"PoseSigma({angle_text(float(max(self[0])))}, {length_text(float(max(self[1])))})"


class PoseWithCovariance(KeptArrays):
    """A pose with its covariance, its arrays read-only."""

    pose: Pose
    covariance: Array

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        object.__setattr__(self, "covariance", np.asarray(self.covariance, dtype=np.float64))
        super().__post_init__()

    @property
    def sigma(self) -> PoseSigma:
        """Standard deviations, degrees and meters."""
        sigma = np.sqrt(np.diag(self.covariance))
        return PoseSigma(np.degrees(sigma[:3]), sigma[3:])

    def covariance_of_inverse(self) -> Array:
        """The covariance (6, 6) of `world_from_camera`, of its left increment `[omega (rad), tau (m)]` along the
        world's axes.
        """
        inverse = self.pose.inverse()
        turn = inverse.rotation_matrix
        jacobian = np.block([[turn, np.zeros((3, 3))], [_cross(inverse.translation) @ turn, turn]])
        return np.asarray(jacobian @ self.covariance @ jacobian.T)

    def covariance_in_ros_order(self, *, of_inverse: bool = False) -> Array:
        """The covariance (6, 6) as of ROS' `geometry_msgs/PoseWithCovariance`: `[x, y, z (m), rotation about the fixed
        axes x, y, z (rad)]` of the pose `camera_from_world`, or of `world_from_camera`.
        """
        pose = self.pose.inverse() if of_inverse else self.pose
        covariance = self.covariance_of_inverse() if of_inverse else self.covariance
        # A left increment turns the translation, too: t' = t + omega x t + tau.
        jacobian = np.block([[-_cross(pose.translation), np.eye(3)], [np.eye(3), np.zeros((3, 3))]])
        return np.asarray(jacobian @ covariance @ jacobian.T)


def _cross(vector: Array) -> Array:
    """The matrix (3, 3) of the cross product with a vector."""
    x, y, z = vector.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


@dataclass(frozen=True, eq=False, repr=False)
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
        Posterior probability of this mode, as of `Diagnostics`.
    overlap_error : float
        Of all regions, a fraction, as of `Diagnostics`.
    region_overlap_errors : (k,) array
        Region by region.

    """

    pose: Pose
    covariance: Array
    confidence: float
    mode_probability: float
    overlap_error: float
    region_overlap_errors: Array

    def __repr__(self) -> str:
        """The confidence, the standard deviations and the pose."""
        return f"Alternative(confidence={self.confidence:.3f}, {self.sigma!r}, {self.pose!r})"


@dataclass(frozen=True, eq=False, repr=False)
class SharedEdge(KeptArrays):
    """A straight edge that two regions share where their planes meet.

    Parameters
    ----------
    regions : tuple of two int
        Their indices in the lists.
    ends : (2, 3) array
        Of the part that both image regions show, in the world, meters; kept read-only.

    """

    regions: tuple[int, int]
    ends: Array

    def __repr__(self) -> str:
        """The regions and the length."""
        length = length_text(float(np.linalg.norm(self.ends[1] - self.ends[0])))
        return f"SharedEdge(regions={self.regions}, {length})"


@dataclass(frozen=True, eq=False, repr=False)
class RegionsOnly:
    """The estimate by the regions without edges, and what edges did to it.

    Parameters
    ----------
    estimate : PoseEstimate
        By the regions alone.
    rank : int or None
        Which of its solutions the pose is about, from 1: the best one, then its alternatives; None where it is about
        none.
    pose : Pose or None
        That solution.
    rotation_deg : float
        The angle between the pose and that solution, degrees; NaN without.
    shift_m : float
        The distance between their camera centers, meters; NaN without.
    """

    estimate: PoseEstimate
    rank: int | None
    pose: Pose | None
    rotation_deg: float
    shift_m: float

    @property
    def is_refined(self) -> bool:
        """Whether edges moved the pose from that solution."""
        return self.rotation_deg > 0.0 or self.shift_m > 0.0

    def __repr__(self) -> str:
        """The rank, how far edges moved the pose, and the estimate."""
        change = f"rotation_deg={self.rotation_deg:.3f}, shift_m={self.shift_m:.4f}"
        return f"RegionsOnly(rank={self.rank}, {change}, {self.estimate!r})"


@dataclass(frozen=True, eq=False, repr=False)
class EdgeDiagnostics:
    """The evidence of the edges of photos and clouds for a pose (docs/math.md, sections 18 and 19).

    Parameters
    ----------
    prior : Prior
        What was searched: the given prior, with what was assumed for missing fields.
    assumed : tuple of str
        Names of the prior's fields that were assumed.
    log_odds : float
        Logarithm of the odds that photo and cloud agree at the pose rather than by chance: anywhere in the prior, or
        about the regions' solution where the pose is one of these.
    log_odds_over_next : float
        The logarithm of the odds of the pose over the likeliest other place; infinite where there is none.
    count : int
        How many edges of the clouds are in view at the pose, away from the regions.
    modes : tuple of EdgeMode
        All maxima of the posterior by edges, of the largest mass first.
    alignments : tuple of Alignment
        How well photo and cloud of each frame agree at the pose.
    focal : FocalEvidence or None
        Their evidence for the focal lengths; None of cameras that have none.
    regions_only : RegionsOnly or None
        The estimate by the regions without edges; None without regions.
    """

    prior: Prior
    assumed: tuple[str, ...]
    log_odds: float
    log_odds_over_next: float
    count: int
    modes: tuple[EdgeMode, ...]
    alignments: tuple[Alignment, ...]
    focal: FocalEvidence | None = None
    regions_only: RegionsOnly | None = None

    def __repr__(self) -> str:
        """The log odds over chance and the next place, and the number of edges."""
        odds = f"log_odds={self.log_odds:.1f}, log_odds_over_next={self.log_odds_over_next:.1f}"
        return f"EdgeDiagnostics({odds}, count={self.count})"


@dataclass(frozen=True, eq=False, repr=False)
class Diagnostics(KeptArrays):
    """How an estimate was found and how well it fits; arrays are read-only.

    Parameters
    ----------
    mode_probability : float
        Posterior probability of this mode; nearby modes count separately: modes that fit alike divide the probability
        of one. The confidence is the sum over those within 5 degrees.
    overlap_error : float
        Area of the symmetric difference of projected and observed regions over the observed area (the paper's delta, on
        the sphere), a fraction; NaN without regions.
    region_overlap_errors : (k,) array
        The same region by region.
    boundary_noise_px : float
        Standard deviation of the contour that the fit shows, pixels, of its clean part where the pose was refined on
        it; NaN without regions.
    outlier_fraction : float or None
        The rest of the contour, a fraction, then.
    alternatives : tuple of Alternative
        Other minima that fit as well and that the priors leave, or other places by edges; best first.
    converged : bool
        Whether the best minimum's iteration ended at a minimum.
    termination : str
        Why it ended.
    evaluations : int
        Of the equations, over all minima.
    distance_m : float
        Median distance of the regions, or points in view, from the camera, meters: what the limit of the translation's
        standard deviation is a fraction of.
    pixel_angle_rad : float
        The angle of a pixel where the regions project, radians: the root of its mean square over them. About 1 over
        the focal length.
    focal_shift : (6,) array
        The pose's derivative by the logarithm of the focal lengths, a left increment: a hundredth of it is what focal
        lengths 1 % longer do (docs/math.md, eq. 10.9). NaN where a direction is left free.
    shared_edges : tuple of SharedEdge
        Edges between regions that were evidence beside samples of a scan.
    rig : RigDiagnostics or None
        How the frames of a rig fit, of `estimate_rig`; else None.
    edges : EdgeDiagnostics or None
        Evidence of the edges of photos and clouds, of `calibrate` and of scenes; None where they were not compared.
    """

    mode_probability: float
    overlap_error: float
    region_overlap_errors: Array
    boundary_noise_px: float
    outlier_fraction: float | None
    alternatives: tuple[Alternative, ...]
    converged: bool
    termination: str
    evaluations: int
    distance_m: float
    pixel_angle_rad: float
    focal_shift: Array
    shared_edges: tuple[SharedEdge, ...] = ()
    rig: RigDiagnostics | None = None
    edges: EdgeDiagnostics | None = None

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for name in ("region_overlap_errors", "focal_shift"):
            object.__setattr__(self, name, read_only(np.asarray(getattr(self, name), dtype=np.float64)))

    def __repr__(self) -> str:
        """The overlap error, the number of alternatives, and the diagnostics of rig and edges."""
        parts = [f"overlap_error={self.overlap_error:.4f}", f"{len(self.alternatives)} alternatives"]
        parts += [repr(each) for each in (self.rig, self.edges) if each is not None]
        return f"Diagnostics({', '.join(parts)})"


@dataclass(frozen=True, eq=False, repr=False)
class PoseEstimate(PoseWithCovariance):
    """The pose of a camera, how sure it is, and whether to trust it; arrays are read-only.

    All estimators return this: `estimate_pose`, `estimate_poses`, `estimate_rig`, `calibrate`, `match_regions` and
    `estimate_scene`.

    Parameters
    ----------
    pose : Pose
        `camera_from_world`.
    covariance : (6, 6) array
        Of the left increment `[omega (rad), tau (meters)]` along the camera's axes, `P' = exp(omega) P + tau`: by the
        noise of contours, samples and edges and by what calibration, time and scan add to it (docs/math.md, eq. 10.8).
        `covariance_of_inverse` is that of `world_from_camera`, `covariance_in_ros_order` that of a ROS message.
    confidence : float
        Probability that the true pose is within 5 degrees, as calibrated on synthetic problems (docs/math.md, section
        15).
    warnings : tuple of PoseWarning
        What to know before trusting the pose.
    diagnostics : Diagnostics
        How it was found and how well it fits: overlap errors, alternatives, diagnostics of frames and edges.

    """

    pose: Pose
    covariance: Array
    confidence: float
    warnings: tuple[PoseWarning, ...]
    diagnostics: Diagnostics

    @property
    def status(self) -> PoseStatus:
        """Whether to trust the pose: trusted, check or doubtful."""
        return pose_status(self.confidence, self.warnings)

    def __repr__(self) -> str:
        """The status, the confidence, the standard deviations, the pose and the codes of the warnings."""
        parts = [self.status.value, f"confidence={self.confidence:.3f}", repr(self.sigma), repr(self.pose)]
        parts += [f"warnings: {', '.join(warning.code for warning in self.warnings)}"] if self.warnings else []
        return f"PoseEstimate({', '.join(parts)})"


def estimate_from_core(estimate: _core.Estimate | str | None) -> PoseEstimate | PoseError:
    """What the core found, or an error with the reason."""
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
        warnings=tuple(map(warning_from_core, estimate.warnings)),
        diagnostics=_diagnostics(estimate, best),
    )


def _diagnostics(estimate: _core.Estimate, best: _core.Solution) -> Diagnostics:
    return Diagnostics(
        mode_probability=best.mode_probability,
        overlap_error=best.overlap_error,
        region_overlap_errors=best.region_overlap_errors,
        boundary_noise_px=estimate.boundary_noise,
        outlier_fraction=estimate.outlier_fraction,
        alternatives=tuple(map(_alternative, estimate.alternatives)),
        converged=best.converged,
        termination=best.termination,
        evaluations=estimate.evaluations,
        distance_m=estimate.distance,
        pixel_angle_rad=estimate.pixel_angle,
        focal_shift=best.focal_shift,
        shared_edges=tuple(SharedEdge((first, second), ends) for (first, second), ends in estimate.shared_edges),
    )


def _alternative(solution: _core.Solution) -> Alternative:
    return Alternative(
        pose=pose_of(solution),
        covariance=solution.covariance,
        confidence=solution.confidence,
        mode_probability=solution.mode_probability,
        overlap_error=solution.overlap_error,
        region_overlap_errors=solution.region_overlap_errors,
    )


def pose_of(solution: _core.Solution) -> Pose:
    """The pose of a solution."""
    return Pose.of_quaternion(solution.quaternion, solution.translation)
