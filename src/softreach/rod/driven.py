"""Rods of arms whose activations are not those of the sections: at rest they are bent already."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator
from softreach.rod.activation_box import ActivationBox
from softreach.rod.arm_rod import ArmRod
from softreach.rod.tip_map import Array, Frames, Status, StrainRange, Strains, TipMap
from softreach.rod.view import DerivedMap, PlacedRod

__all__ = ["DrivenRod", "InnerActivations", "inner_rod"]


@dataclass(frozen=True, eq=False)
class InnerActivations:
    """Activations of the inner arm and their derivatives."""

    values: Array
    """γ, shape (n, inner bundle)."""
    slopes: Array
    """∂γ/∂x, shape (n, inner bundle, bundle)."""


@dataclass(frozen=True, repr=False)
class DrivenRod(DerivedMap):
    """The map from the activations x of an arm through those of its inner arm, γ(x)."""

    base: ArmRod | PlacedRod
    """The map of the inner arm."""
    outer: Manipulator
    """The arm that is driven."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "arm", self.outer)

    @property
    def steps(self) -> int:
        """Steps that the integrator makes along the arm."""
        return self.base.steps

    @cached_property
    def box(self) -> ActivationBox:
        """Bounds of x."""
        return ActivationBox.between(self.outer.bounds, self.outer.bundle_names)

    def activations(self, x: Array) -> Array:
        """γ of the inner arm at checked x (n, bundles)."""
        return np.concatenate([x, np.ones((len(x), 1))], axis=1)

    def with_slopes(self, x: Array) -> InnerActivations:
        """γ of the inner arm with ∂γ/∂x."""
        gamma = self.activations(x)
        slopes = np.eye(gamma.shape[1], x.shape[1])
        return InnerActivations(gamma, np.broadcast_to(slopes, (len(x), *slopes.shape)))

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
        """Put tips, and what else is asked for, of checked x into place."""
        if slopes is None and twists is None:
            inner = self.activations(gamma)
            self.base.fill(inner, tips, status=status, directions=directions)
            return
        at = self.with_slopes(gamma)
        rooms = [
            None if values is None else np.empty((*values.shape[:2], at.values.shape[1]))
            for values in (slopes, twists)
        ]
        self.base.fill(
            at.values, tips, rooms[0], twists=rooms[1], status=status, directions=directions
        )
        for room, values in zip(rooms, (slopes, twists), strict=True):
            if room is not None and values is not None:
                np.matmul(room, at.slopes, out=values)

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        """The smallest ζ along the arm [-] and the largest turn of a step [rad] at x."""
        return self.base.extension_and_turn(self.activations(gamma))

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(x + d) - r(x) - r'(x) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.base.linearization_error(np.append(half_widths, 0.0))

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        widths = np.append(half_widths, 0.0)
        return self.base.linearization_errors(self.activations(centers), widths)

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return self.base.frames(self.activations(self.box.check(activations)), stations, status)

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        of_base = self.base.strains_at(stations)

        def strains(activations: ArrayLike, status: Status | None = None) -> Strains:
            return of_base(self.activations(self.box.check(activations)), status)

        return strains

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.base.strain_range(stations)


def inner_rod(rod: TipMap, activations: Array) -> tuple[TipMap, Array]:
    """The map of the inner arm, and its activations; those given if the arm has no other."""
    return (
        (rod.base, rod.activations(activations))
        if isinstance(rod, DrivenRod)
        else (rod, activations)
    )
