"""Requirements of an arm: what it is for, as a frozen value and a file."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from softreach.arm.loads import Loads
from softreach.arm.manipulator import Manipulator
from softreach.atlas.metrics import METRIC_GROUPS, known_metric
from softreach.requirements.parts import LONGEST, MOST_PLACES, Keep, Limits, Target
from softreach.requirements.requirements_file import read, written
from softreach.support.arguments import (
    POSITIVE,
    as_given,
    as_instance,
    as_number,
    as_path,
    as_text,
)
from softreach.support.arrays import Array, as_floats
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, Range
from softreach.support.files.text import read_text, write_text


@dataclass(frozen=True, eq=False, kw_only=True)
class Requirements:
    """Purpose of an arm; `check` says how far a design meets it.

    Raises:
        InvalidInput: A part of another kind.
        InvalidDesign: Parts that contradict each other; each is named.
    """

    targets: tuple[Target, ...] = ()
    """Places to reach."""
    keeps: tuple[Keep, ...] = ()
    """Regions to stay in or to avoid."""
    limits: Limits = field(default_factory=Limits)
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

    @property
    def within(self) -> Array:
        """Distance to which each of these must be reached [m], shape (n,)."""
        each = [np.full(len(t.places), t.within) for t in self.targets if t.places is not None]
        return np.concatenate([np.empty(0), *each])

    def under_payloads(self, arm: Manipulator) -> list[Manipulator]:
        """An arm under each payload, or as it is where there are none."""
        return [with_payload(arm, payload) for payload in self.payloads or (None,)]

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return dataclasses.replace(self, **changes)

    @classmethod
    def load(cls, path: str | PathLike[str], *, length: float | None = None) -> Self:
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
    ) -> Self:
        """The requirements of a TOML text.

        Args:
            text: The text.
            folder: Folder that the paths in it start from.
            length: As for `load`.
            source: What errors call it.

        Raises:
            InvalidDesign: As for `load`.
        """
        text, folder = as_text("text", text), as_path("folder", folder)
        size = None if length is None else as_number("length", length, POSITIVE)
        source = as_text("source", source)
        parts = read(text, Path(folder), size, source)
        try:
            return cls(**parts)
        except InvalidInput as error:
            fault = Fault(error.name, error.value, f"must be {error.allowed}")
            raise InvalidDesign([fault], source) from None
        except InvalidDesign as error:
            raise InvalidDesign(error.faults, source) from None

    def to_toml(self) -> str:
        """The text of a file, from which `from_toml` makes the same."""
        return written(**vars(self))

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write a TOML file.

        Args:
            path: The file.
            overwrite: Whether it may replace a file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: It cannot be written.
        """
        write_text(path, self.to_toml(), overwrite=overwrite)

    def __repr__(self) -> str:
        parts = [
            f"{len(self.targets)} targets with {len(self.places):,} places",
            f"{len(self.keeps)} regions to keep to",
            f"{len(self.limits.given)} limits",
            f"payloads {', '.join(f'{x:g}' for x in self.payloads) or 'none'} kg",
            f"{len(self.measures)} measures",
        ]
        return f"Requirements: {'; '.join(parts)}"


def with_payload(arm: Manipulator, payload: float | None) -> Manipulator:
    """The arm with a mass at its tip [kg]; as it is for None, and for 0 without loads.

    Raises:
        InvalidDesign: A layer without Young's modulus or density.
    """
    if payload is None or (payload == 0.0 and arm.loads is None):
        return arm
    return arm.replace(loads=(arm.loads or Loads()).replace(payload=payload))


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
        kind = "target" if isinstance(part, Target) else part.kind.replace("_", " ")
        yield part if part.name else dataclasses.replace(part, name=f"{kind} {number}")


def _limits_of(name: str, ends: Any) -> tuple[float | None, float | None]:
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
