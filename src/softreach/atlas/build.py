"""Building an atlas: every design of a space, stored as it comes, resumed where it stopped."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from threading import Lock
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.executor import DaskClient, ExecutorLike, run_designs
from softreach.atlas.metric import Metric
from softreach.atlas.metrics import METRIC_GROUPS, chosen_metrics
from softreach.atlas.reading import a_store, contents, open_atlas, over_length
from softreach.atlas.space import DesignSpace
from softreach.atlas.store import DONE, GAP, UNSTABLE, AtlasStore
from softreach.rod.tip_map import check_tol
from softreach.sampling import check_sampler
from softreach.support.arguments import (
    POSITIVE,
    as_flag,
    as_function,
    as_given,
    as_instance,
    as_number,
    plain,
)
from softreach.support.errors import InvalidInput, counted, warn
from softreach.support.memory import check_memory
from softreach.support.progress import Progress, bar
from softreach.workspace.reach import ACCURACIES

if TYPE_CHECKING:
    import xarray as xr
    from zarr.storage import StoreLike


_EXECUTORS = "a concurrent.futures executor, or a Dask client"
_SAMPLE_MEMORY = 700  # bytes of memory of a sample and its share of the triangulation


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
    durable: bool = False,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Compute the cloud and the metrics of every design (sections 3 and 4), or what is missing.

    All designs share one set of unit activations, scaled to each one's bounds. Every design is
    stored when it is done: after an interruption, even by kill -9, the same call continues and ends
    with the same numbers. What is stored is verified first: damaged designs are computed again. A
    design that fails is recorded with its error, the rest goes on, and the
    next call tries it again. Combinations that no arm can have stay gaps.

    Under loads, only samples with a stable equilibrium count, and `lost_share` tells the share of
    the others. A design of which no sample is stable has no other metric: the rest is NaN, with a
    message, and it is not tried again.

    Stored clouds are rounded to 1e-5 of the shortest length, an error of half of that at most in
    each coordinate, which halves their size; metrics are computed before.

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
        shard: (i, k) computes every k-th design from the i-th on, i from 0: k processes share a
            store without knowing of each other.
        durable: Whether a design counts as done only when not even a power cut can lose it.
            Without, it can damage designs of the last seconds, which the next call notices.
        progress: Called with the number of designs done since its last call; by default a bar is
            shown on a terminal.

    Returns:
        The atlas as `open_atlas` has it.

    Raises:
        InvalidInput: An argument out of range, no valid design, or a store that another command
            began; the message says what differs.
        DamagedStore: The root of the store is damaged, and another command began it.
        StoreFailed: The store cannot be written, for instance because the disk is full.
        SoftreachError: A worker died and broke its executor; the same call with a new one
            continues.

    Warns:
        SoftreachWarning: There are gaps, failed or damaged designs, or designs whose points are too
            sparse for the radius.
    """
    as_instance("space", space, DesignSpace, "a DesignSpace")
    store, (first, count) = a_store("store", store), _shard_of("shard", shard)
    durable = as_flag("durable", durable)
    as_instance("executor", executor, (type(None), Executor, DaskClient), _EXECUTORS)
    progress = None if progress is None else as_function("progress", progress)
    check_sampler(sampler, n, 0, seed)
    check_memory("n", n, _SAMPLE_MEMORY * n)
    command = Command(
        space=space,
        n=n,
        seed=seed,
        sampler=sampler,
        tol=check_tol(tol),
        alpha_over_length=as_number("alpha_over_length", alpha_over_length, POSITIVE),
        accuracy=as_number("accuracy", accuracy, ACCURACIES),
        metrics=chosen_metrics(metrics),
        keep_clouds=as_flag("keep_clouds", keep_clouds),
    )
    if space.gaps:
        _warn_of_gaps(space)
    atlas, numbers = (
        AtlasStore.begin(store, command, durable=durable),
        range(first, space.size, count),
    )
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
    raise InvalidInput(name, shown, "(i, k), or i/k on the command line, with 0 <= i < k")


def _warn_of_gaps(space: DesignSpace) -> None:
    index, reason = next(iter(space.gaps.items()))
    stay = "stays a gap" if len(space.gaps) == 1 else "stay gaps"
    lost = f"{len(space.gaps)} of {space.size} designs cannot exist and {stay}"
    warn(f"{lost}, first {space.values(index)}: {reason}")


def _warn_of_metrics(built: xr.Dataset) -> None:
    if len(unstable := np.flatnonzero(built["status"].values == UNSTABLE)):
        first = built[["number", "message"]].stack(all=built["status"].dims, create_index=False)
        first = first.isel(all=unstable[0])
        without = f"{counted(len(unstable), 'design')} without metrics"
        warn(f"{without}, first number {first['number'].item()}: {first['message'].item()}")
    radius = built.volume.attrs["alpha_over_length"] if "spacing" in built else 0.0
    if radius and (sparse := int((radius < 3.0 * over_length(built, "spacing")).sum())):
        whose = "its volume is" if sparse == 1 else "their volumes are"
        warn(
            f"alpha = {radius:.4g} L is below three mean spacings of the points of "
            f"{counted(sparse, 'design')} and {whose} too small; use more points or a larger alpha"
        )


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
        warn(f"{counted(len(failures), 'design')} failed, first number {index}: {message}")
