"""The postures of a loaded arm: it hangs first, and is then activated.

The posture of γ is the stable equilibrium that follows continuously from that of the arm at rest,
under all loads, when all activations are raised together to γ. Arms with a plane of symmetry lose
their stability in it at pitchforks, and lean to either side from there on. So branches are followed
on a twin of the arm with a tiny intrinsic twist, which decides between the sides, and every posture
is then polished on the arm itself.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.rod.activation_box import ActivationBox
from softreach.rod.free import FreeRod
from softreach.rod.loaded.flood import PARTS, Flood, grid_sizes
from softreach.rod.loaded.following import Followed, follow
from softreach.rod.loaded.ring import Ring
from softreach.rod.loaded.shooting import Equilibria, Shots, turn_between
from softreach.rod.tip_map import TipStatus
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    from softreach.rod.loaded.solver import Solver

__all__ = ["Postures"]

Array = NDArray[np.float64]

_TWIST = 1e-4  # [rad], of the twin over its length
_OF_TWIN = 1e-3  # [L], its tolerance, as postures are polished on the arm
_DOUBTFUL = 0.02  # margin below which what is found from the unloaded arm may not be its posture
_POLISHED = 0.5  # [rad], by which the arm may differ from its twin
_LOST = 0.05  # margin below which a branch that ends has lost its stability
_FIRST_PARTS = 0.02, 0.05, 0.1  # of lines, at which an arm that nothing holds at rest leans
_PULLED = 0.9  # cosine between the arm and its forces, from which on they pull it straight
_HANGING = 4.0  # [rad] of phase, from which on the unloaded arm tells nothing of one that hangs


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures of one arm, by lines from rest.

    Args:
        solver: That of the arm.
        box: Bounds of its activations.
        side: Sense of the twist that decides between mirror images, 1 or -1.
    """

    solver: Solver
    box: ActivationBox
    side: int = 1
    _nearness: ClassVar[float] = np.inf  # [rad], of what is found from guesses
    _least: ClassVar[float] = _DOUBTFUL  # margin of what is found from guesses

    @classmethod
    def of(cls, solver: Solver) -> Postures:
        """Those of an arm, by lines from rest."""
        arm = solver.tables.arm
        return Postures(solver, ActivationBox.between(arm.bounds, arm.bundle_names))

    @lazy
    def twin(self) -> Solver:
        """The solver of the twin."""
        tables = self.solver.tables
        twist = self.side * _TWIST / tables.arm.length
        return replace(self.solver, tables=replace(tables, twist=twist), tol=_OF_TWIN)

    @lazy
    def rest_activation(self) -> Array:
        """0, or the bound next to it, shape (1, bundles)."""
        return np.clip(0.0, self.box.low, self.box.high)[None]

    @lazy
    def rest(self) -> Shots:
        """The twin at rest, as it was hung; not found where nothing holds it there."""
        return self._hung(self.rest_activation).shots

    @property
    def is_held_at_rest(self) -> bool:
        """True if the arm has a stable posture at rest."""
        return bool(self.rest.is_found[0])

    def _hung(self, gamma: Array) -> Followed:
        """Loads put on the twin at fixed activations."""
        start = self.twin.careful(gamma, None, np.zeros(1))
        return follow(self.twin, gamma, gamma, start, hangs=False)

    @lazy
    def _ring(self) -> Ring | None:
        return Ring.at_rest(self.solver, self.rest_activation)

    def find(self, gamma: Array) -> Equilibria:
        """Postures at activations (n, bundles), on the calling thread."""
        equilibria = self.solver.empty(len(gamma))
        self.direct(gamma, slice(None), equilibria)
        rows = np.flatnonzero(equilibria.status != TipStatus.STABLE)
        if len(rows):
            self.by_line(gamma, rows, equilibria)
        return equilibria

    def direct(self, gamma: Array, rows: slice, equilibria: Equilibria) -> None:
        """Newton's method from where the posture may be, at some rows; UNDECIDED where it fails."""
        if not self.is_held_at_rest:
            return
        at = np.arange(len(gamma))[rows]
        order, guesses = self._guesses(gamma[at])
        at = at[order]
        shots = self.solver.quick(gamma[at], guesses)
        good = shots.is_found & (shots.margin > self._least)
        if guesses is not None:
            good &= turn_between(shots.frame, guesses) < self._nearness
        self.solver.put(gamma, at, shots._replace(is_found=good), equilibria)

    def _guesses(self, gamma: Array) -> tuple[NDArray[np.intp], Array | None]:
        """Rows, and frames of the unloaded arm there, or of one that hangs along it."""
        tables, every = self.solver.tables, np.arange(len(gamma))
        if tables.phase.entire <= _HANGING or tables.axes[0, 2] < _PULLED:
            return every, None
        stations = np.append(tables.nodes[::-1], tables.arm.length)
        directors = self._unloaded.frames(gamma, stations).directors[:, ::-1]
        along = directors[:, :, 2]
        if tables.one_direction:
            return every, along.reshape(len(gamma), -1)
        across = np.broadcast_to(tables.axes[1], along.shape)
        across = across - (along * across).sum(axis=2, keepdims=True) * along
        size = np.linalg.norm(across, axis=2, keepdims=True)
        across = np.where(size > 0.1, across / np.maximum(size, 0.1), directors[:, :, 0])
        return every, np.concatenate([along, across], axis=2).reshape(len(gamma), -1)

    @lazy
    def _unloaded(self) -> FreeRod:
        return FreeRod(self.solver.tables.arm, 1e-4)

    def by_line(self, gamma: Array, rows: NDArray[np.intp], equilibria: Equilibria) -> None:
        """Postures at some rows along the straight lines from rest."""
        followed = self.followed(gamma[rows])
        self._polish(gamma, rows, followed, equilibria)
        snaps = followed.has_ended & (followed.shots.margin < _LOST)
        gone = equilibria.status[rows] == TipStatus.UNDECIDED
        equilibria.status[rows[gone & snaps]] = TipStatus.SNAPS
        if not self.is_held_at_rest and gone.any():
            self._unstable(gamma, rows[gone], equilibria)

    def _polish(
        self, gamma: Array, rows: NDArray[np.intp], followed: Followed, equilibria: Equilibria
    ) -> None:
        """Put down the postures of the arm beside those of its twin."""
        shots = polished(self.solver, gamma[rows], followed.shots, _POLISHED)
        self.solver.put(gamma, rows, shots, equilibria)

    def _unstable(self, gamma: Array, rows: NDArray[np.intp], equilibria: Equilibria) -> None:
        """Equilibria of an arm that nothing holds at rest, and that no activation leans."""
        shots = self.solver.careful(gamma[rows], None)
        at_rest = ~np.any(gamma[rows] != self.rest_activation, axis=1)
        good = shots.is_found & ((shots.margin <= 0.0) | at_rest)  # no stable ones of others
        self.solver.put(gamma, rows, shots._replace(is_found=good), equilibria)

    def followed(self, gamma: Array) -> Followed:
        """Branches of the twin along lines from rest; where nothing holds it, from beside it."""
        if self.is_held_at_rest:
            begin = np.repeat(self.rest_activation, len(gamma), axis=0)
            start = self.rest.of(np.zeros(len(gamma), np.intp))
        else:
            begin, start = self._leaning(gamma)
        return follow(self.twin, begin, gamma, start)

    def _leaning(self, gamma: Array) -> tuple[Array, Shots]:
        """Places on lines where the twin leans that nothing holds at rest, and how it does."""
        rest, ring = self.rest_activation, self._ring
        begin = rest + _FIRST_PARTS[0] * (gamma - rest)
        if ring is None:
            return begin, self._hung(begin).shots
        start = ring.near(self.twin, begin)
        for part in _FIRST_PARTS[1:]:
            left = np.flatnonzero(~start.is_found)
            begin[left] = rest + part * (gamma[left] - rest)
            start.put(left, ring.near(self.twin, begin[left]))
        return begin, start

    def continued_from(self, gamma: Array, frame: Array) -> ContinuedPostures:
        """Postures of an arm that is in one of some at activations (k, bundles)."""
        return ContinuedPostures(
            self.solver, self.box, self.side, origin=self, at=gamma, frame=frame
        )

    @lazy
    def mirrored(self) -> Postures:
        """Those of the twin with the other twist."""
        return Postures(self.solver, self.box, -self.side)

    def with_flood(self) -> Postures:
        """The same, with starts from a grid over the box where that is worth it."""
        sizes = grid_sizes(self.box)
        if sizes is None or not self.is_held_at_rest:
            return self
        flood = Flood.over(self.twin, self.box, sizes, self.rest_activation[0], self.rest)
        return FloodedPostures(self.solver, self.box, self.side, flood=flood)


