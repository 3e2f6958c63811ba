"""Numbers of a design, each declared once: symbol, unit, meaning, range; see DESIGN.md.

In kinds outside softreach, fields of numbers without a declaration are numbers without a unit.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sized
from dataclasses import MISSING, dataclass
from functools import cache
from types import MappingProxyType
from typing import Any, Literal, Self

import numpy as np

from softreach.support.arguments import plain
from softreach.support.arrays import as_floats
from softreach.support.errors import Fault, InvalidInput, Range
from softreach.support.lazy import lazy

Shape = Literal["single", "along", "triple", "series", "stations", "several"]
"""One number, a function along the arm alone, a vector, several along the arm, their places, or
several that are none of these."""

_NEAREST = 1e-12  # Z/L by which stations differ at least: less is rounding
_NOTHING = 1e-30  # Size up to which a component of a vector is 0: its powers would be

_SENSE: Mapping[str, tuple[float, float]] = {
    "L": (1e-6, 1e3),
    "m": (1e-9, 1e3),
    "rad": (1e-6, 1e6),
    "1/m": (1e-6, 1e6),
    "kg": (1e-15, 1e9),
    "Pa": (1e-3, 1e15),
    "N/m": (1e-6, 1e12),
    "N m²": (1e-30, 1e15),
}
"""Symbol or unit -> smallest size above 0 and largest that a number of an arm has [unit]."""

MOST = 1e15  # The largest size of numbers of an arm in other units, and of activations

_PLAIN = re.compile(
    r"(?:typing\.Optional\[)?(float|int)(\|None|\])?|tuple\[float(,(float|\.\.\.))*\]"
)
"""Types of fields that are numbers without a declaration, blanks left out."""

_SUFFIXES = {
    "": "",
    "1": "",
    "rad": "_deg",
    "Pa": "_pa",
    "kg/m³": "_kg_m3",
    "N": "_n",
    "m/s²": "_m_s2",
    "N m": "_n_m",
    "N m²": "_n_m2",
    "N/m": "_n_per_m",
    "1/m": "_per_m",
    "kg/m": "_kg_per_m",
}


def unit_suffix(unit: str) -> str:
    """Suffix of names and keys whose values have a unit; angles are in degrees there."""
    return _SUFFIXES.get(unit, f"_{unit}")


class Station(float):
    """Z [m] of a named station, as a part of an arm has it that begins, ends or stands there."""

    name: str

    def __new__(cls, name: str, z: float) -> Self:
        station = super().__new__(cls, z)
        station.name = name
        return station

    def __getnewargs__(self) -> tuple[str, float]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return self.name, float(self)

    def __eq__(self, other: object) -> bool:
        """The name counts: the parts that have it follow when it moves."""
        return isinstance(other, Station) and (self.name, +self) == (other.name, +other)

    def __hash__(self) -> int:
        return hash((self.name, float(self)))


class NamedFloats(Mapping[str, float]):
    """Numbers by name; frozen."""

    def __init__(self, numbers: Mapping[str, float] = {}) -> None:
        self._numbers = {str(name): float(value) for name, value in numbers.items()}

    def __getitem__(self, name: str) -> float:
        return self._numbers[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._numbers)

    def __len__(self) -> int:
        return len(self._numbers)

    def __hash__(self) -> int:
        return hash(frozenset(self._numbers.items()))

    def __repr__(self) -> str:
        return repr(self._numbers)


@dataclass(frozen=True, kw_only=True)
class Number:
    """A number of a part of an arm."""

    field: str = ""
    """Name in the part."""
    symbol: str
    """Symbol in formulas."""
    meaning: str
    """Meaning in a few words."""
    allowed: Range
    """Unit, limits, and whether it is an integer."""
    shape: Shape = "single"
    """Whether it is one number, three, or several."""
    along: type | None = None
    """Class of functions along the arm that may take its place."""
    optional: bool = False
    """True if None is allowed."""
    named: bool = False
    """The name of a station of the arm may take its place."""
    pair: str = ""
    """Two values that may take its place, such as "two at its ends"; "" for none."""
    each: bool = False
    """One value for each bundle of an actuator may take its place."""
    instead_of: str = ""
    """Field that says the same in another way: one of the two is given."""
    hint: str = ""
    """Ends the sentence "give exactly one of ..."."""

    @property
    def unit(self) -> str:
        """SI unit; "" for none."""
        return self.allowed.unit

    @property
    def key(self) -> str:
        """Key in design files: the field with its unit."""
        return self.field + unit_suffix(self.unit)

    def refusal(self, value: object) -> Range | None:
        """The limits that a number is beyond: its own, or the sizes that no arm has; or None."""
        if not self.allowed.admits(value):
            return self.allowed
        return None if self._sense.admits(value) else self._sense

    @lazy
    def usual(self) -> tuple[float, float]:
        """Ends [unit] between which a float is neither refused nor changed, both included."""
        if self.shape != "single" or self.allowed.whole:
            return math.inf, -math.inf
        each = self.allowed, self._sense
        low = (math.nextafter(x.low, math.inf) if x.open_low else x.low for x in each)
        high = (math.nextafter(x.high, -math.inf) if x.open_high else x.high for x in each)
        return max(low), min(high)

    @lazy
    def _sense(self) -> Range:
        declared = self.allowed
        least, most = _SENSE.get(self.symbol) or _SENSE.get(self.unit, (1.0 / MOST, MOST))
        low = least if declared.low == 0.0 and declared.open_low else max(declared.low, -most)
        return declared._replace(low=low, high=min(declared.high, most), open_low=False)

    def faults(self, value: Any) -> list[Fault]:
        """Everything wrong with a value by itself, but for what `series_faults` judges."""
        if self.shape == "stations" or (value is None and self.optional) or self._is_name(value):
            return []
        if self.shape == "single" and isinstance(value, float):  # as nearly all are
            return self._faults_of_one(value)
        each = as_numbers(value)
        if self.shape == "triple" and not (each.shape == (3,) and np.isfinite(each).all()):
            return [Fault(self.field, value, "must be three finite numbers")]
        if self.shape == "several" and not _is_sequence(value):
            return [Fault(self.field, value, "must be a sequence of numbers")]
        if self.shape in ("series", "several", "triple"):
            judged = self.shape == "several"  # of a series the others are judged with its stations
            elements = enumerate(each.ravel().tolist() if each.ndim else ())
            return self._refused((f"[{k}]", x) for k, x in elements if judged or math.isfinite(x))
        if self.along is not None and isinstance(value, self.along):
            return self._refused(("", x) for x in value.values)  # pyright: ignore
        if self._is_pair(value):
            return self._refused(("", x) for x in each.tolist())
        if self._is_of_bundles(value):
            return self._refused((f"[{k}]", x) for k, x in enumerate(each.tolist()))
        return self._faults_of_one(plain(value))

    def _refused(self, elements: Iterable[tuple[str, float]]) -> list[Fault]:
        judged = ((place, x, self.refusal(x)) for place, x in elements)
        return [Fault(self.field + place, x, limits) for place, x, limits in judged if limits]

    def _faults_of_one(self, value: Any) -> list[Fault]:
        allowed, is_single = self.refusal(value), self.shape == "single"
        if is_single and allowed is None:
            return []
        if self.along is not None and not (is_single and isinstance(value, int | float)):
            ways = [self.allowed.text] if is_single else []
            ways += [self.pair] if self.pair else []
            ways += [f"{self.along.__name__} along the arm", *(["None"] if self.optional else [])]
            allowed = f"must be {', or '.join(ways)}"
        return [Fault(self.field, value, allowed or self.allowed)]

    def elements(self, value: Any) -> dict[str, Number]:
        """Numbers in a series or a function along the arm; the ends of stations stay."""
        if self.along is not None and isinstance(value, self.along):
            values = {f"values[{k}]": self._element(k) for k in range(len(value.values))}  # pyright: ignore
            return {f"{self.field}.{name}": x for name, x in (value.numbers | values).items()}  # pyright: ignore
        if not isinstance(value, tuple):
            return {}
        first = 1 if self.shape == "stations" else 0
        return {f"{self.field}[{k}]": self._element(k) for k in range(first, len(value) - first)}

    def _element(self, k: int) -> Number:
        called = {"symbol": f"{self.symbol}[{k}]", "meaning": f"{self.meaning}, number {k}"}
        alone: dict[str, Any] = {"along": None, "pair": "", "each": False}
        return dataclasses.replace(self, shape="single", **alone, **called)

    def normal(self, value: Any) -> Any:
        """A checked value as Python's floats, integers and tuples of them."""
        is_plain = type(value) is float and self.shape == "single" and not self.allowed.whole
        if value is None or is_plain:
            return value
        if self.shape == "triple":
            return tuple(x if abs(x) > _NOTHING else 0.0 for x in as_numbers(value).tolist())
        several = self._is_pair(value) or self._is_of_bundles(value)
        if several or self.shape in ("series", "stations", "several"):
            return tuple(np.asarray(value, float).tolist())
        is_function = self.along is not None and isinstance(value, self.along)
        if is_function or self._is_name(value):
            return value
        return int(plain(value)) if self.allowed.whole else float(plain(value))

    def _is_name(self, value: Any) -> bool:
        return self.named and isinstance(value, str | Station)

    def _is_pair(self, value: Any) -> bool:
        return bool(self.pair) and as_numbers(value).shape == (2,)

    def _is_of_bundles(self, value: Any) -> bool:
        return self.each and _is_sequence(value) and len(value) > 0


