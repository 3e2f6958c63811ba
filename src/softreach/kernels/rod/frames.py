"""Whole configurations: frames along the rod, walked from base to tip, theory (26).

And what turns them into the world, and the largest strains of many cells.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel, strict
from softreach.kernels.rod.magnus import act, exp_coefficients, exponent
from softreach.kernels.rod.tips import BEND_ROWS, LANES, load, node_values, nodes_at, room
from softreach.kernels.vector import combination, cross

_BASE, _MIDDLE, _TIP = np.intp(0), np.intp(1), np.intp(2)
# typed: a literal would compile the function of a node once more


@inline
def _node(table, k, node, gamma):
    """A = (ηu, ζ e3) dZ at one node of step k."""
    row, last = 4 * node, BEND_ROWS + node if table.shape[1] > BEND_ROWS else 4 * node
    rest_length, length, x, y, z = table[k, row, -1], table[k, last, -1], 0.0, 0.0, 0.0
    for j in range(gamma.shape[0]):
        rest_length += table[k, row, j] * gamma[j]
        x += table[k, row + 1, j] * gamma[j]
        y += table[k, row + 2, j] * gamma[j]
        z += table[k, row + 3, j] * gamma[j]
        length += table[k, last, j] * gamma[j]
    return rest_length * x, rest_length * y, rest_length * z, 0.0, 0.0, length


@inline
def _turned(omega, p, s, c):
    """exp(ω) p for a direction p."""
    inner = cross(omega, p)
    outer = cross(omega, inner)
    return (
        p[0] + s * inner[0] + c * outer[0],
        p[1] + s * inner[1] + c * outer[1],
        p[2] + s * inner[2] + c * outer[2],
    )


@kernel
def frames(table, ends, gamma, position, directors):
    """Centerline r (n, station, 3) and directors as rows (n, station, 3, 3) of rods at stations.

    Of packed node tables (step, row, bundle + 1) and activations (n, bundle); `ends` (station,) are
    the numbers of steps from the base, ascending.
    """
    for sample in range(gamma.shape[0]):
        r = (0.0, 0.0, 0.0)
        d1, d2, d3 = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
        k, activation = _BASE, gamma[sample]
        for station in range(ends.shape[0]):
            while k < ends[station]:
                base = _node(table, k, _BASE, activation)
                middle = _node(table, k, _MIDDLE, activation)
                omega = exponent(base, middle, _node(table, k, _TIP, activation))
                step = act(omega, (0.0, 0.0, 0.0))
                r = _moved(r, d1, d2, d3, step)
                d1, d2, d3 = _rotated(d1, d2, d3, omega)
                k += 1
            _store(position, directors, sample, station, r, d1, d2, d3)


def centerlines(table, gamma, start, points, tangents):
    """Centers r (n, step + 1, 3) and tangents d3 of rods at the ends of all of their steps.

    Many side by side, of packed node tables and activations (n, bundle); `start` (12,) are r, d1,
    d2 and d3 of the clamped end.
    """
    _centerlines(table, gamma, *room(table), np.empty(12 * LANES), start, points, tangents)


@kernel
def _centerlines(table, gamma, work, lanes, state, start, points, tangents):
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load(lanes, gamma, first, count)
        for row in range(12):
            for i in range(LANES):
                state[row * LANES + i] = start[row]
        for k in range(table.shape[0] + 1):
            for i in range(count):
                for axis in range(3):
                    points[first + i, k, axis] = state[axis * LANES + i]
                    tangents[first + i, k, axis] = state[(9 + axis) * LANES + i]
            if k < table.shape[0]:
                node_values(work, lanes, table, k)
                for i in range(LANES):
                    base, middle, tip = nodes_at(work, i)
                    omega = exponent(base, middle, tip)
                    r, d1 = _three(state, i, 0), _three(state, i, 3)
                    d2, d3 = _three(state, i, 6), _three(state, i, 9)
                    r = _moved(r, d1, d2, d3, act(omega, (0.0, 0.0, 0.0)))
                    d1, d2, d3 = _turned_by(d1, d2, d3, omega)
                    for axis in range(3):
                        state[axis * LANES + i] = r[axis]
                        state[(3 + axis) * LANES + i] = d1[axis]
                        state[(6 + axis) * LANES + i] = d2[axis]
                        state[(9 + axis) * LANES + i] = d3[axis]


@inline
def _turned_by(d1, d2, d3, omega):
    """The directors after exp(ω), by its matrix: fewer multiplications than three turns."""
    s, c, _ = exp_coefficients(omega)
    x, y, z = omega[0], omega[1], omega[2]
    xx, yy, zz, xy, xz, yz = c * x * x, c * y * y, c * z * z, c * x * y, c * x * z, c * y * z
    u, v, w, d = s * x, s * y, s * z, (d1, d2, d3)
    first = combination((1.0 - yy - zz, xy + w, xz - v), d)
    second = combination((xy - w, 1.0 - xx - zz, yz + u), d)
    return first, second, combination((xz + v, yz - u, 1.0 - xx - yy), d)


@inline
def _three(state, i, row):
    return state[row * LANES + i], state[(row + 1) * LANES + i], state[(row + 2) * LANES + i]


@inline
def _moved(r, d1, d2, d3, step):
    """r + step, the step given in the directors."""
    x, y, z = combination(step, (d1, d2, d3))
    return r[0] + x, r[1] + y, r[2] + z


@inline
def _rotated(d1, d2, d3, omega):
    """The directors after the rotation exp(ω), ω given in the directors themselves."""
    w = combination(omega, (d1, d2, d3))
    s, c, _ = exp_coefficients(omega)
    return _turned(w, d1, s, c), _turned(w, d2, s, c), _turned(w, d3, s, c)


@inline
def _store(position, directors, sample, station, r, d1, d2, d3):
    for axis in range(3):
        position[sample, station, axis] = r[axis]
        directors[sample, station, 0, axis] = d1[axis]
        directors[sample, station, 1, axis] = d2[axis]
        directors[sample, station, 2, axis] = d3[axis]


@strict
def move(points, rotation, position):
    """Turn and move points (n, 3) in place; strict, as those without equilibrium are NaN."""
    a, b, c = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    d, e, f = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    g, h, k = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    p, q, r = position[0], position[1], position[2]
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        points[i, 0] = a * x + b * y + c * z + p
        points[i, 1] = d * x + e * y + f * z + q
        points[i, 2] = g * x + h * y + k * z + r


@strict
def turn(vectors, rotation):
    """Turn vectors (n, 3 k, m), one above another in k threes, in place."""
    for i in range(vectors.shape[0]):
        for row in range(0, vectors.shape[1], 3):
            for j in range(vectors.shape[2]):
                x, y, z = vectors[i, row, j], vectors[i, row + 1, j], vectors[i, row + 2, j]
                for axis in range(3):
                    turned = rotation[axis, 0] * x + rotation[axis, 1] * y
                    vectors[i, row + axis, j] = turned + rotation[axis, 2] * z


_TOGETHER = 64  # cells, so that the loop over them is innermost and short


@kernel
def relative_strains(centers, offset, stretch, curvature, longest, bending):
    """Largest offset + Σ stretch γ and |Σ curvature γ|² along the arm for each cell (n,).

    Of activations (n, m), offsets (station,), stretch (station, m) and curvature (station, 3, m).
    """
    count, bundles = centers.shape
    gamma = np.zeros((bundles, _TOGETHER))
    extension, square, part = np.empty(_TOGETHER), np.empty(_TOGETHER), np.empty(_TOGETHER)
    for first in range(0, count, _TOGETHER):
        size = min(_TOGETHER, count - first)
        for i in range(size):
            gamma[:, i] = centers[first + i]
            longest[first + i] = bending[first + i] = 0.0
        for s in range(len(offset)):
            extension[:] = offset[s]
            _add_products(stretch[s], gamma, extension)
            square[:] = 0.0
            for k in range(3):
                part[:] = 0.0
                _add_products(curvature[s, k], gamma, part)
                square += part * part
            for i in range(size):
                longest[first + i] = max(longest[first + i], extension[i])
                bending[first + i] = max(bending[first + i], square[i])


@inline
def _add_products(factors, gamma, out):
    for j in range(len(factors)):
        for i in range(_TOGETHER):
            out[i] += factors[j] * gamma[j, i]
