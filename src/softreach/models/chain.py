"""An arm as a chain of bodies: hinges and a slide between neighbors, lumped at second order.

The arm is cut into elements, none of which reaches over a breakpoint. Each has its hinges and its
mass in its middle, its node; between neighboring nodes there is a slide, which is half of either
element. What an element turns by, and what a slide stretches by, are integrals of the strains over
it, so that an arm without loads turns as the rod does; tips converge with the square of its length.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from softreach.arm.actuators import LengthTendon, Tendon
from softreach.arm.body import load_number, load_number_faults
from softreach.arm.driving import pilot
from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.arm.section import turned
from softreach.arm.tables import check_extension, strain_stations, tables
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, NotPossible

MOST_BODIES = 500

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, eq=False, kw_only=True)
class Elements:
    """An arm cut into elements from base to tip, with Gauss nodes in each half of them."""

    edges: Array  # Ends of the elements [m], shape (element + 1,)
    stations: Array  # Z of the Gauss nodes [m], (node,)
    weights: Array  # [m], (node,)

    @property
    def nodes(self) -> Array:
        """Z of the middles of the elements [m], (element,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])

    def inside(self, values: Array) -> Array:
        """∫ dZ over each element of values at the stations, shape (element, ...)."""
        return self._sums(values, 0)

    def between(self, values: Array) -> Array:
        """∫ dZ from base to tip, cut at the middles of the elements, shape (element + 1, ...)."""
        return self._sums(values, len(_NODES))

    def _sums(self, values: Array, second: int) -> Array:
        starts = np.union1d(0, np.arange(second, len(self.weights), 2 * len(_NODES)))
        return np.add.reduceat((self.weights * np.asarray(values).T).T, starts)


@dataclass(frozen=True, eq=False, kw_only=True)
class Chain(Elements):
    """The elements of an arm, and the slides between their nodes."""

    masses: Array  # [kg], shape (element,)
    compliance: Array  # ∫ dZ/K about the axes of K [1/(N m)], 0 where rigid, (element, 3)
    turns: Array  # ∫ U dZ about these, per activation [rad], (element, 3, bundle)
    rest_turns: Array  # ∫ û dZ about these [rad], (element, 3)
    growth: Array  # Mean of dη/dγ [-], (element, bundle)
    axial_compliance: Array  # ∫ dZ/K0 of slides [m/N], 0 where rigid, (element + 1,)
    stretch: Array  # ∫ z dZ of slides, per activation [m], (element + 1, bundle)


def check_simulated(arm: Manipulator, model: str) -> None:
    """Refuse what no simulation of an arm has."""
    why = "for a model that moves"
    if faults := arm.section.modulus_faults(why) + arm.section.density_faults(why):
        raise InvalidDesign(faults)
    check_extension(arm)
    loads = arm.loads or Loads()
    weight = {name: getattr(loads, name) for name in ("gravity", "payload", "payload_arm")}
    tendons = [each for each in arm.actuators if isinstance(each, Tendon)]
    refused = {
        "drives: export the design without them, and let the controller apply their gains": (
            arm.drives
        ),
        "tendons driven by length: make them Tendons, whose control is the tension": (
            any(isinstance(each, LengthTendon) for each in tendons)
        ),
        "tendons that guides hold: make their `guides` 0": (
            any(each.has_guides for each in tendons)
        ),
        "a rest shape of an arm with rigid pieces: leave one of them out": (
            arm.rigid_pieces and not arm.rest.is_straight
        ),
        "forces and moments of the loads: set `xfrc_applied` of bodies, or a forcing of the rod": (
            loads != Loads(**weight)
        ),
    }
    for what, is_there in refused.items():
        if is_there:
            raise NotPossible(f"{model} has no {what}")


def elements_of(arm: Manipulator, count: int) -> Elements:
    """The arm in about so many elements: each stretch between breakpoints has one or more."""
    knots = np.array([0.0, *arm.breakpoints, arm.length])
    counts = np.maximum(1, np.rint(count * np.diff(knots) / arm.length)).astype(int)
    spans = zip(knots[:-1], knots[1:], counts, strict=True)
    ends = [np.linspace(a, b, pieces, endpoint=False) for a, b, pieces in spans]
    edges = np.append(np.concatenate(ends), arm.length)
    half = np.repeat(np.diff(edges) / 4.0, 2)  # of the halves of elements
    starts = np.sort(np.concatenate([edges[:-1], 0.5 * (edges[1:] + edges[:-1])]))
    z = (starts[:, None] + half[:, None] * (1.0 + _NODES)).ravel()
    return Elements(edges=edges, stations=z, weights=(half[:, None] * _WEIGHTS).ravel())


def chain_of(arm: Manipulator, bodies: int) -> Chain:
    """The arm as a chain of about so many bodies."""
    elements = elements_of(arm, bodies)
    z = elements.stations
    table, stiffness, angle = tables(arm, z), arm.stiffness_at(z), -arm.section.bending_angle
    rest = arm.rest.curvature(z / arm.length)[..., None]
    return Chain(
        **vars(elements),
        masses=elements.inside(arm.section.mass_per_length_at(arm.profile, z)),
        compliance=elements.inside(1.0 / arm.section.resistance(stiffness)),
        turns=elements.inside(turned(table.curvature, angle)),
        rest_turns=elements.inside(turned(rest, angle)[..., 0]),
        growth=elements.inside(table.rest_length_factor) / np.diff(elements.edges)[:, None],
        axial_compliance=elements.between(1.0 / stiffness.axial),
        stretch=elements.between(table.extension),
    )


def bodies_for(arm: Manipulator, tol: float) -> int:
    """Elements for a tip error [L]: an arc that turns by T is off by about T²/(12n²).

    T is the largest turn of the arm, and counts more where bundles wind around it.
    """
    z, (low, high) = strain_stations(arm), arm.bounds.T
    bends = (low + pilot(arm.bundles) * (high - low)) @ np.moveaxis(tables(arm, z).curvature, 2, 1)
    bends += arm.rest.curvature(z / arm.length)[:, None]
    turn = float(np.trapezoid(np.linalg.norm(bends, axis=-1), z, axis=0).max())
    wound = np.abs(np.diff(arm.outline(z).center, axis=0)).sum(axis=0).max(initial=0.0)
    turn = math.sqrt(turn * (turn + float(wound)))
    if arm.loads is not None and not load_number_faults(arm):
        turn += min(load_number(arm), math.pi)
    return min(max(8, math.ceil(turn / math.sqrt(12.0 * tol))), MOST_BODIES)
