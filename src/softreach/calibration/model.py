"""Predicted places of markers and their exact derivatives by the free numbers of an arm.

Tables are differentiated by differences of fourth order, which are good to ten digits and cost no
equilibrium; all that follows from them, how the arm moves, is the linear response of the rod.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm.base import Base
from softreach.arm.driving import Driving, body_of
from softreach.arm.guides import has_guides
from softreach.arm.manipulator import Manipulator
from softreach.arm.section import turned
from softreach.arm.tensions import LengthLaw, PulledTendons
from softreach.calibration.free_numbers import FreeNumbers, Neighbors
from softreach.calibration.measurements import Measurements
from softreach.kernels.rod.linear_response import WEIGHTS
from softreach.rod.free import ArmRod, FreeRod
from softreach.rod.loaded.rod import LoadedRod, LoadedTendons
from softreach.rod.response import (
    NodeTables,
    RodState,
    StepGrid,
    dead_forces,
    linear_response,
    node_tables,
    rod_state,
    step_grid,
)
from softreach.rod.tip_map import TipStatus
from softreach.support import parallel
from softreach.support.arrays import Array, Mask, joined, rows

_BLOCK = 1024  # samples at once: their shapes at all nodes are kept
_TOL = 1e-6
_STEPS = 24
_BODY = ("profile", "section", "actuators", "loads", "rest", "stations", "rigid_pieces", "markers")
"""Parts of an arm that are more than its drives and the pose of its base."""
_ENDS = ("start", "end", "stations.")  # In names of numbers that move ends of actuators


class Prediction(NamedTuple):
    """Predicted places of the markers of all samples."""

    places: Array  # In the world [m], NaN without an equilibrium, shape (n, marker, 3)
    slopes: Array  # Derivatives by the free numbers, (n, marker, 3, number); of none unless asked
    status: NDArray[np.int8]  # `TipStatus`, shape (n,)


class _Explicit(NamedTuple):
    """All that an arm says without its equilibrium."""

    table: NodeTables
    rotation: Array
    position: Array
    scale: float  # Of the data
    offsets: Array
    bundles: Array  # Activations of all bundles, displacements among them, (n, bundle)
    taut_from: Array
    compliance: Array
    measures: Array  # M and N of tendons driven by length at the nodes, (step, 3, 4, tendon)
    rest: Array  # û at rest at the nodes, (step, 3, 3)


_Around = list[Neighbors]  # Of each number
_Changes = list[_Explicit]  # By each number


def marker_stations(arm: Manipulator, names: Iterable[str]) -> tuple[Array, Array]:
    """Z [m] of some markers, or of the tip without any, and offsets in the directors [m]."""
    if not arm.markers:
        return np.array([arm.length]), np.zeros((1, 3))
    known = {marker.name: marker for marker in arm.markers}
    places = [known[name].station_at("station", arm.length) for name in names]
    return np.array(places), np.array([known[name].offset for name in names])


@dataclass(frozen=True, eq=False)
class MarkerModel:
    """Markers of an arm as functions of its free numbers, at given inputs."""

    free: FreeNumbers
    inputs: Array  # Shape (n, input)
    names: tuple[str, ...]  # Of the markers that were measured

    @classmethod
    def of(cls, free: FreeNumbers, data: Measurements) -> Self:
        """The model of measured poses."""
        return cls(free, data.inputs, data.marker_names)

    def predict(self, values: Array, *, slopes: bool = False) -> Prediction:
        """Places of the markers, and their derivatives if asked for; may raise InvalidDesign."""
        arm, scale = self.free.made(values), self.free.scaled(values)
        return self.of_arm(arm, scale, values if slopes else None)

    def of_arm(self, arm: Manipulator, scale: float = 1, values: Array | None = None) -> Prediction:
        """Places of the markers of an arm, in data of a scale; derivatives where it has values."""
        free, (stations, _) = self.free, marker_stations(arm, self.names)
        moving = any(word in name for name in free.names for word in _ENDS)
        grid = step_grid(body_of(arm), stations, _STEPS, moving_ends=moving)
        neighbors = [] if values is None else [free.neighbors(values, k) for k in range(len(free))]
        if has_guides(arm):
            near = [x for each in neighbors for _, x in each if isinstance(x, Manipulator)]
            if any(body_of(x).bundles != body_of(arm).bundles for x in near):  # of other arcs
                return self._by_differences(arm, scale, neighbors)
        blocks = (self.inputs[block] for block in parallel.blocks(len(self.inputs), _BLOCK))
        return joined([self._block(arm, scale, neighbors, grid, inputs) for inputs in blocks])

    def _by_differences(self, arm: Manipulator, scale: float, neighbors: _Around) -> Prediction:
        slopes = np.zeros((len(self.inputs), len(self.names), 3, len(neighbors)))
        for k, each in enumerate(neighbors):
            for factor, other in each:
                if isinstance(other, float | int):
                    near = arm, float(other)
                else:
                    near = arm.replace(base=other) if isinstance(other, Base) else other, scale
                slopes[..., k] += factor * self.of_arm(*near).places
        return self.of_arm(arm, scale)._replace(slopes=slopes)

    def _explicit(self, arm: Manipulator, scale: float, grid: StepGrid, inputs: Array) -> _Explicit:
        stations, offsets = marker_stations(arm, self.names)
        law, table = Driving(arm).law, node_tables(body_of(arm), stations, grid)
        bend, rise = (x[..., law.columns] for x in (table.curvature, table.extension[:, :, None]))
        measures, angle = np.zeros((*table.length.shape, 4, 0)), arm.section.bending_angle
        if len(law.columns):
            own = arm.section.stiffness_at(arm.profile, table.stations)
            moment = turned(bend, -angle) * arm.section.resistance(own)[..., None]
            force = rise * own.axial[..., None, None]
            measures = np.concatenate([turned(moment, angle), force], axis=-2)
        own, place = Driving(arm).bundles(inputs), np.array(arm.base.position)
        tendons = law.taut_from, law.compliance, measures, table.curvature @ law.rest[0]
        return _Explicit(table, arm.base.rotation, place, scale, offsets, own, *tendons)

    def _block(
        self, arm: Manipulator, scale: float, neighbors: _Around, grid: StepGrid, inputs: Array
    ) -> Prediction:
        at = self._explicit(arm, scale, grid, inputs)
        rod, tendons = self._rod(arm, grid)
        gamma, is_taut = at.bundles, np.empty((len(inputs), 0), bool)
        if not Driving(arm).is_bundles:
            gamma, is_taut = tendons.inner(gamma)
        lost = np.asarray(~np.isfinite(gamma).all(axis=1))
        gamma = np.where(lost[:, None], Driving(arm).law.rest, gamma)
        state = rod_state(rod, gamma, at.table)
        state.status[lost] = TipStatus.NO_EQUILIBRIUM
        places = at.position + at.scale * _beyond(at, state)[1] @ at.rotation.T
        places[lost] = np.nan
        slopes = np.full((*places.shape, len(neighbors)), np.nan)
        if neighbors:
            known = np.asarray(np.isfinite(places).all(axis=(1, 2)))
            some = rows(state, known)
            changes = [self._change(arm, at, each, grid, inputs) for each in neighbors]
            driven = np.stack([change.bundles[known] for change in changes], axis=-1)
            if isinstance(tendons, PulledTendons) and tendons.guides is not None:
                near = (changes, neighbors)
                driven = self._guided(arm, grid, tendons, some.gamma, is_taut[known], driven, near)
                slopes[known] = _slopes(rod.arm, at, some, changes, driven)
            else:
                slopes[known] = _slopes(rod.arm, at, some, changes, driven, by_length=True)
        return Prediction(places, slopes, state.status)

    def _rod(self, arm: Manipulator, grid: StepGrid) -> tuple[ArmRod, LengthLaw | PulledTendons]:
        """The rod of the inner arm, and how that takes what is pulled in."""
        driving = Driving(arm)
        body = body_of(arm).with_bounds(driving.law.rest.T + np.zeros(2))  # which decide nothing
        kind, steps = FreeRod if arm.loads is None else LoadedRod, int(grid.counts.sum())
        rod = kind(body, _TOL, steps)
        return rod, driving.tendons if arm.loads is None else LoadedTendons(driving.law, rod)

    def _guided(
        self,
        arm: Manipulator,
        grid: StepGrid,
        tendons: PulledTendons,
        gamma: Array,
        is_taut: Mask,
        pulled: Array,
        near: tuple[_Changes, _Around],
    ) -> Array:
        """Derivatives of the rod's activations with guides, by those with displacements."""
        columns, on_arcs = tendons.law.columns, np.zeros_like(pulled)
        for k, (change, neighbors) in enumerate(zip(*near, strict=True)):
            own = gamma[:, columns] * change.compliance + change.taut_from
            for factor, other in neighbors:
                if isinstance(other, float | int):
                    continue
                made = arm.replace(base=other) if isinstance(other, Base) else other
                _, there = self._rod(made, grid)
                assert isinstance(there, PulledTendons)
                assert there.guides is not None
                arcs, pulls = there.works(gamma, there.guides.works), there.guides.columns
                loads = there.guides.on_arcs(arcs, gamma[:, pulls])
                on_arcs[:, there.guides.loads, k] += factor * loads
                own += factor * there.shortening(gamma)
            pulled[:, columns, k] -= own
        return tendons.response(gamma, is_taut, pulled, on_arcs)

    def _change(
        self, arm: Manipulator, at: _Explicit, neighbors: Neighbors, grid: StepGrid, inputs: Array
    ) -> _Explicit:
        factors, each = [factor for factor, _ in neighbors], list[_Explicit]()
        for _, other in neighbors:
            if isinstance(other, float | int):
                each.append(at._replace(scale=other))
            elif isinstance(other, Base):  # gravity alone is another one in its frame
                force, weight = dead_forces(arm, other, at.table.stations, at.table.length)
                table = at.table._replace(force=force, weight=weight)
                place = np.array(other.position)
                each.append(at._replace(table=table, rotation=other.rotation, position=place))
            elif any(getattr(arm, part) != getattr(other, part) for part in _BODY):
                each.append(self._explicit(other, at.scale, grid, inputs))
            else:  # the same body, and so the same tables
                each.append(at._replace(bundles=Driving(other).bundles(inputs)))
        table = each[0].table.combined([other.table for other in each], factors)
        columns = zip(*(other[1:] for other in each), strict=True)
        others = (np.tensordot(factors, np.stack(column), axes=1) for column in columns)
        return _Explicit._make([table, *others])


