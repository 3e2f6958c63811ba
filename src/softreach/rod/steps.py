"""Steps of a free rod: the grid along Z, and the rule that meets a tip tolerance.

Steps are uniform in S, theory (15); how many is theory (27).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.arm.driving import cube_corners
from softreach.arm.manipulator import Manipulator
from softreach.arm.profile import Profile
from softreach.arm.tables import Tables, both_sides, jumps, tables
from softreach.kernels.rod import frames, magnus
from softreach.kernels.rod import tips as rod
from softreach.rod.inputs import ActivationBox
from softreach.rod.tip_map import MOST_TURN_OF_STEP
from softreach.support import parallel
from softreach.support.arrays import Array, read_only
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy

Differences = Callable[[Array], Array]

_SAFETY = 2.0
_MOST_STEPS = 4096
_FRAME_TURN = 1.0  # [rad] of one step, up to which directors stay orthonormal to rounding
_SHAPES = 512  # whole shapes held at once
# The error of the steps grows with a high power of the bending, so that it is largest where many
# bundles bend the arm the same way: at few corners of the box, which random samples miss.
_INSIDE = 256
_HEADINGS = 16
_PROBED_STATIONS = 9
_SEARCHED = 8  # corners from which larger errors are searched
_ROUNDS = 24
_FEW_BREAKS = 64  # at all of which steps end, however few the arm needs otherwise


def tables_on(arm: Manipulator, *grids: Array) -> Iterator[Tables]:
    """Tables at the nodes of steps, Z [m] of shape (step, node), which lead their arrays."""
    table = tables(arm, np.concatenate([z.ravel() for z in grids]))
    first = 0
    for z in grids:
        rows, first = slice(first, first + z.size), first + z.size
        values = table.extension[rows], table.curvature[rows], table.rest_length_factor[rows]
        yield Tables(z, *(value.reshape(*z.shape, *value.shape[1:]) for value in values))


@dataclass(frozen=True)
class StepRule:
    """Steps along an arm, uniform in the slender coordinate S, in which bending is even.

    Wherever the arm is not smooth, a step ends: within a step everything is, so that the order of
    the integrator stays. Of more breakpoints than steps only those count at which strains jump; it
    is then measured on tips in steps that end at all of them how many are enough.
    """

    arm: Manipulator
    box: ActivationBox

    def edges(self, steps: int, stations: Array | None = None) -> Array:
        """Step boundaries S [-] from base to tip, with no step longer than `steps` uniform ones.

        Steps end at ascending stations Z [m], too, the last of which then stands for the tip.
        """
        z = [0.0, *ends_of_steps(self.arm, steps), self.arm.length]
        if stations is not None:
            z = [*(mark for mark in z if mark < stations[-1]), *stations]
        return edges_between(self.arm.profile, np.unique(z), steps)

    def nodes(self, *edges: Array) -> tuple[Array, Array, Array, Array]:
        """Tables at the Gauss nodes of the steps between ascending `edges` S [-] of any grids.

        Returns:
            Length of the step as each node sees it [m], shape (step, node); z [-] and its part in
            η [-], shape (step, node, bundle); U [1/m], shape (step, node, 3, bundle).
        """
        starts, widths = np.concatenate([[each[:-1], np.diff(each)] for each in edges], axis=1)
        width = widths[:, None]
        z = self.arm.profile.station(starts[:, None] + width * np.array(magnus.NODES))
        (at,), measure = tables_on(self.arm, z), width * self.arm.profile.radius(z)  # dZ = R2 dS
        return measure, at.extension, at.rest_length_factor, at.curvature

    def packed(self, *edges: Array) -> Array:
        """Packed tables of the steps between edges, read-only."""
        return read_only(rod.pack(*self.nodes(*edges)))

    def _halves(self, steps: int) -> tuple[Array, Array]:
        """Packed tables of the steps, and of both halves of each, computed together."""
        edges = self.edges(steps)
        halves = np.insert(edges, np.arange(1, len(edges)), 0.5 * (edges[:-1] + edges[1:]))
        packed = self.packed(edges, halves)
        return packed[: len(edges) - 1], packed[len(edges) - 1 :]

    def packed_stations(self, stations: Array, steps: int) -> tuple[Array, NDArray[np.int64]]:
        """Packed tables of steps that end at every station Z [m], and the steps up to each.

        The latest are kept: an arm that moves is asked for its shape at the same stations.
        """
        asked = steps, stations.tobytes()
        known = vars(self).get("_latest")
        if known is None or known[0] != asked:
            edges = self.edges(steps, stations)
            ends = np.searchsorted(edges, self.arm.profile.slender_coordinate(stations))
            known = vars(self)["_latest"] = asked, (self.packed(edges), ends)
        return known[1]

    def steps_for(self, tol: float) -> int:
        """The number of uniform steps in S for which no tip is off by more than `tol`.

        The rule: a pilot of activations is run with n and with 2n steps; n is the smallest number
        whose largest difference, doubled for safety, is within `tol`, and for which no step turns
        by more than 2 rad. Halving is sharp at sixth order: it sees 63/64 of the error. The pilot
        holds corners, faces and the inside of the activation box, the corners that bend the arm
        most, and what a search for larger differences finds from there.

        Raises:
            InvalidInput: `tol` is not reached within 4,096 steps.
        """
        at_all, turn = enough_for_all_breaks(self.arm), MOST_TURN_OF_STEP
        exact = self._fewest(tol, lambda steps: _tips_apart(*self._halves(steps)), turn, at_all)
        if not at_all:
            return exact
        fine = self.packed(self.edges(exact))

        def from_fine(steps: int) -> Differences:
            return _tips_apart(self.packed(self.edges(steps)), fine)

        return self._search(tol, from_fine, turn, 0, at_all - 1) or exact

    def steps_for_shapes(self, tol: float) -> int:
        """As `steps_for`, for the largest error of the centerline anywhere along the arm."""
        at_all = enough_for_all_breaks(self.arm)
        return self._fewest(tol, self._shape_differences, _FRAME_TURN, at_all)

    def _fewest(
        self, tol: float, halving: Callable[[int], Differences], turn: float, least: int
    ) -> int:
        """The fewest steps, `least` at least, whose differences are allowed."""
        most = max(_MOST_STEPS, 4 * least)
        if steps := self._search(tol, halving, turn, least, most):
            return steps
        raise InvalidInput("tol", tol, f"reachable within {most} steps", "use a larger one")

    def _search(
        self, tol: float, halving: Callable[[int], Differences], turn: float, least: int, most: int
    ) -> int | None:
        """The fewest steps whose differences on the pilot, and on what it leads to, are allowed."""
        allowed = tol * self.arm.length / _SAFETY
        steps, pilot = max(least, self.fewest_steps(turn)), self.pilot
        while steps <= most:
            difference = halving(steps)
            errors = difference(pilot)
            error = float(errors.max())
            if error <= allowed:
                worse, errors = _worsened(difference, pilot, errors, self.box)
                error = float(errors.max())
                if error <= allowed:
                    return steps
                pilot = np.concatenate([pilot, worse])
            # Undershoot the sixth-order prediction a little, so that the smallest number is found.
            steps = max(steps + 1, int(0.97 * steps * (error / allowed) ** (1 / 6)))
        return None

    def fewest_steps(self, turn: float = _FRAME_TURN) -> int:
        """Steps of which none turns by more than `turn`: |ω| = η |u| R2 dS at the pilot samples.

        By default directors stay orthonormal to rounding.
        """
        steps = min(self._largest_turn / turn, 2.0 * _MOST_STEPS)  # infinite ones overflow
        return max(2, int(np.ceil(steps)))

    @lazy
    def _largest_turn(self) -> float:
        """Largest η |u| R2 over the pilot samples and the arm, times S(L) [rad]."""
        profile, gamma = self.arm.profile, self.pilot
        z = both_sides(self.arm, profile.station(np.linspace(0.0, profile.slender_length, 65)))
        table = tables(self.arm, z)
        bend = np.linalg.norm(np.einsum("scb,nb->nsc", table.curvature, gamma), axis=-1)
        rate = (1.0 + gamma @ table.rest_length_factor.T) * bend * profile.radius(z)
        return float(rate.max() * profile.slender_length)

    @lazy
    def pilot(self) -> Array:
        """Activations on which steps are judged, shape (n, bundles)."""
        return pilot_activations(self.arm, self.box)

    def _shape_differences(self, steps: int) -> Differences:
        """Largest distances [m] along the centerlines with `steps` and with twice as many."""
        coarse, fine = self._halves(steps)
        ends = np.arange(1, len(coarse) + 1)

        def difference(gamma: Array) -> Array:
            errors = np.empty(len(gamma))
            for block in parallel.blocks(len(gamma), _SHAPES):
                places = np.empty((2, len(errors[block]), len(ends), 3))
                directors = np.empty((*places.shape[1:], 3))
                frames.frames(coarse, ends, gamma[block], places[0], directors)
                frames.frames(fine, 2 * ends, gamma[block], places[1], directors)
                errors[block] = np.linalg.norm(places[0] - places[1], axis=-1).max(axis=1)
            return errors

        return difference


def _tips_apart(coarse: Array, fine: Array) -> Differences:
    """Distances [m] between the tips by two packed tables."""

    def difference(gamma: Array) -> Array:
        places = np.empty((2, len(gamma), 3))
        rod.tips(coarse, gamma, places[0])
        rod.tips(fine, gamma, places[1])
        return np.linalg.norm(places[0] - places[1], axis=-1)

    return difference


def ends_of_steps(arm: Manipulator, steps: int) -> tuple[float, ...]:
    """Breakpoints [m] at which a step ends where there are `steps` uniform ones beside."""
    breaks = arm.breakpoints
    return breaks if len(breaks) <= max(_FEW_BREAKS, steps) else jumps(arm)


def enough_for_all_breaks(arm: Manipulator) -> int:
    """The steps from which on one ends at every breakpoint; 0 if one always does."""
    breaks = len(arm.breakpoints)
    return breaks if breaks > _FEW_BREAKS else 0


def edges_between(profile: Profile, z: Array, steps: int) -> Array:
    """Step boundaries S [-] that hold marks, with no step longer than `steps` uniform ones.

    The first and the last of the marks, ascending Z [m], are the ends.
    """
    marks = profile.slender_coordinate(z)
    gaps = np.diff(marks)
    # A gap that only rounding makes longer takes no more steps for it.
    counts = np.ceil(gaps * (steps / profile.slender_length) - 1e-9).astype(int)
    pieces = zip(marks[:-1], gaps, counts, strict=True)
    edges = [start + gap * np.arange(n) / n for start, gap, n in pieces]
    return np.concatenate([*edges, marks[-1:]])


def pilot_activations(arm: Manipulator, box: ActivationBox) -> Array:
    """Corners, points on faces and points inside the activation box, shape (n, bundles).

    All corners where they are no more than 1,024; else as many at random, and those that bend most.
    Only the last depend on more of an arm than its bounds.
    """
    m, rng = box.bundles, np.random.default_rng(0)
    corners = cube_corners(m, rng)
    inside, faces = rng.random((2, _INSIDE, m))
    if m:
        faces[np.arange(_INSIDE), rng.integers(0, m, _INSIDE)] = rng.integers(0, 2, _INSIDE)
    cube = np.concatenate([corners, faces, inside])
    if 2**m > len(corners):
        cube = np.concatenate([cube, _bending_corners(arm)])
    return np.ascontiguousarray(box.from_cube(cube))


def _bending_corners(arm: Manipulator) -> Array:
    """Corners of the unit cube that bend most toward headings, at stations and all along the arm.

    There every bundle is at the bound that helps. Along the arm headings turn as fibers do, or not.
    """
    ends = np.array([0.0, *arm.breakpoints, arm.length])
    z = np.linspace(0.0, arm.length, _PROBED_STATIONS)
    if arm.breakpoints:  # one station within each smooth stretch too
        z = np.union1d(z, 0.5 * (ends[1:] + ends[:-1]))
    plane = tables(arm, z).curvature[:, :2]
    start = 2.0 * np.pi * np.arange(_HEADINGS) / _HEADINGS
    directions = np.unwrap(np.arctan2(plane[:, 1], plane[:, 0]), axis=0)
    turns = np.concatenate([np.zeros((len(z), 1)), directions - directions[0]], axis=1)
    turns = np.unique(turns.round(9), axis=1)
    heading = start[:, None, None] + turns.T  # (heading, turn, station)
    along = np.einsum("htsc,scb->htsb", np.stack([np.cos(heading), np.sin(heading)], -1), plane)
    helps = np.concatenate([along.reshape(-1, arm.bundles), along.sum(2).reshape(-1, arm.bundles)])
    return np.unique((helps > 0).astype(float), axis=0)


def _worsened(
    error: Differences, pilot: Array, known: Array, box: ActivationBox
) -> tuple[Array, Array]:
    """Activations of larger error, and that: one bundle at a time goes to a bound."""
    chosen = np.argsort(-known, kind="stable")[:_SEARCHED]
    gamma, worst = pilot[chosen].copy(), known[chosen].copy()
    free, rows = box.free, np.arange(len(chosen))
    for _ in range(_ROUNDS if len(free) else 0):
        moved = np.repeat(gamma[:, None], 2 * len(free), axis=1)
        moved[:, np.arange(len(free)), free] = box.low[free]
        moved[:, len(free) + np.arange(len(free)), free] = box.high[free]
        errors = error(moved.reshape(-1, box.bundles)).reshape(len(rows), -1)
        best = errors.argmax(axis=1)
        better = errors[rows, best] > 1.0001 * worst
        if not better.any():
            break
        gamma[better] = moved[rows, best][better]
        worst[better] = errors[rows, best][better]
    return gamma, worst
