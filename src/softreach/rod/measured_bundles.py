"""The tip map of activations in comparable measures, where their own units are not.

How far two activations are apart has a meaning where all bundles share a unit. Where tensions,
pressures and strains drive one arm together it has none, until each is counted in its own range.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.tip_map import Frames, StrainRange, Strains, TipMap

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
class MeasuredBundles(TipMap):
    """A tip map that takes activations in multiples of their measures."""

    arm: Manipulator
    tol: float
    whole: TipMap
    """The map of activations in their own units."""

    @cached_property
    def measures(self) -> Array:
        """What one unit of each activation is, shape (bundles,)."""
        return bundle_measures(self.whole)

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return self.whole.supports_unstable

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
        return self if self.tol <= tol else measured_bundles(self.whole.refined(tol))

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        self.whole.fill_tips(gamma * self.measures, out)

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        self.whole.fill_tips_and_status(gamma * self.measures, out, status)

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place."""
        self.whole.fill_slopes(gamma * self.measures, tips, slopes)
        slopes *= self.measures

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """Put tips, ∂r/∂γ (n, 3, bundles) [m] and `TipStatus` (n,) into place."""
        self.whole.fill_slopes_and_status(gamma * self.measures, tips, slopes, status=status)
        slopes *= self.measures

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        tips, twists = self.whole.tip_twists(self._own(activations))
        return tips, twists * self.measures

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]."""
        return self.whole.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.whole.linearization_error(half_widths * self.measures)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        return self.whole.linearization_errors(centers * self.measures, half_widths * self.measures)

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return self.whole.frames(self._own(activations), stations)

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        strains = self.whole.strains_at(stations)
        return lambda activations: strains(self._own(activations))

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.whole.strain_range(stations)

    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.whole.radius(stations)

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation, shape (n,)."""
        return self.whole.status(self._own(activations))

    def _own(self, activations: ArrayLike) -> Array:
        return self.box.check(activations) * self.measures
