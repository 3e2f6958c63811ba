"""Linear response of rods in equilibrium: how they move when their tables change a little.

With θ the rotation of the sections, ρ the movement of the centerline, μ the change of the moment m
and ν that of the force n, all in the frame of the base, an equilibrium that changes obeys

    θ' = R δω,  δω = δω| + η K⁻¹ Rᵀ(μ - θ × m)
    ρ' = d3 δζ + ζ θ × d3,  δζ = δζ| + η/K0 (ν·d3 + θ·(d3 × n))
    μ' = n × ρ' - ζ d3 × ν

where a bar stands for the change of the tables alone, at the same m and n. The step is Gauss
collocation of sixth order in the three nodes of the tables. What μ is at the base follows from what
it is at the tip, which is linear in three unknowns: they are columns like the changes.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import kernel

__all__ = ["GAUSS", "NODES", "WEIGHTS", "respond"]

_R = 15.0**0.5
NODES = np.array([0.5 - _R / 10.0, 0.5, 0.5 + _R / 10.0])
"""Gauss nodes of a step, from 0 to 1."""
WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
"""Weights of the nodes."""
GAUSS = np.array(
    [
        [5.0 / 36.0, 2.0 / 9.0 - _R / 15.0, 5.0 / 36.0 - _R / 30.0],
        [5.0 / 36.0 + _R / 24.0, 2.0 / 9.0, 5.0 / 36.0 - _R / 24.0],
        [5.0 / 36.0 + _R / 30.0, 2.0 / 9.0 + _R / 15.0, 5.0 / 36.0],
    ]
)
"""Integrals from 0 to each node of the polynomials that are 1 at one node, (node, of node)."""


@kernel
def respond(
    growth,
    stretch,
    resistance,
    thrust,
    directors,
    moment,
    force,
    turning,
    pushing,
    yielding,
    measures,
    lever,
    weight,
    marks,
    moves,
    turns,
    works,
):
    """Movements of one rod at boundaries of its steps, and works along it, for all columns.

    Args:
        growth: η dZ of the nodes [m], shape (step, 3).
        stretch: ζ dZ [m], likewise.
        resistance: 1/K1, 1/K1, 1/K3 [1/(N m²)], shape (step, 3, 3); zero without loads.
        thrust: 1/K0 [1/N], shape (step, 3).
        directors: d1, d2, d3 as rows, shape (step, 3, 3, 3).
        moment: m [N m] in the frame of the base, shape (step, 3, 3).
        force: n [N], likewise.
        turning: δω| dZ in the directors, shape (step, 3, 3, column).
        pushing: δζ| dZ, shape (step, 3, column).
        yielding: ν [N], shape (step, 3, 3, column).
        measures: M and N, whose work on δω and δζ is summed, shape (step, 3, 4, work).
        lever: Of the payload in the frame of the base [m], shape (3,).
        weight: Force of the payload [N], shape (3,).
        marks: Steps before each place that is asked for, ascending.
        moves: Result, ρ [m], shape (mark, 3, column).
        turns: Result, θ, likewise.
        works: Result, shape (work, column).
    """
    steps, columns = growth.shape[0], turning.shape[3]
    every = columns + 3
    loaded = False
    for k in range(steps):
        for i in range(3):
            if thrust[k, i] != 0.0:
                loaded = True
    state = np.zeros((6, every))  # θ, μ
    place = np.zeros((3, every))
    for c in range(3):
        state[3 + c, c] = 1.0
    kept = np.zeros((len(marks), 6, every))
    work = np.zeros((measures.shape[3], every))
    system = np.zeros((18, 18))
    rates = np.zeros((18, every))  # θ' and μ' at the nodes
    local = np.zeros((3, 6, 6))
    source = np.zeros((3, 6, every))
    rise = np.zeros((3, 3, 3))  # of ρ' = rise θ + climb
    climb = np.zeros((3, 3, every))
    moved = np.zeros((3, every))
    angle = np.zeros((3, every))
    for k in range(steps):
        for i in range(3):
            d = directors[k, i]
            n0, n1, n2 = force[k, i, 0], force[k, i, 1], force[k, i, 2]
            m0, m1, m2 = moment[k, i, 0], moment[k, i, 1], moment[k, i, 2]
            soft = growth[k, i] * thrust[k, i]
            x, y, z = d[2, 0], d[2, 1], d[2, 2]
            cx, cy, cz = y * n2 - z * n1, z * n0 - x * n2, x * n1 - y * n0  # d3 × n
            s = stretch[k, i]
            for a in range(3):
                rise[i, a, 0] = soft * d[2, a] * cx
                rise[i, a, 1] = soft * d[2, a] * cy
                rise[i, a, 2] = soft * d[2, a] * cz
            rise[i, 0, 1] += s * z
            rise[i, 0, 2] -= s * y
            rise[i, 1, 0] -= s * z
            rise[i, 1, 2] += s * x
            rise[i, 2, 0] += s * y
            rise[i, 2, 1] -= s * x
            for c in range(3):
                for a in range(3):
                    climb[i, a, c] = 0.0
                for a in range(6):
                    source[i, a, c] = 0.0
            for c in range(columns):
                v0, v1, v2 = yielding[k, i, 0, c], yielding[k, i, 1, c], yielding[k, i, 2, c]
                grown = pushing[k, i, c] + soft * (v0 * x + v1 * y + v2 * z)
                p0, p1, p2 = x * grown, y * grown, z * grown
                climb[i, 0, 3 + c], climb[i, 1, 3 + c], climb[i, 2, 3 + c] = p0, p1, p2
                w0, w1, w2 = turning[k, i, 0, c], turning[k, i, 1, c], turning[k, i, 2, c]
                for a in range(3):
                    source[i, a, 3 + c] = d[0, a] * w0 + d[1, a] * w1 + d[2, a] * w2
                source[i, 3, 3 + c] = n1 * p2 - n2 * p1 - s * (y * v2 - z * v1)
                source[i, 4, 3 + c] = n2 * p0 - n0 * p2 - s * (z * v0 - x * v2)
                source[i, 5, 3 + c] = n0 * p1 - n1 * p0 - s * (x * v1 - y * v0)
            if not loaded:
                continue
            for a in range(3):  # B = η R K⁻¹ Rᵀ and B [m]×
                for b in range(3):
                    value = 0.0
                    for e in range(3):
                        value += d[e, a] * resistance[k, i, e] * d[e, b]
                    local[i, a, 3 + b] = growth[k, i] * value
                b0, b1, b2 = local[i, a, 3], local[i, a, 4], local[i, a, 5]
                local[i, a, 0] = b1 * m2 - b2 * m1
                local[i, a, 1] = b2 * m0 - b0 * m2
                local[i, a, 2] = b0 * m1 - b1 * m0
            for b in range(3):  # n × rise
                r0, r1, r2 = rise[i, 0, b], rise[i, 1, b], rise[i, 2, b]
                local[i, 3, b] = n1 * r2 - n2 * r1
                local[i, 4, b] = n2 * r0 - n0 * r2
                local[i, 5, b] = n0 * r1 - n1 * r0
        for i in range(3):
            for a in range(6):
                for c in range(every):
                    rates[6 * i + a, c] = source[i, a, c]
        if loaded:
            for i in range(3):
                for a in range(6):
                    for c in range(every):
                        value = 0.0
                        for b in range(6):
                            value += local[i, a, b] * state[b, c]
                        rates[6 * i + a, c] += value
                    for j in range(3):
                        for b in range(6):
                            system[6 * i + a, 6 * j + b] = -GAUSS[i, j] * local[i, a, b]
                    system[6 * i + a, 6 * i + a] += 1.0
            # The pivots are 1 but for squares of short steps.
            for p in range(18):
                inverse = 1.0 / system[p, p]
                for q in range(p + 1, 18):
                    factor = system[q, p] * inverse
                    if factor != 0.0:
                        for b in range(p + 1, 18):
                            system[q, b] -= factor * system[p, b]
                        for c in range(every):
                            rates[q, c] -= factor * rates[p, c]
            for p in range(17, -1, -1):
                inverse = 1.0 / system[p, p]
                for c in range(every):
                    rates[p, c] *= inverse
                for q in range(p):
                    factor = system[q, p]
                    if factor != 0.0:
                        for c in range(every):
                            rates[q, c] -= factor * rates[p, c]
        for i in range(3):
            d = directors[k, i]
            for c in range(every):
                for a in range(3):
                    angle[a, c] = state[a, c] + (
                        GAUSS[i, 0] * rates[a, c]
                        + GAUSS[i, 1] * rates[6 + a, c]
                        + GAUSS[i, 2] * rates[12 + a, c]
                    )
                for a in range(3):
                    moved[a, c] = (
                        climb[i, a, c]
                        + rise[i, a, 0] * angle[0, c]
                        + rise[i, a, 1] * angle[1, c]
                        + rise[i, a, 2] * angle[2, c]
                    )
                    place[a, c] += WEIGHTS[i] * moved[a, c]
            for j in range(measures.shape[3]):
                for c in range(every):
                    value = 0.0
                    for e in range(3):
                        for a in range(3):
                            value += measures[k, i, e, j] * d[e, a] * rates[6 * i + a, c]
                    for a in range(3):
                        value += measures[k, i, 3, j] * d[2, a] * moved[a, c]
                    work[j, c] += WEIGHTS[i] * value
        for c in range(every):
            for a in range(6):
                state[a, c] += (
                    WEIGHTS[0] * rates[a, c]
                    + WEIGHTS[1] * rates[6 + a, c]
                    + WEIGHTS[2] * rates[12 + a, c]
                )
        for mark in range(len(marks)):
            if marks[mark] == k + 1:
                for c in range(every):
                    for a in range(3):
                        kept[mark, a, c] = place[a, c]
                        kept[mark, 3 + a, c] = state[a, c]
    # At the tip μ = (θ × lever) × weight = lever (θ·weight) - θ (lever·weight).
    along = lever[0] * weight[0] + lever[1] * weight[1] + lever[2] * weight[2]
    unknown = np.zeros((3, columns))
    if loaded:
        for c in range(every):
            across = state[0, c] * weight[0] + state[1, c] * weight[1] + state[2, c] * weight[2]
            for a in range(3):
                angle[a, c] = state[3 + a, c] - lever[a] * across + state[a, c] * along
        a00, a01, a02 = angle[0, 0], angle[0, 1], angle[0, 2]
        a10, a11, a12 = angle[1, 0], angle[1, 1], angle[1, 2]
        a20, a21, a22 = angle[2, 0], angle[2, 1], angle[2, 2]
        b00, b01, b02 = a11 * a22 - a12 * a21, a02 * a21 - a01 * a22, a01 * a12 - a02 * a11
        b10, b11, b12 = a12 * a20 - a10 * a22, a00 * a22 - a02 * a20, a02 * a10 - a00 * a12
        b20, b21, b22 = a10 * a21 - a11 * a20, a01 * a20 - a00 * a21, a00 * a11 - a01 * a10
        scale = -1.0 / (a00 * b00 + a01 * b10 + a02 * b20)
        for c in range(columns):
            r0, r1, r2 = angle[0, 3 + c], angle[1, 3 + c], angle[2, 3 + c]
            unknown[0, c] = scale * (b00 * r0 + b01 * r1 + b02 * r2)
            unknown[1, c] = scale * (b10 * r0 + b11 * r1 + b12 * r2)
            unknown[2, c] = scale * (b20 * r0 + b21 * r1 + b22 * r2)
    for mark in range(len(marks)):
        for c in range(columns):
            for a in range(3):
                moves[mark, a, c] = kept[mark, a, 3 + c]
                turns[mark, a, c] = kept[mark, 3 + a, 3 + c]
                for e in range(3):
                    moves[mark, a, c] += kept[mark, a, e] * unknown[e, c]
                    turns[mark, a, c] += kept[mark, 3 + a, e] * unknown[e, c]
    for j in range(measures.shape[3]):
        for c in range(columns):
            works[j, c] = work[j, 3 + c]
            for e in range(3):
                works[j, c] += work[j, e] * unknown[e, c]
