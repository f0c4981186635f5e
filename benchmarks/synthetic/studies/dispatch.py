"""Tasks on one process, on several, or on any executor; a worker that is lost costs the tasks that it held only."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import Counter, deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Generic, TypeVar

Task = TypeVar("Task")
Result = TypeVar("Result")

MOST_ATTEMPTS = 3
"""Times that a task is started: without a limit, one that crashes its worker would be started for ever."""

MOST_RUNNING = 1000
"""Tasks handed to a caller's executor at a time: more than a cluster has workers, few enough to watch."""

TASKS_AHEAD = 2
"""Tasks that wait in an own pool for each of its processes: enough to keep it busy, and few that a crash holds up."""


class WorkerLostError(RuntimeError):
    """A task ended the process that ran it, as often as it was tried."""


@dataclass
class Dispatcher(Generic[Task, Result]):
    """Runs `function` over tasks on an executor.

    `renew`: makes the executor again after one of its processes ended; None for the caller's own, which is not ours to
    replace. `most_running`: tasks handed over at a time.
    """

    executor: Executor
    function: Callable[[Task], Result]
    renew: Callable[[], Executor] | None = None
    most_running: int = MOST_RUNNING
    _running: dict[Future[Result], Task] = field(default_factory=dict)
    _lost: deque[Task] = field(default_factory=deque)
    _attempts: Counter[Task] = field(default_factory=Counter)

    def results(self, tasks: Sequence[Task]) -> Iterator[tuple[Task, Result | WorkerLostError]]:
        """Each task with its result, as they end; WorkerLostError in its place after `MOST_ATTEMPTS` lost workers.

        Any other error of the function is raised. Lost tasks are tried again after all others and one by one, so that
        one that ends its process takes no other with it.
        """
        waiting = deque(tasks)
        try:
            while waiting or self._running or self._lost:
                self._fill(waiting)
                ended, _ = wait(self._running, return_when=FIRST_COMPLETED)
                for future in ended:
                    yield from self._ended(future)
        finally:
            for future in self._running:
                future.cancel()

    def _fill(self, waiting: deque[Task]) -> None:
        while waiting and len(self._running) < self.most_running:
            self._submit(waiting.popleft())
        if not waiting and not self._running and self._lost:
            self._submit(self._lost.popleft())

    def _submit(self, task: Task) -> None:
        try:
            future = self.executor.submit(self.function, task)
        except BrokenExecutor:
            if self.renew is None:
                raise
            # What still runs on the broken pool has failed too and comes back by itself.
            self.executor = self.renew()
            future = self.executor.submit(self.function, task)
        self._running[future] = task

    def _ended(self, future: Future[Result]) -> Iterator[tuple[Task, Result | WorkerLostError]]:
        task = self._running.pop(future)
        try:
            yield task, future.result()
        except (BrokenExecutor, CancelledError) as error:
            yield from self._lost_again(task, error)
        except Exception as error:
            if not _is_lost_worker(error):
                raise
            yield from self._lost_again(task, error)

    def _lost_again(self, task: Task, error: BaseException) -> Iterator[tuple[Task, WorkerLostError]]:
        self._attempts[task] += 1
        if self._attempts[task] < MOST_ATTEMPTS:
            self._lost.append(task)
        else:
            yield task, WorkerLostError(f"the worker ended {MOST_ATTEMPTS} times ({type(error).__name__})")


def _is_lost_worker(error: Exception) -> bool:
    """Whether dask gave a task up because its workers ended; its classes are not there without the extra."""
    return type(error).__name__ in {"KilledWorker", "FutureCancelledError"}


@contextmanager
def process_pool(workers: int, function: Callable[[Task], Result]) -> Iterator[Dispatcher[Task, Result]]:
    """A dispatcher over so many processes, started afresh so that no thread or lock is carried into them."""
    pools: list[ProcessPoolExecutor] = []

    def start() -> Executor:
        for pool in pools:
            pool.shutdown(wait=False, cancel_futures=True)
        context = multiprocessing.get_context("spawn")
        pools.append(ProcessPoolExecutor(workers, mp_context=context, initializer=_leave_interrupts))
        _refuse_stillborn(pools[-1])
        return pools[-1]

    dispatcher: Dispatcher[Task, Result] = Dispatcher(start(), function, start, TASKS_AHEAD * workers)
    try:
        yield dispatcher
    finally:
        for pool in pools:
            pool.shutdown(wait=True, cancel_futures=True)


def _refuse_stillborn(pool: Executor) -> None:
    """RuntimeError where no process lives long enough to do anything: tasks would be given up one after the other."""
    try:
        pool.submit(os.getpid).result()
    except BrokenExecutor as error:
        raise RuntimeError(
            'the worker processes ended as they started; a script with workers needs `if __name__ == "__main__":`'
            " around what it runs"
        ) from error


def _leave_interrupts() -> None:
    """Leave Ctrl-C, which a terminal sends to every process, to the one that hands out the tasks."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def dask_executor(address: str) -> Iterator[Executor]:
    """The executor of the dask scheduler at an address; ImportError without the extra `studies`."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ImportError("dask's distributed is not installed; needed: pip install 'regionpose[studies]'") from error
    client = Client(address)
    try:
        yield client.get_executor()
    finally:
        client.close()
