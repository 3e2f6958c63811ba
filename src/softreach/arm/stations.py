"""Stations of an arm by name, and parts that begin, end or stand there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, TypeVar

from softreach.arm.number import NamedFloats, Number, Station, fields_of, is_path_name, number
from softreach.arm.part import Part, Triple
from softreach.support.arguments import plain
from softreach.support.errors import Fault, InvalidDesign, Range, did_you_mean

if TYPE_CHECKING:
    from softreach.arm.profile import Profile
    from softreach.arm.section import Section

PLACE = Number(symbol="Z", meaning="place along the arm", allowed=Range(0.0, unit="m"))
"""Declaration of the place of a named station."""

_SHORTEST = 1e-9  # of L, of a part between two places: below it, places round to one another


class Stations(NamedFloats):
    """Z [m] of stations by name; frozen."""

    def __init__(self, places: Any = ()) -> None:
        try:
            pairs = {name: plain(z) for name, z in dict(places).items()}
        except (TypeError, ValueError):
            allowed = "must be a mapping from names to Z in m"
            raise InvalidDesign([Fault("", places, allowed)]) from None
        faults: list[Fault] = []
        for name, z in pairs.items():
            if not isinstance(name, str) or not name or not is_path_name(name):
                allowed = "must be named by one line without dots and brackets"
                faults.append(Fault(str(name), z, allowed))
            elif not PLACE.allowed.admits(z):
                faults.append(Fault(name, z, PLACE.allowed))
        if faults:
            raise InvalidDesign(faults)
        super().__init__(pairs)

    @property
    def numbers(self) -> dict[str, Number]:
        """Places by name: what begins, ends or stands there moves with it."""
        return dict.fromkeys(self, PLACE)

    def values_of(self, name: str, profile: Profile, section: Section) -> tuple[float, ...]:
        """The place of that name [m], as `Part.values_of` gives numbers."""
        return (self[name],)

    def replace(self, **places: float) -> Stations:
        """Those with some in other places."""
        return Stations({**self, **places})

    def __repr__(self) -> str:
        return f"Stations({super().__repr__()})"


class Located(Part):
    """A part at places along the arm, each given over L, in m, or by the name of a station."""

    @property
    def places(self) -> tuple[str, ...]:
        """Fields that are places in m or by name, beside each of which one is over L."""
        return _places(type(self))

    def station_at(self, field: str, length: float) -> float:
        """Z [m] of a place on an arm of a length [m].

        Raises:
            InvalidDesign: The name of a station, while it is part of no arm.
        """
        place = getattr(self, field)
        if isinstance(place, str):
            allowed = "must be Z in m: names of stations are known in an arm alone"
            raise InvalidDesign([Fault(field, place, allowed)])
        ratio = getattr(self, f"{field}_over_length")
        return length * ratio if place is None else float(place)

    def place_faults(self, length: float) -> list[Fault]:
        """Faults of places that an arm of a length [m] does not have."""
        allowed = f"must be on the arm, at most {length:g} m"
        return [
            Fault(field, self.station_at(field, length), allowed)
            for field in self.places
            # over L it is, and of a named station the arm refuses that
            if not isinstance(getattr(self, field), Station | None)
            and self.station_at(field, length) > length
        ]


@cache
def _places(kind: type) -> tuple[str, ...]:
    return tuple(field for field, declared in fields_of(kind).items() if declared.named)


@dataclass(frozen=True, kw_only=True)
class Span(Located):
    """A part between two places along the arm."""

    start_over_length: float = number("Z0/L", "", "its start", low=0.0, below=1.0, default=0.0)
    """Z0/L, where along the arm it begins [-]."""
    end_over_length: float = number("Z1/L", "", "its end", above=0.0, high=1.0, default=1.0)
    """Z1/L, where it ends [-]."""
    start: float | str | None = number(
        "Z0", "m", "its start", instead_of="start_over_length", default=None, low=0.0, named=True
    )
    """Z0 [m], or the name of a station of the arm, in place of `start_over_length`."""
    end: float | str | None = number(
        "Z1", "m", "its end", instead_of="end_over_length", default=None, above=0.0, named=True
    )
    """Z1 [m], or the name of a station of the arm, in place of `end_over_length`."""

    def span(self, length: float) -> tuple[float, float]:
        """Stations [m] between which it is on an arm of a length [m]."""
        if self.start is None and self.end is None:
            return length * self.start_over_length, length * self.end_over_length
        return self.station_at("start", length), self.station_at("end", length)

    def span_over_length(self, length: float) -> tuple[float, float]:
        """The same over L [-]."""
        start, end = (z / length for z in self.span(length))
        start = self.start_over_length if self.start is None else start
        return start, self.end_over_length if self.end is None else end

    def place_faults(self, length: float) -> list[Fault]:
        faults = super().place_faults(length)
        start, end = self.span(length)
        if faults or end - start >= _SHORTEST * length:
            return faults
        if self.end is None:
            return [Fault("start", start, f"must be below its end at Z = {end:g} m")]
        return [Fault("end", end, f"must be above its start at Z = {start:g} m")]

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        start, end = self.start_over_length, self.end_over_length
        in_meters = self.start is not None or self.end is not None
        blamed = any(fault.path.endswith("_over_length") for fault in faults)
        if in_meters or blamed or end - start >= _SHORTEST:
            return faults
        allowed = f"must be above start_over_length = {start:g}"
        return [*faults, Fault("end_over_length", end, allowed)]


@dataclass(frozen=True, kw_only=True)
class RigidPiece(Span):
    """A stretch of the arm that neither actuators nor loads deform: a disk, a joint, a hard tip.

    Actuators pass through it and act on what is beyond; its mass is that of the arm there.

    Raises:
        InvalidDesign: A place off the arm, given twice, or an end that is not beyond the start.
    """


@dataclass(frozen=True, kw_only=True)
class Marker(Located):
    """A point at r(Z) + x d1 + y d2 + z d3 of one section; it changes nothing about the arm.

    One beyond the tip, at an offset along d3, is the point of a tool that the tip holds.

    Raises:
        InvalidDesign: No name, or a station off the arm, given twice, or of no such name.
    """

    name: str
    """Name in files and results; unique within an arm."""
    station_over_length: float = number(
        "Z/L", "", "where its section is", low=0.0, high=1.0, default=1.0
    )
    """Z/L of its section [-]."""
    station: float | str | None = number(
        "Z", "m", "its section", instead_of="station_over_length", default=None, low=0.0, named=True
    )
    """Z [m], or the name of a station of the arm, in place of `station_over_length`."""
    offset: Triple = number(
        "a", "m", "from the center of its section", default=(0.0, 0.0, 0.0), shape="triple"
    )
    """(x, y, z) from the center of its section, in the directors [m]."""

    def _faults(self) -> list[Fault]:
        unnamed = [] if self.name else [Fault("name", self.name, "must be given")]
        return super()._faults() + unnamed


Made = TypeVar("Made", bound=Located)


def placed(part: Made, stations: Mapping[str, float]) -> Made:
    """The part where the stations that it names are; raises InvalidDesign for unknown ones."""
    names = {
        field: place.name if isinstance(place, Station) else place
        for field in part.places
        if isinstance(place := getattr(part, field), str | Station)
    }
    if not names:
        return part
    unknown = {field: name for field, name in names.items() if name not in stations}
    if unknown:
        faults = (Fault(field, name, _allowed(name, stations)) for field, name in unknown.items())
        raise InvalidDesign([*faults])
    return part.replace(**{at: Station(name, stations[name]) for at, name in names.items()})


def _allowed(name: str, stations: Mapping[str, float]) -> str:
    if not stations:
        return "must be Z in m: the arm has no stations by name"
    hint = did_you_mean(name, stations)
    known = f"must be Z in m or a station of the arm: {', '.join(stations)}"
    return f"{known}; {hint}" if hint else known
