"""From regions to a pose: the scipy Levenberg-Marquardt driver around the core, and batches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import groupby, islice
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.image_region import ImageRegion
from regionpose.pixel_edges import straight_bearings
from regionpose.pose import Pose
from regionpose.prior import Prior
from regionpose.world_region import WorldRegion

Array = NDArray[np.float64]
System = Literal["plane", "sphere"]
Integration = Literal["boundary", "mesh", "pixels"]
Driver = Literal["scipy", "native"]
Start = Literal["global", "paper"]
Refine = Literal["contour"]
Item = TypeVar("Item")
Region = TypeVar("Region", ImageRegion, WorldRegion)
Problem = tuple[Camera, Sequence[ImageRegion], Sequence[WorldRegion]]
Sides = tuple[list[_core.ObservedRegion], list[_core.WorldRegion]]

TOLERANCE = 1e-11
"""Relative change of cost and pose at which the scipy driver stops, as the native one."""

GRADIENT_TOLERANCE = 1e-15
"""Cosine between residual and Jacobian at which the scipy driver stops: MINPACK refuses to be told never to."""

MOST_EVALUATIONS = 140
"""Evaluations of the equations for one minimum, as of the native driver."""

TERMINATIONS = {
    1: "the cost changes less than the tolerance",
    2: "the pose changes less than the tolerance",
    3: "cost and pose change less than the tolerance",
    4: "the gradient is zero",
}
"""What ended an iteration that converged, by MINPACK's code, in the words of the native driver."""

OUT_OF_VIEW = 1e6
"""Residual where a region leaves the view, so that the step there is refused."""


class PoseError(ValueError):
    """No pose shows the regions as they were observed."""


@dataclass(frozen=True)
class PoseWarning:
    """Something to know before trusting a pose: a stable `code` and a sentence."""

    code: str
    message: str

    def __str__(self) -> str:
        """The code and the sentence."""
        return f"{self.code}: {self.message}"


@dataclass(frozen=True, eq=False, repr=False)
class Alternative(Pose):
    """Another pose that fits as well, its overlap error, covariance (6, 6) and confidence, as of `PoseEstimate`."""

    overlap_error: float = float("nan")
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.inf))
    confidence: float = float("nan")

    @property
    def pose(self) -> Pose:
        """The pose alone."""
        return Pose(self.rotation, self.translation)


@dataclass(frozen=True, eq=False)
class Crease:
    """A straight edge that two regions share where their planes meet.

    `regions`: their places in the lists. `ends` (2, 3): of the part that both image regions show, in the world, metres.
    """

    regions: tuple[int, int]
    ends: Array


@dataclass(frozen=True, eq=False)
class PoseEstimate:
    """The pose of a camera and what is known of it.

    `pose`: camera_from_world. `covariance`: (6, 6) of the left increment `[omega (rad), tau (metres)]`, `P' =
    exp(omega) P + tau`. `confidence`: probability that the true pose is within 5 degrees, as calibrated on synthetic
    problems (docs/math.md, section 15); poses that fit alike share it. `overlap_error`: area of the symmetric
    difference of projected and observed regions over the observed area (the paper's delta, on the sphere), a fraction;
    `region_overlap_errors` (k,) region by region. `boundary_noise`: standard deviation of the contour that the fit
    shows, pixels, of its clean part where the pose was refined on it; `disturbed_share`: the rest of the contour, a
    fraction, then. `alternatives`: other minima that fit as well and that the priors leave, best first. `evaluations`:
    of the equations, over all minima. `termination`: why the best minimum's iteration ended. `creases`: edges between
    regions that were evidence beside samples of a scan.
    """

    pose: Pose
    covariance: Array
    confidence: float
    overlap_error: float
    region_overlap_errors: Array
    boundary_noise: float
    disturbed_share: float | None
    alternatives: tuple[Alternative, ...]
    warnings: tuple[PoseWarning, ...]
    converged: bool
    termination: str
    evaluations: int
    creases: tuple[Crease, ...] = ()

    @property
    def rotation_sigma_deg(self) -> Array:
        """Standard deviations of the rotation about the camera's axes, (3,), degrees."""
        return np.degrees(np.sqrt(np.diag(self.covariance)[:3]))

    @property
    def translation_sigma(self) -> Array:
        """Standard deviations of the translation along the camera's axes, (3,), metres."""
        return np.sqrt(np.diag(self.covariance)[3:])


