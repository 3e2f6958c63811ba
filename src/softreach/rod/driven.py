"""Rods of arms whose activations are not those of the sections.

At rest they are bent already, or a displacement of a tendon decides its tension.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.driving import Driving, InnerActivations, inner_arm, pilot, without_dead_zones
from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.arm_rod import ArmRod
from softreach.rod.tip_map import (
    Array,
    Frames,
    Status,
    StrainRange,
    Strains,
    TipMap,
    TipStatus,
    drop,
    sampled_range,
)
from softreach.rod.view import DerivedMap, PlacedRod
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    from softreach.rod.loaded.pulled import LoadedLengths

__all__ = ["DrivenRod", "inner_rod"]

_OF_LENGTHS = 0.03
"""Tolerance of shapes of which lengths are taken, over that of tips."""


@dataclass(frozen=True, repr=False)
class DrivenRod(DerivedMap):
    """The map from the activations x of an arm through those of its inner arm, γ(x)."""

    base: ArmRod | PlacedRod
    """The map of the inner arm."""
    outer: Manipulator
    """The arm that is driven."""
    is_effective: bool = False
    """True if x are inputs beyond the dead zones of the drives."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "arm", self.outer)

    @property
    def steps(self) -> int:
        return self.base.steps

    @property
    def is_smooth(self) -> bool:
        """True if γ(x) has no kinks within the bounds."""
        return self.driving.is_smooth and self.base.is_smooth

    @property
    def kinks(self) -> list[Array]:
        """Values of each x at which a tendon goes slack, whatever the others are."""
        return self.driving.kinks

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of x."""
        arm = self.driving.arm
        return ActivationBox.between(arm.input_bounds, arm.input_names)

    @lazy
    def driving(self) -> Driving:
        """The map γ(x) of the arm without loads."""
        return Driving(without_dead_zones(self.outer) if self.is_effective else self.outer)

    def inputs(self, x: Array) -> Array:
        """Inputs of the arm at x (n, bundles): with the dead zones that effective ones leave."""
        if not self.is_effective:
            return x
        zones = np.zeros(x.shape[1])
        zones[: len(self.outer.drives)] = [drive.dead_zone for drive in self.outer.drives]
        return x + np.sign(x) * zones

    @lazy
    def lengths(self) -> LoadedLengths | None:
        """Tensions under loads; None without loads or tendons driven by length."""
        if self.outer.loads is None or not self.driving.has_length_tendons:
            return None
        from softreach.rod.loaded.pulled import LoadedLengths
        from softreach.rod.loaded.rod import LoadedRod

        # A tip moves by far more than the length by which a tendon near the axis is off.
        tol = max(_OF_LENGTHS * self.tol, 1e-12)
        return LoadedLengths(self.driving.law, LoadedRod(inner_arm(self.outer), tol))

    def prepare(self) -> None:
        super().prepare()
        self.activations(self.box.low[None])

    def continued_from(self, gamma: Array) -> TipMap:
        rod = super().continued_from(gamma)
        if self.lengths is not None:
            inner = self.lengths.rod.continued_from(self.activations(gamma))
            assert isinstance(inner, ArmRod)
            vars(rod).update(driving=self.driving, lengths=replace(self.lengths, rod=inner))
        return rod

    def activations(self, x: Array) -> Array:
        """γ of the inner arm at checked x (n, bundles); NaN where no tensions are found."""
        if self.lengths is None:
            return self.driving.activations(x)
        bundles = self.driving.bundles(x)
        return self.driving.law.inner(bundles, self.lengths.tensions(bundles).tension)

    def with_slopes(self, x: Array) -> InnerActivations:
        """γ of the inner arm with ∂γ/∂x."""
        if self.lengths is None:
            return self.driving.with_slopes(x)
        bundles, law = self.driving.bundles(x), self.driving.law
        tensions = self.lengths.tensions(bundles)
        inner = law.inner(bundles, tensions.tension)
        of_strains = np.full((len(x), *law.columns.shape, inner.shape[1]), np.nan)
        known = ~np.isnan(inner).any(axis=1)
        of_strains[known] = self.lengths.slopes(inner[known])
        return self.driving.on_taut(x, tensions, of_strains)

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
        if slopes is None and twists is None:
            inner, lost = self._known(self.activations(gamma))
            self.base.fill(inner, tips, status=status, directions=directions)
            self._drop(lost, status, tips, directions)
            return
        at = self.with_slopes(gamma)
        inner, lost = self._known(at.values)
        rooms = [
            None if values is None else np.empty((*values.shape[:2], at.values.shape[1]))
            for values in (slopes, twists)
        ]
        self.base.fill(inner, tips, rooms[0], twists=rooms[1], status=status, directions=directions)
        for room, values in zip(rooms, (slopes, twists), strict=True):
            if room is not None and values is not None:
                np.matmul(room, at.slopes, out=values)
        self._drop(lost, status, tips, slopes, twists, directions)

    def _known(self, inner: Array) -> tuple[Array, NDArray[np.intp]]:
        """Activations with the lower bounds where no tensions were found, and their rows."""
        lost = np.flatnonzero(np.isnan(inner).any(axis=1))
        if len(lost):
            inner[lost] = self.base.box.low
        return inner, lost

    def _drop(self, lost: NDArray[np.intp], status: Status | None, *values: Array | None) -> None:
        drop(lost, status, *values)
        if status is not None:
            status[lost] = TipStatus.UNDECIDED

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        return self.base.extension_and_turn(self.activations(gamma))

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(x + d) - r(x) - r'(x) d| [m] for |dj| <= half_widths[j] in the box.

        Infinite where γ(x) has kinks.
        """
        if not self.driving.is_affine:
            return np.inf
        return self.base.linearization_error(self.driving.widths @ half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        if not self.driving.is_affine:
            return np.full(len(centers), np.inf)
        widths = self.driving.widths @ half_widths
        return self.base.linearization_errors(self.activations(centers), widths)

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        inner, lost = self._known(self.activations(self.box.check(activations)))
        frames = self.base.frames(inner, stations, status)
        self._drop(lost, status, *frames)
        return frames

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        of_base = self.base.strains_at(stations)

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            inner, lost = self._known(self.activations(self.box.check(activations)))
            strain = of_base(inner, status)
            self._drop(lost, status, *strain)
            return strain

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box.

        With tendons driven by length over samples of the box: others may strain it a little more.
        """
        if not self.driving.has_length_tendons:
            return self.base.strain_range(stations)
        gamma = self.box.from_cube(pilot(self.box.bundles))
        return sampled_range(self.strains_at(stations)(gamma))


def inner_rod(rod: TipMap, activations: Array) -> tuple[TipMap, Array]:
    """The map of the inner arm, and its activations; those given if the arm has no other."""
    return (
        (rod.base, rod.activations(activations))
        if isinstance(rod, DrivenRod)
        else (rod, activations)
    )
