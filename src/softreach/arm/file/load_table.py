"""The table of what acts on an arm beside its actuators."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from softreach.arm.file.quantities import Quantity
from softreach.arm.file.table import Table
from softreach.arm.loads import Loads, PointLoad
from softreach.support.errors import Range

__all__ = ["LoadTable", "PointLoadTable"]

Triple = Annotated[list[float], Field(min_length=3, max_length=3)]

_ZERO = [0.0, 0.0, 0.0]


class PointLoadTable(Table):
    """A force and a moment on one section, in the base frame."""

    station: Annotated[float, Quantity(Range(0.0, unit="m"), "Z: where they act [m]")] = Field(
        alias="station_m", examples=[0.0]
    )
    force: Triple = Field(default=_ZERO, alias="force_n", description="[N]")
    moment: Triple = Field(default=_ZERO, alias="moment_n_m", description="[N m]")

    def value(self) -> PointLoad:
        """The load."""
        return PointLoad(**self.values_but())


class LoadTable(Table):
    """Gravity, a payload, forces and moments; in the base frame unless they follow the tip."""

    gravity: Triple = Field(
        default=[0.0, 0.0, -9.81],
        alias="gravity_m_s2",
        description="Acceleration of what falls [m/s²]; the arm at rest points along +z",
    )
    payload: Annotated[float, Quantity.of(Loads, "payload")] = Field(
        default=0.0, alias="payload_kg"
    )
    payload_arm: Triple = Field(
        default=_ZERO,
        alias="payload_arm_m",
        description="From the tip to the center of the payload, in the directors of the tip [m]",
    )
    tip_force: Triple = Field(default=_ZERO, alias="tip_force_n", description="[N]")
    tip_moment: Triple = Field(default=_ZERO, alias="tip_moment_n_m", description="[N m]")
    follower_force: Triple = Field(
        default=_ZERO, alias="follower_force_n", description="In the directors of the tip [N]"
    )
    follower_moment: Triple = Field(
        default=_ZERO, alias="follower_moment_n_m", description="In the directors of the tip [N m]"
    )
    force_per_length: Triple = Field(
        default=_ZERO, alias="force_per_length_n_per_m", description="Beside weight [N/m]"
    )
    point_loads: list[PointLoadTable] = Field(
        default=[], description="Forces and moments anywhere along the arm"
    )

    def made(self) -> Loads:
        """The loads."""
        points = tuple(one.value() for one in self.point_loads)
        return Loads(**self.values_but("point_loads"), point_loads=points)
