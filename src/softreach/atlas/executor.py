"""Designs computed and stored by the threads of this process, or by workers elsewhere."""

from __future__ import annotations

import os
import pickle
import secrets
from collections.abc import Callable, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.intermediates import Intermediates
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import UNSTABLE, AtlasStore
from softreach.rod.tip_map import no_equilibrium_message
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible, SoftreachError, no_warnings
from softreach.support.files.stores import StoreFailed
from softreach.support.interruption import check_stopped

_AHEAD = 512  # tasks that an executor has at a time

Values = dict[str, Array]
Outcome = tuple[int, str]  # Number of a design, and why it failed; empty if it did not
OnOutcome = Callable[[Outcome], None]


@runtime_checkable
class DaskClient(Protocol):
    """A `dask.distributed.Client`."""

    def get_executor(self, *, pure: bool) -> Executor:
        """An executor on its cluster; those that are pure compute equal tasks once."""
        ...


ExecutorLike = Executor | DaskClient | None

_opened: dict[tuple[str, int], AtlasStore] = {}  # Stores by the token of a call and the process


def run_designs(
    store: AtlasStore, indices: Sequence[int], executor: ExecutorLike, on_outcome: OnOutcome
) -> None:
    """Compute and store designs, one a task; each outcome is reported as it comes."""
    if executor is None:
        # Drawing a task computes the tips, so at most a few clouds per thread are held at once.
        begun = (begin_design(store, index) for index in indices)
        tasks = (partial(lambda task: on_outcome(task()), task) for task in begun)
        # Threads start with the second task: with one before all they get the first design at once.
        parallel.run(chain([lambda: None], tasks))
        return
    for metric in store.command.metrics if isinstance(executor, ProcessPoolExecutor) else ():
        try:
            pickle.dumps(metric.compute)
        except Exception:
            allowed = "a function of a module where worker processes compute it"
            hint = "lambdas and functions inside of functions cannot be sent to them"
            name = f"compute of metric {metric.name}"
            raise InvalidInput(name, metric.compute, allowed, hint) from None
    pool = executor if isinstance(executor, Executor) else executor.get_executor(pure=False)
    _run_in_pool(pool, store, indices, on_outcome)


def _run_in_pool(
    pool: Executor, store: AtlasStore, indices: Sequence[int], on_outcome: OnOutcome
) -> None:
    key = token, origin = secrets.token_hex(8), os.getpid()
    remote = _Remote(store.command, store.location, store.opened.durable, token, origin)
    _opened[key] = store  # for workers that are threads of this process
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
                index = pending.pop(future)
                try:
                    outcome = future.result()
                except Exception as error:
                    if type(error).__name__ != "KilledWorker":
                        raise
                    outcome = index, "its worker died repeatedly"  # Dask has tried it again by then
                    store.write_status(*outcome)
                on_outcome(outcome)
    except BrokenExecutor as error:
        raise NotPossible(
            "a worker died and broke its executor; finished designs are safe: the same call with "
            "a new executor continues"
        ) from error
    finally:
        for future in pending:
            future.cancel()
        _opened.pop(key, None)


class _Remote(NamedTuple):
    """A store as it travels to a worker, with the functions of metrics, which are in no store.

    Unpickling it imports the modules that these and the kinds of the design's parts are in.
    """

    command: Command
    location: Any
    durable: bool
    token: str
    origin: int  # Process that began the store


def _run_remotely(remote: _Remote, index: int) -> Outcome:
    """Compute and store a design in a worker; a repeated call gives the same result."""
    try:
        return begin_design(_store_of(remote), index)()
    except SoftreachError as error:
        raise StoreFailed(str(error)) from None  # this one can be sent back


def _store_of(remote: _Remote) -> AtlasStore:
    """The store, opened once by each worker process, which uses one thread by default."""
    from zarr.storage import MemoryStore

    key = remote.token, os.getpid()  # a forked process has what its parent opened
    if key not in _opened:
        if key[1] != remote.origin:
            os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")
            if isinstance(remote.location, dict | MemoryStore):
                where = "in the memory of another process"
                raise NotPossible(f"the store is {where}; use a path or a URL")
        _opened.clear()
        store = AtlasStore.open(remote.location, durable=remote.durable)
        _opened[key] = replace(store, command=remote.command)  # which has all functions
    return _opened[key]


@no_warnings()  # the metrics hold what they say: spacing of the points, error of the volume
def begin_design(store: AtlasStore, index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses all threads; return the rest as a function to call.

    All threads compute the tips of one design while the hulls of others are computed, one on each
    thread. A failure of the design is stored and returned, one of the store is raised.
    """
    command = store.command
    try:
        needed = Intermediates(command.space.design(index), store.cube, command)
        threaded = [metric for metric in command.metrics if Need.REACHABLE_SET in metric.needs]
        values = _values(threaded, needed, command)  # none but NaN where nothing is stable
        needed.forget(Need.REACHABLE_SET)
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, index, needed, values)


@no_warnings()
def _finish(store: AtlasStore, index: int, needed: Intermediates, values: Values) -> Outcome:
    command, stable = store.command, needed.stable
    try:
        rest = [metric for metric in command.metrics if metric.name not in values]
        values |= _values(rest, needed, command)
        tips = needed.tips if command.keep_clouds else None
    except Exception as error:
        return _fail(store, index, error)
    if stable.any():
        store.write(index, values, tips)
    else:
        store.write(index, values, tips, UNSTABLE, no_equilibrium_message(len(stable)))
    return index, ""


def _values(metrics: Sequence[Metric], needed: Intermediates, command: Command) -> Values:
    """Metrics by name; where no sample is stable there is none but the share that is lost."""
    sizes, is_stable = command.profile_sizes, needed.stable.any()
    return {
        metric.name: metric.value(needed, sizes)
        if is_stable or metric.needs == (Need.LOST_SHARE,)
        else np.full([sizes[dim] for dim in metric.over], np.nan)
        for metric in metrics
    }


def _fail(store: AtlasStore, index: int, error: Exception) -> Outcome:
    message = f"{type(error).__name__}: {error}"
    store.write_status(index, message)
    return index, message
