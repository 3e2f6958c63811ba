"""Tables of the body of an arm: its profile, materials, section and rings."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, Tag

from softreach.arm.file.along import either
from softreach.arm.file.quantities import Quantity
from softreach.arm.file.table import Table
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.sampled_profiles import PiecewiseTaper, SampledTaper
from softreach.arm.section import Ring, Section

__all__ = [
    "PROFILES",
    "InlineMaterial",
    "LinearTable",
    "MaterialTable",
    "PiecewiseTable",
    "RingTable",
    "SampledTable",
    "SectionTable",
]


class LinearTable(Table):
    """A cone or a cylinder."""

    kind: Literal["linear"] = "linear"
    length: Annotated[float, Quantity.of(LinearTaper, "length")] = Field(
        alias="length_m", examples=[1.0]
    )
    outer_radius: Annotated[float, Quantity.of(LinearTaper, "outer_radius")] = Field(
        alias="outer_radius_m", examples=[0.0625]
    )
    taper: Annotated[float, Quantity.of(LinearTaper, "taper")] = Field(
        default=0.0, alias="taper_deg"
    )

    def made(self) -> Profile:
        """The profile."""
        return LinearTaper(**self.values_but("kind"))


class PiecewiseTable(Table):
    """Cones and cylinders one after the other."""

    kind: Literal["piecewise"]
    length: Annotated[float, Quantity.of(PiecewiseTaper, "length")] = Field(
        alias="length_m", examples=[1.0]
    )
    stations_over_length: list[float] = Field(
        examples=[[0.0, 1.0]], description="Z/L of the radii, rising from 0 to 1 [-]"
    )
    radii: list[float] = Field(
        alias="radii_m", examples=[[0.0625, 0.0625]], description="R2 at the stations [m]"
    )

    def made(self) -> Profile:
        """The profile."""
        return PiecewiseTaper(**self.values_but("kind"))


class SampledTable(PiecewiseTable):
    """The monotone cubic through samples of the radius."""

    kind: Literal["sampled"]  # pyright: ignore[reportIncompatibleVariableOverride]

    def made(self) -> Profile:
        """The profile."""
        return SampledTaper(**self.values_but("kind"))


PROFILES: dict[str, type[LinearTable | PiecewiseTable]] = {
    "linear": LinearTable,
    "piecewise": PiecewiseTable,
    "sampled": SampledTable,
}
"""Tables of profiles by their kind."""


class MaterialTable(Table):
    """A material; no Young's modulus where it cancels, no density where nothing weighs."""

    young_modulus: Annotated[float, Quantity.of(Material, "young_modulus")] | None = Field(
        default=None, alias="young_modulus_pa"
    )
    poisson_ratio: Annotated[float, Quantity.of(Material, "poisson_ratio")] = 0.5
    density: Annotated[float, Quantity.of(Material, "density")] | None = Field(
        default=None, alias="density_kg_m3"
    )

    def made(self, name: str = "") -> Material:
        """The material."""
        return Material(**{"name": name, **self.values_but()})


class InlineMaterial(MaterialTable):
    """A material where it is used."""

    name: str = ""


MaterialOrName = Annotated[
    Annotated[str, Tag("<plain>")] | Annotated[InlineMaterial, Tag("<table>")], either
]


class RingTable(Table):
    """A layer between two radii."""

    name: str = Field(default="", description="What actuators and pictures call it")
    inner_ratio: Annotated[float, Quantity.of(Ring, "inner_ratio")] = Field(examples=[0.75])
    outer_ratio: Annotated[float, Quantity.of(Ring, "outer_ratio")] = 1.0
    material: MaterialOrName | None = Field(
        default=None, description="Name of a material of this file or of the library, or its values"
    )

    def made(self, material: Material) -> Ring:
        """The ring, of this material."""
        return Ring(**self.values_but("material"), material=material)


class SectionTable(Table):
    """The inside of the arm."""

    core: MaterialOrName | None = Field(
        default=None,
        description="What fills the inside: a name, or values; else the innermost ring's",
    )
    bore_ratio: Annotated[float, Quantity.of(Section, "bore_ratio")] = 0.0

    def made(self, rings: tuple[Ring, ...], core: Material | None) -> Section:
        """The section."""
        return Section(rings=rings, core=core, bore_ratio=self.bore_ratio)