def polished(solver: Solver, gamma: Array, on_twin: Shots, within: float) -> Shots:
    """Stable equilibria of an arm beside those of its twin; found where they are so near [rad]."""
    shots = solver.careful(gamma, on_twin.frame)
    good = on_twin.is_found & shots.is_found & (shots.margin > 0.0)
    return shots._replace(is_found=good & (turn_between(shots.frame, on_twin.frame) < within))


@dataclass(frozen=True, eq=False)
class FloodedPostures(Postures):
    """The same with starts from a flooded grid."""

    flood: Flood = field(kw_only=True)
    _nearness: ClassVar[float] = 0.15
    _least: ClassVar[float] = 0.0

    def _guesses(self, gamma: Array) -> tuple[NDArray[np.intp], Array | None]:
        """Those of uncut cells, rough ones last: lanes wait for the slowest among them."""
        frames, rough = self.flood.at(gamma)
        order = np.argsort(rough, kind="stable")[: np.isfinite(rough).sum()]
        return order, frames[order]

    def followed(self, gamma: Array) -> Followed:
        """In uncut cells from the nearest node, else from where the lines meet the first cut."""
        uncut = self.flood.is_uncut(gamma)
        begin, start = self.flood.nearest(gamma)
        slopes = self.flood.at(gamma)[0] - start.frame
        cut = np.flatnonzero(~uncut)
        if len(cut):
            begin[cut], of_cut, slopes[cut] = self._before_cuts(gamma[cut])
            start.put(cut, of_cut)
        followed = follow(self.twin, begin, gamma, start, slopes)
        lost = np.flatnonzero(uncut & ~followed.shots.is_found)
        if len(lost):
            by_line = super().followed(gamma[lost])
            followed.has_ended[lost] = by_line.has_ended
            followed.shots.put(lost, by_line.shots)
        return followed

    def _before_cuts(self, gamma: Array) -> tuple[Array, Shots, Array]:
        """Where lines meet their first cut, else rest; postures there, and changes of frames."""
        rest, clear = self.rest_activation, self.flood.clear(self.rest_activation, gamma)[:, None]
        way = gamma - rest
        begin = rest + clear * way
        guesses = self.flood.at(begin)[0]
        before = self.flood.at(begin - np.minimum(clear, 1 / PARTS) * way)[0]
        slopes = (1.0 - clear) * PARTS * (guesses - before)
        start = self.twin.careful(begin, guesses)
        lost = ~start.is_found | (start.margin <= 0.0)
        lost = np.flatnonzero(lost | (turn_between(start.frame, guesses) > self._nearness))
        start.put(lost, self.rest.of(np.zeros(len(lost), np.intp)))
        begin[lost], slopes[lost] = rest, 0.0
        return begin, start, slopes