def estimate_pose(
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    *,
    prior: Prior | None = None,
    start: Start = "global",
    system: System = "plane",
    integration: Integration = "boundary",
    mesh_size: float | None = None,
    refine: Refine | None = "contour",
    driver: Driver = "scipy",
) -> PoseEstimate:
    """The pose `camera_from_world` from which each world region looks like the image region of its place in the list.

    No `prior` is needed (docs/math.md, section 7); it adds starts and, like the viewpoint of a region
    (`WorldRegion.seen_from`), rules out what lies elsewhere (section 10). `start="paper"` searches from the paper's own
    start alone (its sections 2.1.1, 2.2.1), or from the prior's initial pose alone if there is one. `system`: moments
    on each region's normalized plane or on the sphere; `integration`: sums over the boundary, a mesh, or (sphere,
    observed side) the mask's pixels. `mesh_size`: edge length of the mesh's triangles over the square root of the
    region's area; None is 1/8 on the sphere and, on the plane, where every mesh is exact, triangles between the
    boundary's vertices. `refine="contour"` leads the pose onto the observed contours where a part of them is disturbed
    (docs/math.md, section 11) or hidden (section 14). `driver` runs the final least squares of the moments.

    Weak, ambiguous or poorly fitting geometry is reported in `warnings`. ValueError for bad input; PoseError (a
    ValueError) where no pose shows every region.
    """
    if driver not in ("scipy", "native"):
        raise ValueError(f'driver is {driver!r}; needed "scipy" or "native"')
    if start not in ("global", "paper"):
        raise ValueError(f'start is {start!r}; needed "global" or "paper"')
    check_camera(camera, image_regions)
    problem = _core.Problem(
        observed_regions(camera, image_regions, integration),
        [region.core for region in checked_regions(world_regions, WorldRegion)],
        system=system,
        integration=integration,
        mesh_size=mesh_size,
    )
    known = core_prior(prior)
    if driver == "native":
        found = _estimate_or_error(problem.estimate(start=start, refine=refine, prior=known))
    else:
        search = problem.search(start=start, refine=refine, prior=known)
        minima = [scipy_minimum(search, rotation, translation) for rotation, translation in search.candidates]
        found = _estimate_or_error(search.judged(minima))
    if isinstance(found, PoseError):
        raise found
    return found


def estimate_poses(
    problems: Iterable[Problem],
    *,
    prior: Prior | Iterable[Prior | None] | None = None,
    refine: Refine | None = "contour",
    threads: int | None = None,
) -> list[PoseEstimate | PoseError]:
    """The estimates of many problems (camera, image_regions, world_regions), in order, by the native driver.

    A problem without an answer leaves the others theirs. In its place stands a PoseError: that of `estimate_pose` where
    no pose shows every region, or one that says what is wrong with a region that is refused. `prior`: what is known of
    every pose, or a list of what is known of each (None: nothing). They are solved without the interpreter on a pool of
    `threads` of its own (all cores when None) and are the same for
    any number of them. ValueError, its message led by the problem's number, for what is no problem at all.
    """
    listed = _listed(problems, "a list of problems (camera, image_regions, world_regions)")
    checked = [_checked_problem(index, problem) for index, problem in enumerate(listed)]
    mapped = _straight_bearings([(camera, regions) for camera, regions, _ in checked])
    sides = [_sides_or_error(*problem, bearings) for problem, bearings in zip(checked, mapped, strict=True)]
    told = zip(sides, _priors(prior, len(sides)), strict=True)
    whole = [(each, known) for each, known in told if not isinstance(each, PoseError)]
    batch, priors = [each for each, _ in whole], [known for _, known in whole]
    estimates = iter(_core.estimate_batch(batch, priors, threads=threads, refine=refine))
    return [each if isinstance(each, PoseError) else _estimate_or_error(next(estimates)) for each in sides]


