"""The postures of a loaded arm: it hangs first, and is then activated.

The posture of γ is the stable equilibrium that follows continuously from that of the arm at rest,
under all loads, when all activations are raised together to γ. Arms with a plane of symmetry lose
their stability in it at pitchforks, and lean to either side from there on. So branches are followed
on a twin of the arm with a tiny intrinsic twist, which decides between the sides, and every posture
is then polished on the arm itself.

A tall column has no stable posture at rest but a ring of leaning ones, all around the direction of
its loads. Activations, however small, lean it to one side of the ring.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from softreach.geometry.sphere_maps import is_axisymmetric, pole_rings
from softreach.kernels.loaded.unloaded_frames import LANES
from softreach.rod.free import FreeRod
from softreach.rod.inputs import ActivationBox
from softreach.rod.loaded.flood import CUT, PARTS, Flood, Followed, follow
from softreach.rod.loaded.solver import Equilibria, Solver, turn_between
from softreach.rod.loaded.tables import SHOT_AT_ONCE
from softreach.rod.tip_map import BLOCK, TipStatus
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy

NEUTRAL = 1e-5  # what tolerances leave of the margin of a ring, which is 0
SYMMETRIC = 1e-6  # [rad], of the directions that the base of an axisymmetric arm would have to see
_AT_ONCE, _BY_LINE = BLOCK // 8, 32 * LANES  # samples per task
_NODES = {1: 33, 2: 33, 3: 17}  # of the grid for each free bundle: at most a few thousand postures
_TWIST = 1e-4  # [rad], of the twin over its length
_OF_TWIN = 1e-3  # [L], its tolerance, as postures are polished on the arm
_DOUBTFUL = 0.02  # margin below which what is found from the unloaded arm may not be its posture
_NEAR = 0.15  # [rad], of what the flood guesses
_BESIDE = 0.03  # [rad], by which the arm differs from its twin but near a pitchfork
_POLISHED = 0.5  # [rad], by which the arm may differ from its twin
_LOST = 0.05  # margin below which a branch that ends has lost its stability
_FIRST_PARTS = 0.02, 0.05, 0.1  # of lines, at which an arm that nothing holds at rest leans
_PULLED = 0.9  # cosine between the arm and its forces, from which on they pull it straight
_HANGING = 4.0  # [rad] of phase, from which on the unloaded arm is no guess for one that hangs
_TURNS = np.pi / 16 * np.array([0, *(sign * k for k in range(1, 17) for sign in (1, -1))])
"""Azimuths beside the one to which the unloaded arm bends, at which the arm is looked for."""
_STRAIGHT = 1e-8  # [L], aside, of an arm that no activation leans to any side


@dataclass(frozen=True, eq=False)
class Postures:
    """Postures of one arm, by lines from rest."""

    solver: Solver
    side: int = 1
    """Sense of the twist that decides between mirror images, 1 or -1."""
    flood: Flood | None = None
    """Starts on a grid over the box of activations; None for those on lines alone."""

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of the activations."""
        arm = self.solver.tables.arm
        return ActivationBox.between(arm.bounds, arm.bundle_names)

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
    def rest(self) -> Equilibria:
        """The twin at rest, as it was hung; not found where nothing holds it there."""
        return self._hung(self.rest_activation)

    @property
    def is_held_at_rest(self) -> bool:
        """True if the arm has a stable posture at rest."""
        return bool(self.rest.is_stable[0])

    def _hung(self, gamma: Array) -> Equilibria:
        """The twin after its loads are put on at fixed activations."""
        start = self.twin.search(gamma, None, np.zeros(1))
        return follow(self.twin, gamma, gamma, start, hangs=False).last

    def find(self, gamma: Array, *, by_lines: bool = True) -> Equilibria:
        """Postures at activations (n, bundles); where not found at once, by lines if wanted.

        What is to be searched again is gathered, so that kernels get whole blocks.
        """
        equilibria = self.solver.empty(len(gamma))
        blocks = parallel.blocks(len(gamma), _AT_ONCE)
        parallel.run(partial(self.direct, gamma, b, equilibria) for b in blocks)
        rows = np.flatnonzero(~equilibria.is_stable & by_lines)
        blocks = parallel.blocks(len(rows), _BY_LINE)
        parallel.run(partial(self.by_line, gamma, rows[b], equilibria) for b in blocks)
        return equilibria

    def direct(self, gamma: Array, rows: slice, equilibria: Equilibria) -> None:
        """Newton's method from where the posture may be, at some rows; UNDECIDED where it fails."""
        if not self.is_held_at_rest:
            return
        at = np.arange(len(gamma))[rows]
        order, guesses = self._guesses(gamma[at])
        at = at[order]
        new = self.solver.search(gamma[at], guesses)
        good = new.margin > (_DOUBTFUL if self.flood is None else 0.0)
        if self.flood is not None and guesses is not None:
            good &= turn_between(new.frame, guesses) < _NEAR
        self.solver.put(gamma, at, new.only(good), equilibria)

    def _guesses(self, gamma: Array) -> tuple[Index, Array | None]:
        """Rows, and frames there: of the flood, of the unloaded arm, or of one that hangs along."""
        if self.flood is not None:  # uncut cells, rough ones last: lanes wait for the slowest
            frames, rough = self.flood.at(gamma)
            order = np.argsort(rough, kind="stable")[: (rough < CUT).sum()]
            return order, frames[order]
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

    def by_line(self, gamma: Array, rows: Index, equilibria: Equilibria) -> None:
        """Postures at some rows along the straight lines from rest."""
        followed = self.followed(gamma[rows])
        new = polished(self.solver, gamma[rows], followed.last, _POLISHED)
        self.solver.put(gamma, rows, new, equilibria)
        snaps = followed.has_ended & (followed.last.margin < _LOST)
        gone = equilibria.status[rows] == TipStatus.UNDECIDED
        equilibria.status[rows[gone & snaps]] = TipStatus.SNAPS
        if not self.is_held_at_rest and gone.any():  # unstable ones, which no activation leans
            left, new = rows[gone], self.solver.search(gamma[rows[gone]], None)
            at_rest = (gamma[left] == self.rest_activation).all(axis=1)
            self.solver.put(gamma, left, new.only(~new.is_stable | at_rest), equilibria)

    def followed(self, gamma: Array) -> Followed:
        """Branches of the twin from the nearest node of the flood, or along lines from rest.

        In cut cells they begin where the lines from rest meet the first cut.
        """
        if (flood := self.flood) is None:
            return self._from_rest(gamma)
        uncut = flood.is_uncut(gamma)
        begin, start = flood.nearest(gamma)
        slopes = flood.at(gamma)[0] - start.frame
        cut = np.flatnonzero(~uncut)
        if len(cut):
            begin[cut], of_cut, slopes[cut] = self._before_cuts(flood, gamma[cut])
            start.put(cut, of_cut)
        followed = follow(self.twin, begin, gamma, start, slopes)
        lost = np.flatnonzero(uncut & ~followed.last.is_found)
        if len(lost):
            by_line = self._from_rest(gamma[lost])
            followed.has_ended[lost] = by_line.has_ended
            followed.last.put(lost, by_line.last)
        return followed

    def _from_rest(self, gamma: Array) -> Followed:
        """Along lines from rest; where nothing holds the twin there, from where it leans beside."""
        rest = self.rest_activation
        if self.is_held_at_rest:
            begin = np.repeat(rest, len(gamma), axis=0)
            return follow(self.twin, begin, gamma, self.rest.of(np.zeros(len(gamma), int)))
        begin = rest + _FIRST_PARTS[0] * (gamma - rest)
        if (ring := self._ring) is None:
            return follow(self.twin, begin, gamma, self._hung(begin))
        start = self._near_ring(*ring, begin)
        for part in _FIRST_PARTS[1:]:
            left = np.flatnonzero(~start.is_found)
            begin[left] = rest + part * (gamma[left] - rest)
            start.put(left, self._near_ring(*ring, begin[left]))
        return follow(self.twin, begin, gamma, start)

    def _before_cuts(self, flood: Flood, gamma: Array) -> tuple[Array, Equilibria, Array]:
        """Where lines meet their first cut, else rest; postures there, and changes of frames."""
        rest, clear = self.rest_activation, flood.clear(gamma)[:, None]
        way = gamma - rest
        begin = rest + clear * way
        guesses = flood.at(begin)[0]
        before = flood.at(begin - np.minimum(clear, 1 / PARTS) * way)[0]
        slopes = (1.0 - clear) * PARTS * (guesses - before)
        start = self.twin.search(begin, guesses)
        near = turn_between(start.frame, guesses) <= _NEAR
        lost = np.flatnonzero(~(start.is_stable & near))
        start.put(lost, self.rest.of(np.zeros(len(lost), int)))
        begin[lost], slopes[lost] = rest, 0.0
        return begin, start, slopes

    @lazy
    def _ring(self) -> tuple[Array, float] | None:
        """Frame of an arm of the ring that leans at rest, and its azimuth; None where none does."""
        solver, rest, tables = self.solver, self.rest_activation, self.solver.tables
        if not tables.one_direction or tables.phase.entire > SHOT_AT_ONCE:
            return None
        image, axis = solver.base_map(rest), tables.axes[0]
        if not is_axisymmetric(image, axis, SYMMETRIC):
            return None
        rings = pole_rings(image, axis, axis)
        points = rings.points[rings.signs > 0]
        whole = replace(solver, tables=tables.in_one_segment)
        many, tip = np.repeat(rest, len(points), axis=0), np.array([tables.arm.length])
        shapes, margin = whole.shapes_facing(many, points, tip)
        if not (margin > -NEUTRAL).any():
            return None
        first = int((margin > -NEUTRAL).argmax())
        frame = solver.frames_facing(rest, points[[first]])[0]
        return frame, float(_azimuth(shapes.position[:, 0], tables.axes)[first])

    def _near_ring(self, frame: Array, azimuth: float, gamma: Array) -> Equilibria:
        """Stable equilibria of the twin near the ring, about where it would bend without loads."""
        twin, tables = self.twin, self.twin.tables
        leaning = twin.search(gamma, None).only(np.zeros(len(gamma), bool))
        bent = FreeRod(tables.arm, 1e-6).tips(gamma)
        bends = np.linalg.norm(bent @ tables.axes[1:].T, axis=1) > _STRAIGHT * tables.arm.length
        there = _azimuth(bent, tables.axes) - azimuth
        for turn in _TURNS:
            left = np.flatnonzero(bends & ~leaning.is_found)
            new = twin.search(gamma[left], _turned(frame, there[left] + turn, tables.axes))
            leaning.put(left[new.is_stable], new.of(new.is_stable))
        return leaning

    def continued_from(self, gamma: Array, frame: Array) -> ContinuedPostures:
        """Postures of an arm that is in one of some at activations (k, bundles)."""
        return ContinuedPostures(self.solver, self.side, origin=self, at=gamma, frame=frame)

    @lazy
    def mirrored(self) -> Postures:
        """Those of the twin with the other twist."""
        return Postures(self.solver, -self.side)

    def with_flood(self) -> Postures:
        """The same, with starts from a grid over the box where that is worth it."""
        nodes = _NODES.get(self.box.dimension)
        if nodes is None or not self.is_held_at_rest:
            return self
        sizes = tuple(nodes if free else 1 for free in self.box.is_free)
        flood = Flood(self.twin, self.box, sizes, self.rest_activation, self.rest)
        on_arm = polished(self.solver, flood.gamma, flood.held, _BESIDE)
        flood.held.put(np.flatnonzero(on_arm.is_found), on_arm.of(on_arm.is_found))
        return Postures(self.solver, self.side, flood)


