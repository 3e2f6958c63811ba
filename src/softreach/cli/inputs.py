"""What commands take: designs, clouds, activations, radii; degrees end here."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.numbers import WHOLE
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.support.files.text import MEGABYTE, read_text
from softreach.support.quantity import numbers_in, shortened

if TYPE_CHECKING:
    import xarray as xr

    from softreach.arm.manipulator import Manipulator

__all__ = [
    "Activation",
    "AsJson",
    "Design",
    "Durable",
    "Sampler",
    "Samples",
    "Seed",
    "Source",
    "activation_of",
    "cloud_of",
    "design_from",
    "is_stored",
    "points_of",
    "radius_of",
    "shape_of",
]

_MOST_TARGETS = 64 * MEGABYTE  # a million targets

Design = Annotated[
    str, Parameter(help="Design file (.toml), or a built-in design such as minimal_trunk.")
]
Source = Annotated[str, Parameter(help="Cloud (.zarr), design file (.toml) or built-in design.")]
Sampler = Annotated[str, Parameter(help="uniform, boundary, sobol or grid.")]
Samples = Annotated[int, WHOLE, Parameter(help="Samples, when the source is a design.")]
Seed = Annotated[int, WHOLE, Parameter(help="Seed of the sampler.")]
AsJson = Annotated[bool, Parameter(name="--json", negative="", help="Print JSON for machines.")]
Durable = Annotated[
    bool, Parameter(negative="", help="Wait until not even a power cut can lose what is written.")
]
Activation = Annotated[
    str | None,
    Parameter(
        help="Activations, one per bundle in its unit ([-], N or Pa): -1,0,-0.5",
        allow_leading_hyphen=True,
    ),
]


def design_from(text: str, changes: Changes = UNCHANGED) -> Manipulator:
    """The design of that name or file, changed as asked."""
    from softreach.arm import designs, file
    from softreach.arm.tables import check_extension

    built_in = {name: getattr(designs, name) for name in designs.__all__}
    if text in built_in:
        arm = built_in[text]()
    elif text.endswith(".jl"):
        allowed = f"a .toml file, or one of {', '.join(built_in)}"
        hint = f"softreach import {text} {text[:-3]}.toml makes one of a filament"
        raise InvalidInput("design", text, allowed, hint)
    elif text.endswith(".toml") or Path(text).is_file():
        arm = _loaded(text)
    else:
        raise InvalidInput("design", text, f"a .toml file, or one of {', '.join(built_in)}")
    try:
        varied = changes.applied_to(arm)
        check_extension(varied)
        return varied
    except InvalidDesign as error:
        one_option = len(error.faults) == 1 and changes.given
        raise file.in_file_terms(error, "" if one_option else text) from None


def _loaded(path: str) -> Manipulator:
    from softreach.arm.manipulator import Manipulator

    if not Path(path).is_file():
        raise InvalidInput("design", path, "a file that exists")
    return Manipulator.load(path)


def is_stored(source: str) -> bool:
    """Whether a source is a stored cloud; else it is a design."""
    return source.rstrip("/").endswith(".zarr")


def cloud_of(
    source: str, n: int, seed: int, sampler: str, changes: Changes = UNCHANGED
) -> xr.Dataset:
    """The stored cloud, or one computed from the design."""
    from softreach.cloud.clouds import compute_cloud, open_cloud

    if is_stored(source):
        changes.refuse("left out for a stored cloud: give the design instead")
        return open_cloud(source)
    return compute_cloud(design_from(source, changes), n, seed=seed, sampler=sampler)


def activation_of(text: str | None, arm: Manipulator) -> list[float]:
    """Numbers from `-1,0,-0.5`; every bundle at its lower bound when there is none."""
    if text is None:
        return arm.bounds[:, 0].tolist()
    values = numbers_in(text, arm.bundles)
    if values is None:
        allowed = f"{arm.bundles} comma-separated numbers ({', '.join(arm.bundle_names)})"
        raise InvalidInput("activation", shortened(text), allowed)
    return values


def shape_of(text: str | None, arm: Manipulator) -> xr.Dataset:
    """The arm as activations bend it, which must leave it a shape."""
    import numpy as np

    from softreach.rod.kinematics import configuration

    shape = configuration(arm, activation_of(text, arm))
    if not np.isfinite(shape.position.values).all():
        lower, upper = (",".join(f"{bound:g}" for bound in ends) for ends in arm.bounds.T)
        allowed = f"such that the arm has a shape, as from {lower} to {upper}"
        raise InvalidInput("activation", text, allowed)
    return shape


def points_of(text: str | None, file: Path | None) -> list[list[float]]:
    """Positions [m] from `x,y,z`, or from a CSV file with such columns (a header is skipped)."""
    from softreach.inverse.request import position_in, positions_in

    if text is not None:
        return [position_in("target", text)]
    if file is None:
        raise InvalidInput("targets", file, "a CSV file")
    return positions_in(read_text("targets", file, _MOST_TARGETS), str(file))


def radius_of(text: str, length: float) -> float | str:
    """An alpha radius in m from `0.05L`, `0.05` (m) or `critical`."""
    if text == "critical":
        return text
    values = numbers_in(text.removesuffix("L"), 1)
    radius = (length if text.endswith("L") else 1.0) * (values[0] if values else 0.0)
    if not 0.0 < radius < math.inf:
        raise InvalidInput(
            "alpha", shortened(text) or "''", "a radius > 0 like 0.05L or 0.05 (m), or critical"
        )
    return radius
