"""Reachability clouds: sampled activations, their tips, and how both were made (section 3)."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from contextlib import AbstractContextManager, nullcontext
from functools import partial
from os import PathLike
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach import schema
from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import all_inputs, as_tip_map, with_unstable
from softreach.rod.tip_map import Device, Frame, TipMap, TipOutputs
from softreach.sampling import check_sampler, cube_blocks
from softreach.support import parallel
from softreach.support.arguments import as_dataset, as_flag, as_function, as_path
from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import place_to_read, replacing_folder
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.stores import (
    ARRAYS,
    DIGEST,
    READING,
    ROOT,
    foreign_entry,
    opened_store,
    seal,
    storage_errors,
)
from softreach.support.memory import check_memory
from softreach.support.progress import Progress, bar

if TYPE_CHECKING:
    import xarray as xr

    from softreach.rod.clearance import ClearanceMap

_CHUNK = 1 << 19  # samples of a stored array that are held at once
_LONG = 5_000_000  # samples from which a bar is worth showing


def compute_cloud(
    arm: Manipulator | TipMap,
    n: int = 400_000,
    *,
    seed: int = 0,
    sampler: str = "uniform",
    tol: float = 1e-6,
    frame: Frame = "world",
    point: str | None = None,
    device: Device = "cpu",
    clearance: bool = False,
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
        frame: Frame of the tips: that of the "world", or of the "base", whose z is along the
            straight arm. The attributes hold it, and the pose of the base.
        point: Name of the marker that counts as the tip, such as that of a tool; by default that
            of the design. Of a tip map its own counts.
        device: What computes tips: "cpu", or "cuda" for a GPU, of arms without loads.
        clearance: Whether to add the clearance of the whole arm, see `rod.compute_clearance`: what
            is left by `cloud.isel(sample=cloud.clearance > 0)` touches nothing.
        progress: Called with the number of samples done since its last call; by default a bar is
            shown on a terminal when the cloud is large.

    Returns:
        Dataset with `tip` (sample, axis) [m] and `activation` (sample, bundle) [its unit]; its
        attributes hold the design, seed, sampler, tol and versions. For an arm under loads also
        the coordinate `status` (sample), a `TipStatus`; a tip without equilibrium is NaN. With
        `clearance`, `clearance` [m], `obstacle` and `station` [m] (sample) of where it is least.

    Raises:
        InvalidInput: An argument out of range, or more samples than fit into memory; the message
            says what to use instead.
        MissingExtra: `softreach[cuda]` is not installed.
        NotPossible: There is no GPU, no driver for it, or the arm has loads; with `clearance`, the
            base of the arm lies inside an obstacle, or a mesh cannot be used.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=1000)
        >>> cloud.tip.shape, cloud.activation.shape
        ((1000, 3), (1000, 3))
    """
    report = None if progress is None else as_function("progress", progress)
    whole = all_inputs(as_tip_map(arm, tol, frame=frame, point=point, device=device))
    tip_map = with_unstable(whole)
    bundles = tip_map.box.bundles
    clearance = as_flag("clearance", clearance)
    n, seed = check_sampler(sampler, n, bundles, seed)
    check_memory("n", n, 8 * (bundles + 3 + 4 * clearance) * n)
    room = _room(whole.arm, tol) if clearance else None
    activation, tip = np.empty((n, bundles)), np.empty((n, 3))
    status = np.empty(n, np.int8) if tip_map.supports_unstable else None
    show_bar = report is None and n > _LONG
    tip_map.prepare()

    def fill(rows: slice, progress: Progress | None) -> None:
        kept = None if status is None else status[rows]
        tip_map.fill(activation[rows], TipOutputs(tip[rows], status=kept))
        if progress:
            progress(rows.stop - rows.start)

    def tasks(progress: Progress | None) -> Iterator[Callable[[], object]]:
        cubes = cube_blocks(sampler, n, bundles, seed, tip_map.block)
        for rows, cube in zip(parallel.blocks(n, tip_map.block), cubes, strict=True):
            tip_map.box.from_cube(cube, out=activation[rows])
            yield partial(fill, rows, progress)

    with bar("computing tips", n) if show_bar else nullcontext(report) as shown:
        parallel.run(tasks(shown))
    made = {"seed": seed, "sampler": sampler, "tol": tip_map.tol, "frame": tip_map.frame}
    cloud = schema.cloud_dataset(tip_map.arm, activation, tip, **made, device=tip_map.device)
    if room is not None:
        cloud = cloud.assign(room.variables(room.of(activation)))
    return cloud if status is None else schema.with_status(cloud, status)


