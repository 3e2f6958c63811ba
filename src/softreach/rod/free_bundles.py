"""The tip map of the bundles that are free to move, the others held where they are."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softreach.rod.activation_box import ActivationBox
from softreach.rod.affine_coordinates import AffineCoordinates
from softreach.rod.steps import check_tol
from softreach.rod.tip_map import TipMap, a_tip_map
from softreach.support.arguments import checked

__all__ = ["FreeBundles", "free_bundles"]

Array = NDArray[np.float64]


@checked(rod=a_tip_map)
def free_bundles(rod: TipMap) -> TipMap:
    """The restriction of a tip map to its free bundles; the map itself if all are free."""
    if rod.box.dimension == rod.box.bundles:
        return rod
    return FreeBundles(rod.arm, rod.tol, rod)


@dataclass(frozen=True, repr=False)
class FreeBundles(AffineCoordinates):
    """A tip map of which some bundles are held: activations and derivatives are of the others."""

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
        return self if self.tol <= check_tol(tol) else free_bundles(self.whole.refined(tol))

    def _activations(self, coordinates: Array) -> Array:
        return self.whole.box.with_held(coordinates)

    def _widths(self, half_widths: Array) -> Array:
        widths = np.zeros(self.whole.box.bundles)
        widths[self.whole.box.free] = half_widths
        return widths

    def _derivatives(self, of_whole: Array) -> Array:
        return of_whole[:, :, self.whole.box.free]
