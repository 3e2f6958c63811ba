"""The activation box: what the bundles may be activated to, and its map from the unit cube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput

__all__ = ["ActivationBox"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ActivationBox:
    """Bounds of activations; a bundle whose bounds are equal is held, the others are free."""

    bounds: tuple[tuple[float, float], ...]
    """(lower, upper) for each bundle, in its own unit."""
    names: tuple[str, ...]
    """A name for each bundle."""

    @classmethod
    def between(cls, bounds: ArrayLike, names: Sequence[str]) -> ActivationBox:
        """The box of an array of bounds, shape (bundles, 2)."""
        return cls(tuple((low, high) for low, high in np.asarray(bounds).tolist()), tuple(names))

    @property
    def bundles(self) -> int:
        """Number of bundles, free or held."""
        return len(self.bounds)

    @cached_property
    def low(self) -> Array:
        """Lower bounds, shape (bundles,)."""
        return _frozen(np.array([low for low, _ in self.bounds]))

    @cached_property
    def high(self) -> Array:
        """Upper bounds, shape (bundles,)."""
        return _frozen(np.array([high for _, high in self.bounds]))

    @cached_property
    def widths(self) -> Array:
        """Upper minus lower bounds, shape (bundles,)."""
        return _frozen(self.high - self.low)

    @cached_property
    def scales(self) -> Array:
        """`widths`, with 1 for held bundles: what changes of activation are measured by."""
        return _frozen(np.where(self.widths > 0, self.widths, 1.0))

    @cached_property
    def is_free(self) -> NDArray[np.bool_]:
        """Which bundles can move, shape (bundles,)."""
        return self.widths > 0

    @cached_property
    def free(self) -> NDArray[np.intp]:
        """Indices of the bundles that can move, shape (dimension,)."""
        return np.flatnonzero(self.is_free)

    @property
    def dimension(self) -> int:
        """Number of free bundles."""
        return len(self.free)

    @property
    def volume(self) -> float:
        """Product of the widths of the free bundles; 1 if none is."""
        return float(np.prod(self.widths[self.free]))

    def from_cube(self, cube: Array, out: Array | None = None) -> Array:
        """Activations of points of the unit cube that has an axis for every bundle.

        Args:
            cube: Points in [0, 1], shape (n, bundles).
            out: Where to put them; `cube` itself is allowed.

        Returns:
            Activations, shape (n, bundles), never outside the bounds.
        """
        scaled = np.multiply(cube, self.widths, out=out)
        return np.minimum(np.add(self.low, scaled, out=scaled), self.high, out=scaled)

    def from_free_cube(self, cube: Array) -> Array:
        """Activations of points of the unit cube of the free bundles; the others stay held.

        Args:
            cube: Points in [0, 1], shape (n, dimension).
        """
        whole = np.zeros((len(cube), self.bundles))
        whole[:, self.free] = cube
        return self.from_cube(whole, out=whole)

    def to_cube(self, activations: Array) -> Array:
        """Where activations lie in the unit cube, shape (n, bundles); held bundles at 0."""
        return (activations - self.low) / self.scales

    def check(self, activations: ArrayLike) -> Array:
        """The activations as an (n, bundles) float array, inside the bounds or not.

        Raises:
            InvalidInput: Another shape, or values that are not finite.
        """
        gamma = np.ascontiguousarray(activations, dtype=float)
        if gamma.ndim != 2 or gamma.shape[1] != self.bundles:
            allowed = f"of shape (n, {self.bundles}), one column per bundle"
            raise InvalidInput("activations.shape", gamma.shape, allowed)
        if gamma.size and not np.isfinite([gamma.min(), gamma.max()]).all():
            row = int(np.flatnonzero(~np.isfinite(gamma).all(axis=1))[0])
            raise InvalidInput(f"activations[{row}]", gamma[row], "finite numbers")
        return gamma

    def clip(self, activations: Array) -> Array:
        """The activations moved to the nearest bounds where they are outside."""
        return np.clip(activations, self.low, self.high)

    def excess(self, activations: Array) -> Array:
        """How far each bundle is outside its bounds, in widths; negative inside."""
        return np.maximum(self.low - activations, activations - self.high) / self.scales

    def margin(self, activations: Array) -> Array:
        """Distance to the nearest bound of a free bundle, in widths, shape (n,); 0 if none is."""
        if not self.dimension:
            return np.zeros(len(activations))
        room = np.minimum(activations - self.low, self.high - activations)
        return (room[:, self.free] / self.widths[self.free]).min(axis=1)

    def corners(self) -> Array:
        """All corners, shape (2^bundles, bundles), the last bundle varying fastest."""
        bits = np.indices((2,) * self.bundles).reshape(self.bundles, -1).T
        return self.from_cube(bits.astype(float))


def _frozen(values: Array) -> Array:
    values.setflags(write=False)
    return values
