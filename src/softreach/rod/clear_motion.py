"""Motions of an arm that touch nothing, certified between the clearances that are computed.

When activations change by δγ, every section stretches by z·δγ and turns by η U·δγ + (∂η·δγ) u per
length, and carries what lies beyond it. No point of the arm therefore moves farther than

    v·|δγ|,  vⱼ = ∫ |zⱼ| + (η |Uⱼ| + |∂ηⱼ| |u|) ℓ(Z) dZ,

with the longest arc ℓ from there to the tip, or to the point of a tool. Two configurations clear
the straight motion between them where their clearances add up to more; other motions are halved.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.kernels.rod.linear_response import WEIGHTS
from softreach.rod.clearance import ClearanceMap, Clearances
from softreach.rod.free import FreeRod
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import all_inputs
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.lazy import lazy

_STEPS = 24  # least steps of the integrals
_SAFETY = 1.02  # of their error
_ROUNDING = 1e-9  # of ranges


CLEAR, UNDECIDED, TOUCHES = 0, 1, 2
"""What is known of a motion: it touches nothing; some of it comes too near to tell; it touches."""


class Checked(NamedTuple):
    """Motions that were checked, and the configurations at which they were."""

    outcome: Index  # one of these, shape (n,)
    motion: Index  # that of each configuration, ascending, shape (k,)
    share: Array  # where on it, ascending in each motion, from 0 to 1, shape (k,)
    room: Array  # what `ClearMotions.room_at` says there [m], shape (k,)


@dataclass(frozen=True, eq=False)
class ClearMotions:
    """Which straight motions between activations keep the arm clear of everything.

    Parts of the arm count as near each other in `compute_clearance` once their gap is below half of
    their width, so that no step closes so much. Only where an arm bends to a radius below 1.5 of
    its own may they begin to count nearer, between two configurations that are checked.

    Raises:
        NotPossible: The arm has loads, or tendons that are driven by length or have guides.
    """

    clearance: ClearanceMap
    """Clearances of configurations."""
    margin: float = 0.0
    """Clearance to keep [m]."""

    def __post_init__(self) -> None:
        driving = self.clearance.tip_map.inputs.driving
        is_known = driving is None or driving.is_bundles
        if not is_known or not isinstance(self.clearance.tip_map.rod, FreeRod):
            raise NotPossible(
                "no motion is certified of an arm under loads, or with tendons that are driven by "
                "length or have guides: leave these out, or check samples by compute_clearance"
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
            NotPossible: The arm touches something there, or may.
        """
        gamma, box = self.box.check(np.atleast_2d(np.asarray(activations))), self.box
        if len(gamma) != 1 or (box.excess(gamma) > _ROUNDING).any():
            allowed = f"{box.bundles} numbers between {box.low.tolist()} and {box.high.tolist()}"
            raise InvalidInput(name, activations, allowed)
        value, which, _ = self.at(box.clip(gamma))
        if not value[0] > self.error:
            least = f"its clearance to {self.clearance.names[which[0]]} is {value[0]:.2g} m"
            raise NotPossible(f"at {name} the arm is not free: {least}, less the margin")
        return box.clip(gamma)[0]

    @lazy
    def _rates(self) -> tuple[Array, Array]:
        """v of a unit of each activation of the rod [m], with what the arm swells by, (bundle,).

        And the part of the gap at which parts of the arm begin to count that such a unit closes at
        most. A turn between two parts has the shorter arc to one of both as its lever.
        """
        rod: Any = self.clearance.tip_map.rod
        rule, arm, (low, high) = rod.rule, rod.arm, np.array(rod.arm.bounds).T
        edges = rule.edges(max(_STEPS, rod.steps))
        measure, z, eta, curvature = (x.reshape(-1, *x.shape[2:]) for x in rule.nodes(edges))
        weight = _SAFETY * measure * np.tile(WEIGHTS, len(edges) - 1)
        least, most = 1.0 + _least(z, low, high), 1.0 - _least(-z, low, high)
        bend, poisson = np.linalg.norm(curvature, axis=1), self.clearance._poisson
        sharpest = bend @ np.maximum(np.abs(low), np.abs(high))
        turn = (1.0 - _least(-eta, low, high))[:, None] * bend + np.abs(eta) * sharpest[:, None]
        turn, stretch = turn * weight[:, None], np.abs(z) * weight[:, None]
        along = np.cumsum(weight * most)
        point = self.clearance.whole.point
        tool = 0.0 if point is None else float(np.linalg.norm(point.offset))
        speed = (stretch + turn * (along[-1] - along + weight * most + tool)[:, None]).sum(axis=0)
        wide = arm.widest(arm.profile.station(np.repeat(0.5 * (edges[1:] + edges[:-1]), 3)))
        swells = poisson * np.abs(z) / least[:, None]
        speed += 2.0 * (swells * (wide * least**-poisson)[:, None]).max(axis=0)
        turned, levers = np.cumsum(turn, axis=0), np.cumsum(turn * along[:, None], axis=0)
        half = np.searchsorted(along, 0.5 * along)
        closing = along[:, None] * (turned - turned[half]) + 2.0 * levers[half] - levers
        closing += np.cumsum(stretch, axis=0)
        thin = np.minimum.accumulate(wide * most**-poisson)
        return speed, (closing / thin[:, None]).max(axis=0) + 3.0 * swells.max(axis=0)

    def largest(self, delta: Array) -> tuple[Array, Array]:
        """No point moves farther for changes of activation (n, bundles) [m], shape (n,).

        And no gap between parts of the arm closes by more of that at which they begin to count.
        """
        driving, inner = self.clearance.tip_map.inputs.driving, np.abs(delta)
        inner = inner if driving is None else inner @ np.abs(driving.gains).T
        return inner @ self._rates[0], inner @ self._rates[1]

    def check(self, begin: Array, end: Array, shortest: float, rooms: Any = None) -> Checked:
        """Check straight motions between activations (n, bundles), down to the shortest share.

        Rooms of both ends, (2, n) [m], spare their clearances.
        """
        delta = end - begin
        speed, closing = self.largest(delta)
        a, b = (self.room_at(begin), self.room_at(end)) if rooms is None else rooms
        outcome, which = np.full(len(begin), CLEAR), np.arange(len(begin))
        low, high = np.zeros(len(begin)), np.ones(len(begin))
        known = [(which, low, a), (which, high, b)]
        while len(which):
            with np.errstate(divide="ignore", invalid="ignore"):
                ways = [np.minimum(x / speed[which], 1.0 / closing[which]) for x in (a, b)]
            worst, is_clear = np.minimum(a, b), ways[0] + ways[1] > high - low
            unsure = (worst <= 0.0) | (~is_clear & (high - low <= shortest))
            states = [TOUCHES, UNDECIDED]
            state = np.select([~(worst > -self.error), unsure], states, CLEAR)
            np.maximum.at(outcome, which, state)
            left = ~is_clear & (outcome[which] == CLEAR)
            which, low, high, a, b = (x[left] for x in (which, low, high, a, b))
            middle = 0.5 * (low + high)
            room = self.room_at(begin[which] + middle[:, None] * delta[which])
            known.append((which, middle, room))
            which, low = np.concatenate([which, which]), np.concatenate([low, middle])
            high = np.concatenate([middle, high])
            a, b = np.concatenate([a, room]), np.concatenate([room, b])
        which, share, room = (np.concatenate(each) for each in zip(*known, strict=True))
        order = np.lexsort((share, which))
        return Checked(outcome, which[order], share[order], room[order])


def _least(factors: Array, low: Array, high: Array) -> Array:
    """Least values of factors (n, bundle) times activations within bounds, shape (n,)."""
    return np.minimum(factors * low, factors * high).sum(axis=1)


@lru_cache(maxsize=8)
def clear_motions(tip_map: TipMap, margin: float = 0.0) -> ClearMotions:
    """Clear motions of an arm in all of its inputs, kept for the next call."""
    return ClearMotions(ClearanceMap(all_inputs(tip_map)), margin)
