"""Requirements of an arm as frozen values: places to reach, room to keep, limits, measures."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal, Self

import numpy as np

from softreach.atlas.metrics import METRIC_GROUPS, known_metric
from softreach.requirements.regions import Region
from softreach.support.arguments import (
    POSITIVE,
    as_flag,
    as_given,
    as_instance,
    as_integer,
    as_number,
    as_one_of,
    as_path,
    as_text,
)
from softreach.support.arrays import Array, as_floats, as_points, read_only
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, Range
from softreach.support.files.atomic import writing
from softreach.support.files.kinds import FileKind, Formats, text_with
from softreach.support.files.text import MEGABYTE, read_text

__all__ = ["Keep", "Limits", "Requirements", "Target"]

MOST_PLACES = 1_000_000
"""Places that all targets may have together."""
LONGEST = 64 * MEGABYTE
"""Bytes that a file of requirements may have."""

_NOT_NEGATIVE = Range(0.0)
_LENGTH = Range(0.0, unit="m")
_SHARE = Range(0.0, 1.0, open_low=True)
_REGION = "a region: Box, Sphere, HalfSpace or Mesh"

REQUIREMENTS_FILE: Formats = {
    ".toml": FileKind("a file of requirements", text_with("softreach requirements"))
}
"""Kind of file that requirements are saved as, and replace."""


@dataclass(frozen=True, eq=False)
class Target:
    """Places that the tip must reach, or a region of which it must reach a share.

    Raises:
        InvalidInput: Neither places nor a region, both, or numbers out of range.
    """

    places: Array | None = None
    """A place, the places of a path, or a cloud of places [m], shape (n, 3)."""
    _: dataclasses.KW_ONLY
    region: Region | None = None
    """A region to be covered instead."""
    share: float = 1.0
    """Share of the region that must be reached [-]."""
    within: float = 0.0
    """Distance to which the tip must come to a place [m]; 0 for the error of the tips."""
    name: str = ""
    """What it is called in results."""

    def __post_init__(self) -> None:
        if (self.places is None) == (self.region is None):
            raise InvalidInput("places", as_given(self.places), "given, or a region, and not both")
        if self.places is not None:
            places = as_points("places", self.places)
            if not 0 < len(places) <= MOST_PLACES:
                raise InvalidInput("places", f"{len(places):,}", f"from 1 to {MOST_PLACES:,}")
            object.__setattr__(self, "places", read_only(places.copy()))
        else:
            region = as_instance("region", self.region, Region, _REGION)
            if not np.isfinite(region.volume):
                raise InvalidInput("region", region, "bounded: a half-space has no end")
        object.__setattr__(self, "share", as_number("share", self.share, _SHARE))
        if self.region is None and self.share != 1.0:
            raise InvalidInput("share", self.share, "left out where there is no region")
        object.__setattr__(self, "within", as_number("within", self.within, _LENGTH))
        as_text("name", self.name)


@dataclass(frozen=True, eq=False)
class Keep:
    """A region that the arm must stay in, or must avoid.

    Raises:
        InvalidInput: No region, or a value that is not one of those listed.
    """

    region: Region
    """The region."""
    inside: bool
    """True to stay inside, False to avoid it."""
    _: dataclasses.KW_ONLY
    of: Literal["tip", "arm"] = "arm"
    """The tip alone, or the body from base to tip with its radius before activation."""
    when: Literal["targets", "always"] = "targets"
    """In the poses that are used at the targets, or in every pose within the bounds, among which
    the worst is searched for: samples and a polish, no proof."""
    clearance: float = 0.0
    """Distance to keep from the boundary [m]."""
    name: str = ""
    """What it is called in results."""

    def __post_init__(self) -> None:
        as_instance("region", self.region, Region, _REGION)
        as_flag("inside", self.inside)
        as_one_of("of", self.of, ("tip", "arm"))
        as_one_of("when", self.when, ("targets", "always"))
        object.__setattr__(self, "clearance", as_number("clearance", self.clearance, _LENGTH))
        as_text("name", self.name)

    @property
    def kind(self) -> str:
        """Table of a file that it stands in: "stay_inside" or "avoid"."""
        return "stay_inside" if self.inside else "avoid"

    def missed(self, points: Array) -> Array:
        """How far points (n, 3) are from where they may be [m], negative where they are well."""
        distance = self.region.distance(points)
        return (distance if self.inside else -distance) + self.clearance


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Upper limits of an arm; None for no limit.

    Those of poses (shortening, force, pressure, stroke, bending) are judged in the poses that are
    used at the targets; where there are no targets, over all of the bounds. The others follow from
    the design alone.

    Raises:
        InvalidInput: A number out of range.
    """

    actuators: int | None = None
    """Number of inputs that can move."""
    shortening: float | None = None
    """Share of its length before activation by which the line of a bundle shortens [-]; without
    targets at all corners of the bounds."""
    force: float | None = None
    """Pull or push of a bundle that is driven by force, and tension of a tendon driven by length
    [N]."""
    pressure: float | None = None
    """Pressure of a chamber, above or below that around it [Pa]."""
    stroke: float | None = None
    """Displacement of a tendon that is driven by length [m]."""
    mass: float | None = None
    """Mass of the arm [kg]."""
    load_number: float | None = None
    """Λ, theory (79), under the largest payload [-]."""
    bending: float | None = None
    """κ R2 anywhere along the arm [-]; its inner side folds at 1."""

    def __post_init__(self) -> None:
        for name, value in self.given.items():
            if name == "actuators":
                as_integer(name, value, 0)
                continue
            allowed = Range(0.0, 1.0) if name == "shortening" else _NOT_NEGATIVE
            object.__setattr__(self, name, as_number(name, value, allowed))

    @property
    def given(self) -> dict[str, float]:
        """Those that there are, by name."""
        return {name: value for name, value in vars(self).items() if value is not None}


