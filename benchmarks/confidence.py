"""How well the confidence holds, on the synthetic problems of `trust` and `mistakes`.

Draws problems of every noise model, mistake and camera, and scans with wrong labels, solves them, and compares the
probability that is stated with how often the first answer is within 5 deg of the truth, of poses from outlines and of
those from samples apart: by kind, by bins, and by the mean of minus the logarithm of the probability of what happened.
Prints the multiple of the log odds that would make it likeliest which poses are right (docs/math.md, eq. 15.3): 1 where
they hold. The seeds are other ones than those of any table: they begin at a million.

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
from scipy.optimize import minimize_scalar
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
TRUSTED = 0.97
"""As in rust/src/verdict/solution.rs."""
BINS = (0.0, 0.05, 0.15, 0.3, 0.6, 0.8, 0.9, 0.97, 0.99, 1.0)
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
    """What a fit showed (`_core.Estimate.evidence`), what it was taken for, and whether the first answer was within the
    limit; ``most`` is the confidence of a fit that shows the place beyond doubt: what the noise and the other answers
    leave.
    """

    kind: str
    source: str
    evidence: tuple[float, ...]
    log_odds: float
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
    stated, log_odds = first.confidence, estimate.log_odds
    found = rotation_error(first.rotation, problem.scene.rotation) < WRONG_DEG
    source = "samples" if any(world.samples is not None for world in problem.world_regions) else "outlines"
    most = min(stated / float(expit(log_odds)), 1.0)
    return Solved(kind.name, source, tuple(estimate.evidence.tolist()), log_odds, most, stated, found)


def outcomes(scenes: int, workers: int) -> list[Solved]:
    """The outcomes of so many problems of each kind, those that have one."""
    chosen = list(itertools.product(kinds(), range(FIRST_SEED, FIRST_SEED + scenes)))
    with ProcessPoolExecutor(workers) as pool:
        found = track(pool.map(solved, chosen, chunksize=8), "problems", total=len(chosen))
        return [outcome for outcome in found if outcome is not None]


def log_loss(probability: Array, found: Array) -> float:
    """Mean of minus the logarithm of the probability of what happened."""
    kept = np.clip(probability, 1e-12, 1.0 - 1e-12)
    return float(-np.mean(found * np.log(kept) + (1.0 - found) * np.log(1.0 - kept)))


def likeliest_multiple(most: Array, log_odds: Array, found: Array) -> float:
    """The multiple of the log odds that makes it likeliest which poses are right."""
    best = minimize_scalar(
        lambda multiple: log_loss(most * expit(multiple * log_odds), found), bounds=(0.0, 5.0), method="bounded"
    )
    return float(best.x)


def print_kinds(kinds: Array, confidence: Array, found: Array) -> None:
    """Stated and found shares, kind by kind."""
    for name in dict.fromkeys(kinds.tolist()):
        own = kinds == name
        means = 100.0 * confidence[own].mean(), 100.0 * found[own].mean()
        print(f"  {name:36} {own.sum():5} poses, {means[0]:5.1f} % stated, {means[1]:5.1f} % found")


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
    parser.add_argument("--keep", type=Path, help="write evidence and outcomes by source: beside this .npz file")
    options = parser.parse_args()
    rows = outcomes(options.scenes, options.workers)
    for source in ("outlines", "samples"):
        own = [row for row in rows if row.source == source]
        names, evidence = np.array([row.kind for row in own]), np.array([row.evidence for row in own])
        found, stated = np.array([float(row.found) for row in own]), np.array([row.stated for row in own])
        most, log_odds = np.array([row.most for row in own]), np.array([row.log_odds for row in own])
        if options.keep is not None:
            file = options.keep.with_stem(f"{options.keep.stem}-{source}")
            np.savez(file, kinds=names, most=most, evidence=evidence, log_odds=log_odds, stated=stated, found=found)
        print(f"{source}: {len(own)} poses, {100.0 * found.mean():.1f} % found")
        print_kinds(names, stated, found)
        print_bins(stated, found)
        multiple = likeliest_multiple(most, log_odds, found)
        likeliest = log_loss(most * expit(multiple * log_odds), found)
        print(f"log loss {log_loss(stated, found):.4f}, {likeliest:.4f} by {multiple:.2f} times the log odds")
        trusted = stated > TRUSTED
        print(f"above {TRUSTED}: {trusted.sum()} poses, {int((1.0 - found[trusted]).sum())} of them wrong")


if __name__ == "__main__":
    main()
