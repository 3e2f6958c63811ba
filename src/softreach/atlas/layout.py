"""The arrays of an atlas store: names, dimensions, types, chunks and units."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softreach.atlas.command import Command
from softreach.atlas.metric import Metric
from softreach.schema import AXES

RESOLUTION = 1e-5
"""Step of stored tips over the shortest length: no coordinate is off by more than half of it."""

CUBE = "unit_activation"  # The array of activations that all designs share

PER_DESIGN = ("status", "message", "curvature", "tip", "metrics")
"""The arrays whose chunks are designs."""

MISSING = int(np.iinfo(np.int32).min)  # Number in place of a tip that is NaN, or not stored


@dataclass(frozen=True, eq=False)
class Plan:
    """An array to create."""

    name: str
    shape: tuple[int, ...]
    dims: tuple[str, ...]
    dtype: Any
    chunks: tuple[int, ...]
    fill: Any
    attrs: dict[str, Any]
    data: Any = None
    """Values to write at once; None for those that designs bring, and for activations."""

    def compressors(self) -> Any:
        """Codecs of the Zarr v3 core, which every reader has; a checksum comes last."""
        from zarr.codecs import BloscCodec, Crc32cCodec

        large = self.name == "tip"  # activations are random bits, and the same bytes anywhere
        blosc = BloscCodec(cname="zstd", clevel=5, shuffle="bitshuffle")
        return (blosc, Crc32cCodec()) if large else (Crc32cCodec(),)


def array_plans(command: Command) -> Iterator[Plan]:
    """Every array of an atlas."""
    space, sizes = command.space, command.profile_sizes
    varied = space.varied()
    for name, values in space.parameters:
        parameter = varied[name]
        about: dict[str, Any] = {"units": parameter.unit, "long_name": parameter.meaning}
        about |= {"symbol": parameter.symbol, "part": parameter.owner}
        dims = (name,) if space.layout == "grid" else ("design",)
        yield _shared(name, np.array(values), dims, about)
    yield _labels("metric", [metric.name for metric in command.numbers])
    yield _labels("axis", list(AXES))
    shape = (command.n, space.bundles)
    cube = _shared(CUBE, np.broadcast_to(0.0, shape), ("sample", "bundle"), _CUBE)
    yield replace(cube, data=None)
    yield _per_design(command, "status", np.uint8, 0, STATUS)
    yield _per_design(command, "message", str, "", MESSAGE)
    if profiles := command.profiles:
        yield _labels("quantity", [metric.name for metric in profiles])
        yield _shared("station", np.array(command.stations), ("station",), _STATION)
        yield _shared("quantile", np.array(command.quantiles), ("quantile",), {"units": "1"})
        about = {"long_name": "metrics over stations and quantiles", "metrics": _meanings(profiles)}
        sizes = {"quantity": len(profiles), **sizes}
        yield _per_design(command, "curvature", np.float64, np.nan, about, **sizes)
    if command.keep_clouds:  # as fixed-point numbers: half the size, and the same error everywhere
        step = RESOLUTION * space.length_range[0]
        about = {"units": "m", "long_name": "tip position", "scale_factor": step}
        about["_FillValue"] = MISSING
        sizes = {"axis": len(AXES), "sample": command.n}
        yield _per_design(command, "tip", np.int32, MISSING, about, **sizes)
    about = {"long_name": "metrics of the designs", "metrics": _meanings(command.numbers)}
    about["alpha_over_length"] = command.alpha_over_length
    sizes = {"metric": len(command.numbers)}
    yield _per_design(command, "metrics", np.float64, np.nan, about, **sizes)


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


def _meanings(metrics: Sequence[Metric]) -> str:
    return "; ".join(f"{metric.name} [{metric.unit}]: {metric.meaning}" for metric in metrics)


def _per_design(
    command: Command, name: str, dtype: Any, fill: Any, attrs: dict[str, Any], **sizes: int
) -> Plan:
    space = command.space
    shape, dims = (*space.shape, *sizes.values()), (*space.dims, *sizes)
    chunks = (*(1 for _ in space.shape), *(max(size, 1) for size in sizes.values()))
    return Plan(name, shape, dims, dtype, chunks, fill, attrs)


def _shared(name: str, data: np.ndarray, dims: tuple[str, ...], attrs: dict[str, Any]) -> Plan:
    chunks = (min(data.shape[0], 1 << 20), *data.shape[1:])
    fill = 0 if data.dtype.kind in "iu" else np.nan
    return Plan(name, data.shape, dims, data.dtype, chunks, fill, attrs, data)


def _labels(name: str, labels: list[str]) -> Plan:
    data, count = np.array(labels, dtype=np.dtypes.StringDType()), len(labels)
    return Plan(name, (count,), (name,), str, (max(count, 1),), "", {}, data)
