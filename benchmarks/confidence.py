"""The weights of the confidence: a logistic regression on the synthetic problems of the study `trust`.

Draws problems of every noise model and camera, solves them, and fits the probability that the pose, or one that fits
alike, is within 5 deg of the truth to what the fit shows (docs/math.md, section 15). Prints the weights for
rust/src/confidence.rs and, for the weights that are built in, their log loss and how they hold on these problems. The
seeds are other ones than those of any table: they begin at a million.

    python benchmarks/confidence.py [--scenes 600] [--workers 2] [--keep FILE]
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
from regionpose.estimation.sides import observed_regions
from regionpose.evaluation.measures import rotation_error
from regionpose.evaluation.studies.conditions import Condition, NoiseModel
from regionpose.evaluation.studies.mixes import draw_mixed_problem
from regionpose.evaluation.studies.study import benchmark_setups
from regionpose.evaluation.studies.trust import WRONG_DEG
from rich.progress import track

Array = NDArray[np.float64]

FIRST_SEED = 1_000_000
FEATURES = ("1", "ln rotation sigma", "ln scatter", "log odds of the clean share", "ln clean parts", "several regions")
RIDGE = 1e-2
"""Keeps a weight finite that no problem speaks against."""

STEPS = 50


@dataclass(frozen=True)
class Solved:
    """What a fit showed, what it was taken for, and whether the pose or an alternative was within the limit."""

    evidence: tuple[float, ...]
    stated: float
    found: bool


def solved(chosen: tuple[str, NoiseModel, int]) -> Solved | None:
    """The outcome of one problem; None where no pose is in view or nothing can be given to an estimate."""
    camera, model, seed = chosen
    try:
        problem = draw_mixed_problem(benchmark_setups()[camera], Condition(camera=camera, model=model), seed)
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
    return Solved(tuple(estimate.evidence.tolist()), float(stated), min(errors) < WRONG_DEG)


def problems(scenes: int) -> list[tuple[str, NoiseModel, int]]:
    """Both cameras, all noise models, so many seeds of each."""
    seeds = range(FIRST_SEED, FIRST_SEED + scenes)
    return list(itertools.product(("perspective", "omnidirectional"), typing.get_args(NoiseModel), seeds))


def outcomes(scenes: int, workers: int) -> list[Solved]:
    """The outcomes of all problems that have one."""
    chosen = problems(scenes)
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


def main() -> None:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=600, help="problems of each camera and noise model")
    parser.add_argument("--workers", type=int, default=2, help="processes")
    parser.add_argument("--keep", type=Path, help="write features, confidences and outcomes to this .npz file")
    options = parser.parse_args()
    rows = outcomes(options.scenes, options.workers)
    features = np.array([row.evidence for row in rows])
    stated, found = np.array([row.stated for row in rows]), np.array([float(row.found) for row in rows])
    if options.keep is not None:
        np.savez(options.keep, features=features, stated=stated, found=found)
    weights = fitted(features, found)
    print(f"{len(rows)} problems, {100.0 * found.mean():.1f} % of them found")
    for name, weight in zip(FEATURES, weights, strict=True):
        print(f"  {weight:9.4f}  {name}")
    fresh = 1.0 / (1.0 + np.exp(-features @ weights))
    print(f"log loss: of these weights {log_loss(fresh, found):.4f}, of those built in {log_loss(stated, found):.4f}")
    for least, most in ((0.0, 0.3), (0.3, 0.6), (0.6, 0.9), (0.9, 0.99), (0.99, 1.01)):
        inside = (least <= stated) & (stated < most)
        if inside.any():
            means = f"{100.0 * stated[inside].mean():5.1f} % stated, {100.0 * found[inside].mean():5.1f} % found"
            print(f"  built in {least:4.2f} to {min(most, 1.0):4.2f}: {int(inside.sum()):6} problems, {means}")


if __name__ == "__main__":
    main()
