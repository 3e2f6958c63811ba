"""All equilibria of a loaded arm at one activation, as a value to be asked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import schema
from softreach.rod.equilibrium import Solver
from softreach.rod.kinematics import configuration, shape_dataset, stations_along
from softreach.rod.loaded import LoadedRod
from softreach.rod.tip_map import TipMap, TipStatus

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["AllEquilibria"]

Array = NDArray[np.float64]

_SMALL = 1e-9  # of a length, below which it is shown as 0, in L


@dataclass(frozen=True, eq=False, repr=False)
class AllEquilibria:
    """All equilibria of one arm: stable ones first, then by falling margin."""

    rod: TipMap
    """The arm."""
    solver: Solver | None
    """What walked along it; None without loads."""
    activation: Array
    """Of each bundle, shape (bundles,)."""
    tips: Array
    """r [m], shape (n, 3)."""
    status: NDArray[np.int8]
    """`TipStatus`, shape (n,)."""
    margin: Array
    """How far from the loss of stability, from 1 to below 0 [-], shape (n,); 0 of stable rings."""
    directions: Array
    """Where gravity pulls as the tip sees it, in the base frame of the arm before its loads, shape
    (n, 3); NaN without loads."""
    signs: NDArray[np.int8]
    """Whether the map of directions keeps the sense of rotation there (1) or turns it over (-1), as
    it does where the ways to fall are odd in number; 0 of rings; shape (n,)."""
    is_ring: NDArray[np.bool_]
    """Whether it stands for a ring of them, all around the direction of gravity; shape (n,)."""
    followed: int | None
    """The one that follows continuously from the unloaded arm, which is that of the tip map; None
    where that branch has ended."""
    complete: bool
    """Whether the degree is 1, and the branch is among them: nothing says that one is missing."""

    @property
    def degree(self) -> int:
        """The sum of the signs, which is 1 if none is missing; a ring counts 0."""
        return int(self.signs.sum())

    def configuration(self, stations: int | ArrayLike = 101) -> xr.Dataset:
        """Their shapes as `softreach.configuration` has them, one for each `sample`.

        Args:
            stations: Number of stations, evenly spaced from base to tip, or their Z [m], ascending.
        """
        gamma, rod = np.repeat(self.activation[None], len(self), axis=0), self.rod
        if self.solver is None or not isinstance(rod, LoadedRod):
            return configuration(rod, gamma, stations)
        z = stations_along(rod, stations)
        shapes = self.solver.held(gamma, self.directions, z)[0]
        strains = rod.strains_of_shapes(z)(gamma, shapes.moment, shapes.force)
        return shape_dataset(rod, gamma, z, shapes.frames, strains)

    def to_dataset(self) -> xr.Dataset:
        """All numbers over `equilibrium` and `axis`."""
        import xarray as xr

        each, vector = ("equilibrium",), ("equilibrium", "axis")
        values = {
            "tip": (vector, self.tips, {"units": "m"}),
            "status": (each, self.status),
            "margin": (each, self.margin, {"units": "1"}),
            "direction": (vector, self.directions, {"units": "1"}),
            "sign": (each, self.signs),
            "is_ring": (each, self.is_ring),
            "is_followed": (each, np.arange(len(self)) == self.followed),
            "activation": (("bundle",), self.activation),
        }
        names = {"axis": list(schema.AXES), **schema.bundle_coordinates(self.rod.arm)}
        whole = {"degree": self.degree, "complete": int(self.complete)}
        return xr.Dataset(values, names, {**schema.provenance(self.rod.arm), **whole})

    def __len__(self) -> int:
        return len(self.tips)

    def __repr__(self) -> str:
        stable = int((self.status == TipStatus.STABLE).sum())
        doubt = "" if self.complete else ", some may be missing"
        head = f"<AllEquilibria: {len(self)}, of which {stable} stable; degree {self.degree}{doubt}"
        return "\n".join([head, *(f"  {self._line(k)}" for k in range(len(self)))]) + ">"

    def _line(self, k: int) -> str:
        small = _SMALL * self.rod.length
        tip = ", ".join(f"{x:.4g}" if abs(x) > small else "0" for x in self.tips[k])
        kind = TipStatus(self.status[k]).name.lower() + (" ring" if self.is_ring[k] else "")
        which = ", follows from the unloaded arm" if k == self.followed else ""
        return f"{kind}: tip ({tip}) m, margin {self.margin[k]:.3g}{which}"
