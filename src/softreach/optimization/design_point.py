"""Numbers of one design on the way of a polish, with derivatives by its parameters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from softreach.arm.body import load_number, mass
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameters, parameters_by_every_name
from softreach.optimization.free_parameters import Values
from softreach.optimization.objectives import SETS, DesignCase
from softreach.optimization.problem import Problem
from softreach.requirements.regions import Region
from softreach.rod.rods import effective, in_steps, refined, tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.support.lazy import lazy
from softreach.workspace import ReachableSolid
from softreach.workspace.boundary import boundary_samples
from softreach.workspace.gradient import VolumeGradient, gradient_of
from softreach.workspace.tip_derivatives import TipDerivatives

OF_ARM: dict[str, Callable[[Manipulator], float]] = {
    "mass": mass,
    "load_number": load_number,
    "actuators": lambda arm: float(arm.inputs),
}
_TOL = 1e-7  # of tips at the targets, in L
STEP = 1e-4  # of a range, or of the unit cube, for what is differentiated by differences
_PLACES = 8192  # of a region, whose share is covered


@dataclass(eq=False)
class DesignPoint:
    """One design on the way of a polish; derivatives are by real parameters over their ranges."""

    problem: Problem
    values: Values
    accuracy: float
    like: Sequence[TipMap] = ()
    """Tip maps of a design nearby, in as many steps."""

    @lazy
    def case(self) -> DesignCase:
        """The design, to be asked."""
        return self.problem.case(self.values, self.accuracy)

    @lazy
    def arms(self) -> list[Manipulator]:
        """The arm under each payload."""
        return self.problem.requirements.under_payloads(self.case.arm)

    @lazy
    def rods(self) -> tuple[TipMap, ...]:
        """Its tip map under each payload."""
        if not self.like:
            return tuple(refined(tip_map(arm), _TOL) for arm in self.arms)
        pairs = zip(self.arms, self.like, strict=True)
        return tuple(in_steps(arm, rod.steps, rod) for arm, rod in pairs)

    @lazy
    def derivatives(self) -> tuple[TipDerivatives, ...]:
        """∂r/∂p of each of these, by parameters of the arm."""
        known = [find_parameters(rod.arm, self._paths[0]) for rod in self.rods]
        return tuple(
            TipDerivatives(rod, [each[name] for name in self._paths[0]])
            for rod, each in zip(self.rods, known, strict=True)
        )

    @lazy
    def chain(self) -> Array:
        """Change of parameters of the arm by unknowns: ranges and ties, shape (paths, reals)."""
        return self._paths[1]

    @lazy
    def sets(self) -> VolumeGradient:
        """Derivatives of the reachable set."""
        return gradient_of(self.case.reached, self._paths[0], self.accuracy)

    def value(self, name: str) -> float:
        """A number of the reachable set, of what it covers, or of the design alone."""
        if name == "coverage":
            return float(np.mean([self.share(*pair) for pair in self._covered]))
        if name in SETS:
            return float(getattr(self.case.reached, SETS[name]))
        return OF_ARM[name](self.case.arm)

    def slope(self, name: str) -> Array:
        """Its derivatives by the reals; those of the design alone by differences."""
        if name == "coverage":
            return np.mean([self.share_slope(*pair) for pair in self._covered], axis=0)
        if name in SETS:
            return getattr(self.sets, SETS[name]) @ self._paths[1]
        of = OF_ARM[name]
        return np.array([(of(up) - of(down)) / step for step, up, down in self.neighbors])

    @property
    def _covered(self) -> list[tuple[int, Region]]:
        """Numbers of the payloads with the regions that must be covered under them."""
        return [
            (number, target.region)
            for number in range(len(self.arms))
            for target in self.problem.requirements.targets
            if target.region is not None
        ]

    def share(self, number: int, region: Region) -> float:
        """Share of a region that the tip reaches under a payload."""
        solid = self.case.set_of(self.arms[number])
        if not isinstance(solid, ReachableSolid):
            return 0.0
        return float(solid.contains(region.places(_PLACES)).mean())

    def share_slope(self, number: int, region: Region) -> Array:
        """Its derivatives: what the part of the boundary in the region sweeps, theory (98)."""
        solid = self.case.set_of(self.arms[number])
        if not isinstance(solid, ReachableSolid):
            return np.zeros(self.chain.shape[1])
        nodes = boundary_samples(solid.image)
        inside = (region.distance(nodes.places) <= 0.0).astype(float)
        derivatives, rod = self.derivatives[number], effective(self.rods[number])
        if rod is not self.rods[number]:
            known = find_parameters(rod.arm, self._paths[0])
            derivatives = TipDerivatives(rod, [known[name] for name in self._paths[0]])
        swept = nodes.derivative(derivatives.at(nodes.cube), inside)
        return swept @ self.chain / region.volume

    @lazy
    def neighbors(self) -> list[tuple[float, Manipulator, Manipulator]]:
        """Designs on both sides along each real parameter, and how far they are apart."""
        parameters, pairs = self.problem.parameters, []
        reals, (low, high) = parameters.reals(self.values), parameters.bounds.T
        for k in range(len(reals)):
            ends = np.clip(reals[k] + np.array([1, -1]) * STEP * (high - low)[k], low[k], high[k])
            arms = []
            for end in ends:
                moved = reals.copy()
                moved[k] = end
                arms.append(parameters.arm(parameters.moved(self.values, moved)))
            pairs.append((float((ends[0] - ends[1]) / (high - low)[k]), *arms))
        return pairs

    @lazy
    def _paths(self) -> tuple[tuple[str, ...], Array]:
        """Parameters of the arm that move, and the chain."""
        parameters = self.problem.parameters
        known = parameters_by_every_name(self.case.arm)
        widths = np.ptp(parameters.bounds, axis=1)
        names = [each.name for each in parameters.real]
        rows = {
            name: widths[k] * np.eye(len(names))[k] for k, name in enumerate(names) if name in known
        }
        for tie in parameters.ties:
            if tie.of in names and tie.name in known:
                k = names.index(tie.of)
                rows[tie.name] = tie.factor * widths[k] * np.eye(len(names))[k]
        return tuple(rows), np.array(list(rows.values())).reshape(-1, len(names))