def _checked_problem(index: int, problem: Problem) -> tuple[Camera, list[ImageRegion], list[_core.WorldRegion]]:
    """The parts of a problem; ValueError, led by its number, for one that is of the wrong kind."""
    try:
        camera, image_regions, world_regions = _problem_parts(problem)
        regions = check_camera(camera, image_regions)
        return camera, regions, [region.core for region in checked_regions(world_regions, WorldRegion)]
    except ValueError as error:
        raise ValueError(f"problem {index}: {error}") from error


def _sides_or_error(
    camera: Camera, regions: list[ImageRegion], worlds: list[_core.WorldRegion], bearings: list[Array] | None
) -> Sides | PoseError:
    """Both sides of a problem as the core takes them, or what is wrong with its image regions."""
    try:
        return observed_regions(camera, regions, "boundary", bearings), worlds
    except ValueError as error:
        return PoseError(str(error))


def _straight_bearings(sides: Sequence[tuple[Camera, list[ImageRegion]]]) -> list[list[Array] | None]:
    """The bearings of each problem's rings, those of neighbours by one camera mapped at once; None as of one alone."""
    mapped: list[list[Array] | None] = []
    for _, group in groupby(sides, key=lambda side: id(side[0])):
        problems = list(group)
        counts = [sum(len(region.rings) for region in regions) for _, regions in problems]
        whole = _ring_bearings(problems[0][0], [region for _, regions in problems for region in regions])
        following = iter(whole or ())
        mapped += [list(islice(following, count)) if whole else None for count in counts]
    return mapped


def _ring_bearings(camera: Camera, regions: Sequence[ImageRegion]) -> list[Array] | None:
    """The bearings of all rings of some regions, as of `straight_bearings`."""
    return straight_bearings(camera, [ring for region in regions for ring in region.rings_on_border(camera)])


def _problem_parts(problem: Problem) -> Problem:
    parts = _listed(problem, "(camera, image_regions, world_regions)")
    if len(parts) != 3:
        raise ValueError(f"found {len(parts)} items; needed (camera, image_regions, world_regions)")
    return problem


def check_camera(camera: Camera, image_regions: Sequence[ImageRegion]) -> list[ImageRegion]:
    """The regions as a list; ValueError unless it is a camera whose image has the shape of each region's mask."""
    if not isinstance(camera, Camera):
        raise ValueError(f"camera is a {type(camera).__name__}; needed one of the regionpose cameras")
    regions = checked_regions(image_regions, ImageRegion)
    for index, region in enumerate(regions):
        if region.mask is None or camera.width is None or camera.height is None:
            continue
        if region.mask.shape != (camera.height, camera.width):
            needed = (camera.height, camera.width)
            raise ValueError(
                f"image region {index} has a mask of shape {region.mask.shape}; the camera's image is {needed}"
            )
    return regions


def checked_regions(regions: Sequence[Region], kind: type[Region]) -> list[Region]:
    """The regions as a list; ValueError naming the first that is of another kind."""
    listed = _listed(regions, f"a list of {kind.__name__}s")
    for index, region in enumerate(listed):
        if not isinstance(region, kind):
            raise ValueError(f"region {index} is a {type(region).__name__}; needed a {kind.__name__}")
    return listed


def _listed(items: Iterable[Item], needed: str) -> list[Item]:
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
    straight = mapped or _ring_bearings(camera, regions)
    following, observed = iter(straight or ()), []
    for index, region in enumerate(regions):
        try:
            bearings = list(islice(following, len(region.rings))) if straight else region.bearings(camera)
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


def core_prior(prior: Prior | None) -> _core.Prior | None:
    """The prior as the core takes it; ValueError for what is none."""
    if prior is None or isinstance(prior, Prior):
        return None if prior is None else prior.core
    raise ValueError(f"prior is a {type(prior).__name__}; needed a Prior or None")


def _priors(prior: Prior | Iterable[Prior | None] | None, count: int) -> list[_core.Prior | None]:
    """One for each of so many problems."""
    if prior is None or isinstance(prior, Prior):
        return [core_prior(prior)] * count
    try:
        listed = list(prior)
    except TypeError as error:
        raise ValueError(f"prior is a {type(prior).__name__}; needed a Prior, a list of them or None") from error
    if len(listed) != count:
        raise ValueError(f"prior has {len(listed)} items; needed one Prior, or a list of one for each problem, {count}")
    return [core_prior(each) for each in listed]


