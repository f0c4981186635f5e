"""Which image region is which world region: hypotheses of single pairs, verified by the pose of all."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from regionpose import _core
from regionpose.cameras import Camera
from regionpose.regions.image import ImageRegion
from regionpose.regions.world import WorldRegion
from regionpose.solve.batch import core_batch
from regionpose.solve.core_inputs import check_camera, checked_regions, core_prior, observed_regions, problem_of
from regionpose.solve.estimate import PoseError, PoseEstimate
from regionpose.solve.options import Solver, checked_solver
from regionpose.solve.prior import Prior
from regionpose.solve.single import estimate_pose
from regionpose.solve.warning import PoseWarning
from regionpose.solve.warning_code import WarningCode
from regionpose.validation.arguments import checked_arguments
from regionpose.validation.arrays import real_rows

Array = NDArray[np.float64]
Pair = tuple[int, int]
Pairs = tuple[Pair, ...]

MATCHED_OVERLAP = 0.15
"""Overlap error (a fraction) up to which two regions are a pair: three times the 5 % at which the paper calls a pose
solved, for contours that a segmentation has disturbed by as much; shapes that differ leave about 0.4."""

REACH = 1.0
"""Largest distance between observed and predicted centroid, in square roots of the observed solid angle: the pose of
one region, a few degrees off where its contour is disturbed, predicts its neighbors to less."""

MOST_SIZE_RATIO = 3.0
"""Largest ratio of observed to predicted solid angle, either way, for the same reason."""

LEAST_ANCHORS = 3
"""Image regions whose pairs are tried before the search may end: the pose of one alone can be poor."""

MOST_ROUNDS = 4
"""Rounds of assigning and solving from one hypothesis; the second or third adds nothing to the one before."""

AS_MUCH_SCORE = 0.5
"""Margin in the score below which another assignment may explain the image as well: half of a pair that fits
exactly."""

AS_MUCH_NOISE = 2.0
"""Ratio of boundary noises above which it doesn't, whatever its score. It is far above their scatter; an arrangement
that is off by a fraction of a region leaves tens of times the noise."""

AMBIGUITY = 25.0
"""Variances by which a prior has to count more against an assignment's pose to rule it out, as between poses of one
(docs/math.md, eq. 10.6)."""


@dataclass(frozen=True, eq=False)
class RegionMatches:
    """Which image region is which world region, and the pose of these pairs.

    Parameters
    ----------
    pairs : tuple of (int, int)
        Image index and world index, by image index.
    unmatched_image, unmatched_world : tuple of int
        The indices left over.
    estimate : PoseEstimate
        Of the pairs in this order, so that its k-th region is `pairs[k]`.
    alternatives : tuple of pairs
        Others that explain the image about as well, best first.
    warnings : tuple of PoseWarning
        "ambiguous-matching" where there are alternatives, "unconfirmed-matching" where a single pair was found among
        several regions; those of the pose are in `estimate.warnings`.
    """

    pairs: Pairs
    unmatched_image: tuple[int, ...]
    unmatched_world: tuple[int, ...]
    estimate: PoseEstimate
    alternatives: tuple[Pairs, ...]
    warnings: tuple[PoseWarning, ...]


@checked_arguments
def match_regions(
    camera: Camera,
    image_regions: Sequence[ImageRegion],
    world_regions: Sequence[WorldRegion],
    *,
    known: Sequence[Pair] = (),
    prior: Prior | None = None,
    solver: Solver | None = None,
    threads: int | None = None,
) -> RegionMatches:
    """The pairs of image and world regions that one pose explains best, and the pose.

    The pose of each single pair predicts where all other regions project; the nearest are assigned one to one, solved
    together, and kept where the overlap error delta of each is below 15 % (docs/math.md, sections 7 and 8). A pair
    counts `1 - (delta / 15 %)^2`, the truncated quadratic loss of MSAC (Torr and Zisserman 2000); the greatest sum
    wins. Regions stay unmatched that are hidden, cut off, seen from behind (`WorldRegion.with_viewpoint`), given by one
    scan line alone or without a partner. `alternatives` and a warning report other assignments that the prior leaves.

    Parameters
    ----------
    camera : Camera
        That saw the image regions.
    image_regions : sequence of ImageRegion
        What the image shows, pixels, in any order.
    world_regions : sequence of WorldRegion
        What the world holds, meters, in any order.
    known : sequence of (int, int)
        Image and world indices of regions that are known to be the same: they stay pairs, and their poses alone
        predict where the others project.
    prior : Prior, optional
        What is known of the pose; it decides between assignments that explain about as much.
    solver : Solver, optional
        How the poses are computed; its driver is that of the pose of all pairs, the others are native.
    threads : int, optional
        How many work at once; all cores when None. It changes the time alone.

    Returns
    -------
    RegionMatches
        The pairs, the pose of all, and other assignments.

    Raises
    ------
    ValueError
        For bad input.
    PoseError
        A ValueError, where no image region looks like any world region.

    """
    options = checked_solver(solver)
    images, worlds = checked_regions(image_regions, ImageRegion), checked_regions(world_regions, WorldRegion)
    sides = _Sides.of(camera, images, worlds, core_prior(prior), options, _checked_pairs(known, images, worlds))
    sides.check()
    consensuses, least = _from_known(sides) if sides.known else _consensuses(sides, threads)
    if not consensuses:
        raise PoseError(
            f"none of {len(sides.observed)} image regions looks like any of {len(sides.worlds)} world regions: the best"
            f" pair has an overlap error of {100.0 * least:.1f} %; needed up to {100.0 * MATCHED_OVERLAP:.0f} %"
        )
    assignments = _completed(sides, _best(sides, consensuses))
    pairs = assignments[0]
    paired = [images[i] for i, _ in pairs], [worlds[j] for _, j in pairs]
    estimate = estimate_pose(camera, *paired, prior=prior, solver=options)
    return RegionMatches(
        pairs=pairs,
        unmatched_image=tuple(sorted({*range(len(images))} - {i for i, _ in pairs})),
        unmatched_world=tuple(sorted({*range(len(worlds))} - {j for _, j in pairs})),
        estimate=estimate,
        alternatives=tuple(assignments[1:]),
        warnings=_warnings(assignments, sides),
    )


@dataclass(frozen=True)
class _Sides:
    """Both sides of all regions: for the core, and as centroids and sizes; and what is known of the pose.

    Of the k observed ones `bearings` (k, 3) of the centroids and `solid_angles` (k,); of the m world ones `centroids`
    (m, 3), `normals` (m, 3), `areas` (m,), and `facing` (m,): 1 where the camera has to be on the normal's side, -1
    where on the other, 0 where it may be on either.
    """

    observed: list[_core.ObservedRegion]
    worlds: list[_core.WorldRegion]
    bearings: Array
    solid_angles: Array
    centroids: Array
    normals: Array
    areas: Array
    facing: Array
    prior: _core.Prior | None
    solver: Solver
    known: Pairs

    @classmethod
    def of(
        cls,
        camera: Camera,
        images: list[ImageRegion],
        worlds: list[WorldRegion],
        prior: _core.Prior | None,
        solver: Solver,
        known: Pairs,
    ) -> _Sides:
        """Both sides as this camera sees them."""
        check_camera(camera, images)
        if not (images and worlds):
            raise ValueError(f"there are {len(images)} image and {len(worlds)} world regions; needed at least one each")
        observed = observed_regions(camera, images, solver.integration)
        moments = [_core.spherical_moments(region.bearings(camera), 1) for region in images]
        sums = np.array([[m[1, 0, 0], m[0, 1, 0], m[0, 0, 1]] for m in moments])
        return cls(
            observed=observed,
            worlds=[_outline(region.core) for region in worlds],
            bearings=sums / np.linalg.norm(sums, axis=1, keepdims=True),
            solid_angles=np.array([m[0, 0, 0] for m in moments]),
            centroids=np.array([_centroid(region.core) for region in worlds]),
            normals=np.array([region.normal for region in worlds]),
            areas=np.array([region.area for region in worlds]),
            facing=np.array([_facing(region.core) for region in worlds]),
            prior=prior,
            solver=solver,
            known=known,
        )

    def check(self) -> None:
        """Nothing; ValueError for an image region that the core refuses."""
        try:
            self.problem([(index, 0) for index in range(len(self.observed))])
        except ValueError as error:
            raise ValueError(f"image {error}") from error

    def problem(self, pairs: Sequence[Pair]) -> _core.Problem:
        """The problem of these pairs."""
        observed, worlds = [self.observed[i] for i, _ in pairs], [self.worlds[j] for _, j in pairs]
        return problem_of(observed, worlds, self.solver)

    def near(self, pose: _core.Solution) -> list[Pair]:
        """The pairs that a pose predicts, nearest first: one to one, in reach of one another and of similar size."""
        rotation = pose.rotation
        points = self.centroids @ rotation.T + pose.translation
        distances = np.linalg.norm(points, axis=1)
        rays = points / distances[:, None]
        cosines = np.sum(self.normals @ rotation.T * rays, axis=1)
        solid_angles = self.areas * np.abs(cosines) / distances**2
        gaps = np.linalg.norm(self.bearings[:, None] - rays[None], axis=2) / np.sqrt(self.solid_angles)[:, None]
        ratios = np.abs(np.log(np.maximum(solid_angles, np.finfo(float).tiny)[None] / self.solid_angles[:, None]))
        refused = (gaps > REACH) | (ratios > np.log(MOST_SIZE_RATIO)) | (self.facing * cosines > 0.0)
        for image, world in self.known:
            refused[image], refused[:, world] = True, True
            refused[image, world] = False
        # Above the sum of all others: a refused pair is taken only where nothing else is left.
        out_of_reach = min(refused.shape) * (REACH + np.log(MOST_SIZE_RATIO)) + 1.0
        costs = np.where(refused, out_of_reach, gaps + ratios)
        costs[tuple(np.reshape(self.known, (-1, 2)).astype(np.intp).T)] = 0.0
        # Loaded when first used, as scipy's driver is.
        from scipy.optimize import linear_sum_assignment

        rows, columns = linear_sum_assignment(costs)
        order = np.argsort(costs[rows, columns], kind="stable")
        return [(int(i), int(j)) for i, j in zip(rows[order], columns[order], strict=True) if not refused[i, j]]

    def solved(self, pairs: Iterable[Pair], start: _core.Solution, *, refined: bool = False) -> _Consensus | None:
        """The consensus of all the pairs, solved from a pose; None unless each of them fits."""
        refine = self.solver.refine if refined else None
        ordered = tuple(sorted(pairs))
        initial = _core.Prior(initial=(start.rotation, start.translation))
        estimate = self.problem(ordered).estimate(start="paper", prior=initial, refine=refine)
        found = [pair not in self.known for pair in ordered]
        if estimate is None or not (estimate.best.region_overlap_errors[found] <= MATCHED_OVERLAP).all():
            return None
        return _Consensus.of(ordered, estimate.best, estimate.boundary_noise)


def _outline(world: _core.WorldRegion) -> _core.WorldRegion:
    """The region by its outline: its samples would make each of many poses more exact than a hypothesis needs."""
    if world.samples is None:
        return world
    outline = _core.WorldRegion.from_outline(world.origin, world.axes[:2], world.outline)
    return outline if world.viewpoint is None else outline.with_viewpoint(world.viewpoint)


def _centroid(world: _core.WorldRegion) -> Array:
    """The area centroid in the world, (3,)."""
    moments = _core.planar_moments(world.outline, 1)
    flat = np.array([moments[1, 0], moments[0, 1]]) / moments[0, 0]
    centroid: Array = world.origin + flat @ world.axes[:2]
    return centroid


def _facing(world: _core.WorldRegion) -> float:
    """The side of the region's normal, 1 or -1, on which its viewpoint lies; 0 without one."""
    return 0.0 if world.viewpoint is None else float(np.sign(world.axes[2] @ (world.viewpoint - world.origin)))


