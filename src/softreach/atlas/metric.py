"""Metrics: numbers that an atlas holds of every design, with name, unit, meaning and function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, Protocol, Self

import numpy as np

from softreach.support.arguments import as_instance, as_text
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, SoftreachError

PROFILE = ("station", "quantile")


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


class SupportsNeeds(Protocol):
    """Source of what metrics need, such as a dictionary."""

    def __getitem__(self, need: Need, /) -> Any: ...


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
    """As in "m", "m3", "1/m"; "1" if there is none."""
    meaning: str
    needs: tuple[Need, ...]
    """Arguments of `compute`, in this order."""
    compute: Callable[..., Any]
    """Returns the number. Worker processes can use functions of a module only, no lambdas."""
    over: tuple[str, ...] = ()
    """Dimensions of the result: () for a number, ("station", "quantile") for a profile."""
    nan_if: str = ""
    """Case where NaN is right; empty if there is none. A design with any other NaN has failed."""

    def __post_init__(self) -> None:
        if not as_text("name of the metric", self.name).isidentifier():
            raise InvalidInput("name of the metric", self.name, "letters, digits and underscores")
        for field in ("unit", "meaning", "nan_if"):
            as_text(f"{field} of metric {self.name}", getattr(self, field))
        as_instance(f"needs of metric {self.name}", self.needs, (tuple, list), "a tuple")
        object.__setattr__(self, "needs", tuple(self.needs))
        if not all(isinstance(need, Need) for need in self.needs):
            allowed = f"some of Need.{', Need.'.join(Need.__members__)}"
            raise InvalidInput(f"needs of metric {self.name}", self.needs, allowed)
        if not callable(self.compute):
            raise InvalidInput(f"compute of metric {self.name}", self.compute, "a function")
        if self.over not in ((), PROFILE):
            raise InvalidInput(f"over of metric {self.name}", self.over, f"() or {PROFILE}")

    def value(self, found: SupportsNeeds, sizes: Mapping[str, int]) -> Array:
        """The metric of one design, shape () or that of a profile.

        Args:
            found: Gives what the metric needs.
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
        return {
            "name": self.name,
            "unit": self.unit,
            "meaning": self.meaning,
            "needs": [need.name for need in self.needs],
            "over": list(self.over),
            "nan_if": self.nan_if,
            "compute": place_of(self.compute),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The metric that `to_dict` described; to compute it, the real one has to be passed."""
        known = {
            "needs": tuple(Need[name] for name in values["needs"]),
            "over": tuple(values["over"]),
            "compute": _Elsewhere(values["compute"]),
        }
        return cls(**{**values, **known})


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
