"""Mapped triangles of a sphere that may hold a root of the map, seen along its value."""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel

__all__ = ["DROPPED", "FLAT", "OPEN", "judge"]

DROPPED, FLAT, OPEN = 0, 1, 2
"""Verdicts: no root is near, the image is flat, the triangle is to be cut further."""


@inline
def _sag(images, middle, a, b):
    """Distance from the image of the middle of a side to the middle of its image, squared."""
    x = images[middle, 0] - 0.5 * (images[a, 0] + images[b, 0])
    y = images[middle, 1] - 0.5 * (images[a, 1] + images[b, 1])
    z = images[middle, 2] - 0.5 * (images[a, 2] + images[b, 2])
    return x * x + y * y + z * z


@inline
def _side(px, py, qx, qy):
    """Squared length of a side, the origin's turn about it, and its squared distance from it."""
    dx, dy = qx - px, qy - py
    size = max(dx * dx + dy * dy, 1e-300)
    along = min(max(-(px * dx + py * dy) / size, 0.0), 1.0)
    x, y = px + along * dx, py + along * dy
    return size, px * dy - py * dx, x * x + y * y


@kernel
def judge(images, parents, children, caution, flatness, out):
    """Judge the quarters of triangles by the images of their corners.

    Args:
        images: Of all points, the last coordinate along the value, shape (point, 3).
        parents: Triangles that were cut, shape (n, 3).
        children: Their quarters in four rounds, the last of the middles of sides, shape (4 n, 3).
        caution: How near an image must come to the value to be cut further, in its sags.
        flatness: Least altitude of a flat image, in sags.
        out: Filled with verdicts, shape (4 n,).
    """
    n = parents.shape[0]
    for p in range(n):
        a, b, c = parents[p, 0], parents[p, 1], parents[p, 2]
        last = children[3 * n + p]
        sag = max(_sag(images, last[0], a, b), _sag(images, last[1], b, c))
        sag = math.sqrt(max(sag, _sag(images, last[2], c, a)))
        for k in range(p, 4 * n, n):
            a, b, c = children[k, 0], children[k, 1], children[k, 2]
            out[k] = DROPPED
            if max(images[a, 2], max(images[b, 2], images[c, 2])) + sag <= 0.0:
                continue
            ax, ay, bx, by = images[a, 0], images[a, 1], images[b, 0], images[b, 1]
            cx, cy = images[c, 0], images[c, 1]
            s, t, d = _side(ax, ay, bx, by)
            u, v, e = _side(bx, by, cx, cy)
            w, x, f = _side(cx, cy, ax, ay)
            inside = (t > 0 and v > 0 and x > 0) or (t < 0 and v < 0 and x < 0)
            apart = 0.0 if inside else math.sqrt(min(d, min(e, f)))
            if apart <= caution * sag + 1e-12:
                doubled = abs((bx - ax) * (cy - by) - (by - ay) * (cx - bx))
                altitude = doubled / math.sqrt(max(s, max(u, w)))
                out[k] = FLAT if altitude >= flatness * sag else OPEN
