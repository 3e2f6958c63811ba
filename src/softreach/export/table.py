"""A cloud as a table: x, y, z and one activation column per bundle, with what describes it."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import chain, count
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["CloudTable", "cloud_table", "column_names"]

Array = NDArray[np.float64]

_BLOCK = 1 << 18


class CloudTable(NamedTuple):
    """Tips and activations as plain arrays."""

    tip: Array
    """[m], shape (sample, 3)."""
    activation: Array
    """γ, shape (sample, bundle)."""
    bundles: tuple[str, ...]
    """Names of the bundles as the cloud has them."""
    units: tuple[str, ...]
    """Unit of the activation of each bundle."""
    status: NDArray[np.uint8] | None
    """0 stable, 1 unstable, 2 no equilibrium, of an arm under loads, shape (sample,)."""
    metadata: dict[str, str | int | float]
    """Design (TOML), seed, tolerance, versions and units."""

    @property
    def gammas(self) -> list[str]:
        """Names of the activation columns."""
        return column_names(self.bundles)

    def columns(self, rows: slice = slice(None)) -> dict[str, NDArray[Any]]:
        """Contiguous columns by name: x, y, z, the activations, and the status if there is one."""
        arrays = [*self.tip[rows].T, *self.activation[rows].T]
        names = ["x", "y", "z", *self.gammas]
        if self.status is not None:
            arrays.append(self.status[rows])
            names.append("status")
        return {name: np.ascontiguousarray(a) for name, a in zip(names, arrays, strict=True)}

    def blocks(self) -> Iterator[dict[str, NDArray[Any]]]:
        """The columns, a bounded number of rows at a time."""
        for start in range(0, len(self.tip), _BLOCK) or [0]:
            yield self.columns(slice(start, start + _BLOCK))


def cloud_table(cloud: xr.Dataset) -> CloudTable:
    """The arrays and the description of a cloud.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle), each in its unit.

    Raises:
        InvalidInput: The dataset is not a cloud.
    """
    missing = {"tip", "activation"} - set(map(str, cloud.data_vars))
    if missing:
        found = ", ".join(map(str, cloud.data_vars)) or "nothing"
        raise InvalidInput("cloud", found, "a dataset with tip and activation")
    tip, activation = cloud["tip"], cloud["activation"]
    return CloudTable(
        tip.transpose("sample", "axis").values.astype(float, copy=False),
        activation.transpose("sample", "bundle").values.astype(float, copy=False),
        _bundle_names(activation),
        _bundle_units(activation),
        cloud["status"].values.astype(np.uint8) if "status" in cloud else None,
        _metadata(cloud),
    )


def column_names(bundles: Sequence[str]) -> list[str]:
    """Column names that every format and language can hold, all different.

    >>> column_names(["left", "fiber 1 2", "left"])
    ['gamma_left', 'gamma_fiber_1_2', 'gamma_left_2']
    """
    names: list[str] = []
    for k, bundle in enumerate(bundles):
        safe = re.sub(r"[^0-9A-Za-z]+", "_", bundle).strip("_") or str(k + 1)
        plain = f"gamma_{safe}"
        numbered = (f"{plain}_{number}" for number in count(k))
        names.append(next(name for name in chain([plain], numbered) if name not in names))
    return names


def _bundle_names(activation: xr.DataArray) -> tuple[str, ...]:
    if "bundle" in activation.coords:
        return tuple(map(str, activation["bundle"].values))
    return tuple(str(k + 1) for k in range(activation.sizes["bundle"]))


def _bundle_units(activation: xr.DataArray) -> tuple[str, ...]:
    if "unit" in activation.coords:
        return tuple(map(str, activation["unit"].values))
    return (activation.attrs.get("units", "1"),) * activation.sizes["bundle"]


def _metadata(cloud: xr.Dataset) -> dict[str, str | int | float]:
    each = _bundle_units(cloud["activation"])
    units = {
        "tip_units": cloud["tip"].attrs.get("units", "m"),
        "activation_units": ", ".join(each if len(set(each)) > 1 else each[:1]),
    }
    length = cloud["tip"].attrs.get("length")
    known = cloud.attrs | units | ({} if length is None else {"length_m": length})
    return {str(key): _plain(value) for key, value in known.items()}


def _plain(value: Any) -> str | int | float:
    value = value.item() if isinstance(value, np.generic) else value
    return value if isinstance(value, str | int | float) else str(value)
