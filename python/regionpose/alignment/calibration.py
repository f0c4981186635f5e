"""From photos and clouds of one rig, and regions where there are some, to the camera's pose (docs/math.md, section
18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.alignment.agreement import Alignment, aligned
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.explanations import explained_by_edges, explained_with_regions, without_calibration
from regionpose.alignment.focal import ByFocal, FocalEvidence, focal_evidence
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.hypotheses import answers_of, is_same, places_of
from regionpose.alignment.judgment import Judgment, hidden_regions
from regionpose.alignment.pose_search import EdgeMode
from regionpose.alignment.region_evidence import RegionEvidence
from regionpose.alignment.visibility import occlusions
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, part
from regionpose.solve.estimate import PoseError, PoseEstimate
from regionpose.solve.options import Solver, checked_solver
from regionpose.solve.prior import MOUNT_SIGMA_M, Prior
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import KeptArrays, finite_array

Array = NDArray[np.float64]

SEARCHED, FOCAL_TRIED = 0.75, 0.95
"""Shares of the time after which maxima are found, and other focal lengths tried: about those of a
street frame, for who waits."""


@dataclass(frozen=True, eq=False, repr=False)
class Calibration(KeptArrays):
    """A pose by photos and clouds, and by regions where there are some, and what it was found by.

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
        Logarithm of the odds that photo and cloud agree at the pose rather than by chance: anywhere in the prior, or
        about the regions' answer where the pose is one of these.
    lead : float
        The logarithm of the odds of the pose over the likeliest other place; infinite where there is none.
    edges : int
        How many edges of the clouds are in view at the pose, away from the regions.
    modes : tuple of EdgeMode
        All maxima of the posterior by edges, of the largest mass first.
    alignments : tuple of Alignment
        How well photo and cloud of each frame agree at the pose.
    regions : PoseEstimate or None
        What the regions say alone; None without any.
    focal : FocalEvidence or None
        What the edges say of the focal lengths; None of cameras that have none.
    """

    estimate: PoseEstimate
    prior: Prior
    assumed: tuple[str, ...]
    log_odds: float
    lead: float
    edges: int
    modes: tuple[EdgeMode, ...]
    alignments: tuple[Alignment, ...]
    regions: PoseEstimate | None = None
    focal: FocalEvidence | None = None

    @property
    def pose(self) -> Pose:
        """The camera's, `camera_from_world`."""
        return self.estimate.pose

    @property
    def rank_before(self) -> int | None:
        """The place of the pose among the answers of the regions alone, from 0; None where it is none of them."""
        if self.regions is None:
            return None
        answers = enumerate(answers_of(self.regions))
        return next((number for number, answer in answers if is_same(answer.pose, self.pose)), None)

    @property
    def before(self) -> Pose | None:
        """The answer of the regions that the pose is about; None where it is about none."""
        if self.regions is None or self.rank_before is None:
            return None
        return answers_of(self.regions)[self.rank_before].pose

    @property
    def is_refined(self) -> bool:
        """Whether edges say more than the regions' answer by itself."""
        return self.before is not None and bool(self.turned_deg > 0.0 or self.moved_m > 0.0)

    @property
    def turned_deg(self) -> float:
        """The angle between the pose and the regions' answer that it is about, degrees; NaN without."""
        before = self.before
        return np.nan if before is None else float(np.degrees((self.pose.rotation * before.rotation.inv()).magnitude()))

    @property
    def moved_m(self) -> float:
        """The distance between their camera centers, meters; NaN without."""
        before = self.before
        return np.nan if before is None else float(np.linalg.norm(self.pose.camera_center - before.camera_center))

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
    """The pose of a camera in the frame of a scanner, from photos and clouds, and regions where frames have some.

    The edges of the clouds, of depth and intensity, are laid on those of the photos at tens of thousands of poses that
    the prior allows; the likeliest are maximized, and how far the best leads chance and the others gives the
    confidence (docs/math.md, section 18). Frames of one rig share the pose, and their evidence adds up. Pairs of
    regions give answers of their own, as of `estimate_pose` or `estimate_rig`, about which the edges beside them are
    laid, too; all these are explanations of one posterior.

    Parameters
    ----------
    frames : sequence of SceneFrame
        Photos and clouds of one rig, the clouds in the scanner's frame.
    prior : Prior, optional
        Where the camera stands (`camera_near`), which direction is up, a rough pose. Without regions and a place the
        camera is taken to be near the scanner, within 0.5 m along each axis; without `up` or `initial` with its
        deviations every rotation is searched. With regions and without a place edges are looked at near their answers
        alone.
    sensor_origin : (3,) array, optional
        Where the scanner stands in the clouds' frame, meters; by default where the prior has the camera, else (0, 0,
        0).
    solver : Solver, optional
        How regions are solved, its limits, and what a frame and the focal lengths are off by.
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
        A ValueError, where clouds and photos show no edges in common that the prior allows, and where no pose shows
        every region.
    """
    if not frames:
        raise ValueError("frames is empty; needed at least one photo and cloud")
    options = checked_solver(solver)
    regions = RegionEvidence.of(frames, prior or Prior(), options)
    return calibrate_with(frames, regions, prior, sensor_origin, options, progress)


