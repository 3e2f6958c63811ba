"""A family of designs, by some parameters and the values they take; the command of an atlas.

The same command resumes an atlas, another one is refused.
"""

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from importlib.metadata import version
from typing import Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.parameters import (
    Parameter,
    Written,
    changed,
    find_parameter,
    find_parameters,
    from_written,
    parameters,
    unknown_parameter,
)
from softreach.arm.tables import check_extension
from softreach.atlas.metrics import Metric, known_metric
from softreach.cloud.curvature import QUANTILES
from softreach.rod.tip_map import Device
from softreach.sampling import check_sampler, sample_cube
from softreach.support.arguments import as_integer
from softreach.support.arrays import as_floats, check_finite
from softreach.support.errors import InvalidDesign, InvalidInput, counted
from softreach.support.progress import bar
from softreach.support.quantity import read_number, read_whole_number

Layout = Literal["grid", "list"]

ATLAS_VERSION = 5  # Version of the layout of a store
STATIONS = tuple(np.linspace(0.5, 1.0, 6).tolist())

_RESERVED = frozenset(
    ("status", "message", "number", "tip", "axis", "unit_activation", "sample", "bundle", "length")
    + ("design", "metric", "metrics", "curvature", "quantity", "station", "quantile", "rank")
)
"""Names that no metric may have, as an atlas or a question about it uses them itself."""
_LONGEST = 1e3  # ratio of the lengths of designs whose tips share one fixed-point step
_MOST = 1_000_000  # designs, each of which is looked at and has files of its own
_MOST_VALUES = 100_000  # of one parameter
_INTEGER = re.compile(r"[+-]?\d+", re.ASCII)


def column(name: str, values: ArrayLike) -> tuple[float, ...]:
    """Finite values of a parameter; whole numbers stay whole."""
    floats = as_floats(name, values, "one finite value or more")
    if floats.ndim > 1:
        raise InvalidInput(f"{name}.shape", floats.shape, "of one dimension")
    array = np.asarray(values)
    return tuple(np.atleast_1d(array if array.dtype.kind in "iu" else floats).tolist())


