"""The sides of regions as the core takes them, checked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import islice
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.geometry.pose import Pose
from regionpose.regions.image import ImageRegion
from regionpose.regions.pixel_edges import bearings_of_rings
from regionpose.regions.world import WorldRegion
from regionpose.solve.options import Integration, Solver
from regionpose.solve.prior import Prior
from regionpose.validation.arguments import checked_arguments

Array = NDArray[np.float64]
Item = TypeVar("Item")
Region = TypeVar("Region", ImageRegion, WorldRegion)


def core_problem(
    camera: Camera, image_regions: Sequence[ImageRegion], world_regions: Sequence[WorldRegion], solver: Solver
) -> _core.Problem:
    """The problem of two sides by a solver's equations; ValueError for what is wrong with one of them."""
    images = check_camera(camera, image_regions)
    observed = observed_regions(camera, images, solver.integration)
    return problem_of(observed, [region.core for region in checked_regions(world_regions, WorldRegion)], solver)


def problem_of(
    observed: Sequence[_core.ObservedRegion], worlds: Sequence[_core.WorldRegion], solver: Solver
) -> _core.Problem:
    """The problem of two sides as the core takes them, by a solver's equations."""
    return _core.Problem(
        observed, worlds, system=solver.system, integration=solver.integration, mesh_size=solver.mesh_size
    )


@checked_arguments
def overlap_errors(
    camera: Camera, image_regions: Sequence[ImageRegion], world_regions: Sequence[WorldRegion], pose: Pose
) -> tuple[float, Array]:
    """The overlap errors of regions at a pose, as `PoseEstimate` has them, cut at the image's border.

    Parameters
    ----------
    camera : Camera
        That saw the image regions.
    image_regions, world_regions : sequence of ImageRegion, sequence of WorldRegion
        The two sides, each pair at the same place of its list.
    pose : Pose
        `camera_from_world`.

    Returns
    -------
    float, (k,) array
        Of all regions together and of each, fractions; 1 where nothing of a region is shown.

    Raises
    ------
    ValueError
        As of `estimate_pose`.

    """
    problem = core_problem(camera, image_regions, world_regions, Solver())
    return problem.overlap_errors(pose.rotation_matrix, pose.translation)


def check_camera(camera: Camera, image_regions: Sequence[ImageRegion]) -> list[ImageRegion]:
    """The regions as a list; ValueError unless it is a camera whose image has the shape of each region's mask."""
    if not isinstance(camera, Camera):
        raise ValueError(f"camera is a {type(camera).__name__}; needed a Camera")
    regions = checked_regions(image_regions, ImageRegion)
    for index, region in enumerate(regions):
        if region.mask is not None:
            camera.check_size(region.mask.shape, f"mask of image region {index}")
    return regions


def checked_regions(regions: Sequence[Region], kind: type[Region]) -> list[Region]:
    """The regions as a list; ValueError naming the first that is of another kind."""
    items = listed(regions, f"a list of {kind.__name__}s")
    for index, region in enumerate(items):
        if not isinstance(region, kind):
            raise ValueError(f"region {index} is a {type(region).__name__}; needed a {kind.__name__}")
    return items


def listed(items: Iterable[Item], needed: str) -> list[Item]:
    """The items as a list; ValueError for what has none."""
    try:
        return list(items)
    except TypeError as error:
        raise ValueError(f"found a {type(items).__name__}; needed {needed}") from error


def observed_regions(
    camera: Camera, regions: Sequence[ImageRegion], integration: Integration, mapped: list[Array] | None = None
) -> list[_core.ObservedRegion]:
    """The regions as the core takes them; ValueError naming the first that holds pixels without a ray.

    `mapped`: bearings (n, 3) of their rings, one after another; None where they are to be found.
    """
    mapped = mapped or ring_bearings(camera, regions)
    following, observed = iter(mapped or ()), []
    for index, region in enumerate(regions):
        try:
            bearings = list(islice(following, len(region.rings))) if mapped else region.bearings(camera)
            borders, hidden = region.border_bearings(camera), region.hidden_bearings(camera)
            pixels = region.pixel_bearings(camera) if integration == "pixels" else (None, None)
        except ValueError as error:
            raise ValueError(f"image region {index}: {error}") from error
        observed.append(
            _core.ObservedRegion(
                bearings,
                region.area,
                borders=borders,
                hidden=hidden,
                pixel_bearings=pixels[0],
                pixel_solid_angles=pixels[1],
            )
        )
    return observed


def ring_bearings(camera: Camera, regions: Sequence[ImageRegion]) -> list[Array] | None:
    """The bearings of all rings of some regions, as of `bearings_of_rings`."""
    return bearings_of_rings(camera, [ring for region in regions for ring in region.rings_on_border(camera)])


def core_prior(prior: Prior | None) -> _core.Prior | None:
    """The prior as the core takes it; ValueError for what is none."""
    if prior is None or isinstance(prior, Prior):
        return None if prior is None else prior.core
    raise ValueError(f"prior is a {type(prior).__name__}; needed a Prior or None")
