"""Metrics of softreach: one table of name, unit, meaning, function and needs, in groups.

What they need of a design is computed once each, at its first use.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property, partial
from itertools import chain
from operator import attrgetter
from typing import Any, NamedTuple, Self

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.cloud.curvature import QUANTITIES, stream_statistics
from softreach.cloud.volume import flat_areas
from softreach.geometry.alpha_shape import AlphaComplex, delaunay
from softreach.geometry.hull import convex_hull
from softreach.rod.rods import as_tip_map, with_unstable
from softreach.rod.tip_map import Device, TipMap, TipStatus
from softreach.sampling import sample_cube
from softreach.support import plugins
from softreach.support.arguments import as_function, as_given, as_instance, as_text
from softreach.support.arrays import Array, Mask
from softreach.support.errors import InvalidInput, SoftreachError
from softreach.workspace import reachable_set

PROFILE = ("station", "quantile")
_BLOCK = 65_536  # samples at a time, where not all of them are needed at once
_TOL = 1e-6  # of tips, in L
_SPACINGS = 1.6  # of samples that fill the box evenly, over L: radius of the alpha shape


class Need(Enum):
    """Results that a metric can be computed from; each is computed once per design."""

    ARM = "the design, a Manipulator"
    LENGTH = "its length L [m]"
    ACTIVATIONS = "activations of the samples with a stable equilibrium [-], shape (n, bundles)"
    TIPS = "their tips in the world [m], shape (n, 3)"
    BASE_TIPS = "their tips in the frame of the base, whose z is along the straight arm [m], (n, 3)"
    LOST_SHARE = "share of the samples without a stable equilibrium [-]"
    ALPHA = "radius of the alpha shape of this design [m]"
    ALPHA_COMPLEX = "alpha shapes of every radius, an AlphaComplex of the tips"
    CONVEX_VOLUME = "volume of the convex hull of the tips [m³]"
    REACHABLE_SET = "the exact ReachableSet; it is computed with all threads"
    STRAIN_STATISTICS = "dataset of bending, torsion and extension, as of curvature_statistics"


class MetricFailed(SoftreachError):
    """A metric could not be computed, or gave an invalid value."""


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A number that an atlas holds of every design.

    Raises:
        InvalidInput: A name that is no identifier, needs that are no `Need`, or no function.
    """

    name: str
    """Name of the variable in the atlas."""
    unit: str
    """Unit, such as "m", "m3", "1/m"; "1" if there is none."""
    meaning: str
    """Meaning in a few words, for tables and labels."""
    needs: tuple[Need, ...]
    """Arguments of `compute`, in this order."""
    compute: Callable[..., Any]
    """Function that returns the number. Worker processes take those of a module, no lambdas."""
    over: tuple[str, ...] = ()
    """Dimensions of the result: () for a number, ("station", "quantile") for a profile."""
    nan_if: str = ""
    """Case where NaN is right; empty if there is none. A design with any other NaN has failed."""

    def __post_init__(self) -> None:
        if not as_text("name of the metric", self.name).isidentifier():
            raise InvalidInput("name of the metric", self.name, "letters, digits and underscores")
        for what in ("unit", "meaning", "nan_if"):
            as_text(f"{what} of metric {self.name}", getattr(self, what))
        as_function(f"compute of metric {self.name}", self.compute)
        as_instance(f"needs of metric {self.name}", self.needs, (tuple, list), "a tuple")
        if not all(isinstance(need, Need) for need in self.needs):
            allowed = f"some of Need.{', Need.'.join(Need.__members__)}"
            raise InvalidInput(f"needs of metric {self.name}", self.needs, allowed)
        object.__setattr__(self, "needs", tuple(self.needs))
        if self.over not in ((), PROFILE):
            raise InvalidInput(f"over of metric {self.name}", self.over, f"() or {PROFILE}")

    def value(self, found: Any, sizes: Mapping[str, int]) -> Array:
        """The metric of one design, shape () or that of a profile.

        Args:
            found: What the metric needs by `Need`, such as a dictionary.
            sizes: Number of stations and quantiles.

        Raises:
            MetricFailed: The function failed, or returned something that is not finite or of
                another shape.
        """
        arguments = [found[need] for need in self.needs]
        try:
            value = np.asarray(self.compute(*arguments), dtype=np.float64)
        except Exception as error:
            raise MetricFailed(f"{self.name}: {type(error).__name__}: {error}") from error
        shape = tuple(sizes[dim] for dim in self.over)
        if value.shape != shape:
            raise MetricFailed(f"{self.name}: of shape {value.shape}, must be of shape {shape}")
        if np.isinf(value).any() or (np.isnan(value).any() and not self.nan_if):
            raise MetricFailed(f"{self.name} = {value}: must be finite")
        return value

    def to_dict(self) -> dict[str, Any]:
        """The metric in plain values: all of it but the function, of which only the place is kept.

        Two metrics with equal values here are the same to a store.
        """
        plain = {name: getattr(self, name) for name in ("name", "unit", "meaning")}
        plain |= {"needs": [need.name for need in self.needs], "over": list(self.over)}
        return plain | {"nan_if": self.nan_if, "compute": place_of(self.compute)}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The metric that `to_dict` described; to compute it, the real one has to be passed."""
        needs = tuple(Need[name] for name in values["needs"])
        over, compute = tuple(values["over"]), _Elsewhere(values["compute"])
        return cls(**{**values, "needs": needs, "over": over, "compute": compute})


@dataclass(frozen=True)
class _Elsewhere:
    place: str

    def __call__(self, *_: Any) -> float:
        raise MetricFailed(f"{self.place} is known by name only; pass the metric to build_atlas")


def place_of(compute: Callable[..., Any]) -> str:
    """Module and name of a function."""
    if isinstance(compute, _Elsewhere):
        return compute.place
    named: Any = compute if hasattr(compute, "__qualname__") else type(compute)
    return f"{named.__module__}:{named.__qualname__}"


def known_metric(name: str) -> Metric | None:
    """The metric of softreach with this name, if there is one."""
    return _KNOWN.get(name)


def chosen_metrics(metrics: Sequence[str | Metric]) -> tuple[Metric, ...]:
    """Metrics by their names, groups or themselves, each once: those of softreach first."""
    several = isinstance(metrics, list | tuple | Mapping)
    if not several or not metrics:
        raise InvalidInput("metrics", "none" if several else as_given(metrics), _ALLOWED)
    chosen: dict[str, Metric] = {}
    for metric in chain.from_iterable(map(_metrics_of, metrics)):
        same = chosen.setdefault(metric.name, metric) == metric
        if not same or _KNOWN.get(metric.name, metric) != metric:
            raise InvalidInput("name of a metric", metric.name, "the name of one metric only")
    order = dict.fromkeys([*_KNOWN, *sorted(chosen)])
    return tuple(chosen[name] for name in order if name in chosen)


def _metrics_of(choice: str | Metric) -> tuple[Metric, ...]:
    if isinstance(choice, Metric):
        return (choice,)
    if isinstance(choice, str):
        if choice in METRIC_GROUPS:
            return METRIC_GROUPS[choice]
        if choice in (known := own_metrics()):
            return (known[choice],)
    hint = "the command line imports those by --import"
    raise InvalidInput("metrics", as_given(choice), _ALLOWED, hint)


def own_metrics() -> dict[str, Metric]:
    """Metrics of modules that the user named on the command line."""
    known = (value for module in plugins.imported() for value in vars(module).values())
    metrics = (value for value in known if isinstance(value, Metric))
    return {m.name: m for m in metrics if _KNOWN.get(m.name) != m}


def _extreme(find: Callable[[Array], float], axis: int, tips: Array) -> float:
    return find(tips[:, axis])


def _reach_radius(tips: Array) -> float:
    return math.sqrt(float((tips[:, 0] ** 2 + tips[:, 1] ** 2).max()))


def _alpha_volume(shape: AlphaComplex, alpha: float) -> float:
    return float(shape.volume(alpha))


def _unreachability(shape: AlphaComplex, alpha: float, convex: float, tips: Array) -> float:
    if (areas := flat_areas(tips, alpha)) is not None:
        return 1.0 - areas[0] / areas[1] if areas[1] > 0 else math.nan
    return 1.0 - _alpha_volume(shape, alpha) / convex if convex > 0 else math.nan


def _flat_area(which: int, tips: Array, alpha: float) -> float:
    areas = flat_areas(tips, alpha)
    return math.nan if areas is None else areas[which]


def _spacing(shape: AlphaComplex, alpha: float, tips: Array) -> float:
    return math.cbrt(_alpha_volume(shape, alpha) / len(tips))


def _fold_volume(reached: Any) -> float:
    return reached.fold_volume if reached.dimension == 3 else 0.0


def _mean_multiplicity(reached: Any) -> float:
    volumes = reached.multiplicity
    total = sum(volumes.values())
    return sum(k * volume for k, volume in volumes.items()) / total if total > 0 else math.nan


def _multiple_volume(reached: Any) -> float:
    volumes = reached.multiplicity
    return sum(volume for k, volume in volumes.items() if k > 1) if volumes else math.nan


def _quantiles(name: str, statistics: Any) -> Array:
    return statistics[name].values


_TIPS, _BASE_TIPS = (Need.TIPS,), (Need.BASE_TIPS,)
_SET, _ALPHA = (Need.REACHABLE_SET,), (Need.ALPHA_COMPLEX, Need.ALPHA)
_FINITE = "the design has other than three bundles"
_ENDS = (("min", "lower", np.min), ("max", "upper", np.max))

_COLUMNS = ("name", "unit", "meaning", "compute", "needs", "nan_if", "over")

# fmt: off
_ROWS: dict[str, list[tuple[Any, ...]]] = {
    "extent": [
        *((f"{axis}_{end}", "m", f"{word} end of the cloud's bounding box along {axis}",
           partial(_extreme, find, k), _TIPS)
          for k, axis in enumerate("xyz") for end, word, find in _ENDS),
        ("reach_height", "m", "largest height of a tip above the base plane",
         partial(_extreme, np.max, 2), _BASE_TIPS),
        ("reach_radius", "m", "largest distance of a tip from the base axis",
         _reach_radius, _BASE_TIPS),
    ],
    "convex": [
        ("convex_volume", "m3", "volume of the cloud's convex hull", float, (Need.CONVEX_VOLUME,)),
    ],
    "concave": [
        ("volume", "m3", "volume of the cloud's alpha shape",
         _alpha_volume, _ALPHA),
        ("unreachability", "1", "UNR = 1 - volume / convex_volume",
         _unreachability, (*_ALPHA, Need.CONVEX_VOLUME, Need.TIPS), "the cloud is on a line"),
        ("area", "m2", "area of the alpha shape of a cloud in one plane",
         partial(_flat_area, 0), (Need.TIPS, Need.ALPHA), "the cloud has a volume"),
        ("convex_area", "m2", "area of the convex hull of a cloud in one plane",
         partial(_flat_area, 1), (Need.TIPS, Need.ALPHA), "the cloud has a volume"),
        ("regions", "1", "parts of the alpha shape, connected through faces",
         AlphaComplex.regions, _ALPHA),
        ("spacing", "m", "mean distance between neighboring tips, (volume / n)^(1/3)",
         _spacing, (*_ALPHA, Need.TIPS)),
    ],
    "exact": [
        ("exact_volume", "m3", "volume of the reachable set, without sampling",
         attrgetter("volume"), _SET),
        ("exact_volume_error", "m3", "estimated error of exact_volume",
         attrgetter("volume_error"), _SET),
        ("exact_area", "m2", "area of the reachable set, in one plane or of two bundles",
         attrgetter("area"), _SET, "the reachable set has a volume"),
        ("exact_area_error", "m2", "estimated error of exact_area",
         attrgetter("area_error"), _SET, "the reachable set has a volume"),
        ("exact_convex_volume", "m3", "volume of the reachable set's convex hull",
         attrgetter("convex_volume"), _SET),
        ("exact_unreachability", "1", "UNR = 1 - exact_volume / exact_convex_volume",
         attrgetter("unreachability"), _SET, "the reachable set is a sheet or a curve"),
        ("exact_lost_share", "1",
         "share of the activation box without a posture, told by the reachable set",
         attrgetter("lost_share"), _SET),
        ("multiplicity", "1", "mean number of activations that reach a place, if finite",
         _mean_multiplicity, _SET, _FINITE),
        ("multiple_volume", "m3", "volume that more than one activation reaches, if finite",
         _multiple_volume, _SET, _FINITE),
        ("fold_volume", "m3", "volume reached with both orientations of the map",
         _fold_volume, _SET, _FINITE),
    ],
    "curvature": [
        (f"{quantity}_quantile", unit, meaning,
         partial(_quantiles, f"{quantity}_quantile"), (Need.STRAIN_STATISTICS,), "", PROFILE)
        for quantity, (unit, meaning) in QUANTITIES.items()
    ],
    "stability": [
        ("lost_share", "1",
         "share of the samples without a stable equilibrium, which count for nothing else",
         float, (Need.LOST_SHARE,)),
    ],
}
# fmt: on

METRIC_GROUPS = {
    group: tuple(Metric(**dict(zip(_COLUMNS, row, strict=False))) for row in rows)
    for group, rows in _ROWS.items()
}
"""Group -> its metrics. Those of `curvature` are quantiles at stations, the others numbers."""

_KNOWN = {metric.name: metric for group in METRIC_GROUPS.values() for metric in group}
_ALLOWED = f"some of {', '.join(METRIC_GROUPS)}, or metrics of your own"


class Settings(NamedTuple):
    """What the command of an atlas says of the metrics of many designs, for a single one."""

    tol: float  # Error of tips over L
    accuracy: float  # Relative error of volumes of reachable sets
    alpha_over_length: float  # Radius of alpha shapes over L
    stations: tuple[float, ...] = (1.0,)  # Over L, where curvatures are taken
    quantiles: tuple[float, ...] = (0.5,)  # Of these
    metrics: tuple[Metric, ...] = ()  # That will be computed
    device: Device = "cpu"  # Of tips


@dataclass(eq=False)
class Intermediates:
    """Need -> its value for one design, computed at first use."""

    arm: Manipulator
    cube: Array  # Unit activations that all designs share, shape (n, bundles)
    command: Any  # Settings, or a `Command` that has them
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
        return as_tip_map(self.arm, self.command.tol, device=self.command.device)

    @cached_property
    def tips(self) -> Array:
        """Tips of all samples [m], shape (n, 3); NaN where there is no equilibrium."""
        return self._samples[0]

    @cached_property
    def stable(self) -> Mask:
        """Mask of the samples that have a stable equilibrium, shape (n,)."""
        if not self.rod.supports_unstable:  # the tips may not be needed
            return np.ones(len(self.cube), bool)
        return self._samples[1] == TipStatus.STABLE

    @cached_property
    def _samples(self) -> tuple[Array, Any]:
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
