"""Inputs of a tip map: their bounds, and γ(x), the activations of a rod at what a search changes.

x are some inputs in other units, so that changes of different kinds compare. Drives, tendons that
are driven by length and a shape at rest lead from inputs to activations.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.driving import Driving
from softreach.arm.manipulator import Manipulator
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
    """(lower, upper) for each bundle [unit of the bundle]."""
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
        pairs = as_rows("bounds", bounds, 2, "(lower, upper) of each bundle, shape (bundles, 2)")
        return cls(tuple((low, high) for low, high in pairs.tolist()), tuple(names))

    @lazy
    def bundles(self) -> int:
        """Number of bundles, free or fixed."""
        return len(self.bounds)

    @lazy
    def low(self) -> Array:
        """Lower bounds [unit of each bundle], shape (bundles,)."""
        return read_only(np.array([low for low, _ in self.bounds]))

    @lazy
    def high(self) -> Array:
        """Upper bounds [unit of each bundle], shape (bundles,)."""
        return read_only(np.array([high for _, high in self.bounds]))

    @lazy
    def widths(self) -> Array:
        """Upper minus lower bounds [unit of each bundle], shape (bundles,)."""
        return read_only(self.high - self.low)

    @lazy
    def scales(self) -> Array:
        """`widths`, with 1 for fixed bundles: changes are measured in them [unit of each]."""
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
        """Product of the widths of the free bundles [product of their units]; 1 if none is."""
        return float(np.prod(self.widths[self.free]))

    def from_cube(self, cube: Array, out: Array | None = None) -> Array:
        """Activations of points of the unit cube that has an axis for every bundle.

        They are never outside the bounds; shapes (n, bundles), and `out` may be `cube` itself.
        """
        gamma = np.multiply(cube, self.widths, out=out)
        gamma += self.low
        return np.minimum(gamma, self.high, out=gamma) if self._overshoots else gamma

    @lazy
    def _overshoots(self) -> bool:
        """True if rounding carries some low + width past its bound, where 1 would then lie."""
        return bool((self.low + self.widths > self.high).any())

    def from_free_cube(self, cube: Array) -> Array:
        """Activations of points (n, dimension) of the unit cube of the free bundles, in [0, 1]."""
        every = np.zeros((len(cube), self.bundles))
        every[:, self.free] = cube
        return self.from_cube(every, out=every)

    def with_fixed(self, activations: Array) -> Array:
        """Activations of all bundles from those of the free ones, shape (n, dimension)."""
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


@dataclass(frozen=True)
class Inputs:
    """The map γ(x), γ = γ(offset + scale ∘ x)."""

    own_box: ActivationBox
    """Bounds of all inputs, each in its own unit."""
    driving: Driving | None
    """The drives, lengths and shape at rest of an arm; None if inputs are activations."""
    scale: tuple[float, ...]
    """Size of one unit of x, for each input."""
    free: tuple[int, ...]
    """The inputs that x has; the others are fixed at their lower bounds."""

    @classmethod
    def of(cls, own_box: ActivationBox, driving: Driving | None = None) -> Inputs:
        """All inputs in their own units."""
        return cls(own_box, driving, (1.0,) * own_box.bundles, tuple(range(own_box.bundles)))

    @classmethod
    def of_drives(cls, arm: Manipulator) -> Inputs:
        """Those of an arm whose inputs are not the activations of its sections."""
        driving = Driving(arm)
        return cls.of(_bounds(driving), driving)

    def effective(self) -> Inputs:
        """Inputs that begin beyond the dead zones of drives."""
        assert self.driving is not None
        driving = replace(self.driving, is_effective=True)
        return replace(self, own_box=_bounds(driving), driving=driving)

    def measured(self, arm: Manipulator) -> Inputs:
        """The same in `activation_measures`."""
        measures = dict(zip(arm.input_names, activation_measures(arm).tolist(), strict=True))
        return replace(self, scale=tuple(measures[name] for name in self.own_box.names))

    def continued_from(self, activation: Array, frames: Array | None = None) -> Inputs:
        """Those of an arm in its posture at activations of the rod, see `TipMap.continued_from`."""
        if self.driving is None or self.driving.pulled is None:
            return self
        pulled = self.driving.pulled.continued_from(activation, frames)
        return replace(self, driving=replace(self.driving, pulled=pulled))

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of x."""
        if self.is_plain:
            return self.own_box
        ends = np.stack([self.own_box.low, self.own_box.high], axis=1)[self._columns]
        names = [self.own_box.names[j] for j in self.free]
        return ActivationBox.between(ends / self.measures[:, None], names)

    @lazy
    def measures(self) -> Array:
        """Size of one unit of each x in the unit of its input, shape (bundles,)."""
        return np.array(self.scale, float)[self._columns]

    @lazy
    def _columns(self) -> NDArray[np.intp]:
        return np.array(self.free, np.intp)

    @lazy
    def is_plain(self) -> bool:
        """True if x are all inputs in their own units."""
        return len(self.free) == len(self.scale) and all(factor == 1.0 for factor in self.scale)

    @lazy
    def are_activations(self) -> bool:
        """True if γ(x) = x."""
        return self.is_plain and self.driving is None

    @property
    def kinks(self) -> list[Array]:
        """Values of each x at which a tendon goes slack, for all values of the others."""
        if self.driving is None:
            return [np.empty(0)] * len(self.free)
        return [self.driving.kinks[j] / self.scale[j] for j in self.free]

    def every(self, x: Array) -> Array:
        """All inputs in their own units, at checked x (n, bundles)."""
        if self.is_plain:
            return x
        inputs = np.full((len(x), len(self.own_box.low)), self.own_box.low)
        inputs[:, self._columns] = x * self.measures
        return inputs

    def activations(self, x: Array) -> Array:
        """γ of the rod, (n, its bundles), at checked x; NaN where no tensions are found."""
        inputs = self.every(x)
        return inputs if self.driving is None else self.driving.activations(inputs)

    def with_slopes(self, x: Array) -> tuple[Array, Array | None]:
        """γ with ∂γ/∂(inputs); None where inputs are activations."""
        inputs = self.every(x)
        return (inputs, None) if self.driving is None else self.driving.with_slopes(inputs)

    def along_x(self, slopes: Array, of_drives: Array | None, out: Array) -> None:
        """Put derivatives along x (n, ..., bundles) into place, from those along activations."""
        if of_drives is not None:
            slopes = np.matmul(slopes, of_drives, out=out if self.is_plain else None)
        if not self.is_plain:
            np.multiply(slopes[:, :, self._columns], self.measures, out=out)

    def widths(self, half_widths: Array) -> Array | None:
        """Largest changes of activation for |dx| <= half_widths; None where γ(x) has kinks."""
        if not self.is_plain:
            own, half_widths = half_widths * self.measures, np.zeros(len(self.scale))
            half_widths[self._columns] = own
        if self.driving is None:
            return half_widths
        return np.abs(self.driving.gains) @ half_widths if self.driving.is_affine else None


def _bounds(driving: Driving) -> ActivationBox:
    return ActivationBox.between(driving.driven.input_bounds, driving.driven.input_names)


def activation_measures(arm: Manipulator) -> Array:
    """Measures in which changes of each activation are counted, shape (bundles,).

    Strains count as they are. Where all bundles share another unit, the widest range is 1, so that
    distances keep their proportions; where units differ, the range of each bundle is.
    """
    units = set(arm.input_units)
    ranges = np.diff(arm.input_bounds, axis=1)[:, 0]
    if units == {"1"} or not ranges.any():
        return np.ones(arm.inputs)
    if len(units) == 1:
        return np.full(arm.inputs, ranges.max())
    return np.where(ranges > 0, ranges, np.maximum(np.abs(arm.input_bounds[:, 1]), 1.0))
