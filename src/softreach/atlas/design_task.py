"""Task of one design, start to end: tips, what its metrics are computed from, and its store."""

from __future__ import annotations

import os
import socket
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.atlas.command import Command
from softreach.atlas.metric import Metric, Need
from softreach.atlas.store import UNSTABLE, AtlasStore, Result
from softreach.cloud.curvature import stream_statistics
from softreach.geometry.alpha_shape import AlphaComplex
from softreach.geometry.delaunay import delaunay
from softreach.geometry.hull import convex_hull
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap, TipStatus, no_equilibrium_message
from softreach.support.arrays import Array
from softreach.support.errors import SoftreachError, no_warnings
from softreach.support.files.damage import StoreFailed
from softreach.support.plugins import Imports

_BLOCK = 65_536  # samples at a time, where not all of them are needed at once
Values = dict[str, Array]
Outcome = tuple[int, str]
"""Number of a design, and why it failed; empty if it did not."""

_opened: dict[tuple[str, tuple[str, int]], AtlasStore] = {}


class Intermediates(Mapping[Need, Any]):
    """Need -> its value for one design, computed at first use.

    Args:
        arm: The design.
        cube: Unit activations that all designs share, shape (n, bundles).
        command: Radius, accuracy, tolerance, stations and quantiles.
        metrics: The metrics that will be computed.
    """

    def __init__(
        self, arm: Manipulator, cube: Array, command: Command, metrics: Sequence[Metric]
    ) -> None:
        self.arm, self.cube, self.command = arm, cube, command
        self.needs = frozenset(need for metric in metrics for need in metric.needs)
        self._cache: dict[Need, Any] = {}

    @cached_property
    def rod(self) -> TipMap:
        """The tip map of the design, to the tolerance of the command."""
        return tip_map(self.arm, self.command.tol)

    @cached_property
    def tips(self) -> Array:
        """Tips of all samples [m], shape (n, 3); NaN where there is no equilibrium."""
        return self._samples[0]

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """Mask of the samples that have a stable equilibrium, shape (n,)."""
        return self._samples[1] == TipStatus.STABLE

    @cached_property
    def _samples(self) -> tuple[Array, NDArray[np.int8]]:
        return self.rod.tips_and_status(activations_of(self.rod, self.cube))

    def __getitem__(self, need: Need) -> Any:
        if need not in self._cache:
            self._cache[need] = _COMPUTE[need](self)
        return self._cache[need]

    def __iter__(self) -> Iterator[Need]:
        return iter(_COMPUTE)

    def __len__(self) -> int:
        return len(_COMPUTE)

    def forget(self, *needs: Need) -> None:
        """Free the memory of results that are no longer needed."""
        for need in needs:
            self._cache.pop(need, None)


def activations_of(rod: TipMap, cube: Array) -> Array:
    """The shared unit activations in the bounds of a tip map, shape (n, bundles)."""
    return rod.box.from_cube(cube[:, : rod.box.bundles])


