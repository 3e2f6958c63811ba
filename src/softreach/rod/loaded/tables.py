"""Tables of a loaded rod for its kernels, and the phase that bounds the length of its steps.

The tangents of theory (68) obey Jacobi's equation: where a force w pushes, they swing like
cos ∫ √(w/K) ds, so that conjugate points are about π of this phase apart; where it pulls, they grow
like cosh of the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import both_sides, compliance, ends_over, tables
from softreach.kernels.loaded import unloaded_frames as rest_frames
from softreach.kernels.loaded.rod_step import NODES
from softreach.kernels.rod import magnus
from softreach.kernels.rod import tips as rod
from softreach.rod.steps import edges_between, ends_of_steps, tables_on
from softreach.support.arrays import Array, Index
from softreach.support.lazy import lazy

PHASE_OF_SEGMENT = 4.0  # [rad]
MOST_SEGMENTS = 64
SHOT_AT_ONCE = 20.0  # [rad] of phase, up to which one segment is shot: e^20 roundings are 1e-7 rad
_MOST_PHASE = math.pi / 2.0
_MOST_STEPS = 1 << 16
_STATIONS = 65
_GAUSS, _WEIGHTS = np.polynomial.legendre.leggauss(5)


class LoadPhase(NamedTuple):
    """Bounds of the phase of the tangents, theory (85)."""

    entire: float
    """Over the entire arm [rad]."""
    steepest: float
    """Over the entire arm, were it everywhere as steep in S as where it is steepest [rad]."""
    squeeze: float
    """The largest force over K0, times the largest η/ζ̂ [-]: from 1 on it could squeeze the arm to
    nothing."""

    stations: Array
    """Z from base to tip [m], shape (station,)."""
    along: Array
    """Phase from the base to there [rad], shape (station,)."""

    @property
    def fewest_steps(self) -> int:
        """Uniform ones in S, of which none makes more than a quarter of a swing.

        Half of what is between conjugate points in a straight arm leaves room for the moment of a
        bent one, which makes the phase at most about √2 as large.
        """
        return max(2, math.ceil(min(self.steepest / _MOST_PHASE, _MOST_STEPS)))


class StepTables(NamedTuple):
    """Steps from tip to base."""

    pieces: Array
    """Packed Magnus nodes of the pieces between the nodes of steps, (4 step, 12, bundle + 1)."""
    lengths: Array
    """η dZ, then ζ̂ dZ, at the nodes, (step, 10, bundle + 1)."""
    scalars: Array
    """1/K1, 1/K3 - 1/K1, 1/K0 and the dead force along the world's axes, (step, 5, 6); of flat
    sections then 1/K2 - 1/K1 and the axis of K2 along d1 and d2, (step, 5, 9)."""
    bends: Array
    """U at the nodes, (step, 5, 3, bundle)."""
    moments: Array
    """Dead moment at the tip end of each step along the world's axes, (step, 3)."""
    firsts: Index
    """The first step of each segment, and the number of steps, (segment + 1,)."""


