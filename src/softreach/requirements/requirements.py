"""Requirements of an arm: what it is for, as a frozen value and as TOML with units."""

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
from softreach.geometry.region_tables import EXAMPLES, SHAPES, RegionReader, lines_of, region_line
from softreach.geometry.regions import Region, Sphere
from softreach.inverse.request import positions_in
from softreach.requirements.parts import LIMIT_UNITS, MOST_PLACES, Goals, Keep, Limits, Target
from softreach.support.arguments import POSITIVE, as_given, as_instance, as_number, as_path, as_text
from softreach.support.arrays import Array, as_floats, joined
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, Range
from softreach.support.files import toml
from softreach.support.files.columns import MOST
from softreach.support.files.text import MEGABYTE, read_bytes, read_text, write_text

LONGEST = 64 * MEGABYTE  # Bytes that a file of requirements may have

_KEYS = ("version", "reach", "stay_inside", "avoid", "limits", "measures", "search")
"""At the top, beside payloads; `search` is read by the search of designs."""
_BALL = {"region": Sphere((0.0, 0.0, 0.0), 1.0)}
_INSTEAD = {Target: _BALL, Keep: _BALL, Limits: {}}
"""In place of faulty parts, so that the others can be judged."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Requirements:
    """Purpose of an arm; `check` says how far a design meets it.

    Raises:
        InvalidInput: A part of another kind.
        InvalidDesign: Parts that contradict each other; each is named.
    """

    targets: Sequence[Target] = ()
    """Places to reach."""
    keeps: Sequence[Keep] = ()
    """Regions to stay in or to avoid."""
    limits: Limits = field(default_factory=Limits)
    """Upper limits."""
    payloads: Sequence[float] = ()
    """Masses at the tip under each of which every target must be reached [kg]; none for the loads
    of the design as they are."""
    measures: Mapping[str, tuple[float | None, float | None]] = field(default_factory=dict)
    """Metric of an atlas, such as "exact_volume" -> least and largest value that it may have [unit
    of the metric]; None for no limit."""

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
        return self.goals.places

    @property
    def within(self) -> Array:
        """Distance to which each of these must be reached [m], shape (n,)."""
        return self.goals.within

    @property
    def goals(self) -> Goals:
        """These places with what is asked for there."""
        return joined([Goals.of(np.empty((0, 3)), 0.0), *(each.goals for each in self.targets)])

    @property
    def regions(self) -> tuple[tuple[Target, Region], ...]:
        """Targets that are regions to cover, with these."""
        return tuple((each, each.region) for each in self.targets if each.region is not None)

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
        folder: str | PathLike[str] | None = ".",
        length: float | None = None,
        source: str = "",
    ) -> Self:
        """The requirements of a TOML text.

        Args:
            text: The text.
            folder: Folder that the paths in it start from; None for a text that may name no file.
            length: As for `load`.
            source: What errors call it.

        Raises:
            InvalidDesign: As for `load`.
        """
        text = as_text("text", text)
        place = None if folder is None else Path(as_path("folder", folder))
        size = None if length is None else as_number("length", length, POSITIVE)
        reader = _Reader(place, size)
        document = toml.document_of(text, LONGEST, as_text("source", source))
        if "actuators" in document:
            wrong = "this is a design; give a file of requirements"
            raise InvalidDesign([Fault("actuators", None, wrong)], source)
        parts = reader.parts(document)
        if reader.faults:
            raise InvalidDesign(reader.faults, source)
        try:
            return cls(**parts)
        except InvalidInput as error:
            faults = [Fault(error.name, error.value, f"must be {error.allowed}")]
        except InvalidDesign as error:
            faults = error.faults
        raise InvalidDesign(faults, source)

    def to_toml(self) -> str:
        """The text of a file in m and kg, from which `from_toml` makes the same."""
        head = lines_of({"version": 1, "payloads_kg": self.payloads or None})
        blocks = [["# softreach requirements", *head]]
        for target in self.targets:
            lines = ["[[reach]]", *lines_of({"name": target.name})]
            if target.places is not None:
                rows = (f"  {toml.value_text(row)}," for row in target.points.tolist())
                lines += ["places_m = [", *rows, "]"]
            elif target.region is not None:
                lines += [region_line(target.region), *lines_of({"share": target.share})]
            way = None if target.direction is None else np.asarray(target.direction).tolist()
            words = {"within_m": target.within, "direction": way, "cone_rad": target.cone}
            blocks.append(lines + lines_of({key: word or None for key, word in words.items()}))
        for keep in sorted(self.keeps, key=lambda keep: not keep.inside):
            words = {"of": keep.of, "when": keep.when, "clearance_m": keep.clearance or None}
            start = [f"[[{keep.kind}]]", *lines_of({"name": keep.name})]
            blocks.append([*start, region_line(keep.region), *lines_of(words)])
        if limits := self.limits.given:
            keys = (f"{name}_{LIMIT_UNITS[name].lower()}".rstrip("_") for name in limits)
            blocks.append(["[limits]", *lines_of(dict(zip(keys, limits.values(), strict=True)))])
        blocks += [["[measures]"]] if self.measures else []
        for name, ends in self.measures.items():
            pairs = zip(("at_least", "at_most"), ends, strict=True)
            known = ((key, toml.value_text(end)) for key, end in pairs if end is not None)
            blocks[-1].append(f"{toml.key_text(name)} = {toml.inline_table(known)}")
        return "\n\n".join("\n".join(block) for block in blocks) + "\n"

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
        payloads = ", ".join(f"{x:g}" for x in self.payloads) or "none"
        return (
            f"Requirements: {len(self.targets)} targets with {len(self.places):,} places; "
            f"{len(self.keeps)} regions to keep to; {len(self.limits.given)} limits; "
            f"payloads {payloads} kg; {len(self.measures)} measures"
        )


def with_payload(arm: Manipulator, payload: float | None) -> Manipulator:
    """The arm with a mass at its tip [kg]; as it is for None, and for 0 without loads."""
    if payload is None or (payload == 0.0 and arm.loads is None):
        return arm
    return arm.replace(loads=(arm.loads or Loads()).replace(payload=payload))


def _named(parts: Sequence[Any]) -> Iterator[Any]:
    """The parts, those without a name called "target 1" or "avoid 2" by their places."""
    names = [part.name for part in parts if part.name]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("name", repr(twice[0]), "the name of only one target or region")
    for number, part in enumerate(parts, 1):
        kind = "target" if isinstance(part, Target) else part.kind.replace("_", " ")
        yield part if part.name else dataclasses.replace(part, name=f"{kind} {number}")


def _limits_of(name: str, ends: Any) -> tuple[float | None, float | None]:
    metric = known_metric(name) if isinstance(name, str) else None
    if metric is None or metric.over:
        known = [m.name for group in METRIC_GROUPS.values() for m in group if not m.over]
        raise InvalidInput("measures", as_given(name), f"one of {', '.join(known)}")
    said = f"measures[{name!r}]"
    if not isinstance(ends, Sequence) or isinstance(ends, str) or len(ends) != 2:
        raise InvalidInput(said, as_given(ends), "a pair (least, largest)")
    low, high = (None if x is None else as_number(said, x) for x in ends)
    if low is not None and high is not None and low > high:
        raise InvalidInput(said, f"({low:g}, {high:g})", "a pair with least <= largest")
    return low, high


def _contradictions(needs: Requirements) -> Iterator[Fault]:
    """Places that a tip may not be at, and regions to cover that it may not enter."""
    for keep in needs.keeps:
        where = "outside" if keep.inside else "inside"
        for target in needs.targets:
            region = target.region
            points = np.asarray(target.points if region is None else region.places(256))
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


class _Reader(RegionReader):
    lists = RegionReader.lists | {"payloads", "places", "direction"}

    def _made(self, kind: Any, raw: dict[str, Any], path: str, values: dict[str, Any]) -> Any:
        """As for any part; of a faulty target or region what is left is judged too."""
        wrong = {name for name, value in values.items() if value is toml.WRONG}
        if not wrong or kind not in _INSTEAD:
            return super()._made(kind, raw, path, values)
        if wrong & {"region", "places", "direction"}:  # nothing can be said of directions then
            wrong |= {"direction", "cone"}
        right = {name: value for name, value in values.items() if name not in wrong}
        if wrong & {"region", "places"}:
            right = _INSTEAD[kind] | right
        super()._made(kind, raw, path, right)
        return toml.WRONG

    def parts(self, document: dict[str, Any]) -> dict[str, Any]:
        """Fields of the requirements; of no use where there are faults."""
        payloads = self._numbers(document, "", {"payloads": "kg"}, _KEYS)
        raw = self._table(document, "limits")
        if document.get("version", 1) != 1:
            self._refuse("version", document["version"], "must be 1")
        return payloads | {
            "targets": [self._target(*each) for each in self._tables(document, "reach")],
            "keeps": [
                self._keep(*each, kind == "stay_inside")
                for kind in ("stay_inside", "avoid")
                for each in self._tables(document, kind)
            ],
            "limits": self._made(Limits, raw, "limits", self._numbers(raw, "limits", LIMIT_UNITS)),
            "measures": self._measures(self._table(document, "measures")),
        }

    def _target(self, raw: dict[str, Any], path: str) -> Any:
        numbers = {"within": "m", "share": "", "places": "m", "direction": "", "cone": "rad"}
        values = self._part(raw, path, numbers, ("name", "file"))
        file = values.pop("file", None)
        count = sum(x is not None for x in (values.get("places"), file, values.get("region")))
        if count != 1:
            allowed = f"needs one of places, file, {', '.join(SHAPES)}, and has {count}"
            return self._refuse(path, None, allowed)
        if file is not None:
            try:
                place = self._beside(as_text("file", file), "places_m")
                places = positions_in(read_bytes("file", place, MOST), file, self.length)
                values["places"] = np.array(places)
            except InvalidInput as error:
                allowed = f"must be {error.allowed} ({error.name} = {error.value})"
                values["places"] = self._refuse(f"{path}.file", file, allowed)
        return self._made(Target, raw, path, values)

    def _keep(self, raw: dict[str, Any], path: str, inside: bool) -> Any:
        values = self._part(raw, path, {"clearance": "m"}, ("name", "of", "when"))
        if "region" not in values:
            return self._refuse(path, None, f"needs one of {', '.join(SHAPES)}")
        return self._made(Keep, raw, path, values | {"inside": inside})

    def _part(
        self, raw: dict[str, Any], path: str, numbers: Mapping[str, str], words: tuple[str, ...]
    ) -> dict[str, Any]:
        """Values of a table by field: numbers, words, and the region that it has."""
        values = self._numbers(raw, path, numbers, (*words, *SHAPES, "mesh_unit"))
        values |= {name: raw[name] for name in words if name in raw}
        shapes = [name for name in SHAPES if name in raw]
        if len(shapes) > 1:
            values["region"] = self._refuse(path, None, f"has {' and '.join(shapes)}: give one")
        elif shapes:
            values["region"] = self.region(raw, shapes[0], f"{path}.{shapes[0]}")
        if "mesh_unit" in raw and "mesh" not in raw:
            self._refuse(f"{path}.mesh_unit", raw["mesh_unit"], "needs a mesh")
        return values

    def _measures(self, raw: dict[str, Any]) -> dict[str, Any]:
        measures = {}
        for name, table in raw.items():
            path = f"measures.{toml.key_text(name)}"
            metric = known_metric(name)
            if metric is None or metric.over:
                self._refuse(path, None, "is no metric: softreach list metrics names them")
            elif not isinstance(table, dict):
                self._refuse(path, table, "must be a table with at_least, at_most or both")
            else:
                unit = metric.unit if metric.unit in EXAMPLES else ""
                ends: dict[str, str] = dict.fromkeys(("at_least", "at_most"), unit)
                values = self._numbers(table, path, ends, plain=True)
                measures[name] = tuple(map(values.get, ends))
        return measures
