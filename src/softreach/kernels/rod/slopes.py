"""Derivatives of tips by activations, of many rods: the exact derivative of `rod.tips`.

A step moves the point p of what lies beyond it to exp(Ω) p, so that its change dp obeys
dp <- R dp + v + ω × p with (ω, v) = dexp(dΩ), theory (29). What multiplies the values at the three
nodes there is pulled back through dexp and the exponent once for each step, as three rows whatever
the number of bundles; a bundle then costs a sum over its column of the table.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.rod.magnus import act, exp_derivatives, exponent_and_parts, pulled_back
from softreach.kernels.rod.tips import (
    BEND_ROWS,
    LANES,
    NODE_ROWS,
    TIP,
    TOGETHER,
    clear_tips,
    load,
    node_values,
    nodes_at,
    room,
)

# Scratch of a group of lanes: for each coordinate what multiplies changes of the tables' rows, the
# rows of R, what multiplies dΩ in each coordinate, and the parts of the exponent.
_AXIS, _SIX = NODE_ROWS * TOGETHER, 6 * TOGETHER
_TURN = 3 * _AXIS
_POINT = _TURN + 9 * TOGETHER
_PARTS = _POINT + 3 * _SIX
_SCRATCH = _PARTS + 5 * _SIX


def slopes(table, gamma, tips, out):
    """Tips (n, 3) and their derivatives (n, 3, bundle) of n activations."""
    columns, scratch = np.empty((gamma.shape[1], 3 * LANES)), np.empty(_SCRATCH)
    same = 0.0 if table.shape[1] > BEND_ROWS else 1.0
    _slopes(table, same, gamma, *room(table), columns, scratch, tips, out)


@kernel
def _slopes(table, same, gamma, work, lanes, columns, scratch, tips, out):
    bundles = gamma.shape[1]
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load(lanes, gamma, first, count)
        clear_tips(work)
        _clear(columns)
        for k in range(table.shape[0] - 1, -1, -1):
            node_values(work, lanes, table, k)
            for group in range(-(-count // TOGETHER)):
                begin = group * TOGETHER
                _expand(work, begin, scratch)
                for axis in range(3):
                    _pull_back(work, begin, scratch, axis, same)
                for j in range(bundles):
                    _carry(columns[j], begin, scratch, table, k, j)
                    if table.shape[1] > BEND_ROWS:
                        _stretch(columns[j], begin, scratch, table, k, j)
        _store(work, columns, first, count, tips, out)


@inline
def _clear(columns):
    for j in range(columns.shape[0]):
        for i in range(columns.shape[1]):
            columns[j, i] = 0.0


@inline
def _store(work, columns, first, count, tips, out):
    for i in range(count):
        for axis in range(3):
            tips[first + i, axis] = work[TIP + axis * LANES + i]
            for j in range(out.shape[2]):
                out[first + i, axis, j] = columns[j, axis * LANES + i]


@inline
def _expand(work, begin, scratch):
    """Move the points of a group of lanes, and write what their derivatives are made of."""
    for lane in range(TOGETHER):
        i = begin + lane
        base, middle, tip = nodes_at(work, i)
        omega, (b1, b2, inner, left, right) = exponent_and_parts(base, middle, tip)
        x, y, z = act(omega, (work[TIP + i], work[TIP + LANES + i], work[TIP + 2 * LANES + i]))
        work[TIP + i], work[TIP + LANES + i], work[TIP + 2 * LANES + i] = x, y, z
        turn, first, second = exp_derivatives(omega)
        _write_row(scratch, _TURN + lane, turn[0])
        _write_row(scratch, _TURN + 3 * TOGETHER + lane, turn[1])
        _write_row(scratch, _TURN + 6 * TOGETHER + lane, turn[2])
        # dp = B ω + A v + A ω × p, row by row
        _write_twist(scratch, _POINT + lane, _row(second[0], z, first[1], -y, first[2], first[0]))
        _write_twist(
            scratch, _POINT + _SIX + lane, _row(second[1], x, first[2], -z, first[0], first[1])
        )
        _write_twist(
            scratch, _POINT + 2 * _SIX + lane, _row(second[2], y, first[0], -x, first[1], first[2])
        )
        _write_twist(scratch, _PARTS + lane, b1)
        _write_twist(scratch, _PARTS + _SIX + lane, b2)
        _write_twist(scratch, _PARTS + 2 * _SIX + lane, inner)
        _write_twist(scratch, _PARTS + 3 * _SIX + lane, left)
        _write_twist(scratch, _PARTS + 4 * _SIX + lane, right)


@inline
def _pull_back(work, begin, scratch, axis, same):
    """Write what multiplies changes of the tables' rows in one coordinate: theory (28)."""
    for lane in range(TOGETHER):
        b1 = _straight(scratch, _PARTS + lane)
        b2 = _straight(scratch, _PARTS + _SIX + lane)
        inner = _twist(scratch, _PARTS + 2 * _SIX + lane)
        left = _twist(scratch, _PARTS + 3 * _SIX + lane)
        right = _twist(scratch, _PARTS + 4 * _SIX + lane)
        row = _twist(scratch, _POINT + axis * _SIX + lane)
        base, middle, tip = pulled_back((b1, b2, inner, left, right), row)
        to, i = axis * _AXIS + lane, begin + lane
        _write_node(work, i, scratch, to, base, same)
        _write_node(work, 4 * LANES + i, scratch, to + 4 * TOGETHER, middle, same)
        _write_node(work, 8 * LANES + i, scratch, to + 8 * TOGETHER, tip, same)
        _write_row(scratch, to + BEND_ROWS * TOGETHER, (base[5], middle[5], tip[5]))