@dataclass(frozen=True, eq=False)
class ContinuedPostures(Postures):
    """The same along straight lines from the nearest posture that the arm may be in."""

    origin: Postures = field(kw_only=True)
    at: Array = field(kw_only=True)
    """Activations, shape (k, bundles)."""
    frame: Array = field(kw_only=True)
    """How the arm sees the world there, shape (k, component)."""

    def continued_from(self, gamma: Array, frame: Array) -> ContinuedPostures:
        return replace(self, at=gamma, frame=frame)

    def direct(self, gamma: Array, rows: slice, equilibria: Equilibria) -> None:
        """Nothing: all are followed."""

    @lazy
    def rest_activation(self) -> Array:
        return self.at

    def followed(self, gamma: Array) -> Followed:
        """Branches of the twin from the nearest of the postures that it has."""
        from scipy.spatial import KDTree

        twin, rest, good = self._begun
        some, scales = np.flatnonzero(good | ~good.any()), self.box.scales
        near = some[np.atleast_1d(KDTree(self.at[some] / scales).query(gamma / scales)[1])]
        return follow(twin, self.at[near], gamma, rest.of(near))

    @lazy
    def _begun(self) -> tuple[Solver, Shots, NDArray[np.bool_]]:
        """The twin that has most of these postures, on it, and which; of two that of the side."""
        sides = []
        for postures in (self.origin, self.origin.mirrored):
            rest = postures.twin.careful(self.at, self.frame)
            near = turn_between(rest.frame, self.frame) < _POLISHED
            sides.append((postures.twin, rest, rest.is_found & (rest.margin > 0.0) & near))
            if sides[-1][2].all():
                break
        return max(sides, key=lambda side: side[2].sum())

    @lazy
    def twin(self) -> Solver:
        return self._begun[0]

    @lazy
    def rest(self) -> Shots:
        return self._begun[1]

    @property
    def is_held_at_rest(self) -> bool:
        return True
