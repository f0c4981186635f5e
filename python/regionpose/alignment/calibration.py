"""From photos and clouds of one rig, and regions where there are some, to the camera's pose (docs/math.md, section
18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.alignment.agreement import aligned
from regionpose.alignment.assessment import Assessment, hidden_regions
from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.explanations import explained_by_edges, explained_with_regions, without_calibration
from regionpose.alignment.focal import ByFocal, focal_evidence
from regionpose.alignment.hypotheses import clusters_of, is_same, solutions_of
from regionpose.alignment.photo_cloud import PhotoCloud
from regionpose.alignment.region_evidence import RegionEvidence
from regionpose.alignment.visibility import occlusions
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.progress import Progress, part
from regionpose.solve.estimate import EdgeDiagnostics, PoseError, PoseEstimate, RegionsOnly
from regionpose.solve.frame import Frame, named_frames
from regionpose.solve.options import Solver, checked_solver
from regionpose.solve.prior import MOUNT_SIGMA_M, Prior
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import finite_array

Array = NDArray[np.float64]

SEARCHED, FOCAL_TRIED = 0.75, 0.95
"""Fractions of the progress at which maxima are found, and other focal lengths tried: about those of the time that a
street frame takes."""


@checked_arguments
def calibrate(
    camera: Camera,
    frames: Sequence[Frame],
    *,
    prior: Prior | None = None,
    sensor_origin: ArrayLike | None = None,
    solver: Solver | None = None,
    progress: Progress | None = None,
) -> PoseEstimate:
    """The pose of a camera in the frame of a scanner, from photos and clouds, and regions where frames have some.

    The edges of the clouds, of depth and intensity, are laid on those of the photos at tens of thousands of poses that
    the prior allows; the likeliest are maximized, and the odds of the best over chance and over the others give the
    confidence (docs/math.md, section 18). Frames of one rig share the pose, and their evidence adds up. Pairs of
    regions give solutions of their own, as of `estimate_pose` or `estimate_rig`, about which the edges beside them are
    laid, too; all these are explanations of one posterior.

    Parameters
    ----------
    camera : Camera
        That took all photos.
    frames : sequence of Frame
        Photos and clouds of one rig, the clouds in the scanner's frame, with pairs of regions or without.
    prior : Prior, optional
        Where the camera stands (`camera_near`), which direction is up, a rough pose. Without regions and a place the
        camera is taken to be near the scanner, within 0.5 m along each axis; without `up` or `initial` with its
        deviations every rotation is searched. With regions and without a place edges are compared near the regions'
        hypotheses alone.
    sensor_origin : (3,) array, optional
        Where the scanner stands in the clouds' frame, meters; by default where the prior has the camera, else (0, 0,
        0).
    solver : Solver, optional
        How regions are solved, its limits, and what a frame and the focal lengths are off by.
    progress : callable, optional
        Called with the fraction of the work that is done, 0 to 1.

    Returns
    -------
    PoseEstimate
        The pose with its covariance, confidence and warnings. `diagnostics.edges` holds the evidence of edges, what was
        searched and what was assumed for that, and the estimate of the regions without edges;
        `diagnostics.alternatives` other places, likeliest first. Without regions it has no overlap errors (NaN).

    Raises
    ------
    ValueError
        For no frames, and for bad input, naming the frame, as for one without `image` or `points`.
    PoseError
        A ValueError, where clouds and photos show no edges in common that the prior allows, and where no pose shows
        every region.
    """
    options = checked_solver(solver)
    photo_clouds = [PhotoCloud.of(camera, frame) for frame in named_frames(frames, "photo and cloud")]
    regions = RegionEvidence.of(photo_clouds, prior or Prior(), options)
    return calibrate_with(photo_clouds, regions, prior, sensor_origin, options, progress)


def calibrate_with(
    frames: Sequence[PhotoCloud],
    regions: RegionEvidence | None,
    prior: Prior | None,
    sensor_origin: ArrayLike | None,
    solver: Solver,
    progress: Progress | None = None,
) -> PoseEstimate:
    """As `calibrate`, of frames whose regions were solved before."""
    by_regions = None if regions is None else regions.estimate
    known, assumed, origin = _assumed(prior, sensor_origin, by_regions)
    edges, report = [EdgeFrame(frame, origin) for frame in frames], progress or (lambda fraction: None)
    search = part(progress, 0.0, SEARCHED)
    if by_regions is None:
        explained = explained_by_edges(edges, known, search)
    else:
        hidden = [_hides(frames, solution.pose) for solution in solutions_of(by_regions)]
        explained = explained_with_regions(edges, known, by_regions, hidden, solver, search)
    if not explained.hypotheses:
        raise PoseError(_nothing_shown(edges))
    clusters = clusters_of(explained.hypotheses)
    best = clusters[0].best
    if regions is not None and clusters[0].solution:
        regions = regions.first_at(best.pose)
    by_focal = ByFocal.of(
        edges, best, known, None if regions is None else without_calibration(regions.estimate, solver)
    )
    focal = None if by_focal is None else focal_evidence(by_focal, part(progress, SEARCHED, FOCAL_TRIED))
    report(FOCAL_TRIED)
    assessment = Assessment(edges, clusters, explained.none, focal, solver)
    if regions is None or by_regions is None:
        estimate = assessment.by_edges()
    else:
        estimate = assessment.with_regions(regions, by_regions)
    alignments = tuple(aligned(frame, one, estimate.pose) for frame, one in zip(frames, edges, strict=True))
    hidden_ones = () if regions is None else hidden_regions(alignments, regions.starts)
    report(1.0)
    found = EdgeDiagnostics(
        prior=known,
        assumed=assumed,
        log_odds=explained.log_odds(clusters[0]),
        log_odds_over_next=float(clusters[0].log_weight - clusters[1].log_weight) if len(clusters) > 1 else np.inf,
        count=sum(len(alignment.places) for alignment in alignments),
        modes=explained.modes,
        alignments=alignments,
        focal=focal,
        regions_only=None if by_regions is None else _regions_only(by_regions, estimate.pose),
    )
    diagnostics = replace(estimate.diagnostics, edges=found)
    return replace(estimate, warnings=(*estimate.warnings, *hidden_ones), diagnostics=diagnostics)


def _regions_only(estimate: PoseEstimate, pose: Pose) -> RegionsOnly:
    """The estimate by regions alone, compared with the pose by regions and edges."""
    solutions = enumerate(solutions_of(estimate))
    rank, solution = next(((k + 1, each.pose) for k, each in solutions if is_same(each.pose, pose)), (None, None))
    if solution is None:
        return RegionsOnly(estimate, None, None, np.nan, np.nan)
    rotation_deg = float(np.degrees((pose.rotation * solution.rotation.inv()).magnitude()))
    shift_m = float(np.linalg.norm(pose.camera_center - solution.camera_center))
    return RegionsOnly(estimate, rank, solution, rotation_deg, shift_m)


def _hides(frames: Sequence[PhotoCloud], pose: Pose) -> bool:
    """Whether the clouds hide a region at a pose."""
    found = (occlusions(frame, pose) for frame in frames)
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
