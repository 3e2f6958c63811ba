"""The tip map of the bundles that are free to move, the others held where they are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.tip_map import Frames, StrainRange, Strains, TipMap

__all__ = ["FreeBundles", "free_bundles"]

Array = NDArray[np.float64]


def free_bundles(rod: TipMap) -> TipMap:
    """The restriction of a tip map to its free bundles; the map itself if all are free."""
    if rod.box.dimension == rod.box.bundles:
        return rod
    return FreeBundles(rod.arm, rod.tol, rod)


@dataclass(frozen=True, repr=False)
class FreeBundles(TipMap):
    """A tip map of which some bundles are held: activations and derivatives are of the others."""

    arm: Manipulator
    tol: float
    whole: TipMap
    """The map of all bundles."""

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return self.whole.supports_unstable

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds, of the free bundles."""
        return self._box

    @cached_property
    def _box(self) -> ActivationBox:
        return self.whole.box.of_free_bundles()

    def refined(self, tol: float) -> TipMap:
        """The map of the same bundles to a smaller tolerance; itself if its own is no larger.

        Args:
            tol: Largest tip error, in L.
        """
        return self if self.tol <= tol else free_bundles(self.whole.refined(tol))

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        self.whole.fill_tips(self._all(gamma), out)

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        self.whole.fill_tips_and_status(self._all(gamma), out, status)

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place."""
        of_all = np.empty((len(gamma), 3, self.whole.box.bundles))
        self.whole.fill_slopes(self._all(gamma), tips, of_all)
        slopes[:] = of_all[:, :, self.whole.box.free]

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """Put tips, ∂r/∂γ (n, 3, bundles) [m] and `TipStatus` (n,) into place."""
        of_all = np.empty((len(gamma), 3, self.whole.box.bundles))
        self.whole.fill_slopes_and_status(self._all(gamma), tips, of_all, status=status)
        slopes[:] = of_all[:, :, self.whole.box.free]

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        tips, twists = self.whole.tip_twists(self._all(self.box.check(activations)))
        return tips, np.ascontiguousarray(twists[:, :, self.whole.box.free])

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]."""
        return self.whole.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.whole.linearization_error(self._widths_of_all(half_widths))

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        return self.whole.linearization_errors(self._all(centers), self._widths_of_all(half_widths))

    def _widths_of_all(self, half_widths: Array) -> Array:
        whole = np.zeros(self.whole.box.bundles)
        whole[self.whole.box.free] = half_widths
        return whole

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return self.whole.frames(self._all(self.box.check(activations)), stations)

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        strains = self.whole.strains_at(stations)
        return lambda activations: strains(self._all(self.box.check(activations)))

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.whole.strain_range(stations)

    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.whole.radius(stations)

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation, shape (n,)."""
        return self.whole.status(self._all(self.box.check(activations)))

    def _all(self, gamma: Array) -> Array:
        return self.whole.box.with_held(gamma)
