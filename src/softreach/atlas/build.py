"""Building an atlas: every design of a space, stored as it comes, resumed where it stopped."""

import os
import pickle
import secrets
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, wait
from dataclasses import replace
from functools import partial
from itertools import chain, islice
from threading import Lock
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from zarr.storage import MemoryStore, StoreLike  # noqa: TID253  (imported where stores are)

from softreach.atlas.metrics import METRIC_GROUPS, Intermediates, Metric, Need, chosen_metrics
from softreach.atlas.reading import a_store, contents, open_atlas, over_length
from softreach.atlas.space import Command, DesignSpace
from softreach.atlas.store import DONE, GAP, UNSTABLE, AtlasStore
from softreach.rod.rods import check_device
from softreach.rod.tip_map import Device, check_tol, no_equilibrium
from softreach.sampling import check_sampler
from softreach.support import errors, parallel
from softreach.support.arguments import POSITIVE, as_flag, as_given, as_instance, as_number, plain
from softreach.support.arrays import Array
from softreach.support.files.stores import StoreFailed
from softreach.support.interruption import check_stopped
from softreach.support.lazy import Dataset
from softreach.support.memory import check_memory
from softreach.support.progress import Progress, as_progress, bar
from softreach.workspace.reach import ACCURACIES

Values = dict[str, Array]
Outcome = tuple[int, str]  # Number of a design, and why it failed; empty if it did not
OnOutcome = Callable[[Outcome], None]

_AHEAD = 512  # tasks that an executor has at a time
_EXECUTORS = "a concurrent.futures executor, or a Dask client"
_SAMPLE_MEMORY = 700  # bytes of memory of a sample and its share of the triangulation
_opened: dict[tuple[str, int], AtlasStore] = {}  # Stores by the token of a call and the process


@runtime_checkable
class DaskClient(Protocol):
    """A `dask.distributed.Client`."""

    def get_executor(self, *, pure: bool) -> Executor:
        """An executor on its cluster; those that are pure compute equal tasks once."""
        ...


ExecutorLike = Executor | DaskClient | None


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
            raise errors.InvalidInput(name, metric.compute, allowed, hint) from None
    pool = executor if isinstance(executor, Executor) else executor.get_executor(pure=False)
    _run_pool(pool, store, indices, on_outcome)


def _run_pool(pool: Executor, store: AtlasStore, indices: Sequence[int], report: OnOutcome) -> None:
    key = token, origin = secrets.token_hex(8), os.getpid()
    remote = _Remote(store.command, store.location, token, origin)
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
            for future in wait(pending, return_when="FIRST_COMPLETED").done:
                index = pending.pop(future)
                try:
                    outcome = future.result()
                except Exception as error:
                    if type(error).__name__ != "KilledWorker":
                        raise
                    outcome = index, "its worker died repeatedly"  # Dask has tried it again by then
                    store.write_status(*outcome)
                report(outcome)
    except BrokenExecutor as error:
        then = "finished designs are safe: the same call with a new executor continues"
        raise errors.NotPossible(f"a worker died and broke its executor; {then}") from error
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
    token: str
    origin: int  # Process that began the store


def _run_remotely(remote: _Remote, index: int) -> Outcome:
    """Compute and store a design in a worker, which opens the store once and uses one thread."""
    key = remote.token, os.getpid()  # a forked process has what its parent opened
    try:
        if key not in _opened:
            if key[1] != remote.origin:
                os.environ.setdefault("SOFTREACH_NUM_THREADS", "1")
                if isinstance(remote.location, dict | MemoryStore):
                    where = "in the memory of another process"
                    raise errors.NotPossible(f"the store is {where}; use a path or a URL")
            _opened.clear()
            store = AtlasStore.open(remote.location)
            _opened[key] = replace(store, command=remote.command)  # which has all functions
        return begin_design(_opened[key], index)()
    except errors.SoftreachError as error:
        raise StoreFailed(str(error)) from None  # this one can be sent back


