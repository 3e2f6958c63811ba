"""A table of the inverse for fast loops: activations at the nodes of a grid, linear between them.

Nodes are solved from their neighbors, with little change of activation, so that these go on
continuously from the middle of the bounds outward. Cells are kept whose tips are right.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.roots import descend
from softreach.rod.rods import all_inputs, as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_number, as_path
from softreach.support.arrays import Array, Index, as_points
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.support.files.atomic import writing

_SAMPLES = 1 << 13
_MOST_NODES = 4_000_000
_RESIDUAL = 1e-9  # of nodes, in L
_FARTHEST = 0.5  # of the ranges, between neighbors on one branch
_SHARES = np.array(list(product(np.linspace(0.0, 1.0, 5), repeat=3)))  # of a cell, where it is held
_SAFETY = 1.25  # of the largest error there: linear tables err most at middles, which are there
_CELLS = 4096  # held to their tips together
_CORNERS = np.array(list(product((0, 1), repeat=3)))
_NEIGHBORS = np.concatenate([np.eye(3, dtype=int), -np.eye(3, dtype=int)])


@dataclass(frozen=True, eq=False, kw_only=True)
class InverseTable:
    """Activations that put the tip at a place, by linear interpolation within cells of a grid."""

    arm: Manipulator
    """The design."""
    origin: Array
    """Place of the first node [m], shape (3,)."""
    spacing: float
    """Edge of a cell [m]."""
    rows: NDArray[np.int32]
    """Row of each node in `activations`, -1 where there is none, shape (nx, ny, nz)."""
    cells: NDArray[np.uint8]
    """1 for cells that have an answer, by their lower corner, shape (nx, ny, nz)."""
    activations: NDArray[np.float32]
    """At the nodes, in the units of the inputs, shape (n, bundles)."""
    error: float
    """Largest distance between a place in such a cell and the tip there [m]."""

    def __call__(self, places: ArrayLike) -> Array:
        """Activations, shape (n, bundles), for places (n, 3) [m]; NaN where there is no answer."""
        points = as_points("places", places)
        share = (points - self.origin) / self.spacing
        inside = np.all((share >= 0.0) & (share < np.array(self.rows.shape) - 1), axis=1)
        cell = np.where(inside[:, None], share, 0.0).astype(int)
        known = np.flatnonzero(inside & (self.cells[tuple(cell.T)] == 1))
        cell, share = cell[known], share[known] - cell[known]
        between = np.zeros((len(known), self.activations.shape[1]))
        for corner in _CORNERS:
            weight = np.where(corner, share, 1.0 - share).prod(axis=1)
            between += weight[:, None] * self.activations[self.rows[tuple((cell + corner).T)]]
        gamma = np.full((len(points), between.shape[1]), np.nan)
        gamma[known] = between.clip(*self.arm.input_bounds.T)
        return gamma

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write the arrays under their names as a file of NumPy, .npz.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
        """
        names = "origin", "spacing", "rows", "cells", "activations", "error"
        arrays: dict[str, Any] = {name: np.asarray(getattr(self, name)) for name in names}
        arrays["input_names"] = np.array(self.arm.input_names)
        with writing(as_path("path", path), overwrite=as_flag("overwrite", overwrite)) as file:
            np.savez_compressed(file, **arrays)

    def __repr__(self) -> str:
        count, n = int(self.cells.sum()), len(self.activations)
        return f"<InverseTable: {n:,} nodes, {count:,} cells, error up to {self.error:.3g} m>"


def inverse_table(
    arm: Manipulator | TipMap,
    *,
    spacing_over_length: float = 0.05,
    error_over_length: float = 0.01,
    tol: float = 1e-6,
    point: str | None = None,
) -> InverseTable:
    """A table of activations over the places in reach, of an arm with or without loads.

    Of several that reach a place those are taken that go on continuously from the middle of the
    bounds; where that leads nowhere, others.

    Args:
        arm: The design, or its tip map, with three free bundles or more.
        spacing_over_length: Edge of a cell, in L; errors fall with its square.
        error_over_length: Largest error of a cell that is kept, in L, with a quarter for safety.
        tol: Largest tip error, in L.
        point: Name of the marker that counts as the tip; by default that of the design.

    Returns:
        The table, with the largest `error` of its cells at 125 places in each and a quarter more.

    Raises:
        InvalidInput: An argument is out of its range, or fewer than three bundles are free.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
        NotPossible: The grid is too large, or no cell has so small an error.
    """
    known = all_inputs(as_tip_map(arm, tol, point=point))
    spacing = known.length * as_number("spacing_over_length", spacing_over_length, Range(1e-3, 0.5))
    most = known.length * as_number("error_over_length", error_over_length, Range(1e-6, 0.5))
    if known.box.dimension < 3:
        raise InvalidInput("free bundles", known.box.dimension, "3 or more, for places in space")
    nodes = _Nodes(known, spacing)
    cells, error = nodes.judged(most)
    if not cells.any():
        raise NotPossible(f"no cell is right to {most:.3g} m: make `spacing_over_length` smaller")
    used = np.zeros(cells.shape, bool)
    used[tuple((np.argwhere(cells)[:, None] + _CORNERS).transpose(2, 0, 1))] = True
    rows = np.where(used, np.cumsum(used).reshape(used.shape) - 1, -1).astype(np.int32)
    return InverseTable(
        arm=known.arm,
        origin=nodes.origin,
        spacing=spacing,
        rows=rows,
        cells=cells.astype(np.uint8),
        activations=nodes.gamma[used].astype(np.float32),
        error=error,
    )