@dataclass(frozen=True, eq=False, kw_only=True)
class LoadTables:
    """Tables of one arm under its loads, for any number of steps."""

    arm: Manipulator
    longest: float = PHASE_OF_SEGMENT
    """Phase of the longest segment between nodes [rad]."""
    twist: float = 0.0
    """Of the arm at rest [rad/m], beside that of its design."""
    direction: Array | None = None
    """Unit vector in the base frame of one more force on the tip."""
    force: float = 0.0
    """Of that [N]; nodes, axes and phase are the same for all."""

    def under(self, force: float) -> LoadTables:
        """The same with another size of that force [N]."""
        kept = {name: getattr(self, name) for name in ("axes", "one_direction", "phase", "_made")}
        tables = replace(self, force=force)
        vars(tables).update(kept)
        return tables

    @property
    def is_flat(self) -> bool:
        """True if sections have two bending stiffnesses."""
        return self.arm.section.bending_ratio != 1.0

    @lazy
    def loads(self) -> Loads:
        """Loads on the arm beside its actuators, in the frame of the base."""
        loads = self.arm.loads or Loads(gravity=(0.0, 0.0, 0.0))
        return loads.seen_from(self.arm.base)

    def _mass_per_length(self, z: Array) -> Array:
        """[kg/m], before activation; 0 where nothing falls, as densities may not be known."""
        if not any(self.loads.gravity):
            return np.zeros(z.shape)
        return self.arm.section.mass_per_length_at(self.arm.profile, z)

    @lazy
    def nodes(self) -> Array:
        """Z of the nodes between tip and base [m], even in phase, from tip to base."""
        segments = max(1, math.ceil(min(self.phase.entire / self.longest, MOST_SEGMENTS)))
        wanted = self.phase.along[-1] * (1.0 - np.arange(1, segments) / segments)
        return np.interp(wanted, self.phase.along, self.phase.stations)

    @property
    def segments(self) -> int:
        """Segments of the arm, each shot from its tip end."""
        return len(self.nodes) + 1

    @property
    def in_one_segment(self) -> LoadTables:
        """The same without nodes."""
        return replace(self, longest=np.inf)

    @lazy
    def axes(self) -> Array:
        """Orthonormal directions of the world in the base frame, as rows, the first of gravity.

        Without gravity that of the largest dead force, so that a tip force alone needs no more than
        one direction.
        """
        first = next((f for f in self._dead_forces if f.any()), np.array([0.0, 0.0, -1.0]))
        first = first / np.linalg.norm(first)
        other = np.eye(3)[np.argmin(np.abs(first))]
        second = np.cross(first, other)
        second = second / np.linalg.norm(second)
        return np.array([first, second, np.cross(first, second)], float)

    @lazy
    def one_direction(self) -> bool:
        """True if all forces are dead and along the first axis, so that two unknowns are enough."""
        loads, dead = self.loads, self._dead_forces
        across = dead @ self.axes[1:].T
        size = np.abs(dead).max(axis=1, keepdims=True)
        moments = [loads.tip_moment, loads.follower_force]
        moments += [load.moment for load in loads.point_loads]
        return bool((np.abs(across) <= 1e-14 * size).all()) and not np.any(moments)

    @property
    def frame_size(self) -> int:
        """Numbers of a frame: how the nodes of an arm see the world."""
        return self.segments * (3 if self.one_direction else 6)

    @lazy
    def at_tip(self) -> Array:
        """Weight of the payload along the axes, its lever, force and moment that follow, (12,)."""
        loads = self.loads
        weight = self.axes @ (loads.payload * np.array(loads.gravity))
        parts = weight, loads.payload_arm, loads.follower_force, loads.follower_moment
        return np.concatenate([np.array(part, float) for part in parts])

    @property
    def _tip_force(self) -> Array:
        """Dead force on the tip with the weight of the payload [N]."""
        return self.loads.payload * np.array(self.loads.gravity) + np.array(self.loads.tip_force)

    @property
    def _dead_forces(self) -> Array:
        """Along which dead forces act, shape (force, 3)."""
        loads, last = self.loads, [] if self.direction is None else [self.direction]
        forces = [loads.gravity, loads.force_per_length, self._tip_force]
        return np.array([*forces, *(load.force for load in loads.point_loads), *last], float)

    @lazy
    def phase(self) -> LoadPhase:
        """The phase that the loads give the tangents at most.

        Its rate is √(w (1 + w/K0)/K + (M/2K)²) ζ̂, with K the smallest of K1, K2 and K3, w and M the
        sizes of all forces and moments beyond, added as if along one line, and ζ̂ the largest
        within bounds, or η where that is larger. Flat sections add what buckles them sideways.
        """
        arm, profile = self.arm, self.arm.profile
        z = both_sides(arm, profile.station(np.linspace(0.0, profile.slender_length, _STATIONS)))
        axial, yields = compliance(arm, z)
        moment, softest = self.loads.moment_size, yields.max(axis=-1)
        with np.errstate(over="ignore"):
            force = self._largest_force(z)
            swing = force * (1.0 + force * axial) * softest + (0.5 * moment * softest) ** 2
            table = tables(arm, z)
            longest = 1.0 + ends_over(table.extension, arm.bounds).T
            grown = 1.0 + ends_over(table.rest_length_factor, arm.bounds).T
            relative = grown[1] / longest[0] if table.has_forces else 1.0
            squeeze = float((force * axial * relative).max())
            stretch = np.maximum(longest[1], grown[1])
            if self.is_flat:
                swing += _sideways(yields, force, _beyond(stretch * force, z) + moment)
            rate = stretch * np.sqrt(swing)
        steepest = rate * profile.radius(z) * profile.slender_length  # dZ = R2 dS
        along = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(z)))
        return LoadPhase(float(along[-1]), float(steepest.max()), squeeze, z, along)

    def _largest_force(self, z: Array) -> Array:
        """The sizes of all forces beyond each station, added [N]."""
        loads = self.loads
        gravity, at_tip = math.hypot(*loads.gravity), math.hypot(*loads.tip_force)
        per_length = math.hypot(*loads.force_per_length) + self._mass_per_length(z) * gravity
        along = _beyond(per_length, z)
        points = sum((math.hypot(*p.force) * (p.station >= z) for p in loads.point_loads), 0.0)
        at_tip += math.hypot(*loads.follower_force) + loads.payload * gravity
        return at_tip + along + points

    @lazy
    def _made(self) -> dict[int, StepTables]:
        """Tables by their number of steps; searches use the same ones again."""
        return {}

    def uniform(self, steps: int) -> StepTables:
        """At least `steps` steps, with boundaries where the arm or its loads are not smooth."""
        if steps not in self._made:
            self._made[steps] = self.of_edges(self.edges(np.array([]), steps))
        made = self._made[steps]
        if self.direction is None:
            return made
        scalars = made.scalars.copy()
        scalars[..., 3:6] += self.force * (self.axes @ self.direction)
        return made._replace(scalars=scalars)

    def edges(self, stations: Array, steps: int) -> Array:
        """Boundaries S of steps from tip to base, among them stations Z [m], nodes and breaks.

        No step is longer in S than those of `steps` uniform ones.
        """
        points = [load.station for load in self.loads.point_loads]
        breaks = [0.0, self.arm.length, *ends_of_steps(self.arm, steps), *points]
        z = np.unique(np.concatenate([breaks, self.nodes, stations]))
        return edges_between(self.arm.profile, z, steps)[::-1]

    def of_edges(self, edges: Array) -> StepTables:
        """Tables of steps between boundaries S, tip first."""
        profile, width = self.arm.profile, -np.diff(edges)[:, None]
        s, ends = edges[:-1, None] - width * np.array(NODES), profile.station(edges)
        z = profile.station(s)
        z[:, 0], z[:, -1] = ends[:-1], ends[1:]
        # A hair inside their step, nodes at its ends take what jumps there from within.
        inward = z + 1e-9 * (z[:, :1] - z[:, -1:]) * np.array([-1.0, 0.0, 0.0, 0.0, 1.0])
        wide = (width * np.diff(np.array(NODES))).reshape(-1, 1)  # of the pieces between nodes
        between = profile.station(s[:, 1:].reshape(-1, 1) + wide * np.array(magnus.NODES))
        at, inside = tables_on(self.arm, inward, between)
        resting = inside.rest_length_factor  # only rotations are needed
        pieces = rod.pack(wide * profile.radius(between), resting, resting, inside.curvature)
        pieces[:, 3::4, -1] += self.twist  # u3 at rest
        measure = width * profile.radius(inward)
        axial, yields = compliance(self.arm, inward)
        bending, across, torsion = np.moveaxis(yields, -1, 0)
        force, moments = self._dead_loads(z)
        scalars = [bending, torsion - bending, axial, *np.moveaxis(force, -1, 0)]
        if self.is_flat:
            angle = np.full(z.shape, self.arm.section.bending_angle)
            scalars += [across - bending, -np.sin(angle), np.cos(angle)]
        inner = [int(np.abs(ends - node).argmin()) for node in self.nodes]
        return StepTables(
            pieces,
            rest_frames.pack_lengths(measure, at.extension, at.rest_length_factor),
            np.ascontiguousarray(np.stack(scalars, axis=-1)),
            np.ascontiguousarray(at.curvature),
            moments,
            np.array([0, *inner, len(edges) - 1], np.int64),
        )

    def _dead_loads(self, z: Array) -> tuple[Array, Array]:
        """Force [N] at nodes, theory (60), (step, 5, 3), moment at tip ends of steps, (step, 3)."""
        loads, length, order = self.loads, self.arm.length, z.ravel()
        half = 0.5 * (np.concatenate([[length], order[:-1]]) - order)
        mass = self._mass_per_length(order[:, None] + half[:, None] * (1.0 + _GAUSS))
        beyond = np.cumsum(half * (mass @ _WEIGHTS)).reshape(z.shape)
        force = self._tip_force + beyond[..., None] * np.array(loads.gravity)
        force = force + (length - z)[..., None] * np.array(loads.force_per_length)
        moments = np.zeros((len(z), 3))
        moments[0] = self.axes @ np.array(loads.tip_moment)
        for load in loads.point_loads:  # on the base they act on no step
            step = np.abs(z[:, 0] - load.station).argmin() if load.station > 0.0 else len(z)
            force[step:] += load.force
            moments[step : step + 1] += self.axes @ np.array(load.moment)
        return force @ self.axes.T, moments


def _beyond(density: Array, z: Array) -> Array:
    """Integrals from stations Z [m] to the last one."""
    each = 0.5 * (density[1:] + density[:-1]) * np.diff(z)
    return np.append(np.cumsum(each[::-1])[::-1], 0.0)


def _sideways(yields: Array, force: Array, moment: Array) -> Array:
    """Square of the rate at which a bending moment winds tangents about a flat strip [1/m²].

    A moment M about the axis of K1 couples bending about the other one with torsion at the rate
    M √((1/K2 - 1/K1) (1/K3 - 1/K1)): Prandtl's strip buckles sideways as M comes to about π/2 of
    it. M is at most that of all forces on their levers, and of an elastica 2 √(w K).
    """
    first, second, torsion = np.moveaxis(yields, -1, 0)
    coupling = np.abs(first - second)
    coupling *= np.maximum(np.abs(torsion - first), np.abs(torsion - second))
    with np.errstate(divide="ignore", invalid="ignore"):  # in rigid pieces
        elastica = 2.0 * np.sqrt(force / np.minimum(first, second))
    return coupling * np.fmin(moment, elastica) ** 2
