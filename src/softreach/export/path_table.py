"""The activations along a path as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.export.table import column_names

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["path_csv"]


def path_csv(found: xr.Dataset) -> str:
    """Activations and tip errors [m] at the points of a path, one line each, as CSV.

    Args:
        found: From `track_path`; what is beyond the end of the branch is nan.
    """
    names = [str(name) for name in found["bundle"].values]
    rows = zip(found.activation.values.tolist(), found.tip_error.values.tolist(), strict=True)
    header = ",".join([*column_names(names), "tip_error_m"])
    lines = [header, *(",".join(f"{x:.12g}" for x in (*g, error)) for g, error in rows)]
    return "\n".join([*lines, ""])
