"""The poses of many problems at once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby, islice
from typing import cast

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.core_inputs import (
    check_camera,
    checked_regions,
    core_prior,
    listed,
    observed_regions,
    ring_bearings,
)
from regionpose.solve.estimate import PoseError, PoseEstimate, estimate_from_core
from regionpose.solve.options import Solver, checked_solver
from regionpose.solve.prior import Prior

Array = NDArray[np.float64]
PoseProblem = tuple[Camera, Sequence[ImageRegion], Sequence[WorldRegion]]
Checked = tuple[Camera, list[ImageRegion], list[_core.WorldRegion]]
Sides = tuple[list[_core.ObservedRegion], list[_core.WorldRegion]]


def estimate_poses(
    problems: Iterable[PoseProblem],
    *,
    prior: Prior | Iterable[Prior | None] | None = None,
    solver: Solver | None = None,
    threads: int | None = None,
) -> list[PoseEstimate | PoseError]:
    """The estimates of many problems, in order, by the native driver.

    A failed problem returns a PoseError in its slot. Problems are solved without the interpreter on a pool of threads
    of its own, and are the same for any number of them.

    Parameters
    ----------
    problems : iterable of tuples
        Each (camera, image_regions, world_regions), as of `estimate_pose`.
    prior : Prior, iterable of Prior or None
        What is known of every pose, or a list of what is known of each (None: nothing).
    solver : Solver, optional
        How the poses are computed; its driver is native.
    threads : int, optional
        How many work at once; all cores when None.

    Returns
    -------
    list of PoseEstimate or PoseError
        In place of an estimate a PoseError: that of `estimate_pose` where no pose shows every region, or the reason
        for refusing a problem, such as a mask of another size.

    Raises
    ------
    ValueError
        For an item that does not hold three parts, with its number first, and for other options.

    Examples
    --------
    >>> import regionpose as rp
    >>> rp.estimate_poses([])
    []

    """
    options = native(solver)
    given = [_parts(index, problem) for index, problem in enumerate(listed(problems, PROBLEMS))]
    sides = _sides([_checked(*parts) for parts in given], options)
    paired = zip(sides, _priors(prior, len(sides)), strict=True)
    whole = [(each, known) for each, known in paired if not isinstance(each, PoseError)]
    batch, priors = [each for each, _ in whole], [known for _, known in whole]
    estimates = iter(core_batch(batch, priors, options, threads))
    return [each if isinstance(each, PoseError) else estimate_from_core(next(estimates)) for each in sides]


PROBLEMS = "a list of problems (camera, image_regions, world_regions)"


def native(solver: Solver | None) -> Solver:
    """The options of what is solved in the core alone; ValueError for scipy's driver."""
    options = checked_solver(solver)
    if options.driver == "scipy":
        raise ValueError('driver is "scipy"; needed "native" for many poses at once')
    return options


def core_batch(
    batch: Sequence[Sides], priors: Sequence[_core.Prior | None], solver: Solver, threads: int | None
) -> list[_core.Estimate | str | None]:
    """The core's estimates of many problems by a solver's equations."""
    return _core.estimate_batch(
        batch,
        priors,
        threads=threads,
        system=solver.system,
        integration=solver.integration,
        mesh_size=solver.mesh_size,
        start=solver.start,
        refine=solver.refine,
        frame_sigma=solver.frame_sigma,
        limits=solver.limits,
    )


def _parts(index: int, problem: PoseProblem) -> PoseProblem:
    """The three parts of a problem; ValueError that begins with its number for other counts."""
    try:
        parts = listed(problem, "(camera, image_regions, world_regions)")
    except ValueError as error:
        raise ValueError(f"problem {index}: {error}") from error
    if len(parts) != 3:
        raise ValueError(f"problem {index}: found {len(parts)} items; needed (camera, image_regions, world_regions)")
    return cast(PoseProblem, tuple(parts))


def _checked(
    camera: Camera, image_regions: Sequence[ImageRegion], world_regions: Sequence[WorldRegion]
) -> Checked | PoseError:
    """The parts of a problem, or what is wrong with one of them."""
    try:
        regions = check_camera(camera, image_regions)
        return camera, regions, [region.core for region in checked_regions(world_regions, WorldRegion)]
    except ValueError as error:
        return PoseError(str(error))


def _sides(problems: Sequence[Checked | PoseError], solver: Solver) -> list[Sides | PoseError]:
    """Both sides of each problem as the core takes them, or what is wrong with it."""
    whole = [(camera, regions) for camera, regions, _ in (each for each in problems if not isinstance(each, PoseError))]
    mapped = iter(_mapped_rings(whole))
    return [each if isinstance(each, PoseError) else _sides_or_error(*each, next(mapped), solver) for each in problems]


def _sides_or_error(
    camera: Camera,
    regions: list[ImageRegion],
    worlds: list[_core.WorldRegion],
    bearings: list[Array] | None,
    solver: Solver,
) -> Sides | PoseError:
    """Both sides of a problem as the core takes them, or what is wrong with its image regions."""
    try:
        return observed_regions(camera, regions, solver.integration, bearings), worlds
    except ValueError as error:
        return PoseError(str(error))


def _mapped_rings(sides: Sequence[tuple[Camera, list[ImageRegion]]]) -> list[list[Array] | None]:
    """The bearings of each problem's rings, those of neighbors by one camera mapped at once; None as of one alone."""
    mapped: list[list[Array] | None] = []
    for _, group in groupby(sides, key=lambda side: id(side[0])):
        problems = list(group)
        counts = [sum(len(region.rings) for region in regions) for _, regions in problems]
        whole = ring_bearings(problems[0][0], [region for _, regions in problems for region in regions])
        following = iter(whole or ())
        mapped += [list(islice(following, count)) if whole else None for count in counts]
    return mapped


def _priors(prior: Prior | Iterable[Prior | None] | None, count: int) -> list[_core.Prior | None]:
    """One for each of so many problems."""
    if prior is None or isinstance(prior, Prior):
        return [core_prior(prior)] * count
    try:
        given = list(prior)
    except TypeError as error:
        raise ValueError(f"prior is a {type(prior).__name__}; needed a Prior, a list of them or None") from error
    if len(given) != count:
        raise ValueError(f"prior has {len(given)} items; needed one Prior, or a list of one for each problem, {count}")
    return [core_prior(each) for each in given]
