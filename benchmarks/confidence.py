"""The weights of the confidence: a logistic regression on the synthetic problems of `trust` and `mistakes`.

Draws problems of every noise model, mistake and camera, and scans with wrong labels, solves them, and fits the
probability that the first answer is within 5 deg of the truth to what its fit shows (docs/math.md, section 15), of
poses from outlines and of those from samples apart. Prints the weights for
rust/src/verdict/confidence.rs and how they hold on each kind when they are fitted to the others. The seeds are other
ones than those of any table: they begin at a million.

    python -m benchmarks.confidence [--scenes 80] [--workers 2] [--keep FILE]
"""

from __future__ import annotations

import argparse
import itertools
import typing
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from regionpose import _core
from regionpose.solve.core_inputs import observed_regions
from rich.progress import track
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.synthetic.measures import rotation_error
from benchmarks.synthetic.studies.conditions import Condition, Cut, Mistake, NoiseModel
from benchmarks.synthetic.studies.mistakes import draw_mistaken_problem
from benchmarks.synthetic.studies.mixes import draw_mixed_problem
from benchmarks.synthetic.studies.problems import StudyProblem
from benchmarks.synthetic.studies.study import benchmark_setups
from benchmarks.synthetic.studies.trust import WRONG_DEG

Array = NDArray[np.float64]

FIRST_SEED = 1_000_000
COMMON = ("1", "ln rotation sigma", "several regions")
FEATURES = {
    "outlines": (*COMMON, "ambiguous", "whole", "ln scatter", "contradicted regions", "overlap error"),
    "samples": (*COMMON, "unseen", "wrong labels", "ln growth"),
}
BINS = (0.0, 0.05, 0.15, 0.3, 0.6, 0.8, 0.9, 0.97, 0.99, 1.0)
RIDGE = 1e-3
"""Keeps a weight finite that no problem speaks against."""
MISLABELED = (0.03, 0.1)
"""Shares of wrong labels, as in the study `lidar`: scans of real scenes have some at right poses, too."""
CUTS: tuple[Cut, ...] = ("scanner", "box")
"""What of a region a scanner does not see, as there: it makes some poses wrong and leaves others right."""


@dataclass(frozen=True)
class Kind:
    """A camera, and what is wrong: a noise model of the study `trust`, labels or a part of its scan, or a mistake."""

    camera: str
    model: NoiseModel | None = None
    mistake: Mistake | None = None
    mislabeled: float = 0.0
    cut: Cut = "none"

    def draw(self, seed: int) -> StudyProblem:
        """The problem of a seed."""
        setup = benchmark_setups()[self.camera]
        if self.mistake is not None:
            return draw_mistaken_problem(setup, Condition(camera=self.camera, mistake=self.mistake), seed)
        model = self.model or "exact"
        drawn = Condition(camera=self.camera, model=model, mislabeled=self.mislabeled, cut=self.cut)
        return draw_mixed_problem(setup, drawn, seed)

    @property
    def name(self) -> str:
        """What is wrong."""
        labels = f", {100.0 * self.mislabeled:.0f} % mislabeled" if self.mislabeled else ""
        cut = f", cut by the {self.cut}" if self.cut != "none" else ""
        return f"model {self.model}{labels}{cut}" if self.mistake is None else f"mistake {self.mistake}"


def kinds() -> list[Kind]:
    """All noise models, scans with wrong labels or cut as in the study `lidar`, all mistakes, with both cameras."""
    cameras = ("perspective", "omnidirectional")
    models = [Kind(camera, model=m) for camera, m in itertools.product(cameras, typing.get_args(NoiseModel))]
    labels = [Kind(camera, model="lidar", mislabeled=share) for camera, share in itertools.product(cameras, MISLABELED)]
    cuts = [Kind(camera, model="lidar", cut=cut) for camera, cut in itertools.product(cameras, CUTS)]
    mistakes = [Kind(camera, mistake=m) for camera, m in itertools.product(cameras, typing.get_args(Mistake))]
    return [*models, *labels, *cuts, *mistakes]


@dataclass(frozen=True)
class Solved:
    """What a fit showed, what it was taken for, and whether the first answer was within the limit; ``most`` is the
    confidence of a fit that shows the place beyond doubt: what the noise and the other answers leave.
    """

    kind: str
    evidence: tuple[float, ...]
    most: float
    stated: float
    found: bool