@dataclass(frozen=True)
class _Consensus:
    """Pairs that one pose explains, how well (`match_regions`), and the noise of their boundaries in pixels."""

    pairs: Pairs
    pose: _core.Solution
    score: float
    noise: float

    @classmethod
    def of(cls, pairs: Pairs, solution: _core.Solution, noise: float) -> _Consensus:
        """The consensus of a solution of these pairs."""
        losses = np.minimum(solution.region_overlap_errors / MATCHED_OVERLAP, 1.0) ** 2
        return cls(pairs, solution, float(np.sum(1.0 - losses)), noise)

    def is_another(self, other: _Consensus) -> bool:
        """Whether a region has another partner here than there, or no pair is the same."""
        there, back = dict(other.pairs), {j: i for i, j in other.pairs}
        contradicts = any(there.get(i, j) != j or back.get(j, i) != i for i, j in self.pairs)
        return contradicts or not {*self.pairs} & {*other.pairs}


def _consensuses(sides: _Sides, threads: int | None) -> tuple[list[_Consensus], float]:
    """What the poses of single pairs grow to, and the least overlap error of those pairs.

    Image regions are tried in turn, the largest first. What shares none of those tried has at most the score of as many
    exact pairs as regions are left: when that is too little, nothing left can explain as much.
    """
    found: list[_Consensus] = []
    needed, least = 0.0, np.inf
    for tried, anchor in enumerate(np.argsort(-sides.solid_angles, kind="stable").tolist()):
        if tried >= LEAST_ANCHORS and len(sides.observed) - tried < needed:
            break
        for error, alone in _single_pairs(sides, anchor, threads):
            least = min(least, error)
            if error <= MATCHED_OVERLAP:
                found.append(_grown(sides, alone, needed))
                needed = max(needed, found[-1].score - AS_MUCH_SCORE)
    return found, least


