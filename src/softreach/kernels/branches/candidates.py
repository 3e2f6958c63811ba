"""Starting points of Newton's method: tetrahedra of the activation box that map onto a target.

A target's solutions lie in tetrahedra whose linear image, inflated by its interpolation error,
contains it: an octree over space lists those of every place. In each of them the quadratic through
tips and Jacobians says whether and where, up to its remainder. Where the map does not fold, a root
of the quadratic that lies outside its tetrahedron is left to the neighbor's; where it may, one is
searched on either side of the fold.

That quadratic is the average of the vertices' expansions, Σ λi (fi + ½ Ji (x - xi)), exact for
quadratics. A Freudenthal tetrahedron walks from vertex 0 to vertex 3 along one axis after the
other; let sj tell how far along edge j, so that λ = (1 - s0, s0 - s1, s1 - s2, s2), and
Dij = Ji (xj+1 - xj). Then

    f(s) = Σ λi (gi + ½ Σ sj Dij),   gi = fi - ½ Σ Dij over j < i,

and Newton's method takes Σ λi Dij for ∂f/∂sj.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.image.activation_mesh import axes_of, image_faces, orientation, tetrahedron
from softreach.kernels.vector import combination, cross, dot, matrix, minus, plus, row, times


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


MOST_STARTS = 1024  # starts kept for one target; a fold to a point has a whole curve of them

_DISTINCT = 0.1  # starts nearer than this, in widths of their cells, lead to one solution
_MARGIN = 2.0  # remainders by which a target may lie outside the image of a tetrahedron
_MANY = 32  # starts after which a tetrahedron is searched once only
_EVEN = 0.3  # ratio of det J at its vertices above which a tetrahedron does not fold
_AT_ONCE = 512  # tetrahedra of a list that are compared with a target before any is searched
_ASIDE = 0.1  # how far from each other vertex a search near one begins


def find_starts(mesh, tree, targets, low, high, with_root, target, cell, start, inverse):
    """Activations near each solution of the targets (t, 3), until the arrays are full.

    Filled with each start's target, cell, activation (room, 3) and the inverse (room, 3, 3) [1/m]
    of the quadratic's Jacobian, 0 where singular. `with_root` leaves out tetrahedra whose quadratic
    does not reach the target. Numbers of targets that are done, and of starts.
    """
    # Memory that a kernel makes takes longer to compile.
    room = quadratic(), np.empty(MOST_STARTS), np.empty(_AT_ONCE, np.int32)
    return _find_starts(
        mesh, tree, targets, low, high, with_root, *room, target, cell, start, inverse
    )


@kernel
def _find_starts(
    mesh, tree, targets, low, high, with_root, q, side, held, target, cell, start, inverse
):
    count = np.intp(0)  # typed: compiled once
    for t in range(targets.shape[0]):
        if count + MOST_STARTS > start.shape[0]:
            return t, count
        first = count
        p = row(targets, t)
        begin, end = leaf_at(tree.low, tree.size, tree.child, tree.first, tree.length, p)
        for part in range(begin, end, _AT_ONCE):
            for entry in range(listed(tree, p, part, min(part + _AT_ONCE, end), held)):
                c, which = held[entry] // 6, held[entry] % 6
                v, axes = tetrahedron(mesh.corner, c, which), axes_of(which)
                most, least, even = _determinants(mesh.slope, v)
                expand(mesh, v, axes, p, q)
                for attempt in range(_attempts(even, count - first)):
                    weights = _linear_weights(mesh.tip, v, p)
                    if attempt > 0:
                        weights = _near_vertex((most, least)[attempt - 1])
                    reached, weights, det = _search(q, weights, even, mesh.remainder[c])
                    guess, det = _place(mesh.gamma, v, weights), det * orientation(which)
                    if (reached or not with_root) and _is_new(
                        mesh, c, guess, det, start, side, first, count
                    ):
                        turn = orientation(which) * det
                        _put(guess, q, axes, turn, low, high, count, start, inverse)
                        target[count], cell[count], side[count - first] = t, c, det
                        count += 1
    return targets.shape[0], count


@inline
def _attempts(even, count):
    """Number of searches to begin in a tetrahedron: one, or also on either side of a fold."""
    if count >= MOST_STARTS:
        return 0
    return 1 if even or count >= _MANY else 3


@inline
def _search(q, weights, even, remainder):
    """Outcome of a search: true if it reaches the target, its end, and the determinant there."""
    reached, weights, det = refine(q, weights, remainder)
    if reached and even:
        reached = is_inside(q, weights, det, _MARGIN * remainder)
    return reached, weights, det


@inline
def _place(gamma, v, w):
    """The activation at barycentric coordinates."""
    a, b, c, d = row(gamma, v[0]), row(gamma, v[1]), row(gamma, v[2]), row(gamma, v[3])
    return (
        w[0] * a[0] + w[1] * b[0] + w[2] * c[0] + w[3] * d[0],
        w[0] * a[1] + w[1] * b[1] + w[2] * c[1] + w[3] * d[1],
        w[0] * a[2] + w[1] * b[2] + w[2] * c[2] + w[3] * d[2],
    )


@inline
def _put(guess, q, axes, det, low, high, n, start, inverse):
    scale = 1.0 / det if det != 0.0 else 0.0
    for i in range(3):
        start[n, i] = min(max(guess[i], low[i]), high[i])
        for j in range(3):
            inverse[n, axes[i], j] = scale * q.width[i] * q.gradient[i, j]


@inline
def _determinants(slope, v):
    """The vertices of the largest and least det J, and whether the tetrahedron does not fold."""
    most, least = 0, 0
    high = low = _determinant(slope, v[0])
    for i in range(1, 4):
        det = _determinant(slope, v[i])
        if det > high:
            most, high = i, det
        if det < low:
            least, low = i, det
    return most, least, low > _EVEN * high or high < _EVEN * low


@inline
def _determinant(slope, i):
    a = matrix(slope, i)
    return dot(a[0], cross(a[1], a[2]))


@inline
def _near_vertex(i):
    """Barycentric coordinates of a place near a vertex."""
    near, far = 1.0 - 3.0 * _ASIDE, _ASIDE
    return (
        near if i == 0 else far,
        near if i == 1 else far,
        near if i == 2 else far,
        near if i == 3 else far,
    )


@inline
def _linear_weights(tip, v, p):
    """Barycentric coordinates of p in a linear image, moved into it."""
    base, det, normals = image_faces(tip, v)
    q = minus(p, base)
    b0, b1 = max(det + dot(q, normals[0]), 0.0), max(dot(q, normals[1]), 0.0)
    b2, b3 = max(dot(q, normals[2]), 0.0), max(dot(q, normals[3]), 0.0)
    total = b0 + b1 + b2 + b3
    if total > 0:
        return b0 / total, b1 / total, b2 / total, b3 / total
    return 0.25, 0.25, 0.25, 0.25


@inline
def _is_new(mesh, c, guess, det, start, side, begin, end):
    """True if no start of the target is so near, on one side of a fold, that both lead to one."""
    gamma, first, last = mesh.gamma, mesh.corner[c, 0], mesh.corner[c, 7]
    for i in range(begin, end):
        apart = 0.0
        for k in range(3):
            width = gamma[last, k] - gamma[first, k]
            apart = max(apart, abs(start[i, k] - guess[k]) / width)
        if apart < _DISTINCT and det * side[i - begin] > 0.0:
            return False
    return True


_ITERATIONS = 6
_OUTSIDE = 0.5  # how far outside a tetrahedron its quadratic is followed, in barycentric units
_CONVERGED, _ACCEPTED = 0.25, 2.0  # residuals at which to end and to keep, in remainders
_ROUNDING = 1e-6  # in barycentric units


class Quadratic(NamedTuple):
    """Of one tetrahedron at a time; all arrays are written."""

    value: np.ndarray  # gi - p [m], p being the target, (4, 3)
    change: np.ndarray  # Dij [m], (4, 3, 3)
    width: np.ndarray  # the lengths of the edges along their axes, with sign [-], (3,)
    gradient: np.ndarray
    """Of each sj in space, times the determinant of ∂f/∂s, at the last step, shape (3, 3)."""


def quadratic():
    """Space for one."""
    return Quadratic(np.empty((4, 3)), np.empty((4, 3, 3)), np.empty(3), np.empty((3, 3)))


@inline
def expand(mesh, v, axes, p, q):
    """Put the quadratic of the tetrahedron of vertices v, whose edges follow `axes`, into q."""
    for j in range(3):
        q.width[j] = mesh.gamma[v[j + 1], axes[j]] - mesh.gamma[v[j], axes[j]]
    for i in range(4):
        for c in range(3):
            before = 0.0
            for j in range(3):
                change = q.width[j] * mesh.slope[v[i], c, axes[j]]
                q.change[i, j, c] = change
                if j < i:
                    before += change
            q.value[i, c] = mesh.tip[v[i], c] - p[c] - 0.5 * before


@inline
def refine(q, weights, remainder):
    """Newton's method from barycentric coordinates to where f is the target, but for a cubic rest.

    Whether it is reached, the coordinates, and the determinant of ∂f/∂s at the last step.
    """
    s = (1.0 - weights[0], weights[2] + weights[3], weights[3])
    det, size = 0.0, 0.0
    for _ in range(_ITERATIONS):
        miss, a = _at(q, s)
        size = dot(miss, miss)
        s, det, moved = _step(q, s, miss, a)
        if size <= (_CONVERGED * remainder) ** 2:
            return True, barycentric(s), det
        if not moved:
            return size <= (_ACCEPTED * remainder) ** 2, barycentric(s), det
    miss, a = _at(q, s)
    return dot(miss, miss) <= (_ACCEPTED * remainder) ** 2, barycentric(s), det


@inline
def barycentric(s):
    """λ at s."""
    return 1.0 - s[0], s[0] - s[1], s[1] - s[2], s[2]


@inline
def _at(q, s):
    """p - f at s, and ∂f/∂s0, ∂f/∂s1, ∂f/∂s2."""
    w, none = barycentric(s), (0.0, 0.0, 0.0)
    miss, a0, a1, a2 = none, none, none, none
    for i in range(4):
        change = matrix(q.change, i)
        a0, a1 = plus(a0, times(w[i], change[0])), plus(a1, times(w[i], change[1]))
        a2 = plus(a2, times(w[i], change[2]))
        miss = minus(miss, times(w[i], row(q.value, i)))
    a = (a0, a1, a2)
    return minus(miss, times(0.5, combination(s, a))), a


@inline
def _step(q, s, miss, a):
    """A Newton step, cut short where it leaves the neighborhood of the tetrahedron."""
    g = (cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1]))
    det = dot(a[0], g[0])
    for j in range(3):
        q.gradient[j, 0], q.gradient[j, 1], q.gradient[j, 2] = g[j]
    if det == 0.0:
        return s, det, False
    scale = 1.0 / det
    y = (scale * dot(g[0], miss), scale * dot(g[1], miss), scale * dot(g[2], miss))
    here, ahead = barycentric(s), barycentric((s[0] + y[0], s[1] + y[1], s[2] + y[2]))
    part = 1.0
    for i in range(4):
        if ahead[i] < -_OUTSIDE:
            part = min(part, (here[i] + _OUTSIDE) / (here[i] - ahead[i]))
    if part < 1e-3:
        return s, det, False
    return (s[0] + part * y[0], s[1] + part * y[1], s[2] + part * y[2]), det, True


@inline
def is_inside(q, weights, det, margin):
    """True if a target can lie in the image of a tetrahedron that is off by so much at most."""
    for i in range(4):
        outside = -weights[i] - _ROUNDING
        if outside > 0.0:
            size = 0.0
            for c in range(3):
                before = q.gradient[i - 1, c] if i > 0 else 0.0
                behind = q.gradient[i, c] if i < 3 else 0.0
                size += (before - behind) ** 2
            if (outside * det) ** 2 > margin * margin * size:
                return False
    return True
