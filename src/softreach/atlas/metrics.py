"""The metrics that softreach knows, in groups."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING

from softreach.atlas.metric import PROFILE, Metric, Need
from softreach.cloud.curvature import QUANTITIES
from softreach.geometry.alpha_shape import AlphaComplex
from softreach.support.arguments import as_given
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

    from softreach.workspace import ReachableSet

__all__ = ["METRIC_GROUPS", "chosen_metrics", "known_metric"]


def _lowest(axis: int, tips: Array) -> float:
    return tips[:, axis].min()


def _highest(axis: int, tips: Array) -> float:
    return tips[:, axis].max()


def _reach_radius(tips: Array) -> float:
    return math.sqrt(float((tips[:, 0] ** 2 + tips[:, 1] ** 2).max()))


def _box() -> Iterator[Metric]:
    for k, axis in enumerate("xyz"):
        for end, word, find in (("min", "lower", _lowest), ("max", "upper", _highest)):
            yield Metric(
                name=f"{axis}_{end}",
                unit="m",
                meaning=f"{word} end of the cloud's bounding box along {axis}",
                needs=(Need.TIPS,),
                compute=partial(find, k),
            )


_EXTENT = (
    *_box(),
    Metric(
        name="reach_height",
        unit="m",
        meaning="largest height of a tip above the base plane",
        needs=(Need.TIPS,),
        compute=partial(_highest, 2),
    ),
    Metric(
        name="reach_radius",
        unit="m",
        meaning="largest distance of a tip from the base axis",
        needs=(Need.TIPS,),
        compute=_reach_radius,
    ),
)

_CONVEX = (
    Metric(
        name="convex_volume",
        unit="m3",
        meaning="volume of the cloud's convex hull",
        needs=(Need.CONVEX_VOLUME,),
        compute=float,
    ),
)


def _alpha_volume(shape: AlphaComplex, alpha: float) -> float:
    return float(shape.volume(alpha))


def _unreachability(shape: AlphaComplex, alpha: float, convex: float) -> float:
    return 1.0 - _alpha_volume(shape, alpha) / convex if convex > 0 else math.nan


def _spacing(shape: AlphaComplex, alpha: float, tips: Array) -> float:
    return math.cbrt(_alpha_volume(shape, alpha) / len(tips))


_CONCAVE = (
    Metric(
        name="volume",
        unit="m3",
        meaning="volume of the cloud's alpha shape",
        needs=(Need.ALPHA_COMPLEX, Need.ALPHA),
        compute=_alpha_volume,
    ),
    Metric(
        name="unreachability",
        unit="1",
        meaning="UNR = 1 - volume / convex_volume",
        needs=(Need.ALPHA_COMPLEX, Need.ALPHA, Need.CONVEX_VOLUME),
        compute=_unreachability,
        nan_if="the cloud is flat",
    ),
    Metric(
        name="regions",
        unit="1",
        meaning="parts of the alpha shape, connected through faces",
        needs=(Need.ALPHA_COMPLEX, Need.ALPHA),
        compute=AlphaComplex.regions,
    ),
    Metric(
        name="spacing",
        unit="m",
        meaning="mean distance between neighboring tips, (volume / n)^(1/3)",
        needs=(Need.ALPHA_COMPLEX, Need.ALPHA, Need.TIPS),
        compute=_spacing,
    ),
)


def _multiplicity(reached: ReachableSet) -> Mapping[int, float]:
    """Volume by number of activations; none where there is no volume."""
    from softreach.workspace import ReachableSolid

    return reached.multiplicity if isinstance(reached, ReachableSolid) else {}


def _fold_volume(reached: ReachableSet) -> float:
    from softreach.workspace import ReachableSolid

    return reached.fold_volume if isinstance(reached, ReachableSolid) else 0.0


def _mean_multiplicity(reached: ReachableSet) -> float:
    volumes = _multiplicity(reached)
    whole = sum(volumes.values())
    return sum(k * volume for k, volume in volumes.items()) / whole if whole > 0 else math.nan


def _multiple_volume(reached: ReachableSet) -> float:
    volumes = _multiplicity(reached)
    return sum(volume for k, volume in volumes.items() if k > 1) if volumes else math.nan


_FINITE_ONLY = "the design has other than three bundles"

_EXACT = (
    Metric(
        name="exact_volume",
        unit="m3",
        meaning="volume of the reachable set, without sampling",
        needs=(Need.REACHABLE_SET,),
        compute=attrgetter("volume"),
    ),
    Metric(
        name="exact_volume_error",
        unit="m3",
        meaning="estimated error of exact_volume",
        needs=(Need.REACHABLE_SET,),
        compute=attrgetter("volume_error"),
    ),
    Metric(
        name="exact_convex_volume",
        unit="m3",
        meaning="volume of the reachable set's convex hull",
        needs=(Need.REACHABLE_SET,),
        compute=attrgetter("convex_volume"),
    ),
    Metric(
        name="exact_unreachability",
        unit="1",
        meaning="UNR = 1 - exact_volume / exact_convex_volume",
        needs=(Need.REACHABLE_SET,),
        compute=attrgetter("unreachability"),
        nan_if="the reachable set is flat",
    ),
    Metric(
        name="exact_lost_share",
        unit="1",
        meaning="share of the activation box left out of the reachable set: not stable, or torn",
        needs=(Need.REACHABLE_SET,),
        compute=attrgetter("lost_share"),
    ),
    Metric(
        name="multiplicity",
        unit="1",
        meaning="mean number of activations that reach a place, if finite",
        needs=(Need.REACHABLE_SET,),
        compute=_mean_multiplicity,
        nan_if=_FINITE_ONLY,
    ),
    Metric(
        name="multiple_volume",
        unit="m3",
        meaning="volume that more than one activation reaches, if finite",
        needs=(Need.REACHABLE_SET,),
        compute=_multiple_volume,
        nan_if=_FINITE_ONLY,
    ),
    Metric(
        name="fold_volume",
        unit="m3",
        meaning="volume reached with both orientations of the map",
        needs=(Need.REACHABLE_SET,),
        compute=_fold_volume,
        nan_if=_FINITE_ONLY,
    ),
)


def _quantiles(name: str, statistics: xr.Dataset) -> Array:
    return statistics[name].values


_CURVATURE = tuple(
    Metric(
        name=f"{quantity}_quantile",
        unit=unit,
        meaning=meaning,
        needs=(Need.STRAIN_STATISTICS,),
        compute=partial(_quantiles, f"{quantity}_quantile"),
        over=PROFILE,
    )
    for quantity, (unit, meaning) in QUANTITIES.items()
)

_STABILITY = (
    Metric(
        name="lost_share",
        unit="1",
        meaning="share of the samples without a stable equilibrium, which count for nothing else",
        needs=(Need.LOST_SHARE,),
        compute=float,
    ),
)

METRIC_GROUPS: dict[str, tuple[Metric, ...]] = {
    "extent": _EXTENT,
    "convex": _CONVEX,
    "concave": _CONCAVE,
    "exact": _EXACT,
    "curvature": _CURVATURE,
    "stability": _STABILITY,
}
"""Group -> its metrics. Those of `curvature` are quantiles at stations, the others numbers."""

_KNOWN = {metric.name: metric for group in METRIC_GROUPS.values() for metric in group}


def known_metric(name: str) -> Metric | None:
    """The metric of softreach with this name, if there is one."""
    return _KNOWN.get(name)


def chosen_metrics(asked: Sequence[str | Metric]) -> tuple[Metric, ...]:
    """The metrics asked for, each once: those of softreach as in its table, then others by name.

    Args:
        asked: Names of groups, and metrics.

    Raises:
        InvalidInput: Nothing, an unknown group, or two metrics of one name.
    """
    several = isinstance(asked, list | tuple | Mapping)
    if not several or not asked:
        raise InvalidInput("metrics", "none" if several else as_given(asked), _ALLOWED)
    found: dict[str, Metric] = {}
    for metric in (metric for choice in asked for metric in _metrics_of(choice)):
        if found.setdefault(metric.name, metric) != metric or _taken(metric):
            raise InvalidInput("name of a metric", metric.name, "of one metric only")
    order = list(_KNOWN)
    own = sorted(name for name in found if name not in _KNOWN)
    return tuple(found[name] for name in [*order, *own] if name in found)


_ALLOWED = f"some of {', '.join(METRIC_GROUPS)}, or metrics of your own"


def _metrics_of(choice: str | Metric) -> tuple[Metric, ...]:
    if isinstance(choice, Metric):
        return (choice,)
    if not isinstance(choice, str) or choice not in METRIC_GROUPS:
        raise InvalidInput("metrics", as_given(choice), _ALLOWED)
    return METRIC_GROUPS[choice]


def _taken(metric: Metric) -> bool:
    """Whether softreach has another metric of this name."""
    return metric.name in _KNOWN and _KNOWN[metric.name] != metric
