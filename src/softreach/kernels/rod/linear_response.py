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

from softreach.kernels.compiler import inline, kernel

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


@inline
def _skew(v, out):
    out[0, 0] = out[1, 1] = out[2, 2] = 0.0
    out[0, 1], out[1, 0] = -v[2], v[2]
    out[0, 2], out[2, 0] = v[1], -v[1]
    out[1, 2], out[2, 1] = -v[0], v[0]


@inline
def _product(factor, a, b, out):
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            value = factor * a[i, j]
            for c in range(b.shape[1]):
                out[i, c] += value * b[j, c]


@inline
def _copy(a, out):
    """Write a to out; Numba takes seconds to compile an assignment of one array to another."""
    for i in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[i, c] = a[i, c]


@inline
def _add(factor, a, out):
    for i in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[i, c] += factor * a[i, c]


@inline
def _rates_of_places(node, d3, force, work):
    """Write ρ' = (η/K0 d3 (d3 × n)ᵀ - ζ d3 ×) θ into `work`, shape (3, 3)."""
    rest_length, stretch, thrust = node
    _skew(d3, work)
    across = (
        d3[1] * force[2] - d3[2] * force[1],
        d3[2] * force[0] - d3[0] * force[2],
        d3[0] * force[1] - d3[1] * force[0],
    )
    for a in range(3):
        for b in range(3):
            work[a, b] = rest_length * thrust * d3[a] * across[b] - stretch * work[a, b]


@inline
def _sources(node, d, force, turning, pushing, yielding, hat, climb, source):
    """Write what the tables alone change: of ρ' into `climb`, of θ' and μ' into `source`."""
    rest_length, stretch, thrust = node
    columns = pushing.shape[0]
    climb[:] = 0.0
    source[:] = 0.0
    for c in range(columns):
        pull = yielding[0, c] * d[2, 0] + yielding[1, c] * d[2, 1] + yielding[2, c] * d[2, 2]
        grown = pushing[c] + rest_length * thrust * pull
        for a in range(3):
            climb[a, 3 + c] = d[2, a] * grown
    _product(1.0, d.T, turning, source[:3, 3:])
    _skew(force, hat)
    _product(1.0, hat, climb, source[3:])
    _skew(d[2], hat)
    _product(-stretch, hat, yielding, source[3:, 3:])


@inline
def _law(rest_length, resistance, d, moment, force, rise, hat, local):
    """Write the law of θ' and μ' by θ and μ into `local`, shape (6, 6)."""
    local[:] = 0.0
    for a in range(3):
        for b in range(3):
            for e in range(3):
                yields = 0.0
                for f in range(3):
                    yields += resistance[e, f] * d[f, b]
                local[a, 3 + b] += rest_length * d[e, a] * yields
    _skew(moment, hat)
    _product(1.0, local[:3, 3:], hat, local[:3, :3])
    _skew(force, hat)
    _product(1.0, hat, rise, local[3:, :3])


@inline
def _collocate(local, state, system, rates):
    """Add what the state makes of the rates at the three nodes, which depend on each other."""
    for i in range(3):
        _product(1.0, local[i], state, rates[6 * i : 6 * i + 6])
        for j in range(3):
            for a in range(6):
                for b in range(6):
                    system[6 * i + a, 6 * j + b] = -GAUSS[i, j] * local[i, a, b]
    for p in range(18):
        system[p, p] += 1.0
    _solve(system, rates)


@inline
def _solve(system, rates):
    """Solve for all columns in place: the pivots are 1 but for squares of short steps."""
    size, columns = rates.shape
    for p in range(size):
        for q in range(p + 1, size):
            factor = system[q, p] / system[p, p]
            if factor != 0.0:
                for b in range(p + 1, size):
                    system[q, b] -= factor * system[p, b]
                for c in range(columns):
                    rates[q, c] -= factor * rates[p, c]
    for p in range(size - 1, -1, -1):
        inverse = 1.0 / system[p, p]
        for c in range(columns):
            rates[p, c] *= inverse
        _lift(p, system, rates)


@inline
def _lift(p, system, rates):
    for q in range(p):
        factor = system[q, p]
        if factor != 0.0:
            for c in range(rates.shape[1]):
                rates[q, c] -= factor * rates[p, c]


@inline
def _move(i, state, rates, rise, climb, angle, moved):
    """Write ρ' of all columns at node i into `moved`."""
    for a in range(3):
        for c in range(state.shape[1]):
            angle[a, c] = state[a, c] + (
                GAUSS[i, 0] * rates[a, c]
                + GAUSS[i, 1] * rates[6 + a, c]
                + GAUSS[i, 2] * rates[12 + a, c]
            )
    _copy(climb, moved)
    _product(1.0, rise, angle, moved)


@inline
def _step(rates, state):
    """Add θ' and μ' of the three nodes to θ and μ."""
    for a in range(6):
        for c in range(state.shape[1]):
            state[a, c] += (
                WEIGHTS[0] * rates[a, c]
                + WEIGHTS[1] * rates[6 + a, c]
                + WEIGHTS[2] * rates[12 + a, c]
            )


