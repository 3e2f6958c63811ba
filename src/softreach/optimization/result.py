"""Result of a search: the best designs with their numbers, and all that was judged."""

from __future__ import annotations

from dataclasses import dataclass

from softreach.arm.manipulator import Manipulator
from softreach.optimization.deviations import Spread
from softreach.optimization.problem import Candidate, Problem

__all__ = ["Search"]


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Search:
    """The best designs of a search."""

    problem: Problem
    front: tuple[Candidate, ...]
    """Designs that no other beats in every objective, judged to full accuracy; for one objective
    the best alone. Without a design that meets all requirements, the one that misses least."""
    candidates: tuple[Candidate, ...]
    """Everything that was judged, on coarse sets."""
    spreads: tuple[Spread, ...] = ()
    """Goals of arms made after the best, which deviate by the tolerances; none without these."""
    robust: bool = False
    """Goals are those that 5 % of the arms are worse than; the nominal ones are in `spreads`."""
    designs: int
    """Designs that were looked at, those of polishes too."""
    seconds: float

    @property
    def best(self) -> Candidate:
        """The first of the front."""
        return self.front[0]

    @property
    def arm(self) -> Manipulator:
        """The design of the best."""
        return self.problem.parameters.arm(self.best.values)
