"""The numbers that an atlas holds of every design: their names, units and how they are found."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.geometry.alpha_shape import AlphaComplex
from softreach.geometry.delaunay import delaunay
from softreach.geometry.hull import convex_hull

__all__ = ["METRICS", "Metric", "hull_metrics", "image_metrics", "scalar_names"]

Array = NDArray[np.float64]
Numbers = dict[str, float]


class Metric(NamedTuple):
    """What one number means."""

    unit: str
    meaning: str


def _box() -> dict[str, Metric]:
    ends = {"min": "lower", "max": "upper"}
    return {
        f"{axis}_{end}": Metric("m", f"{word} end of the cloud's bounding box along {axis}")
        for axis in "xyz"
        for end, word in ends.items()
    }


METRICS: dict[str, dict[str, Metric]] = {
    "extent": {
        **_box(),
        "reach_height": Metric("m", "largest height of a tip above the base plane"),
        "reach_radius": Metric("m", "largest distance of a tip from the base axis"),
    },
    "convex": {"convex_volume": Metric("m3", "volume of the cloud's convex hull")},
    "concave": {
        "volume": Metric("m3", "volume of the cloud's alpha shape"),
        "unreachability": Metric("1", "UNR = 1 - volume / convex_volume"),
        "regions": Metric("1", "parts of the alpha shape that hang together"),
        "spacing": Metric("m", "mean distance between neighboring tips, (volume / n)^(1/3)"),
    },
    "exact": {
        "exact_volume": Metric("m3", "volume of the reachable set, without sampling"),
        "exact_volume_error": Metric("m3", "estimated error of exact_volume"),
        "exact_convex_volume": Metric("m3", "volume of the reachable set's convex hull"),
        "exact_unreachability": Metric("1", "UNR = 1 - exact_volume / exact_convex_volume"),
        "multiplicity": Metric("1", "mean number of activations that reach a place, if finite"),
        "multiple_volume": Metric("m3", "volume that more than one activation reaches, if finite"),
        "fold_volume": Metric("m3", "volume reached with both orientations of the map"),
    },
    "curvature": {},
}
"""Group -> name -> metric. `curvature` holds quantiles at stations instead of single numbers."""


def scalar_names(groups: tuple[str, ...]) -> tuple[str, ...]:
    """The names of the single numbers in these groups, in order."""
    return tuple(name for group in groups for name in METRICS[group])


def hull_metrics(arm: Manipulator, tips: Array, alpha: float, groups: tuple[str, ...]) -> Numbers:
    """Metrics of the points themselves; serial, so several designs can run side by side.

    Args:
        arm: The design.
        tips: Positions [m], shape (n, 3).
        alpha: Radius of the alpha shape, in L.
        groups: Which groups are wanted.
    """
    found = _extent(tips) if "extent" in groups else {}
    if "concave" in groups:
        found |= _concave(tips, alpha * arm.length)
    elif "convex" in groups:
        found["convex_volume"] = convex_hull(tips).volume
    return found


def image_metrics(arm: Manipulator, tol: float, accuracy: float) -> Numbers:
    """Metrics of the exact reachable set; uses all threads by itself."""
    from softreach.workspace import ReachableSolid, reachable_set

    reached = reachable_set(arm, accuracy=accuracy, tol=tol)
    solid = isinstance(reached, ReachableSolid)
    multiplicity = reached.multiplicity if solid else {}
    return {
        "exact_volume": reached.volume,
        "exact_volume_error": reached.volume_error,
        "exact_convex_volume": reached.convex_volume,
        "exact_unreachability": reached.unreachability,
        "multiplicity": _mean_multiplicity(multiplicity),
        "multiple_volume": _multiple_volume(multiplicity),
        "fold_volume": reached.fold_volume if solid else math.nan,
    }


def _extent(tips: Array) -> Numbers:
    low, high = tips.min(axis=0), tips.max(axis=0)
    ends = {f"{axis}_min": low[k] for k, axis in enumerate("xyz")}
    ends |= {f"{axis}_max": high[k] for k, axis in enumerate("xyz")}
    radius = math.sqrt(float((tips[:, 0] ** 2 + tips[:, 1] ** 2).max()))
    return {**ends, "reach_height": high[2], "reach_radius": radius}


def _concave(tips: Array, radius: float) -> Numbers:
    """Both volumes from one triangulation."""
    shape = AlphaComplex(triangulation=delaunay(tips))
    volume, convex = float(shape.volume(radius)), float(shape.volumes.sum())
    return {
        "convex_volume": convex,
        "volume": volume,
        "unreachability": 1.0 - volume / convex if convex > 0 else math.nan,
        "regions": shape.regions(radius),
        "spacing": math.cbrt(volume / len(tips)),
    }


def _mean_multiplicity(volumes: Mapping[int, float]) -> float:
    whole = sum(volumes.values())
    return sum(k * volume for k, volume in volumes.items()) / whole if whole > 0 else math.nan


def _multiple_volume(volumes: Mapping[int, float]) -> float:
    return sum(volume for k, volume in volumes.items() if k > 1) if volumes else math.nan
