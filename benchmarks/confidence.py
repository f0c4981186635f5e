"""The weights of the confidence: a logistic regression on the synthetic problems of `trust` and `mistakes`.

Draws problems of every noise model, mistake and camera, solves them, and fits the probability that the pose, or one
that fits alike, is within 5 deg of the truth to what the fit shows (docs/math.md, section 15). Prints the weights for
rust/src/verdict/confidence.rs and how they hold on each kind when they are fitted to the others. The seeds are other
ones than those of any table: they begin at a million.

    python benchmarks/confidence.py [--scenes 100] [--workers 2] [--keep FILE]
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
from regionpose.evaluation.measures import rotation_error
from regionpose.evaluation.studies.conditions import Condition, Mistake, NoiseModel
from regionpose.evaluation.studies.mistakes import draw_mistaken_problem
from regionpose.evaluation.studies.mixes import draw_mixed_problem
from regionpose.evaluation.studies.problems import Problem
from regionpose.evaluation.studies.study import benchmark_setups
from regionpose.evaluation.studies.verdict import WRONG_DEG
from regionpose.solver import observed_regions
from rich.progress import track

Array = NDArray[np.float64]

FIRST_SEED = 1_000_000
FEATURES = ("1", "ln spread", "whole", "ln scatter", "contradicted regions")
BINS = (0.0, 0.15, 0.3, 0.6, 0.8, 0.9, 0.97, 0.99, 1.0)
RIDGE = 1e-2
"""Keeps a weight finite that no problem speaks against."""

STEPS = 50


@dataclass(frozen=True)
class Kind:
    """A camera, and what is wrong: a noise model of the study `trust`, or a mistake."""

    camera: str
    model: NoiseModel | None = None
    mistake: Mistake | None = None

    def draw(self, seed: int) -> Problem:
        """The problem of a seed."""
        setup = benchmark_setups()[self.camera]
        if self.mistake is not None:
            return draw_mistaken_problem(setup, Condition(camera=self.camera, mistake=self.mistake), seed)
        return draw_mixed_problem(setup, Condition(camera=self.camera, model=self.model or "exact"), seed)


def kinds() -> list[Kind]:
    """All noise models with the cameras of `trust`, all mistakes with those of `mistakes`."""
    models = itertools.product(("perspective", "omnidirectional"), typing.get_args(NoiseModel))
    mistakes = itertools.product(("perspective", "fisheye"), typing.get_args(Mistake))
    return [*(Kind(camera, model=m) for camera, m in models), *(Kind(camera, mistake=m) for camera, m in mistakes)]


@dataclass(frozen=True)
class Solved:
    """What a fit showed, what it was taken for, and whether the pose or an alternative was within the limit."""

    kind: str
    evidence: tuple[float, ...]
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
    answers = [estimate.best, *estimate.alternatives]
    errors = [rotation_error(answer.rotation, problem.scene.rotation) for answer in answers]
    stated = sum(answer.confidence for answer in answers)
    name = f"model {kind.model}" if kind.mistake is None else f"mistake {kind.mistake}"
    return Solved(name, tuple(estimate.evidence.tolist()), float(stated), min(errors) < WRONG_DEG)


def outcomes(scenes: int, workers: int) -> list[Solved]:
    """The outcomes of so many problems of each kind, those that have one."""
    chosen = list(itertools.product(kinds(), range(FIRST_SEED, FIRST_SEED + scenes)))
    with ProcessPoolExecutor(workers) as pool:
        found = track(pool.map(solved, chosen, chunksize=8), "problems", total=len(chosen))
        return [outcome for outcome in found if outcome is not None]


def fitted(features: Array, found: Array) -> Array:
    """Weights of the likeliest logistic regression, by Newton's steps on standardized features."""
    mean, spread = features.mean(axis=0), features.std(axis=0)
    mean[0], spread[0] = 0.0, 1.0
    standard = (features - mean) / spread
    penalty = RIDGE * np.eye(features.shape[1])
    penalty[0, 0] = 0.0
    weights = np.zeros(features.shape[1])
    for _ in range(STEPS):
        probability = 1.0 / (1.0 + np.exp(-standard @ weights))
        slope = probability * (1.0 - probability)
        curvature = standard.T @ (standard * slope[:, None]) + penalty
        weights += np.linalg.solve(curvature, standard.T @ (found - probability) - penalty @ weights)
    weights = weights / spread
    weights[0] -= weights[1:] @ mean[1:]
    return weights


def log_loss(probability: Array, found: Array) -> float:
    """Mean of minus the logarithm of the probability of what happened."""
    kept = np.clip(probability, 1e-12, 1.0 - 1e-12)
    return float(-np.mean(found * np.log(kept) + (1.0 - found) * np.log(1.0 - kept)))


def left_out(rows: list[Solved], features: Array, found: Array) -> Array:
    """(n,) probabilities of each kind by the weights of all others."""
    names = np.array([row.kind for row in rows])
    probability = np.zeros(len(rows))
    for name in dict.fromkeys(names.tolist()):
        own = names == name
        probability[own] = 1.0 / (1.0 + np.exp(-features[own] @ fitted(features[~own], found[~own])))
        print(f"  {name:24} {100.0 * probability[own].mean():5.1f} % stated, {100.0 * found[own].mean():5.1f} % found")
    return probability


def print_bins(probability: Array, found: Array) -> None:
    """Stated and found shares, bin by bin."""
    for least, most in itertools.pairwise(BINS):
        inside = (least <= probability) & (probability < most + (most == BINS[-1]))
        if inside.any():
            means = f"{100.0 * probability[inside].mean():5.1f} % stated, {100.0 * found[inside].mean():5.1f} % found"
            print(f"  {least:4.2f} to {most:4.2f}: {int(inside.sum()):6} problems, {means}")


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100, help="problems of each camera, noise model and mistake")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--keep", type=Path, help="write features, confidences and outcomes to this .npz file")
    options = parser.parse_args()
    rows = outcomes(options.scenes, options.workers)
    features = np.array([row.evidence for row in rows])
    stated, found = np.array([row.stated for row in rows]), np.array([float(row.found) for row in rows])
    if options.keep is not None:
        np.savez(options.keep, features=features, stated=stated, found=found, kinds=[row.kind for row in rows])
    weights = fitted(features, found)
    print(f"{len(rows)} problems, {100.0 * found.mean():.1f} % of them found")
    for name, weight in zip(FEATURES, weights, strict=True):
        print(f"  {weight:9.4f}  {name}")
    print("each kind by the weights of the others:")
    others = left_out(rows, features, found)
    print_bins(others, found)
    fresh = 1.0 / (1.0 + np.exp(-features @ weights))
    losses = [log_loss(probability, found) for probability in (fresh, others, stated)]
    print("log loss: {:.4f}, of kinds left out {:.4f}, of the weights built in {:.4f}; these:".format(*losses))
    print_bins(stated, found)


if __name__ == "__main__":
    main()