@errors.no_warnings()  # the metrics hold what they say: spacing of the points, error of the volume
def begin_design(store: AtlasStore, index: int) -> Callable[[], Outcome]:
    """Do the part of a design that uses all threads; return the rest as a function to call.

    All threads compute the tips of one design while the hulls of others are computed, one on each
    thread. A failure of the design is stored and returned, one of the store is raised.
    """
    try:
        needed = Intermediates(store.command.space.design(index), store.cube, store.command)
        values = _values(needed, store.command, of_sets=True)
        needed.computed.pop(Need.REACHABLE_SET, None)  # frees memory
    except StoreFailed:
        raise
    except Exception as error:
        return partial(_fail, store, index, error)
    return partial(_finish, store, index, needed, values)


@errors.no_warnings()
def _finish(store: AtlasStore, index: int, needed: Intermediates, values: Values) -> Outcome:
    try:
        values |= _values(needed, store.command, of_sets=False)
        tips = needed.tips if store.command.keep_clouds else None
    except Exception as error:
        return _fail(store, index, error)
    stable, why = needed.stable, ""
    if not stable.any():
        why = str(no_equilibrium(len(stable)).value)
    store.write(index, values, tips, UNSTABLE if why else DONE, why)
    return index, ""


def _values(needed: Intermediates, command: Command, *, of_sets: bool) -> Values:
    """Metrics by name; where no sample is stable there is none but the share that is lost."""
    sizes, is_stable = command.profile_sizes, needed.stable.any()
    return {
        metric.name: metric.value(needed, sizes)
        if is_stable or metric.needs == (Need.LOST_SHARE,)
        else np.full([sizes[dim] for dim in metric.over], np.nan)
        for metric in command.metrics
        if (Need.REACHABLE_SET in metric.needs) == of_sets
    }


def _fail(store: AtlasStore, index: int, error: Exception) -> Outcome:
    message = f"{type(error).__name__}: {error}"
    store.write_status(index, message)
    return index, message


def build_atlas(
    space: DesignSpace,
    store: StoreLike,
    n: int = 400_000,
    seed: int = 0,
    *,
    sampler: str = "uniform",
    metrics: Sequence[str | Metric] = tuple(METRIC_GROUPS),
    alpha_over_length: float = 0.05,
    accuracy: float = 3e-3,
    tol: float = 1e-6,
    keep_clouds: bool = True,
    executor: ExecutorLike = None,
    shard: tuple[int, int] = (0, 1),
    device: Device = "cpu",
    progress: Progress | None = None,
) -> Dataset:
    """Compute the cloud and the metrics of every design (sections 3 and 4), or what is missing.

    All designs share one set of unit activations, scaled to each one's bounds. Every design is
    stored when it is done: after an interruption, even by kill -9, the same call continues and ends
    with the same numbers. Damaged designs are computed again, and so are those that failed, which
    are recorded with their errors. Combinations that no arm can have stay gaps.

    Under loads, only samples with a stable equilibrium count; `lost_share` is the share of the
    others. Without any, a design has no other metric, but a message, and is not tried again.

    Stored clouds are rounded to 1e-5 of the shortest length, off by half of that at most in each
    coordinate, which halves their size; metrics are computed before.

    Args:
        space: The designs.
        store: Path, URL or Zarr store of the atlas.
        n: Samples of each design.
        seed: Seed of the sampler.
        sampler: As `compute_cloud` has it.
        metrics: Groups of metrics (extent, convex, concave, exact, curvature, stability), or a
            `Metric` of your own.
        alpha_over_length: Radius of the alpha shapes over the length of each design.
        accuracy: Relative error asked of the exact volumes; see `reachable_set`.
        tol: Largest tip error, in L.
        keep_clouds: Whether to store the tips, 6.2 bytes each.
        executor: None for all cores of this process, with at most two clouds and one triangulation
            per thread in memory; a `concurrent.futures` executor; or a Dask client. Workers write
            to the store, which they must see at the same place, and use one thread each unless
            ``SOFTREACH_NUM_THREADS`` says otherwise.
        shard: (i, k) computes every k-th design from the i-th on, i from 0, so that k processes
            share a store.
        device: What computes tips: "cpu", or "cuda" for a GPU, of arms without loads.
        progress: Called with the number of designs done since its last call; None for a bar.

    Returns:
        The atlas as `open_atlas` has it.

    Raises:
        InvalidInput: An argument out of range, no valid design, or a store of another command.
        DamagedStore: The root of the store is damaged, and another command began it.
        StoreFailed: The store cannot be written, for instance because the disk is full.
        SoftreachError: A worker died and broke its executor; a new one continues.

    Warns:
        SoftreachWarning: Gaps, failed or damaged designs, or points too sparse for the radius.

    Examples:
        >>> space = sr.DesignSpace.grid(sr.designs.minimal_trunk(), taper=[0.0, 0.03])
        >>> atlas = sr.build_atlas(space, "tapers.zarr", n=500, metrics=["convex"])
        >>> atlas.convex_volume.sel(taper=0.03).item() > 0
        True
    """
    as_instance("space", space, DesignSpace, "a DesignSpace")
    store, (first, count) = a_store("store", store), _shard_of("shard", shard)
    check_device(device)
    as_instance("executor", executor, (type(None), Executor, DaskClient), _EXECUTORS)
    progress = None if progress is None else as_progress(progress)
    check_sampler(sampler, n, 0, seed)
    check_memory("n", n, _SAMPLE_MEMORY * n)
    known: Any = {
        "tol": check_tol(tol),
        "device": device,
        "alpha_over_length": as_number("alpha_over_length", alpha_over_length, POSITIVE),
        "accuracy": as_number("accuracy", accuracy, ACCURACIES),
        "metrics": chosen_metrics(metrics),
        "keep_clouds": as_flag("keep_clouds", keep_clouds),
    }
    command = Command(space=space, n=n, seed=seed, sampler=sampler, **known)
    if space.gaps:
        index, reason = next(iter(space.gaps.items()))
        stay = "stays a gap" if len(space.gaps) == 1 else "stay gaps"
        lost = f"{len(space.gaps)} of {space.size} designs cannot exist and {stay}"
        errors.warn(f"{lost}, first {space.values(index)}: {reason}")
    atlas = AtlasStore.begin(store, command)
    numbers = range(first, space.size, count)
    content = contents(atlas, tips_of=numbers)
    content.warn_of_damage("; damaged designs are computed again")
    ended = np.isin(content.status, (DONE, GAP, UNSTABLE))
    _run(atlas, [k for k in numbers if not ended[k]], executor, progress)
    built = open_atlas(store)
    _warn_of_metrics(built)
    return built