def stations(meaning: str) -> Any:
    """Field of a dataclass that holds the places Z/L of a series; those between the ends vary."""
    return number("Z/L", "", meaning, above=0.0, below=1.0, shape="stations")


def number(
    symbol: str,
    unit: str,
    meaning: str,
    *,
    low: float = -math.inf,
    high: float = math.inf,
    above: float = -math.inf,
    below: float = math.inf,
    integer: bool = False,
    default: Any = MISSING,
    **options: Any,
) -> Any:
    """Field of a dataclass that is a number of a design.

    Args:
        symbol: Symbol in formulas.
        unit: SI unit, "rad" for angles, "" for none.
        meaning: Meaning in a few words.
        low: Least value.
        high: Largest value.
        above: Largest value that is too small.
        below: Least value that is too large.
        integer: Whether it counts something.
        default: Default of the field; without one it is required, None makes it optional.
        options: Other fields of `Number`, such as `shape`.

    Examples:
        >>> from dataclasses import dataclass
        >>> from softreach.arm.number import fields_of, number
        >>> @dataclass(frozen=True, kw_only=True)
        ... class Disk:
        ...     radius: float = number("R", "m", "outer radius", above=0.0)
        >>> fields_of(Disk)["radius"].key
        'radius_m'
    """
    ends = max(low, above), min(high, below)
    allowed = Range(*ends, unit, above > -math.inf, below < math.inf, integer)
    declared = Number(symbol=symbol, meaning=meaning, allowed=allowed, **options)
    return dataclasses.field(default=default, metadata={"number": declared})


