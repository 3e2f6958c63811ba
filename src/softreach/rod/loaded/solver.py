"""The equilibria of a loaded rod at many activations, shot from the tip, and their shapes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.arm.base import rotation_matrices
from softreach.arm.tables import compliance as compliance_of
from softreach.geometry.sphere_maps import Map
from softreach.kernels.loaded import shooting as kernels
from softreach.kernels.loaded.response import TRACE, respond, respond_flat
from softreach.rod.free import linear_strains, per_length, tables_at
from softreach.rod.loaded.tables import LoadTables, StepTables
from softreach.rod.steps import enough_for_all_breaks
from softreach.rod.tip_map import Status, Strains, TipStatus, has_tip
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy

ALL_LOADS = np.ones(1)
_WIDEST = 1.2  # [rad], longest first step of Newton's method that is trusted
_SMALL = 2e-3  # [rad], step from which on chord steps do
_WALKS = 8, 12  # allowed, with tangents and without
_OF_TOL = 1e-2  # what the search may use up of the tolerance
_SEARCHES = {  # of flat sections, and of forces along one direction
    (False, False): kernels.solve_frames,
    (False, True): kernels.solve_directions,
    (True, False): kernels.solve_flat_frames,
    (True, True): kernels.solve_flat_directions,
}
_TRACED = 1 << 20  # numbers kept of the sections of all arms in one task, 8 MB


class Equilibria(NamedTuple):
    """Equilibria of activations, one for each, and where the search for one ended."""

    tips: Array
    """Tips r [m], shape (n, 3); NaN where there is no equilibrium on the branch."""
    status: Status
    """`TipStatus`, shape (n,)."""
    margin: Array
    """Margin of stability, from 1 to below 0 [-], shape (n,)."""
    frame: Array
    """First axis of the world at the nodes [-], tip first, as the base of the unloaded arm sees it,
    (n, 3 node); with loads of several directions also the second one, (n, 6 node)."""

    @property
    def is_found(self) -> Mask:
        """Mask of those that are equilibria, stable or not, shape (n,)."""
        return has_tip(self.status)

    @property
    def is_stable(self) -> Mask:
        """Mask of those that are stable equilibria, shape (n,)."""
        return np.asarray(self.status == TipStatus.STABLE)

    def of(self, rows: slice | Mask | Index) -> Equilibria:
        """Some of them; a slice shares memory."""
        return self._make(values[rows] for values in self)

    def put(self, rows: slice | Index, others: Equilibria) -> None:
        """Replace some of them."""
        for values, new in zip(self, others, strict=True):
            values[rows] = new

    def only(self, good: Mask) -> Equilibria:
        """The same, undecided where they are not good."""
        return self._replace(status=np.where(good, self.status, np.int8(TipStatus.UNDECIDED)))


class LoadedShapes(NamedTuple):
    """Arms at stations, all shapes (n, station, ...)."""

    position: Array
    """r [m]."""
    directors: Array
    """d1, d2, d3 as rows."""
    moment: Array
    """m [N m] in the directors."""
    force: Array
    """n [N] in the directors."""


@dataclass(frozen=True, eq=False)
class Solver:
    """Equilibria with a given number of steps."""

    tables: LoadTables
    steps: int
    """Least number of steps; no fewer than the phase of the loads needs."""
    tol: float
    """Largest tip error, in L, of which the search uses up a hundredth."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "steps", max(self.steps, self.tables.phase.fewest_steps))

    @lazy
    def _steps(self) -> StepTables:
        return self.tables.uniform(self.steps)

    def judge(self) -> Solver:
        """The same with twice the steps, or as many as let one end at every breakpoint."""
        steps = max(2 * self.steps, enough_for_all_breaks(self.tables.arm))
        return Solver(self.tables, steps, self.tol)

    def search(self, gamma: Array, guesses: Array | None, shares: Array = ALL_LOADS) -> Equilibria:
        """Searches at (n, bundles) under shares of the loads, (n,), or (1,) for all.

        They begin from frames as in `Equilibria`, or from those of the unloaded arm.
        """
        limits = _WIDEST, _SMALL, max(_OF_TOL * self.tol, 1e-13)
        return self._shot(gamma, guesses, self._steps, limits, shares)

    def _shot(
        self,
        gamma: Array,
        guesses: Array | None,
        steps: StepTables,
        limits: tuple[float, float, float],
        shares: Array = ALL_LOADS,
        walks: tuple[int, int] = _WALKS,
    ) -> Equilibria:
        """Searches on any steps; see `solve_directions`."""
        tables, size = self.tables, self.tables.frame_size
        out = np.empty((len(gamma), 5 + size))
        solve = _SEARCHES[tables.is_flat, tables.one_direction]
        given = np.zeros((0, size)) if guesses is None else np.ascontiguousarray(guesses)
        arm = _columns(gamma), tables.axes, tables.at_tip, given, tuple(steps)
        solve(*arm, limits, walks, shares, out)
        margin = out[:, -2]
        status = np.where(margin > 0, TipStatus.STABLE, TipStatus.UNSTABLE).astype(np.int8)
        ends = Equilibria(out[:, :3], status, margin, out[:, 3:-2])
        return ends.only((out[:, -1] == kernels.FOUND) & np.isfinite(out[:, :-1]).all(axis=1))

    def _traced(self, gamma: Array, frames: Array, steps: StepTables) -> Array:
        """Sections between steps, tip first."""
        return self._walked(gamma, frames, steps, (0, 0, len(gamma)))[2]

    def _walked(
        self, gamma: Array, frames: Array, steps: StepTables, counts: tuple[int, int, int]
    ) -> tuple[Array, Array, Array]:
        """Twists, compliances and sections of so many arms, all or none; see `respond`."""
        moved, yielding, traced = counts
        twists, yields = np.zeros((moved, 6, gamma.shape[1] or 1)), np.zeros((yielding, 3, 3))
        sections = np.zeros((traced, len(steps.lengths) + 1, TRACE))
        walked = _columns(gamma), self.tables.at_tip, np.ascontiguousarray(frames), tuple(steps)
        walk = respond_flat if self.tables.is_flat else respond
        walk(*walked, twists, yields, sections)
        return twists[:, :, : gamma.shape[1]], yields, sections

    def empty(self, n: int) -> Equilibria:
        """Room for n equilibria."""
        tips, frame = np.full((n, 3), np.nan), np.zeros((n, self.tables.frame_size))
        return Equilibria(tips, np.full(n, TipStatus.UNDECIDED, np.int8), np.full(n, np.nan), frame)

    def near(self, gamma: Array, known: Equilibria) -> Equilibria:
        """Equilibria near known ones of other steps."""
        equilibria = self.empty(len(gamma))
        self.put(gamma, slice(None), self.search(gamma, known.frame), equilibria)
        return equilibria

    def put(
        self, gamma: Array, rows: slice | Index, ends: Equilibria, equilibria: Equilibria
    ) -> None:
        """Put down what is found at some rows of all activations.

        No arm is where ζ = ζ̂ + η n3/K0 is not positive: it would be turned inside out.
        """
        tips = np.where(ends.is_found[:, None], ends.tips, np.nan)
        equilibria.put(rows, ends._replace(tips=tips))
        if self.tables.phase.squeeze < 1.0:
            return
        z = self.tables.arm.profile.station(self.tables.edges(np.array([]), self.steps)[::-1])
        at = np.arange(len(gamma))[rows]
        shapes = self.shapes(gamma[at], z, equilibria.of(at))
        extension = self.strains_under(gamma[at], z, shapes).extension
        squeezed = at[(extension <= 0.0).any(axis=1)]
        equilibria.tips[squeezed] = np.nan
        equilibria.status[squeezed] = TipStatus.NO_EQUILIBRIUM

    def strains_under(self, gamma: Array, z: Array, shapes: LoadedShapes) -> Strains:
        """The strains at stations Z [m], from m and n in the directors of the shapes there."""
        arm = self.tables.arm
        axial, yields = compliance_of(arm, z)
        u, extension, eta = linear_strains(tables_at(arm, z.tobytes()), gamma)
        extension = extension + eta * shapes.force[..., 2] * axial
        bent = np.einsum("sab,nsb->nsa", arm.section.in_directors(yields), shapes.moment)
        return per_length(u + bent, extension, eta)

    def base_map(self, gamma: Array) -> Map:
        """Map from directions of gravity at the tip of one arm (1, bundles) to those at its base.

        Both (n, 3) as the base of the unloaded arm sees them; loads along one direction only.
        """
        is_flat = self.tables.is_flat
        walk = kernels.base_flat_directions if is_flat else kernels.base_directions

        def image(points: Array) -> Array:  # steps do not keep the length
            images, directions = np.empty((len(points), 3)), np.ascontiguousarray(points)
            at_tip, steps = self.tables.at_tip, tuple(self._steps)
            walk(_columns(gamma), at_tip, directions, steps, images)
            return images / np.linalg.norm(images, axis=1, keepdims=True)

        return image

    def shapes_facing(
        self, gamma: Array, directions: Array, stations: Array
    ) -> tuple[LoadedShapes, Array]:
        """Shapes of arms whose tips see gravity along given directions, and their margins.

        Nothing is searched: the directions (n, 3), as in `base_map`, are those of equilibria
        of loads along one direction, of arms of one segment.
        """
        edges = self.tables.edges(stations, self.steps)
        z = self.tables.arm.profile.station(edges)
        is_uniform = len(edges) == len(self._steps.lengths) + 1  # stations at ends of steps alone
        table = self._steps if is_uniform else self.tables.of_edges(edges)
        rows = np.abs(z[None] - np.append(stations, 0.0)[:, None]).argmin(axis=1)
        trace = self._traced(gamma, directions, table)
        at, nowhere = np.zeros((len(gamma), 3)), np.full(len(rows), np.nan)
        position, directors, *inner = _shapes_of(at, trace, table, rows, nowhere)
        turn = np.swapaxes(directors[:, -1], -1, -2)  # so that the last one stands on the base
        position, directors = (position - position[:, -1:]) @ turn, directors @ turn[:, None]
        shapes = LoadedShapes(*(values[:, :-1] for values in (position, directors, *inner)))
        margin = self._shot(gamma, directions, table, (np.inf, np.inf, 0.0), walks=(1, 0)).margin
        return shapes, margin

    def frames_facing(self, gamma: Array, directions: Array) -> Array:
        """Frames, as in `Equilibria`, of arms whose tips see gravity along given directions."""
        whole = self._steps._replace(firsts=np.array([0, len(self._steps.lengths)]))
        trace = self._traced(gamma, directions, whole)
        seen = trace[:, self._steps.firsts[:-1], :3] @ rotation_matrices(trace[:, -1, 12:16])
        seen /= np.linalg.norm(seen, axis=2, keepdims=True)  # steps do not keep the length
        return seen.reshape(len(gamma), self.tables.frame_size)

    def respond(
        self, gamma: Array, known: Equilibria, *, compliance: bool = False, directors: bool = False
    ) -> tuple[Array, Array, Array]:
        """Derivatives of tips at equilibria with these steps, theory (74); NaN where there is none.

        Returns:
            (v, ω) per activation, shape (n, 6, bundles); ∂r/∂F [m/N], shape (n, 3, 3) or (0, 3, 3);
            directors as rows [-], likewise.
        """
        n, (rows, lost) = len(gamma), _found_rows(known)
        counts = n, n * compliance, n * directors
        twists, yields, trace = self._walked(gamma[rows], known.frame[rows], self._steps, counts)
        for values in (twists, yields):
            values[lost[: len(values)]] = np.nan
        if not directors:
            return twists, yields, np.empty((0, 3, 3))
        at, at_tip = np.zeros(1, int), np.array([self.tables.arm.length])
        shapes = _shapes_of(known.tips, trace, self._steps, at, at_tip)
        return twists, yields, shapes.directors[:, 0]

    def shapes(self, gamma: Array, stations: Array, known: Equilibria) -> LoadedShapes:
        """Arms at ascending stations Z [m], if any; NaN where there is no equilibrium.

        The equilibria at activations (n, bundles) are known with these steps or others.
        """
        position, moment, force = np.empty((3, len(gamma), len(stations), 3))
        shapes = LoadedShapes(position, np.empty((*position.shape, 3)), moment, force)
        if not len(stations):
            return shapes
        edges = self.tables.edges(stations, self.steps)
        table, z = self.tables.of_edges(edges), self.tables.arm.profile.station(edges)
        rows = np.abs(z[None] - stations[:, None]).argmin(axis=1)

        def fill(block: slice) -> None:
            at, lost = _found_rows(some := known.of(block))
            inner = gamma[block][at]
            ends = self._shot(inner, some.frame[at], table, (_WIDEST, _SMALL, 1e-12))
            trace = self._traced(inner, ends.frame, table)
            tips = np.where((lost | ~ends.is_found)[:, None], np.nan, ends.tips)
            at_block = _shapes_of(tips, trace, table, rows, stations)
            for values, new in zip(shapes, at_block, strict=True):
                values[block] = new

        size = max(1, _TRACED // (len(edges) * TRACE))
        parallel.run(partial(fill, block) for block in parallel.blocks(len(gamma), size))
        return shapes


def _columns(gamma: Array) -> Array:
    """Activations for kernels, which want one bundle at least."""
    return gamma if gamma.shape[1] else np.zeros((len(gamma), 1))


def _found_rows(known: Equilibria) -> tuple[Index, Mask]:
    """Rows with a found one in place of each that is lost, so that none is walked in vain."""
    lost = ~known.is_found
    return np.where(lost, lost.argmin(), np.arange(len(lost))), lost


def _shapes_of(
    tips: Array, trace: Array, table: StepTables, rows: Index, stations: Array
) -> LoadedShapes:
    """Shapes at stations Z [m], ends of steps with these rows, tip first; NaN where a tip is."""
    force = np.concatenate([table.scalars[:1, 0, 3:6], table.scalars[:, -1, 3:6]])[rows]
    axes = _world(trace[:, -1])[:, None]
    trace = trace[:, rows]
    world, turn = _world(trace), rotation_matrices(trace[..., 12:16])
    directors = np.swapaxes(world, -1, -2) @ axes
    back = trace[..., None, 9:12] @ turn @ np.swapaxes(world, -1, -2) @ axes
    position = tips[:, None] - back[..., 0, :]
    position[:, stations == 0.0] = 0.0
    directors[:, stations == 0.0] = np.eye(3)
    moment = (trace[..., None, 6:9] @ turn)[..., 0, :]
    thrust = ((force + trace[..., 16:19])[..., None, :] @ world)[..., 0, :]
    for values in (position, directors, moment, thrust):
        values[np.isnan(tips).any(axis=1)] = np.nan
    return LoadedShapes(position, directors, moment, thrust)


def _world(trace: Array) -> Array:
    """Axes of the world in the directors of sections, as rows, without the errors of the steps."""
    g, h = trace[..., 0:3], trace[..., 3:6]
    g = g / np.linalg.norm(g, axis=-1, keepdims=True)
    h = h - (g * h).sum(axis=-1, keepdims=True) * g
    h /= np.linalg.norm(h, axis=-1, keepdims=True)
    return np.stack([g, h, np.cross(g, h)], axis=-2) @ rotation_matrices(trace[..., 12:16])


def units(frames: Array) -> Array:
    """Frames whose directions have unit length."""
    axes = frames.reshape(len(frames), frames.shape[1] // 3, 3)
    size = np.linalg.norm(axes, axis=2, keepdims=True)
    return (axes / np.maximum(size, 1e-300)).reshape(frames.shape)


def turn_between(frames: Array, others: Array) -> Array:
    """The largest change of a direction [rad], shape (n,)."""
    change = (frames - others).reshape(len(frames), frames.shape[1] // 3, 3)
    return np.sqrt(np.einsum("nki,nki->nk", change, change).max(axis=1))