def _from_known(sides: _Sides) -> tuple[list[_Consensus], float]:
    """What the poses of the known pairs grow to, and infinity: no pair is asked alone."""
    estimate = sides.problem(sides.known).estimate(prior=sides.prior)
    if estimate is None:
        raise PoseError(f"no pose shows the {len(sides.known)} regions whose pairs are known")
    poses = [estimate.best, *estimate.alternatives]
    alone = [_Consensus.of(sides.known, pose, estimate.boundary_noise) for pose in poses]
    return [_grown(sides, each, 0.0) for each in alone], float("inf")


def _checked_pairs(known: Sequence[Pair], images: list[ImageRegion], worlds: list[WorldRegion]) -> Pairs:
    """The known pairs by image index; ValueError for an index that is none or that stands in two."""
    if isinstance(known, Sequence) and not len(known):
        return ()
    pairs = real_rows(known, "known", 2)
    if pairs.dtype.kind == "f":
        raise ValueError(f"known has type {pairs.dtype}; needed indices (n, 2)")
    for side, count in enumerate((len(images), len(worlds))):
        places = pairs[:, side].tolist()
        if len({*places}) < len(places) or any(not 0 <= place < count for place in places):
            what = ("image", "world")[side]
            raise ValueError(f"known names the {what} regions {places}; needed different indices from 0 to {count - 1}")
    return tuple(sorted((i, j) for i, j in pairs.tolist()))


