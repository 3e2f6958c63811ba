"""Solutions of the inverse problem, readable as a list."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from html import escape
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.tip_map import Frame, TipMap
from softreach.schema import (
    AXES,
    activation_attributes,
    activation_text,
    bundle_coordinates,
    provenance,
)
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import counted
from softreach.support.units import LengthUnit, as_unit

if TYPE_CHECKING:
    import xarray as xr


_EXACT = 1e-6  # of L, the error of tips


class Status(IntEnum):
    """Outcome of the search for a target."""

    REACHED = 0
    """Some activation within the bounds puts the tip there, stable, to `tol` or `within`; its
    residual says how near."""
    UNREACHABLE = 1
    """It is proved that no activation does: no tip is nearer than `gap_bound`, above `tol` L."""
    NOT_FOUND = 2
    """The search found no activation, and no proof that there is none."""
    IN_CONTACT = 3
    """Of those that were found every activation makes the arm touch something."""


@dataclass(frozen=True, eq=False, repr=False)
class Solution:
    """The activations that reach one target, or come nearest to it."""

    target: Array
    """Wanted position of the tip [m], shape (3,)."""
    status: Status
    """Outcome of the search."""
    activations: Array
    """Each activation that reaches the target [unit of each], shape (k, bundles); k = 0 if none."""
    residuals: Array
    """|tip - target| [m], shape (k,)."""
    direction_errors: Array
    """Angles between the tip's direction and that wanted [rad], NaN if none is, shape (k,)."""
    marker_errors: Array
    """Distances of markers from their targets [m], shape (k, markers)."""
    conditions: Array
    """Condition numbers of ∂r/∂γ of the free bundles [-], infinite on a fold, shape (k,)."""
    margins: Array
    """Distance to the nearest bound of a free bundle over its range [-], shape (k,)."""
    leans: Mask
    """Mask of those whose posture leans to one of two sides, under loads, shape (k,)."""
    sheets: Index
    """Number of the tip map that holds each; 0 for postures that activations lead to straight from
    rest, shape (k,)."""
    nearest: Array
    """The reachable point nearest to the target that was found [m], shape (3,)."""
    nearest_activation: Array
    """An activation that leads there [unit of each], shape (bundles,)."""
    gap: float
    """|nearest - target| [m]."""
    direction_gap: float
    """Angle between the tip's direction there and that wanted [rad]; NaN if none is."""
    marker_gaps: Array
    """Distances of markers from their targets there [m], shape (markers,)."""
    gap_bound: float
    """A proved lower bound of the distance to all tips within the bounds [m], more than their
    error; 0 if nothing is proved."""
    tip_maps: tuple[TipMap, ...]
    """Tip maps: that of postures from rest, and those of other sheets that loads leave."""
    marker_names: tuple[str, ...]
    """Names of the markers that have targets."""

    def __len__(self) -> int:
        return len(self.activations)

    def posture(self, number: int = 0) -> TipMap:
        """The tip map of the arm in the posture of one of the activations.

        `configuration`, `track_path` and `Drag` begin there. Without loads it is that of the arm.

        Args:
            number: Row of `activations`.
        """
        tip_map = self.tip_maps[self.sheets[number]]
        return tip_map.continued_from(self.activations[number][None])

    def __repr__(self) -> str:
        place = ", ".join(f"{x:.6g}" for x in self.target)
        outcome = self.status.name.lower().replace("_", " ")
        if not len(self):
            near = f"nearest point {self.gap:.3g} m away{_off(self.direction_gap)}"
            return f"<Solution for ({place}) m: {outcome}, {near}>"
        count, worst = counted(len(self), "activation"), self.residuals.max()
        summary = f"{count}, largest residual {worst:.1e} m"
        return f"<Solution for ({place}) m: {outcome}, {summary}>"

    def __str__(self) -> str:
        return self.text()

    def text(self, unit: str | None = None) -> str:
        """A line for each activation, or what is known of the nearest point.

        Args:
            unit: Of lengths: m, cm, mm or L; None for that of the design, or one that is handy.

        Raises:
            InvalidInput: No such unit.
        """
        arm, names = self.tip_maps[0].arm, self.tip_maps[0].box.names
        shown = arm.length_unit if unit is None else as_unit(unit, arm.length)
        status = self.status.name.lower().replace("_", " ")
        if len(self) and self.gap > _EXACT * arm.length:
            status += f" within {shown.rounded(self.gap)}"
        lines = [f"target {shown.place(self.target)}: {status}"]
        for k, gamma in enumerate(self.activations):
            quality = f"residual {shown.rounded(self.residuals[k], digits='.1e')}"
            quality += _off(self.direction_errors[k])
            quality += self._markers_off(self.marker_errors[k], shown)
            if gamma.size:
                quality += f", condition {self.conditions[k]:.3g}, margin {self.margins[k]:.3g}"
            if self.sheets[k]:
                quality += ", in a posture that the arm does not take straight from rest"
            lines.append(f"{activation_text(arm, gamma, names)}  ({quality})")
        if not len(self):
            least = shown.rounded(self.gap_bound)
            bound = f"; every tip is proved to be {least} away or farther" if self.gap_bound else ""
            nearest, gap = shown.place(self.nearest), shown.rounded(self.gap)
            off = _off(self.direction_gap) + self._markers_off(self.marker_gaps, shown)
            lines.append(f"nearest {nearest}, {gap} away{off}{bound}")
            gamma = activation_text(arm, self.nearest_activation, names)
            lines.append(f"the tip is there at {gamma}")
        return "\n  ".join(lines)

    def _markers_off(self, errors: Array, unit: LengthUnit) -> str:
        pairs = zip(self.marker_names, errors, strict=True)
        return "".join(f", {name} {unit.rounded(x, digits='.3g')} off" for name, x in pairs)


