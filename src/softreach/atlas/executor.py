"""Executors of designs: the threads of this process, or workers elsewhere.

Workers write to the store themselves, so a task that ran twice, or whose answer was lost with its
worker, leaves the same bytes.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from itertools import chain, islice
from typing import Any, Protocol

from softreach.atlas.design_task import Outcome, Remote, begin_design, run_remotely
from softreach.atlas.store import AtlasStore
from softreach.support import parallel
from softreach.support.arguments import as_given
from softreach.support.errors import InvalidInput, SoftreachError
from softreach.support.interruption import check_stopped

__all__ = ["ExecutorLike", "an_executor", "run_designs"]

_AHEAD = 512  # tasks that an executor has at a time


class DaskClient(Protocol):
    """Method of a `dask.distributed.Client` that is used."""

    def get_executor(self, **options: Any) -> Executor:
        """Its tasks as futures."""
        ...


OnOutcome = Callable[[Outcome], None]

ExecutorLike = Executor | DaskClient | None


def an_executor(name: str, value: Any) -> Any:
    """An executor of designs.

    Raises:
        InvalidInput: None of those.
    """
    if value is None or isinstance(value, Executor) or hasattr(value, "get_executor"):
        return value
    allowed = "a concurrent.futures executor, or a Dask client"
    raise InvalidInput(name, as_given(value), allowed)


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
        InvalidInput: A metric that worker processes cannot get.
        StoreFailed: The store cannot be written.
        SoftreachError: A worker died, and with it the executor.
    """
    if executor is None:
        # Drawing a task computes the tips, so at most a few clouds per thread are held at once.
        metrics = store.command.metrics
        tasks = (_reporting(begin_design(store, metrics, index), on_outcome) for index in indices)
        # Threads start with the second task: with one before all they get the first design at once.
        parallel.run(chain([lambda: None], tasks))
        return
    if isinstance(executor, ProcessPoolExecutor):
        for metric in store.command.metrics:
            try:
                pickle.dumps(metric.compute)
            except Exception:
                raise InvalidInput(
                    f"compute of metric {metric.name}",
                    metric.compute,
                    "a function of a module where worker processes compute it",
                    "lambdas and functions inside of functions cannot be sent to them",
                ) from None
    pool = executor if isinstance(executor, Executor) else executor.get_executor(pure=False)
    _run_in_pool(pool, store, indices, on_outcome)


def _reporting(task: Callable[[], Outcome], on_outcome: OnOutcome) -> Callable[[], None]:
    return lambda: on_outcome(task())


def _run_in_pool(
    pool: Executor, store: AtlasStore, indices: Sequence[int], on_outcome: OnOutcome
) -> None:
    remote, waiting = Remote(store), iter(indices)
    pending: dict[Future[Outcome], int] = {}
    try:
        while True:
            check_stopped()
            for index in islice(waiting, _AHEAD - len(pending)):
                pending[pool.submit(run_remotely, remote, index)] = index
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                on_outcome(_outcome(future, store, pending.pop(future)))
    except BrokenExecutor as error:
        raise SoftreachError(
            "a worker died and broke its executor; what is done is safe, and the same call with "
            "a new executor continues"
        ) from error
    finally:
        for future in pending:
            future.cancel()


def _outcome(future: Future[Outcome], store: AtlasStore, index: int) -> Outcome:
    try:
        return future.result()
    except Exception as error:
        if type(error).__name__ != "KilledWorker":
            raise
        message = "its worker died repeatedly"  # Dask has tried it again by then
        store.write_status(index, message)
        return index, message
