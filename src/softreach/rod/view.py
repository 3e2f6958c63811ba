"""Views of a tip map: in the world, of some bundles, in other measures, of stable tips alone.

How far two activations are apart has a meaning where all bundles share a unit. Where tensions,
pressures and strains drive one arm together it has none, until each is counted in its own range.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.kernels.rod.placing import move, turn
from softreach.rod.activation_box import ActivationBox
from softreach.rod.arm_rod import ArmRod
from softreach.rod.tip_map import (
    Array,
    Frame,
    Frames,
    Held,
    Status,
    StrainRange,
    Strains,
    TipMap,
    TipStatus,
    drop,
)
from softreach.support.arguments import as_instance
from softreach.support.lazy import lazy

__all__ = [
    "DerivedMap",
    "PlacedRod",
    "View",
    "activation_measures",
    "free_bundles",
    "measured_bundles",
    "stable_tips",
]


def free_bundles(rod: TipMap) -> TipMap:
    """The restriction of a tip map to its free bundles; the map itself if all are free."""
    as_instance("rod", rod, TipMap, "a TipMap")
    if rod.box.dimension == rod.box.bundles:
        return rod
    view = _view(rod)
    return replace(view, free=tuple(view.free[k] for k in rod.box.free))


def measured_bundles(rod: TipMap) -> TipMap:
    """A tip map whose activations are in `activation_measures`; the map itself if they are."""
    view, measures = _view(rod), activation_measures(rod.arm)
    names = rod.arm.input_names
    scale = tuple(float(measures[names.index(name)]) for name in view.base.box.names)
    return rod if scale == view.scale else replace(view, scale=scale)


def stable_tips(rod: TipMap) -> TipMap:
    """The tip map with NaN where the equilibrium is not stable; the map itself if it has none."""
    if not rod.supports_unstable or (isinstance(rod, View) and rod.only_stable):
        return rod
    return replace(_view(rod), only_stable=True)


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


def _view(rod: TipMap) -> View:
    if isinstance(rod, View):
        return rod
    bundles = rod.box.bundles
    return View(rod, (1.0,) * bundles, tuple(range(bundles)))


@dataclass(frozen=True, repr=False)
class DerivedMap(TipMap):
    """A tip map made of another one, which answers where nothing changes."""

    base: TipMap
    arm: Manipulator = field(init=False, compare=False)
    tol: float = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.base.arm)
        object.__setattr__(self, "tol", self.base.tol)

    @property
    def pose(self) -> Base:
        return self.base.pose

    @property
    def frame(self) -> Frame:
        return self.base.frame

    @property
    def supports_unstable(self) -> bool:
        return self.base.supports_unstable

    @property
    def is_smooth(self) -> bool:
        """True if tips depend smoothly on activations within the bounds, on each branch."""
        return self.base.is_smooth

    @property
    def kinks(self) -> list[Array]:
        """Values of each activation at which the map has a kink, whatever the others are."""
        return self.base.kinks

    @lazy
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.base.box

    def prepare(self) -> None:
        self.base.prepare()

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        return self.base.extension_and_turn(gamma)

    def activations(self, x: Array) -> Array:
        """Activations of the base at checked ones (n, bundles)."""
        return x

    def continued_from(self, gamma: Array) -> TipMap:
        base = self.base.continued_from(self.activations(gamma))
        return self if base is self.base else replace(self, base=base)

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held | None:
        return self.base.held(self.activations(gamma), sizes)

    def farthest(self) -> float:
        return self.base.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        return self.base.linearization_error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        return self.base.linearization_errors(centers, half_widths)

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        return self.base.strains_at(stations)

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        return self.base.strain_range(stations)


@dataclass(frozen=True, repr=False)
class PlacedRod(DerivedMap):
    """A free or loaded rod as the world sees it: r = r(0) + R r', with r' in the base's frame.

    Its base stands, hangs or leans anywhere.
    """

    base: ArmRod
    """The rod in the frame of its base."""

    @property
    def pose(self) -> Base:
        """Pose of the base in the world."""
        return self.arm.base

    @property
    def frame(self) -> Frame:
        """The world."""
        return "world"

    @property
    def steps(self) -> int:
        return self.base.steps

    def fill(
        self,
        gamma: Array,
        tips: Array,
        slopes: Array | None = None,
        *,
        twists: Array | None = None,
        status: Status | None = None,
        directions: Array | None = None,
    ) -> None:
        """Put tips, and what else is asked for, into place; they are turned and moved there."""
        self.base.fill(gamma, tips, slopes, twists=twists, status=status, directions=directions)
        rotation, position = np.array(self.pose.rotation), np.array(self.pose.position)
        move(tips, rotation, position)
        if slopes is not None:
            turn(slopes, rotation)
        if directions is not None:
            move(directions, rotation, np.zeros(3))
        if twists is not None:
            turn(twists, rotation)
            if position.any():  # v is that of the origin, which is another point now
                v, w = twists[:, :3], twists[:, 3:]
                for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
                    v[:, i] += position[j] * w[:, k] - position[k] * w[:, j]

    def held(self, gamma: Array, sizes: tuple[int, ...]) -> Held | None:
        held = super().held(gamma, sizes)
        if held is not None:
            for tips in (held.tips, held.end_tips):
                move(tips, np.array(self.pose.rotation), np.array(self.pose.position))
        return held

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        return self.placed(self.base.frames(activations, stations, status))

    def placed(self, frames: Frames) -> Frames:
        """Centerlines and directors in the world of those in the frame of the base."""
        directors = self.pose.directions_to_world(frames.directors)
        return Frames(self.pose.to_world(frames.position), directors)


@dataclass(frozen=True, repr=False)
class View(DerivedMap):
    """A tip map in other coordinates x of its activations, γ = offset + scale ∘ x.

    A search that takes NaN for a failed step ends at places that the arm can hold, where unstable
    equilibria are NaN as missing ones are.
    """

    base: TipMap
    """The map of all activations in their own units; no view itself."""
    scale: tuple[float, ...]
    """Size of one unit of x, for each bundle of the base."""
    free: tuple[int, ...]
    """The bundles of the base that x has; the others are fixed at their lower bounds."""
    only_stable: bool = False
    """True if unstable equilibria count as none."""

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of x."""
        base = self.base.box
        if self._is_plain:
            return base
        ends = np.stack([base.low, base.high], axis=1)[self._columns] / self.measures[:, None]
        return ActivationBox.between(ends, [base.names[j] for j in self.free])

    @lazy
    def measures(self) -> Array:
        """Size of one unit of each x in the unit of its activation, shape (bundles,)."""
        return np.array(self.scale, float)[self._columns]

    @property
    def kinks(self) -> list[Array]:
        """Values of each x at which the map has a kink, whatever the others are."""
        return [self.base.kinks[j] / self.scale[j] for j in self.free]

    @lazy
    def _columns(self) -> NDArray[np.intp]:
        return np.array(self.free, np.intp)

    @lazy
    def _is_plain(self) -> bool:
        """True if x are the activations of the base."""
        return len(self.free) == len(self.scale) and all(factor == 1.0 for factor in self.scale)

    def activations(self, x: Array) -> Array:
        """Activations of the base, (n, its bundles), at checked x (n, bundles)."""
        if self._is_plain:
            return x
        gamma = np.tile(self.base.box.low, (len(x), 1))
        gamma[:, self._columns] = x * self.measures
        return gamma

    def fill(
        self,
        gamma: Array,
        tips: Array,
        slopes: Array | None = None,
        *,
        twists: Array | None = None,
        status: Status | None = None,
        directions: Array | None = None,
    ) -> None:
        if self.only_stable and status is None:
            status = np.empty(len(gamma), np.int8)
        rooms = [  # for derivatives along all bundles of the base
            values
            if values is None or self._is_plain
            else np.empty((*values.shape[:2], len(self.scale)))
            for values in (slopes, twists)
        ]
        at = self.activations(gamma)
        self.base.fill(at, tips, rooms[0], twists=rooms[1], status=status, directions=directions)
        for room, values in zip(rooms, (slopes, twists), strict=True):
            if room is not None and room is not values:
                np.multiply(room[:, :, self._columns], self.measures, out=values)
        self._drop(status, tips, slopes, twists, directions)

    def _drop(self, status: Status | None, *values: Array | None) -> None:
        """Make NaN what is not stable where only that counts, and unstable ones as none."""
        if self.only_stable and status is not None:
            drop(np.flatnonzero(status != TipStatus.STABLE), None, *values)
            status[status == TipStatus.UNSTABLE] = TipStatus.NO_EQUILIBRIUM

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        return self.base.extension_and_turn(self.activations(gamma))

    def linearization_error(self, half_widths: Array) -> float:
        return self.base.linearization_error(self._widths(half_widths))

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        widths = self._widths(half_widths)
        return self.base.linearization_errors(self.activations(centers), widths)

    def _widths(self, half_widths: Array) -> Array:
        widths = np.zeros(len(self.scale))
        widths[self._columns] = half_widths * self.measures
        return widths

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        gamma = self.activations(self.box.check(activations))
        if self.only_stable and status is None:
            status = np.empty(len(gamma), np.int8)
        frames = self.base.frames(gamma, stations, status)
        self._drop(status, *frames)
        return frames

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        of_base = self.base.strains_at(stations)

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            gamma = self.activations(self.box.check(activations))
            if self.only_stable and status is None:
                status = np.empty(len(gamma), np.int8)
            strain = of_base(gamma, status)
            self._drop(status, *strain)
            return strain

        return strains