def _shard_of(name: str, value: Any) -> tuple[int, int]:
    pair = tuple(map(plain, value)) if isinstance(value, tuple | list) else ()
    if len(pair) == 2 and {*map(type, pair)} == {int} and 0 <= pair[0] < pair[1]:
        return pair
    shown = "/".join(map(str, pair)) if len(pair) == 2 else as_given(value)
    raise errors.InvalidInput(name, shown, "(i, k), or i/k on the command line, with 0 <= i < k")


def _warn_of_metrics(built: Dataset) -> None:
    if len(unstable := np.flatnonzero(built["status"].values == UNSTABLE)):
        number, message = (built[x].values.flat[unstable[0]] for x in ("number", "message"))
        without = f"{errors.counted(len(unstable), 'design')} without metrics"
        errors.warn(f"{without}, first number {number}: {message}")
    radius = built.volume.attrs["alpha_over_length"] if "spacing" in built else 0.0
    if radius and (sparse := int((radius < 3.0 * over_length(built, "spacing")).sum())):
        whose = "its volume is" if sparse == 1 else "their volumes are"
        few = f"alpha = {radius:.4g} L is below three mean spacings of the points of"
        remedy = "use more points or a larger alpha"
        errors.warn(f"{few} {errors.counted(sparse, 'design')} and {whose} too small; {remedy}")


def _run(
    atlas: AtlasStore, indices: list[int], executor: ExecutorLike, progress: Progress | None
) -> None:
    failures: dict[int, str] = {}
    lock = Lock()
    with bar("computing designs", len(indices)) as shown:

        def on_outcome(outcome: tuple[int, str]) -> None:
            with lock:
                failures.update([outcome] if outcome[1] else [])
                (progress or shown)(1)

        run_designs(atlas, indices, executor, on_outcome)
    if failures:
        index, message = next(iter(failures.items()))
        failed = f"{errors.counted(len(failures), 'design')} failed"
        errors.warn(f"{failed}, first number {index}: {message}")