def scipy_minimum(search: _core.Search, rotation: Array, translation: Array) -> _core.Minimum:
    """The whitened minimum that scipy's Levenberg-Marquardt (MINPACK) reaches by one left increment of a candidate."""
    # Loaded when first used: batches and the native driver do without.
    from scipy.optimize import leastsq

    increments = _Increments(search, rotation, translation)
    if increments.out_of_view:
        return _core.Minimum(rotation, translation, np.inf, False, "a region left the view", 1)
    counted, _, details, message, code = leastsq(
        increments.residual,
        increments.unit,
        Dfun=increments.jacobian,
        full_output=True,
        ftol=TOLERANCE,
        xtol=TOLERANCE,
        gtol=GRADIENT_TOLERANCE,
        maxfev=MOST_EVALUATIONS,
    )
    moved = _core.moved_pose(rotation, translation, counted - increments.unit)
    cost, termination = float(details["fvec"] @ details["fvec"]), TERMINATIONS.get(code, " ".join(message.split()))
    return _core.Minimum(*moved, cost, code in TERMINATIONS, termination, int(details["nfev"]))


class _Increments:
    """The whitened equations as functions of one left increment (6,) of a pose, counted from `unit`.

    The unit is a radian about each axis and the distance along each, so that the solver's relative tolerance means
    those.
    """

    def __init__(self, search: _core.Search, rotation: Array, translation: Array) -> None:
        first = search.evaluate(rotation, translation, np.zeros(6))
        distance = search.distance(rotation, translation)
        self.unit = np.array([1.0, 1.0, 1.0, distance, distance, distance])
        self._at, self._evaluation = self.unit.tobytes(), first
        self._search, self._start = search, (rotation, translation)
        self.out_of_view = first is None
        self._count = 0 if first is None else len(first[0])

    def residual(self, counted: Array) -> Array:
        """Residuals (m,), large where a region is out of view."""
        evaluation = self._evaluated(counted)
        return np.full(self._count, OUT_OF_VIEW) if evaluation is None else evaluation[0]

    def jacobian(self, counted: Array) -> Array:
        """Derivatives (m, 6) by the increment."""
        evaluation = self._evaluated(counted)
        return np.zeros((self._count, 6)) if evaluation is None else evaluation[1]

    def _evaluated(self, counted: Array) -> tuple[Array, Array] | None:
        # As bytes: numpy takes longer to compare six numbers than to copy them.
        at = counted.tobytes()
        if at != self._at:
            self._at = at
            self._evaluation = self._search.evaluate(*self._start, counted - self.unit)
        return self._evaluation


def _estimate_or_error(estimate: _core.Estimate | str | None) -> PoseEstimate | PoseError:
    if isinstance(estimate, str):
        return PoseError(estimate)
    if estimate is None:
        return PoseError(
            "no pose shows every world region where its image region is; check that the pairs belong together"
        )
    best = estimate.best
    alternatives = tuple(
        Alternative(
            # From a matrix, of which scipy checks that it is a rotation, it takes five times as long.
            Rotation.from_quat(solution.quaternion),
            solution.translation,
            overlap_error=solution.overlap_error,
            covariance=solution.covariance,
            confidence=solution.confidence,
        )
        for solution in estimate.alternatives
    )
    return PoseEstimate(
        pose=Pose.of_quaternion(best.quaternion, best.translation),
        covariance=best.covariance,
        confidence=best.confidence,
        overlap_error=best.overlap_error,
        region_overlap_errors=best.region_overlap_errors,
        boundary_noise=estimate.boundary_noise,
        disturbed_share=estimate.disturbed_share,
        alternatives=alternatives,
        warnings=tuple(PoseWarning(code, message) for code, message in estimate.warnings),
        converged=best.converged,
        termination=best.termination,
        evaluations=estimate.evaluations,
        creases=tuple(Crease((first, second), ends) for (first, second), ends in estimate.creases),
    )
