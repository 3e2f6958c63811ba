"""The tip map: from activations to where the tip is, and everything else that a rod can say.

Left of it there is physics and no sample; right of it there are millions of samples and no physics.
Whoever asks where an arm can go asks a tip map, never the fields of the arm.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from enum import IntEnum
from functools import lru_cache, partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.weight import VERIFIED_LOAD_NUMBER, is_overloaded
from softreach.rod.activation_box import ActivationBox
from softreach.rod.frames import Frames, StrainRange, Strains, TipMotions, position_slopes
from softreach.rod.steps import check_tol
from softreach.support import parallel
from softreach.support.arguments import as_given, flag, instance
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput, counted
from softreach.support.errors import warn as issue_warning

__all__ = [
    "BLOCK",
    "TipMap",
    "TipStatus",
    "a_tip_map",
    "an_arm",
    "tip_map",
]

Array = NDArray[np.float64]

BLOCK = 16_384
"""Samples per task: large against a thread's cost, small enough for Ctrl-C to be prompt."""


class TipStatus(IntEnum):
    """Whether a tip can be trusted."""

    STABLE = 0
    """A stable equilibrium."""
    UNSTABLE = 1
    """An unstable equilibrium."""
    NO_EQUILIBRIUM = 2
    """The branch that starts at the unloaded arm ends before; the tip is NaN."""


class TipMap(ABC):
    """The map from the activations of one arm to its tip, to a tolerance; frozen.

    All arrays of activations have shape (n, bundles) and are checked; activations outside the
    bounds are allowed, but `tol` is promised inside them. Results do not depend on threads.
    """

    arm: Manipulator
    """The design, to be stored beside results; nothing here looks inside it."""
    tol: float
    """Largest tip error, in L."""

    @property
    def length(self) -> float:
        """L [m], the scale of everything in space."""
        return self.arm.length

    @property
    def supports_unstable(self) -> bool:
        """Whether a tip can have another status than stable."""
        return False

    @property
    @abstractmethod
    def box(self) -> ActivationBox:
        """The activations within bounds."""

    @abstractmethod
    def refined(self, tol: float) -> TipMap:
        """The map of the same arm to a smaller tolerance; itself if its own is no larger.

        Args:
            tol: Largest tip error, in L.
        """

    @abstractmethod
    def fill_tips(self, gamma: Array, out: Array) -> None:
        """Put the tips [m] of checked activations into `out`, (n, 3), on the calling thread."""

    @abstractmethod
    def fill_slopes(self, gamma: Array, tips: Array, slopes: Array) -> None:
        """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] of checked activations into place."""

    @abstractmethod
    def tip_twists(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m] and the spatial twist of the tip frame per unit of each activation.

        Returns:
            Tips, shape (n, 3); (v, ω) with v [m] and ω [rad], shape (n, 6, bundles).
        """

    def farthest(self) -> float:
        """No tip is farther from the base than this [m]; infinite where no bound is known."""
        return np.inf

    def linearization_error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box.

        Infinite where no bound is known, so that nothing is proved by it.
        """
        return np.inf

    def linearization_errors(self, centers: Array, half_widths: Array) -> Array:
        """The same [m] for |dj| <= half_widths[j] around each center only, shape (n,).

        Args:
            centers: Activations of which no d leads out of the box, shape (n, bundles).
            half_widths: Shape (bundles,).
        """
        return np.full(len(centers), self.linearization_error(half_widths))

    @abstractmethod
    def frames(self, activations: ArrayLike, stations: ArrayLike) -> Frames:
        """Centerline and directors at ascending stations Z [m]."""

    @abstractmethod
    def strains_at(self, stations: ArrayLike) -> Callable[[ArrayLike], Strains]:
        """The strains at stations Z [m], in any order, as a function of activations.

        What depends on the stations alone is computed once, for many blocks of activations.
        """

    @abstractmethod
    def strain_range(self, stations: ArrayLike) -> StrainRange:
        """Ranges of the strains at stations Z [m] within the activation box."""

    @abstractmethod
    def radius(self, stations: ArrayLike) -> Array:
        """Outer radius R2 before activation at stations Z [m]."""

    @property
    def steps(self) -> int:
        """Steps that an integrator makes along the arm; 0 for a map that has none of its own."""
        return 0

    def strains(self, activations: ArrayLike, stations: ArrayLike) -> Strains:
        """Curvature and extension at ascending stations Z [m]."""
        return self.strains_at(stations)(activations)

    def tips(self, activations: ArrayLike) -> Array:
        """Tip positions [m], shape (n, 3)."""
        gamma = self.box.check(activations)
        out = np.empty((len(gamma), 3))
        parallel.run(self.tip_task(gamma[b], out[b]) for b in parallel.blocks(len(gamma), BLOCK))
        return out

    def tip_task(self, gamma: Array, out: Array) -> Callable[[], object]:
        """The work of filling `out` with the tips of `gamma`, to be run on any thread."""
        return partial(self.fill_tips, gamma, out)

    def fill_tips_and_status(self, gamma: Array, out: Array, status: NDArray[np.int8]) -> None:
        """Put tips [m] (n, 3) and their `TipStatus` (n,) into place, on the calling thread."""
        self.fill_tips(gamma, out)
        status[:] = TipStatus.STABLE

    def fill_slopes_and_status(
        self, gamma: Array, tips: Array, slopes: Array, *, status: NDArray[np.int8]
    ) -> None:
        """`fill_slopes`, and the `TipStatus` (n,) of each, on the calling thread."""
        self.fill_slopes(gamma, tips, slopes)
        if self.supports_unstable:
            self.fill_tips_and_status(gamma, np.empty_like(tips), status)
        else:
            status[:] = TipStatus.STABLE

    def tips_and_status(self, activations: ArrayLike) -> tuple[Array, NDArray[np.int8]]:
        """Tips [m], shape (n, 3), NaN without an equilibrium, and their `TipStatus`, (n,)."""
        gamma = self.box.check(activations)
        tips, status = np.empty((len(gamma), 3)), np.empty(len(gamma), np.int8)
        parallel.run(
            partial(self.fill_tips_and_status, gamma[b], tips[b], status[b])
            for b in parallel.blocks(len(gamma), BLOCK)
        )
        return tips, status

    def tips_and_slopes(self, activations: ArrayLike) -> tuple[Array, Array]:
        """Tips [m], shape (n, 3), and their derivatives ∂r/∂γ [m], shape (n, 3, bundles)."""
        gamma = self.box.check(activations)
        tips, slopes = np.empty((len(gamma), 3)), np.empty((len(gamma), 3, self.box.bundles))
        size = BLOCK // (16 if self.supports_unstable else 8)  # an equilibrium takes a search
        parallel.run(
            partial(self.fill_slopes, gamma[b], tips[b], slopes[b])
            for b in parallel.blocks(len(gamma), size)
        )
        return tips, slopes

    def tip_directions(self, activations: ArrayLike) -> Array:
        """Tangents d3 of the tips [-], shape (n, 3)."""
        return np.ascontiguousarray(self.frames(activations, [self.length]).directors[:, 0, 2])

    def tip_motions(self, activations: ArrayLike) -> TipMotions:
        """Positions and directions of the tips with their derivatives, in two passes over rods."""
        tips, twists = self.tip_twists(activations)
        slopes = np.empty_like(twists[:, :3])
        position_slopes(tips, twists, slopes)
        return TipMotions(tips, slopes, self.tip_directions(activations), twists[:, 3:])

    def status(self, activations: ArrayLike) -> NDArray[np.int8]:
        """`TipStatus` of each activation, shape (n,)."""
        return np.full(len(self.box.check(activations)), TipStatus.STABLE, np.int8)

    def check_stations(self, stations: ArrayLike, *, ascending: bool = True) -> Array:
        """The stations as a float array.

        Args:
            stations: Z [m], shape (station,).
            ascending: Whether they must not fall.

        Raises:
            InvalidInput: No such Z within [0, L].
        """
        z = as_floats("stations", stations)
        inside = z.ndim == 1 and z.size > 0 and ((z >= 0) & (z <= self.length)).all()
        if not inside or (ascending and (np.diff(z) < 0).any()):
            order = "ascending " if ascending else ""
            raise InvalidInput("stations", z, f"{order}Z within [0, {self.length:g}] m")
        return z

    def __repr__(self) -> str:
        bundles = counted(self.box.bundles, "bundle")
        size = f"L = {self.length:g} m, {bundles}"
        return f"<{type(self).__name__}: {size}, tip error up to {self.tol:g} L>"


