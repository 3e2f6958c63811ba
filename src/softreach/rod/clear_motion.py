"""Motions of an arm that touch nothing, certified between the clearances that are computed.

When activations change by δγ, every section stretches by z·δγ and turns by η U·δγ + (∂η·δγ) u per
length, and carries what lies beyond it. No point of the arm therefore moves farther than

    v(δγ) = ∫ |z·δγ| + (η |U·δγ| + |∂η·δγ| |u|) ℓ(Z) dZ,

with the longest arc ℓ from there to the tip, or to the point of a tool. This is a norm: a clearance
c clears all activations with v(δγ) < c. Two configurations clear the straight motion between them
where their clearances add up to more than v; other motions are halved until all parts are clear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.kernels.rod.linear_response import WEIGHTS
from softreach.rod.clearance import ClearanceMap, Clearances
from softreach.rod.free import FreeRod
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import all_inputs, as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index, joined
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.lazy import lazy

_STEPS = 24  # least steps of the integrals
_SAFETY = 1.02  # of their error
_ROUNDING = 1e-9  # of ranges
_BLOCK = 1 << 14  # motions at once


class Motion(IntEnum):
    """What is known of a straight motion."""

    CLEAR = 0
    """No configuration on it touches anything."""
    TOUCHES = 1
    """One on it does."""
    UNDECIDED = 2
    """Some come too near to tell."""


class Checked(NamedTuple):
    """Motions that were checked, and their configurations that prove them clear."""

    outcome: Index  # `Motion`, shape (n,)
    motion: Index  # that of each configuration, ascending, shape (k,)
    share: Array  # where on it, ascending in each motion, from 0 to 1, shape (k,)
    room: Array  # what `ClearMotions.room_at` says there [m], shape (k,)


class _Rates(NamedTuple):
    """How an arm moves at nodes along it, by the activations of its rod."""

    weight: Array  # of the integral over Z [m], shape (node,)
    extension: Array  # z [-], shape (node, bundle)
    turn: Array  # η U [rad/m], shape (node, 3, bundle)
    bent: Array  # |∂η| |u| [rad/m], shape (node, bundle)
    arc: Array  # longest arc that a node stands for [m], shape (node,)
    swelling: Array  # largest change of the radius by extension, over it [-], shape (node,)
    radius: Array  # least and largest radius [m], shape (2, node)


@dataclass(frozen=True, eq=False)
class ClearMotions:
    """Which straight motions between activations keep the arm clear of everything.

    Parts of an arm count as near each other as in `compute_clearance`, once their gap is below half
    of their width. Where an arm bends to a radius below 1.5 of its own, they may begin to count
    between two configurations that are checked.

    Raises:
        NotPossible: The arm has loads, or tendons that are driven by length.
    """

    clearance: ClearanceMap
    """Clearances of configurations."""
    margin: float = 0.0
    """Clearance to keep [m]."""

    def __post_init__(self) -> None:
        known = self.clearance.tip_map
        driving = known.inputs.driving
        if not isinstance(known.rod, FreeRod):
            raise NotPossible("free motions are known of arms without loads: leave the loads out")
        if driving is not None and not driving.is_bundles:
            raise NotPossible(
                "free motions are not known of tendons that are driven by length or have guides"
            )

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.clearance.whole.box

    @property
    def error(self) -> float:
        """How much smaller a clearance may be than it is said to be [m]."""
        return self.clearance.contact_error

    def at(self, gamma: Array) -> Clearances:
        """Clearances at activations (n, bundles), less the margin."""
        found = self.clearance.of(gamma)
        return found._replace(value=found.value - self.margin)

    def room_at(self, gamma: Array) -> Array:
        """What is left of them at least [m], shape (n,); above -`error` if nothing is touched."""
        return self.at(gamma).value - self.error

    def free_at(self, name: str, activations: ArrayLike) -> Array:
        """One activation (bundles,) that is within the bounds and free.

        Raises:
            InvalidInput: It is out of bounds, not finite or of another shape.
            NotPossible: The arm touches something there, or comes too near to tell.
        """
        box = self.box
        gamma = box.check(np.atleast_2d(np.asarray(activations)))
        if len(gamma) != 1 or (box.excess(gamma) > _ROUNDING).any():
            ends = " and ".join(str(each.tolist()) for each in (box.low, box.high))
            raise InvalidInput(name, activations, f"{box.bundles} numbers between {ends}")
        gamma = box.clip(gamma)
        found = self.at(gamma)
        if not found.value[0] > self.error:
            what = self.clearance.names[found.which[0]] if found.which[0] >= 0 else "itself"
            near = f"touches {what}" if found.value[0] < 0.0 else f"is too near to {what} to tell"
            raise NotPossible(f"at {name} the arm {near}: its clearance is {found.value[0]:.3g} m")
        return gamma[0]

    @lazy
    def _rates(self) -> _Rates:
        rod: Any = self.clearance.tip_map.rod
        rule, arm, (low, high) = rod.rule, rod.arm, np.array(rod.arm.bounds).T
        edges = rule.edges(max(_STEPS, self.clearance.tip_map.steps))
        measure, z, eta, curvature = rule.nodes(edges)
        bundles, weight = z.shape[-1], (measure * WEIGHTS).ravel()
        z, eta = z.reshape(-1, bundles), eta.reshape(-1, bundles)
        curvature = curvature.reshape(-1, 3, bundles)
        least, most = 1.0 + _least(z, low, high), 1.0 - _least(-z, low, high)
        bend = np.linalg.norm(curvature, axis=1) @ np.maximum(np.abs(low), np.abs(high))
        wide, poisson = arm.widest(self._stations(edges)), self.clearance._poisson
        return _Rates(
            weight=_SAFETY * weight,
            extension=z,
            turn=curvature * (1.0 - _least(-eta, low, high))[:, None, None],
            bent=np.abs(eta) * bend[:, None],
            arc=_SAFETY * weight * most,
            swelling=poisson / least,
            radius=np.stack([wide * most**-poisson / _SAFETY, wide * least**-poisson]),
        )

    def _stations(self, edges: Array) -> Array:
        middles = 0.5 * (edges[1:] + edges[:-1])
        return np.repeat(self.clearance.arm.profile.station(middles), 3)

    @lazy
    def _tool(self) -> float:
        """Length of the line from the tip to the point of a tool [m]."""
        tip_map, rest = self.clearance.tip_map, self.box.low[None]
        if not len(tool := self.clearance._tools(rest)):
            return 0.0
        end = tip_map.frames(rest, [tip_map.length]).position[0, -1]
        return float(np.linalg.norm(tool[0] - end))

    @lazy
    def _lever(self) -> Array:
        """ℓ, the longest arc from each node to the tip and on to the point of a tool [m]."""
        return np.cumsum(self._rates.arc[::-1])[::-1] + self._tool

    def _strained(self, delta: Array) -> tuple[Array, Array]:
        """How changes of the rod's activations stretch and turn each node, (n, node) [-, rad/m]."""
        rates = self._rates
        turn = (delta @ rates.turn.reshape(-1, delta.shape[1]).T).reshape(len(delta), -1, 3)
        turned = np.linalg.norm(turn, axis=2) + np.abs(delta) @ rates.bent.T
        return np.abs(delta @ rates.extension.T), turned

    def _speed_of(self, delta: Array) -> Array:
        """v of changes of the rod's activations (n, bundle) [m], with what the arm swells by."""
        rates, (stretch, turn) = self._rates, self._strained(delta)
        moved = (stretch + turn * self._lever) @ rates.weight
        return moved + 2.0 * (stretch * rates.swelling * rates.radius[1]).max(axis=1)

    def _approach_of(self, delta: Array) -> Array:
        """Part of the gap at which two parts of the arm begin to count that changes may close.

        A turn between them has the shorter arc to one of both as its lever at most. What they swell
        by counts up to the distance at which they begin to.
        """
        rates, (stretch, turn) = self._rates, self._strained(delta)
        first, middle, last, half_wide = self._pairs
        arc = np.append(0.0, np.cumsum(rates.arc))
        along = (stretch, turn, turn * 0.5 * (arc[1:] + arc[:-1]))
        sums = (np.pad(np.cumsum(x * rates.weight, axis=1), ((0, 0), (1, 0))) for x in along)
        stretched, turned, levered = sums
        near = stretched[:, last] - stretched[:, first]
        near += levered[:, middle] - levered[:, first]
        near -= arc[first] * (turned[:, middle] - turned[:, first])
        near += arc[last] * (turned[:, last] - turned[:, middle])
        near -= levered[:, last] - levered[:, middle]
        swells = (stretch * rates.swelling).max(axis=1)
        return (near / half_wide).max(axis=1) + 3.0 * swells

    @lazy
    def _pairs(self) -> tuple[Index, Index, Index, Array]:
        """Pairs of parts: first nodes, those in the middle, last ones, and half of their width."""
        rates = self._rates
        parts = np.linspace(0, len(rates.arc), min(len(rates.arc), _STEPS) + 1).astype(int)
        a, b = np.triu_indices(len(parts) - 1)
        arc, first, last = np.append(0.0, np.cumsum(rates.arc)), parts[a], parts[b + 1]
        thin = np.minimum.reduceat(rates.radius[0], parts[:-1])
        middle = np.searchsorted(arc, 0.5 * (arc[first] + arc[last]))
        return first, middle, last, 0.5 * (thin[a] + thin[b])

    def speeds(self, delta: Array) -> tuple[Array, Array]:
        """How far points move at most for changes of activation (n, bundles) [m], shape (n,).

        And what they may close of the gap at which two parts of the arm begin to count, (n,).
        """
        driving = self.clearance.tip_map.inputs.driving
        if driving is None or driving.is_affine:
            inner = delta if driving is None else delta @ driving.gains.T
            return self._speed_of(inner), self._approach_of(inner)
        inner, unit = np.abs(delta) @ np.abs(driving.gains).T, np.eye(len(driving.gains))
        return inner @ self._speed_of(unit), inner @ self._approach_of(unit)

    def shares(self, room: Array, speeds: tuple[Array, Array]) -> Array:
        """How far along changes with such `speeds` the arm stays clear, from rooms [m]; (n,)."""
        with np.errstate(divide="ignore"):
            clear, own = room / speeds[0], 1.0 / speeds[1]
        own = own if self.clearance.itself else np.inf
        return np.where(room > 0.0, np.minimum(clear, own), 0.0)

    def check(
        self,
        begin: Array,
        end: Array,
        shortest: float,
        rooms: Sequence[Array] | None = None,
        speeds: tuple[Array, Array] | None = None,
    ) -> Checked:
        """Check straight motions between activations (n, bundles), down to parts of a share.

        Args:
            begin: Where they begin, shape (n, bundles).
            end: Where they end.
            shortest: The least share that a motion is cut into.
            rooms: `room_at` of both ends, if they are known.
            speeds: `speeds` of the motions, if they are known, or of one that all of them are.
        """
        if rooms is None:
            rooms = self.room_at(begin), self.room_at(end)
        parts = [Checked(*np.empty((2, 0), np.int64), *np.empty((2, 0)))]
        for block in parallel.blocks(len(begin), _BLOCK):
            ends = begin[block], end[block]
            own = self.speeds(ends[1] - ends[0]) if speeds is None else speeds
            own = tuple(np.broadcast_to(x, len(ends[0])) for x in own)
            found = self._check(*ends, *(x[block] for x in rooms), own, shortest)
            parts.append(found._replace(motion=found.motion + block.start))
        return joined(parts)

    def _check(
        self, begin: Array, end: Array, a: Array, b: Array, speeds: Any, shortest: float
    ) -> Checked:
        n, delta = len(begin), end - begin
        outcome = np.full(n, Motion.CLEAR)
        known = [(np.arange(n), np.zeros(n), a), (np.arange(n), np.ones(n), b)]
        which, low, high = np.arange(n), np.zeros(n), np.ones(n)
        while True:
            self._judge(outcome, which, np.minimum(a, b))
            own: Any = tuple(x[which] for x in speeds)
            clear = self.shares(a, own) + self.shares(b, own) > high - low
            left = ~clear & (outcome[which] == Motion.CLEAR)
            short = left & (high - low <= shortest)
            outcome[which[short]] = Motion.UNDECIDED
            left &= ~short
            if not left.any():
                break
            which, low, high, a, b = (x[left] for x in (which, low, high, a, b))
            middle = 0.5 * (low + high)
            room = self.room_at(begin[which] + middle[:, None] * delta[which])
            known.append((which, middle, room))
            which = np.concatenate([which, which])
            low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
            a, b = np.concatenate([a, room]), np.concatenate([room, b])
        which, share, room = (np.concatenate(each) for each in zip(*known, strict=True))
        order = np.lexsort((share, which))
        return Checked(outcome, which[order], share[order], room[order])

    def _judge(self, outcome: Index, which: Index, room: Array) -> None:
        """Mark motions with a configuration that touches, or that may touch."""
        near = outcome[which] == Motion.CLEAR
        outcome[which[near & ~(room > 0.0)]] = Motion.UNDECIDED
        outcome[which[~(room > -self.error)]] = Motion.TOUCHES


def _least(factors: Array, low: Array, high: Array) -> Array:
    """Least values of factors (n, bundle) times activations within bounds, shape (n,)."""
    return np.minimum(factors * low, factors * high).sum(axis=1)


def clear_motions(arm: Manipulator | TipMap, margin: float = 0.0) -> ClearMotions:
    """Clear motions of an arm in all of its inputs, kept for the next call."""
    return _of_map(all_inputs(as_tip_map(arm)), margin)


@lru_cache(maxsize=8)
def _of_map(tip_map: TipMap, margin: float) -> ClearMotions:
    return ClearMotions(ClearanceMap(tip_map), margin)
