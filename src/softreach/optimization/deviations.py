"""Deviations of arms as they are made, and their effect to first order: theory (99)."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.special import ndtr

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters import Parameter, find_parameters, shifted
from softreach.arm.tables import check_extension
from softreach.requirements.findings import share_error
from softreach.requirements.requirements import Requirements, Target
from softreach.rod.tip_map import InvalidLoads
from softreach.support import parallel
from softreach.support.arguments import as_mapping, as_number
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible, Range
from softreach.support.quantity import quantity
from softreach.workspace.gradient import MovingBoundary, volume_gradient
from softreach.workspace.reach import reachable_set
from softreach.workspace.reachable import ReachableSet

_QUANTILE = 0.05  # share of arms that are worse than the number given for them
_NORMAL = 1.6448536269514722  # the 95 % quantile of the normal distribution
AGREEMENT = 3.0  # standard errors
_SIGMA = Range(0.0)
TOL = 1e-6  # of tips at targets, in L
_IN_REGION = 2048  # places of a region
_BLOCK = 1 << 22  # numbers at once


@dataclass(frozen=True, eq=False)
class Deviations:
    """Independent normal deviations of parameters of an arm."""

    arm: Manipulator
    parameters: tuple[Parameter, ...]
    names: tuple[str, ...]
    sigmas: Array  # Standard deviation of each [its unit], shape (parameters,)

    def made(self, change: Array) -> Manipulator:
        """The arm with changes of its parameters; parts that share one change alike."""
        made = self.arm
        for parameter, amount in zip(self.parameters, change.tolist(), strict=True):
            if amount:
                # One after the other: what follows from a parameter deviates with it.
                made = shifted(made, parameter, amount)
        check_extension(made)
        return made


def deviations_of(arm: Manipulator, sigmas: Mapping[str, Any]) -> Deviations:
    """Deviations of a design from standard deviations [SI units] by parameter."""
    arm = a_manipulator("arm", arm)
    given = as_mapping("sigmas", sigmas, lambda name, x: as_number(f"sigmas {name}", x, _SIGMA))
    if not given:
        raise InvalidInput("sigmas", "none", "the standard deviation of one parameter or more")
    known = find_parameters(arm, given)
    for name, parameter in known.items():
        if parameter.whole or not np.isfinite(parameter.values(arm)).all():
            raise InvalidInput("sigmas", name, "a number that can change a little, not a count")
    names, parts = zip(*known.items(), strict=True)
    return Deviations(arm, parts, names, np.array([given[name] for name in names]))


@dataclass(frozen=True, kw_only=True)
class Spread:
    """A number of arms as they are made: to first order, and of arms really made."""

    name: str
    """Name of the number."""
    unit: str
    """SI unit; "1" for none."""
    nominal: float
    """Value of the design itself [unit]."""
    mean: float
    """Mean of the arms to first order [unit]."""
    deviation: float
    """Standard deviation to first order [unit]."""
    quantile: float
    """Quantile of the arms to first order [unit]: 5 %, or 95 % where small values are good."""
    error: float = 0.0
    """Error of the mean, from how finely sets were computed [unit]."""
    sense: float = 1.0
    """1 if large values are good, -1 if small ones are [-]."""
    made: int = 0
    """Arms that were made; the fields below are NaN without any."""
    made_mean: float = math.nan
    """Mean of the arms made [unit]."""
    made_error: float = math.nan
    """Standard error of `made_mean` [unit]."""
    made_deviation: float = math.nan
    """Standard deviation of the arms made [unit]."""
    deviation_error: float = math.nan
    """Standard error of `made_deviation` [unit]."""
    made_quantile: float = math.nan
    """Quantile of the arms made [unit]."""
    quantile_error: float = math.nan
    """Standard error of `made_quantile`, from the ranks within one of it [unit]."""

    @property
    def level(self) -> float:
        """Share of arms below the quantile [-]: 0.05, or 0.95 where small values are good."""
        return _QUANTILE if self.sense > 0.0 else 1.0 - _QUANTILE

    @property
    def agrees(self) -> bool:
        """True if both means, and both deviations, are within three standard errors."""
        if self.made < 2:
            return False
        off = abs(self.mean - self.made_mean), abs(self.deviation - self.made_deviation)
        errors = math.hypot(self.made_error, self.error), self.deviation_error + self.error
        rounding = 1e-9 * abs(self.nominal)
        return all(x <= AGREEMENT * error + rounding for x, error in zip(off, errors, strict=True))

    def with_made(self, values: Array, error: float = 0.0) -> Self:
        """The same with values of arms that were made, NaN without one, which share an error."""
        values = values[np.isfinite(values)]
        count = len(values)
        if count < 2:
            return replace(self, made=count)
        mean, deviation = float(values.mean()), float(values.std(ddof=1))
        fourth = float(((values - mean) ** 4).mean())
        spread = max(fourth - deviation**4, 0.0) / (4.0 * count * max(deviation**2, 1e-300))
        off = math.sqrt(self.level * (1.0 - self.level) / count)
        levels = np.clip([self.level - off, self.level, self.level + off], 0.0, 1.0)
        low, quantile, high = np.quantile(values, levels).tolist()
        numbers = {"made_mean": mean, "made_deviation": deviation, "made_quantile": quantile}
        errors = {
            "made_error": math.hypot(deviation / math.sqrt(count), error),
            "deviation_error": math.sqrt(spread),
            "quantile_error": math.hypot(0.5 * (high - low), error),
        }
        return replace(self, made=count, **numbers, **errors)

    def __str__(self) -> str:
        scale, unit = (100.0, "%") if self.unit == "1" else (1.0, self.unit.replace("m3", "m³"))

        def text(value: float, error: float) -> str:
            return quantity(scale * value, unit, scale * error)

        mean, low = (text(value, 0.01 * self.deviation) for value in (self.mean, self.quantile))
        first = f"{mean}, {100 * self.level:.0f} % quantile {low}"
        if self.made < 2:
            return first
        mean = text(self.made_mean, self.made_error)
        low = text(self.made_quantile, self.quantile_error)
        return f"{first}; made {mean}, {low}: {'agrees' if self.agrees else 'DIFFERS'}"


class FirstOrder:
    """Sets, their boundaries and what deviations do to them, to first order."""

    def __init__(
        self, deviations: Deviations, needs: Requirements, accuracy: float, changes: Array
    ) -> None:
        self.deviations, self.needs = deviations, needs
        self.accuracy, self.changes = accuracy, changes
        self.targets = [target for target in needs.targets if target.region is None]
        self.regions = [(target, region.places(_IN_REGION)) for target, region in needs.regions]
        self.gradient = volume_gradient(deviations.arm, deviations.names, accuracy=accuracy)
        self.solid = self.gradient.solid
        self.boundary = MovingBoundary.of(self.solid, deviations.parameters)
        self.loaded = [self._of(arm) for arm in needs.under_payloads(deviations.arm)]

    def _of(self, arm: Manipulator) -> tuple[ReachableSet, MovingBoundary] | None:
        """Set of the arm under a payload, and its boundary; None where nothing is stable."""
        if arm is self.deviations.arm or not self.needs.targets:
            return self.solid, self.boundary
        try:
            solid = reachable_set(arm, accuracy=self.accuracy)
        except InvalidLoads:
            return None
        if solid.dimension < 3:
            payload = arm.loads.payload if arm.loads else 0.0
            raise NotPossible(f"with {payload:g} kg at its tip the arm reaches no volume")
        known = find_parameters(arm, self.deviations.names)
        return solid, MovingBoundary.of(solid, tuple(known.values()))

    def kept(self) -> Spread:
        """Share of the volume that is kept."""
        volume, sigmas = self.solid.volume, self.deviations.sigmas
        shares = 1.0 - self.boundary.lost(self.changes) / volume
        # The triangles sweep what the gradient, which is more exact, says to be swept in all.
        off = np.linalg.norm((self.boundary.growth - self.gradient.volume) * sigmas)
        mean = 1.0 - self.boundary.mean_lost(sigmas) / volume
        error = float(off) / volume / math.sqrt(2.0 * math.pi)
        return _spread_of("reach kept", shares, nominal=1.0, mean=mean, error=error)

    def costs(self) -> Array:
        """Share lost by each parameter alone."""
        each = np.diag(self.deviations.sigmas)
        return np.array([self.boundary.mean_lost(row) for row in each]) / self.solid.volume

    def of_set(self, name: str, unit: str, sense: float) -> Spread:
        """A number of the set, by its gradient."""
        mean = float(getattr(self.solid, name))
        slopes = (getattr(self.gradient, part) for part in (name, f"{name}_error"))
        widths = (float(np.linalg.norm(each * self.deviations.sigmas)) for each in slopes)
        known = dict(zip(("deviation", "error"), widths, strict=True))
        low = mean - sense * _NORMAL * known["deviation"]
        of = {"name": name, "unit": unit, "sense": sense}
        return Spread(nominal=mean, mean=mean, quantile=low, **known, **of)

    def depths(self, places: Array, within: float) -> Iterator[tuple[Array, Array]]:
        """Depth of places within reach [m], and how the boundary there moves, by payloads."""
        still = np.zeros((len(places), len(self.deviations.sigmas)))
        for known in self.loaded:
            if known is None:
                yield np.full(len(places), -np.inf), still
            else:
                yield within - known[0].distance(places), known[1].speed_at(places)

    def probability(self, target: Target) -> Array:
        """Φ(depth / σ) of each place under the worst payload: 0 or 1 where nothing moves."""
        within, each = max(target.within, TOL * self.solid.arm.length), []
        for depth, speed in self.depths(target.points, within):
            sigma = np.linalg.norm(speed * self.deviations.sigmas, axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                share = ndtr(depth / sigma)
            each.append(np.where(sigma > 0.0, share, (depth >= 0.0).astype(float)))
        return np.min(each, axis=0)

    def covered(self, target: Target, places: Array) -> Spread:
        """Share of a region with these places that is covered, under the worst payload."""
        shares, nominal = np.ones(len(self.changes)), 1.0
        for depth, speed in self.depths(places, target.within):
            nominal = min(nominal, float((depth >= 0.0).mean()))
            for block in parallel.blocks(len(shares), max(1, _BLOCK // len(places))):
                held = (depth + self.changes[block] @ speed.T >= 0.0).mean(axis=1)
                shares[block] = np.minimum(shares[block], held)
        known = {"mean": float(shares.mean()), "error": float(share_error(nominal, len(places)))}
        return _spread_of(target.name, shares, nominal=nominal, **known)


def _spread_of(name: str, shares: Array, **known: Any) -> Spread:
    low = max(0.0, float(np.quantile(shares, _QUANTILE)))
    return Spread(name=name, unit="1", deviation=float(shares.std()), quantile=low, **known)
