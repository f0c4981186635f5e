"""Hypotheses that explain photos and clouds: solutions of regions, edges about these, and edges alone (docs/math.md,
section 18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import expit

from regionpose.alignment.edge_frame import EdgeFrame
from regionpose.alignment.hypotheses import Cluster, Hypothesis, log_sum, priors_of, solutions_of
from regionpose.alignment.odds import CHANCE_PRIOR, UNINFORMATIVE_PRIOR
from regionpose.alignment.pose_search import Density, search_about, search_prior
from regionpose.progress import Progress, part, with_progress
from regionpose.solve.edge_diagnostics import EdgeMode
from regionpose.solve.estimate import PoseEstimate
from regionpose.solve.options import Solver
from regionpose.solve.prior import Prior

LEAST_PRIOR = 1e-4
"""Least probability of a solution of regions about which edges are compared: a hundredth of what all of them leave."""

SOLUTIONS_SEARCHED = 0.4
"""Fraction of the time after which edges about the solutions are compared, for the progress: of one solution and the
prior."""

NEGLIGIBLE = 1e-3
"""Probability that all solutions of regions are wrong, once edges about them were compared, below which the whole prior
is not searched, which takes most of the time: a thirtieth of what a trusted pose may lack."""


@dataclass(frozen=True, eq=False)
class Explanations:
    """`hypotheses`: with their weights. `none`: the weight of none of them. `modes`: all maxima by edges."""

    hypotheses: tuple[Hypothesis, ...]
    none: float
    modes: tuple[EdgeMode, ...]

    def log_odds(self, cluster: Cluster) -> float:
        """Logarithm of the odds that edges agree in a cluster rather than by chance; 0 where none are in view."""
        uninformative = [each for each in cluster.hypotheses if each.mode is None]
        agreeing = [each for each in cluster.hypotheses if each.mode is not None]
        if not agreeing:
            return 0.0
        if not uninformative:
            return log_sum(agreeing) - float(np.log(max(self.none, 1e-300)))
        return (
            log_sum(agreeing)
            - log_sum(uninformative)
            - float(np.log((1.0 - UNINFORMATIVE_PRIOR) / UNINFORMATIVE_PRIOR))
        )


def explained_by_edges(frames: Sequence[EdgeFrame], prior: Prior, progress: Progress | None = None) -> Explanations:
    """The maxima of what a prior allows, and chance."""
    starts = [] if prior.initial is None else [prior.initial]
    modes = search_prior(frames, prior, starts, progress=progress)
    hypotheses = tuple(_of_mode(mode, 1.0 - CHANCE_PRIOR) for mode in modes)
    return Explanations(hypotheses, CHANCE_PRIOR, tuple(modes))


def explained_with_regions(
    frames: Sequence[EdgeFrame],
    prior: Prior,
    regions: PoseEstimate,
    hidden: Sequence[bool],
    solver: Solver,
    progress: Progress | None = None,
) -> Explanations:
    """The solutions of regions by themselves, with edges about each, and edges alone where a prior gives the camera's
    position; `hidden`: which solutions hide a region.
    """
    probabilities, known, modes = priors_of(regions, hidden), without_calibration(regions, solver), []
    none = max(1.0 - float(probabilities.sum()), 0.0)
    hypotheses = []
    pairs = list(zip(solutions_of(known), probabilities.tolist(), strict=True))
    for number, ((solution, probability), own) in enumerate(
        with_progress(pairs, part(progress, 0.0, SOLUTIONS_SEARCHED))
    ):
        if probability <= 0.0:
            continue
        found = []
        if probability >= LEAST_PRIOR and is_covariance(solution.covariance):
            density = Density.student(solution.pose, solution.covariance, frames[0].origin)
            found = search_about(frames, solution.pose, density, progress=own)
        # Without an edge in view whether edges are informative makes no difference.
        uninformative = probability * UNINFORMATIVE_PRIOR if found else probability
        whole = solutions_of(regions)[number].covariance
        hypotheses.append(Hypothesis(solution.pose, whole, float(np.log(uninformative)), number))
        hypotheses += [_of_mode(mode, probability * (1.0 - UNINFORMATIVE_PRIOR), number) for mode in found]
        modes += found
    # Under chance the mass of all maxima of a prior is 1 on the mean.
    left = float(expit(np.log(max(none, 1e-300)) - log_sum(hypotheses)))
    if _has_position(prior) and left > NEGLIGIBLE:
        starts = [solution.pose for solution in solutions_of(regions)]
        found = search_prior(frames, prior, starts, progress=part(progress, SOLUTIONS_SEARCHED, 1.0))
        hypotheses += [_of_mode(mode, none * (1.0 - CHANCE_PRIOR)) for mode in found]
        modes += found
        none *= CHANCE_PRIOR if found else 1.0
    modes.sort(key=lambda mode: mode.log_mass, reverse=True)
    return Explanations(tuple(hypotheses), none, tuple(modes))


def without_calibration(estimate: PoseEstimate, solver: Solver) -> PoseEstimate:
    """The estimate with the covariance that it has if focal lengths and image center are without error: what an error
    of these does to regions and edges alike is added after.
    """
    if not np.isfinite(estimate.covariance).all() or not np.isfinite(estimate.diagnostics.focal_shift).all():
        return estimate
    calibration = solver.calibration_covariance(estimate.diagnostics.focal_shift, estimate.diagnostics.pixel_angle_rad)
    return replace(estimate, covariance=estimate.covariance - calibration)


def _of_mode(mode: EdgeMode, prior: float, solution: int | None = None) -> Hypothesis:
    return Hypothesis(mode.pose, mode.covariance, float(np.log(prior)) + mode.log_mass, solution, mode)


def _has_position(prior: Prior) -> bool:
    return prior.camera_near is not None or prior.initial_center_sigma_m is not None


def is_covariance(covariance: NDArray[np.float64]) -> bool:
    """Whether a matrix (6, 6) is finite and leaves no direction without error."""
    return bool(np.isfinite(covariance).all() and np.linalg.eigvalsh(covariance).min() > 0.0)
