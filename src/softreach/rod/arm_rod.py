"""Rod of one arm, free or loaded: its steps, and how far activations bend it."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from threading import RLock
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import Tables, check_extension, strain_stations, tables
from softreach.rod.activation_box import ActivationBox
from softreach.rod.tip_map import Array, Frame, TipMap, check_tol
from softreach.support import parallel
from softreach.support.lazy import lazy

__all__ = ["ArmRod"]


@dataclass(frozen=True, repr=False)
class ArmRod(TipMap):
    """The rod that one arm is, free or loaded, in the activations of all its bundles.

    It is that of the frame of the base, wherever this is in the world.

    Raises:
        InvalidInput: `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """

    arm: Manipulator
    tol: float = 1e-6
    fixed_steps: int | None = None
    """Steps along the arm, if nothing breaks it, in place of those that `tol` needs."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_tol(self.tol))
        check_extension(self.arm)

    @property
    def frame(self) -> Frame:
        """That of the base, which is the world's where the arm stands upright at its origin."""
        return "world" if self.arm.base.is_identity else "base"

    @lazy
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return ActivationBox.between(self.arm.bounds, self.arm.bundle_names)

    @lazy
    def _strain_table(self) -> Tables:
        return tables(self.arm, strain_stations(self.arm))

    def extension_and_turn(self, gamma: Array) -> tuple[Array, Array]:
        """Smallest ζ, or η, along the arm at activations (n, bundles), shape (n,).

        And the largest angle by which a step turns the arm [rad], η |Uγ| R2 dS, shape (n,).
        """
        table, profile = self._strain_table, self.arm.profile
        step = profile.radius(table.stations) * (profile.slender_length / self.steps)
        least, most = np.empty((2, len(gamma)))
        with np.errstate(all="ignore"):  # what overflows is no arm
            for block in parallel.blocks(len(gamma), 1024):
                extension = growth = 1.0 + gamma[block] @ table.extension.T
                if table.growth is not table.extension:
                    growth = 1.0 + gamma[block] @ table.growth.T
                bend = np.linalg.norm(
                    np.einsum("scb,nb->nsc", table.curvature, gamma[block]), axis=-1
                )
                least[block] = np.minimum(extension, growth).min(axis=1)
                most[block] = (growth * bend * step).max(axis=1)
        return least, most

    @abstractmethod
    def _prepare(self) -> None:
        """Compute what every sample needs."""

    def prepare(self) -> None:
        known = vars(self)
        if "_is_prepared" in known:
            return
        with known.setdefault("_lock", RLock()):
            if "_is_prepared" not in known:
                self._prepare()
                known["_is_prepared"] = True

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_lock"}