def _beyond(at: _Explicit, state: RodState) -> tuple[Array, Array]:
    """Offsets in the frame of the base, and places there, (n, marker, 3) each."""
    offset = np.einsum("mk,nmka->nma", at.offsets, state.place_directors)
    return offset, state.position + offset


def _slopes(
    arm: Manipulator,
    at: _Explicit,
    state: RodState,
    changes: _Changes,
    driven: Array,
    *,
    by_length: bool = False,
) -> Array:
    """Derivatives of places, (n, marker, 3, number); `driven` are those of activations."""
    bundles = state.gamma.shape[1]
    tables = [change.table for change in changes]
    response = linear_response(at.table, state, tables, at.measures)
    if by_length and at.measures.shape[-1]:
        driven = _with_tensions(arm, at, state, changes, driven, response.works)
    rule, parts = "nmaj,njk->nmak", (response.moves, response.turns)
    by_inputs = (np.einsum(rule, each[..., :bundles], driven) for each in parts)
    moves, turns = (x[..., bundles:] + y for x, y in zip(parts, by_inputs, strict=True))
    offset, place = _beyond(at, state)
    slopes = moves + np.cross(turns, offset[..., None], axisa=2, axisb=2, axisc=2)
    for k, change in enumerate(changes):
        slopes[..., k] += np.einsum("mk,nmka->nma", change.offsets, state.place_directors)
    slopes = at.scale * np.einsum("ab,nmbk->nmak", at.rotation, slopes)
    for k, change in enumerate(changes):
        turned = change.scale * at.rotation + at.scale * change.rotation
        slopes[..., k] += change.position + place @ turned.T
    return slopes