def _off(angle: float) -> str:
    return "" if np.isnan(angle) else f", direction {np.degrees(angle):.3g}° off"


@dataclass(frozen=True, eq=False, repr=False)
class Solutions(Sequence[Solution]):
    """One `Solution` for each target, stored as flat arrays so that a million cost little."""

    targets: Array
    """Shape (t, 3) [m]."""
    statuses: NDArray[np.int8]
    """`Status` of each target, shape (t,)."""
    activations: Array
    """Shape (n, bundles) [unit of each]."""
    residuals: Array
    """Shape (n,) [m]."""
    direction_errors: Array
    """Shape (n,) [rad]."""
    marker_errors: Array
    """Shape (n, markers) [m]."""
    conditions: Array
    """Shape (n,) [-]."""
    margins: Array
    """Shape (n,) [-]."""
    leans: Mask
    """Shape (n,)."""
    sheets: Index
    """Numbers of tip maps, shape (n,)."""
    nearest: Array
    """The nearest reachable points, shape (t, 3) [m]."""
    nearest_activations: Array
    """Shape (t, bundles) [unit of each]."""
    gaps: Array
    """Shape (t,) [m]."""
    direction_gaps: Array
    """Shape (t,) [rad]."""
    marker_gaps: Array
    """Shape (t, markers) [m]."""
    gap_bounds: Array
    """Proved lower bounds of the distance to all tips, 0 if nothing is proved, shape (t,) [m]."""
    offsets: Index
    """Activations of target i are rows offsets[i]:offsets[i + 1], shape (t + 1,)."""
    arm: Manipulator
    """The design."""
    frame: Frame
    """The frame in which places are told."""
    bundles: tuple[str, ...]
    """Names of the bundles that were solved for."""
    tip_maps: tuple[TipMap, ...]
    """Tip maps: that of postures from rest, and those of other sheets."""
    marker_names: tuple[str, ...]
    """Names of the markers that have targets."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The solutions for consecutive blocks of targets, one block or more, as one."""
        if len(parts) == 1:
            return parts[0]
        counts = np.concatenate([part.counts for part in parts])
        return replace(
            max(parts, key=lambda part: len(part.tip_maps)),
            offsets=np.concatenate([[0], np.cumsum(counts)]),
            **{name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS},
        )

    def only(self, rows: Index, counts: Index) -> Self:
        """The same with those of its activations, so many for each target, that touch nothing."""
        own = self._of({"target": slice(None), "solution": rows})
        touches = (counts == 0) & (self.counts > 0)
        own["statuses"] = np.where(touches, Status.IN_CONTACT, self.statuses).astype(np.int8)
        return replace(self, offsets=np.cumsum([0, *counts]), **own)

    @property
    def counts(self) -> Index:
        """Number of activations found for each target, shape (t,)."""
        return np.diff(self.offsets)

    def __len__(self) -> int:
        return len(self.targets)

    @overload
    def __getitem__(self, index: int) -> Solution: ...
    @overload
    def __getitem__(self, index: slice) -> Solutions: ...
    def __getitem__(self, index: int | slice) -> Solution | Solutions:
        if not isinstance(index, slice):
            i = range(len(self))[index]
            rows = {"target": i, "solution": slice(self.offsets[i], self.offsets[i + 1])}
            target, status, *others = self._of(rows).values()
            common = {"tip_maps": self.tip_maps, "marker_names": self.marker_names}
            return Solution(target, Status(status), *others, **common)
        chosen = np.arange(len(self))[index]
        counts = self.counts[chosen]
        offsets = np.concatenate([[0], np.cumsum(counts)])
        inside = np.arange(offsets[-1]) - np.repeat(offsets[:-1], counts)
        rows = {"target": chosen, "solution": np.repeat(self.offsets[chosen], counts) + inside}
        return replace(self, offsets=offsets, **self._of(rows))

    def __repr__(self) -> str:
        outcomes = np.bincount(self.statuses, minlength=len(Status))
        parts = [
            f"{outcomes[status]} {status.name.lower().replace('_', ' ')}"
            for status in Status
            if outcomes[status]
        ]
        if len(self.residuals):
            parts.append(counted(len(self.residuals), "activation"))
            parts.append(f"largest residual {self.residuals.max():.1e} m")
        targets = counted(len(self), "target")
        return f"<Solutions for {targets}{': ' if parts else ''}{', '.join(parts)}>"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self)[1:-1])}</p>{self.to_dataset()._repr_html_()}"

    def _of(self, rows: Mapping[str, Any]) -> dict[str, Any]:
        return {name: getattr(self, name)[rows[axes[0]]] for name, (_, axes, _) in _COLUMNS.items()}

    def to_dataset(self) -> xr.Dataset:
        """Labelled arrays over `target` and over `solution`, whose `target_of` names its target."""
        import xarray as xr

        units = activation_attributes(self.arm, self.bundles)
        variables = {
            name: (axes, getattr(self, field), units if "bundle" in axes else about)
            for field, (name, axes, about) in _COLUMNS.items()
            if self.marker_names or "marker" not in axes
        }
        variables["target_of"] = ("solution",), np.repeat(np.arange(len(self)), self.counts), {}
        coordinates = {"axis": list(AXES), **bundle_coordinates(self.arm, self.bundles)}
        coordinates |= {"marker": list(self.marker_names)} if self.marker_names else {}
        return xr.Dataset(variables, coordinates, provenance(self.arm, self.frame))


