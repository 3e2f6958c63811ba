"""What solving the inverse problem yields: flat arrays that read like a list of solutions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.schema import AXES

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Solution", "Solutions", "Status"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class Status(IntEnum):
    """How a target fared."""

    REACHED = 0
    """Some activation within the bounds puts the tip there."""
    UNREACHABLE = 1
    """None does; the nearest point that was found is given."""
    NOT_CONVERGED = 2
    """The search did not come to rest: what is given is the best so far, not certain."""


@dataclass(frozen=True)
class Solution:
    """The activations that reach one target, or come nearest to it."""

    target: Array
    """Where the tip should be [m], shape (3,)."""
    status: Status
    """How the target fared."""
    activations: Array
    """Each activation that reaches the target [-], shape (k, m); k = 0 if it is out of reach."""
    residuals: Array
    """|tip - target| [m], shape (k,)."""
    condition: Array
    """Condition number of the position Jacobian ∂r/∂γ, infinite on a fold, shape (k,)."""
    margin: Array
    """Distance to the nearest bound, relative to its range, shape (k,)."""
    nearest: Array
    """The reachable point nearest to the target [m], shape (3,)."""
    nearest_activation: Array
    """An activation that leads there [-], shape (m,)."""
    gap: float
    """|nearest - target| [m]."""

    def __len__(self) -> int:
        return len(self.activations)


@dataclass(frozen=True)
class Solutions(Sequence[Solution]):
    """One `Solution` for each target, stored as flat arrays so that a million cost little."""

    arm: Manipulator
    """The design."""
    targets: Array
    """Shape (t, 3) [m]."""
    offsets: Index
    """Activations of target i are rows offsets[i]:offsets[i + 1], shape (t + 1,)."""
    activations: Array
    """Shape (n, m) [-]."""
    residuals: Array
    """Shape (n,) [m]."""
    condition: Array
    """Shape (n,) [-]."""
    margin: Array
    """Shape (n,) [-]."""
    status: NDArray[np.int8]
    """`Status` of each target, shape (t,)."""
    nearest: Array
    """Shape (t, 3) [m]."""
    nearest_activation: Array
    """Shape (t, m) [-]."""
    gap: Array
    """Shape (t,) [m]."""

    @property
    def counts(self) -> Index:
        """Number of activations found for each target, shape (t,)."""
        return np.diff(self.offsets)

    def __len__(self) -> int:
        return len(self.targets)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> Solutions: ...
    def __getitem__(self, index: int | slice) -> Solution | Solutions:
        if isinstance(index, slice):
            return self._several(np.arange(len(self))[index])
        return self._one(range(len(self))[index])

    def __iter__(self) -> Iterator[Solution]:
        return (self._one(i) for i in range(len(self)))

    def _one(self, i: int) -> Solution:
        rows = slice(self.offsets[i], self.offsets[i + 1])
        return Solution(
            target=self.targets[i],
            status=Status(self.status[i]),
            activations=self.activations[rows],
            residuals=self.residuals[rows],
            condition=self.condition[rows],
            margin=self.margin[rows],
            nearest=self.nearest[i],
            nearest_activation=self.nearest_activation[i],
            gap=float(self.gap[i]),
        )

    def _several(self, chosen: Index) -> Solutions:
        counts = self.counts[chosen]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        inside = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
        rows = np.repeat(self.offsets[chosen], counts) + inside
        return Solutions(
            arm=self.arm,
            targets=self.targets[chosen],
            offsets=offsets,
            activations=self.activations[rows],
            residuals=self.residuals[rows],
            condition=self.condition[rows],
            margin=self.margin[rows],
            status=self.status[chosen],
            nearest=self.nearest[chosen],
            nearest_activation=self.nearest_activation[chosen],
            gap=self.gap[chosen],
        )

    def to_dataset(self) -> xr.Dataset:
        """Labelled arrays over `target` and over `solution`, whose `target_of` names its target."""
        import xarray as xr

        meanings = " ".join(f"{status.value}={status.name.lower()}" for status in Status)
        return xr.Dataset(
            {
                "position": (("target", "axis"), self.targets, {"units": "m"}),
                "status": ("target", self.status, {"units": "1", "meanings": meanings}),
                "nearest": (("target", "axis"), self.nearest, {"units": "m"}),
                "nearest_activation": (
                    ("target", "bundle"),
                    self.nearest_activation,
                    {"units": "1"},
                ),
                "gap": ("target", self.gap, {"units": "m"}),
                "target_of": ("solution", np.repeat(np.arange(len(self)), self.counts)),
                "activation": (("solution", "bundle"), self.activations, {"units": "1"}),
                "residual": ("solution", self.residuals, {"units": "m"}),
                "condition": ("solution", self.condition, {"units": "1"}),
                "margin": ("solution", self.margin, {"units": "1"}),
            },
            {"axis": list(AXES), "bundle": list(self.arm.bundle_names)},
            {"design": self.arm.to_toml()},
        )