@dataclass(frozen=True, kw_only=True)
class DesignSpace:
    """Designs that differ from a base in named parameters, by `grid`, `listed` or `sampled`.

    Combinations that no arm can have are found when asked for (`gaps`) and have no design.

    Raises:
        InvalidInput: An unknown parameter, no values, values that are not finite or come twice,
            lists of different length, or more than a million designs.
    """

    base: Manipulator
    """The design that all others are variations of."""
    parameters: tuple[tuple[str, tuple[float, ...]], ...]
    """Name and values [SI units] of every parameter."""
    layout: Layout = "grid"
    """Every combination (grid), or the values taken together, one of each (list)."""

    def __post_init__(self) -> None:
        base = a_manipulator("base", self.base)
        if not self.parameters:
            known = (name for name, parameter in parameters(base).items() if not parameter.owner)
            allowed = f"at least one of {', '.join(known)}, or of a part, such as left.offset"
            raise InvalidInput("parameters", "none", allowed)
        find_parameters(base, self.names)
        for name, values in self.parameters:
            if {"/", "\\"} & {*name}:
                allowed = "without / and \\, which would name folders of the store"
                raise InvalidInput("parameter", name, allowed, "rename the part")
            if not values or not np.isfinite(values).all():
                raise InvalidInput(name, values, "one finite value or more")
            if self.layout == "grid" and len(set(values)) < len(values):
                raise InvalidInput(name, values, "values that differ")
        if self.layout == "list" and len({len(values) for _, values in self.parameters}) > 1:
            counts = ", ".join(f"{name}: {len(values)}" for name, values in self.parameters)
            allowed = "the same number for each parameter in a list of designs"
            raise InvalidInput("parameters", counts, allowed)
        if self.size > _MOST:
            allowed, hint = f"{_MOST:,} at most", "take fewer values, or build several atlases"
            raise InvalidInput("designs", f"{self.size:,}", allowed, hint)

    @classmethod
    def grid(cls, base: Manipulator, **values: ArrayLike) -> Self:
        """Every combination of the values.

        Args:
            base: The design to vary.
            **values: Parameter -> values [SI units], for instance `taper=np.radians([0, 1, 2])`;
                see `arm.parameters` for the names. Those with a dot or a bracket are given as
                `**{"rings[0].material.young_modulus": [1e5, 2e5]}`.
        """
        return cls(base=base, parameters=_plain(values), layout="grid")

    @classmethod
    def listed(cls, base: Manipulator, **values: ArrayLike) -> Self:
        """The first values of all parameters make a design, the second ones the next, and so on."""
        return cls(base=base, parameters=_plain(values), layout="list")

    @classmethod
    def sampled(
        cls,
        base: Manipulator,
        count: int,
        *,
        seed: int = 0,
        **ranges: tuple[float, float],
    ) -> Self:
        """Designs spread evenly over a box of parameters.

        Args:
            base: The design to vary.
            count: Number of designs, a power of two.
            seed: Of the sampler, a scrambled Sobol sequence.
            **ranges: Parameter -> lower and upper end [SI units].
        """
        a_manipulator("base", base)
        count, seed = as_integer("count", count, 1, _MOST), as_integer("seed", seed)
        if not ranges:
            return cls(base=base, parameters=())
        cube = sample_cube("sobol", count, len(ranges), seed)
        ends = np.array([_ends(name, ends) for name, ends in ranges.items()])
        points = ends[:, 0] + cube * np.diff(ends, axis=1)[:, 0]
        if counts := [k for k, name in enumerate(ranges) if find_parameter(base, name).whole]:
            points[:, counts] = np.rint(points[:, counts])
        columns = zip(ranges, points.T.tolist(), strict=True)
        return cls(base=base, parameters=_plain(dict(columns)), layout="list")

    def __str__(self) -> str:
        lines, varied = [f"{self.layout} of {counted(self.size, 'design')}"], self.varied()
        for name, values in self.parameters:
            ends = f"{min(values):.6g} to {max(values):.6g} {varied[name].unit}".removesuffix(" 1")
            lines.append(f"  {name}: {counted(len(values), 'value')} from {ends}")
        return "\n".join(lines)

    @property
    def names(self) -> tuple[str, ...]:
        """The parameters' names."""
        return tuple(name for name, _ in self.parameters)

    @property
    def dims(self) -> tuple[str, ...]:
        """Dimensions of the atlas: the parameters of a grid, or `design`."""
        return self.names if self.layout == "grid" else ("design",)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of designs along each dimension."""
        counts = tuple(len(values) for _, values in self.parameters)
        return counts if self.layout == "grid" else counts[:1]

    @property
    def size(self) -> int:
        """Number of designs, gaps included."""
        return math.prod(self.shape)

    def varied(self) -> dict[str, Parameter]:
        """Varied parameters, by name."""
        return find_parameters(self.base, self.names)

    def place(self, index: int) -> tuple[int, ...]:
        """Place of the design with this number, along each dimension."""
        number = as_integer("number of the design", index, 0, self.size - 1)
        return tuple(map(int, np.unravel_index(number, self.shape)))

    def values(self, index: int) -> dict[str, float]:
        """Parameters of the design with this number, counted in C order over `shape`."""
        place = self.place(index)
        where = place if self.layout == "grid" else place * len(self.parameters)
        return {name: values[k] for (name, values), k in zip(self.parameters, where, strict=True)}

    def design(self, index: int) -> Manipulator:
        """The design with this number.

        Raises:
            InvalidDesign: No such arm can exist, or some activation would shorten it to nothing.
        """
        arm = changed(self.base, self.values(index))
        check_extension(arm)
        return arm

    @property
    def gaps(self) -> Mapping[int, str]:
        """Combinations that no arm can have: number -> why not."""
        return self._survey[0]

    @cached_property
    def bundles(self) -> int:
        """The largest number of bundles of any design; 0 if there is no design."""
        return max((count for count, _ in self._survey[1]), default=0)

    @cached_property
    def length_range(self) -> tuple[float, float]:
        """Length of the shortest and of the longest design [m]."""
        lengths = [length for _, length in self._survey[1]] or [math.nan]
        return min(lengths), max(lengths)

    @cached_property
    def _survey(self) -> tuple[dict[int, str], list[tuple[int, float]]]:
        """Gaps, and inputs and length of all others; each is made once, which takes about 2 ms."""
        gaps: dict[int, str] = {}
        sizes: list[tuple[int, float]] = []
        with bar("looking at all designs", self.size) as shown:
            for index in range(self.size):
                try:
                    arm = self.design(index)
                except InvalidDesign as error:
                    gaps[index] = "; ".join(str(error).splitlines())
                else:
                    sizes.append((arm.inputs, arm.length))
                shown(1)
        return gaps, sizes

    def to_dict(self) -> dict[str, Any]:
        """The space in plain values, from which `from_dict` makes an equal one."""
        parameters = {name: [*values] for name, values in self.parameters}
        base, extent = self.base.to_toml(), [self.bundles, *self.length_range]
        return {"design": base, "layout": self.layout, "parameters": parameters, "extent": extent}

    @classmethod
    def from_dict(cls, space: Mapping[str, Any]) -> Self:
        """The space that `to_dict` described; its base design is read when it is asked for."""
        bundles, *lengths = space["extent"]  # so that reading a store makes no design
        made = object.__new__(cls)
        vars(made).update(layout=space["layout"], written=space["design"], bundles=bundles)
        vars(made).update(parameters=_plain(space["parameters"]), length_range=tuple(lengths))
        return made

    def __getattr__(self, name: str) -> Any:
        """The base design of a store, whose actuators may need a module that nobody imported."""
        if name != "base" or "written" not in vars(self):
            raise AttributeError(name)
        base = Manipulator.from_toml(vars(self)["written"], source="the base design")
        object.__setattr__(self, "base", base)
        return base


def _plain(values: Mapping[str, ArrayLike]) -> tuple[tuple[str, tuple[float, ...]], ...]:
    return tuple((name, column(name, entries)) for name, entries in values.items())


def _ends(name: str, ends: ArrayLike) -> np.ndarray:
    allowed = "two numbers, the lower one first"
    floats = check_finite(name, as_floats(name, ends, allowed))
    if floats.shape != (2,) or not floats[0] < floats[1]:
        raise InvalidInput(name, ends, allowed)
    return floats


@dataclass(frozen=True, kw_only=True)
class Command:
    """Everything that decides the numbers of an atlas, and nothing else."""

    space: DesignSpace
    n: int
    seed: int
    sampler: str
    tol: float
    alpha_over_length: float  # Radius of the alpha shapes over the length of each design
    accuracy: float  # Relative error asked of the exact volumes
    metrics: tuple[Metric, ...]  # As `chosen_metrics` has them
    keep_clouds: bool
    device: Device = "cpu"
    """What computes tips; the last digits depend on it."""
    stations: tuple[float, ...] = STATIONS
    """Places at which curvature is measured, over the length of each design."""
    quantiles: tuple[float, ...] = QUANTILES
    softreach_version: str = field(default_factory=lambda: version("softreach"))
    atlas_version: int = ATLAS_VERSION

    def __post_init__(self) -> None:
        space = self.space
        for metric in self.metrics:
            if metric.name in _RESERVED or metric.name in space.names:
                allowed = "a name that the atlas does not use itself"
                raise InvalidInput("name of a metric", metric.name, allowed)
        if not space.bundles:
            why = next(iter(space.gaps.values()))
            designs = counted(space.size, "design")
            raise InvalidInput("space", designs, "valid for at least one design", why)
        shortest, longest = space.length_range
        if self.keep_clouds and longest > _LONGEST * shortest:
            allowed = f"within a factor of {_LONGEST:g} of each other if clouds are kept"
            hint = "stored tips share one step; pass keep_clouds=False, or build two atlases"
            raise InvalidInput("length", f"{shortest:g} to {longest:g} m", allowed, hint)
        check_sampler(self.sampler, self.n, space.bundles, self.seed)

    @property
    def numbers(self) -> tuple[Metric, ...]:
        """The metrics that are single numbers."""
        return tuple(metric for metric in self.metrics if not metric.over)

    @property
    def profiles(self) -> tuple[Metric, ...]:
        """The metrics over stations and quantiles."""
        return tuple(metric for metric in self.metrics if metric.over)

    @property
    def profile_sizes(self) -> dict[str, int]:
        """Number of stations and quantiles of a profile."""
        return {"station": len(self.stations), "quantile": len(self.quantiles)}

    def to_json(self) -> str:
        """The command as text, from which `from_json` makes an equal one."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        metrics = [metric.to_dict() for metric in self.metrics]
        return json.dumps({**values, "space": self.space.to_dict(), "metrics": metrics})

    @classmethod
    def from_json(cls, text: str) -> Self:
        """The command that `to_json` wrote; metrics that are not softreach's lack a function."""
        values = json.loads(text)  # the root of a store is sealed
        if (version := values.get("atlas_version")) != ATLAS_VERSION:
            hint = "build the atlas again in a new folder"
            raise InvalidInput("version of the atlas", version, str(ATLAS_VERSION), hint)
        values |= {name: tuple(values[name]) for name in ("stations", "quantiles")}
        space, metrics = DesignSpace.from_dict(values["space"]), list[Metric]()
        for metric in values["metrics"]:
            own = known_metric(metric["name"])
            same = own is not None and own.to_dict() == metric
            metrics.append(own if own and same else Metric.from_dict(metric))
        return cls(**{**values, "space": space, "metrics": tuple(metrics)})

    def continuing(self, begun: Self) -> Self:
        """This command for a store that another version began: without metrics added since."""
        names = {metric.name for metric in begun.metrics}
        kept = (m for m in self.metrics if m.name in names or not known_metric(m.name))
        return replace(self, metrics=tuple(kept), softreach_version=begun.softreach_version)

    def differences(self, other: Self) -> list[str]:
        """Differences between this command and another, one line each."""
        own, its = ({m.name: m.to_dict() for m in each.metrics} for each in (self, other))
        lines = [*_differences(_flat(self), _flat(other))]
        for one, two, words in ((its, own, "there and not here"), (own, its, "here and not there")):
            if only := [name for name in one if name not in two]:
                lines.append(f"metrics: {', '.join(only)} {words}")
        for name in own.keys() & its.keys():
            lines += (f"metric {name}, {line}" for line in _differences(own[name], its[name]))
        return lines


