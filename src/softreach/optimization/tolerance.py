"""Tolerance of a design: what of its reach is kept by arms that are made with deviations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.optimization.deviations import FirstOrder, Spread, deviations_of
from softreach.optimization.monte_carlo import ArmsMade, arms_made, tried, with_places, with_region
from softreach.requirements.requirements import Requirements
from softreach.rod.rods import as_tip_map
from softreach.schema import provenance
from softreach.support.arguments import as_instance, as_integer, as_number
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible, counted, no_warnings
from softreach.support.progress import Progress, as_progress
from softreach.workspace.reach import ACCURACIES

if TYPE_CHECKING:
    import xarray as xr

_MOST = 1_000_000


class TargetTolerance(NamedTuple):
    """Probability that each place of a target is within reach of an arm as it is made."""

    name: str
    probability: Array
    """To first order, under the worst of the payloads, shape (places,)."""
    made: Array
    """Share of the arms made that reach it, NaN for places that were not tried."""
    arms: int
    """Arms that were made."""

    @property
    def made_error(self) -> Array:
        """Standard errors of these shares; with 0 or 1, what one arm more would make of it."""
        each = np.maximum(self.made * (1.0 - self.made), 1.0 / max(self.arms, 1))
        return np.sqrt(each / max(self.arms, 1))

    @property
    def agrees(self) -> bool:
        """True if the means over the places that were tried are within three standard errors."""
        tried = np.isfinite(self.made)
        off = abs(float((self.probability - self.made)[tried].mean())) if tried.any() else np.inf
        return off <= 3.0 * float(self.made_error[tried].mean())


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
) -> Tolerance:
    """Share of the reach, and of the targets, that arms keep which deviate as they are made.

    To first order the boundary of the reachable set moves along its normal by σ_n, the root of the
    sum of (σ ∂r/∂p · n)²: the share of the set that is kept is 1 - ∮ σ_n dA / (√(2π) V) in the
    mean, theory (99). Its quantile is that of samples of the deviations; a place at a depth d
    within the boundary is kept with the probability Φ(d / σ_n). Beside a sharp rim that is too
    much, as only the nearer of both sheets counts. Nothing of this is taken on trust: arms are
    really made with the first of these samples, their sets are compared, and places are searched
    for from all solutions of the design.

    Args:
        arm: The design, of three free bundles or more.
        sigmas: Parameter -> standard deviation [SI unit]; normal and independent.
        requirements: Targets whose places and regions are to be kept, under each payload; limits
            and regions to keep to are not looked at.
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
        found = counted(count, "free bundle")
        raise NotPossible(f"a tolerance needs three free bundles or more, and this arm has {found}")
    with no_warnings():
        first = FirstOrder(deviations, needs, accuracy, deviations.draws(samples, seed))
        arms = arms_made(first, checked, seed, progress)
        return _tolerance(first, arms)


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Tolerance:
    """Numbers of a design as it is made."""

    arm: Manipulator
    parameters: tuple[str, ...]
    """Names of the parameters that deviate."""
    units: tuple[str, ...]
    """Unit of each."""
    sigmas: Array
    """Standard deviation of each [its unit], shape (parameters,)."""
    kept: Spread
    """Share of the reachable volume that is still reached."""
    volume: Spread
    """Reachable volume [m³]."""
    unreachability: Spread
    """Unreachability; its quantile is the 95 % one."""
    targets: tuple[TargetTolerance, ...]
    """Targets that have places."""
    regions: tuple[Spread, ...]
    """Share of each region that is covered."""
    costs: Array
    """Mean share of the volume that is lost if a parameter deviates alone, shape (parameters,)."""
    made: int
    """Arms that were made to check all this."""
    impossible: int
    """Arms that cannot exist, or hold no stable equilibrium, beside them."""

    @property
    def agrees(self) -> bool:
        """True if the arms made agree with the first order in every number."""
        spreads = (self.kept, self.volume, self.unreachability, *self.regions)
        return self.made > 1 and all(each.agrees for each in (*spreads, *self.targets))

    @property
    def worst_parameter(self) -> str:
        """The parameter whose deviation costs most."""
        return self.parameters[int(self.costs.argmax())]

    def to_dataset(self) -> xr.Dataset:
        """All numbers, labeled: to first order and of arms made."""
        import xarray as xr

        spreads = [self.kept, self.volume, self.unreachability, *self.regions]
        fields = ("nominal", "mean", "deviation", "quantile", "level", "error", "agrees")
        fields += ("made_mean", "made_error", "made_deviation", "deviation_error")
        fields += ("made_quantile", "quantile_error")
        columns = {name: ("number", [getattr(each, name) for each in spreads]) for name in fields}
        join = np.concatenate
        names = [target.name for target in self.targets for _ in target.probability]
        return xr.Dataset(
            {
                **columns,
                "sigma": ("parameter", self.sigmas),
                "cost": ("parameter", self.costs, {"units": "1"}),
                "target": ("place", np.array(names, dtype=str)),
                "probability": ("place", join([[], *(t.probability for t in self.targets)])),
                "made_share": ("place", join([[], *(t.made for t in self.targets)])),
            },
            {
                "number": [each.name for each in spreads],
                "unit": ("number", [each.unit for each in spreads]),
                "parameter": list(self.parameters),
                "parameter_unit": ("parameter", list(self.units)),
            },
            {**provenance(self.arm), "arms_made": self.made, "arms_impossible": self.impossible},
        )

    def __repr__(self) -> str:
        made = f"{counted(self.made, 'arm')} made"
        if self.impossible:
            made += f", {self.impossible} more cannot exist"
        lines = [
            f"Tolerance ({made}):",
            f"reach kept      {self.kept}",
            f"volume          {self.volume}",
            f"unreachability  {self.unreachability}",
            *(f"{each.name} covered  {each}" for each in self.regions),
            *(_target_text(each) for each in self.targets),
        ]
        order = np.argsort(-self.costs, kind="stable")
        each = ", ".join(f"{self.parameters[k]} {100 * self.costs[k]:.2g} %" for k in order[:6])
        return "\n  ".join([*lines, f"lost by each alone  {each}"])


