"""Task of one design, start to end: its metrics computed, and stored."""

from __future__ import annotations

import os
import secrets
import socket
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from softreach.atlas.intermediates import Intermediates
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import UNSTABLE, AtlasStore, Result
from softreach.rod.tip_map import no_equilibrium_message
from softreach.support.arrays import Array
from softreach.support.errors import SoftreachError, no_warnings
from softreach.support.files.stores import StoreFailed

Values = dict[str, Array]
Outcome = tuple[int, str]
"""Number of a design, and why it failed; empty if it did not."""

_opened: dict[str, AtlasStore] = {}


@no_warnings()  # the metrics hold what they say: spacing of the points, error of the volume
def begin_design(store: AtlasStore, metrics: Sequence[Metric], index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses all threads; return the rest as a function to call.

    All threads compute the tips of one design while the hulls of others are computed, one on each
    thread. A failure of the design is stored and returned, one of the store is raised.
    """
    try:
        arm = store.command.design(index)
        found = Intermediates(arm, store.cube, store.command, metrics)
        threaded = [metric for metric in metrics if Need.REACHABLE_SET in metric.needs]
        values = _values(store, threaded, found)  # none but NaN where nothing is stable
        found.forget(Need.REACHABLE_SET)
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, metrics, index, found, values)


class Remote:
    """Task as it travels to a worker elsewhere that computes designs of a store.

    The worker reads the activations from the store and writes its results there. The command
    travels along, as the functions of metrics are in no store; unpickling it imports the modules
    that these and the kinds of the design's parts are in.
    """

    def __init__(self, store: AtlasStore) -> None:
        self.command, self._location = store.command, store.location
        self._durable = store.opened.durable
        self._store: AtlasStore | None = store
        self._token, self._origin = secrets.token_hex(8), (socket.gethostname(), os.getpid())

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_store": None}

    def store(self) -> AtlasStore:
        """The store, opened once per process, which uses one thread by default."""
        from zarr.storage import MemoryStore

        if self._store is not None:
            return self._store
        if (socket.gethostname(), os.getpid()) != self._origin:
            os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")
            if isinstance(self._location, dict | MemoryStore):
                raise StoreFailed(
                    "the store is in the memory of another process; use a path or a URL"
                )
        if self._token not in _opened:
            _opened.clear()
            _opened[self._token] = AtlasStore.open(self._location, durable=self._durable)
        return _opened[self._token]


def run_remotely(remote: Remote, index: int) -> Outcome:
    """Compute and store a design in a worker; a repeated call gives the same result."""
    try:
        return begin_design(remote.store(), remote.command.metrics, index)()
    except SoftreachError as error:
        raise StoreFailed(str(error)) from None  # this one can be sent back


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
