"""Tables of a loaded rod on whose tip a force grows: only what the force changes is made anew."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softreach.rod.load_tables import LoadTables, StepTables

__all__ = ["TipForceTables"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TipForceTables(LoadTables):
    """Tables under the given loads and one more force on the tip.

    Its axes do not depend on the size of the force, so that all sizes share one set of steps.
    """

    direction: Array
    """Unit vector of the force in the base frame."""
    force: float = 0.0
    """[N]."""
    origin: TipForceTables | None = None
    """The tables of another size of the force, with which all that does not change is shared."""
    steps_made: dict[int, StepTables] = field(default_factory=dict)
    """Tables without the force, by their number of steps."""

    def under(self, force: float) -> TipForceTables:
        """The same with another size of the force [N]."""
        kept = self.origin or self
        made = self.steps_made
        return TipForceTables(
            self.arm, self.loads, self.body, self.direction, force, origin=kept, steps_made=made
        )

    @cached_property
    def _given(self) -> LoadTables:
        return LoadTables(self.arm, self.loads, self.body)

    @cached_property
    def axes(self) -> Array:
        """Those of the loads; where no force acts otherwise, the first is along this one."""
        if self.origin is not None:
            return self.origin.axes
        loads = self.loads
        forces = [loads.gravity, loads.force_per_length, loads.tip_force]
        if any(map(any, (*forces, *(one.force for one in loads.point_loads)))):
            return self._given.axes
        alone = loads.replace(tip_force=tuple(self.direction))
        return LoadTables(self.arm, alone, self.body).axes

    @cached_property
    def one_direction(self) -> bool:
        """Whether all forces, this one included, are dead and along the first axis."""
        if self.origin is not None:
            return self.origin.one_direction
        along = np.abs(self.axes[1:] @ self.direction).max() <= 1e-14
        return bool(along) and self._given.one_direction

    def uniform(self, steps: int) -> StepTables:
        """At least `steps` steps, with boundaries where the arm or its loads are not smooth."""
        if steps not in self.steps_made:
            self.steps_made[steps] = super().uniform(steps)
        made = self.steps_made[steps]
        scalars = made.scalars.copy()
        scalars[..., 3:] += self.force * (self.axes @ self.direction)
        return made._replace(scalars=scalars)
