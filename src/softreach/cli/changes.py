"""The design that a command works on, and the options that change it first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

from cyclopts import Group, Parameter

from softreach.cli.values import Number, pairs_in
from softreach.support.errors import InvalidDesign, InvalidInput, did_you_mean, warn

if TYPE_CHECKING:
    from softreach.arm.loads import Loads
    from softreach.arm.manipulator import Manipulator


_POSTURES = {"upright": "up", "hanging": "down"}
"""Words for the way that a base points."""


Signed = Annotated[str | None, Parameter(allow_leading_hyphen=True)]
"""Text that may begin with a minus."""


@Parameter(name="*", group=Group("Changes of the design", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Changes:
    """Changes that a command makes to the design that it takes.

    Attributes:
        base: The way the arm points from its base in the world: up (upright), down (hanging), x,
            -x, y or -y.
        revolution_deg: Revolution of every helical fiber [deg]; each keeps its handedness.
        taper_deg: Taper angle [deg].
        payload: Mass at the tip with its unit: 200g.
        gravity: down, up, sideways (along +x), none, or x,y,z [m/s²] in the world, whose +z points
            up; down if left out and there are loads.
        tip_force: Force on the tip in the world, x,y,z [N]: 0,0,-0.5 or 0,0,-500mN.
        point: Marker that counts as the tip, such as that of a tool.
        settings: PATH=VALUE of any parameter, as softreach list parameters DESIGN names them:
            left.offset_deg=30, or with the unit in the value, left.offset=30deg. May be repeated.
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

    def applied_to(self, arm: Manipulator) -> Manipulator:
        """The changed design.

        Parameters of the body and of actuators come first, then loads, for which these may have
        given moduli and densities.

        Raises:
            InvalidInput: An option that cannot be read, an unknown parameter, or loads on an arm
                without moduli or densities.
            InvalidDesign: No such arm can exist.
        """
        from softreach.arm.parameters import changed

        pairs = pairs_in("set", self.settings, "PATH=VALUE, such as taper=2deg") or {}
        of_loads = {name: text for name, text in pairs.items() if name.startswith("loads.")}
        others = {name: text for name, text in pairs.items() if name not in of_loads}
        arm = self._posed(arm)
        arm = changed(arm, _values(arm, others, self._angles()))
        if of_loads or {"payload", "gravity", "tip_force"} & self.given.keys():
            arm = self._loaded(arm, bool(of_loads))
            arm = changed(arm, _values(arm, of_loads))
        return arm.at_point(self.point)

    def _posed(self, arm: Manipulator) -> Manipulator:
        from softreach.arm.base import POINTS

        if self.base is None:
            return arm
        points = _POSTURES.get(self.base, self.base)
        if points not in POINTS:
            raise InvalidInput("base", self.base, f"one of {', '.join([*_POSTURES, *POINTS])}")
        return arm.replace(base=arm.base.replace(points=points))

    def _angles(self) -> dict[str, float]:
        from softreach.arm.written import from_written

        angles = {"revolution": self.revolution_deg, "taper": self.taper_deg}
        return {name: from_written(x, "rad") for name, x in angles.items() if x is not None}

    def _loaded(self, arm: Manipulator, others: bool) -> Manipulator:
        """The arm with the loads it has and those given; none where all are zero and stay so."""
        from softreach.arm.loads import GRAVITIES, Loads

        loads = (arm.loads or Loads()).replace(**self._loads(arm))
        if not others and loads == Loads(gravity=GRAVITIES["none"]):
            return arm.replace(loads=None)
        self._check_matter(loads, arm)
        return arm.replace(loads=loads)

    def _check_matter(self, loads: Loads, arm: Manipulator) -> None:
        examples = {"young_modulus": "1MPa", "density": "1000kg/m3"}
        faults = loads.section_faults(arm.section, arm.length)
        lacking = {fault.path: examples.get(fault.path.rpartition(".")[2]) for fault in faults}
        lacking = {path: example for path, example in lacking.items() if example}
        if lacking:
            idle = ("base", "revolution_deg", "taper_deg", "point")  # which ask for no matter
            values = {name: str(value) for name, value in self.given.items() if name not in idle}
            options = " ".join(f"--set {path}={example}" for path, example in lacking.items())
            hint = f"give them in the design file, or as {options}"
            if examples["density"] in lacking.values():
                hint += " (no density is needed with --gravity none)"
            allowed = f"on an arm with {' and '.join(lacking)}"
            raise InvalidInput(", ".join(values), ", ".join(values.values()), allowed, hint)

    def _loads(self, arm: Manipulator) -> dict[str, object]:
        loads: dict[str, object] = {}
        if self.payload is not None:
            loads["payload"] = read_mass("payload", self.payload)
        if self.gravity is not None:
            loads["gravity"] = _gravity(self.gravity, arm)
        if self.tip_force is not None:
            loads["tip_force"] = _vector("tip_force", self.tip_force, "N")
        return loads


