"""From regions, a photo and a cloud to a pose that all of them agree with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from regionpose.alignment.answers import Witnessed, witnessed
from regionpose.alignment.focal import focal_evidence
from regionpose.alignment.focal_curve import Estimated
from regionpose.alignment.frame import SceneFrame
from regionpose.alignment.photo import Photo
from regionpose.alignment.refinement import SceneRefinement, refine_with_scene
from regionpose.alignment.steps import checked_intensity, checked_points
from regionpose.arguments import checked_arguments
from regionpose.cameras import Camera
from regionpose.estimation.answer import PoseEstimate
from regionpose.estimation.moved import moved_estimate
from regionpose.estimation.options import Solver, checked_solver
from regionpose.estimation.prior import Prior
from regionpose.estimation.single import estimate_pose
from regionpose.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion


@checked_arguments
def estimate_with_scene(
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    image: ArrayLike | Photo,
    points: ArrayLike,
    *,
    intensity: ArrayLike | None = None,
    prior: Prior | None = None,
    solver: Solver | None = None,
) -> Witnessed:
    """The pose of `estimate_pose`, judged by the rest of photo and cloud: the edges of both away from the regions, and
    what stands before these.

    They choose among answers that fit alike, lower the confidence of a pose at which they do not agree, and refine one
    at which they do, as of `refine_with_scene`; odds of 9 to 1 against it give the warning `scene-disagrees`, against
    the camera's focal lengths `focal-contradicted`, and a region that the cloud hides at the pose gives `hidden-region`
    (docs/math.md, section 18). Scene files do the same.

    Parameters
    ----------
    camera : Camera
        That took the photo.
    image_regions : sequence of ImageRegion
        What the photo shows, pixels.
    world_regions : sequence of WorldRegion
        What the world holds, meters, each at the place of its image region.
    image : (h, w) or (h, w, 3) array, or Photo
        The photo that the image regions are of: uint8, uint16 or floats in [0, 1].
    points : (n, 3) array
        The whole cloud, world coordinates, meters.
    intensity : (n,) array, optional
        What the scanner received from each point, on any scale; brightness of colors if they are not from this photo.
    prior : Prior, optional
        As of `estimate_pose`.
    solver : Solver, optional
        As of `estimate_pose`.

    Returns
    -------
    Witnessed
        The `estimate` and the `witness`, as a pair.

    Raises
    ------
    ValueError
        As of `estimate_pose`; for an image, points or an intensity of other shapes, and for an image of another size
        than the camera's.
    PoseError
        As of `estimate_pose`.

    """
    photo = image if isinstance(image, Photo) else Photo.of(image)
    places = checked_points(points)
    frame = SceneFrame(photo, places, camera, image_regions, checked_intensity(intensity, places), world_regions)

    def estimated(known: Prior | None) -> PoseEstimate:
        return estimate_pose(camera, image_regions, world_regions, prior=known, solver=solver)

    def zoomed(other: Camera, pose: Pose) -> PoseEstimate:
        known = (prior or Prior()).started_at(pose)
        return estimate_pose(other, image_regions, world_regions, prior=known, solver=solver)

    def settled(pose: Pose) -> PoseEstimate:
        return zoomed(camera, pose)

    def refined(estimate: PoseEstimate) -> tuple[PoseEstimate, SceneRefinement]:
        options = checked_solver(solver)
        return refined_estimate(estimate, [frame], camera, image_regions, world_regions, zoomed, options)

    return witnessed(estimated(prior), lambda pose: [frame.alignment(pose)], settled, refined)


def refined_estimate(
    estimate: PoseEstimate,
    scene: Sequence[SceneFrame],
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    estimated: Estimated,
    solver: Solver,
) -> tuple[PoseEstimate, SceneRefinement]:
    """An estimate with its pose refined by the rest of the scene if that says enough, and what that said of the pose
    and of the focal lengths; `estimated`: the regions' estimate with another camera, started at a pose.

    The estimate's covariance holds what the edges of all frames share beside their noise: the error of each whole
    exposure, to the solver's deviations, and of the calibration.
    """
    # With the calibration as it is given; what an error of it does to regions and edges is added after.
    given = _at_given_calibration(estimate, solver)
    found = refine_with_scene(given.pose, given.covariance, scene)

    def zoomed(other: Camera, pose: Pose) -> PoseEstimate:
        return _at_given_calibration(estimated(other, pose), solver)

    focal = focal_evidence(given, scene, zoomed, found.pose if found.refined else None)
    found = replace(found, focal=focal)
    covariance = estimate.covariance
    if found.refined:
        shift = estimate.focal_shift if focal is None else 100.0 * focal.shift
        calibration = solver.calibration_covariance(shift, estimate.pixel_angle_rad)
        covariance = found.covariance + _shared_error(solver, len(scene)) + calibration
    return moved_estimate(estimate, found.pose, covariance, camera, image_regions, world_regions, solver), found


def _at_given_calibration(estimate: PoseEstimate, solver: Solver) -> PoseEstimate:
    """The estimate with the covariance that it has if focal lengths and image center are without error."""
    if not np.isfinite(estimate.covariance).all():
        return estimate
    calibration = solver.calibration_covariance(estimate.focal_shift, estimate.pixel_angle_rad)
    return replace(estimate, covariance=estimate.covariance - calibration)


def _shared_error(solver: Solver, frames: int) -> NDArray[np.float64]:
    """Covariance (6, 6) of the mean error of so many whole exposures."""
    sigma = np.repeat([np.radians(solver.frame_sigma_deg), solver.frame_sigma_m], 3)
    return np.diag(np.square(sigma)) / frames