def _single_pairs(sides: _Sides, image: int, threads: int | None) -> list[tuple[float, _Consensus]]:
    """Overlap error and consensus of one image region with each world region, one for each pose, best first."""
    problems = [([sides.observed[image]], [world]) for world in sides.worlds]
    priors, moments = [sides.prior] * len(problems), replace(sides.solver, refine=None)
    estimates = core_batch(problems, priors, moments, threads)
    single = [
        (solution.overlap_error, _Consensus.of(((image, world),), solution, estimate.boundary_noise))
        for world, estimate in enumerate(estimates)
        if isinstance(estimate, _core.Estimate)
        for solution in [estimate.best, *estimate.alternatives]
        if np.isfinite(solution.overlap_error)
    ]
    return sorted(single, key=lambda pair: pair[0])


def _grown(sides: _Sides, alone: _Consensus, needed: float) -> _Consensus:
    """The consensus of a single pair, or a part of it where that can't reach the score that is needed."""
    current = alone
    for _ in range(MOST_ROUNDS):
        near = sides.near(current.pose)
        if len(near) < max(needed, 2):
            break
        grown = sides.solved(near, current.pose) or _extended(sides, current, near, needed)
        if len(grown.pairs) <= len(current.pairs):
            break
        current = grown
    return current


def _extended(
    sides: _Sides, consensus: _Consensus, near: list[Pair], needed: float = 0.0, *, refined: bool = False
) -> _Consensus:
    """The consensus and those of the pairs, one after the other, that fit together with it."""
    images, worlds = (set(side) for side in zip(*consensus.pairs, strict=True))
    free = [(i, j) for i, j in near if i not in images and j not in worlds]
    for tried, pair in enumerate(free):
        if len(consensus.pairs) + len(free) - tried < needed:
            break
        consensus = sides.solved([*consensus.pairs, pair], consensus.pose, refined=refined) or consensus
    return consensus