def _gravity(text: str, arm: Manipulator) -> tuple[float, ...]:
    """Gravity in the world [m/s²]; words for how the arm stands are for an upright base only."""
    from softreach.arm.loads import GRAVITIES

    allowed = f"{', '.join(GRAVITIES)}, or "
    if text in _POSTURES:
        if not arm.base.is_identity:
            allowed += "three finite numbers x,y,z in m/s², in the world"
            hint = f"how the arm stands is said by its base, which {arm.base}"
            raise InvalidInput("gravity", text, allowed, hint)
        text = {"upright": "down", "hanging": "up"}[text]
    return GRAVITIES.get(text) or _vector("gravity", text, "m/s²", allowed)


UNCHANGED = Changes()


def design_from(text: str, changes: Changes = UNCHANGED) -> Manipulator:
    """The design of that name or file, changed as asked.

    Raises:
        InvalidInput: There is no such design.
        InvalidDesign: No such arm can exist; in the terms of files.
    """
    from softreach.arm import design_file
    from softreach.arm.tables import check_extension

    arm = _unchanged(text)
    try:
        changed = changes.applied_to(arm)
        check_extension(changed)
        say_limits(changed)
        return changed
    except InvalidDesign as error:
        one_option = len(error.faults) == 1 and changes.given
        raise design_file.in_file_terms(error, "" if one_option else text) from None


def say_limits(arm: Manipulator) -> None:
    """Warn where the design leaves what the linear law covers."""
    from softreach.arm.lines import law_warning

    if text := law_warning(arm):
        warn(text)


_POINTS = (".csv", ".txt", ".xyz", ".npy", ".npz", ".parquet", ".mat", ".ply", ".stl", ".obj")
"""Suffixes of points, surfaces and tables, which are no designs."""


def _unchanged(text: str) -> Manipulator:
    from softreach.arm import designs
    from softreach.arm.manipulator import Manipulator

    if text in designs.__all__:
        return getattr(designs, text)()
    path = Path(text)
    if path.suffix.lower() in _POINTS:
        allowed = "a .toml file, a built-in design, or a .zarr cloud where a command takes one"
        hint = "for the volume of points of your own: softreach.concave_hull(points, alpha=0.05)"
        raise InvalidInput(
            "design", text, allowed, f"{hint} in Python, points in m of shape (n, 3)"
        )
    is_named = (
        path.exists() and not path.is_dir() and not (path.suffix == ".json" and path.is_file())
    )
    if is_named or path.suffix == ".toml":
        return Manipulator.load(text)  # which refuses what is no file, such as a pipe
    if text.endswith(".json"):
        hint = f"softreach import {text} {text[:-5]}.toml makes one of a filament"
    else:
        hint = did_you_mean(text, designs.__all__)
    allowed = f"a .toml file, or one of {', '.join(designs.__all__)}"
    raise InvalidInput("design", text, allowed, hint)


def read_mass(name: str, text: str) -> float:
    """A mass [kg] that was written with its unit.

    Raises:
        InvalidInput: Anything else.
    """
    from softreach.support.quantity import read_quantity, unit_names

    try:
        mass = read_quantity(text, "kg")
    except ValueError:
        mass = -1.0
    if mass < 0:
        units = ", ".join(unit_names("kg"))
        raise InvalidInput(name, text, f"a mass >= 0 with its unit ({units}), such as 200g")
    return mass


def _vector(name: str, text: str, unit: str, others: str = "") -> tuple[float, ...]:
    """Three numbers x,y,z, in the SI unit if none follows the last."""
    from softreach.support.quantity import read_quantity, unit_names

    names = unit_names(unit)
    written = max(
        (suffix for suffix in names if text.rstrip().endswith(suffix)), key=len, default=""
    )
    parts = text.rstrip().removesuffix(written).split(",")
    try:
        values = tuple(read_quantity(f"{part}{written or names[0]}", unit) for part in parts)
    except ValueError:
        values = ()
    if len(values) != 3:
        allowed = f"{others}three finite numbers x,y,z in {unit} ({', '.join(names)})"
        raise InvalidInput(name, text, allowed)
    return values


def _values(
    arm: Manipulator, texts: Mapping[str, str], angles: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float]:
    """Name of a parameter -> value in its unit, from what was written, and from angles."""
    from softreach.arm.parameters import find_parameter
    from softreach.arm.written import Written

    values = dict(angles)
    if not texts:
        return values
    names = Written.of(arm)
    for key, text in texts.items():
        name = key if key in names.by_key else find_parameter(arm, key).name
        parameter = names.by_key[name]
        if parameter.name in values:
            raise InvalidInput("set", key, "given once, under one of its names")
        try:
            values[parameter.name] = names.number(name, text)
        except ValueError:
            raise InvalidInput(key, text, names.allowed(name)) from None
    return values