class _Nodes:
    """Nodes of a grid around the tips of samples, and the activations that reach them."""

    def __init__(self, known: TipMap, spacing: float) -> None:
        self.known, self.spacing = known, spacing
        box = known.box
        samples = box.from_cube(sample_cube("counter", _SAMPLES, box.bundles))
        tips = known.tips(samples)
        found = np.isfinite(tips[:, 0])
        if not found.any():
            raise NotPossible("no activation has a stable posture: lighten the loads")
        low, high = np.nanmin(tips, axis=0) / spacing, np.nanmax(tips, axis=0) / spacing
        self.origin = spacing * (np.floor(low) - 1.0)
        self.shape = tuple((np.ceil(high) - np.floor(low) + 3.0).astype(int).tolist())
        if np.prod(self.shape) > _MOST_NODES:
            raise NotPossible("the table has too many nodes: make `spacing_over_length` larger")
        self.gamma = np.full((*self.shape, box.bundles), np.nan, np.float32)
        order = np.argsort(-box.margin(samples), kind="stable")
        self._flood(samples[order[found[order]]], tips[order[found[order]]])

    def _flood(self, samples: Array, tips: Array) -> None:
        """Solve nodes beside solved ones, beginning at those beside tips of samples."""
        near = np.rint((tips - self.origin) / self.spacing).astype(int)
        _, first = np.unique(near, axis=0, return_index=True)
        for k in np.sort(first):  # each node once, those of the middle of the bounds first
            if np.isnan(self.gamma[tuple(near[k])][0]):
                front = self._solve(near[[k]], samples[[k]], np.inf)
                while len(front):
                    front = self._solve(*self._beside(front), _FARTHEST)

    def _beside(self, front: Index) -> tuple[Index, Array]:
        """Unsolved neighbors of nodes, each once, and activations to begin with."""
        node = (front + _NEIGHBORS[:, None]).reshape(-1, 3)
        start = np.tile(front, (len(_NEIGHBORS), 1))
        fits = ((node >= 0) & (node < self.shape)).all(axis=1)
        node, start = node[fits], start[fits]
        new = np.isnan(self.gamma[tuple(node.T)][:, 0])
        node, first = np.unique(node[new], axis=0, return_index=True)
        return node, self.gamma[tuple(start[new][first].T)].astype(float)

    def _solve(self, node: Index, start: Array, farthest: float) -> Index:
        """Put down what reaches nodes from starts, not too far from them; the nodes solved."""
        box, residual = self.known.box, _RESIDUAL * self.known.length
        ends = descend(self.known, self.origin + self.spacing * node, box.clip(start), residual, 30)
        change = np.abs((ends.gamma - start) / box.scales).max(axis=1)
        good = (ends.distance <= self.known.tol * self.known.length) & (change <= farthest)
        self.gamma[tuple(node[good].T)] = ends.gamma[good]
        return node[good]

    def judged(self, most: float) -> tuple[NDArray[np.bool_], float]:
        """Cells with an error up to `most` [m], by their lower corner, and the largest error."""
        solved, cells, largest = np.isfinite(self.gamma[..., 0]), np.zeros(self.shape, bool), 0.0
        at = np.argwhere(solved[:-1, :-1, :-1])
        at = at[solved[tuple((at[:, None] + _CORNERS).transpose(2, 0, 1))].all(axis=1)]
        for block in parallel.blocks(len(at), _CELLS):
            errors = self._errors(at[block])
            good = errors <= most
            cells[tuple(at[block][good].T)] = True
            largest = max(largest, float(errors[good].max(initial=0.0)))
        return cells, largest

    def _errors(self, cell: Index) -> Array:
        """Largest distance of tips from their places in cells (n, 3) [m], and more, shape (n,)."""
        weights = np.where(_CORNERS, _SHARES[:, None], 1.0 - _SHARES[:, None]).prod(axis=2)
        corners = self.gamma[tuple((cell[:, None] + _CORNERS).transpose(2, 0, 1))].astype(float)
        gamma = np.einsum("sc,ncb->nsb", weights, corners).reshape(-1, corners.shape[2])
        tips = self.known.tips(self.known.box.clip(gamma)).reshape(len(cell), -1, 3)
        away = tips - self.origin - self.spacing * (cell[:, None] + _SHARES)
        return _SAFETY * np.nan_to_num(np.linalg.norm(away, axis=2), nan=np.inf).max(axis=1)
