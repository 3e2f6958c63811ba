"""What the tip reaches from the stable parts of cells that are left out of an image."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import TipMap
from softreach.workspace.image import Image
from softreach.workspace.tears import corner_values

__all__ = ["Remainder", "remainder"]

Array = NDArray[np.float64]

_INSIDE = np.stack(np.meshgrid(*[[0.25, 0.75]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_MOST = 20_000  # cells looked into
_TAKEN = 1.5


class Remainder(NamedTuple):
    """What cells that are left out still reach."""

    volume: float
    """Outside the image [m³], right to a half of itself."""
    tips: Array
    """Some of the tips [m], shape (n, 3)."""


def remainder(
    rod: TipMap, image: Image, stretches: Array, left_out: NDArray[np.bool_]
) -> Remainder:
    """What cells with a stable corner reach although they are left out, by eight places in each.

    A place counts with the |det J| of the cell's corners, the median of those that are stable, if
    it is stable and its tip lies outside the image. Where stability is lost at a fold, det J grows
    like 1/√x toward it and twice as much is swept as this tells: one and a half times is taken,
    which is right to a third of itself, and a half is stated as the error.

    Args:
        rod: The tip map, with three free bundles.
        image: Of the other cells.
        stretches: det J at the vertices of the grid, 0 where there is no stable equilibrium.
        left_out: Which cells are left out, shape (cells, cells, cells).
    """
    cells = left_out.shape[0]
    corners = corner_values(np.abs(stretches).reshape((cells + 1,) * 3)).reshape(-1, 8)
    cut = np.flatnonzero(left_out.ravel() & corners.any(axis=1))
    looked = cut
    if len(cut) > _MOST:
        looked = np.sort(np.random.default_rng(0).choice(cut, _MOST, replace=False))
    places = np.stack(np.unravel_index(looked, left_out.shape), axis=1)[:, None] + _INSIDE
    tips = stable_tips(rod).tips(rod.box.from_free_cube(places.reshape(-1, 3) / cells))
    stable = np.isfinite(tips[:, 0])
    counted = stable.copy()
    counted[stable] = image.counts_at(tips[stable]) == 0
    values = corners[looked]
    stretch = np.nanmedian(np.where(values > 0.0, values, np.nan), axis=1) if len(looked) else 0.0
    swept = float((stretch * counted.reshape(-1, 8).mean(axis=1)).sum())
    each = rod.box.volume / cells**3 * len(cut) / max(len(looked), 1)
    return Remainder(_TAKEN * swept * each, tips[stable])
