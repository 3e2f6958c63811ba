"""Tendons that disks hold at some places only: between such guides they are straight.

Between neighboring guides the arm counts as an arc of its mean strains: λ long, turned by ω. A
tendon from p in the section of one guide to q in that of the next is ℓ = |λ V(ω) e3 + exp(ω) q - p|
long, theory (24), and by virtual work a tension τ loads the arcs by -τ ∂ℓ/∂(λ, ω), theory (100).
The linear law has that load of the straight arm. What bending adds are four loads on each arc,
w = -Σ τ (∂ℓ - ∂ℓ of the straight arm), which the inner arm has as bundles behind all others.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import Tendon
from softreach.arm.actuators.actuator import Resultants
from softreach.arm.body import Body, UnseenActuator
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.tables import Works
from softreach.support.arrays import Array
from softreach.support.lazy import lazy

_TERMS = 13  # of series in θ²: exact to rounding to θ = π
_AXIS = np.array([0.0, 0.0, 1.0])
_APART = 1e-9  # of the length, below which two guides are one
_COMPLEX = 1e-30  # step of a derivative by complex numbers, which has no cancellation
_PLAIN_STEPS, _MOST_STEPS = 12, 40
_CONVERGED, _LONGEST_STEP = 1e-12, 0.5  # in rad


@dataclass(frozen=True, kw_only=True)
class ArcLoads(UnseenActuator):
    """N and M about the three directors, even along each arc between guides."""

    is_force: ClassVar[bool] = True
    edges: tuple[float, ...]  # Z of the ends of the arcs [m]

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        arc = np.searchsorted(self.edges, z, side="right") - 1
        arc[z == self.edges[-1]] -= 1
        loads = np.kron(arc[:, None] == np.arange(len(self.edges) - 1), np.eye(4))
        loads = loads.reshape(len(z), 4, self.bundles)
        return Resultants(loads[:, 0], loads[:, 1:])

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        return tuple(z for z in self.edges if 0.0 < z < profile.length)


def arc_loads(arm: Body) -> ArcLoads | None:
    """The loads of all arcs between guides of an arm; None without guides."""
    if not (held := [tendon.held_at(arm.length) for tendon in _guided(arm)]):
        return None
    places = np.concatenate(held)
    rigid = np.ravel([piece.span(arm.length) for piece in arm.rigid_pieces])
    inside = rigid[(rigid > places.min()) & (rigid < places.max())]
    ascending = np.unique(np.concatenate([places, inside]))
    edges = ascending[np.diff(ascending, prepend=-1.0) > _APART * arm.length]
    name = "guides"
    while name in [part.name for part in arm.actuators]:
        name += "'"
    count = 4 * (len(edges) - 1)
    return ArcLoads(
        name=name, bundles=count, activation_bounds=(0.0, 0.0), edges=tuple(edges.tolist())
    )


def has_guides(arm: Body) -> bool:
    """True if guides hold tendons of an arm."""
    return bool(_guided(arm))


def _guided(arm: Body) -> list[Tendon]:
    return [part for part in arm.actuators if isinstance(part, Tendon) and part.has_guides]


class _Chords(NamedTuple):
    """Straight pieces of tendons between guides."""

    tendon: NDArray[np.intp]  # Guided tendon of each, shape (chord,)
    arc: NDArray[np.intp]  # Arcs that each spans, (chord, place), base first; one too far is none
    start: Array  # In the section of the first guide [m], shape (chord, 3)
    end: Array  # In the section of the next [m], shape (chord, 3)


@dataclass(frozen=True, eq=False)
class Guides:
    """Guided tendons of an arm that has their arc loads as its last bundles."""

    arm: Body

    @lazy
    def columns(self) -> NDArray[np.intp]:
        """Bundles that are guided tendons."""
        kinds = [isinstance(x, Tendon) and x.has_guides for x in self.arm.bundle_actuators]
        return np.flatnonzero(kinds)

    @lazy
    def loads(self) -> NDArray[np.intp]:
        """Bundles that are loads of arcs."""
        return np.arange(self.arm.bundles - self.arm.actuators[-1].bundles, self.arm.bundles)

    @lazy
    def works(self) -> Works:
        """λ less its length at rest, and ω, of each arc: what unit loads of arcs do work on."""
        return Works(self.arm, self.loads)

    @lazy
    def _edges(self) -> Array:
        return np.array(cast(ArcLoads, self.arm.actuators[-1]).edges)

    @lazy
    def _chords(self) -> _Chords:
        count, parts, first = len(self._edges) - 1, list[_Chords](), 0
        for tendon in _guided(self.arm):
            held = tendon.held_at(self.arm.length)
            places = tendon.points_at(self.arm.profile, held)
            at = np.abs(self._edges - held[:, None]).argmin(axis=1)
            arc = at[:-1, None] + np.arange(count)
            arc = np.where(arc < at[1:, None], arc, count)
            for k in range(tendon.bundles):
                number = np.full(len(arc), first + k)
                parts.append(_Chords(number, arc, places[:-1, :, k], places[1:, :, k]))
            first += tendon.bundles
        tendons, arcs, starts, ends = map(np.concatenate, zip(*parts, strict=True))
        return _Chords(tendons, arcs[:, (arcs < count).any(axis=0)], starts, ends)

    def _arcs(self, works: Array) -> Array:
        """λ and ω of the arcs that each chord spans, shape (n, chord, place, 4)."""
        n, count = len(works), len(self._edges) - 1
        arcs = np.zeros((n, count + 1, 4))  # the last is none
        arcs[:, :count] = works.reshape(n, count, 4)
        arcs[:, :count, 0] += np.diff(self._edges)
        return arcs[:, self._chords.arc]

    @lazy
    def _onto(self) -> Array:
        """1 where the arc of a chord at a place is one of all, shape (chord, place, arc)."""
        return (self._chords.arc[..., None] == np.arange(len(self._edges) - 1)).astype(float)

    @lazy
    def _onto_tendons(self) -> Array:
        """The same for the tendon of each chord, shape (chord, place, tendon, arc)."""
        of_tendon = self._chords.tendon[:, None] == np.arange(len(self.columns))
        return np.einsum("ct,cja->cjta", of_tendon.astype(float), self._onto)

    def _on_arcs(self, values: Array) -> Array:
        """Sums over chords by tendon and arc, (n, chord, place, 4) to (n, tendon, 4 arc)."""
        n, tendons = len(values), len(self.columns)
        total = _summed(values, self._onto_tendons).reshape(n, 4, tendons, -1)
        return np.moveaxis(total, 1, 3).reshape(n, tendons, -1)

    @lazy
    def _softening(self) -> Array:
        """h/12 in bending of the arcs that each tendon spans, 0 in the rest, (tendon, 4 arc)."""
        on_arc = self._on_arcs(np.ones((1, *self._chords.arc.shape, 4)))[0]
        return on_arc * np.kron(np.diff(self._edges) / 12.0, [0.0, 1.0, 1.0, 0.0])

    def lengths(self, works: Array) -> Array:
        """ℓ of each guided tendon [m] by the works of arcs, shape (n, tendon)."""
        each = _pulled(self._arcs(works), self._chords)[0]
        first = np.searchsorted(self._chords.tendon, np.arange(len(self.columns)))
        return np.add.reduceat(each, first, axis=1)

    def slopes(self, works: Array) -> Array:
        """∂ℓ/∂(λ, ω) of all arcs, shape (n, tendon, 4 arc)."""
        return self._on_arcs(_pulled(self._arcs(works), self._chords)[1])

    @lazy
    def _straight(self) -> Array:
        return self.slopes(np.zeros((1, len(self.loads))))

    def on_arcs(self, works: Array, tension: Array) -> Array:
        """w, loads that bending adds to those of the linear law, shape (n, 4 arc)."""
        return -np.einsum("nt,nta->na", tension, self.slopes(works) - self._straight)

    def on_arcs_slopes(self, works: Array, tension: Array) -> tuple[Array, Array]:
        """∂w by the works, shape (n, 4 arc, 4 arc), and by the tensions, (n, 4 arc, tendon)."""
        arcs, (n, count) = self._arcs(works), (len(works), len(self._edges) - 1)
        by_works = np.zeros((n, 4, count, count, 4))
        for j in range(arcs.shape[2]):
            onto = np.einsum("cia,cb->ciab", self._onto, self._onto[:, j])
            for k in range(4):
                moved = arcs.astype(complex)
                moved[:, :, j, k] += 1j * _COMPLEX
                second = _pulled(moved, self._chords)[1].imag / _COMPLEX
                second *= tension[:, self._chords.tendon, None, None]
                by_works[..., k] -= _summed(second, onto).reshape(n, 4, count, count)
        by_works = np.moveaxis(by_works, 1, 2).reshape(n, 4 * count, 4 * count)
        return by_works, -np.swapaxes(self.slopes(works) - self._straight, 1, 2)

    def settled(self, inner: Array, works_of: Callable[[Array], Array]) -> Array:
        """Activations with loads of arcs at which these make the arcs, NaN where nothing settles.

        The first steps have the slopes of straight arcs, each by itself; what does not settle takes
        Newton's. A sample stays once it has settled, so that none depends on those beside it.
        `works_of` are the works of arcs at activations, NaN without an equilibrium.
        """
        slopes, start = self.works.slopes(inner), inner[:, self.loads]
        every = np.broadcast_to(slopes, (len(inner), *slopes.shape[1:]))[..., self.loads]
        own = np.einsum("nii->ni", every)
        gain = (inner[:, self.columns] @ self._softening) * own  # 1 where an arc buckles
        inner, left = inner.copy(), np.flatnonzero((gain < 1.0).all(axis=1))
        settled = np.zeros(len(inner), bool)
        for number in range(_MOST_STEPS):
            if number == _PLAIN_STEPS:
                left = np.flatnonzero((gain < 1.0).all(axis=1) & ~settled)
                inner[np.ix_(left, self.loads)] = start[left]
            if not len(left):
                continue
            works, tension = works_of(inner[left]), inner[left][:, self.columns]
            gap = self.on_arcs(works, tension) - inner[np.ix_(left, self.loads)]
            if number < _PLAIN_STEPS:
                step = gap / (1.0 - gain[left])
            else:
                matrix = self.on_arcs_slopes(works, tension)[0] @ every[left]
                step = np.linalg.solve(np.eye(len(self.loads)) - matrix, gap[..., None])[..., 0]
            strain = np.abs(step * own[left]).max(axis=1)
            limit = _LONGEST_STEP / np.maximum(strain, _LONGEST_STEP)
            inner[np.ix_(left, self.loads)] += limit[:, None] * step
            settled[left] = strain <= _CONVERGED
            left = left[strain > _CONVERGED]
        inner[~settled] = np.nan
        return inner


def _series(x: Array) -> list[Array]:
    """s_k = Σ (-x)ᵐ/(2m + k)! for k = 0 to 5: cos θ, sin θ/θ, (1 - cos θ)/θ², ... with x = θ²."""
    series: list[Array] = []
    for k in (4, 5):
        total = np.zeros_like(x)
        for m in reversed(range(_TERMS)):
            total = (-1) ** m / math.factorial(2 * m + k) + x * total
        series.append(total)
    for k in (3, 2, 1, 0):
        series.insert(0, 1.0 / math.factorial(k) - x * series[1])
    return series


def _summed(values: Array, onto: Array) -> Array:
    """Sums over chords and places, (n, chord, place, 4) to (n, 4, all that `onto` leads to)."""
    chords = onto.shape[0] * onto.shape[1]
    across = np.swapaxes(values.reshape(len(values), chords, 4), 1, 2)
    return np.matmul(across, onto.reshape(chords, -1))


def _dot(a: Array, b: Array) -> Array:
    return (a * b).sum(axis=-1)


def _carried(arc: Array, point: Array) -> Array:
    """λ V(ω) e3 + exp(ω) p, theory (24)."""
    length, turn = arc[..., :1], arc[..., 1:]
    s = [each[..., None] for each in _series(_dot(turn, turn))]
    return (
        s[0] * point
        + s[1] * (np.cross(turn, point) + length * _AXIS)
        + s[2] * (turn * _dot(turn, point)[..., None] + length * np.cross(turn, _AXIS))
        + s[3] * length * turn * turn[..., 2:]
    )


def _slopes_along(arc: Array, point: Array, along: Array) -> Array:
    """Derivatives of n·(λ V(ω) e3 + exp(ω) p) by λ and ω, with s_k' = -(s_(k+1) - k s_(k+2))/2."""
    length, turn = arc[..., 0], arc[..., 1:]
    s = _series(_dot(turn, turn))
    ahead, side = _dot(along, turn), np.cross(_AXIS, along)
    values = (
        _dot(along, point),
        _dot(turn, np.cross(point, along)) + length * along[..., 2],
        ahead * _dot(point, turn) + length * _dot(turn, side),
        length * ahead * turn[..., 2],
    )
    rates = np.sum([v * (k * s[k + 2] - s[k + 1]) / 2.0 for k, v in enumerate(values)], axis=0)
    s1, s2, s3 = (each[..., None] for each in s[1:4])
    by_turn = 2.0 * rates[..., None] * turn + s1 * np.cross(point, along)
    by_turn += s2 * (along * _dot(point, turn)[..., None] + point * ahead[..., None])
    by_turn += s2 * length[..., None] * side
    by_turn += s3 * length[..., None] * (along * turn[..., 2:] + _AXIS * ahead[..., None])
    by_length = s[1] * along[..., 2] + s[2] * _dot(turn, side) + s[3] * turn[..., 2] * ahead
    return np.concatenate([by_length[..., None], by_turn], axis=-1)


def _pulled(arcs: Array, chords: _Chords) -> tuple[Array, Array]:
    """ℓ of each chord, (n, chord), and ∂ℓ/∂(λ, ω) of its arcs, (n, chord, place, 4)."""
    places = range(arcs.shape[2])
    ends = [np.broadcast_to(chords.end, (*arcs.shape[:2], 3))]
    for j in reversed(places):  # from tip to base
        ends.insert(0, _carried(arcs[:, :, j], ends[0]))
    chord = ends[0] - chords.start
    length = np.sqrt(_dot(chord, chord))
    along, slopes = chord / length[..., None], np.empty_like(arcs)
    for j in places:
        slopes[:, :, j] = _slopes_along(arcs[:, :, j], ends[j + 1], along)
        back = -arcs[:, :, j]
        back[..., 0] = 0.0
        along = _carried(back, along)
    return length, slopes
