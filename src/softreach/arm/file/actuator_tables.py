"""Tables [[actuators]]: one for each kind."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, Tag

from softreach.arm.actuators import (
    Actuator,
    Chamber,
    FiberArchitecture,
    ObliqueMuscle,
    RadialMuscle,
    Tendon,
)
from softreach.arm.file.along import AngleAlong, DistanceAlong, RoutingAlong, either
from softreach.arm.file.quantities import Bounds, Quantity, RingName
from softreach.arm.file.table import Table
from softreach.support.errors import Range

__all__ = ["ACTUATORS", "ActuatorTable", "kind_of"]

_ABOVE_0 = Range(0.0, open_low=True)
_BOUNDS = "(lower, upper) for all bundles, or one such pair for each"


class ActuatorTable(Table):
    """What all kinds share."""

    makes: ClassVar[type[Actuator]]
    """What it describes."""

    name: str = Field(default="", description="What results and pictures call it")
    bundles: Annotated[int, Quantity.of(FiberArchitecture, "bundles")] = 1
    start_over_length: Annotated[float, Quantity.of(FiberArchitecture, "start_over_length")] = 0.0
    end_over_length: Annotated[float, Quantity.of(FiberArchitecture, "end_over_length")] = 1.0

    def made(self) -> Actuator:
        """The actuator."""
        return self.makes(**self.values_but("kind"))


class _SectorTable(ActuatorTable):
    """Bundles that fill sectors of a ring."""

    ring: RingName = Field(default=0, description="Index or name of the ring that it is in")
    offset: Annotated[float, Quantity.of(FiberArchitecture, "offset")] = Field(
        default=0.0, alias="offset_deg"
    )
    extent: Annotated[float, Quantity.of(FiberArchitecture, "extent")] = Field(
        alias="extent_deg", examples=[48.0]
    )
    activation_bounds: Bounds = Field(
        default=[-5 / 3, 0.0], description=f"Activation [-], γ < 0 contracts: {_BOUNDS}"
    )


class FiberTable(_SectorTable):
    """A family of fibers; give exactly one of `helical_angle_deg` and `revolution_deg`."""

    makes = FiberArchitecture
    kind: Literal["fiber"]
    helical_angle: (
        Annotated[
            Annotated[float, Quantity.of(FiberArchitecture, "helical_angle"), Tag("<plain>")]
            | Annotated[AngleAlong, Tag("<table>")],
            either,
        ]
        | None
    ) = Field(
        default=None,
        alias="helical_angle_deg",
        description="α: helical angle at the outer radius of the ring, constant or along [deg]",
    )
    revolution: Annotated[float, Quantity.of(FiberArchitecture, "revolution")] | None = Field(
        default=None, alias="revolution_deg"
    )


class ObliqueTable(_SectorTable):
    """A muscle whose fibers run at an angle across a sector that does not wind."""

    makes = ObliqueMuscle
    kind: Literal["oblique_muscle"]
    helical_angle: Annotated[float, Quantity.of(ObliqueMuscle, "helical_angle")] = Field(
        alias="helical_angle_deg", examples=[30.0]
    )


class RadialTable(_SectorTable):
    """A muscle along the radius."""

    makes = RadialMuscle
    kind: Literal["radial_muscle"]


class TendonTable(ActuatorTable):
    """Tendons; give exactly one of `distance_m` and `distance_ratio`."""

    makes = Tendon
    kind: Literal["tendon"]
    distance: (
        Annotated[
            Annotated[float, Quantity.of(Tendon, "distance"), Tag("<plain>")]
            | Annotated[DistanceAlong, Tag("<table>")],
            either,
        ]
        | None
    ) = Field(
        default=None,
        alias="distance_m",
        description="ρt: distance from the axis, constant or along [m]",
    )
    distance_ratio: Annotated[float, Quantity.of(Tendon, "distance_ratio")] | None = None
    offset: Annotated[float, Quantity.of(Tendon, "offset")] = Field(default=0.0, alias="offset_deg")
    revolution: Annotated[float, Quantity.of(Tendon, "revolution")] = Field(
        default=0.0, alias="revolution_deg"
    )
    routing: RoutingAlong | None = Field(
        default=None,
        alias="routing_deg",
        description="Polar angle along the arm from offset_deg, in place of an even revolution",
    )
    activation_bounds: Bounds = Field(
        alias="tension_bounds_n", examples=[[0.0, 1.0]], description=f"Tension [N]: {_BOUNDS}"
    )


class ChamberTable(ActuatorTable):
    """Pressure chambers; of distance and radius, give each as a length or as a ratio to R2."""

    makes = Chamber
    kind: Literal["chamber"]
    distance: Annotated[float, Quantity.of(Chamber, "distance")] | None = Field(
        default=None, alias="distance_m"
    )
    distance_ratio: Annotated[float, Quantity.of(Chamber, "distance_ratio")] | None = None
    radius: Annotated[float, Quantity.of(Chamber, "radius")] | None = Field(
        default=None, alias="radius_m"
    )
    radius_ratio: Annotated[float, Quantity.of(Chamber, "radius_ratio", _ABOVE_0)] | None = None
    area_factor: Annotated[float, Quantity.of(Chamber, "area_factor")] = 1.0
    offset: Annotated[float, Quantity.of(Chamber, "offset")] = Field(
        default=0.0, alias="offset_deg"
    )
    activation_bounds: Bounds = Field(
        alias="pressure_bounds_pa", examples=[[0.0, 1.0]], description=f"Pressure [Pa]: {_BOUNDS}"
    )


ACTUATORS: dict[str, type[ActuatorTable]] = {
    "fiber": FiberTable,
    "oblique_muscle": ObliqueTable,
    "radial_muscle": RadialTable,
    "tendon": TendonTable,
    "chamber": ChamberTable,
}
"""Tables of actuators by their kind."""


def kind_of(actuator: Actuator) -> str | None:
    """The kind that files know it by; None for one defined outside softreach."""
    return next((kind for kind, one in ACTUATORS.items() if one.makes is type(actuator)), None)