def _with_tensions(
    arm: Manipulator, at: _Explicit, state: RodState, changes: _Changes, driven: Array, works: Array
) -> Array:
    """Derivatives of activations with those of tensions in place of displacements.

    A taut tendon keeps s + τ/k = q - taut_from, with s the work of its tension on the strains.
    """
    law = LengthLaw(arm)
    columns, bundles = law.columns, state.gamma.shape[1]
    tension, strains = state.gamma[:, columns], _strains(at, state)
    own = [
        _explicit_shortening(at, each, *strains) + tension * each.compliance + each.taut_from
        for each in changes
    ]
    # The other changes act as if so much less were pulled in.
    pulled = driven.copy()
    pulled[:, columns] -= np.stack(own, axis=-1) + works[..., bundles:]
    return law.slopes_of_taut(state.gamma, tension > 0, works[..., :bundles]) @ pulled


def _strains(at: _Explicit, state: RodState) -> tuple[Array, Array]:
    """ω dZ (n, step, 3, 3) and (ζ - 1) dZ (n, step, 3) at the nodes."""
    table, gamma = at.table, state.gamma
    rest_length = table.length * (1.0 + np.einsum("kij,nj->nki", table.rest_length_factor, gamma))
    bend = np.einsum("kicj,nj->nkic", table.curvature, gamma)
    yields = np.einsum("kiab,nkib->nkia", table.compliance, state.moment)
    bend = rest_length[..., None] * (bend + yields)
    thrust = np.einsum("nkic,kic->nki", state.directors[..., 2, :], table.force)
    rise = table.length * np.einsum("kij,nj->nki", table.extension, gamma)
    return bend, rise + rest_length * table.thrust * thrust


def _explicit_shortening(at: _Explicit, change: _Explicit, bend: Array, rise: Array) -> Array:
    """Change of s at the same strains, (n, tendon): theory of `LengthLaw`."""
    weights, turn, force = WEIGHTS, at.measures[:, :, :3], at.measures[:, :, 3]
    new_turn, new_force = change.measures[:, :, :3], change.measures[:, :, 3]
    length, grown = at.table.length[..., None], change.table.length
    bent = bend - (length * at.rest)[None]
    moved = length * change.rest + grown[..., None] * at.rest
    return (
        np.einsum("i,kict,nkic->nt", weights, new_turn, bent)
        + np.einsum("i,kit,nki->nt", weights, new_force, rise)
        - np.einsum("i,kit,ki->t", weights, force, grown)
        - np.einsum("i,kict,kic->t", weights, turn, moved)
    )