def tip_map(arm: Manipulator | TipMap, tol: float = 1e-6, *, warn: bool = True) -> TipMap:
    """The tip map of an arm, kept for the next call; a tip map is returned as it is.

    Args:
        arm: The design, or a tip map, whose own tolerance then counts.
        tol: Largest tip error, in L.
        warn: Whether to warn of loads beyond what was verified.

    Raises:
        InvalidInput: No arm, or `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """
    if isinstance(arm, TipMap):
        return arm
    if not isinstance(arm, Manipulator):
        raise InvalidInput("arm", as_given(arm), "a Manipulator or a TipMap")
    rod = _of_arm(arm, check_tol(tol))
    flag("warn", warn)
    if warn and arm.loads is not None:
        _warn_of_large_loads(arm)
    return rod


@lru_cache(maxsize=64)
def _of_arm(arm: Manipulator, tol: float) -> TipMap:
    if arm.loads is not None:
        from softreach.rod.loaded import LoadedRod

        return LoadedRod(arm, tol)
    from softreach.rod.free import FreeRod

    return FreeRod(arm, tol)


@lru_cache(maxsize=64)
def _warn_of_large_loads(arm: Manipulator) -> None:
    """Say once that an arm is loaded beyond what was verified; one text for all.

    Raises:
        InvalidDesign: Moduli or densities are missing.
    """
    if is_overloaded(arm):
        issue_warning(
            f"the load number is above {VERIFIED_LOAD_NUMBER:g}, up to which shapes under loads "
            "were verified: look at the status of the samples, and compare with a smaller tol",
        )


an_arm = instance((Manipulator, TipMap), "a Manipulator or a TipMap")
"""An argument that is a design, or its tip map."""

a_tip_map = instance(TipMap, "a TipMap")
