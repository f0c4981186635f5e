"""From a study to its rows, on one process or many: the rows are the same, times apart."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from pathlib import Path
from typing import NamedTuple

from benchmarks.synthetic.studies.dispatch import Dispatcher, WorkerLostError, process_pool
from benchmarks.synthetic.studies.rows import Results, Row, failed_row, whole_row
from benchmarks.synthetic.studies.storage import Journal, Key
from benchmarks.synthetic.studies.study import Study

CHUNK_PROBLEMS = 8
"""Problems of one task: some 0.3 s of work, far above what handing it over costs, and little to lose."""

Progress = Callable[[int, int], None]
"""Told how many problems are done, of how many."""


class Chunk(NamedTuple):
    """Seeds of one condition that one task runs."""

    condition: int
    seeds: tuple[int, ...]


class KeptRows(NamedTuple):
    """Outcomes as they come, and where they are kept."""

    done: dict[Key, Row]
    add: Callable[[dict[Key, Row]], None]


Runs = Callable[[Sequence[Chunk]], Iterator[tuple[Chunk, dict[Key, Row] | WorkerLostError]]]
"""Runs chunks and gives each with its outcomes as they end."""


def run_study(
    study: Study,
    scenes: int,
    *,
    seed: int = 0,
    workers: int = 1,
    executor: Executor | None = None,
    journal: Path | None = None,
    progress: Progress | None = None,
) -> Results:
    """The rows of `scenes` problems of each condition, with seeds from `seed` on, ordered by condition and seed.

    They run in this process, on `workers` processes, or on the caller's `executor`. A problem that fails is a row with
    its error. With a `journal` outcomes are kept in that file as they come, and those that it holds aren't run again;
    ValueError when other settings made it.
    """
    seeds = _checked_seeds(scenes, seed, workers)
    if journal is None:
        return _run(study, seeds, _in_memory(), _dispatched(study, workers, executor), progress)
    with Journal(journal, study.settings(seeds)) as kept:
        return _run(study, seeds, KeptRows(kept.done, kept.add), _dispatched(study, workers, executor), progress)


def _checked_seeds(scenes: int, seed: int, workers: int) -> range:
    for name, value, least in (("scenes", scenes, 1), ("seed", seed, 0), ("workers", workers, 1)):
        if value < least:
            raise ValueError(f"{name} is {value}; it must be {least} or more")
    return range(seed, seed + scenes)


def _in_memory() -> KeptRows:
    done: dict[Key, Row] = {}
    return KeptRows(done, done.update)


def _run(
    study: Study,
    seeds: range,
    kept: KeptRows,
    dispatched: AbstractContextManager[Runs],
    progress: Progress | None,
) -> Results:
    total = len(study.conditions) * len(seeds)
    with dispatched as runs:
        for chunk, outcome in runs(_chunks(study, seeds, kept.done)):
            if isinstance(outcome, WorkerLostError):
                outcome = {(chunk.condition, s): failed_row(outcome) for s in chunk.seeds}
            kept.add(outcome)
            if progress is not None:
                progress(len(kept.done), total)
    keys = ((index, s) for index in range(len(study.conditions)) for s in seeds)
    rows = [whole_row(study.conditions[index], s, kept.done[index, s]) for index, s in keys]
    return Results(study.settings(seeds), rows)


def _chunks(study: Study, seeds: range, done: dict[Key, Row]) -> list[Chunk]:
    """What is left to do. Conditions take turns, so that a study which is stopped has seen all of them alike."""
    chunks = []
    for first in range(0, len(seeds), CHUNK_PROBLEMS):
        for condition in range(len(study.conditions)):
            left = tuple(s for s in seeds[first : first + CHUNK_PROBLEMS] if (condition, s) not in done)
            if left:
                chunks.append(Chunk(condition, left))
    return chunks


def run_chunk(study: Study, chunk: Chunk) -> dict[Key, Row]:
    """The outcomes of a chunk's problems."""
    condition = study.conditions[chunk.condition]
    return {(chunk.condition, seed): study.outcome(condition, seed) for seed in chunk.seeds}


@contextmanager
def _dispatched(study: Study, workers: int, executor: Executor | None) -> Iterator[Runs]:
    """How chunks are run."""
    run = partial(run_chunk, study)
    if executor is not None:
        yield Dispatcher(executor, run).results
    elif workers == 1:
        yield lambda chunks: ((chunk, run(chunk)) for chunk in chunks)
    else:
        with process_pool(workers, run) as dispatcher:
            yield dispatcher.results
