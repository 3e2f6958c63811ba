"""Picture of a search: designs that were judged and the best of them, and which one is where."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.optimization.problem import Candidate, Problem
from softreach.studio.plots.plot import blank_figure, pixels
from softreach.support.units import readable_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.optimization import Search

__all__ = ["SearchPicture", "search_picture"]

Array = NDArray[np.float64]

_INCHES, _DPI = 3.4, 300  # small type would be lost in the scene, few pixels would blur it
_NEAR = 0.05  # of the picture, from a click to a design
_WAY, _BEST, _MISSED = "#4c78a8", "#d9730d", "#c92a2a"


@dataclass(frozen=True, kw_only=True, eq=False)
class SearchPicture:
    """A square picture, and the places of designs in it."""

    image: NDArray[np.uint8]
    """RGB, shape (pixels, pixels, 3)."""
    candidates: tuple[Candidate, ...]
    """Those that are shown."""
    places: Array
    """Of each, from 0 to 1 from the lower left, shape (candidate, 2)."""

    def candidate_at(self, right: float, up: float) -> Candidate | None:
        """The design nearest to a place of the picture; None if none is near."""
        if not len(self.places):
            return None
        away = np.linalg.norm(self.places - (right, up), axis=1)
        nearest = int(away.argmin())
        return self.candidates[nearest] if away[nearest] <= _NEAR else None


def search_picture(
    problem: Problem,
    candidates: tuple[Candidate, ...],
    result: Search | None,
    arm: Manipulator,
    *,
    dark: bool = False,
) -> SearchPicture:
    """Draw a search as far as it is.

    Of one objective, its value against the designs looked at, with the best so far; of two and
    more, one against the other with the front. While nothing meets the needs, and without an
    objective, how far they are missed.

    Args:
        problem: What is searched for.
        candidates: Designs that were judged on the way, one or more.
        result: Of a search that is complete.
        arm: Gives the units of lengths.
        dark: The page is dark.
    """
    final = () if result is None else result.finalists
    every = (*candidates, *final)
    looked_at = np.cumsum([each.designs for each in candidates])
    order = np.append(looked_at, np.full(len(final), looked_at[-1]))
    feasible = np.array([each.is_feasible for each in every])
    if problem.goals and feasible.any():
        columns, labels = _objectives(problem, every, arm)
        x, xlabel = order.astype(float), "designs looked at"
        y, ylabel = columns[0], labels[0]
        if len(columns) > 1:
            x, xlabel, y, ylabel = columns[0], labels[0], columns[1], labels[1]
    else:
        x, xlabel = order.astype(float), "designs looked at"
        y, ylabel = np.array([each.excess for each in every], float), "missed in all [L, shares]"
    shown = np.isfinite(x) & np.isfinite(y)
    figure = blank_figure(_INCHES, _INCHES, _DPI)
    ax = figure.add_subplot()
    late = np.arange(len(every)) >= len(candidates)
    _draw(ax, x, y, shown & ~late, shown & late, feasible)
    best = problem.front(final or candidates)
    _draw_best(ax, problem, (x, y), [k for k, c in enumerate(every) if _is_in(c, best)], shown)
    missed = int((~feasible[: len(candidates)]).sum())
    ax.set_xlabel(xlabel, fontsize=8)
    ax.set_ylabel(ylabel, fontsize=8)
    ax.set_title(f"{len(candidates)} judged, {missed} miss a need" if missed else "", fontsize=8)
    ax.tick_params(labelsize=7)
    image = pixels(figure, dark=dark)  # which lays the figure out
    spots = ax.transData.transform(np.column_stack([x, y])[shown])
    size = figure.get_size_inches() * figure.dpi
    kept = tuple(each for each, is_shown in zip(every, shown, strict=True) if is_shown)
    return SearchPicture(image=image, candidates=kept, places=spots / size)


def _is_in(candidate: Candidate, some: list[Candidate]) -> bool:
    return any(candidate is each for each in some)


def _objectives(
    problem: Problem, every: tuple[Candidate, ...], arm: Manipulator
) -> tuple[list[Array], list[str]]:
    """Values of each objective in the unit that is shown, NaN where there is none; labels."""
    lengths, columns, labels = arm.length_unit, [], []
    for k, goal in enumerate(problem.goals):
        values = np.array([c.objectives[k].value if c.is_feasible else math.nan for c in every])
        largest = float(np.nanmax(np.abs(values)))
        unit, size = readable_unit(goal.objective.unit, largest, lengths)
        columns.append(values / size)
        words = goal.name.replace("_", " ")
        labels.append(f"{words} [{unit}]" if unit else words)
    return columns, labels


def _draw(
    ax: Axes,
    x: Array,
    y: Array,
    way: NDArray[np.bool_],
    late: NDArray[np.bool_],
    feasible: NDArray[np.bool_],
) -> None:
    met, missed = way & feasible, way & ~feasible
    ax.scatter(x[met], y[met], s=14, c=_WAY, linewidths=0)
    ax.scatter(x[missed], y[missed], s=14, c=_MISSED, marker="x", linewidths=1.0)
    ax.scatter(x[late], y[late], s=22, c=_BEST, marker="D", linewidths=0)


def _draw_best(
    ax: Axes,
    problem: Problem,
    places: tuple[Array, Array],
    best: list[int],
    shown: NDArray[np.bool_],
) -> None:
    """The front as a line, or a ring around the best."""
    x, y = places
    best = [k for k in best if shown[k]]
    ax.scatter(x[best], y[best], s=60, facecolors="none", edgecolors=_BEST, linewidths=1.2)
    if len(problem.goals) > 1 and len(best) > 1:
        order = np.array(best)[np.argsort(x[best])]
        ax.plot(x[order], y[order], color=_BEST, lw=0.9)