POSE_LIMITS = ("shortening", "force", "pressure", "stroke", "bending")
"""Limits of poses."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Requirements:
    """What an arm is for; `check` says how far a design meets it.

    Raises:
        InvalidInput: A part of another kind.
        InvalidDesign: Parts that contradict each other; each is named.
    """

    targets: tuple[Target, ...] = ()
    """Places to reach."""
    keeps: tuple[Keep, ...] = ()
    """Regions to stay in or to avoid."""
    limits: Limits = Limits()
    """Upper limits."""
    payloads: tuple[float, ...] = ()
    """Masses at the tip under each of which every target must be reached [kg]; none for the loads
    of the design as they are."""
    measures: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    """Metric of an atlas, such as "exact_volume" -> least and largest value that it may have, in
    its unit; None for no limit."""

    def __post_init__(self) -> None:
        for name, kind, what in (("targets", Target, "Targets"), ("keeps", Keep, "Keeps")):
            parts = getattr(self, name)
            if not isinstance(parts, Sequence) or not all(isinstance(x, kind) for x in parts):
                raise InvalidInput(name, as_given(parts), f"a sequence of {what}")
            object.__setattr__(self, name, tuple(_named(parts)))
        as_instance("limits", self.limits, Limits, "Limits")
        payloads = as_floats("payloads", self.payloads).ravel()
        masses = (as_number("payloads", x, Range(0.0, unit="kg")) for x in payloads.tolist())
        object.__setattr__(self, "payloads", tuple(sorted(set(masses))))
        as_instance("measures", self.measures, Mapping, "a dictionary")
        measures = {name: _limits_of(name, ends) for name, ends in self.measures.items()}
        object.__setattr__(self, "measures", MappingProxyType(measures))
        if (count := len(self.places)) > MOST_PLACES:
            raise InvalidInput("targets", f"{count:,} places", f"at most {MOST_PLACES:,} in all")
        if faults := list(_contradictions(self)):
            raise InvalidDesign(faults)

    @property
    def places(self) -> Array:
        """Places of all targets that have some, one after the other [m], shape (n, 3)."""
        each = [target.places for target in self.targets if target.places is not None]
        return np.concatenate([np.empty((0, 3)), *each])

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return dataclasses.replace(self, **changes)

    @classmethod
    def load(cls, path: str | PathLike[str], *, length: float | None = None) -> Requirements:
        """The requirements of a TOML file.

        Args:
            path: The file; tables of places and meshes that it names lie beside it.
            length: Length of the arm [m], for lengths such as "0.05L"; None refuses these.

        Raises:
            InvalidDesign: The file's faults, all of them, in its own names and units.
            InvalidInput: No file that can be read, or no text in UTF-8.
        """
        name = as_path("path", path)
        text = read_text("requirements", name, LONGEST)
        return cls.from_toml(text, folder=Path(name).parent, length=length, source=name)

    @classmethod
    def from_toml(
        cls,
        text: str,
        *,
        folder: str | PathLike[str] = ".",
        length: float | None = None,
        source: str = "",
    ) -> Requirements:
        """The requirements of a TOML text.

        Args:
            text: The text.
            folder: Folder that the paths in it start from.
            length: As for `load`.
            source: What errors call it.

        Raises:
            InvalidDesign: As for `load`.
        """
        from softreach.requirements.requirements_file import read

        text, folder = as_text("text", text), as_path("folder", folder)
        size = None if length is None else as_number("length", length, POSITIVE)
        return read(text, Path(folder), size, as_text("source", source))

    def to_toml(self) -> str:
        """The text of a file, from which `from_toml` makes the same."""
        from softreach.requirements.requirements_file import written

        return written(self)

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a TOML file; an older one of requirements is replaced.

        Args:
            path: The file.
            overwrite: Replace any file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
        """
        path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
        text = self.to_toml()
        with writing(path, REQUIREMENTS_FILE[".toml"], overwrite=overwrite) as stream:
            stream.write(text.encode())

    def __repr__(self) -> str:
        parts = [
            f"{len(self.targets)} targets with {len(self.places):,} places",
            f"{len(self.keeps)} regions to keep to",
            f"{len(self.limits.given)} limits",
            f"payloads {', '.join(f'{x:g}' for x in self.payloads) or 'none'} kg",
            f"{len(self.measures)} measures",
        ]
        return f"Requirements: {'; '.join(parts)}"