def _best(sides: _Sides, consensuses: list[_Consensus]) -> list[_Consensus]:
    """The one that explains the most and the other readings that explain about as much and that the prior leaves, best
    first.
    """
    confirmed = [each for each in consensuses if _is_confirmed(sides.prior, each)] or consensuses
    first = max(confirmed, key=lambda each: each.score)
    alike = [
        each
        for each in confirmed
        if each.score >= first.score - AS_MUCH_SCORE
        and each.noise <= AS_MUCH_NOISE * first.noise
        and (each.pairs == first.pairs or each.is_another(first))
    ]
    penalties = [_penalty(sides.prior, each.pose) for each in alike]
    left = [each for each, penalty in zip(alike, penalties, strict=True) if penalty <= min(penalties) + AMBIGUITY]
    return sorted(left, key=lambda each: -each.score)


def _is_confirmed(prior: _core.Prior | None, consensus: _Consensus) -> bool:
    """Whether a second pair supports a consensus, or the prior does not rule it out."""
    return len(consensus.pairs) > 1 or _penalty(prior, consensus.pose) <= AMBIGUITY


def _completed(sides: _Sides, consensuses: list[_Consensus]) -> list[Pairs]:
    """The different pairs of the consensuses, in order, with what joins them at a refined pose."""
    distinct: dict[Pairs, _Consensus] = {}
    for each in consensuses:
        distinct.setdefault(each.pairs, each)
    completed = [_extended(sides, each, sides.near(each.pose), refined=True) for each in distinct.values()]
    return list(dict.fromkeys(each.pairs for each in completed))


def _penalty(prior: _core.Prior | None, pose: _core.Solution) -> float:
    """What the prior counts against a pose, in variances."""
    return 0.0 if prior is None else prior.penalty(pose.rotation, pose.translation, pose.covariance)


def _warnings(assignments: list[Pairs], sides: _Sides) -> tuple[PoseWarning, ...]:
    warnings = []
    if len(assignments) > 1:
        warnings.append(PoseWarning(WarningCode.AMBIGUOUS_MATCHING, values={"others": len(assignments) - 1}))
    images, worlds = len(sides.observed), len(sides.worlds)
    if len(assignments[0]) == 1 and images * worlds > 1:
        warnings.append(PoseWarning(WarningCode.UNCONFIRMED_MATCHING, values={"images": images, "worlds": worlds}))
    return tuple(warnings)
