"""Options that commands share: how they are called, what they mean, how they are read.

The design that a command works on is among them, and the options that change it first.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter, Token

import softreach as sr
from softreach.cli.console import console
from softreach.support import errors, quantity
from softreach.support.arguments import POSITIVE, as_one_of
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible, Range
from softreach.support.files.atomic import check_place
from softreach.support.files.formats import PAGES, PICTURES, FileFormat, Formats, format_of
from softreach.support.files.text import read_bytes
from softreach.support.lazy import Dataset
from softreach.support.units import METER, TYPED, LengthUnit, as_unit, read_length

_MATTER = {"young_modulus": "1MPa", "density": "1000kg/m3"}  # what loads need to know


def read_as(
    name: str, text: Any, read: Callable[[Any], Any], allowed: str, limits: Range | None = None
) -> Any:
    """What a reader makes of a text; refused where it raises ValueError or leaves the limits."""
    try:
        value = read(text)
        if limits is None or limits.admits(value):
            return value
    except ValueError:
        pass
    raise InvalidInput(name, text or "''", allowed)


def _read_by(read: Callable[[str], float], allowed: str) -> Parameter:
    def convert(kind: Any, tokens: Sequence[Token]) -> float:
        del kind
        name = (tokens[0].keyword or "number").lstrip("-").replace("-", "_")
        return read_as(name, tokens[0].value, read, allowed)

    return Parameter(converter=convert)


Whole = Annotated[int, _read_by(quantity.read_whole_number, "a whole number such as 20000 or 2e4")]
Angle = Annotated[
    float, _read_by(partial(quantity.read_quantity, unit="rad"), "an angle such as 5deg or 0.1rad")
]
Number = Annotated[float, _read_by(quantity.read_number, "a finite number such as 0.5 or 1e-3")]


def pairs_in(name: str, texts: Sequence[str] | None, allowed: str) -> dict[str, str]:
    """Names and values of NAME=VALUE, each name once; a name may hold another =."""
    pairs: dict[str, str] = {}
    for text in texts or ():
        key, sign, value = (part.strip() for part in text.rpartition("="))
        if not sign or not key or not value:
            raise InvalidInput(name, text, allowed)
        if key in pairs:
            raise InvalidInput(name, text, f"given once for {key}")
        pairs[key] = value
    return pairs


OUTPUT = Group("Output options", sort_key=3)
OUT = Parameter(name=("--out", "-o"), group=OUTPUT)  # the file or folder that is written

STORED = "on a stored cloud: give the design instead"  # no changes, no sampling there


def _output(help: str, name: str | None = None) -> Parameter:
    return Parameter(name=name, group=OUTPUT, help=help)


_DESIGN = "Design file (.toml), or a built-in design such as minimal_trunk."
Design = Annotated[str, Parameter(help=_DESIGN)]
Source = Annotated[str, Parameter(help="Cloud (.zarr), design file (.toml) or built-in design.")]
_SOURCE = "Cloud (.zarr), design (.toml or built-in) or points (.csv .parquet .ply .npy)."
Points = Annotated[str, Parameter(help=_SOURCE)]
_ACTIVATION = "Activations, one per bundle in its unit ([-], N or Pa): -1,0,-0.5"
Activation = Annotated[str | None, Parameter(help=_ACTIVATION, allow_leading_hyphen=True)]
AsJson = Annotated[bool, _output("Print JSON; null where there is no number.", "--json")]
_UNIT = "Unit of lengths: m, cm, mm, in or L. If left out: that of the design file, else m or mm."
Unit = Annotated[str | None, _output(_UNIT)]
Device = Literal["cpu", "cuda"]
Overwrite = Annotated[bool, _output("Overwrite existing output.")]
Out = Annotated[Path | None, OUT]
Place = Annotated[Path, OUT]
View = Annotated[str | None, _output("View: oblique (if left out), front, side, top.")]
Signed = Annotated[str | None, Parameter(allow_leading_hyphen=True)]  # May begin with a minus


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Output:
    """How results are written and printed."""

    overwrite: Overwrite = False
    unit: Unit = None
    json: AsJson = False


DEFAULT = Output()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Sampling:
    """Options of the sampling of a cloud.

    Attributes:
        n: Number of samples: 400000 if left out.
        seed: Seed of the sampler: 0 if left out.
        sampler: uniform (if left out), boundary, counter, sobol or grid.
    """

    n: Annotated[Whole | None, Parameter(name=("--n", "-n"))] = None
    seed: Whole | None = None
    sampler: str | None = None

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of `compute_cloud` and `build_atlas`."""
        if self.sampler == "grid":
            refuse("on the sampler grid, which is not random", seed=self.seed)
        n = 400_000 if self.n is None else self.n
        return {"n": n, "seed": self.seed or 0, "sampler": self.sampler or "uniform"}