def _named(parts: Sequence[Any]) -> Iterator[Any]:
    """The parts, those without a name called "target 1" or "avoid 2" by their places.

    Raises:
        InvalidInput: Two of one name.
    """
    names = [part.name for part in parts if part.name]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInput("name", repr(name), "of one target, or of one region, only")
    for number, part in enumerate(parts, 1):
        if not part.name:
            kind = "target" if isinstance(part, Target) else part.kind.replace("_", " ")
            part = _renamed(part, f"{kind} {number}")
        yield part


def _renamed(part: Any, name: str) -> Any:
    copy = object.__new__(type(part))
    for key, value in {**vars(part), "name": name}.items():
        object.__setattr__(copy, key, value)
    return copy


def _limits_of(name: str, ends: Any) -> tuple[float | None, float | None]:
    """Least and largest value of a measure."""
    metric = known_metric(name) if isinstance(name, str) else None
    if metric is None or metric.over:
        known = [m.name for group in METRIC_GROUPS.values() for m in group if not m.over]
        raise InvalidInput("measures", as_given(name), f"one of {', '.join(known)}")
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
        raise InvalidInput(f"measures[{name!r}]", as_given(ends), "a pair (least, largest)")
    low, high = (None if x is None else as_number(f"measures[{name!r}]", x) for x in ends)
    if low is not None and high is not None and low > high:
        allowed = "a pair with least <= largest"
        raise InvalidInput(f"measures[{name!r}]", f"({low:g}, {high:g})", allowed)
    return low, high


def _contradictions(needs: Requirements) -> Iterator[Fault]:
    """Places that a tip may not be at, and regions to cover that it may not enter."""
    for keep in needs.keeps:
        where = "outside" if keep.inside else "inside"
        for target in needs.targets:
            region = target.region
            points = np.asarray(target.places if region is None else region.places(256))
            missed = keep.missed(points) - target.within
            wrong = np.flatnonzero(missed > 1e-12 * (1.0 + np.abs(points).max()))
            if region is not None:
                if len(wrong) > (1.0 - target.share) * len(missed):
                    part = f"{100 * len(wrong) / len(missed):.0f} % of it {where} {keep.name}"
                    allowed = f"has {part}, so that a share of {target.share:g} cannot be reached"
                    yield Fault(target.name, None, allowed)
            elif len(wrong):
                place = tuple(points[wrong[0]].tolist())
                more = f", and {len(wrong) - 1:,} more places of it" if len(wrong) > 1 else ""
                beyond = f"by {missed[wrong[0]]:.4g} m, clearance counted"
                allowed = f"lies {where} {keep.name} {beyond}{more}: {keep.kind} forbids it"
                yield Fault(f"{target.name}, place {wrong[0] + 1}", place, allowed)
