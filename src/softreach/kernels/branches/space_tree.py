"""An octree over space that lists, for every place, the tetrahedra that may cover it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["SpaceTree", "leaf_at", "listed", "may_meet", "sort_into_children"]


class SpaceTree(NamedTuple):
    """Nodes are cubes; a node's eight children follow each other, x slowest."""

    planes: np.ndarray
    """Faces of the tetrahedra, n·p >= d within [m], shape (tetrahedron, 4, 4)."""
    low: np.ndarray
    """Lowest corner of the root [m], shape (3,)."""
    size: float
    """Edge of the root [m]."""
    child: np.ndarray
    """First child of each node, 0 for a leaf."""
    first: np.ndarray
    """Beginning of a leaf's tetrahedra in `item`."""
    length: np.ndarray
    """Number of its tetrahedra."""
    item: np.ndarray
    """Tetrahedra, leaf after leaf."""


@inline
def may_meet(planes, k, p, half):
    """True if a box round p, of half-sizes, meets tetrahedron k as far as its face planes tell."""
    for i in range(4):
        a, b, c = planes[k, i, 0], planes[k, i, 1], planes[k, i, 2]
        reach = abs(a) * half[0] + abs(b) * half[1] + abs(c) * half[2]
        if a * p[0] + b * p[1] + c * p[2] + reach < planes[k, i, 3]:
            return False
    return True


@inline
def leaf_at(low, size, child, first, length, p):
    """Range of the items of the leaf that holds p; empty outside the root."""
    x, y, z = (p[0] - low[0]) / size, (p[1] - low[1]) / size, (p[2] - low[2]) / size
    if not (min(x, min(y, z)) >= 0.0 and max(x, max(y, z)) <= 1.0):
        return 0, 0
    node = 0
    while child[node] > 0:
        x, y, z = 2.0 * x, 2.0 * y, 2.0 * z
        i, j, k = int(x >= 1.0), int(y >= 1.0), int(z >= 1.0)
        node = child[node] + 4 * i + 2 * j + k
        x, y, z = x - i, y - j, z - k
    return first[node], first[node] + length[node]


@inline
def listed(tree, p, begin, end, held):
    """Put those of some items whose face planes hold p into `held`, in order; return how many.

    Two faces at a time, without a branch: which of them misses p cannot be predicted.
    """
    count = end - begin
    for entry in range(count):
        held[entry] = tree.item[begin + entry]
    for i in (0, 2):
        kept = 0
        for entry in range(count):
            k = held[entry]
            held[kept] = k
            kept += _is_beyond(tree.planes, k, i, p) & _is_beyond(tree.planes, k, i + 1, p)
        count = kept
    return count


@inline
def _is_beyond(planes, k, i, p):
    """True if p lies on the inner side of face i of tetrahedron k."""
    inward = planes[k, i, 0] * p[0] + planes[k, i, 1] * p[1] + planes[k, i, 2] * p[2]
    return inward >= planes[k, i, 3]


@kernel
def sort_into_children(planes, boxes, centers, half, first, count, item, counts, starts, out):
    """Sort the items of nodes into their eight children.

    Args:
        planes: Faces of the tetrahedra.
        boxes: Boxes round them, shape (tetrahedron, 2, 3).
        centers: Centers of the nodes' children, shape (node, 8, 3).
        half: Half the edge of a child.
        first: Beginning of each node's items in `item`.
        count: Number of each node's items.
        item: Items of the nodes.
        counts: Filled with the items of each child, shape (node, 8).
        starts: Beginning of each child's items in `out`, shape (node, 8).
        out: Receives the items; empty to count only.
    """
    for n in range(centers.shape[0]):
        for o in range(8):
            p = (centers[n, o, 0], centers[n, o, 1], centers[n, o, 2])
            size = 0
            for entry in range(first[n], first[n] + count[n]):
                k = item[entry]
                if _boxes_meet(boxes, k, p, half) and may_meet(planes, k, p, (half, half, half)):
                    if out.shape[0]:
                        out[starts[n, o] + size] = k
                    size += 1
            counts[n, o] = size


@inline
def _boxes_meet(boxes, k, p, half):
    """True if the box of tetrahedron k meets the cube round p."""
    for axis in range(3):
        if p[axis] + half < boxes[k, 0, axis] or p[axis] - half > boxes[k, 1, axis]:
            return False
    return True
