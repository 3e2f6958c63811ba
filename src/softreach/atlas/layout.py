"""The arrays of an atlas store: names, dimensions, types, chunks and units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.metric import Metric
from softreach.schema import AXES
from softreach.support.files.stores import sha256

RESOLUTION = 1e-5
"""Step of stored tips over the shortest length: no coordinate is off by more than half of it."""

CUBE = "unit_activation"  # The array of activations that all designs share

PER_DESIGN = ("status", "message", "curvature", "tip", "metrics")
"""The arrays whose chunks are designs."""

OF = "command_sha256"  # Attribute of each array: digest of the command

MISSING = int(np.iinfo(np.int32).min)  # Number in place of a tip that is NaN, or not stored

_CHUNK = 1 << 20  # numbers of a chunk that all designs share
_CUBE = {
    "units": "1",
    "long_name": "place in the activation box of each design: 0 is its lower bound, 1 its upper",
}
_STATION = {"units": "1", "long_name": "station Z before activation, over the design's length"}
STATUS = {
    "long_name": "status of the design",
    "flag_values": [0, 1, 2, 3, 4, 5],
    "flag_meanings": "to_do done failed gap unstable damaged",
}
MESSAGE = {"long_name": "why a design has no numbers"}


class Plan(NamedTuple):
    """An array to create."""

    name: str
    options: dict[str, Any]  # As Zarr's `create_array` has them
    data: Any  # Values to write at once; None for those that designs bring, and for activations


def array_plans(command: Command) -> Iterator[Plan]:
    """Every array of an atlas."""
    space, numbers, profiles = command.space, command.numbers, command.profiles
    plan, varied = partial(_plan, command), space.varied()
    designs = dict(zip(space.dims, space.shape, strict=True))
    for name, entries in space.parameters:
        parameter, values = varied[name], np.array(entries)
        about: dict[str, Any] = {"units": parameter.unit, "long_name": parameter.meaning}
        about |= {"symbol": parameter.symbol, "part": parameter.owner}
        dim = name if space.layout == "grid" else "design"
        fill = 0 if values.dtype == int else np.nan
        yield plan(name, values.dtype, {dim: len(values)}, about, fill, values)
    yield _labels(command, "metric", [metric.name for metric in numbers])
    yield _labels(command, "axis", AXES)
    yield plan(CUBE, float, {"sample": command.n, "bundle": space.bundles}, _CUBE)
    yield plan("status", np.uint8, designs, STATUS, 0)
    yield plan("message", str, designs, MESSAGE, "")
    if profiles:
        yield _labels(command, "quantity", [metric.name for metric in profiles])
        for name, values in (("station", command.stations), ("quantile", command.quantiles)):
            about = _STATION if name == "station" else {"units": "1"}
            yield plan(name, float, {name: len(values)}, about, data=np.array(values))
        about = {"long_name": "metrics over stations and quantiles", "metrics": _meanings(profiles)}
        sizes = designs | {"quantity": len(profiles)} | command.profile_sizes
        yield plan("curvature", float, sizes, about)
    if command.keep_clouds:  # as fixed-point numbers: half the size, and the same error everywhere
        step = RESOLUTION * space.length_range[0]
        about = {"units": "m", "long_name": "tip position", "scale_factor": step}
        about["_FillValue"] = MISSING
        sizes = designs | {"axis": len(AXES), "sample": command.n}
        yield plan("tip", np.int32, sizes, about, MISSING)
    about = {"long_name": "metrics of the designs", "metrics": _meanings(numbers)}
    about["alpha_over_length"] = command.alpha_over_length
    yield plan("metrics", float, designs | {"metric": len(numbers)}, about)


def _plan(
    command: Command,
    name: str,
    dtype: Any,
    sizes: dict[str, int],
    attrs: dict[str, Any],
    fill: Any = np.nan,
    data: Any = None,
) -> Plan:
    """With codecs of the Zarr v3 core, which every reader has; a checksum comes last."""
    from zarr.codecs import BloscCodec, Crc32cCodec

    if name in PER_DESIGN:
        chunks = [1 if dim in command.space.dims else size for dim, size in sizes.items()]
    else:
        chunks = [min(size, _CHUNK) for size in sizes.values()]
    options = {
        "shape": tuple(sizes.values()),
        "dtype": dtype,
        "chunks": tuple(max(size, 1) for size in chunks),
        "fill_value": fill,
        "compressors": (Crc32cCodec(),),
        "dimension_names": tuple(sizes),
        "attributes": attrs | {OF: sha256(command.to_json().encode())},
    }
    if name == "tip":  # activations are random bits, and the same bytes anywhere
        blosc = BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle")
        options["compressors"] = blosc, Crc32cCodec()
    return Plan(name, options, data)


def _meanings(metrics: Sequence[Metric]) -> str:
    return "; ".join(f"{metric.name} [{metric.unit}]: {metric.meaning}" for metric in metrics)


def _labels(command: Command, name: str, labels: Sequence[str]) -> Plan:
    data = np.array(labels, dtype=np.dtypes.StringDType())
    return _plan(command, name, str, {name: len(data)}, {}, "", data)
