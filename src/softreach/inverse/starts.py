"""Starts of searches for the activations with a given tip, with three free bundles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from softreach.inverse.prepared import PreparedMap
from softreach.inverse.request import Request
from softreach.kernels.branches import candidates
from softreach.kernels.branches.space_tree import SpaceTree
from softreach.support import parallel
from softreach.support.arrays import Array, Index, joined, joined_by, rows

__all__ = ["Starts", "spatial_order", "starts_from_cells", "with_torn_cells"]


_ROOM = candidates.MOST_STARTS + 4096  # starts that are gathered before they are copied
_AT_ONCE = 32  # targets that share a tree which is not divided
_PLACES = 32  # along each axis, when targets are put in order


class Starts(NamedTuple):
    """Activations at which searches begin."""

    target: Index
    """Number of the target, shape (n,)."""
    cell: Index
    """Cell of the mesh, shape (n,)."""
    gamma: Array
    """Activation [-], shape (n, 3)."""
    inverse: Array
    """Inverse of the Jacobian there [1/m], roughly; 0 if not known, shape (n, 3, 3)."""

    @staticmethod
    def empty(room: int) -> Starts:
        """Space for so many."""
        target, cell = np.empty(room, np.int64), np.empty(room, np.int64)
        return Starts(target, cell, np.empty((room, 3)), np.empty((room, 3, 3)))


def starts_from_cells(
    prepared: PreparedMap, request: Request, chosen: Index, with_root: bool = True
) -> Starts:
    """Starts for some of the targets, sorted by target.

    Args:
        prepared: The tip map, with its cells and their tree.
        request: The request; targets that follow each other are best near to each other.
        chosen: Numbers of the targets, ascending.
        with_root: Whether to leave out tetrahedra whose quadratic does not reach the target.
    """
    parts = [Starts.empty(0)]
    if not len(prepared.mesh.corner) or not len(chosen):
        return parts[0]
    box, targets = prepared.rod.box, request.targets[chosen]
    low, high, out = box.low.copy(), box.high.copy(), Starts.empty(_ROOM)
    for block, tree in _trees(prepared, targets):
        first, last, _ = block.indices(len(targets))
        while first < last:
            done, count = candidates.find_starts(
                prepared.mesh, tree, targets[first:last], low, high, with_root, *out
            )
            part = rows(out, np.arange(count))
            parts.append(part._replace(target=chosen[part.target + first]))
            first += done
    return joined(parts)


def _trees(prepared: PreparedMap, targets: Array) -> Iterator[tuple[slice, SpaceTree]]:
    """A tree for each block of targets: before many were asked for, of what may cover them."""
    if "tree" in vars(prepared):
        yield slice(len(targets)), prepared.tree
        return
    for block in parallel.blocks(len(targets), _AT_ONCE):
        yield block, prepared.leaves.around(targets[block])


def with_torn_cells(prepared: PreparedMap, request: Request, starts: Starts) -> Starts:
    """The starts, and more from corners of cells that have no image."""
    target, gamma = prepared.torn_cells.starts(request.targets)
    nowhere, unknown = np.full(len(target), -1), np.zeros((len(target), 3, 3))
    return joined_by("target", [starts, Starts(target, nowhere, gamma, unknown)])


def spatial_order(points: Array) -> Index:
    """An order in which points (n, 3) that follow each other share most of their candidates."""
    if len(points) < 2:
        return np.arange(len(points))
    low, high = points.min(axis=0), points.max(axis=0)
    place = ((points - low) * (_PLACES / np.maximum(high - low, 1e-300))).astype(np.int64)
    place = np.minimum(place, _PLACES - 1)
    return np.argsort(place @ np.array([_PLACES**2, _PLACES, 1]), kind="stable")
