"""Triangles: their pixels, and those of a sphere whose images may hold a root."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel, strict


@strict
def fill_triangles(triangles, work, keys):
    """Keep the larger key, of depth above color, at every pixel whose center lies in a triangle.

    Triangles (n, 3, 6) have column, row, depth, red, green and blue at each corner; pixel (i, j)
    covers rows i to i + 1 and columns j to j + 1. There is room `work` for (2, 6) numbers.
    """
    left, slope = work
    for t in range(len(triangles)):
        low = min(triangles[t, 0, 1], triangles[t, 1, 1], triangles[t, 2, 1])
        high = max(triangles[t, 0, 1], triangles[t, 1, 1], triangles[t, 2, 1])
        for i in range(next_center(low, keys.shape[0]), next_center(high, keys.shape[0])):
            right = span(triangles, t, i + 0.5, left, slope)
            first = next_center(left[0], keys.shape[1])
            for column in range(first, next_center(np.nextafter(right, np.inf), keys.shape[1])):
                key = pixel_key(column + 0.5 - left[0], left, slope)
                if key > keys[i, column]:
                    keys[i, column] = key


@strict
def next_center(edge, count):
    """The first pixel whose center is at or after an edge, within 0 to count."""
    return np.int64(np.ceil(min(max(edge - 0.5, 0.0), np.float64(count))))


@strict
def span(triangles, t, height, left, slope):
    """Write the values at the left end of a row and their growth; return the right end."""
    enter, leave, first, last = 0, 0, np.inf, -np.inf
    enter_share, leave_share = 0.0, 0.0
    for i in range(3):
        j = (i + 1) % 3
        rise = triangles[t, j, 1] - triangles[t, i, 1]
        if rise == 0.0:
            continue
        share = (height - triangles[t, i, 1]) / rise
        if share < 0.0 or share > 1.0:
            continue
        x = triangles[t, i, 0] + share * (triangles[t, j, 0] - triangles[t, i, 0])
        if x < first:
            enter, enter_share, first = i, share, x
        if x > last:
            leave, leave_share, last = i, share, x
    width = max(last - first, 1e-12)
    left[0] = first
    for k in range(2, 6):
        a, b = triangles[t, enter, k], triangles[t, (enter + 1) % 3, k]
        left[k] = a + enter_share * (b - a)
        a, b = triangles[t, leave, k], triangles[t, (leave + 1) % 3, k]
        slope[k] = (a + leave_share * (b - a) - left[k]) / width
    return last


@strict
def pixel_key(along, left, slope):
    """Depth in the high half, in unsigned order; red, green, blue, 255 in the low."""
    depth = np.float32(along * slope[2] + left[2]).view(np.uint32)
    ordered = ~depth if depth >> np.uint32(31) else depth | np.uint32(0x80000000)
    key = np.uint64(ordered)
    for k in range(3, 6):
        key = key << np.uint64(8) | np.uint64(np.rint(along * slope[k] + left[k]))
    return key << np.uint64(8) | np.uint64(255)


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
def judge_images(images, parents, children, caution, flatness, out):
    """Judge the quarters (4 n, 3) of triangles (n, 3) by the images of all points (point, 3).

    These have their last coordinate along the value, quarters come in four rounds, the last of the
    middles of sides. An image within `caution` sags of the value is cut further, until its altitude
    is `flatness` sags.
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
