"""What a tab shows beside the scene, and the path that its arm follows, as values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput

__all__ = ["MOST_POINTS", "PlotView", "TipPath"]

MOST_POINTS = 2000
"""Of a path: each is followed, drawn and kept in the state."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PlotView:
    """Which plots are shown beside the scene; each is computed only while it is shown."""

    along_arm: bool = False
    """Curvature and strain along the arm."""
    volume_curve: bool = False
    """V(α) of the cloud that is shown."""
    sweep: bool = False
    """Volume against one parameter of the design."""
    parameter: str = ""
    """Which one; "" for the first there is."""
    histogram: bool = False
    """Activations of the samples that the slice leaves."""
    section: bool = False
    """The reachable set in the plane of the slice."""

    def __post_init__(self) -> None:
        for one in fields(self):
            held, kind = getattr(self, one.name), type(one.default)
            if not isinstance(held, kind):
                raise InvalidInput(f"plots.{one.name}", held, f"a {kind.__name__}")

    @property
    def any(self) -> bool:
        """Whether there is anything beside the scene."""
        return any(getattr(self, one.name) is True for one in fields(self))


@dataclass(frozen=True, kw_only=True)
class TipPath:
    """A path of the tip, and how far along it the arm is."""

    points: tuple[Vector, ...]
    """[m], in order."""
    start: tuple[float, ...] | None = None
    """Activation to begin with; None for the best-conditioned solution at the first point."""
    at: int = 0
    """The point where the arm is."""

    def __post_init__(self) -> None:
        if not 2 <= len(self.points) <= MOST_POINTS:
            raise InvalidInput("path", f"{len(self.points)} points", f"2 to {MOST_POINTS}")
        if not np.isfinite(self.points).all():
            raise InvalidInput("path", "not finite", "finite numbers [m]")
        if not isinstance(self.at, int) or not 0 <= self.at < len(self.points):
            raise InvalidInput("path.at", self.at, f"0 to {len(self.points) - 1}")

    @classmethod
    def through(cls, points: Any, start: Sequence[float] | None = None) -> Self:
        """A path through points [m], shape (k, 3).

        Raises:
            InvalidInput: Points of another shape, too few or too many, or not finite.
        """
        values = as_floats("path", points)
        if values.ndim != 2 or values.shape[1] != 3:
            raise InvalidInput("path.shape", values.shape, "of shape (k, 3)")
        triples = tuple((float(x), float(y), float(z)) for x, y, z in values)
        return cls(points=triples, start=None if start is None else tuple(map(float, start)))

    @classmethod
    def from_fields(cls, values: Mapping[str, Any]) -> Self:
        """A path from what a saved state holds of it."""
        made = cls.through(values["points"], values["start"])
        return cls(points=made.points, start=made.start, at=values["at"])
