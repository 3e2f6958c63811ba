"""A tip that pushes: equilibria of a rod while a force along one direction acts on its tip.

Every force has tables of its own, but only a column of them is new.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Equilibria, Solver, turn_between
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import position_slopes
from softreach.support.arrays import Array
from softreach.support.lazy import lazy

_MOST_STEPS = 256
_SHORTEST = 2.0**-12  # part of a force by which it is raised
_MOST_TURN = 0.2  # [rad], of what a node sees
_DOUBTFUL = 0.05  # margin of stability below which finer steps decide


class TipResponse(NamedTuple):
    """Place and derivatives of one tip."""

    tip: Array
    """r [m], shape (3,); NaN where there is no equilibrium."""
    slope: Array
    """∂r/∂γ [m], shape (3, bundles)."""
    retreat: Array
    """Retreat of the tip per unit of the force with which it pushes, -∂r/∂F [m/N], shape (3,)."""
    equilibrium: Equilibria
    """As the search found it."""

    @property
    def margin(self) -> float:
        """Margin of stability, from 1 to below 0 [-]."""
        return float(self.equilibrium.margin[0])


@dataclass(frozen=True, eq=False)
class PushingTip:
    """The tip of a rod that pushes along a direction, and on which as much pushes back."""

    rod: LoadedRod
    """The rod with its other loads."""
    direction: Array
    """Unit vector along which the tip pushes."""
    steps: int
    """Along the arm."""

    @lazy
    def _tables(self) -> LoadTables:
        return LoadTables(arm=self.rod.arm, direction=-self.direction)

    def _solver(self, force: float, steps: int) -> Solver:
        return Solver(self._tables.under(force), steps, self.rod.tol)

    def respond(self, gamma: Array, force: float, near: TipResponse | None = None) -> TipResponse:
        """The tip at activations (bundles,) that pushes by a force [N], and its derivatives.

        It is searched near another response, or is that of the posture.
        """
        solver, sample = self._solver(force, self.steps), gamma[None]
        if near is None:
            known = Postures(solver).find(sample)
        else:
            known = solver.near(sample, near.equilibrium)
        twists, compliance, _ = solver.respond(sample, known, compliance=True)
        slopes = np.empty_like(twists[:, :3])
        position_slopes(known.tips, twists, slopes)
        return TipResponse(known.tips[0], slopes[0], compliance[0] @ self.direction, known)

    def is_stable(self, gamma: Array, force: float, response: TipResponse) -> bool:
        """True if this equilibrium is stable; in doubt steps half as long decide."""
        if abs(response.margin) > _DOUBTFUL:
            return response.margin > 0
        return bool(self._judged(gamma, force, response).is_stable[0])

    def error(self, gamma: Array, force: float, response: TipResponse) -> float:
        """Movement of the tip when the steps are halved [m]."""
        fine = self._judged(gamma, force, response)
        return float(np.linalg.norm(fine.tips[0] - response.tip))

    def _judged(self, gamma: Array, force: float, response: TipResponse) -> Equilibria:
        return self._solver(force, 2 * self.steps).near(gamma[None], response.equilibrium)

    def settles(self, gamma: Array, force: float, response: TipResponse) -> bool:
        """True if the force alone, raised from the posture without it, leads there."""
        sample, share, step = gamma[None], 0.0, 0.25
        held = Postures(self._solver(0.0, self.steps)).find(sample)
        while share < 1.0 and step > _SHORTEST:
            to = min(1.0, share + step)
            new = self._solver(to * force, self.steps).near(sample, held)
            turn = turn_between(new.frame, held.frame)[0]
            if new.is_stable[0] and turn < _MOST_TURN:
                held, share, step = new, to, 2.0 * step
            else:
                step *= 0.5
        apart = float(np.linalg.norm(held.tips[0] - response.tip))
        return share == 1.0 and apart <= self.rod.tol * self.rod.length

    @property
    def is_finest(self) -> bool:
        """True if steps are not made any shorter."""
        return self.steps >= _MOST_STEPS

    def finer(self) -> PushingTip:
        """The same with steps half as long."""
        return PushingTip(self.rod, self.direction, 2 * self.steps)
