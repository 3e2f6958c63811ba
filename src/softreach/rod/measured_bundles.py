"""The tip map of activations in comparable measures, where their own units are not.

How far two activations are apart has a meaning where all bundles share a unit. Where tensions,
pressures and strains drive one arm together it has none, until each is counted in its own range.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.affine_coordinates import AffineCoordinates
from softreach.rod.steps import check_tol
from softreach.rod.tip_map import TipMap

__all__ = ["MeasuredBundles", "activation_measures", "bundle_measures", "measured_bundles"]

Array = NDArray[np.float64]


def activation_measures(arm: Manipulator) -> Array:
    """What changes of each activation are counted in, shape (bundles,).

    Strains count as they are. Where all bundles share another unit, the widest range is 1, so that
    distances keep their proportions; where units differ, the range of each bundle is.
    """
    units = set(arm.bundle_units)
    ranges = np.diff(arm.bounds, axis=1)[:, 0]
    if units == {"1"} or not ranges.any():
        return np.ones(arm.bundles)
    if len(units) == 1:
        return np.full(arm.bundles, ranges.max())
    return np.where(ranges > 0, ranges, np.maximum(np.abs(arm.bounds[:, 1]), 1.0))


def bundle_measures(rod: TipMap) -> Array:
    """`activation_measures` of those bundles of an arm that a tip map has, shape (bundles,)."""
    names = rod.arm.bundle_names
    return activation_measures(rod.arm)[[names.index(name) for name in rod.box.names]]


def measured_bundles(rod: TipMap) -> TipMap:
    """A tip map whose activations are in `activation_measures`; the map itself if those are 1."""
    if isinstance(rod, MeasuredBundles) or (bundle_measures(rod) == 1.0).all():
        return rod
    return MeasuredBundles(rod.arm, rod.tol, rod)


@dataclass(frozen=True, repr=False)
class MeasuredBundles(AffineCoordinates):
    """A tip map that takes activations in multiples of their measures."""

    @cached_property
    def measures(self) -> Array:
        """What one unit of each activation is, shape (bundles,)."""
        return bundle_measures(self.whole)

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self._box

    @cached_property
    def _box(self) -> ActivationBox:
        whole = self.whole.box
        ends = np.stack([whole.low, whole.high], axis=1) / self.measures[:, None]
        return ActivationBox.between(ends, whole.names)

    def refined(self, tol: float) -> TipMap:
        """The map in the same measures to a smaller tolerance; itself if its own is no larger."""
        return self if self.tol <= check_tol(tol) else measured_bundles(self.whole.refined(tol))

    def _activations(self, coordinates: Array) -> Array:
        return coordinates * self.measures

    def _widths(self, half_widths: Array) -> Array:
        return half_widths * self.measures

    def _derivatives(self, of_whole: Array) -> Array:
        return of_whole * self.measures
