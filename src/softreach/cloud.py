"""Reachability clouds: sampled activations, their tips, and how both were made (section 3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach import parallel, schema
from softreach.arguments import checked, dataset, function, optional, path
from softreach.arm.manipulator import Manipulator
from softreach.atomic import replacing
from softreach.errors import InvalidInput
from softreach.progress import Progress, bar, silent
from softreach.rod.free_bundles import FreeBundles
from softreach.rod.measured_bundles import MeasuredBundles
from softreach.rod.stable_tips import StableTips
from softreach.rod.tip_map import BLOCK, TipMap, tip_map
from softreach.sampling import check_sampler, cube_blocks
from softreach.schema import a_cloud

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["compute_cloud", "design_of", "open_cloud", "save_cloud", "tip_map_of"]

Array = NDArray[np.float64]


@checked(progress=optional(function))
def compute_cloud(
    arm: Manipulator | TipMap,
    n: int = 400_000,
    seed: int = 0,
    sampler: str = "uniform",
    *,
    tol: float = 1e-6,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Sample the activation box and compute the tip of each sample (section 3).

    The result depends on the design, n, seed, sampler and tol alone: not on threads or blocks.
    Memory is the result's own, (3 + bundles) 8 bytes a sample, and a few blocks.

    Args:
        arm: The design, or its tip map; of one restricted to some bundles or in other measures,
            the whole.
        n: Number of samples.
        seed: Seed of the sampler.
        sampler: `uniform` (the paper's), `boundary`, `sobol` or `grid`; see `sampling.sample_cube`.
        tol: Largest tip error, in L.
        progress: Called with the number of samples done since its last call; by default a bar is
            shown on a terminal when the cloud is large.

    Returns:
        Dataset with `tip` (sample, axis) [m] and `activation` (sample, bundle) [its unit]; its
        attributes hold the design, seed, sampler, tol and versions. For an arm under loads also
        the coordinate `status` (sample), a `TipStatus`; a tip without equilibrium is NaN.

    Raises:
        InvalidInput: An argument out of range; the message says what to use instead.
    """
    rod = _of_all_bundles(tip_map(arm, tol))
    if rod.supports_unstable:
        rod.tips(rod.box.low[None])  # what all samples need, once and not on every thread
    bundles = rod.box.bundles
    check_sampler(sampler, n, bundles, seed)
    activation, tip = np.empty((n, bundles)), np.empty((n, 3))
    status = np.empty(n if rod.supports_unstable else 0, np.int8)
    with _shown(progress, n) as shown:
        _fill(rod, activation, tip, status, sampler, seed, shown)
    cloud = schema.cloud_dataset(
        rod.arm, activation, tip, seed=int(seed), sampler=sampler, tol=rod.tol
    )
    return schema.with_status(cloud, status) if rod.supports_unstable else cloud


@checked(cloud=a_cloud, path=path)
def save_cloud(cloud: xr.Dataset, path: str | PathLike[str]) -> None:
    """Write a cloud as a Zarr v3 store; it appears whole, in place of an older one, or not at all.

    Raises:
        InvalidInput: The dataset is no cloud.
    """
    schema.check_cloud(cloud)
    chunk = min(cloud.sizes["sample"], _CHUNK)
    encoding = {name: {"chunks": (chunk, cloud[name].shape[1])} for name in ("tip", "activation")}
    with replacing(path) as partial_path, _few_chunks_at_a_time():
        schema.storable(cloud).to_zarr(
            partial_path, mode="w", zarr_format=3, consolidated=False, encoding=encoding
        )


@checked(path=path)
def open_cloud(path: str | PathLike[str]) -> xr.Dataset:
    """Read a cloud that `save_cloud` wrote.

    Raises:
        InvalidInput: There is no such store, or it holds something else.
    """
    import xarray as xr

    if not (Path(path) / "zarr.json").is_file():
        raise InvalidInput("cloud", fspath(path), "a Zarr store written by softreach")
    with (
        _few_chunks_at_a_time(),
        xr.open_zarr(path, consolidated=False, zarr_format=3, chunks=None) as stored,
    ):
        return schema.check_cloud(stored.load())


def _few_chunks_at_a_time() -> AbstractContextManager[object]:
    """Zarr holds three copies of each chunk in flight, and has ten in flight by default."""
    import zarr

    return zarr.config.set({"async.concurrency": min(4, parallel.thread_count())})


@checked(cloud=dataset())
def design_of(cloud: xr.Dataset) -> Manipulator:
    """The design that a cloud or configuration was computed from."""
    return Manipulator.from_toml(cloud.attrs["design"], source="the cloud's design")


@checked(cloud=dataset())
def tip_map_of(cloud: xr.Dataset) -> TipMap:
    """The tip map that a cloud was computed with."""
    return tip_map(design_of(cloud), float(cloud.attrs["tol"]))


def _of_all_bundles(rod: TipMap) -> TipMap:
    """The map of every bundle, in its own unit, of which this one may be a restriction."""
    while isinstance(rod, FreeBundles | MeasuredBundles | StableTips):
        rod = rod.whole
    return rod


_CHUNK = 1 << 19  # samples of a stored array that are held at once
_LONG = 5_000_000  # samples from which a bar is worth showing


def _fill(
    rod: TipMap,
    activation: Array,
    tip: Array,
    status: NDArray[np.int8],
    sampler: str,
    seed: int,
    progress: Progress,
) -> None:
    """Draw activations block by block and let the threads turn them into tips meanwhile."""

    def tasks() -> Iterator[Callable[[], object]]:
        first = 0
        for cube in cube_blocks(sampler, len(tip), rod.box.bundles, seed, BLOCK):
            block = slice(first, first := first + len(cube))
            rod.box.from_cube(cube, out=activation[block])
            task = rod.tip_task(activation[block], tip[block])
            if len(status):
                asked = activation[block], tip[block], status[block]
                task = partial(rod.fill_tips_and_status, *asked)
            yield partial(_reported, task, progress, len(cube))

    parallel.run(tasks())


def _reported(task: Callable[[], object], progress: Progress, count: int) -> None:
    task()
    progress(count)


def _shown(progress: Progress | None, n: int) -> AbstractContextManager[Progress]:
    """The caller's callback, or a bar if the cloud is large enough to wait for."""
    if progress is None and n > _LONG:
        return bar("computing tips", n)
    return nullcontext(progress or silent)
