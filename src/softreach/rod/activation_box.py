"""The activation box: bounds of the bundles, and its map from the unit cube."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.support.arrays import Array, as_rows, labeled, read_only
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy


@dataclass(frozen=True)
class ActivationBox:
    """Bounds of activations; a bundle whose bounds are equal is fixed, the others are free.

    Raises:
        InvalidInput: No pair lower <= upper of finite numbers and no name for each bundle.
    """

    bounds: tuple[tuple[float, float], ...]
    """(lower, upper) for each bundle, in its own unit."""
    names: tuple[str, ...]
    """A name for each bundle."""

    def __post_init__(self) -> None:
        if not all(-np.inf < low <= high < np.inf for low, high in self.bounds):
            raise InvalidInput("bounds", self.bounds, "pairs of finite numbers, lower <= upper")
        if len(self.names) != len(self.bounds):
            raise InvalidInput("names", self.names, f"{len(self.bounds)}: one for each bundle")

    @classmethod
    def between(cls, bounds: ArrayLike, names: Sequence[str]) -> ActivationBox:
        """The box of an array of bounds, shape (bundles, 2)."""
        pairs = as_rows(
            "bounds", bounds, 2, "(lower, upper) of each bundle, shape (bundles, 2)"
        ).tolist()
        return cls(tuple((low, high) for low, high in pairs), tuple(names))

    @property
    def bundles(self) -> int:
        """Number of bundles, free or fixed."""
        return len(self.bounds)

    @lazy
    def low(self) -> Array:
        """Lower bounds, shape (bundles,)."""
        return read_only(np.array([low for low, _ in self.bounds]))

    @lazy
    def high(self) -> Array:
        """Upper bounds, shape (bundles,)."""
        return read_only(np.array([high for _, high in self.bounds]))

    @lazy
    def widths(self) -> Array:
        """Upper minus lower bounds, shape (bundles,)."""
        return read_only(self.high - self.low)

    @lazy
    def scales(self) -> Array:
        """`widths`, with 1 for fixed bundles: the measure of changes of activation."""
        return read_only(np.where(self.widths > 0, self.widths, 1.0))

    @lazy
    def is_free(self) -> NDArray[np.bool_]:
        """Mask of the bundles that can move, shape (bundles,)."""
        return self.widths > 0

    @lazy
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
            out: Array to put them into; `cube` itself is allowed.

        Returns:
            Activations, shape (n, bundles), never outside the bounds.
        """
        gamma = np.multiply(cube, self.widths, out=out)
        gamma += self.low
        return np.minimum(gamma, self.high, out=gamma) if self._overshoots else gamma

    @lazy
    def _overshoots(self) -> bool:
        """True if rounding carries some low + width past its bound, where 1 would then lie."""
        return bool((self.low + self.widths > self.high).any())

    def from_free_cube(self, cube: Array) -> Array:
        """Activations of points of the unit cube of the free bundles; the others stay fixed.

        Args:
            cube: Points in [0, 1], shape (n, dimension).
        """
        every = np.zeros((len(cube), self.bundles))
        every[:, self.free] = cube
        return self.from_cube(every, out=every)

    def with_fixed(self, activations: Array) -> Array:
        """Activations of all bundles from those of the free ones; the others stay fixed.

        Args:
            activations: Shape (n, dimension).
        """
        if self.dimension == self.bundles:
            return activations
        every = np.tile(self.low, (len(activations), 1))
        every[:, self.free] = activations
        return every

    def to_cube(self, activations: Array) -> Array:
        """Points of the unit cube of activations, shape (n, bundles); fixed bundles at 0."""
        return (activations - self.low) / self.scales

    def check(self, activations: ArrayLike) -> Array:
        """The activations as an (n, bundles) float array, inside the bounds or not.

        Raises:
            InvalidInput: Another shape, or values that are not finite.
        """
        allowed = f"an array of numbers of shape (n, {self.bundles}), one column per bundle"
        gamma = labeled("activations", activations, self.names)
        return as_rows("activations", gamma, self.bundles, allowed)

    def clip(self, activations: Array) -> Array:
        """Activations (n, bundles) moved to the nearest bounds where they are outside."""
        return np.clip(activations, self.low, self.high)

    def excess(self, activations: Array) -> Array:
        """Distance of each bundle beyond its bounds, in `scales`, (n, bundles); negative inside."""
        return np.maximum(self.low - activations, activations - self.high) / self.scales

    def margin(self, activations: Array) -> Array:
        """Distance to the nearest bound of a free bundle, in widths, shape (n,); 0 if none is."""
        if not self.dimension:
            return np.zeros(len(activations))
        room = np.minimum(activations - self.low, self.high - activations)
        return (room[:, self.free] / self.widths[self.free]).min(axis=1)

    def corners(self) -> Array:
        """All corners, shape (2^bundles, bundles), the last bundle varying fastest."""
        upper = np.indices((2,) * self.bundles).reshape(self.bundles, 2**self.bundles).T
        return np.where(upper, self.high, self.low)
