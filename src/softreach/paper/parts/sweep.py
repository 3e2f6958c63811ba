"""Sections 3 and 4: the atlas of designs, its clouds and its volumes (figures 2a to 3c)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.designs import minimal_trunk
from softreach.atlas import DesignSpace, build_atlas, open_atlas
from softreach.errors import InvalidInput
from softreach.paper.atlas_figures import atlas_figures
from softreach.paper.notebook import Notebook
from softreach.paper.parts.shape import ASIDE, shapes
from softreach.paper.settings import Settings

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["sweep", "swept_atlas"]

_STORE = "atlas.zarr"
_SCALARS = (
    "volume",
    "unreachability",
    "convex_volume",
    "exact_volume",
    "exact_unreachability",
    "multiple_volume",
    "fold_volume",
)
_CAPTIONS = {
    "clouds": ("2a", "Reachability clouds, colored by the activations of the three bundles."),
    "corners": ("2b", "The corners of the atlas from two opposing sides, the arm drawn in front."),
    "hulls": ("3a", "Concave hulls (α-shapes) of the clouds."),
    "map_volume": ("3b", "Volume of the concave hulls."),
    "map_exact_volume": ("3b", "Exact volume of the reachable sets, for comparison."),
    "map_unreachability": ("3b", "Unreachability of the clouds: 1 - concave / convex volume."),
    "map_exact_unreachability": ("3b", "Exact unreachability, for comparison."),
    "curvature": ("3c", "Curvature at six stations of the distal half, without and with taper."),
}


def swept_atlas(folder: Path) -> xr.Dataset:
    """The atlas that the sweep left in the folder of all results.

    Raises:
        InvalidInput: It was removed.
    """
    try:
        return open_atlas(folder / _STORE)
    except InvalidInput as error:
        notes = folder / "figures" / "sweep.json"
        raise InvalidInput("atlas", error.value, error.allowed, f"remove {notes} too") from None


def _swept(settings: Settings, folder: Path) -> xr.Dataset:
    """The atlas of section 3, computed or continued: revolution from 0 to 108°, taper to 3°."""
    turns = np.radians(np.linspace(0, 108, settings.designs))
    tapers = np.radians(np.linspace(0, 3, settings.designs))
    space = DesignSpace.grid(minimal_trunk(), revolution=turns, taper=tapers)
    return build_atlas(
        space,
        folder / _STORE,
        settings.samples,
        settings.seed,
        alpha_over_length=settings.alpha,
        accuracy=settings.accuracy,
    )


def sweep(settings: Settings, folder: Path, notes: Notebook) -> None:
    """Volumes, unreachability, widths and curvatures of every design."""
    atlas = _swept(settings, folder)
    curvature = atlas["bending_quantile"].isel(revolution=-1, taper=[0, -1])
    notes.note(
        designs=int(atlas["volume"].notnull().sum()),
        samples=settings.samples,
        revolution_deg=np.degrees(atlas["revolution"].values).round(6).tolist(),
        taper_deg=np.degrees(atlas["taper"].values).round(6).tolist(),
        alpha=atlas["volume"].attrs["alpha_over_length"],
        **shapes(atlas["revolution"].values, atlas["taper"].values, settings.accuracy),
        aside_from=ASIDE,
        quantiles=curvature["quantile"].values.tolist(),
        curvature=curvature.transpose("taper", "station", "quantile").values.tolist(),
        **{name: _rows(atlas[name]) for name in _SCALARS},
    )
    for name, figure in atlas_figures(atlas, settings.panels):
        if name in _CAPTIONS:
            label, words = _CAPTIONS[name]
            notes.draw(label, f"figure_{label}_{name}", words, figure)


def _rows(values: xr.DataArray) -> Any:
    """Numbers over (revolution, taper)."""
    return values.transpose("revolution", "taper").values.tolist()
