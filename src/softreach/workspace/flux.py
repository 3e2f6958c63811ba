"""The signed volume of the image of three bundles, from what flows through its six faces."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.workspace.faces import FaceNodes, box_slopes, gauss_faces

__all__ = ["Flux", "flux_tol", "signed_volume"]

Array = NDArray[np.float64]

_TOL = 1e-11  # in L: there are few nodes, so that steps may be short
_ROUGH_TOL = 1e-9  # where a raster decides the error, and under loads, where each tip costs much
_NODES = (8, 12, 16, 24, 32)


class Flux(NamedTuple):
    """∫ det J dγ by the divergence theorem, theory (81), and what it was computed from."""

    value: float
    """Signed volume [m³]: below zero if the map turns the orientation over."""
    error: float
    """How far off it may be: half as many nodes or so, and the error of the tips [m³]."""
    faces: FaceNodes
    """Nodes on the faces of the unit cube of the free bundles."""
    area: Array
    """Area vectors of the nodes, with their weights [m²], shape (n, 3)."""


def flux_tol(rod: TipMap) -> float:
    """Largest tip error on the faces, in L."""
    return min(rod.tol, _ROUGH_TOL if rod.supports_unstable else _TOL)


def signed_volume(rod: TipMap, nodes: int | None = None) -> Flux:
    """The signed volume of the image of three free bundles.

    By Gauss and Legendre's rule on the faces, as the map is smooth: its error falls faster than any
    power of the number of nodes. They are added until tips are no more exact than the rule.

    Args:
        rod: The tip map.
        nodes: Along each side, for this and two thirds of it alone, instead of as many as it needs;
            tips are then less exact.

    Returns:
        Value and error are NaN if a node has no stable equilibrium.
    """
    rod = rod.refined(flux_tol(rod) if nodes is None else _ROUGH_TOL)
    counts = _NODES if nodes is None else (2 * nodes // 3, nodes)
    found, change = _flux(rod, counts[0]), np.inf
    for count in counts[1:]:
        rough, found = found, _flux(rod, count)
        change = abs(found.value - rough.value)
        if nodes is None and not change > found.error:  # NaN too
            break
    return found._replace(error=change + found.error)


def _flux(rod: TipMap, nodes: int) -> Flux:
    """By one rule; the error is that of the tips alone."""
    faces = gauss_faces(nodes)
    tips, slopes = box_slopes(rod, faces.cube)
    area = faces.area_vectors(slopes)
    # From the middle, where products cancel least. Not BLAS, whose rounding depends on threads.
    value = float(((tips - tips.mean(axis=0)) * area).sum()) / 3.0
    moved = rod.tol * rod.length * float(np.linalg.norm(area, axis=1).sum())
    return Flux(value, moved, faces, area)
