"""The published algorithm beside `regionpose.estimate_pose` on the very same scenes, in one run.

Scenes are the paper's: the world's frame is the first region's; binary masks, squares along the boundary changing the
shares `--noise` of their area; perspective camera for the plane's system, fisheye of 180 deg for the sphere's. The
published algorithm starts from its own initial pose, which takes the seen side as known and the in-plane turn as small;
`regionpose` knows nothing of the pose, and a row each says what it does with the published start handed to it and with
its native driver. Of its answers to a symmetric shape the first counts, or in "any" the nearest of all.
Solved: rotation < 1 deg and delta < 5 %. Times: of the processor, from masks to pose; numpy and scipy drive the
published equations, compiled code ours. The ratio is of the medians, `regionpose` over the method of the line.

    OMP_NUM_THREADS=1 python -m benchmarks.published [--scenes 100] [--planes 1 2 3] [--noise 0 0.05] [--keep FILE]

With `--keep` the outcomes go to that file as they come; the same command goes on from there, and more scenes may be
asked for. The table of docs/results.md comes last.
"""

from __future__ import annotations

import argparse
import itertools
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import regionpose as rp

from benchmarks.published.compare import MAKERS, Outcome, drawn_problem, outcomes
from benchmarks.published.report import DETAILS, TABLE, Condition, details, table_row
from benchmarks.synthetic.studies.rows import Row
from benchmarks.synthetic.studies.storage import Journal, Key

SEPARATOR = ": "


def kept(found: dict[str, Outcome]) -> Row:
    """The outcomes as a row of a file."""
    return {f"{name}{SEPARATOR}{key}": v for name, one in found.items() for key, v in one._asdict().items()}


def outcomes_of(row: Row) -> dict[str, Outcome]:
    """The outcomes that were kept."""
    names = dict.fromkeys(key.split(SEPARATOR)[0] for key in row)
    return {n: Outcome(*(float(str(row[f"{n}{SEPARATOR}{key}"])) for key in Outcome._fields)) for n in names}


@contextmanager
def journal(path: Path | None, settings: dict[str, Any]) -> Iterator[tuple[dict[Key, Row], Any]]:
    """What is done already, and what to tell of more."""
    if path is None:
        done: dict[Key, Row] = {}
        yield done, done.update
        return
    with Journal(path, settings) as opened:
        yield opened.done, opened.add


def run(arguments: argparse.Namespace) -> None:
    """Solve what is not done yet, and print both tables."""
    choices = itertools.product(arguments.systems, arguments.planes, arguments.noise)
    conditions = [Condition(*choice) for choice in choices]
    settings = {
        "conditions": [list(condition) for condition in conditions],
        "templates": arguments.templates,
        "start": arguments.start,
        "version": rp.__version__,
    }
    table = []
    print(DETAILS)
    with journal(arguments.keep, settings) as (done, add):
        for index, condition in enumerate(conditions):
            for seed in range(arguments.scenes):
                print(f"\r{condition.system}, {condition.planes}: {seed} ", end="", file=sys.stderr, flush=True)
                if (index, seed) not in done:
                    problem = drawn_problem(
                        condition.system, seed, condition.planes, arguments.templates, condition.noise
                    )
                    add({(index, seed): kept(outcomes(problem, condition.system, arguments.start))})
            rows = [outcomes_of(done[index, seed]) for seed in range(arguments.scenes)]
            print("\r", end="", file=sys.stderr, flush=True)
            print(details(condition, rows), flush=True)
            table.append(table_row(condition, rows))
    print("\n".join(["", TABLE, *table]))


def main() -> None:
    """Run what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--planes", type=int, nargs="+", default=[1, 2, 3])
    parser.add_argument("--systems", choices=list(MAKERS), nargs="+", default=list(MAKERS))
    parser.add_argument("--templates", choices=["all", "asymmetric", "symmetric"], default="all")
    parser.add_argument("--noise", type=float, nargs="+", default=[0.0], help="shares that segmentation error changes")
    parser.add_argument("--start", choices=["parallel", "turned"], default="parallel")
    parser.add_argument("--keep", type=Path, help="file of the outcomes, to go on from")
    arguments = parser.parse_args()
    if os.environ.get("OMP_NUM_THREADS") != "1":
        print("OMP_NUM_THREADS isn't 1: times may be of several threads")
    run(arguments)


if __name__ == "__main__":
    main()
