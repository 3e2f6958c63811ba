"""Settings of a tab as values: the plots beside its scene, and the path of its tip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidInput

MOST_POINTS = 2000
"""Of a path: each is followed, drawn and kept in the state."""

Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class PlotSettings:
    """Plots beside the scene; each is computed only while it is shown."""

    shown: tuple[str, ...] = ()
    """Names of the plots, each once and in order."""
    parameter: str = ""
    """Parameter against which the volume is plotted; "" for the first there is."""

    def __post_init__(self) -> None:
        if not isinstance(self.parameter, str):
            raise InvalidInput("plots.parameter", self.parameter, "a str")
        if not all(isinstance(name, str) for name in self.shown):
            raise InvalidInput("plots.shown", self.shown, "names of plots")
        object.__setattr__(self, "shown", tuple(sorted(set(self.shown))))

    def showing(self, name: str, on: bool = True) -> Self:
        """A copy with a plot, or without it."""
        shown = {*self.shown, name} if on else {*self.shown} - {name}
        return replace(self, shown=tuple(shown))

    def sweeping(self, parameter: str) -> Self:
        """A copy with another parameter."""
        return replace(self, parameter=parameter)


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
        path = cls.through(values["points"], values["start"])
        return replace(path, at=values["at"])
