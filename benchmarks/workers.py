"""One study on one process, on two, and on a dask cluster of two workers: equal rows, and the time each takes.

A part of the perspective study, 1 and 3 planes with 0 and 5 % of error on the mask. Wall times hold the start of the
processes, the ratio is to one process; run it on a machine that does nothing else. Rows have to be equal, times apart.

    OMP_NUM_THREADS=1 python -m benchmarks.workers [--scenes 100] [--workers 2]
"""

from __future__ import annotations

import argparse
import importlib.util
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any

from benchmarks.synthetic.studies import Results, Study, dask_executor, run_study, study_named
from benchmarks.synthetic.studies.rows import TIMES

Row = dict[str, Any]


@contextmanager
def local_cluster(workers: int) -> Iterator[dict[str, Any]]:
    """The options of `run_study` that send a study to a dask cluster of processes on this machine."""
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None) as cluster,
        dask_executor(cluster.scheduler_address) as executor,
    ):
        yield {"executor": executor}


def comparable(results: Results) -> list[Row]:
    """The rows without times; NaN, which differs from itself, as a text."""
    kept = ({name: value for name, value in row.items() if name not in TIMES} for row in results.rows)
    return [{n: "nan" if isinstance(v, float) and math.isnan(v) else v for n, v in row.items()} for row in kept]


def ways(workers: int) -> dict[str, Callable[[], Any]]:
    """How a study may be run, as contexts that give options of `run_study`."""
    found: dict[str, Callable[[], Any]] = {
        "1 process": lambda: nullcontext({}),
        f"{workers} processes": lambda: nullcontext({"workers": workers}),
    }
    if importlib.util.find_spec("distributed") is None:
        print("dask's distributed isn't there: pip install 'regionpose[studies]' to compare it too")
    else:
        found[f"dask, {workers} workers"] = lambda: local_cluster(workers)
    return found


def timed(study: Study, scenes: int, way: Callable[[], Any]) -> tuple[Results, float]:
    """The rows of a study and the wall time from nothing to all of them."""
    begin = time.perf_counter()
    with way() as options:
        results = run_study(study, scenes, **options)
        return results, time.perf_counter() - begin


def main() -> int:
    """Print a row for each way; 1 where rows differ."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=100)
    parser.add_argument("--workers", type=int, default=2)
    arguments = parser.parse_args()
    study = study_named("perspective").with_values({"side": ("2d",), "planes": (1, 3), "noise": (0.0, 0.05)})
    run_study(study, 1)
    print(
        f"{arguments.scenes * len(study.conditions)} problems\n\n| run on | rows | seconds | ratio |\n|---|---|---|---|"
    )
    first: list[Row] = []
    first_seconds, equal = 0.0, True
    for name, way in ways(arguments.workers).items():
        results, seconds = timed(study, arguments.scenes, way)
        rows = comparable(results)
        first, first_seconds = first or rows, first_seconds or seconds
        equal = equal and rows == first
        print(f"| {name} | {'equal' if rows == first else 'DIFFER'} | {seconds:.1f} | {seconds / first_seconds:.2f} |")
        sys.stdout.flush()
    return 0 if equal else 1


if __name__ == "__main__":
    sys.exit(main())
