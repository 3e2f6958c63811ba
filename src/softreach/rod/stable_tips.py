"""The tip map of stable equilibria alone: whatever else an arm under loads has counts as none."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.frames import Frames, StrainRange, Strains, TipMotions
from softreach.rod.steps import check_tol
from softreach.rod.tip_map import TipMap, TipStatus

__all__ = ["StableTips", "stable_tips"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def stable_tips(rod: TipMap) -> TipMap:
    """The tip map with NaN where the equilibrium is not stable; a map that is stable itself."""
    if isinstance(rod, StableTips) or not rod.supports_unstable:
        return rod
    return StableTips(rod.arm, rod.tol, rod)


@dataclass(frozen=True, repr=False)
class StableTips(TipMap):
    """A tip map whose unstable equilibria are NaN, as its missing ones are.

    A search that takes NaN for a failed step therefore ends at places that the arm can hold.
    """

    arm: Manipulator
    tol: float
    whole: TipMap
    """The map of all equilibria on the branch of the unloaded arm."""

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return True

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.whole.box

    def refined(self, tol: float) -> TipMap:
        """The map of the same arm to a smaller tolerance; itself if its own is no larger."""
        return self if self.tol <= check_tol(tol) else stable_tips(self.whole.refined(tol))

    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""
        self.fill_tips_and_status(gamma, out, np.empty(len(gamma), np.int8))

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        self.whole.fill_tips_and_status(gamma, out, status)
        _drop(status, out)

    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place."""
        self.fill_slopes_and_status(gamma, tips, slopes, status=np.empty(len(gamma), np.int8))

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """Put tips, ∂r/∂γ (n, 3, bundles) [m] and `TipStatus` (n,) into place."""
        self.whole.fill_slopes_and_status(gamma, tips, slopes, status=status)
        _drop(status, tips, slopes)

    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation."""
        tips, twists = self.whole.tip_twists(activations)
        _drop(self.whole.status(activations), tips, twists)
        return tips, twists

    def tip_motions(self, activations: ArrayLike) -> TipMotions:
        """Positions and directions of the tips with their derivatives."""
        motions = self.whole.tip_motions(activations)
        _drop(self.whole.status(activations), *motions)
        return motions

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]."""
        return self.whole.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.whole.linearization_error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        return self.whole.linearization_errors(centers, half_widths)

    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        frames = self.whole.frames(activations, stations)
        _drop(self.whole.status(activations), *frames)
        return frames

    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        of_all = self.whole.strains_at(stations)

        def strains(activations: ArrayLike) -> Strains:
            found = of_all(activations)
            _drop(self.whole.status(activations), *found)
            return found

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.whole.strain_range(stations)

    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.whole.radius(stations)

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation: stable, or none, shape (n,)."""
        status = self.whole.status(activations)
        _drop(status)
        return status


def _drop(status: NDArray[np.int8], *values: Array) -> None:
    """Make NaN, and say that there is no equilibrium, where it is not stable."""
    lost = status != TipStatus.STABLE
    status[lost] = TipStatus.NO_EQUILIBRIUM
    for some in values:
        some[lost] = np.nan
