"""Result of a check: every requirement met, missed or undecided, with the poses at all places."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.requirements.findings import Finding, Verdict
from softreach.requirements.regions import Region
from softreach.requirements.requirements import Requirements, with_payload
from softreach.rod.kinematics import configuration
from softreach.schema import AXES, provenance
from softreach.support.arguments import as_integer
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy
from softreach.support.report import Report, Section

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TOL", "Check", "Coverage"]

TOL = 1e-6  # over L: a place that is reached to the error of the tips is reached


class Coverage(NamedTuple):
    """Share of a region that the tip reaches."""

    name: str
    """Of the target."""
    payload: float | None
    """Mass at the tip [kg]; None for the loads of the design."""
    share: float
    error: float
    """Standard deviation of a share of so many places, which are spread more evenly than chance
    would."""
    places: int
    """Number of places in the region that were tried."""


@dataclass(frozen=True, eq=False, repr=False)
class Check:
    """A design against requirements."""

    arm: Manipulator
    """The design, with its own loads."""
    requirements: Requirements
    payloads: tuple[float | None, ...]
    """Masses at the tip [kg]; None for the loads of the design."""
    findings: tuple[Finding, ...]
    """Every requirement: targets, regions, limits, measures."""
    coverages: tuple[Coverage, ...]
    """Shares of regions that are to be covered, by payload and target."""
    accuracy: float
    gaps: Array
    """Distance of the tip to every place of every target [m], shape (payload, place)."""
    poses: Array
    """Inputs chosen for each place, in their units, shape (payload, place, inputs)."""
    effort: Array
    """√Σ(γ/g)² of these, g being the larger size of the bounds of an input [-], shape (payload,
    place)."""
    nearest: Array
    """Tips of these poses [m], shape (payload, place, 3)."""

    @property
    def verdict(self) -> Verdict:
        """Missed if one requirement is, else undecided if one is."""
        every = {finding.verdict for finding in self.findings}
        return "missed" if "missed" in every else "undecided" if "undecided" in every else "met"

    @property
    def met(self) -> bool:
        """True if every requirement is met."""
        return self.verdict == "met"

    @property
    def excess(self) -> float:
        """Sum of what the findings miss [-]."""
        return float(sum(finding.excess for finding in self.findings))

    @property
    def places(self) -> Array:
        """The places [m], shape (place, 3)."""
        return self.requirements.places

    @lazy
    def target_of(self) -> Index:
        """Index of the target that each place belongs to, shape (place,)."""
        counts = [0 if t.places is None else len(t.places) for t in self.requirements.targets]
        return np.repeat(np.arange(len(counts)), counts)

    @property
    def reached(self) -> Mask:
        """Mask of the places that are met, shape (payload, place)."""
        return self.gaps <= np.maximum(self.requirements.within, TOL * self.arm.length)

    @property
    def regions(self) -> tuple[tuple[str, Region], ...]:
        """Regions with what they are for: "stay_inside", "avoid" or "cover"."""
        kept = ((keep.kind, keep.region) for keep in self.requirements.keeps)
        targets = (target.region for target in self.requirements.targets)
        return (*kept, *(("cover", region) for region in targets if region is not None))

    def shapes(self, count: int) -> xr.Dataset | None:
        """The arm in poses of some places that are apart, under the largest payload.

        Args:
            count: Number of poses at most.

        Returns:
            As `configuration` has them; None where there are no places.
        """
        count = as_integer("count", count, 0)
        rows = np.unique(np.linspace(0, len(self.places) - 1, count).round().astype(int))
        rows = rows[rows >= 0] if len(self.places) else rows[:0]
        if not len(rows):
            return None
        arm = with_payload(self.arm, self.payloads[-1])
        shapes = configuration(arm, self.poses[-1, rows])
        held = np.isfinite(shapes["position"].values).all(axis=(1, 2))
        return shapes.isel(sample=held) if held.any() else None

    def report(self) -> Report:
        """Verdict, every requirement and a picture, to be printed, or saved as an .html file."""
        from softreach.plot.arm import plot_check

        own = [finding.verdict for finding in self.findings]
        parts = [f"{word}, {own.count(word)} of {len(own)}" for word in ("missed", "undecided")]
        kept = [part for part in parts if part.split(",")[0] in own] or [f"met, all {len(own)}"]
        size = self.arm.length_unit.text(self.arm.length)
        space = 9 if "undecided" in own else 6
        rows = [(f.word.ljust(space), f.name, f.text) for f in self.findings]
        caption = "The arm at the places that it must reach."
        return Report(
            title="Requirements of an arm",
            verdict=f"Requirements of an arm of {size}: {'; '.join(kept)}",
            state=self.verdict,
            sections=[
                Section(title="Requirements", rows=rows, printed=max(1, len(rows))),
                Section(
                    title="Picture",
                    figures=lambda: [(plot_check(self, unit=self.arm.length_unit).figure, caption)],
                ),
                Section(title="The design", text=self.arm.to_toml()),
                Section(title="The requirements", text=self.requirements.to_toml()),
            ],
        )

    def __repr__(self) -> str:
        return str(self.report())

    def to_dataset(self) -> xr.Dataset:
        """Places with their gaps, poses and efforts, and the findings, labeled."""
        import xarray as xr

        at = ("payload", "place")
        findings = self.findings
        masses = [np.nan if payload is None else payload for payload in self.payloads]
        names = [self.requirements.targets[k].name for k in self.target_of]
        return xr.Dataset(
            {
                "position": (("place", "axis"), self.places, {"units": "m"}),
                "target": ("place", np.array(names, dtype=str)),
                "gap": (at, self.gaps, {"units": "m"}),
                "reached": (at, self.reached),
                "pose": ((*at, "input"), self.poses),
                "nearest": ((*at, "axis"), self.nearest, {"units": "m"}),
                "effort": (at, self.effort, {"units": "1"}),
                "met": ("finding", [finding.met for finding in findings]),
                "verdict": ("finding", np.array([f.verdict for f in findings], dtype=str)),
                "excess": ("finding", [finding.excess for finding in findings], {"units": "1"}),
                "text": ("finding", np.array([finding.text for finding in findings], dtype=str)),
                "share": ("coverage", [each.share for each in self.coverages], {"units": "1"}),
                "share_error": ("coverage", [each.error for each in self.coverages]),
            },
            {
                "axis": list(AXES),
                "payload": ("payload", masses, {"units": "kg"}),
                "input": list(self.arm.input_names),
                "input_unit": ("input", list(self.arm.input_units)),
                "finding": np.array([finding.name for finding in findings], dtype=str),
                "kind": ("finding", np.array([finding.kind for finding in findings], dtype=str)),
                "coverage": np.array([each.name for each in self.coverages], dtype=str),
            },
            {**provenance(self.arm), "length": self.arm.length},
        )
