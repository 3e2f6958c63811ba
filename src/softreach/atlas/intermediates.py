"""Intermediate results behind the metrics of a design, each computed once, at its first use."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.atlas.metrics import Metric, Need
from softreach.atlas.space import Command
from softreach.cloud.curvature import stream_statistics
from softreach.geometry.alpha_shape import AlphaComplex
from softreach.geometry.delaunay import delaunay
from softreach.geometry.hull import convex_hull
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.rod.tip_map import TipMap, TipStatus
from softreach.sampling import sample_cube
from softreach.support.arrays import Array
from softreach.workspace import reachable_set

_BLOCK = 65_536  # samples at a time, where not all of them are needed at once
_TOL = 1e-6  # of tips, in L
_SPACINGS = 1.6  # of samples that fill the box evenly, over L: radius of the alpha shape


class Settings(NamedTuple):
    """What a `Command` says of the metrics of many designs, for a single one."""

    tol: float  # Error of tips over L
    accuracy: float  # Relative error of volumes of reachable sets
    alpha_over_length: float  # Radius of alpha shapes over L
    stations: tuple[float, ...] = (1.0,)  # Over L, where curvatures are taken
    quantiles: tuple[float, ...] = (0.5,)  # Of these
    metrics: tuple[Metric, ...] = ()  # That will be computed


@dataclass(eq=False)
class Intermediates:
    """Need -> its value for one design, computed at first use."""

    arm: Manipulator
    cube: Array  # Unit activations that all designs share, shape (n, bundles)
    command: Command | Settings
    known_set: Callable[[], Any] | None = None  # Source of the reachable set, if it is known
    computed: dict[Need, Any] = field(default_factory=dict)

    @classmethod
    def of_one(cls, arm: Manipulator, n: int, accuracy: float, sets: Callable[[], Any]) -> Self:
        """Of one design, with a radius of alpha shapes that its samples, a power of 2, allow."""
        cube = sample_cube("sobol", n, max(arm.inputs, 1))
        alpha = _SPACINGS / float(np.cbrt(n))
        return cls(arm, cube, Settings(_TOL, accuracy, alpha), sets)

    @cached_property
    def rod(self) -> TipMap:
        """The tip map of the design, to the tolerance of the command."""
        return as_tip_map(self.arm, self.command.tol)

    @cached_property
    def tips(self) -> Array:
        """Tips of all samples [m], shape (n, 3); NaN where there is no equilibrium."""
        return self._samples[0]

    @cached_property
    def stable(self) -> NDArray[np.bool_]:
        """Mask of the samples that have a stable equilibrium, shape (n,)."""
        if not self.rod.supports_unstable:  # the tips may not be needed
            return np.ones(len(self.cube), bool)
        return self._samples[1] == TipStatus.STABLE

    @cached_property
    def _samples(self) -> tuple[Array, NDArray[np.int8]]:
        return with_unstable(self.rod).tips_and_status(activations_of(self.rod, self.cube))

    def __getitem__(self, need: Need) -> Any:
        if need not in self.computed:
            self.computed[need] = _COMPUTE[need](self)
        return self.computed[need]


def activations_of(rod: TipMap, cube: Array) -> Array:
    """The shared unit activations in the bounds of a tip map, shape (n, bundles)."""
    return rod.box.from_cube(cube[:, : rod.box.bundles])


def _stable(of: Intermediates, values: Array) -> Array:
    """Those of the samples that have a stable equilibrium; not copied if all have."""
    return values if of.stable.all() else values[of.stable]


def _convex_volume(of: Intermediates) -> float:
    """From the triangulation, if one is needed anyway."""
    if any(Need.ALPHA_COMPLEX in metric.needs for metric in of.command.metrics):
        return float(of[Need.ALPHA_COMPLEX].volumes.sum())
    return convex_hull(of[Need.TIPS]).volume


def _strain_statistics(of: Intermediates) -> Any:
    rod, cube = of.rod, _stable(of, of.cube)
    blocks = (activations_of(rod, cube[k : k + _BLOCK]) for k in range(0, len(cube), _BLOCK))
    stations = np.array(of.command.stations) * rod.length
    return stream_statistics(rod, blocks, stations, quantiles=of.command.quantiles)


_COMPUTE: dict[Need, Callable[[Intermediates], Any]] = {
    Need.ARM: lambda of: of.arm,
    Need.LENGTH: lambda of: of.arm.length,
    Need.ACTIVATIONS: lambda of: _stable(of, activations_of(of.rod, of.cube)),
    Need.TIPS: lambda of: _stable(of, of.tips),
    Need.BASE_TIPS: lambda of: of.arm.base.to_base(of[Need.TIPS]),
    Need.LOST_SHARE: lambda of: float((~of.stable).mean()),
    Need.ALPHA: lambda of: of.command.alpha_over_length * of.arm.length,
    Need.ALPHA_COMPLEX: lambda of: AlphaComplex(triangulation=delaunay(of[Need.TIPS])),
    Need.CONVEX_VOLUME: _convex_volume,
    Need.REACHABLE_SET: lambda of: (
        of.known_set() if of.known_set else reachable_set(of.rod, accuracy=of.command.accuracy)
    ),
    Need.STRAIN_STATISTICS: _strain_statistics,
}
