"""Values between the nodes of an even grid over a box, by multilinear interpolation."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["interpolate"]


@kernel
def interpolate(values, points, low, scale, sizes, out):
    """Put Σ over the corners of each point's cell into `out`.

    Args:
        values: At the nodes (node, component), the last axis of the grid varying fastest.
        points: Places (n, axis); outside the grid the nearest cell is continued.
        low: The first node of every axis (axis,).
        scale: Cells per unit of every axis, 0 for an axis of one node (axis,).
        sizes: Nodes of every axis (axis,).
        out: Filled, (n, component).
    """
    axes = sizes.shape[0]
    fraction, stride = np.zeros(axes), np.ones(axes, np.int64)
    for axis in range(axes - 2, -1, -1):
        stride[axis] = stride[axis + 1] * sizes[axis + 1]
    for n in range(points.shape[0]):
        at = 0
        for axis in range(axes):
            x = (points[n, axis] - low[axis]) * scale[axis]
            cell = min(max(int(np.floor(x)), 0), max(sizes[axis] - 2, 0))
            fraction[axis] = x - cell
            at += cell * stride[axis]
        for component in range(out.shape[1]):
            out[n, component] = 0.0
        for corner in range(1 << axes):
            weight, node = _corner(corner, at, fraction, stride)
            for component in range(out.shape[1]):
                out[n, component] += weight * values[node, component]


@inline
def _corner(corner, at, fraction, stride):
    """Weight and node of one corner of a cell; never a node outside of the grid."""
    weight, node = 1.0, at
    for axis in range(stride.shape[0]):
        if not corner >> axis & 1:
            weight *= 1.0 - fraction[axis]
        elif fraction[axis] == 0.0:
            weight = 0.0
        else:
            weight *= fraction[axis]
            node += stride[axis]
    return weight, node
