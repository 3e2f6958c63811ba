"""Linear response of an arm in equilibrium: how places move when its tables change a little.

Tables are those of the steps between wanted stations and all places where the arm is not smooth.
Each node stays at its share of its step while the arm changes, so that steps grow with the arm and
no actuator ends inside one.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import compliance
from softreach.kernels.rod.linear_response import GAUSS, NODES, WEIGHTS, respond
from softreach.rod.free import ArmRod
from softreach.rod.steps import tables_on
from softreach.rod.tip_map import InvalidLoads
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

_TOGETHER = 64  # samples to a task


class StepGrid(NamedTuple):
    """Steps of an arm between the places where something begins or ends."""

    counts: NDArray[np.intp]
    """Steps between neighbors of these places, in their order along the arm."""
    moving_ends: bool
    """True if what ends at the base or at the tip may come to end before."""


class NodeTables(NamedTuple):
    """Tables of an arm at the nodes of its steps, base first."""

    stations: Array
    """Z [m], shape (step, 3)."""
    length: Array
    """dZ [m], shape (step, 3)."""
    extension: Array
    """z per activation [-], shape (step, 3, bundle)."""
    rest_length_factor: Array
    """Its part in η, likewise."""
    curvature: Array
    """U [1/m], shape (step, 3, 3, bundle)."""
    thrust: Array
    """1/K0 [1/N], shape (step, 3); zero without loads."""
    compliance: Array
    """K⁻¹ in the directors [1/(N m²)], shape (step, 3, 3, 3); zero without loads."""
    force: Array
    """Dead force n in the frame of the base [N], shape (step, 3, 3)."""
    moment: Array
    """Dead moment in that frame [N m], likewise; zero but for changes."""
    lever: Array
    """Of the payload in the directors of the tip [m], shape (3,)."""
    weight: Array
    """Force of the payload in the frame of the base [N], shape (3,)."""
    places: Array
    """Z of the wanted stations [m], shape (station,)."""

    def combined(self, others: list[NodeTables], factors: list[float]) -> NodeTables:
        """Σ factor x other, of differences."""
        columns = zip(*others, strict=True)
        weighted = (map(np.multiply, factors, column) for column in columns)
        return NodeTables(*(np.asarray(sum(terms)) for terms in weighted))


class Response(NamedTuple):
    """Changes of places per unit of each column, in the frame of the base."""

    moves: Array
    """ρ of the centerline [m], shape (n, station, 3, column)."""
    turns: Array
    """θ of the section [rad], likewise."""
    works: Array
    """Work of the unit_loads, shape (n, work, column)."""


def _places(arm: Manipulator, stations: Array, moving_ends: bool) -> Array:
    """All places where something begins or ends [m], ascending, with repetitions."""
    profile = arm.profile
    breaks = [z for actuator in arm.actuators for z in actuator.breakpoints(profile)]
    breaks += [arm.length * x for x in arm.section.breaks]
    spans = [*arm.actuators, *arm.rigid_pieces]
    ends = [(a.station_at("start", arm.length), a.station_at("end", arm.length)) for a in spans]
    rigid = [z for pair in ends[len(arm.actuators) :] for z in pair]
    breaks += [z for z in rigid if 0.0 < z < arm.length]
    if moving_ends:
        breaks += [0.0 for start, _ in ends if start <= 0.0]
        breaks += [arm.length for _, end in ends if end >= arm.length]
    points = [] if arm.loads is None else [load.station for load in arm.loads.point_loads]
    return np.sort([0.0, arm.length, *profile.breakpoints, *breaks, *points, *stations])


def step_grid(
    arm: Manipulator, stations: Array, steps: int, *, moving_ends: bool = False
) -> StepGrid:
    """Steps of an inner arm, none longer in S than so many even ones.

    A step should not turn the arm by much more than a third of a radian. Wanted stations Z [m] are
    in any order; moving ends of actuators at the base or at the tip may come to end before.
    """
    s = arm.profile.slender_coordinate(_places(arm, stations, moving_ends))
    counts = np.ceil(np.diff(s) / arm.profile.slender_length * steps - 1e-9)
    return StepGrid(np.maximum(counts, 1).astype(np.intp), moving_ends)


def node_tables(arm: Manipulator, stations: Array, grid: StepGrid) -> NodeTables:
    """Tables of an inner arm at the nodes of its steps.

    Raises:
        InvalidInput: Loads other than gravity, a payload and dead forces; or more or fewer places
            than the grid was made for.
    """
    profile = arm.profile
    s = profile.slender_coordinate(_places(arm, stations, grid.moving_ends))
    if len(s) != len(grid.counts) + 1:
        raise InvalidInput("breakpoints of the arm", len(s) - 1, f"{len(grid.counts)} as before")
    width = np.repeat(np.diff(s) / grid.counts, grid.counts)
    first = np.concatenate(
        [a + d / n * np.arange(n) for a, d, n in zip(s, np.diff(s), grid.counts, strict=False)]
    )
    at = first[:, None] + width[:, None] * NODES
    z = profile.station(at)
    # Steps without length stand where something ends: the inside of the arm decides.
    length = width[:, None] * profile.radius(z)
    (table,), axial, soft = tables_on(arm, z), np.zeros(z.shape), np.zeros((*z.shape, 3))
    if arm.loads is not None:
        axial, soft = compliance(arm, z)
    force, weight = dead_forces(arm, arm.base, z, length)
    return NodeTables(
        stations=z,
        length=length,
        extension=table.extension,
        rest_length_factor=table.rest_length_factor,
        curvature=table.curvature,
        thrust=axial,
        compliance=arm.section.in_directors(soft),
        force=force,
        moment=np.zeros(force.shape),
        lever=np.array((0.0, 0.0, 0.0) if arm.loads is None else arm.loads.payload_arm),
        weight=weight,
        places=np.asarray(stations, float),
    )


def dead_forces(arm: Manipulator, base: Base, z: Array, length: Array) -> tuple[Array, Array]:
    """Dead force n beyond the nodes, theory (60), and that of the payload in the frame of a base.

    Z and dZ of the nodes [m] are (step, 3), the forces [N] (step, 3, 3) and (3,), wherever the base
    of the arm itself is.
    """
    if arm.loads is None:
        return np.zeros((*z.shape, 3)), np.zeros(3)
    loads = arm.loads.seen_from(base)
    others = [loads.follower_force, loads.follower_moment, loads.tip_moment]
    others += [load.moment for load in loads.point_loads]
    if any(map(any, others)):
        allowed = "gravity, a payload and dead forces: moments and forces that follow have none"
        raise InvalidLoads("loads", "others", allowed)
    gravity = np.array(loads.gravity)
    mass = np.zeros(z.shape)
    if gravity.any():
        mass = arm.section.mass_per_length_at(arm.profile, z) * length
    steps = mass @ WEIGHTS
    beyond = np.cumsum(steps[::-1])[::-1] - steps
    beyond = beyond[:, None] + (steps[:, None] - mass @ GAUSS.T)
    force = (loads.payload + beyond)[..., None] * gravity + np.array(loads.tip_force)
    force = force + (arm.length - z)[..., None] * np.array(loads.force_per_length)
    for load in loads.point_loads:
        force = force + np.where((z < load.station)[..., None], np.array(load.force), 0.0)
    return force, loads.payload * gravity


class RodState(NamedTuple):
    """Shapes of one arm in equilibrium at the nodes of its steps, in the frame of the base."""

    gamma: Array
    """Activations of the inner arm, shape (n, bundle)."""
    directors: Array
    """d1, d2, d3 as rows at the nodes, shape (n, step, 3, 3, 3)."""
    moment: Array
    """m in the directors [N m], shape (n, step, 3, 3)."""
    position: Array
    """r at the wanted stations [m], shape (n, station, 3)."""
    place_directors: Array
    """Directors there, shape (n, station, 3, 3)."""
    tip_directors: Array
    """Directors of the tips, shape (n, 3, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""


def rod_state(rod: ArmRod, gamma: Array, table: NodeTables) -> RodState:
    """Equilibria of a rod at activations of its arm, at the nodes of its tables."""
    z = np.concatenate([table.stations.ravel(), table.places, [rod.length]])
    ascending, back = np.unique(np.clip(z, 0.0, rod.length), return_inverse=True)
    frames, moment, status = rod.with_moments(gamma, ascending)
    position, directors, moment = (values[:, back] for values in (*frames, moment))
    steps, count, wanted = table.stations.shape[0], table.stations.size, len(table.places)
    return RodState(
        gamma,
        directors[:, :count].reshape(-1, steps, 3, 3, 3),
        moment[:, :count].reshape(-1, steps, 3, 3),
        position[:, count : count + wanted],
        directors[:, count : count + wanted],
        directors[:, -1],
        status,
    )


def linear_response(
    table: NodeTables, state: RodState, changes: list[NodeTables], unit_loads: Array | None = None
) -> Response:
    """Movements of equilibria per unit of each activation, then of each change of the tables.

    The work of unit loads M and N at the nodes, shape (step, 3, 4, work), is computed, too.
    """
    n, bundles = state.gamma.shape
    if unit_loads is None:
        unit_loads = np.zeros((*table.length.shape, 4, 0))
    unit_loads = np.ascontiguousarray(unit_loads)
    change, columns = _changed_tables(table, changes), bundles + len(changes)
    lever, tipping = table.lever @ state.tip_directors, np.zeros((n, 3, columns))
    for k, other in enumerate(changes, bundles):  # moment of the payload at the same directors
        moved = other.lever @ state.tip_directors
        tipping[..., k] = np.cross(lever, other.weight) + np.cross(moved, table.weight)
    marks = np.searchsorted(table.stations[:, 1], np.sort(table.places))
    moves, turns = np.zeros((2, n, len(table.places), 3, columns))
    works = np.zeros((n, unit_loads.shape[-1], columns))

    def fill(rows: slice) -> None:
        for k in range(rows.start, rows.stop):
            answers = moves[k], turns[k], works[k]
            per_arm = _per_arm(table, change, state.gamma[k], state.directors[k], state.moment[k])
            given = unit_loads, lever[k], table.weight, tipping[k], marks
            respond(*per_arm, *given, *answers)

    parallel.run(partial(fill, block) for block in parallel.blocks(n, _TOGETHER))
    back = np.argsort(np.argsort(table.places, kind="stable"), kind="stable")
    return Response(moves[:, back], turns[:, back], works)


def _changed_tables(table: NodeTables, changes: list[NodeTables]) -> tuple[Array, ...]:
    """Changes of ζ̂ dZ, η dZ, U, 1/K0, K⁻¹, force and moment by column.

    Those of products are per activation, (..., column, bundle + 1), the last place at rest.
    """

    def stacked(name: str, axis: int) -> Array:
        whole = getattr(table, name)
        if not changes:
            return np.zeros(np.insert(np.array(whole.shape), whole.ndim + axis + 1, 0))
        return np.stack([getattr(change, name) for change in changes], axis=axis)

    length = stacked("length", -1)[..., None]
    each = table.length[..., None, None]

    def product(name: str) -> Array:
        by = length * getattr(table, name)[:, :, None] + each * stacked(name, -2)
        return np.concatenate([by, length], axis=-1)

    products = product("extension"), product("rest_length_factor")
    others = (stacked(name, -1) for name in ("thrust", "compliance", "force", "moment"))
    return *products, stacked("curvature", -2), *others


def _per_arm(
    table: NodeTables, change: tuple[Array, ...], gamma: Array, d: Array, moment: Array
) -> tuple[Array, ...]:
    """What the kernel wants of one arm."""
    by_stretch, by_rest_length, by_curvature, by_thrust, by_compliance, by_force, by_moment = change
    length, whole, axial = table.length, np.append(gamma, 1.0), table.thrust
    thrust = np.einsum("kic,kic->ki", d[..., 2, :], table.force)
    squeeze = axial * thrust  # n3/K0
    rest_length = length * (1.0 + table.rest_length_factor @ gamma)
    stretch = length * (1.0 + table.extension @ gamma) + rest_length * squeeze
    bend = table.curvature @ gamma + np.einsum("kiab,kib->kia", table.compliance, moment)
    each = length[..., None]
    grown, stretched = by_rest_length @ whole, by_stretch @ whole
    bent = by_curvature @ gamma + np.einsum("kiabc,kib->kiac", by_compliance, moment)
    bent += table.compliance @ d @ by_moment
    of_activations = (each * table.rest_length_factor)[:, :, None] * bend[..., None]
    of_activations += rest_length[..., None, None] * table.curvature
    of_changes = grown[:, :, None] * bend[..., None] + rest_length[..., None, None] * bent
    turning = np.concatenate([of_activations, of_changes], axis=-1)
    of_activations = each * (table.extension + table.rest_length_factor * squeeze[..., None])
    of_changes = stretched + grown * squeeze[..., None]
    of_changes += rest_length[..., None] * by_thrust * thrust[..., None]
    pushing = np.concatenate([of_activations, of_changes], axis=-1)
    yielding = np.zeros((*table.force.shape, turning.shape[-1]))
    yielding[..., len(gamma) :] = by_force
    return (
        rest_length,
        stretch,
        np.ascontiguousarray(table.compliance),
        table.thrust,
        np.ascontiguousarray(d),
        np.einsum("kic,kica->kia", moment, d),
        table.force,
        turning,
        pushing,
        yielding,
    )
