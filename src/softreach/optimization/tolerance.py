"""Tolerance of a design: what of its reach is kept by arms that are made with deviations.

Their effect is known to first order, theory (99), and checked by arms that are really made.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.inverse.solve import solve_inverse
from softreach.optimization.deviations import AGREEMENT, TOL, FirstOrder, Spread, deviations_of
from softreach.requirements.findings import share_error
from softreach.requirements.requirements import Requirements, Target
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import InvalidLoads
from softreach.sampling import sample_cube
from softreach.schema import provenance
from softreach.support import errors, parallel
from softreach.support.arguments import as_instance, as_integer, as_number
from softreach.support.arrays import Array, Index, Mask, over
from softreach.support.errors import InvalidDesign, NotPossible, counted
from softreach.support.lazy import Dataset
from softreach.support.progress import Progress, as_progress
from softreach.workspace.reach import ACCURACIES, reachable_set
from softreach.workspace.reachable import ReachableSet
from softreach.workspace.search import nearest_tips

_POOL = 1 << 17  # places of space among which those are that are followed
_FOLLOWED = 1 << 13  # near the boundary, and as many away from it
_NEAR = 4.0  # deviations of the boundary
_MOST_TRIED = 1024  # places of targets that arms are made for
_STARTS = 8  # of searches for a place, beside the solutions of the design
_MOST = 1_000_000


class TargetTolerance(NamedTuple):
    """Probability that each place of a target is within reach of an arm as it is made."""

    name: str
    """Name of the target."""
    probability: Array
    """Probability to first order [-], under the worst of the payloads, shape (places,)."""
    made: Array
    """Share of the arms made that reach it [-], NaN for places that were not tried."""
    arms: int
    """Arms that were made."""

    @property
    def made_error(self) -> Array:
        """Standard errors of these shares [-]; with 0 or 1, what one arm more would make of it."""
        return share_error(self.made, max(self.arms, 1))

    @property
    def agrees(self) -> bool:
        """True if the means over the places that were tried are within three standard errors."""
        tried = np.isfinite(self.made)
        off = abs(float((self.probability - self.made)[tried].mean())) if tried.any() else np.inf
        return off <= AGREEMENT * float(self.made_error[tried].mean())


def tolerance(
    arm: Manipulator,
    sigmas: Mapping[str, float],
    requirements: Requirements | None = None,
    *,
    samples: int = 10_000,
    checked: int = 200,
    accuracy: float = 1e-2,
    seed: int = 0,
    progress: Progress | None = None,
) -> "Tolerance":
    """Share of the reach, and of the targets, that arms keep which deviate as they are made.

    To first order the boundary of the reachable set moves along its normal by σ_n, the root of the
    sum of (σ ∂r/∂p · n)²: the share of the set that is kept is 1 - ∮ σ_n dA / (√(2π) V) in the
    mean, theory (99). Its quantile is that of samples of the deviations; a place at a depth d
    within the boundary is kept with the probability Φ(d / σ_n), less beside a sharp rim, where
    only the nearer of both sheets counts. To check this, arms are really made with the first of
    these samples, their sets are compared, and places are searched for from all solutions.

    Args:
        arm: The design, of three free bundles or more.
        sigmas: Parameter -> standard deviation [SI unit]; normal and independent.
        requirements: Targets whose places and regions are to be kept, under each payload; limits,
            directions and regions to keep to are not looked at.
        samples: Samples of the deviations.
        checked: Arms that are made; 0 for none.
        accuracy: Relative error of the volumes.
        seed: Of the deviations.
        progress: Called with the number of arms made since its last call.

    Raises:
        InvalidInput: An unknown parameter or one that cannot deviate, or a number out of range.
        NotPossible: Fewer than three free bundles.
        InvalidDesign: The design has no neighbors with other values of a parameter.
        MissingExtra: scikit-image is not installed.
    """
    deviations = deviations_of(arm, sigmas)
    needs = Requirements() if requirements is None else requirements
    as_instance("requirements", needs, Requirements, "Requirements")
    samples = as_integer("samples", samples, 100, _MOST)
    checked = as_integer("checked", checked, 0, samples)
    accuracy = as_number("accuracy", accuracy, ACCURACIES)
    seed, progress = as_integer("seed", seed, 0), as_progress(progress)
    if (count := as_tip_map(deviations.arm).box.dimension) < 3:
        bundles = f"three free bundles or more, and this arm has {counted(count, 'free bundle')}"
        raise NotPossible(f"a tolerance needs {bundles}")
    with errors.no_warnings():
        shape = samples, len(deviations.sigmas)
        changes = np.random.default_rng(seed).standard_normal(shape) * deviations.sigmas
        return _tolerance(FirstOrder(deviations, needs, accuracy, changes), checked, seed, progress)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tolerance:
    """Numbers of a design as it is made."""

    arm: Manipulator
    """The design."""
    parameters: tuple[str, ...]
    """Names of the parameters that deviate."""
    units: tuple[str, ...]
    """Unit of each."""
    sigmas: Array
    """Standard deviation of each [its unit], shape (parameters,)."""
    kept: Spread
    """Share of the reachable volume that is still reached [-]."""
    volume: Spread
    """Reachable volume [m³]."""
    unreachability: Spread
    """Unreachability [-]; its quantile is the 95 % one."""
    targets: tuple[TargetTolerance, ...]
    """Targets that have places."""
    regions: tuple[Spread, ...]
    """Share of each region that is covered [-]."""
    costs: Array
    """Mean share of the volume that is lost if a parameter deviates alone [-], shape
    (parameters,)."""
    made: int
    """Arms that were made to check all this."""
    impossible: int
    """Arms that cannot exist, or hold no stable equilibrium, beside them."""

    @property
    def agrees(self) -> bool:
        """True if the arms made agree with the first order in every number."""
        return self.made > 1 and all(each.agrees for each in (*self.spreads, *self.targets))

    @property
    def spreads(self) -> tuple[Spread, ...]:
        """Every result that is one number [its unit], regions last."""
        return self.kept, self.volume, self.unreachability, *self.regions

    def to_dataset(self) -> Dataset:
        """All numbers, labeled: to first order and of arms made."""
        import xarray as xr

        fields = ("nominal", "mean", "deviation", "quantile", "level", "error", "agrees")
        fields += ("made_mean", "made_error", "made_deviation", "deviation_error")
        fields += ("made_quantile", "quantile_error")
        numbers = {x: [getattr(each, x) for each in self.spreads] for x in fields}
        names = [target.name for target in self.targets for _ in target.probability]
        shares = {
            "probability": [[], *(target.probability for target in self.targets)],
            "made_share": [[], *(target.made for target in self.targets)],
        }
        values = over("number", **numbers) | over("parameter", sigma=self.sigmas)
        values |= over("parameter", "1", cost=self.costs)
        values |= over("place", target=np.array(names, dtype=str))
        values |= over("place", **{name: np.concatenate(x) for name, x in shares.items()})
        labels = {"number": [x.name for x in self.spreads], "parameter": list(self.parameters)}
        labels |= over("number", unit=[x.unit for x in self.spreads])
        labels |= over("parameter", parameter_unit=list(self.units))
        about = {"arms_made": self.made, "arms_impossible": self.impossible}
        return xr.Dataset(values, labels, {**provenance(self.arm), **about})

    def __repr__(self) -> str:
        made = f"{counted(self.made, 'arm')} made"
        if self.impossible:
            made += f", {self.impossible} more cannot exist"
        lines = [f"Tolerance ({made}):"]
        lines += (f"{each.name:<14}  {each}" for each in self.spreads[:3])
        lines += (f"{each.name} covered  {each}" for each in self.regions)
        for target in self.targets:
            count, least = len(target.probability), int(target.probability.argmin())
            text = f"{100 * target.probability[least]:.3g} %"
            if np.isfinite(share := target.made[least]):
                error = 100 * target.made_error[least]
                text += f" (of arms made {100 * share:.3g} ± {error:.2g} %)"
            which = f" at place {least + 1} of {count:,}, the least likely" if count > 1 else ""
            lines.append(f"{target.name} reached  {text}{which}")
        order = np.argsort(-self.costs, kind="stable")
        each = ", ".join(f"{self.parameters[k]} {100 * self.costs[k]:.2g} %" for k in order[:6])
        return "\n  ".join([*lines, f"lost by each alone  {each}"])


def _tolerance(first: FirstOrder, checked: int, seed: int, progress: Progress) -> Tolerance:
    """Numbers to first order, and of arms that are made with the first of the changes."""
    of_set = first.of_set("volume", "m3", 1.0), first.of_set("unreachability", "1", -1.0)
    spreads = [first.kept(), *of_set, *(first.covered(*region) for region in first.regions)]
    made: list[tuple[list[float], list[Mask]]] = []
    errors = np.zeros(len(spreads))
    if checked:
        followed, starts = _Followed.of(first, seed), [_starts(first, x) for x in first.targets]
        make = partial(_made, first, followed, starts)
        for each in parallel.in_order(partial(make, change) for change in first.changes[:checked]):
            progress(1)
            made += [] if each is None else [each]
        errors[0] = followed.error(float(np.mean([row[0] for row, _ in made]))) if made else 0.0
    values = np.array([row for row, _ in made]).reshape(len(made), len(spreads)).T
    each = zip(spreads, values, errors.tolist(), strict=True)
    kept, volume, unreachability, *regions = (x.with_made(own, error) for x, own, error in each)
    targets = []
    for k, target in enumerate(first.targets):
        share = np.full(len(target.points), np.nan)
        if made:
            share[_tried(target)] = np.mean([reached[k] for _, reached in made], axis=0)
        targets.append(TargetTolerance(target.name, first.probability(target), share, len(made)))
    own, units = first.deviations, tuple(each.unit for each in first.deviations.parameters)
    of_arm: Any = {"arm": own.arm, "parameters": own.names, "units": units, "sigmas": own.sigmas}
    of_sets: Any = {
        "kept": kept,
        "volume": volume,
        "unreachability": unreachability,
        "targets": tuple(targets),
        "regions": tuple(regions),
        "costs": first.costs(),
    }
    return Tolerance(made=len(made), impossible=checked - len(made), **of_arm, **of_sets)


class _Followed(NamedTuple):
    """Places within the reach of the design, more of them near its boundary."""

    near: Array
    away: Array
    share: float  # Share of the volume near the boundary

    @classmethod
    def of(cls, first: FirstOrder, seed: int) -> "_Followed":
        solid, boundary = first.solid, first.boundary
        low, high = boundary.places.min(axis=0), boundary.places.max(axis=0)
        pool = low + (high - low) * sample_cube("sobol", _POOL, 3, seed)
        pool = pool[solid.contains(pool)]
        moves = np.linalg.norm(boundary.speed_at(pool) * first.deviations.sigmas, axis=1)
        width = math.sqrt(float(boundary.area.mean()))
        near = boundary.distance(pool) < _NEAR * moves + width
        return cls(pool[near][:_FOLLOWED], pool[~near][:_FOLLOWED], float(near.mean()))

    def kept(self, solid: ReachableSet) -> float:
        parts = ((self.near, self.share), (self.away, 1.0 - self.share))
        return sum(x * float(solid.contains(part).mean()) for part, x in parts if len(part))

    def error(self, kept: float) -> float:
        """Standard error of such a share, as if the places were random."""
        lost = min(1.0, (1.0 - kept) / max(self.share, 1e-9))
        return self.share * math.sqrt(lost * (1.0 - lost) / max(1, len(self.near)))


def _made(
    first: FirstOrder, followed: _Followed, starts: list[list[Array]], change: Array
) -> tuple[list[float], list[Mask]] | None:
    """Numbers of an arm with deviations, and the places that it reaches; None without one."""
    with parallel.undivided(), errors.no_warnings():
        try:
            arm = first.deviations.made(change)
            solid = reachable_set(arm, accuracy=first.accuracy)
            if solid.dimension == 3:
                covered = (_share(first, *region, arm, solid) for region in first.regions)
                numbers = [followed.kept(solid), solid.volume, solid.unreachability, *covered]
                pairs = zip(first.targets, starts, strict=True)
                return numbers, [_reached(arm, first, *x) for x in pairs]
        except (InvalidDesign, InvalidLoads):
            return None
    return None


def _tried(target: Target) -> Index:
    """Numbers of the places that arms are made for, evenly spread over all."""
    count = len(target.points)
    return np.unique(np.linspace(0, count - 1, min(count, _MOST_TRIED)).astype(np.int64))


def _starts(first: FirstOrder, target: Target) -> list[Array]:
    """Places of the cube to search from: of all solutions of the design, and of a grid."""
    arm, places = first.deviations.arm, target.points[_tried(target)]
    box, solutions = as_tip_map(arm).box, solve_inverse(arm, places, from_rest=True)
    rows = [solutions.nearest_activations]
    for number in range(int(solutions.counts.max(initial=0))):
        has = solutions.counts > number
        rows.append(row := solutions.nearest_activations.copy())
        row[has] = solutions.activations[solutions.offsets[:-1][has] + number]
    known = [np.nan_to_num(box.to_cube(row)[:, box.free], nan=0.5) for row in rows]
    grid = sample_cube("sobol", _STARTS, box.dimension)
    return [*known, *(np.tile(start, (len(places), 1)) for start in grid)]


def _reached(arm: Manipulator, first: FirstOrder, target: Target, starts: list[Array]) -> Mask:
    """Places that an arm reaches under every payload, of those that are tried: by searches."""
    places = target.points[_tried(target)]
    within, held = max(target.within, TOL * arm.length), np.ones(len(places), bool)
    for laden in first.needs.under_payloads(arm):
        rod, left = as_tip_map(laden), np.arange(len(places))
        for start in starts if len(places) else ():
            gamma = rod.box.from_free_cube(start[left])
            gaps = nearest_tips(rod, gamma, places[left], within).distance
            left = left[~(gaps <= within)]
            if not len(left):
                break
        held[left] = False
    return held


def _share(
    first: FirstOrder, target: Target, places: Array, arm: Manipulator, solid: ReachableSet
) -> float:
    share = 1.0
    for laden in first.needs.under_payloads(arm):
        own = solid if laden is arm else reachable_set(laden, accuracy=first.accuracy)
        if own.dimension < 3:
            return 0.0
        inside = own.distance(places) <= target.within if target.within else own.contains(places)
        share = min(share, float(inside.mean()))
    return share
