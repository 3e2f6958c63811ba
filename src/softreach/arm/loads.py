"""What acts on an arm beside its actuators."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, ClassVar, Self

from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.arrays import as_floats
from softreach.support.errors import Fault, InvalidDesign, Range

if TYPE_CHECKING:
    from softreach.arm.section import Section

__all__ = ["Loads", "PointLoad"]

Triple = tuple[float, float, float]

_ZERO: Triple = (0.0, 0.0, 0.0)

_SIZE = Range(-1e30, 1e30)  # of any number: products stay far from where doubles end


@dataclass(frozen=True, kw_only=True)
class PointLoad:
    """A force and a moment on one section, in the base frame whatever the arm does.

    Raises:
        InvalidDesign: A field is not what it must be.
    """

    station: float
    """Z [m]."""
    force: Triple = _ZERO
    """[N]."""
    moment: Triple = _ZERO
    """[N m]."""

    def __post_init__(self) -> None:
        _check(self, scalars={"station": "a finite number of meters, at least 0"})


@dataclass(frozen=True, kw_only=True)
class Loads:
    """Gravity, a payload, forces and moments; in the base frame unless they follow the tip.

    Raises:
        InvalidDesign: A field is not what it must be.
    """

    variables: ClassVar[tuple[Variable, ...]] = (
        Variable("payload", "mp", "mass at the tip", Range(0.0, unit="kg")),
    )
    series: ClassVar[tuple[Variable, ...]] = (
        Variable("gravity", "g", "acceleration of what falls", Range(unit="m/s²")),
        Variable("payload_arm", "a", "lever arm of the payload", Range(unit="m")),
        Variable("tip_force", "F", "force on the tip", Range(unit="N")),
        Variable("tip_moment", "M", "moment on the tip", Range(unit="N m")),
        Variable("follower_force", "F'", "force that follows the tip", Range(unit="N")),
        Variable("follower_moment", "M'", "moment that follows the tip", Range(unit="N m")),
        Variable("force_per_length", "f", "force per length", Range(unit="N/m")),
    )

    gravity: Triple = (0.0, 0.0, -9.81)
    """Acceleration of what falls [m/s²]; the base tangent is +z, so that an arm whose base points
    up has -z here."""
    payload: float = 0.0
    """Mass at the tip [kg]."""
    payload_arm: Triple = _ZERO
    """From the tip to the center of the payload, in the directors of the tip [m]."""
    tip_force: Triple = _ZERO
    """[N]."""
    tip_moment: Triple = _ZERO
    """[N m]."""
    follower_force: Triple = _ZERO
    """On the tip, in its directors [N]."""
    follower_moment: Triple = _ZERO
    """On the tip, in its directors [N m]."""
    point_loads: tuple[PointLoad, ...] = ()
    """Forces and moments anywhere along the arm."""
    force_per_length: Triple = _ZERO
    """Beside weight, per length before activation [N/m]."""

    def __post_init__(self) -> None:
        _check(self, scalars={"payload": "a finite mass, at least 0 kg"})
        points = self.point_loads
        if not isinstance(points, tuple | list) or not all(
            isinstance(one, PointLoad) for one in points
        ):
            raise InvalidDesign([Fault("point_loads", points, "must be PointLoads")])
        object.__setattr__(self, "point_loads", tuple(points))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return replace(self, **changes)

    def section_faults(self, section: Section, length: float) -> list[Fault]:
        """What keeps them from acting on an arm: moduli, densities, places off the arm."""
        faults = section.modulus_faults("where loads act")
        if any(self.gravity):
            faults += section.density_faults("where weight counts")
        allowed = f"must be on the arm, at most {length:g} m"
        return faults + [
            Fault(f"loads.point_loads[{k}].station", one.station, allowed)
            for k, one in enumerate(self.point_loads)
            if one.station > length
        ]

    @property
    def conservative(self) -> bool:
        """Whether the loads have a potential, so that stable means of least energy."""
        moments = (self.tip_moment, *(one.moment for one in self.point_loads))
        return not any(map(any, (self.follower_force, self.follower_moment, *moments)))


def _check(loads: Loads | PointLoad, scalars: dict[str, str]) -> None:
    faults = []
    for field in fields(loads):
        value = getattr(loads, field.name)
        if field.name == "point_loads":
            continue
        if field.name in scalars:
            if not _is_number(value) or value < 0:
                faults.append(Fault(field.name, value, f"must be {scalars[field.name]}"))
                continue
            object.__setattr__(loads, field.name, float(value))
            continue
        triple = _triple(value)
        if triple is None:
            faults.append(
                Fault(field.name, value, "must be three finite numbers from -1e+30 to 1e+30")
            )
            continue
        object.__setattr__(loads, field.name, triple)
    if faults:
        raise InvalidDesign(faults)


def _is_number(value: Any) -> bool:
    return _SIZE.admits(plain(value))


def _triple(value: Any) -> Triple | None:
    try:
        x, y, z = as_floats("triple", value).tolist()
    except (TypeError, ValueError):
        return None
    return (x, y, z) if all(map(_is_number, (x, y, z))) else None