def _flat(command: Command) -> dict[str, Any]:
    """All settings but the metrics by name, those of the space too."""
    values = {f.name: getattr(command, f.name) for f in fields(command) if f.name != "metrics"}
    space = values.pop("space")
    design = {"layout": space.layout, "design": space.base.to_toml()}
    return values | design | dict(space.parameters)


def _differences(mine: Mapping[str, Any], theirs: Mapping[str, Any]) -> Iterator[str]:
    for name in dict.fromkeys([*mine, *theirs]):
        own, other = mine.get(name), theirs.get(name)
        if own != other:
            yield f"{name}: {_shown(other, own)} there, {_shown(own, other)} here"


def _shown(value: Any, other: Any) -> str:
    """A setting in a few words, chosen so that it differs visibly from the other one."""
    if value is None:
        return "none"
    if isinstance(value, tuple) and len(value) > 4:
        return f"{len(value)} values from {value[0]:.6g} to {value[-1]:.6g}"
    if isinstance(value, str) and "\n" in value:
        own = [line for line in value.splitlines() if line and line not in str(other).splitlines()]
        return "; ".join(own) or "less"
    return repr(value)


def parse_parameter(base: Manipulator, key: str, text: str) -> tuple[str, list[float]]:
    """Name and values [SI units] of a parameter as written.

    `taper_deg` with `0:3:16` or `0,1,2`, or `taper` with `0deg:3deg:16` or `0deg,1deg`.
    """
    names = Written.of(base)
    if key not in names.by_key:
        raise unknown_parameter(key, names.written)
    parameter, has_unit = names.by_key[key], key in names.written
    try:
        numbers = _read(text, _number if has_unit else partial(names.number, key))
    except ValueError:
        kind = "numbers" if has_unit else names.allowed(key)
        ends = f"start:stop:count (both ends count, up to {_MOST_VALUES} values)"
        allowed = f"{kind}; several as 1,2,3 or {ends}"
        raise InvalidInput(key, text, allowed) from None
    if has_unit:
        numbers = [from_written(x, parameter.unit) for x in numbers]
    return parameter.name, numbers


def _read(text: str, read: Callable[[str], float]) -> list[float]:
    if ":" not in text:
        return [read(one) for one in text.split(",")]
    start, stop, count = text.split(":")
    number = read_whole_number(count)
    if not 0 < number <= _MOST_VALUES:
        raise ValueError(text)
    values = np.linspace(read(start), read(stop), number)
    return [float(f"{value:.15g}") for value in values]  # 1.8 and not 1.8000000000000003


def _number(text: str) -> float:
    number = read_number(text)
    return read_whole_number(text) if _INTEGER.fullmatch(text.strip()) else number
