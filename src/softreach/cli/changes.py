"""The design that a command works on, and the options that change it first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

import softreach as sr
from softreach.cli.values import Number, pairs_in, read_as
from softreach.support.arguments import as_one_of
from softreach.support.errors import (
    InvalidDesign,
    InvalidInput,
    NotPossible,
    Range,
    did_you_mean,
    warn,
)
from softreach.support.quantity import read_quantity, unit_names
from softreach.support.units import as_unit

_POSTURES = {"upright": "up", "hanging": "down"}
"""Words for the way that a base points."""
_MATTER = {"young_modulus": "1MPa", "density": "1000kg/m3"}
"""Examples of what loads need to know of a material."""


Signed = Annotated[str | None, Parameter(allow_leading_hyphen=True)]
"""Text that may begin with a minus."""


@Parameter(name="*", group=Group("Changes of the design", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes that a command makes to the design that it takes.

    Attributes:
        base: The way the arm points: up (upright), down (hanging), x, -x, y or -y.
        revolution_deg: Revolution of every helical fiber; each keeps its handedness.
        taper_deg: Taper angle.
        payload: Mass at the tip with its unit: 200g.
        gravity: down, up, sideways, none, or x,y,z [m/s²]; default down if there are loads.
        tip_force: Force on the tip in the world, x,y,z [N]: 0,0,-0.5
        point: Marker that counts as the tip, such as that of a tool.
        settings: Value of any parameter, as in taper=2deg. May be repeated.
    """

    base: Signed = None
    revolution_deg: Number | None = None
    taper_deg: Number | None = None
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
            words = _POSTURES | {points: points for points in POINTS}
            points = words[as_one_of("base", self.base, words)]
            arm = arm.replace(base=arm.base.replace(points=points))
        texts, given = pairs_in("set", self.settings, "PATH=VALUE, such as taper=2deg"), self.given
        of_loads = {name: texts.pop(name) for name in [*texts] if name.startswith("loads.")}
        angles = [(name, given[name]) for name in ("revolution_deg", "taper_deg") if name in given]
        arm = changed(arm, _values(arm, [*angles, *texts.items()]))
        if of_loads or {"payload", "gravity", "tip_force"} & given.keys():
            arm = self._loaded(arm, keep=bool(of_loads))
            arm = changed(arm, _values(arm, [*of_loads.items()]))
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
        lacking = {
            fault.path: _MATTER[field]
            for fault in loads.section_faults(arm.section, arm.length)
            if (field := fault.path.rpartition(".")[2]) in _MATTER
        }
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
        warn(text)


_POINTS = (".csv", ".txt", ".xyz", ".npy", ".npz", ".parquet", ".mat", ".ply", ".stl", ".obj")
"""Suffixes of points, surfaces and tables, which are no designs."""


def _unchanged(text: str) -> sr.Manipulator:
    names = sr.designs.__all__
    if text in names:
        return getattr(sr.designs, text)()
    path = Path(text)
    suffix = path.suffix.lower()
    if suffix in _POINTS:
        raise NotPossible(
            f"{text} is no design: give a .toml file; in Python, softreach.concave_hull(points, "
            "alpha=0.05) computes the volume of points [m] of shape (n, 3)"
        )
    is_json = suffix == ".json" and path.is_file()
    if suffix == ".toml" or (path.exists() and not path.is_dir() and not is_json):
        return sr.Manipulator.load(text)  # which refuses what is no file, such as a pipe
    hint = did_you_mean(text, names)
    if suffix == ".json":
        hint = f"if it is a filament: softreach import {text} {text[:-5]}.toml"
    allowed = f"a .toml file, or one of {', '.join(names)}"
    raise InvalidInput("design", text, allowed, hint)


def read_mass(name: str, text: str) -> float:
    """A mass [kg] that was written with its unit."""
    allowed = f"a mass >= 0 with its unit ({', '.join(unit_names('kg'))}), such as 200g"
    return read_as(name, text, lambda text: read_quantity(text, "kg"), allowed, Range(0.0))


def _vector(name: str, text: str, unit: str, others: str = "") -> tuple[float, ...]:
    """Three numbers x,y,z, in the SI unit if none follows the last."""
    names = unit_names(unit)

    def read(text: str) -> tuple[float, ...]:
        written = max((name for name in names if text.endswith(name)), key=len, default="")
        x, y, z = text.removesuffix(written).split(",")
        return tuple(read_quantity(f"{part}{written or names[0]}", unit) for part in (x, y, z))

    allowed = f"{others}three finite numbers x,y,z in {unit} ({', '.join(names)})"
    return read_as(name, text.rstrip(), read, allowed)


def _values(arm: sr.Manipulator, written: Sequence[tuple[str, object]]) -> dict[str, float]:
    from softreach.arm.parameters import find_parameter
    from softreach.arm.written import Written

    values: dict[str, float] = {}
    names = Written.of(arm) if written else Written({})
    for key, value in written:
        name = key if key in names.by_key else find_parameter(arm, key).name
        own = names.by_key[name].name
        if own in values:
            raise InvalidInput("set", key, "given once, under one of its names")
        values[own] = read_as(key, value, partial(names.number, name), names.allowed(name))
    return values
