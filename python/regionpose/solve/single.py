"""From regions to a pose."""

from __future__ import annotations

from collections.abc import Sequence

from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.core_inputs import core_prior, core_problem
from regionpose.solve.estimate import PoseError, PoseEstimate, estimate_from_core
from regionpose.solve.options import Solver, checked_solver
from regionpose.solve.prior import Prior
from regionpose.solve.scipy_driver import scipy_minimum
from regionpose.validation.arguments import checked_arguments


@checked_arguments
def estimate_pose(
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    *,
    prior: Prior | None = None,
    solver: Solver | None = None,
) -> PoseEstimate:
    """Estimate the pose `camera_from_world` from paired image and world regions.

    Weak, ambiguous or poorly fitting geometry is reported in the estimate's `warnings`.

    Parameters
    ----------
    camera : Camera
        That saw the image regions.
    image_regions : sequence of ImageRegion
        What the image shows, pixels.
    world_regions : sequence of WorldRegion
        What the world holds, meters, each at the place of its image region.
    prior : Prior, optional
        What is known of the pose. None is needed (docs/math.md, section 7); one adds starts and, like the viewpoint of
        a region (`WorldRegion.with_viewpoint`), rules out what lies elsewhere (section 10).
    solver : Solver, optional
        How the pose is computed; scipy does the final least squares by default.

    Returns
    -------
    PoseEstimate
        The pose, its covariance, confidence and warnings, and others that fit as well.

    Raises
    ------
    ValueError
        For bad input, naming the region or option.
    PoseError
        A ValueError, where no pose shows every region.

    Examples
    --------
    >>> import numpy as np, regionpose as rp
    >>> camera = rp.PinholeCamera(800.0, 800.0, 320.0, 240.0, width=640, height=480)
    >>> sign = np.array([[0, 0, 0], [0.6, 0, 0], [0.6, 0.3, 0], [0.3, 0.3, 0], [0.3, 1, 0], [0, 1, 0]])
    >>> true = rp.Pose.from_quat([0.6, 0.0, 0.0, 0.8], [-0.2, 0.1, 4.0])
    >>> seen = rp.ImageRegion.from_polygon(camera.project(true @ sign))
    >>> estimate = rp.estimate_pose(camera, [seen], [rp.WorldRegion.from_polygon(sign)])
    >>> bool(np.allclose(estimate.pose.camera_center, true.camera_center, atol=1e-6))
    True

    """
    options = checked_solver(solver)
    problem, known = core_problem(camera, image_regions, world_regions, options), core_prior(prior)
    if options.driver == "native":
        found = estimate_from_core(
            problem.estimate(
                start=options.start,
                refine=options.refine,
                prior=known,
                frame_sigma=options.frame_sigma,
                limits=options.limits,
            )
        )
    else:
        search = problem.search(
            start=options.start,
            refine=options.refine,
            prior=known,
            frame_sigma=options.frame_sigma,
            limits=options.limits,
        )
        minima = [scipy_minimum(search, rotation, translation) for rotation, translation in search.candidates]
        found = estimate_from_core(search.assess(minima))
    if isinstance(found, PoseError):
        raise found
    return found