def _target_text(target: TargetTolerance) -> str:
    least = int(target.probability.argmin())
    text = f"{100 * target.probability[least]:.3g} %"
    made = target.made[least]
    if np.isfinite(made):
        text += f" (of arms made {100 * made:.3g} ± {100 * target.made_error[least]:.2g} %)"
    count = len(target.probability)
    which = f" at place {least + 1} of {count:,}, the least likely" if count > 1 else ""
    return f"{target.name} reached  {text}{which}"


def _tolerance(first: FirstOrder, arms: ArmsMade) -> Tolerance:
    made, deviations = arms.made, first.deviations

    def column(name: str) -> Array:
        return np.array([getattr(each, name) for each in made], float)

    targets = []
    for k, target in enumerate(with_places(first.needs)):
        probability = first.probability(target)
        share = np.full(len(probability), np.nan)
        if made:
            share[tried(len(share))] = np.mean([each.reached[k] for each in made], axis=0)
        targets.append(TargetTolerance(target.name, probability, share, len(made)))
    return Tolerance(
        arm=deviations.arm,
        parameters=deviations.names,
        units=tuple(each.unit for each in deviations.parameters),
        sigmas=deviations.sigmas,
        kept=first.kept().with_made(column("kept"), arms.error_of_kept if made else 0.0),
        volume=first.of_set("volume", "m3", 1.0).with_made(column("volume")),
        unreachability=first.of_set("unreachability", "1", -1.0).with_made(
            column("unreachability")
        ),
        targets=tuple(targets),
        regions=tuple(
            first.covered(target).with_made(np.array([each.covered[k] for each in made], float))
            for k, target in enumerate(with_region(first.needs))
        ),
        costs=first.costs(),
        made=len(made),
        impossible=arms.impossible,
    )