def calibrate_with(
    frames: Sequence[SceneFrame],
    regions: RegionEvidence | None,
    prior: Prior | None,
    sensor_origin: ArrayLike | None,
    solver: Solver,
    progress: Progress | None = None,
) -> Calibration:
    """As `calibrate`, of frames whose `regions` were looked at before."""
    by_regions = None if regions is None else regions.estimate
    known, assumed, origin = _assumed(prior, sensor_origin, by_regions)
    edges, report = [EdgeFrame(frame, origin) for frame in frames], progress or (lambda share: None)
    search = part(progress, 0.0, SEARCHED)
    if by_regions is None:
        explained = explained_by_edges(edges, known, search)
    else:
        hidden = [_hides(frames, answer.pose) for answer in answers_of(by_regions)]
        explained = explained_with_regions(edges, known, by_regions, hidden, solver, search)
    if not explained.hypotheses:
        raise PoseError(_nothing_shown(edges))
    places = places_of(explained.hypotheses)
    best = places[0].best
    if regions is not None and places[0].answer:
        regions = regions.first_at(best.pose)
    by_focal = ByFocal.of(
        edges, best, known, None if regions is None else without_calibration(regions.estimate, solver)
    )
    focal = None if by_focal is None else focal_evidence(by_focal, best, part(progress, SEARCHED, FOCAL_TRIED))
    report(FOCAL_TRIED)
    judgment = Judgment(edges, places, explained.none, focal, solver)
    if regions is None or by_regions is None:
        estimate = judgment.by_edges()
    else:
        estimate = judgment.with_regions(regions, by_regions)
    alignments = tuple(aligned(frame, one, estimate.pose) for frame, one in zip(frames, edges, strict=True))
    if regions is not None:
        hidden_ones = hidden_regions(alignments, regions.starts)
        estimate = replace(estimate, warnings=(*estimate.warnings, *hidden_ones))
    report(1.0)
    return Calibration(
        estimate=estimate,
        prior=known,
        assumed=assumed,
        log_odds=explained.log_odds(places[0]),
        lead=float(places[0].log_weight - places[1].log_weight) if len(places) > 1 else np.inf,
        edges=sum(len(alignment.places) for alignment in alignments),
        modes=explained.modes,
        alignments=alignments,
        regions=by_regions,
        focal=focal,
    )


def _hides(frames: Sequence[SceneFrame], pose: Pose) -> bool:
    """Whether the clouds hide a region at a pose."""
    found = (occlusions(frame.regions, frame.world_regions, frame.points, frame.camera, pose) for frame in frames)
    return any(each.is_hidden for of_frame in found for each in of_frame)


def _nothing_shown(frames: Sequence[EdgeFrame]) -> str:
    edges, points = sum(frame.edge_count for frame in frames), sum(frame.point_count for frame in frames)
    found = f"{points} points have {edges} edges as seen from sensor_origin"
    found += ", none of which a photo shows at the likeliest poses of the prior" * bool(edges)
    return f"no pose was found: {found}; needed photos and dense clouds of one scene"


def _assumed(
    prior: Prior | None, sensor_origin: ArrayLike | None, regions: PoseEstimate | None
) -> tuple[Prior, tuple[str, ...], Array]:
    """The prior with what it needs to be searched, the names of what was assumed, and a place near the scanner."""
    known, assumed = prior or Prior(), []
    has_pose = known.initial is not None and known.initial_rotation_sigma_deg is not None
    place = np.zeros(3) if regions is None else regions.pose.camera_center
    if sensor_origin is not None:
        place = finite_array(sensor_origin, "sensor_origin", (3,))
    elif known.camera_near is not None:
        place = np.asarray(known.camera_near, dtype=np.float64)
    elif has_pose and known.initial is not None:
        place = known.initial.camera_center
    if regions is None and known.camera_near is None and not has_pose:
        known, assumed = replace(known, camera_near=place), ["camera_near"]
    if regions is None and known.camera_near is not None and known.camera_near_sigma_m is None:
        known = replace(known, camera_near_sigma_m=MOUNT_SIGMA_M)
        assumed.append("camera_near_sigma_m")
    return known, tuple(assumed), place