def solved(chosen: tuple[Kind, int]) -> Solved | None:
    """The outcome of one problem; None where no pose is in view or nothing can be given to an estimate."""
    kind, seed = chosen
    try:
        problem = kind.draw(seed)
        sides = (observed_regions(problem.camera, problem.image_regions, "boundary"), problem.world_regions)
        core = _core.Problem(sides[0], [w.core for w in sides[1]], system="plane", integration="boundary")
    except ValueError:
        return None
    estimate = core.estimate()
    if estimate is None:
        return None
    first = estimate.best
    most = _core.rotation_confidence(first.covariance) * first.confidence / estimate.probability
    found = rotation_error(first.rotation, problem.scene.rotation) < WRONG_DEG
    return Solved(kind.name, tuple(estimate.evidence.tolist()), most, first.confidence, found)


def outcomes(scenes: int, workers: int) -> list[Solved]:
    """The outcomes of so many problems of each kind, those that have one."""
    chosen = list(itertools.product(kinds(), range(FIRST_SEED, FIRST_SEED + scenes)))
    with ProcessPoolExecutor(workers) as pool:
        found = track(pool.map(solved, chosen, chunksize=8), "problems", total=len(chosen))
        return [outcome for outcome in found if outcome is not None]


def stated(most: Array, features: Array, weights: Array) -> Array:
    """(n,) confidences by the weights (docs/math.md, eq. 15.1)."""
    return np.asarray(most * expit(features @ weights), dtype=np.float64)


def fitted(most: Array, features: Array, found: Array) -> Array:
    """The likeliest weights."""

    def cost(weights: Array) -> float:
        loss = len(found) * log_loss(stated(most, features, weights), found)
        return float(loss + RIDGE * weights[1:] @ weights[1:])

    return np.asarray(minimize(cost, np.zeros(features.shape[1])).x, dtype=np.float64)


def log_loss(probability: Array, found: Array) -> float:
    """Mean of minus the logarithm of the probability of what happened."""
    kept = np.clip(probability, 1e-12, 1.0 - 1e-12)
    return float(-np.mean(found * np.log(kept) + (1.0 - found) * np.log(1.0 - kept)))


def left_out(kinds: list[str], most: Array, features: Array, found: Array) -> Array:
    """(n,) confidences of each kind by the weights of all others."""
    names = np.array(kinds)
    confidence = np.zeros(len(names))
    for name in dict.fromkeys(kinds):
        own = names == name
        weights = fitted(most[~own], features[~own], found[~own])
        confidence[own] = stated(most[own], features[own], weights)
        print(f"  {name:24} {100.0 * confidence[own].mean():5.1f} % stated, {100.0 * found[own].mean():5.1f} % found")
    return confidence


def print_bins(confidence: Array, found: Array) -> None:
    """Stated and found shares, bin by bin."""
    for least, most in itertools.pairwise(BINS):
        own = (confidence > least) & (confidence <= most)
        if own.any():
            means = 100.0 * confidence[own].mean(), 100.0 * found[own].mean()
            counted = f"{least:.2f} to {most:.2f}: {own.sum():5} poses"
            print(f"  {counted}, {means[0]:5.1f} % stated, {means[1]:5.1f} % found")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=80, help="problems of each camera and kind")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--keep", type=Path, help="write features and outcomes by source: beside this .npz file")
    options = parser.parse_args()
    rows = outcomes(options.scenes, options.workers)
    for source, names in FEATURES.items():
        own = [row for row in rows if len(row.evidence) == len(names)]
        features = np.array([row.evidence for row in own])
        found = np.array([float(row.found) for row in own])
        now, most = np.array([row.stated for row in own]), np.array([row.most for row in own])
        if options.keep is not None:
            kinds = np.array([row.kind for row in own])
            file = options.keep.with_stem(f"{options.keep.stem}-{source}")
            np.savez(file, kinds=kinds, most=most, features=features, stated=now, found=found)
        print(f"{source}: {len(own)} poses, {100.0 * found.mean():.1f} % found; each kind by weights of all others:")
        others = left_out([row.kind for row in own], most, features, found)
        for name, weight in zip(names, fitted(most, features, found), strict=True):
            print(f"{weight:8.4f}  {name}")
        print(f"log loss, each kind left out: {log_loss(others, found):.4f}; bins of these:")
        print_bins(others, found)
        print("bins by the weights that are built in:")
        print_bins(now, found)


if __name__ == "__main__":
    main()
