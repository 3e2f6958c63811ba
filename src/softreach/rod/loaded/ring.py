"""Where an arm leans that nothing holds at rest.

A tall column has no stable posture at rest but a ring of leaning ones, all around the direction of
its loads. Activations, however small, lean it to one side of the ring.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.sphere_maps import is_axisymmetric, pole_rings
from softreach.rod.free import FreeRod
from softreach.rod.loaded.phase import SHOT_AT_ONCE
from softreach.rod.loaded.shooting import Shots

if TYPE_CHECKING:
    from softreach.rod.loaded.solver import Solver

__all__ = ["NEUTRAL", "SYMMETRIC", "Ring"]

Array = NDArray[np.float64]

_TURNS = np.pi / 16 * np.array([0, *(sign * k for k in range(1, 17) for sign in (1, -1))])
"""Azimuths beside the one to which the unloaded arm bends, at which the arm is looked for."""
NEUTRAL = 1e-5
"""What tolerances leave of the margin of a ring, which is 0."""
SYMMETRIC = 1e-6
"""Of the directions that the base of an axisymmetric arm would have to see [rad]."""
_STRAIGHT = 1e-8  # [L], aside, of an arm that no activation leans to any side


@dataclass(frozen=True, eq=False)
class Ring:
    """The ring of one arm under loads along one direction."""

    frame: Array
    """As in `Equilibria`, of one arm of the ring, shape (component,)."""
    azimuth: float
    """To which this one leans, about the first axis of the world [rad]."""

    @classmethod
    def at_rest(cls, solver: Solver, rest: Array) -> Ring | None:
        """The ring of an arm at rest (1, bundles).

        None where there is none, loads have several directions, or are too heavy for a search.
        """
        tables, axis = solver.tables, solver.tables.axes[0]
        if not tables.one_direction or tables.phase.entire > SHOT_AT_ONCE:
            return None

        image = solver.base_map(rest)
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
        return cls(frame, float(_azimuth(shapes.frames.position[:, 0], tables.axes)[first]))

    def near(self, twin: Solver, gamma: Array) -> Shots:
        """Stable equilibria of the twin near the ring, under small activations (n, bundles).

        They lean to about where the activations bend the unloaded arm; without a bend none is
        found.
        """
        shots, tables = twin.careful(gamma, None), twin.tables
        shots.is_found[:] = False
        bent = FreeRod(tables.arm, 1e-6).tips(gamma)
        bends = np.linalg.norm(bent @ tables.axes[1:].T, axis=1) > _STRAIGHT * tables.arm.length
        there = _azimuth(bent, tables.axes) - self.azimuth
        for turn in _TURNS:
            left = np.flatnonzero(bends & ~shots.is_found)
            found = twin.careful(gamma[left], self._turned(there[left] + turn, tables.axes))
            good = found.is_found & (found.margin > 0.0)
            shots.put(left[good], found.of(good))
        return shots

    def _turned(self, angles: Array, axes: Array) -> Array:
        """Frames of other arms of the ring, shape (n, component)."""
        turns = np.zeros((len(angles), 3, 3))
        turns[:, 0, 0] = 1.0
        turns[:, 1, 1] = turns[:, 2, 2] = np.cos(angles)
        turns[:, 2, 1] = np.sin(angles)
        turns[:, 1, 2] = -turns[:, 2, 1]
        turned = self.frame.reshape(-1, 3) @ axes.T @ turns.transpose(0, 2, 1) @ axes
        return turned.reshape(len(angles), self.frame.size)


def _azimuth(places: Array, axes: Array) -> Array:
    """About the first axis [rad]."""
    return np.arctan2(places @ axes[2], places @ axes[1])
