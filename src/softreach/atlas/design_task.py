"""One design, start to end: tips, metrics, store."""

from __future__ import annotations

import os
import socket
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.atlas.command import Command
from softreach.atlas.metrics import hull_metrics, image_metrics
from softreach.atlas.store import AtlasStore, Result, StoreFailed
from softreach.curvature import QUANTITIES, stream_statistics
from softreach.errors import SoftreachError, SoftreachWarning
from softreach.rod.kinematics import tip_positions

__all__ = ["Outcome", "Remote", "activations_of", "begin_design", "run_remotely"]

Array = NDArray[np.float64]
Outcome = tuple[int, str]
"""Number of a design, and why it failed; empty if it did not."""

_BLOCK = 65_536


def begin_design(store: AtlasStore, index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses every thread by itself; the rest is returned, to be called.

    So that one design's tips are computed by all threads while others have their hulls taken, one
    on each thread. A failure of the design is stored and returned, one of the store is raised.
    """
    try:
        arm, command = store.command.design(index), store.command
        tips = tip_positions(arm, activations_of(arm, store.cube), command.tol)
        exact = "exact" in command.metrics
        numbers = image_metrics(arm, command.tol, command.accuracy) if exact else {}
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, index, arm, tips, numbers)


def activations_of(arm: Manipulator, cube: Array) -> Array:
    """The shared unit activations in the arm's own bounds, shape (n, bundles)."""
    low, high = arm.bounds.T
    return low + cube[:, : arm.bundles] * (high - low)


class Remote:
    """What a worker elsewhere needs to compute designs of a store.

    It travels to the worker instead of arrays: the worker reads the activations from the store and
    writes its results there.
    """

    def __init__(self, store: AtlasStore) -> None:
        self._store: AtlasStore | None = store
        self._location, self._origin = store.location, (socket.gethostname(), os.getpid())

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_store": None}

    def store(self) -> AtlasStore:
        """The store, opened once per process."""
        from zarr.storage import MemoryStore

        if self._store is not None:
            return self._store
        if isinstance(self._location, dict | MemoryStore):
            raise StoreFailed("the store is in the memory of another process; use a path or a URL")
        key = repr(self._location), self._origin
        if key not in _opened:
            _opened.clear()
            _opened[key] = AtlasStore.open(self._location)
        return _opened[key]

    def bound_threads(self) -> None:
        """A worker process takes one thread, unless its environment says otherwise."""
        if (socket.gethostname(), os.getpid()) != self._origin:
            os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")


_opened: dict[tuple[str, tuple[str, int]], AtlasStore] = {}


def run_remotely(remote: Remote, index: int) -> Outcome:
    """Compute and store a design in a worker; called again, it does the same again."""
    remote.bound_threads()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        try:
            return begin_design(remote.store(), index)()
        except SoftreachError as error:
            raise StoreFailed(str(error)) from None  # survives the way back


def _finish(
    store: AtlasStore, index: int, arm: Manipulator, tips: Array, numbers: dict[str, float]
) -> Outcome:
    command = store.command
    try:
        numbers |= hull_metrics(arm, tips, command.alpha, command.metrics)
        curved = "curvature" in command.metrics
        quantiles = _quantiles(arm, command, store.cube) if curved else None
    except Exception as error:
        return _fail(store, index, error)
    store.write(index, Result(numbers, quantiles, tips if command.keep_clouds else None))
    return index, ""


def _fail(store: AtlasStore, index: int, error: Exception) -> Outcome:
    message = f"{type(error).__name__}: {error}"
    store.write_failure(index, message)
    return index, message


def _quantiles(arm: Manipulator, command: Command, cube: Array) -> Array:
    """Shape (quantity, station, quantile)."""
    stations = np.array(command.stations) * arm.length
    found = stream_statistics(arm, _blocks(arm, cube), stations, quantiles=command.quantiles)
    return np.stack([found[f"{name}_quantile"].values for name in QUANTITIES])


def _blocks(arm: Manipulator, cube: Array) -> Iterator[Array]:
    return (activations_of(arm, cube[k : k + _BLOCK]) for k in range(0, len(cube), _BLOCK))