@inline
def _twist(scratch, at):
    return (
        scratch[at],
        scratch[at + TOGETHER],
        scratch[at + 2 * TOGETHER],
        scratch[at + 3 * TOGETHER],
        scratch[at + 4 * TOGETHER],
        scratch[at + 5 * TOGETHER],
    )


@inline
def _straight(scratch, at):
    """A twist whose linear part is along the axis."""
    x, y, z, _, _, along = _twist(scratch, at)
    return x, y, z, 0.0, 0.0, along


@inline
def _write_twist(scratch, to, a):
    _write_row(scratch, to, a[:3])
    _write_row(scratch, to + 3 * TOGETHER, a[3:])


@inline
def _write_row(scratch, to, row):
    scratch[to], scratch[to + TOGETHER], scratch[to + 2 * TOGETHER] = row


@inline
def _row(below, s, left, t, right, beside):
    """(below + s left + t right, beside)."""
    return (
        below[0] + s * left[0] + t * right[0],
        below[1] + s * left[1] + t * right[1],
        below[2] + s * left[2] + t * right[2],
        beside[0],
        beside[1],
        beside[2],
    )


@inline
def _write_node(work, i, scratch, to, row, same):
    """Product rule on ω = ηu."""
    rest_length = work[i]
    bend = row[0] * work[i + LANES] + row[1] * work[i + 2 * LANES] + row[2] * work[i + 3 * LANES]
    scratch[to] = bend + same * row[5]
    scratch[to + TOGETHER] = rest_length * row[0]
    scratch[to + 2 * TOGETHER] = rest_length * row[1]
    scratch[to + 3 * TOGETHER] = rest_length * row[2]


@inline
def _carry(column, begin, scratch, table, k, j):
    """Carry the derivatives by one activation across step k."""
    t = table[k, :, j]
    bends = t[0], t[1], t[2], t[3], t[4], t[5], t[6], t[7], t[8], t[9], t[10], t[11]
    for lane in range(TOGETHER):
        i = begin + lane
        point = column[i], column[LANES + i], column[2 * LANES + i]
        x, y, z = _TURN + lane, _TURN + 3 * TOGETHER + lane, _TURN + 6 * TOGETHER + lane
        column[i] = _coordinate(scratch, x, lane, point, bends)
        column[LANES + i] = _coordinate(scratch, y, _AXIS + lane, point, bends)
        column[2 * LANES + i] = _coordinate(scratch, z, 2 * _AXIS + lane, point, bends)


@inline
def _stretch(column, begin, scratch, table, k, j):
    """Add what changes of ζ dZ do, where ζ is not η."""
    base, middle, tip = (
        table[k, BEND_ROWS, j],
        table[k, BEND_ROWS + 1, j],
        table[k, BEND_ROWS + 2, j],
    )
    for axis in range(3):
        for lane in range(TOGETHER):
            at = axis * _AXIS + BEND_ROWS * TOGETHER + lane
            along = scratch[at] * base + scratch[at + TOGETHER] * middle
            column[axis * LANES + begin + lane] += along + scratch[at + 2 * TOGETHER] * tip


@inline
def _coordinate(scratch, turn, base, point, t):
    """A row of R with the derivative of the point, and the sum over a column of the table."""
    middle, tip = base + 4 * TOGETHER, base + 8 * TOGETHER
    return (
        scratch[turn] * point[0]
        + scratch[turn + TOGETHER] * point[1]
        + scratch[turn + 2 * TOGETHER] * point[2]
        + scratch[base] * t[0]
        + scratch[base + TOGETHER] * t[1]
        + scratch[base + 2 * TOGETHER] * t[2]
        + scratch[base + 3 * TOGETHER] * t[3]
        + scratch[middle] * t[4]
        + scratch[middle + TOGETHER] * t[5]
        + scratch[middle + 2 * TOGETHER] * t[6]
        + scratch[middle + 3 * TOGETHER] * t[7]
        + scratch[tip] * t[8]
        + scratch[tip + TOGETHER] * t[9]
        + scratch[tip + 2 * TOGETHER] * t[10]
        + scratch[tip + 3 * TOGETHER] * t[11]
    )
