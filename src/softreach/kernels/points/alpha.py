"""Alpha shapes from a Delaunay triangulation: radii, volumes, boundary, regions, critical radius.

The alpha shape of radius α is the union of the cells whose circumscribed sphere has radius R <= α.
A region is a set of such cells that are connected through faces.

Points on a sphere or a grid have many spheres of one radius, which rounding of the coordinates
makes differ. So a cell counts from the least radius that rounding leaves possible. With edges of
up to l and 6V = |det|, every height is at least |det| / l², so that coordinates off by e move R by
at most 4 e R l² / |det|. A cell no thicker than rounding is flat: it joins others, and alone it is
no region.

References:
    Edelsbrunner, Mücke (1994), Three-dimensional alpha shapes, ACM Trans. Graphics 13, 43-72.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict
from softreach.kernels.points.predicates import (
    BOTTOM,
    EPS,
    ORIENT_BOUND,
    dot3,
    edge,
    end,
    minor,
    value,
)
from softreach.kernels.points.triangulation import FACES, corners
from softreach.kernels.vector import strict_cross as cross
from softreach.kernels.vector import strict_difference as difference
from softreach.kernels.vector import strict_dot as dot

DIGITS = 2.0**26  # a value this many times its rounding error is good to eight digits
LENGTH_BOUND = 48 * EPS  # three products of a square and a minor of two products
SLACK = 2.0**-33  # of a radius: what is typed or computed has so many digits
COORDINATES = 64 * EPS  # 4 vertices whose coordinates are good to nine roundings, times √3
LARGEST_SLACK = 2.0**-11
FLAT = 2.0**-43  # thickness over coordinates: a thousand roundings


@strict
def measure_cells(points, cells, names, box, w, radii, least, volumes, flat):
    """Write the radius of the circumscribed sphere, the volume and the thickness of every cell.

    With edges a, b, c from the last vertex, 6V = a · (b × c), and the center of the sphere is at
    (a² b × c + b² c × a + c² a × b) / 12V from there. Vertices are taken in the order of their
    names (n,), so that rounding is the same whoever made the cell. Points (n, 3) are in [-1, 1];
    cells (m, 4) with a negative vertex are none. Radii (m,), and the least that rounding leaves
    possible, are inf without a volume or a center inside the box or on its lower faces; a flat cell
    is no thicker than rounding.
    """
    for t in range(len(cells)):
        radii[t], least[t], volumes[t], flat[t] = np.inf, np.inf, 0.0, False
        i, j, k, m = corners(cells, t)
        if (i | j | k | m) < 0:
            continue
        i, j, k, m = by_name(names, i, j, k, m)
        x, y, z, det, sure, longest = sphere(points, i, j, k, m)
        if not sure:
            x, y, z, det = sphere_exact(points, i, j, k, m, w)
        volumes[t] = abs(det) / 6.0
        coarse = longest * max(
            max(size(points, i), size(points, j)), max(size(points, k), size(points, m))
        )
        flat[t] = abs(det) <= FLAT * coarse
        if det != 0.0 and not (
            beyond(points[m, 0] + x / (2.0 * det), box[0, 0], box[1, 0])
            or beyond(points[m, 1] + y / (2.0 * det), box[0, 1], box[1, 1])
            or beyond(points[m, 2] + z / (2.0 * det), box[0, 2], box[1, 2])
        ):
            radii[t] = np.sqrt(x * x + y * y + z * z) / (2.0 * abs(det))
            slack = SLACK + COORDINATES * coarse / abs(det)
            least[t] = radii[t] * (1.0 - min(slack, LARGEST_SLACK))


@strict
def size(points, i):
    """The largest coordinate of a point."""
    return max(abs(points[i, 0]), max(abs(points[i, 1]), abs(points[i, 2])))


@strict
def by_name(names, i, j, k, m):
    """Four vertices in the order of their names."""
    a, b = (names[i] << 32) | i, (names[j] << 32) | j
    c, d = (names[k] << 32) | k, (names[m] << 32) | m
    a, b, c, d = min(a, b), max(a, b), min(c, d), max(c, d)
    a, c, b, d = min(a, c), max(a, c), min(b, d), max(b, d)
    b, c = min(b, c), max(b, c)
    low = 0xFFFFFFFF
    return np.intp(a & low), np.intp(b & low), np.intp(c & low), np.intp(d & low)


@strict
def beyond(x, lower, upper):
    """True if a coordinate is below the lower bound, or not below the upper one."""
    return x < lower or x >= upper


@strict
def sphere(points, i, j, k, m):
    """The numerator of the center, 6V, if both are good to eight digits, the longest edge²."""
    a, b, c = difference(points, i, m), difference(points, j, m), difference(points, k, m)
    a2, b2, c2 = dot(a, a), dot(b, b), dot(c, c)
    bc, ca, ab = cross(b, c), cross(c, a), cross(a, b)
    x = a2 * bc[0] + b2 * ca[0] + c2 * ab[0]
    y = a2 * bc[1] + b2 * ca[1] + c2 * ab[1]
    z = a2 * bc[2] + b2 * ca[2] + c2 * ab[2]
    det = dot(a, bc)
    length = np.sqrt(x * x + y * y + z * z)
    u = max(abs(a[0]), abs(b[0]), abs(c[0]))
    v = max(abs(a[1]), abs(b[1]), abs(c[1]))
    w = max(abs(a[2]), abs(b[2]), abs(c[2]))
    longest = max(a2, b2, c2)
    length_size = longest * (u * v + v * w + w * u)
    sure = (
        abs(det) > DIGITS * ORIENT_BOUND * u * v * w
        and length > DIGITS * LENGTH_BOUND * length_size
    )
    return x, y, z, det, sure, longest


@strict
def sphere_exact(points, i, j, k, m, w):
    """`sphere` with each sum exact until its last rounding: a flat cell cancels most digits."""
    a = edge(w, BOTTOM, points, i, m)
    b = edge(w, end(a[2]), points, j, m)
    c = edge(w, end(b[2]), points, k, m)
    a2 = dot3(w, end(c[2]), a[0], a[0], a[1], a[1], a[2], a[2])
    b2 = dot3(w, end(a2), b[0], b[0], b[1], b[1], b[2], b[2])
    c2 = dot3(w, end(b2), c[0], c[0], c[1], c[1], c[2], c[2])
    x, y, z, det = 0.0, 0.0, 0.0, 0.0
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        bc = minor(w, end(c2), b[u], b[v], c[u], c[v])
        ca = minor(w, end(bc), c[u], c[v], a[u], a[v])
        ab = minor(w, end(ca), a[u], a[v], b[u], b[v])
        x, y, z = y, z, value(w, dot3(w, end(ab), a2, bc, b2, ca, c2, ab))
        det = value(w, dot3(w, end(ab), a[axis], bc, b[axis], ca, c[axis], ab))
    return x, y, z, det


@strict
def boundary_faces(cells, neighbors, kept, faces, owners):
    """Number of faces (f, 3) between kept cells (m, 4) and the rest, outwards, and their owners.

    Neighbors (m, 4) are -1 for none; there is room for 4 m faces.
    """
    count = 0
    for t in range(len(cells)):
        for i in range(4):
            if kept[t] and (neighbors[t, i] < 0 or not kept[neighbors[t, i]]):
                owners[count] = t
                for k in range(3):
                    faces[count, k] = cells[t, FACES[i, k]]
                count += 1
    return count


@strict
def added_regions(neighbors, solid, parent, t):
    """Join cell t, new, to the cells around it that have a region; how many more regions there are.

    ``parent`` leads from each cell towards the one that names its set (union-find), and ``solid``
    of that one is True if not all of them are flat: if the set is a region.
    """
    parent[t] = t
    added = int(solid[t])
    here = t
    for i in range(4):
        there = neighbors[t, i]
        if there < 0 or parent[there] < 0:
            continue
        there = root(parent, there)
        if there != here:
            parent[here] = there
            added -= int(solid[here] and solid[there])
            solid[there] |= solid[here]
            here = there
    return added


@strict
def join_regions(neighbors, kept, solid, parent):
    """The number of regions of the kept cells; arguments of `added_regions`, parents -1 before."""
    regions = 0
    for t in range(len(neighbors)):
        if kept[t]:
            regions += added_regions(neighbors, solid, parent, t)
    return regions


@strict
def join_pieces(faces, regions, solid, parent, table, inner):
    """Mark faces (f, 3) that are listed twice as inner, and join the sets on both sides.

    Faces are sorted vertices, `regions` their sets, `solid` and `parent` as of `added_regions`, and
    the table holds -1 at a power of two of places above f.
    """
    for f in range(len(faces)):
        a, b, c = np.int64(faces[f, 0]), np.int64(faces[f, 1]), np.int64(faces[f, 2])
        at = (a * 73856093 ^ b * 19349663 ^ c * 83492791) & (len(table) - 1)
        while table[at] != -1:
            g = table[at]
            if faces[g, 0] == a and faces[g, 1] == b and faces[g, 2] == c:
                break
            at = (at + 1) & (len(table) - 1)
        if table[at] == -1:
            table[at] = f
            continue
        g = table[at]
        inner[f], inner[g] = True, True
        here, there = root(parent, regions[f]), root(parent, regions[g])
        if here != there:
            parent[here] = there
            solid[there] |= solid[here]


@strict
def root(parent, t):
    """The one that names the set of t in a union-find forest, with paths halved."""
    while parent[t] != t:
        parent[t] = parent[parent[t]]
        t = parent[t]
    return t


@strict
def least_radii(cells, radii, least):
    """Write the least radius of the cells at each vertex into ``least``, which is -1 before."""
    for t in range(len(cells)):
        for i in range(4):
            v = cells[t, i]
            if least[v] < 0.0 or radii[t] < least[v]:
                least[v] = radii[t]


@strict
def radius_of_one_region(neighbors, radii, least, solid, parent, regions, order):
    """The first radius at which one region is left, adding cells in an order of least radii.

    `solid`, `parent` and the number of regions are those of `join_regions`, which change.
    """
    for k in range(len(order)):
        t = order[k]
        regions += added_regions(neighbors, solid, parent, t)
        alike = 2.0 * radii[t] - least[t]
        if regions == 1 and (k + 1 == len(order) or least[order[k + 1]] > alike):
            return radii[t]
    return np.inf
