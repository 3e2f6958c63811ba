"""The opponent: a compiled Tsit5 with fixed steps on the rod's twelve unknowns.

Same tables, same lanes, same compiler flags and threads as our kernel, so that only the method
differs. Tsitouras, Comput. Math. Appl. 62 (2011) 770.
"""

from __future__ import annotations

import numpy as np

from softreach.arm import tables as arm_tables
from softreach.kernels.compiler import kernel

LANES = 64
STEPS = 100
NODES = np.array([0.0, 0.161, 0.327, 0.9, 0.9800255409045097, 1.0])
WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0],
        [0.161, 0.0, 0.0, 0.0, 0.0],
        [-0.008480655492356989, 0.335480655492357, 0.0, 0.0, 0.0],
        [2.8971530571054935, -6.359448489975075, 4.3622954328695815, 0.0, 0.0],
        [5.325864828439257, -11.748883564062828, 7.4955393428898365, -0.09249506636175525, 0.0],
        [
            5.86145544294642,
            -12.92096931784711,
            8.159367898576159,
            -0.071584973281401,
            -0.028269050394068383,
        ],
    ]
)
FINAL = np.array(
    [
        0.09646076681806523,
        0.01,
        0.4798896504144996,
        1.379008574103742,
        -3.290069515436081,
        2.324710524099774,
    ]
)


def tables(arm, steps: int = STEPS):
    """z and U at every stage of every step, uniform in S like ours, with dZ/dS."""
    profile, end = arm.profile, arm.profile.slender_length
    s = (np.arange(steps)[:, None] + NODES) * end / steps
    z = profile.station(s)
    table = arm_tables.tables(arm, z.ravel())
    packed = np.concatenate([table.extension[:, None], table.curvature], axis=1)
    return packed.reshape(steps, 6, 4, -1), profile.radius(z) * end / steps


@kernel
def _strain(strain, gamma, table):
    """ζ, u1, u2, u3 of every lane at one stage."""
    for row in range(4):
        value = strain[row * LANES : (row + 1) * LANES]
        value[:] = 1.0 if row == 0 else 0.0
        for j in range(gamma.shape[0]):
            weight, g = table[row, j], gamma[j]
            for i in range(LANES):
                value[i] += weight * g[i]


@kernel
def _slope(k, y, strain, measure):
    """(r, d1, d2, d3)' = ζ (d3, u x d1, u x d2, u x d3) dZ/dS."""
    for i in range(LANES):
        zeta = measure * strain[i]
        u1, u2, u3 = (
            zeta * strain[LANES + i],
            zeta * strain[2 * LANES + i],
            zeta * strain[3 * LANES + i],
        )
        for axis in range(3):
            d1 = y[(3 + axis) * LANES + i]
            d2 = y[(6 + axis) * LANES + i]
            d3 = y[(9 + axis) * LANES + i]
            k[axis * LANES + i] = zeta * d3
            k[(3 + axis) * LANES + i] = u3 * d2 - u2 * d3
            k[(6 + axis) * LANES + i] = u1 * d3 - u3 * d1
            k[(9 + axis) * LANES + i] = u2 * d1 - u1 * d2


@kernel
def _combined(out, y, k0, k1, k2, k3, k4, w):
    a, b, c, d, e = w[0], w[1], w[2], w[3], w[4]
    for i in range(12 * LANES):
        out[i] = y[i] + (a * k0[i] + b * k1[i]) + (c * k2[i] + d * k3[i]) + e * k4[i]


@kernel
def _last(y, k5, w):
    for i in range(12 * LANES):
        y[i] += w * k5[i]


@kernel
def _step(y, stage, k, strain, lanes, table, measure, weights):
    for s in range(6):
        _combined(stage, y, k[0], k[1], k[2], k[3], k[4], weights[s])
        _strain(strain, lanes, table[s])
        _slope(k[s], stage, strain, measure[s])


@kernel
def tips(table, measure, weights, final, gamma, out):
    """Tip positions by Tsit5, (n, fiber) -> (n, 3)."""
    n, m = gamma.shape
    lanes = np.zeros((m, LANES))
    y, stage = np.zeros(12 * LANES), np.zeros(12 * LANES)
    k, strain = np.zeros((6, 12 * LANES)), np.zeros(4 * LANES)
    for first in range(0, n, LANES):
        count = min(LANES, n - first)
        for j in range(m):
            for i in range(count):
                lanes[j, i] = gamma[first + i, j]
        y[:] = 0.0
        for axis in range(3):
            y[(3 + 4 * axis) * LANES : (4 + 4 * axis) * LANES] = 1.0
        for step in range(table.shape[0]):
            _step(y, stage, k, strain, lanes, table[step], measure[step], weights)
            _combined(y, y, k[0], k[1], k[2], k[3], k[4], final)
            _last(y, k[5], final[5])
        for i in range(count):
            for axis in range(3):
                out[first + i, axis] = y[axis * LANES + i]