_MEANINGS = " ".join(f"{status.value}={status.name.lower()}" for status in Status)
_COLUMNS: dict[str, tuple[str, tuple[str, ...], dict[str, str]]] = {
    "targets": ("position", ("target", "axis"), {"units": "m"}),
    "statuses": ("status", ("target",), {"units": "1", "meanings": _MEANINGS}),
    "activations": ("activation", ("solution", "bundle"), {}),
    "residuals": ("residual", ("solution",), {"units": "m"}),
    "direction_errors": ("direction_error", ("solution",), {"units": "rad"}),
    "marker_errors": ("marker_error", ("solution", "marker"), {"units": "m"}),
    "conditions": ("condition", ("solution",), {"units": "1"}),
    "margins": ("margin", ("solution",), {"units": "1"}),
    "leans": ("leans", ("solution",), {}),
    "sheets": ("sheet", ("solution",), {"long_name": "0 for postures straight from rest"}),
    "nearest": ("nearest", ("target", "axis"), {"units": "m"}),
    "nearest_activations": ("nearest_activation", ("target", "bundle"), {}),
    "gaps": ("gap", ("target",), {"units": "m"}),
    "direction_gaps": ("direction_gap", ("target",), {"units": "rad"}),
    "marker_gaps": ("marker_gap", ("target", "marker"), {"units": "m"}),
    "gap_bounds": ("gap_bound", ("target",), {"units": "m"}),
}
"""Fields of `Solutions` in the order of those of `Solution`, as they are stored."""
