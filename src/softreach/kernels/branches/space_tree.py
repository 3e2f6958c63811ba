"""An octree over space that lists, for every place, the tetrahedra that may cover it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import row


class SpaceTree(NamedTuple):
    """Nodes are cubes; a node's eight children follow each other, x slowest."""

    planes: np.ndarray  # faces of the tetrahedra, n·p >= d within [m], (tetrahedron, 4, 4)
    boxes: np.ndarray  # boxes round the images of cells of six tetrahedra each [m], (cell, 2, 3)
    low: np.ndarray  # lowest corner of the root [m], (3,)
    size: float  # edge of the root [m]
    child: np.ndarray  # first child of each node, 0 for a leaf
    first: np.ndarray  # beginning of a leaf's tetrahedra in `item`
    length: np.ndarray  # number of its tetrahedra
    item: np.ndarray  # tetrahedra, leaf after leaf


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
    """Put those of some items whose faces and boxes hold p into `held`, in order; return how many.

    Two faces at a time, without a branch: which of them misses p cannot be predicted. What is left
    does not depend on how large the leaf is.
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
    kept = 0
    for entry in range(count):
        held[kept] = held[entry]
        kept += int(_is_boxed(tree.boxes, held[entry] // 6, p))
    return kept


@inline
def _is_boxed(boxes, c, p):
    """True if p lies in the box of cell c."""
    inside = True
    for k in range(3):
        inside &= boxes[c, 0, k] <= p[k] and p[k] <= boxes[c, 1, k]
    return inside


@inline
def _is_beyond(planes, k, i, p):
    """True if p lies on the inner side of face i of tetrahedron k."""
    inward = planes[k, i, 0] * p[0] + planes[k, i, 1] * p[1] + planes[k, i, 2] * p[2]
    return inward >= planes[k, i, 3]


@kernel
def sort_into_children(planes, boxes, corner, edge, first, count, item, meets, counts, starts, out):
    """Sort the items of nodes into their eight children: first counted, then listed.

    Nodes have lowest corners (node, 3) and `count` items from `first` on; a child has an edge.
    `meets` has a bit for each child that an item may meet, filled when counting; `counts` (node, 8)
    is filled with the items of each child, which begin at `starts` (node, 8) in `out`: empty to
    count only, else with room for one more.
    """
    for n in range(corner.shape[0]):
        p, begin, end = row(corner, n), first[n], first[n] + count[n]
        if not out.shape[0]:
            for entry in range(begin, end):
                meets[entry] = _children_met(planes, boxes, item[entry], p, edge)
        for o in range(8):
            size = 0
            for entry in range(begin, end):
                if out.shape[0]:  # the next item takes the place of one that misses
                    out[starts[n, o] + size] = item[entry]
                size += meets[entry] >> o & 1
            counts[n, o] = size


@inline
def _children_met(planes, boxes, k, p, edge):
    """A bit for each child that tetrahedron k may meet as far as its box and faces tell."""
    half, c = 0.5 * edge, k // 6
    x, y = _sides_met(boxes, c, 0, p, edge), _sides_met(boxes, c, 1, p, edge)
    z = _sides_met(boxes, c, 2, p, edge)
    met = 0
    for o in range(8):
        met |= (x >> (o >> 2) & y >> (o >> 1 & 1) & z >> (o & 1) & 1) << o
    for i in range(4):
        a, b, c = planes[k, i, 0], planes[k, i, 1], planes[k, i, 2]
        reach = half * (abs(a) + abs(b) + abs(c)) - planes[k, i, 3]
        low = a * (p[0] + half) + b * (p[1] + half) + c * (p[2] + half) + reach
        a, b, c = a * edge, b * edge, c * edge
        beyond = 0
        for o in range(8):
            inward = low + (o >> 2) * a + (o >> 1 & 1) * b + (o & 1) * c
            beyond |= int(inward >= 0.0) << o
        met &= beyond
        if not met:
            break
    return met


@inline
def _sides_met(boxes, c, axis, p, edge):
    """Two bits: a box meets the lower and the upper half of a cube along an axis."""
    low, high = boxes[c, 0, axis], boxes[c, 1, axis]
    lower = int(low <= p[axis] + edge) & int(high >= p[axis])
    upper = int(low <= p[axis] + 2.0 * edge) & int(high >= p[axis] + edge)
    return lower | upper << 1
