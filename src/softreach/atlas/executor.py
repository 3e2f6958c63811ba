"""Designs computed and stored by the threads of this process, or by workers elsewhere.

Workers write to the store themselves, so a task that ran twice, or whose answer was lost with its
worker, leaves the same bytes.
"""

from __future__ import annotations

import os
import pickle
import secrets
import socket
from collections.abc import Callable, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass, field
from functools import partial
from itertools import chain, islice
from typing import Any

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.intermediates import Intermediates
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import UNSTABLE, AtlasStore, Result
from softreach.rod.tip_map import no_equilibrium_message
from softreach.support import parallel
from softreach.support.arguments import as_given
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible, SoftreachError, no_warnings
from softreach.support.files.stores import StoreFailed
from softreach.support.interruption import check_stopped

__all__ = ["ExecutorLike", "an_executor", "begin_design", "run_designs"]

_AHEAD = 512  # tasks that an executor has at a time

Values = dict[str, Array]
Outcome = tuple[int, str]
"""Number of a design, and why it failed; empty if it did not."""
OnOutcome = Callable[[Outcome], None]


ExecutorLike = Any
"""None, an `Executor`, or a `dask.distributed.Client`, which has a method `get_executor`."""

_opened: dict[str, AtlasStore] = {}


def an_executor(name: str, value: Any) -> Any:
    """An executor of designs.

    Raises:
        InvalidInput: None of those.
    """
    if value is None or isinstance(value, Executor) or hasattr(value, "get_executor"):
        return value
    raise InvalidInput(name, as_given(value), "a concurrent.futures executor, or a Dask client")


def run_designs(
    store: AtlasStore, indices: Sequence[int], executor: ExecutorLike, on_outcome: OnOutcome
) -> None:
    """Compute and store designs, one a task; each outcome is reported as it comes.

    Raises:
        InvalidInput: A metric that worker processes cannot get.
        StoreFailed: The store cannot be written.
        NotPossible: A worker died, and with it the executor.
    """
    if executor is None:
        # Drawing a task computes the tips, so at most a few clouds per thread are held at once.
        metrics = store.command.metrics
        begun = (begin_design(store, metrics, index) for index in indices)
        tasks = (partial(lambda task: on_outcome(task()), task) for task in begun)
        # Threads start with the second task: with one before all they get the first design at once.
        parallel.run(chain([lambda: None], tasks))
        return
    if isinstance(executor, ProcessPoolExecutor):
        _check_pickled(store.command.metrics)
    pool = executor if isinstance(executor, Executor) else executor.get_executor(pure=False)
    _run_in_pool(pool, store, indices, on_outcome)


def _check_pickled(metrics: Sequence[Metric]) -> None:
    for metric in metrics:
        try:
            pickle.dumps(metric.compute)
        except Exception:
            allowed = "a function of a module where worker processes compute it"
            hint = "lambdas and functions inside of functions cannot be sent to them"
            name = f"compute of metric {metric.name}"
            raise InvalidInput(name, metric.compute, allowed, hint) from None


def _run_in_pool(
    pool: Executor, store: AtlasStore, indices: Sequence[int], on_outcome: OnOutcome
) -> None:
    remote = _Remote(store.command, store.location, store.opened.durable, store)
    waiting = iter(indices)
    pending: dict[Future[Outcome], int] = {}
    try:
        while True:
            check_stopped()
            for index in islice(waiting, _AHEAD - len(pending)):
                pending[pool.submit(_run_remotely, remote, index)] = index
            if not pending:
                return
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                on_outcome(_outcome(future, store, pending.pop(future)))
    except BrokenExecutor as error:
        raise NotPossible(
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


@dataclass(frozen=True)
class _Remote:
    """A store as it travels to a worker elsewhere, where designs are read and written.

    The command travels along, as the functions of metrics are in no store; unpickling it imports
    the modules that these and the kinds of the design's parts are in.
    """

    command: Command
    location: Any
    durable: bool
    here: AtlasStore | None
    """The store itself, in the process that opened it."""
    token: str = field(default_factory=lambda: secrets.token_hex(8))
    origin: tuple[str, int] = field(default_factory=lambda: (socket.gethostname(), os.getpid()))

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"here": None}

    def store(self) -> AtlasStore:
        """The store, opened once per process, which uses one thread by default."""
        from zarr.storage import MemoryStore

        if self.here is not None:
            return self.here
        if (socket.gethostname(), os.getpid()) != self.origin:
            os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")
            if isinstance(self.location, dict | MemoryStore):
                raise NotPossible(
                    "the store is in the memory of another process; use a path or a URL"
                )
        if self.token not in _opened:
            _opened.clear()
            _opened[self.token] = AtlasStore.open(self.location, durable=self.durable)
        return _opened[self.token]


def _run_remotely(remote: _Remote, index: int) -> Outcome:
    """Compute and store a design in a worker; a repeated call gives the same result."""
    try:
        return begin_design(remote.store(), remote.command.metrics, index)()
    except SoftreachError as error:
        raise StoreFailed(str(error)) from None  # this one can be sent back


@no_warnings()  # the metrics hold what they say: spacing of the points, error of the volume
def begin_design(store: AtlasStore, metrics: Sequence[Metric], index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses all threads; return the rest as a function to call.

    All threads compute the tips of one design while the hulls of others are computed, one on each
    thread. A failure of the design is stored and returned, one of the store is raised.
    """
    try:
        arm = store.command.space.design(index)
        found = Intermediates(arm, store.cube, store.command, metrics)
        threaded = [metric for metric in metrics if Need.REACHABLE_SET in metric.needs]
        values = _values(store, threaded, found)  # none but NaN where nothing is stable
        found.forget(Need.REACHABLE_SET)
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, metrics, index, found, values)


@no_warnings()
def _finish(
    store: AtlasStore, metrics: Sequence[Metric], index: int, found: Intermediates, values: Values
) -> Outcome:
    try:
        rest = [metric for metric in metrics if metric.name not in values]
        values |= _values(store, rest, found)
        tips = found.tips if store.command.keep_clouds else None
    except Exception as error:
        return _fail(store, index, error)
    if found.stable.any():
        store.write(index, Result(values, tips))
    else:
        message = no_equilibrium_message(len(found.stable))
        store.write(index, Result(values, tips), UNSTABLE, message)
    return index, ""


def _values(store: AtlasStore, metrics: Sequence[Metric], found: Intermediates) -> Values:
    """Metrics by name; where no sample is stable there is none but the share that is lost."""
    sizes = store.command.profile_sizes
    if found.stable.any():
        return {metric.name: metric.value(found, sizes) for metric in metrics}
    return {
        metric.name: metric.value(found, sizes)
        if metric.needs == (Need.LOST_SHARE,)
        else np.full([sizes[dim] for dim in metric.over], np.nan)
        for metric in metrics
    }


def _fail(store: AtlasStore, index: int, error: Exception) -> Outcome:
    message = f"{type(error).__name__}: {error}"
    store.write_status(index, message)
    return index, message
