"""The rod in the world: an arm whose base stands, hangs or leans anywhere."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.kernels.rod.placing import move, turn
from softreach.rod.activation_box import ActivationBox
from softreach.rod.arm_rod import ArmRod
from softreach.rod.tip_map import Array, Frame, Frames, Status, StrainRange, Strains, TipMap

__all__ = ["PlacedRod"]


@dataclass(frozen=True, repr=False)
class PlacedRod(TipMap):
    """A free or loaded rod as the world sees it: r = r(0) + R r', with r' in the base's frame."""

    rod: ArmRod
    """The rod in the frame of its base."""
    arm: Manipulator = field(init=False, compare=False)
    tol: float = field(init=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.rod.arm)
        object.__setattr__(self, "tol", self.rod.tol)

    @property
    def pose(self) -> Base:
        """Pose of the base in the world."""
        return self.arm.base

    @property
    def frame(self) -> Frame:
        """The world."""
        return "world"

    @cached_property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.rod.box

    @property
    def supports_unstable(self) -> bool:
        """True if a tip can have another status than stable."""
        return self.rod.supports_unstable

    @property
    def steps(self) -> int:
        """Steps that the integrator makes along the arm."""
        return self.rod.steps

    def prepare(self) -> None:
        """Compute what every sample needs, once for all threads."""
        self.rod.prepare()

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
        self.rod.fill(gamma, tips, slopes, twists=twists, status=status, directions=directions)
        rotation, position = self._pose
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

    @cached_property
    def _pose(self) -> tuple[Array, Array]:
        """Rotation and position as the kernels take them."""
        return np.array(self.pose.rotation), np.array(self.pose.position)

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        """The smallest ζ along the arm [-] and the largest turn of a step [rad], (n,) each."""
        return self.rod.extension_and_turn(gamma)

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]."""
        return self.rod.farthest()

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        return self.rod.linearization_error(half_widths)

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,)."""
        return self.rod.linearization_errors(centers, half_widths)

    def frames(
        self, activations: ArrayLike, stations: ArrayLike, status: Status | None = None
    ) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""
        return self.placed(self.rod.frames(activations, stations, status))

    def placed(self, frames: Frames) -> Frames:
        """Centerlines and directors in the world of those in the frame of the base."""
        directors = self.pose.directions_to_world(frames.directors)
        return Frames(self.pose.to_world(frames.position), directors)

    def strains_at(self, stations: ArrayLike) -> Callable[..., Strains]:
        """The strains at stations Z [m], in any order, as a function of activations."""
        return self.rod.strains_at(stations)

    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""
        return self.rod.strain_range(stations)