SAMPLING = Sampling()


@Parameter(name="*", group=Group("Changes of the design", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes that a command makes to the design that it takes.

    Attributes:
        base: The way the arm points: up, down, x, -x, y or -y.
        payload: Mass at the tip with its unit: 200g.
        gravity: down, up, sideways, none, or x,y,z [m/s²]; default down if there are loads.
        tip_force: Force on the tip in the world, x,y,z [N]: 0,0,-0.5
        point: Marker that counts as the tip, such as that of a tool.
        settings: Value of any parameter, as in taper=2deg. May be repeated.
    """

    base: Signed = None
    payload: Signed = None
    gravity: Signed = None
    tip_force: Signed = None
    point: str | None = None
    settings: Annotated[list[str] | None, Parameter(name="--set")] = None

    @property
    def given(self) -> dict[str, object]:
        """The options that were given, by their names."""
        options = vars(self) | {"set": ", ".join(self.settings) if self.settings else None}
        del options["settings"]
        return {name: value for name, value in options.items() if value is not None}

    def applied_to(self, arm: sr.Manipulator) -> sr.Manipulator:
        """The changed design: parameters first, which may give what loads need to know."""
        from softreach.arm.base import POINTS
        from softreach.arm.parameters import changed

        if self.base is not None:
            points = as_one_of("base", self.base, POINTS)
            arm = arm.replace(base=arm.base.replace(points=points))
        texts = pairs_in("set", self.settings, "PATH=VALUE, such as taper=2deg")
        of_loads = {name: texts.pop(name) for name in [*texts] if name.startswith("loads.")}
        arm = changed(arm, _values(arm, texts))
        if of_loads or {"payload", "gravity", "tip_force"} & self.given.keys():
            arm = self._loaded(arm, keep=bool(of_loads))
            arm = changed(arm, _values(arm, of_loads))
        return arm.at_point(self.point)

    def _loaded(self, arm: sr.Manipulator, *, keep: bool) -> sr.Manipulator:
        """The arm with the loads it has and those given; none where all are zero and none stay."""
        from softreach.arm.loads import GRAVITIES

        new: dict[str, object] = {}
        if self.payload is not None:
            new["payload"] = read_mass("payload", self.payload)
        if self.gravity is not None:
            words = f"{', '.join(GRAVITIES)}, or "
            vector = GRAVITIES.get(self.gravity)
            new["gravity"] = vector or _vector("gravity", self.gravity, "m/s²", words)
        if self.tip_force is not None:
            new["tip_force"] = _vector("tip_force", self.tip_force, "N")
        loads = (arm.loads or sr.Loads()).replace(**new)
        if not keep and loads == sr.Loads(gravity=GRAVITIES["none"]):
            return arm.replace(loads=None)
        faults = loads.section_faults(arm.section, arm.length)
        named = ((fault.path, fault.path.rpartition(".")[2]) for fault in faults)
        lacking = {path: _MATTER[field] for path, field in named if field in _MATTER}
        if lacking:
            options = " ".join(f"--set {path}={example}" for path, example in lacking.items())
            needed = " and ".join(lacking)
            raise NotPossible(f"loads need {needed}: add them to the design file, or {options}")
        return arm.replace(loads=loads)


UNCHANGED = Changes()


def design_from(text: str, changes: Changes = UNCHANGED, unit: str | None = None) -> sr.Manipulator:
    """The design of that name or file, changed as asked, to be shown in a unit."""
    from softreach.arm import design_file
    from softreach.arm.tables import check_extension

    arm = _unchanged(text)
    try:
        changed = shown_in(unit, changes.applied_to(arm))
        check_extension(changed)
    except InvalidDesign as error:
        one_option = len(error.faults) == 1 and changes.given
        raise design_file.in_file_terms(error, "" if one_option else text) from None
    say_limits(changed)
    return changed


def shown_in(unit: str | None, arm: sr.Manipulator) -> sr.Manipulator:
    """The design, shown in the unit that was asked for if there is one."""
    return arm if unit is None else arm.replace(display_unit=as_unit(unit, arm.length).name)


def say_limits(arm: sr.Manipulator) -> None:
    """Warn where the design leaves what the linear law covers."""
    from softreach.arm.lines import law_warning

    if text := law_warning(arm):
        errors.warn(text)


# suffixes of points, surfaces and tables, which are no designs
_POINTS = (".csv", ".txt", ".xyz", ".npy", ".npz", ".parquet", ".ply", ".stl", ".obj")


def _unchanged(text: str) -> sr.Manipulator:
    names = sr.designs.__all__
    if text in names:
        return getattr(sr.designs, text)()
    path = Path(text)
    suffix = path.suffix.lower()
    if suffix in _POINTS:
        hint = "softreach volume and show take points (.csv .txt .parquet .ply .npy)"
        raise NotPossible(f"{text} is not a design: give a .toml file; {hint}")
    is_json = suffix == ".json" and path.is_file()
    if suffix == ".toml" or (path.exists() and not path.is_dir() and not is_json):
        return sr.Manipulator.load(text)  # which refuses what is no file, such as a pipe
    hint = errors.did_you_mean(text, names)
    if suffix == ".json":
        hint = f"if it is a filament: softreach import {text} {text[:-5]}.toml"
    raise InvalidInput("design", text, f"a .toml file, or one of {', '.join(names)}", hint)


def read_mass(name: str, text: str) -> float:
    """A mass [kg] that was written with its unit."""
    allowed = f"a mass >= 0 with its unit ({', '.join(quantity.unit_names('kg'))}), such as 200g"
    return read_as(name, text, lambda text: quantity.read_quantity(text, "kg"), allowed, Range(0.0))


def _vector(name: str, text: str, unit: str, others: str = "") -> tuple[float, ...]:
    """Three numbers x,y,z, in the SI unit if none follows the last."""
    names = quantity.unit_names(unit)

    def read(text: str) -> tuple[float, ...]:
        written = max((name for name in names if text.endswith(name)), key=len, default=names[0])
        x, y, z = text.removesuffix(written).split(",")
        return tuple(quantity.read_quantity(f"{part}{written}", unit) for part in (x, y, z))

    allowed = f"{others}three finite numbers x,y,z in {unit} ({', '.join(names)})"
    return read_as(name, text.rstrip(), read, allowed)


def _values(arm: sr.Manipulator, written: Mapping[str, str]) -> dict[str, float]:
    from softreach.arm.parameters import Written, find_parameter

    values: dict[str, float] = {}
    names = Written.of(arm) if written else Written({})
    for key, value in written.items():
        name = key if key in names.by_key else find_parameter(arm, key).name
        own = names.by_key[name].name
        if own in values:
            raise InvalidInput("set", key, "given once, under one of its names")
        values[own] = read_as(key, value, partial(names.number, name), names.allowed(name))
    return values


def refuse(where: str, **options: object) -> None:
    """Refuse options that would be ignored there, such as "without --out", if any is given."""
    for name, value in options.items():
        if value is not None and value is not False:
            raise NotPossible(f"--{name.replace('_', '-')} has no effect {where}")


def is_stored(source: str) -> bool:
    """True if a source is a stored cloud; else it is a design."""
    return source.rstrip("/").endswith(".zarr")


def cloud_of(
    source: str, sampling: Sampling, changes: Changes, unit: str | None
) -> tuple[Dataset, sr.Manipulator]:
    """The stored cloud, or one of the design; its design."""
    if is_stored(source):
        refuse(STORED, **changes.given, **vars(sampling))
        cloud = sr.open_cloud(source)
        say_limits(arm := shown_in(unit, sr.cloud.design_of(cloud)))
        return cloud, arm
    arm = design_from(source, changes, unit)
    return sr.compute_cloud(arm, **sampling.arguments), arm


def points_of(
    source: str, sampling: Sampling, changes: Changes, unit: str | None
) -> tuple[Dataset, LengthUnit]:
    """The points of a file, which have no design, and the unit to print them in."""
    refuse("on points, which have no design", **changes.given, **vars(sampling))
    points = sr.exchange.read_points(source, unit=unit)
    return points, as_unit(unit or points.tip.attrs["unit_of_file"])


def is_points(source: str) -> bool:
    """True if a source is a file of points."""
    from softreach.exchange.points import POINT_FILES

    return source.lower().endswith(POINT_FILES)


def written_unit(arm: sr.Manipulator) -> LengthUnit:
    """Unit of tables and meshes, which other programs take to be in m unless one was chosen."""
    return METER if arm.display_unit is None else arm.length_unit


def activation_of(text: str | None, arm: sr.Manipulator, name: str = "activation") -> list[float]:
    """Numbers from `-1,0,-0.5`; every bundle at its lower bound when there is none."""
    if text is None:
        return arm.input_bounds[:, 0].tolist()
    if (values := quantity.numbers_in(text, arm.inputs)) is not None:
        return values
    allowed = f"{arm.inputs} comma-separated numbers ({', '.join(arm.input_names)})"
    raise InvalidInput(name, text, allowed)


def shape_of(text: str | None, arm: sr.Manipulator) -> Dataset:
    """The arm as activations bend it, which must leave it a shape."""
    import numpy as np

    shape = sr.configuration(arm, activation_of(text, arm))
    if not np.isfinite(shape.position.values).all():
        lower, upper = (",".join(f"{bound:g}" for bound in ends) for ends in arm.input_bounds.T)
        allowed = f"such that the arm has a shape, as between {lower} and {upper}"
        raise InvalidInput("activation", text, allowed)
    return shape


def points_in(name: str, file: Path, arm: sr.Manipulator) -> list[list[float]]:
    """Positions [m] from a CSV file with columns x, y, z; a header says no more than units."""
    from softreach.inverse.request import positions_in
    from softreach.support.files.columns import MOST

    return positions_in(read_bytes(name, file, MOST), str(file), arm.length)


def radius_of(text: str, length: float | None) -> float | str:
    """An alpha radius in m from `0.05L` where L is known, `5cm`, `0.05` (m) or `critical`."""
    if text == "critical":
        return text
    relative = "" if length is None else "0.05L, "
    allowed = f"a radius > 0 like {relative}5cm ({TYPED}) or 0.05 (m), or critical"
    return read_as("alpha", text, lambda text: read_length(text, length), allowed, POSITIVE)


def check_output(
    out: Path | list[Path] | None, formats: Formats, overwrite: bool, *libraries: str
) -> None:
    """Refuse files that could not be written in the end, before anything is computed.

    All libraries that are missing are named at once.
    """
    paths = out if isinstance(out, list) else [] if out is None else [out]
    if not paths:
        refuse("without --out", overwrite=overwrite)
    known = [formats.get(path.suffix.lower(), FileFormat()) for path in paths]
    errors.check_installed(*(name for each in known for name in each.libraries), *libraries)
    for path in paths:
        foreign = format_of(path, formats, "out").foreign
        check_place(path, overwrite=overwrite, foreign=foreign, name="out")


def check_picture(
    path: Path | None, overwrite: bool, *, view: str | None = None, page: bool = False
) -> None:
    """Refuse a view, and a place for a picture or for a page that turns, as `check_output`."""
    from softreach.picture.projection import view_angles

    if path is None:
        refuse("without --out", view=view)
    elif view is not None:
        view_angles(view)
    check_output(path, {**PICTURES, **PAGES} if page else PICTURES, overwrite)


def is_page(path: Path) -> bool:
    """True if a figure is asked for that turns in a browser."""
    return path.suffix.lower() in PAGES


def save_picture(figure: Any, path: Path, overwrite: bool) -> None:
    """Write a figure, and say what part of the data a page that turns shows."""
    sr.plot.save_figure(figure, path, overwrite=overwrite)
    if note := getattr(figure, "note", ""):
        console.note(f"{path}: {note}")


def save_mesh(mesh: Any, written: LengthUnit, path: Path, overwrite: bool) -> None:
    """Write a surface, and say the unit of its lengths."""
    sr.export.export_mesh(mesh, path, unit=written, overwrite=overwrite)
    console.written(path, written)
