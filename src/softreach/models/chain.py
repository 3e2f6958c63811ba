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

from softreach.arm.body import load_number, load_number_faults
from softreach.arm.driving import pilot
from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import strain_stations, tables
from softreach.support.arrays import Array

MOST_BODIES = 500

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True, eq=False, kw_only=True)
class Chain:
    """The elements of an arm, from base to tip, and the slides between their nodes."""

    edges: Array  # Ends of the elements [m], shape (element + 1,)
    masses: Array  # [kg], shape (element,)
    compliance: Array  # ∫ dZ/K about the directors [1/(N m)], 0 where rigid, (element, 3)
    turns: Array  # ∫ U dZ, per activation [rad], (element, 3, bundle)
    rest_turns: Array  # ∫ û dZ [rad], (element, 3)
    growth: Array  # Mean of dη/dγ [-], (element, bundle)
    axial_compliance: Array  # ∫ dZ/K0 of slides [m/N], 0 where rigid, (element + 1,)
    stretch: Array  # ∫ z dZ of slides, per activation [m], (element + 1, bundle)

    @property
    def nodes(self) -> Array:
        """Z of the middles of the elements [m], (element,)."""
        return 0.5 * (self.edges[1:] + self.edges[:-1])


def chain_of(arm: Manipulator, bodies: int) -> Chain:
    """The arm in about so many elements: each stretch between breakpoints has one or more."""
    knots = np.array([0.0, *arm.breakpoints, arm.length])
    counts = np.maximum(1, np.rint(bodies * np.diff(knots) / arm.length)).astype(int)
    spans = zip(knots[:-1], knots[1:], counts, strict=True)
    ends = [np.linspace(a, b, count, endpoint=False) for a, b, count in spans]
    edges = np.append(np.concatenate(ends), arm.length)
    half = np.repeat(np.diff(edges) / 4.0, 2)  # of the halves of elements
    starts = np.sort(np.concatenate([edges[:-1], 0.5 * (edges[1:] + edges[:-1])]))
    z = (starts[:, None] + half[:, None] * (1.0 + _NODES)).ravel()
    weights = (half[:, None] * _WEIGHTS).ravel()

    def integrals(values: Array) -> Array:
        each = (weights * np.asarray(values).T).T
        return each.reshape(len(half), len(_NODES), *each.shape[1:]).sum(axis=1)

    def of_elements(values: Array) -> Array:
        return integrals(values).reshape(len(half) // 2, 2, *values.shape[1:]).sum(axis=1)

    def of_slides(values: Array) -> Array:
        each = integrals(values)
        none = np.zeros((1, *each.shape[1:]))
        padded = np.concatenate([none, each, none])
        return padded.reshape(len(padded) // 2, 2, *each.shape[1:]).sum(axis=1)

    table, stiffness = tables(arm, z), arm.stiffness_at(z)
    return Chain(
        edges=edges,
        masses=of_elements(arm.section.mass_per_length_at(arm.profile, z)),
        compliance=of_elements(1.0 / arm.section.resistance(stiffness)),
        turns=of_elements(table.curvature),
        rest_turns=of_elements(arm.rest.curvature(z / arm.length)),
        growth=of_elements(table.rest_length_factor) / np.diff(edges)[:, None],
        axial_compliance=of_slides(1.0 / stiffness.axial),
        stretch=of_slides(table.extension),
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
