"""Options that commands share: how they are called, what they mean, how they are read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

import softreach as sr
from softreach.cli.changes import Changes, design_from, say_limits, shown_in
from softreach.cli.console import console
from softreach.cli.values import Whole, read_as
from softreach.support.arguments import POSITIVE
from softreach.support.errors import InvalidInput, NotPossible, check_installed
from softreach.support.files.atomic import check_place
from softreach.support.files.formats import (
    PAGES,
    PICTURES,
    FileFormat,
    Formats,
    format_of,
)
from softreach.support.files.text import MEGABYTE, read_text
from softreach.support.quantity import numbers_in
from softreach.support.units import METER, TYPED, LengthUnit, read_length

if TYPE_CHECKING:
    import xarray as xr

OUTPUT = Group("Output options", sort_key=3)
OUT = Parameter(name=("--out", "-o"), group=OUTPUT)
"""The one name of the file or folder that a command writes."""

_MOST_TARGETS = 64 * MEGABYTE  # a million targets
STORED = "on a stored cloud: give the design instead"
"""Where changes of a design and options of sampling have no effect."""


def _output(help: str, name: str | None = None) -> Parameter:
    return Parameter(name=name, group=OUTPUT, help=help)


Design = Annotated[
    str, Parameter(help="Design file (.toml), or a built-in design such as minimal_trunk.")
]
Source = Annotated[str, Parameter(help="Cloud (.zarr), design file (.toml) or built-in design.")]
_ACTIVATION = "Activations, one per bundle in its unit ([-], N or Pa): -1,0,-0.5"
Activation = Annotated[str | None, Parameter(help=_ACTIVATION, allow_leading_hyphen=True)]
AsJson = Annotated[bool, _output("Print JSON; null where there is no number.", "--json")]
_UNIT = "Unit of lengths: m, cm, mm, in or L. If left out: that of the design file, else m or mm."
Unit = Annotated[str | None, _output(_UNIT)]
Durable = Annotated[bool, _output("Flush to disk before exiting.")]
Overwrite = Annotated[bool, _output("Overwrite existing output.")]
Out = Annotated[Path | None, OUT]
View = Annotated[str | None, _output("View: oblique (if left out), front, side, top.")]


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
        sampler: uniform (if left out), boundary, sobol or grid.
    """

    n: Annotated[Whole | None, Parameter(name=("--n", "-n"))] = None
    seed: Whole | None = None
    sampler: str | None = None

    @property
    def count(self) -> int:
        """Number of samples."""
        return 400_000 if self.n is None else self.n

    @property
    def arguments(self) -> dict[str, Any]:
        """Arguments of `compute_cloud` and `build_atlas`."""
        if self.sampler == "grid":
            refuse("on the sampler grid, which is not random", seed=self.seed)
        return {"n": self.count, "seed": self.seed or 0, "sampler": self.sampler or "uniform"}


SAMPLING = Sampling()


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
) -> tuple[xr.Dataset, sr.Manipulator]:
    """The stored cloud, or one of the design; its design."""
    if is_stored(source):
        refuse(STORED, **changes.given, **vars(sampling))
        cloud = sr.open_cloud(source)
        say_limits(arm := shown_in(unit, sr.cloud.design_of(cloud)))
        return cloud, arm
    arm = design_from(source, changes, unit)
    return sr.compute_cloud(arm, **sampling.arguments), arm


def written_unit(arm: sr.Manipulator) -> LengthUnit:
    """Unit of tables and meshes, which other programs take to be in m unless one was chosen."""
    return METER if arm.display_unit is None else arm.length_unit


def activation_of(text: str | None, arm: sr.Manipulator, name: str = "activation") -> list[float]:
    """Numbers from `-1,0,-0.5`; every bundle at its lower bound when there is none."""
    if text is None:
        return arm.input_bounds[:, 0].tolist()
    if (values := numbers_in(text, arm.inputs)) is not None:
        return values
    allowed = f"{arm.inputs} comma-separated numbers ({', '.join(arm.input_names)})"
    raise InvalidInput(name, text, allowed)


def shape_of(text: str | None, arm: sr.Manipulator) -> xr.Dataset:
    """The arm as activations bend it, which must leave it a shape."""
    import numpy as np

    shape = sr.configuration(arm, activation_of(text, arm))
    if not np.isfinite(shape.position.values).all():
        lower, upper = (",".join(f"{bound:g}" for bound in ends) for ends in arm.input_bounds.T)
        allowed = f"such that the arm has a shape, such as from {lower} to {upper}"
        raise InvalidInput("activation", text, allowed)
    return shape


def points_in(name: str, file: Path, arm: sr.Manipulator) -> list[list[float]]:
    """Positions [m] from a CSV file with columns x, y, z; a header says no more than units."""
    from softreach.inverse.request import positions_in

    return positions_in(read_text(name, file, _MOST_TARGETS), str(file), arm.length)


def radius_of(text: str, length: float) -> float | str:
    """An alpha radius in m from `0.05L`, `5cm`, `0.05` (m) or `critical`."""
    if text == "critical":
        return text
    allowed = f"a radius > 0 like 0.05L, 5cm ({TYPED}) or 0.05 (m), or critical"
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
    check_installed(*(name for each in known for name in each.libraries), *libraries)
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