def polished(solver: Solver, gamma: Array, on_twin: Equilibria, within: float) -> Equilibria:
    """Stable equilibria of an arm beside those of its twin; found where they are so near [rad]."""
    new = solver.search(gamma, on_twin.frame)
    near = turn_between(new.frame, on_twin.frame) < within
    return new.only(on_twin.is_found & new.is_stable & near)


@dataclass(frozen=True, eq=False)
class ContinuedPostures(Postures):
    """The same along straight lines from the nearest posture that the arm may be in."""

    origin: Postures = field(kw_only=True)
    at: Array = field(kw_only=True)
    """Activations, shape (k, bundles)."""
    frame: Array = field(kw_only=True)
    """How the arm sees the world there, shape (k, component)."""

    def continued_from(self, gamma: Array, frame: Array) -> ContinuedPostures:
        return self.origin.continued_from(gamma, frame)

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
    def _begun(self) -> tuple[Solver, Equilibria, Mask]:
        """The twin that has most of these postures, on it, and which; of two that of the side."""
        sides = []
        for postures in (self.origin, self.origin.mirrored):
            rest = postures.twin.search(self.at, self.frame)
            near = turn_between(rest.frame, self.frame) < _POLISHED
            sides.append((postures.twin, rest, rest.is_stable & near))
            if sides[-1][2].all():
                break
        return max(sides, key=lambda side: side[2].sum())

    @lazy
    def twin(self) -> Solver:
        return self._begun[0]

    @lazy
    def rest(self) -> Equilibria:
        return self._begun[1]

    @property
    def is_held_at_rest(self) -> bool:
        return True