def _room(arm: Manipulator, tol: float) -> ClearanceMap:
    from softreach.rod.clearance import ClearanceMap

    room = ClearanceMap(all_inputs(as_tip_map(arm, tol)))
    room.warn_at_rest()
    return room


def save_cloud(cloud: xr.Dataset, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write a cloud as a Zarr v3 store; it appears whole or not at all.

    Every file carries a checksum, so that `open_cloud` notices damage.

    Args:
        cloud: From `compute_cloud`, or a part of its samples.
        path: The folder to write.
        overwrite: Whether it may replace a file or a store of softreach; a folder with anything in
            it that softreach did not write is never replaced.

    Raises:
        InvalidInput: The dataset is no cloud, its design, bundles and length do not agree, or
            something else is there.
        NotWritten: It cannot be written.

    Examples:
        >>> cloud = sr.compute_cloud(sr.designs.minimal_trunk(), n=1000)
        >>> sr.save_cloud(cloud, "trunk.zarr")
        >>> sr.open_cloud("trunk.zarr").tip.equals(cloud.tip)
        True
    """
    place, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    schema.check_stored_cloud(cloud)
    from zarr.codecs import Crc32cCodec, ZstdCodec

    stored, chunk = schema.storable(cloud), min(cloud.sizes["sample"], _CHUNK)
    # A checksum for each chunk, also for those of NaN alone.
    encoding: dict[Hashable, Any] = {
        name: {"compressors": (ZstdCodec(level=0), Crc32cCodec())} for name in stored.variables
    }
    for name in ("tip", "activation"):
        encoding[name]["chunks"] = (chunk, stored[name].shape[1])
    options = {"zarr_format": 3, "consolidated": False, "write_empty_chunks": True}
    made = replacing_folder(place, foreign_entry, overwrite=overwrite)
    with made as folder, _few_chunks_at_a_time():
        stored.to_zarr(folder, mode="w", encoding=encoding, **options)
        seal(folder)


def open_cloud(path: str | PathLike[str]) -> xr.Dataset:
    """Read a cloud that `save_cloud` wrote.

    Raises:
        InvalidInput: There is no such store, or it holds something else.
        DamagedStore: It is not what was written; which array and chunk, and what to do.
        StoreFailed: It cannot be read, or was replaced meanwhile.
    """
    import xarray as xr

    location = place_to_read(as_path("path", path))
    opened = opened_store(location, "cloud")
    if opened is None or "command" in opened.group.attrs:
        hint = f"it does not exist, or has no {ROOT}" if opened is None else "this is an atlas"
        raise InvalidInput("cloud", location, "a Zarr store written by softreach", hint)
    opened.required = lambda _: True
    with _few_chunks_at_a_time(), storage_errors(f"{location} cannot be read"):
        try:
            opened.check_arrays()
            with opened.noting(raising=True), xr.open_zarr(opened.place, **READING) as stored:
                cloud = schema.stored_names(stored.load())
        finally:
            opened.check_root()
        for name in (ARRAYS, DIGEST):
            del cloud.attrs[name]
        return schema.check_stored_cloud(cloud)


def design_of(cloud: xr.Dataset) -> Manipulator:
    """The design that a cloud or configuration was computed from."""
    cloud = as_dataset("cloud", cloud)
    return Manipulator.from_toml(cloud.attrs["design"], source="the cloud's design")


def tip_map_of(cloud: xr.Dataset) -> TipMap:
    """The tip map that a cloud was computed with."""
    arm = design_of(cloud)
    return as_tip_map(arm, float(cloud.attrs["tol"]), frame=schema.frame_of(cloud))


CLOUD_STORE: Formats = {".zarr": FileFormat(foreign=foreign_entry)}  # format of a stored cloud


def _few_chunks_at_a_time() -> AbstractContextManager[object]:
    """Zarr holds three copies of each chunk in flight, and has ten in flight by default."""
    import zarr

    return zarr.config.set({"async.concurrency": min(4, parallel.thread_count())})
