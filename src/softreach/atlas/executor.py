"""Executors of designs: the threads of this process, or workers elsewhere.

Workers write to the store themselves, so a task that ran twice, or whose answer was lost with its
worker, leaves the same bytes.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from itertools import chain
from typing import Any, Protocol, Self

from softreach.atlas.design_task import Outcome, Remote, begin_design, run_remotely
from softreach.atlas.metric import Metric, check_travels
from softreach.atlas.processes import LocalProcesses, Workers
from softreach.atlas.store import AtlasStore
from softreach.support import parallel
from softreach.support.arguments import as_given
from softreach.support.errors import InvalidInput, SoftreachError

__all__ = ["ExecutorLike", "an_executor", "run_designs"]

ATTEMPTS = 3
"""Workers that a design may take with it before it counts as failed."""


class DaskClient(Protocol):
    """Method of a `dask.distributed.Client` that is used."""

    def get_executor(self, **options: Any) -> Executor:
        """Its tasks as futures."""
        ...


OnOutcome = Callable[[Outcome], None]

ExecutorLike = Executor | DaskClient | Workers | None


_ALLOWED = "a concurrent.futures executor, a function that makes one, or a Dask client"


def an_executor(name: str, value: Any) -> Any:
    """An executor of designs.

    Raises:
        InvalidInput: None of those.
    """
    known = value is None or isinstance(value, Executor) or hasattr(value, "get_executor")
    if known or (callable(value) and not isinstance(value, type)):
        return value
    raise InvalidInput(name, as_given(value), _ALLOWED)


def run_designs(
    store: AtlasStore,
    indices: Sequence[int],
    executor: ExecutorLike,
    on_outcome: OnOutcome,
) -> None:
    """Compute designs and store them.

    Args:
        store: Where they go.
        indices: Which designs.
        executor: None for the threads of this process; else what runs the designs, one a task.
        on_outcome: Called with each outcome as it comes.

    Raises:
        InvalidInput: Not an executor, or a metric that its workers cannot get.
        StoreFailed: The store cannot be written.
        SoftreachError: An executor that cannot be restarted has lost a worker.
    """
    if executor is None:
        # Drawing a task computes the tips, so at most a few clouds per thread are held at once.
        metrics = store.command.metrics
        tasks = (_reporting(begin_design(store, metrics, index), on_outcome) for index in indices)
        # Threads start with the second task: with one before all they get the first design at once.
        parallel.run(chain([lambda: None], tasks))
        return
    pool = _Pool(executor)
    with pool:
        pool.check_metrics(store.command.metrics)
        for index in _run_in_pool(pool, Remote(store), deque(indices), on_outcome):
            on_outcome(_given_up(store, index))


def _reporting(task: Callable[[], Outcome], on_outcome: OnOutcome) -> Callable[[], None]:
    return lambda: on_outcome(task())


class _Pool:
    """An executor that is restarted where that is possible."""

    def __init__(self, executor: ExecutorLike) -> None:
        self._start: Workers | None = None
        if isinstance(executor, Executor):
            self._now = executor
        elif hasattr(executor, "get_executor"):
            # The scheduler itself tries the task of a dead worker again.
            self._now = executor.get_executor(pure=False)  # pyright: ignore
        else:
            self._start = start = an_executor("executor", executor)
            self._now = start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is not None:
            self.abandon()
        if self._start is not None:
            self._now.shutdown(wait=True, cancel_futures=True)

    def abandon(self) -> None:
        """Wait for nothing that is being computed, if the workers are ours."""
        if isinstance(self._now, LocalProcesses):
            self._now.abandon()

    def check_metrics(self, metrics: Sequence[Metric]) -> None:
        """Refuse metrics whose functions a worker process cannot get."""
        if isinstance(self._now, ThreadPoolExecutor):
            return
        by_import = isinstance(self._now, ProcessPoolExecutor)
        for metric in metrics:
            check_travels(metric, by_import=by_import)

    @property
    def window(self) -> int:
        """Tasks to have in the pool at a time: few, as any of them may have broken it."""
        return 2 * getattr(self._now, "_max_workers", 512)

    def submit(self, *call: Any) -> Future[Outcome]:
        """Hand a call to a worker."""
        return self._now.submit(*call)

    def renew(self) -> None:
        """Replace a broken executor."""
        if self._start is None:
            raise SoftreachError(
                "a worker died and broke its executor; the same call continues, and goes on by "
                "itself if the executor is given as a function that makes it"
            )
        self._now.shutdown(wait=False, cancel_futures=True)
        self._now = self._start()


def _run_in_pool(
    pool: _Pool, remote: Remote, waiting: deque[int], on_outcome: OnOutcome
) -> list[int]:
    """Run the designs; return those that kill their workers again and again."""
    lost: list[int] = []
    while waiting:
        suspects = _run_until_broken(pool, remote, waiting, on_outcome)
        # One at a time, to tell the design at fault from its neighbors.
        lost += [index for index in suspects if not _survives(pool, remote, index, on_outcome)]
    return lost


def _survives(pool: _Pool, remote: Remote, index: int, on_outcome: OnOutcome) -> bool:
    tries = (_run_until_broken(pool, remote, deque([index]), on_outcome) for _ in range(ATTEMPTS))
    return any(not died for died in tries)


def _run_until_broken(
    pool: _Pool, remote: Remote, waiting: deque[int], on_outcome: OnOutcome
) -> list[int]:
    """Run designs from `waiting` until all are done or a worker dies; return those running then."""
    pending: dict[Future[Outcome], int] = {}
    suspects: list[int] = []
    broken = False
    try:
        while (waiting or pending) and not broken:
            broken = not _fill(pool, remote, waiting, pending)
            done = wait(pending, return_when=FIRST_COMPLETED).done
            suspects += _settle(pending, done, remote, on_outcome)
            broken = broken or bool(suspects)
    finally:
        for future in pending:
            future.cancel()
    if broken:
        suspects += _settle(pending, wait(pending).done, remote, on_outcome)
        pool.renew()
    return suspects


def _fill(
    pool: _Pool, remote: Remote, waiting: deque[int], pending: dict[Future[Outcome], int]
) -> bool:
    """Submit designs up to the pool's window; False if the pool is broken."""
    try:
        while waiting and len(pending) < pool.window:
            pending[pool.submit(run_remotely, remote, waiting[0])] = waiting[0]
            waiting.popleft()
    except BrokenExecutor:
        return False
    return True


def _settle(
    pending: dict[Future[Outcome], int],
    done: set[Future[Outcome]],
    remote: Remote,
    on_outcome: OnOutcome,
) -> list[int]:
    """Report what has ended; return designs that ended with their worker."""
    ended = [(future, pending.pop(future)) for future in done]
    return [index for future, index in ended if not _reported(future, index, remote, on_outcome)]


def _reported(future: Future[Outcome], index: int, remote: Remote, on_outcome: OnOutcome) -> bool:
    """Report an outcome; False if there is none, as the worker died."""
    try:
        on_outcome(future.result())
    except (BrokenExecutor, CancelledError):
        return False
    except Exception as error:
        if type(error).__name__ != "KilledWorker":
            raise
        on_outcome(_given_up(remote.store(), index))  # Dask has tried it again by then
    return True


def _given_up(store: AtlasStore, index: int) -> Outcome:
    message = "its worker died repeatedly"
    store.write_failure(index, message)
    return index, message
