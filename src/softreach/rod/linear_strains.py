"""Strains that are linear in the activations, and what a box of activations makes of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.arm.tables import Tables
from softreach.rod.activation_box import ActivationBox
from softreach.rod.tip_map import StrainRange, Strains

__all__ = ["linear_strains", "strain_range"]

Array = NDArray[np.float64]

_HEADINGS = 720


def linear_strains(table: Tables, gamma: Array) -> Strains:
    """u = Uγ and ζ = 1 + z·γ at the stations of a table.

    Samples vary fastest in memory, so that all values at one station lie side by side. The sum runs
    over the bundles in their order, whatever BLAS and its threads would do.

    Args:
        table: z and U.
        gamma: Activations, shape (n, bundles).
    """
    rows = np.concatenate([table.curvature, table.extension[:, None]], axis=1)
    bundles = np.ascontiguousarray(gamma.T)
    total, term = np.empty((len(rows), 4, len(gamma))), np.empty((4, len(gamma)))
    if not len(bundles):
        total[:] = 0.0
    for row, out in zip(
        rows if len(bundles) else (), total, strict=False
    ):  # station by station, so that terms stay cached
        np.multiply(row[:, :1], bundles[0], out=out)
        for j in range(1, len(bundles)):
            out += np.multiply(row[:, j : j + 1], bundles[j], out=term)
    total[:, 3] += 1.0
    return Strains(np.moveaxis(total[:, :3], 2, 0), total[:, 3].T)


def strain_range(table: Tables, box: ActivationBox) -> StrainRange:
    """Ranges of the strains of all activations in a box."""
    bounds = np.stack([box.low, box.high], axis=1)
    most = _most_bending(table.curvature[:, :2], bounds)
    return StrainRange(
        bending=np.stack([np.zeros_like(most), most], axis=1),
        torsion=_ends(table.curvature[:, 2], bounds),
        extension=1.0 + _ends(table.extension, bounds),
    )


def _ends(rows: Array, bounds: Array) -> Array:
    """Least and largest of linear functions over a box, shape (station, 2)."""
    ends = rows[..., None] * bounds
    return np.stack([ends.min(-1).sum(-1), ends.max(-1).sum(-1)], axis=1)


def _most_bending(plane: Array, bounds: Array) -> Array:
    """An upper bound of √(u1² + u2²): the support of (u1, u2) toward many headings."""
    heading = np.linspace(0.0, 2.0 * np.pi, _HEADINGS, endpoint=False)
    toward = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    along = np.einsum("hc,scb->shb", toward, plane)
    support = (along[..., None] * bounds).max(-1).sum(-1)
    return support.max(axis=1) / np.cos(np.pi / _HEADINGS)
