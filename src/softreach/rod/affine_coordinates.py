"""A tip map in other coordinates of its activations: what all of them delegate to the whole."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.frames import Frames, StrainRange, Strains
from softreach.rod.tip_map import TipMap

__all__ = ["AffineCoordinates"]

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class AffineCoordinates(TipMap):
    """A tip map that takes coordinates of which the activations of another are affine functions."""

    arm: Manipulator
    tol: float
    whole: TipMap
    """The map of all activations in their own units."""

    @abstractmethod
    def _activations(self, coordinates: Array) -> Array:
        """The activations of the whole, (n, its bundles), at checked coordinates (n, bundles)."""

    @abstractmethod
    def _widths(self, half_widths: Array) -> Array:
        """Changes of the activations of the whole, (its bundles,), by those of coordinates."""

    @abstractmethod
    def _derivatives(self, of_whole: Array) -> Array:
        """Derivatives along coordinates, (n, c, bundles), from those along activations."""

    def _checked(self, coordinates: ArrayLike) -> Array:
        return self._activations(self.box.check(coordinates))

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return self.whole.supports_unstable

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        self.whole.fill_tips(self._activations(gamma), out)

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        self.whole.fill_tips_and_status(self._activations(gamma), out, status)

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place."""
        of_whole = np.empty((len(gamma), 3, self.whole.box.bundles))
        self.whole.fill_slopes(self._activations(gamma), tips, of_whole)
        slopes[:] = self._derivatives(of_whole)

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """`fill_slopes`, and the `TipStatus` (n,) of each, on the calling thread."""
        of_whole = np.empty((len(gamma), 3, self.whole.box.bundles))
        at = self._activations(gamma)
        self.whole.fill_slopes_and_status(at, tips, of_whole, status=status)
        slopes[:] = self._derivatives(of_whole)

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        tips, twists = self.whole.tip_twists(self._checked(activations))
        return tips, np.ascontiguousarray(self._derivatives(twists))

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]."""
        return self.whole.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.whole.linearization_error(self._widths(half_widths))

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        widths = self._widths(half_widths)
        return self.whole.linearization_errors(self._activations(centers), widths)

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return self.whole.frames(self._checked(activations), stations)

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        strains = self.whole.strains_at(stations)
        return lambda activations: strains(self._checked(activations))

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.whole.strain_range(stations)

    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.whole.radius(stations)

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation, shape (n,)."""
        return self.whole.status(self._checked(activations))