@cache
def fields_of(kind: type) -> Mapping[str, Number]:
    """Numbers of a kind of part by their fields, those of the kind itself before inherited ones."""
    numbers: dict[str, Number] = {}
    own = [(owner, vars(owner).get("__dataclass_fields__", {})) for owner in kind.__mro__]
    fields = [
        (owner, known[name])
        for owner, known in own
        for name in inspect.get_annotations(owner)
        if name in known
    ]
    known = {field.name for owner, field in fields if "number" in field.metadata or _is_ours(owner)}
    for owner, field in fields:
        declared = field.metadata.get("number")
        if declared is None and field.name not in known:
            declared = _plain_number(owner, field)
        if declared and field.name not in numbers:
            optional = declared.optional or default_of(kind, field.name) is None
            numbers[field.name] = dataclasses.replace(declared, field=field.name, optional=optional)
    return MappingProxyType(numbers)


@cache
def alternatives(kind: type) -> Mapping[str, str]:
    """Fields of a kind of part that say the same in two ways, each to the other."""
    pairs = [(each.field, each.instead_of) for each in fields_of(kind).values() if each.instead_of]
    return MappingProxyType(dict(pairs) | {other: field for field, other in pairs})


def default_of(kind: type, field: str) -> Any:
    """Default of a field of a dataclass."""
    return getattr(kind, "__dataclass_fields__")[field].default  # noqa: B009


@cache
def own_fields(kind: type) -> frozenset[str]:
    """Numbers of a kind that are not softreach's; none for a kind of softreach."""
    ours = (fields_of(base) for base in kind.__mro__ if _is_ours(base))
    return frozenset(fields_of(kind)).difference(*ours)


def series_faults(values: Mapping[str, Any], field: str, per_station: bool = True) -> list[Fault]:
    """Everything wrong with `stations_over_length` and a field with a value for each, or a gap."""
    stations, along = as_numbers(values["stations_over_length"]), as_numbers(values[field])
    ends = stations.ndim == 1 and len(stations) > 1 and stations[0] == 0.0 and stations[-1] == 1.0
    if not ends or not np.isfinite(stations).all() or (np.diff(stations) < _NEAREST).any():
        rise = "must be two or more numbers that rise from 0 (base) to 1 (tip), each by"
        allowed = f"{rise} {_NEAREST:g} or more"
        return [Fault("stations_over_length", values["stations_over_length"], allowed)]
    count = len(stations) if per_station else len(stations) - 1
    if along.shape != (count,) or not np.isfinite(along).all():
        where = "station" if per_station else "gap between stations"
        allowed = f"must be {count} finite numbers, one for each {where}"
        return [Fault(field, values[field], allowed)]
    return []


def _is_sequence(value: Any) -> bool:
    """True for numbers in a row."""
    each = as_numbers(value)
    return each.ndim == 1 and isinstance(value, Sized) and each.size == len(value)


def is_path_name(text: str) -> bool:
    """True for one line without dots and brackets, and without spaces around it."""
    return text.isprintable() and text == text.strip() and not set(text) & set(".[]")


def as_numbers(values: Any) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Numbers as an array; empty for text, booleans and anything else that is not a number."""
    if isinstance(values, list | tuple) and any(isinstance(each, bool) for each in values):
        return np.empty(0)  # NumPy takes them for 0 and 1
    try:
        return as_floats("values", values)
    except InvalidInput:
        return np.empty(0)


def _plain_number(owner: type, field: dataclasses.Field[Any]) -> Number | None:
    typed = field.type.__name__ if isinstance(field.type, type) else str(field.type)
    plain = _PLAIN.fullmatch(typed.replace(" ", ""))
    if plain is None or not field.init:
        return None
    return Number(
        symbol=field.name,
        meaning=f"field of {owner.__name__}",
        allowed=Range(whole=plain[1] == "int"),
        shape="single" if plain[1] else "several",
        optional=bool(plain[2]),
    )


def _is_ours(owner: type) -> bool:
    return owner.__module__.partition(".")[0] == "softreach"