@dataclass(frozen=True, eq=False)
class PosturesBeside(Postures):
    """Those within half a radian of one that the arm is in, by one search each."""

    frame: Array = field(kw_only=True)  # of the posture, (1, component)
    found: Array = field(kw_only=True)  # of the last that was found

    def find(self, gamma: Array, *, by_lines: bool = True) -> Equilibria:
        new, equilibria = self.solver.search(gamma, self.frame), self.solver.empty(len(gamma))
        near = turn_between(new.frame, self.frame) < _POLISHED
        self.solver.put(gamma, slice(None), new.only(new.is_stable & near), equilibria)
        self.found[:] = new.frame
        return equilibria


def _turned(frame: Array, angles: Array, axes: Array) -> Array:
    """Frames of a frame that turns about the first axis [rad], shape (n, component)."""
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = 1.0
    turns[:, 1, 1] = turns[:, 2, 2] = np.cos(angles)
    turns[:, 2, 1] = np.sin(angles)
    turns[:, 1, 2] = -turns[:, 2, 1]
    turned = frame.reshape(-1, 3) @ axes.T @ turns.transpose(0, 2, 1) @ axes
    return turned.reshape(len(angles), frame.size)


def _azimuth(places: Array, axes: Array) -> Array:
    """About the first axis [rad]."""
    return np.arctan2(places @ axes[2], places @ axes[1])