@inline
def _add_work(weight, unit_loads, d, turned, moved, work):
    """Add the work of unit_loads (4, work) on the rates of strains at a node."""
    for j in range(work.shape[0]):
        for a in range(3):
            bend = 0.0
            for e in range(3):
                bend += unit_loads[e, j] * d[e, a]
            push = unit_loads[3, j] * d[2, a]
            for c in range(work.shape[1]):
                work[j, c] += weight * (bend * turned[a, c] + push * moved[a, c])


@inline
def _keep(step, marks, place, state, kept):
    """Keep ρ and θ at the places that are asked for behind a step."""
    for mark in range(len(marks)):
        if marks[mark] == step:
            _copy(place, kept[mark, :3])
            _copy(state, kept[mark, 3:])


@inline
def _moment_at_base(state, lever, weight, tipping, excess, unknown):
    """Write the μ at the base into `unknown` that leaves (θ × lever) × weight + tipping at the tip.

    Columns of the state are those of the unknowns, then all others.
    """
    along = lever[0] * weight[0] + lever[1] * weight[1] + lever[2] * weight[2]
    for c in range(state.shape[1]):
        across = state[0, c] * weight[0] + state[1, c] * weight[1] + state[2, c] * weight[2]
        for a in range(3):
            excess[a, c] = state[3 + a, c] - lever[a] * across + state[a, c] * along
    for a in range(3):
        for c in range(unknown.shape[1]):
            unknown[a, c] = tipping[a, c] - excess[a, 3 + c]
    _solve(excess[:, :3], unknown)


@inline
def _solved(values, unknown, out):
    """Write what columns come to, whose first three are those of the unknowns."""
    _copy(values[:, 3:], out)
    _product(1.0, values[:, :3], unknown, out)


@kernel
def respond(
    rest_length,
    stretch,
    resistance,
    thrust,
    directors,
    moment,
    force,
    turning,
    pushing,
    yielding,
    unit_loads,
    lever,
    weight,
    tipping,
    marks,
    moves,
    turns,
    works,
):
    """Moves ρ [m] and turns θ (mark, 3, column) of one rod behind steps `marks`, and works.

    Of each node (step, 3): η dZ and ζ dZ [m]; resistance K⁻¹ in the directors [1/(N m²)]
    (3, 3 more), 0 without loads; thrust 1/K0 [1/N]; d1, d2, d3 as rows (3, 3 more); moment m [N m]
    and force n [N] in the frame of the base (3 more). Columns are what changes there: turning
    δω| dZ in the directors, pushing δζ| dZ, yielding ν [N]. Works (work, column) are those of unit
    loads M and N (4, work more) on δω and δζ. The payload has a lever [m], a weight [N] and
    `tipping`, the change of its moment on the tip at the same directors [N m] (3, column).
    """
    steps, columns = rest_length.shape[0], turning.shape[3]
    every = columns + 3
    loaded = thrust.max() > 0.0
    state, place = np.zeros((6, every)), np.zeros((3, every))  # θ and μ, ρ
    for c in range(3):
        state[3 + c, c] = 1.0
    kept = np.zeros((len(marks), 6, every))
    work = np.zeros((unit_loads.shape[3], every))
    system, rates = np.zeros((18, 18)), np.zeros((18, every))  # θ' and μ' at the nodes
    local, hat, rise = np.zeros((3, 6, 6)), np.zeros((3, 3)), np.zeros((3, 3, 3))
    climb = np.zeros((3, 3, every))
    moved, angle = np.zeros((3, every)), np.zeros((3, every))
    for k in range(steps):
        for i in range(3):
            d, n = directors[k, i], force[k, i]
            node = rest_length[k, i], stretch[k, i], thrust[k, i]
            source = rates[6 * i : 6 * i + 6]
            _rates_of_places(node, d[2], n, rise[i])
            _sources(
                node, d, n, turning[k, i], pushing[k, i], yielding[k, i], hat, climb[i], source
            )
            _law(rest_length[k, i], resistance[k, i], d, moment[k, i], n, rise[i], hat, local[i])
        if loaded:
            _collocate(local, state, system, rates)
        for i in range(3):
            _move(i, state, rates, rise[i], climb[i], angle, moved)
            _add(WEIGHTS[i], moved, place)
            turned = rates[6 * i : 6 * i + 3]
            _add_work(WEIGHTS[i], unit_loads[k, i], directors[k, i], turned, moved, work)
        _step(rates, state)
        _keep(k + 1, marks, place, state, kept)
    unknown = np.zeros((3, columns))
    if loaded:
        _moment_at_base(state, lever, weight, tipping, angle, unknown)
    for mark in range(len(marks)):
        _solved(kept[mark, :3], unknown, moves[mark])
        _solved(kept[mark, 3:], unknown, turns[mark])
    _solved(work, unknown, works)
