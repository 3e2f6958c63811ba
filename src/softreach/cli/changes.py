"""Options that change a design before it is asked: angles, loads, any parameter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.numbers import NUMBER
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.loads import Loads
    from softreach.arm.manipulator import Manipulator
    from softreach.arm.parameters.parameter import Parameter as DesignParameter

__all__ = ["UNCHANGED", "Changes", "read_mass"]

_GRAVITY = {
    "down": (0.0, 0.0, -9.81),
    "upright": (0.0, 0.0, -9.81),
    "up": (0.0, 0.0, 9.81),
    "hanging": (0.0, 0.0, 9.81),
    "sideways": (9.81, 0.0, 0.0),
    "none": (0.0, 0.0, 0.0),
}
"""In the base frame, where an arm at rest points along +z."""


@Parameter(name="*", group="Changes of the design")
@dataclass(frozen=True, kw_only=True)
class Changes:
    """What a command changes of the design that it takes."""

    revolution_deg: Annotated[
        float | None,
        NUMBER,
        Parameter(help="Give every helical fiber this revolution [deg], each in its own sense."),
    ] = None
    taper_deg: Annotated[
        float | None, NUMBER, Parameter(help="Use this taper angle instead [deg].")
    ] = None
    payload: Annotated[
        str | None,
        Parameter(
            help="Mass at the tip with its unit (g, kg, mg): 200g. Gravity is down unless given.",
            allow_leading_hyphen=True,
        ),
    ] = None
    gravity: Annotated[
        str | None,
        Parameter(
            help="Gravity in the base frame, where the arm at rest points along +z: down "
            "(or upright: the arm stands on its base, 0,0,-9.81), up (or hanging: it hangs from "
            "its base, 0,0,9.81), sideways (9.81,0,0), none, or x,y,z [m/s²].",
            allow_leading_hyphen=True,
        ),
    ] = None
    tip_force: Annotated[
        str | None,
        Parameter(
            help="Force on the tip in the base frame, x,y,z [N]: 0,0,-0.5 or 0,0,-500mN.",
            allow_leading_hyphen=True,
        ),
    ] = None
    settings: Annotated[
        list[str] | None,
        Parameter(
            name="--set",
            negative="",
            help="PATH=VALUE of any parameter, as in atlases; the unit stands in the value or in "
            "the name: rings[0].material.young_modulus=1MPa, left.offset_deg=30, "
            "loads.payload_kg=0.2. May be repeated.",
        ),
    ] = None

    @property
    def given(self) -> dict[str, object]:
        """The options that were given, by their names."""
        every = {
            "revolution_deg": self.revolution_deg,
            "taper_deg": self.taper_deg,
            "payload": self.payload,
            "gravity": self.gravity,
            "tip_force": self.tip_force,
            "set": ", ".join(self.settings) if self.settings else None,
        }
        return {name: value for name, value in every.items() if value is not None}

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

        pairs = dict(self._pairs())
        of_loads = {name: text for name, text in pairs.items() if name.startswith("loads.")}
        others = {name: text for name, text in pairs.items() if name not in of_loads}
        arm = changed(arm, _values(arm, others, self._angles()))
        if of_loads or {"payload", "gravity", "tip_force"} & self.given.keys():
            arm = self._loaded(arm, bool(of_loads))
            arm = changed(arm, _values(arm, of_loads))
        return arm

    def refuse(self, why: str) -> None:
        """Refuse whatever was given, where there is no design to change."""
        for name, value in self.given.items():
            raise InvalidInput(name, value, why)

    def _angles(self) -> dict[str, float]:
        angles = {"revolution": self.revolution_deg, "taper": self.taper_deg}
        return {name: math.radians(deg) for name, deg in angles.items() if deg is not None}

    def _pairs(self) -> Iterator[tuple[str, str]]:
        """Name and value of every setting; the name of an actuator may hold another =."""
        named: set[str] = set()
        for text in self.settings or ():
            name, sign, value = (part.strip() for part in text.rpartition("="))
            if not sign or not name or not value:
                raise InvalidInput("set", text, "PATH=VALUE, such as taper=2deg")
            if name in named:
                raise _given_twice(name)
            named.add(name)
            yield name, value

    def _loaded(self, arm: Manipulator, others: bool) -> Manipulator:
        """The arm with the loads that it has and those that are given; none where all are zero.

        Args:
            arm: The arm.
            others: Whether settings change more of its loads.
        """
        from softreach.arm.loads import Loads

        loads = (arm.loads or Loads()).replace(**self._loads())
        if not others and loads == Loads(gravity=_GRAVITY["none"]):
            return arm.replace(loads=None)
        self._check_matter(loads, arm)
        return arm.replace(loads=loads)

    def _check_matter(self, loads: Loads, arm: Manipulator) -> None:
        """Ask in one line for the moduli and densities that loads need."""
        lacking = [
            fault.path
            for fault in loads.section_faults(arm.section, arm.length)
            if fault.path.endswith(("young_modulus", "density"))
        ]
        if lacking:
            given = {name: value for name, value in self.given.items() if "_deg" not in name}
            examples = {"young_modulus": "1MPa", "density": "1000kg/m3"}
            options = (f"--set {path}={examples[path.rpartition('.')[2]]}" for path in lacking)
            weightless = any(path.endswith("density") for path in lacking)
            raise InvalidInput(
                ", ".join(given),
                ", ".join(map(str, given.values())),
                f"on an arm with {' and '.join(lacking)}",
                f"give them in the design file, or as {' '.join(options)}"
                + (" (no density is needed with --gravity none)" if weightless else ""),
            )

    def _loads(self) -> dict[str, object]:
        found: dict[str, object] = {}
        if self.payload is not None:
            found["payload"] = read_mass("payload", self.payload)
        if self.gravity is not None:
            found["gravity"] = _GRAVITY.get(self.gravity) or _triple(
                "gravity", self.gravity, "m/s²", f"{', '.join(_GRAVITY)}, or "
            )
        if self.tip_force is not None:
            found["tip_force"] = _triple("tip_force", self.tip_force, "N")
        return found


UNCHANGED = Changes()


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


def _triple(name: str, text: str, unit: str, others: str = "") -> tuple[float, ...]:
    """Three numbers, in the SI unit if none follows them."""
    from softreach.support.quantity import read_quantity, unit_names

    *first, last = text.split(",")
    try:
        z, written = _number_and_unit(last, unit)
        values = [*(read_quantity(f"{one}{written}", unit) for one in first), z]
    except ValueError:
        values = []
    if len(values) != 3:
        units = ", ".join(unit_names(unit))
        raise InvalidInput(name, text, f"{others}three finite numbers x,y,z in {unit} ({units})")
    return tuple(values)


def _number_and_unit(text: str, unit: str) -> tuple[float, str]:
    """The value of the last of three numbers, and the unit that follows all of them."""
    from softreach.support.quantity import read_quantity, unit_names

    plain = text.strip()
    written = next(
        (one for one in sorted(unit_names(unit), key=len, reverse=True) if plain.endswith(one)),
        "",
    )
    shown = written or unit_names(unit)[0]
    return read_quantity(plain.removesuffix(written) + shown, unit), shown


def _values(
    arm: Manipulator, texts: Mapping[str, str], angles: Mapping[str, float] = MappingProxyType({})
) -> dict[str, float]:
    """Name of a parameter -> value in its unit, from what was written, and from angles."""
    from softreach.arm.parameters.changes import find_parameter, parameters_by_every_name
    from softreach.arm.parameters.shown import written_parameters

    found = dict(angles)
    if not texts:
        return found
    plain, written = parameters_by_every_name(arm), written_parameters(arm)
    for name, text in texts.items():
        parameter = plain.get(name) or written.get(name) or find_parameter(arm, name)
        if parameter.name in found:
            raise _given_twice(name)
        read = _of_value if name in plain else _of_name
        found[parameter.name] = read(parameter, name, text)
    return found


def _given_twice(name: str) -> InvalidInput:
    return InvalidInput("set", name, "given once, under one of its names")


def _of_value(parameter: DesignParameter, name: str, text: str) -> float:
    """A value with its unit."""
    from softreach.arm.parameters.shown import written_name
    from softreach.support.quantity import read_quantity, unit_names

    try:
        return read_quantity(text, parameter.unit)
    except ValueError:
        pass
    units = ", ".join(unit_names(parameter.unit))
    if not units:
        raise InvalidInput(name, text, "a finite number without a unit")
    allowed = f"a finite number with its unit ({units})"
    in_name = written_name(name, parameter.unit)
    raise InvalidInput(name, text, allowed, f"or set {in_name} to a number")


def _of_name(parameter: DesignParameter, name: str, text: str) -> float:
    """A value whose unit the name holds."""
    from softreach.arm.parameters.shown import from_written
    from softreach.support.quantity import read_quantity

    try:
        return from_written(read_quantity(text, "1"), parameter.unit)
    except ValueError:
        allowed = "a finite number without a unit, which the name holds"
        raise InvalidInput(name, text, allowed) from None
