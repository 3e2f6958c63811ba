"""The best designs of an atlas under constraints."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arguments import checked, flag, mapping_of, optional, text, whole
from softreach.atlas.arguments import an_atlas, an_interval
from softreach.atlas.reading import opened_atlas
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

    from softreach.atlas.reading import AtlasLike

__all__ = ["Interval", "best_designs"]

Interval = tuple[float | None, float | None]


@checked(
    atlas=an_atlas,
    metric=text,
    smallest=flag,
    where=optional(mapping_of(an_interval)),
    count=whole(1),
)
def best_designs(
    atlas: AtlasLike,
    metric: str,
    *,
    smallest: bool = False,
    where: Mapping[str, Interval] | None = None,
    count: int = 1,
) -> xr.Dataset:
    """The designs with the largest or smallest metric among those that meet the constraints.

    Args:
        atlas: A store, or a dataset from `open_atlas`.
        metric: What to compare.
        smallest: Whether smaller values are better.
        where: Metric or parameter -> (lowest, highest) allowed; None leaves an end open.
        count: How many designs at most.

    Returns:
        All metrics and parameters over `rank`, the best first; empty if no design qualifies.

    Raises:
        InvalidInput: No such metric or parameter, or an argument of another kind.
    """
    opened = opened_atlas(atlas)
    dims = opened["status"].dims
    numbers = [name for name in opened.data_vars if opened[name].dims == dims]
    _check_known(metric, [str(name) for name in numbers if opened[name].dtype.kind == "f"])
    stacked = opened[[*numbers, *_parameters(opened)]].stack(rank=dims, create_index=False)
    allowed = np.isfinite(stacked[metric].values)
    limits: Any = where or {}  # open ends are infinite by now
    for name, (low, high) in limits.items():
        _check_known(name, [str(known) for known in stacked.variables])
        values = stacked[name].values
        allowed &= (values >= low) & (values <= high)
    order = np.argsort(stacked[metric].values * (1 if smallest else -1), kind="stable")
    return stacked.isel(rank=order[allowed[order]][:count])


def _parameters(atlas: xr.Dataset) -> list[str]:
    """Coordinates that only the designs' own dimensions have."""
    dims = set(atlas["status"].dims)
    return [str(n) for n, c in atlas.variables.items() if len(c.dims) == 1 and set(c.dims) <= dims]


def _check_known(name: str, known: list[str]) -> None:
    if name not in known:
        raise InvalidInput("metric", name, f"one of {', '.join(dict.fromkeys(known))}")