@no_warnings()  # the metrics hold what they say: spacing of the points, error of the volume
def begin_design(store: AtlasStore, metrics: Sequence[Metric], index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses all threads; return the rest as a function to call.

    All threads compute the tips of one design while the hulls of others are computed, one on each
    thread. A failure of the design is stored and returned, one of the store is raised.
    """
    try:
        arm = store.command.design(index)
        intermediates = Intermediates(arm, store.cube, store.command, metrics)
        if not intermediates.stable.any():  # found now, by all threads
            return partial(_put_unstable, store, metrics, index, intermediates)
        threaded = [metric for metric in metrics if Need.REACHABLE_SET in metric.needs]
        values = _values(threaded, intermediates)
        intermediates.forget(Need.REACHABLE_SET)
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, metrics, index, intermediates, values)


class Remote:
    """Task as it travels to a worker elsewhere that computes designs of a store.

    It travels to the worker instead of arrays: the worker reads the activations from the store and
    writes its results there. The metrics' functions are in no store, so they travel along, behind
    the modules that they and the kinds of the design's parts are in.
    """

    def __init__(self, store: AtlasStore) -> None:
        base = store.command.space.base
        self._imports = Imports.needed_by([base.profile, *base.actuators])  # unpickled first
        self._store: AtlasStore | None = store
        self.metrics = store.command.metrics
        self._durable = store.durable
        self._location, self._origin = store.location, (socket.gethostname(), os.getpid())

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_store": None}

    def store(self) -> AtlasStore:
        """The store, opened once per process."""
        from zarr.storage import MemoryStore

        if self._store is not None:
            return self._store
        if self._imports.fault:
            raise StoreFailed(f"in a worker process: {self._imports.fault}")
        if isinstance(self._location, dict | MemoryStore):
            raise StoreFailed("the store is in the memory of another process; use a path or a URL")
        key = repr(self._location), self._origin
        if key not in _opened:
            _opened.clear()
            _opened[key] = AtlasStore.open(self._location, durable=self._durable)
        return _opened[key]

    def bound_threads(self) -> None:
        """A worker process takes one thread, unless its environment says otherwise."""
        if (socket.gethostname(), os.getpid()) != self._origin:
            os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")


def run_remotely(remote: Remote, index: int) -> Outcome:
    """Compute and store a design in a worker; a repeated call gives the same result."""
    remote.bound_threads()
    try:
        return begin_design(remote.store(), remote.metrics, index)()
    except SoftreachError as error:
        raise StoreFailed(str(error)) from None  # this one can be sent back


def _stable(of: Intermediates, values: Array) -> Array:
    """Those of the samples that have a stable equilibrium; not copied if all have."""
    return values if of.stable.all() else values[of.stable]


def _alpha_complex(of: Intermediates) -> AlphaComplex:
    return AlphaComplex(triangulation=delaunay(of[Need.TIPS]))


def _convex_volume(of: Intermediates) -> float:
    """From the triangulation, if one is needed anyway."""
    if Need.ALPHA_COMPLEX in of.needs:
        return float(of[Need.ALPHA_COMPLEX].volumes.sum())
    return convex_hull(of[Need.TIPS]).volume


def _reachable_set(of: Intermediates) -> Any:
    from softreach.workspace import reachable_set

    return reachable_set(of.rod, accuracy=of.command.accuracy)


def _strain_statistics(of: Intermediates) -> Any:
    rod, cube = of.rod, of.cube
    if rod.supports_unstable:
        cube = cube[of.stable]
    blocks = (activations_of(rod, cube[k : k + _BLOCK]) for k in range(0, len(cube), _BLOCK))
    stations = np.array(of.command.stations) * rod.length
    return stream_statistics(rod, blocks, stations, quantiles=of.command.quantiles)


@no_warnings()
def _finish(
    store: AtlasStore,
    metrics: Sequence[Metric],
    index: int,
    intermediates: Intermediates,
    values: Values,
) -> Outcome:
    try:
        rest = [metric for metric in metrics if metric.name not in values]
        result = Result(values | _values(rest, intermediates), _kept_tips(store, intermediates))
    except Exception as error:
        return _fail(store, index, error)
    store.write(index, result)
    return index, ""


def _put_unstable(
    store: AtlasStore, metrics: Sequence[Metric], index: int, intermediates: Intermediates
) -> Outcome:
    """Store a design of which no sample is stable: it has no other metric than that."""
    sizes = intermediates.command.profile_sizes
    values = {
        metric.name: np.full([sizes[dim] for dim in metric.over], np.nan) for metric in metrics
    }
    known = [metric for metric in metrics if metric.needs == (Need.LOST_SHARE,)]
    values |= {metric.name: metric.value(intermediates, sizes) for metric in known}
    result = Result(values, _kept_tips(store, intermediates))
    store.write(index, result, UNSTABLE, no_equilibrium_message(len(intermediates.stable)))
    return index, ""


def _values(metrics: Sequence[Metric], intermediates: Intermediates) -> Values:
    sizes = intermediates.command.profile_sizes
    return {metric.name: metric.value(intermediates, sizes) for metric in metrics}


def _kept_tips(store: AtlasStore, intermediates: Intermediates) -> Array | None:
    return intermediates.tips if store.command.keep_clouds else None


def _fail(store: AtlasStore, index: int, error: Exception) -> Outcome:
    message = f"{type(error).__name__}: {error}"
    store.write_failure(index, message)
    return index, message


_COMPUTE: dict[Need, Callable[[Intermediates], Any]] = {
    Need.ARM: lambda of: of.arm,
    Need.LENGTH: lambda of: of.arm.length,
    Need.ACTIVATIONS: lambda of: _stable(of, activations_of(of.rod, of.cube)),
    Need.TIPS: lambda of: _stable(of, of.tips),
    Need.BASE_TIPS: lambda of: of.arm.base.to_base(of[Need.TIPS]),
    Need.LOST_SHARE: lambda of: float((~of.stable).mean()),
    Need.ALPHA: lambda of: of.command.alpha_over_length * of.arm.length,
    Need.ALPHA_COMPLEX: _alpha_complex,
    Need.CONVEX_VOLUME: _convex_volume,
    Need.REACHABLE_SET: _reachable_set,
    Need.STRAIN_STATISTICS: _strain_statistics,
}
