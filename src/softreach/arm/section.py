"""The cross-section: a core and rings of materials, and how stiff and heavy they make it.

What a laboratory measured on the arm itself takes the place of what follows from materials.
"""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.number import is_path_name, number
from softreach.arm.part import AlongArm, Part, values_along
from softreach.support.arguments import as_text
from softreach.support.arrays import Array
from softreach.support.errors import Fault, InvalidDesign, InvalidInput
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    from softreach.arm.profile import Profile

LIBRARY_HINT = (
    "the page Materials of the guide lists them, and so does softreach.arm.material_names()"
)
"""Places where the names of materials are listed."""


@dataclass(frozen=True, kw_only=True)
class Material(Part):
    """An isotropic elastic material.

    While one material fills an arm that only fibers and muscles drive, Young's modulus cancels from
    its shapes and may be left out. Density is needed for weight alone.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    young_modulus: float | None = number("E", "Pa", "Young's modulus", above=0.0, default=None)
    """E, Young's modulus [Pa]; None where it cancels."""
    poisson_ratio: float = number("ν", "", "Poisson's ratio", low=0.0, high=0.5, default=0.5)
    """ν, Poisson's ratio [-]."""
    density: float | None = number("ρ", "kg/m³", "density", low=0.0, default=None)
    """ρ, mass per volume [kg/m³]; 0 where only loads count, None where weight plays no part."""
    name: str = ""
    """Name in files and pictures."""

    @property
    def relative_modulus(self) -> float:
        """E [Pa], or 1 where it cancels and was left out."""
        return 1.0 if self.young_modulus is None else self.young_modulus

    def same_matter(self, other: Material) -> bool:
        """All but the names are equal."""
        return self == other or self.replace(name="") == other.replace(name="")


@dataclass(frozen=True)
class MaterialRecord:
    """A material of the library and where its numbers come from."""

    material: Material  # The material under its name
    modulus: str  # Kind of Young's modulus: `Young's modulus`, `stress at 100 % strain`, ...
    sources: Mapping[str, str]  # Field of a number -> heading of the page of references
    note: str  # Advice to a designer, in a line


def material_names() -> tuple[str, ...]:
    """The names of all materials of the library, from soft to stiff."""
    return tuple(_library())


def material_record(name: str) -> MaterialRecord:
    """A material of the library with the sources of its numbers; raises InvalidInput."""
    if name not in (library := _library()):
        hint = _hint(name, tuple(library))
        raise InvalidInput("material", name, "a material of the library", hint)
    return library[name]


def named_material(name: str) -> Material:
    """A material of the library.

    Args:
        name: One of `material_names()`, such as "ecoflex_00_30".

    Raises:
        InvalidInput: No material has this name.
    """
    return material_record(as_text("name", name)).material


def as_material(material: Any) -> Any:
    """The material of the library for its name; anything else as it is."""
    known = isinstance(material, str) and material in _library()
    return _library()[material].material if known else material


def material_faults(field: str, value: object, *, optional: bool = False) -> list[Fault]:
    """A fault for a field of a part that is no material and no name of one."""
    if isinstance(value, Material) or (optional and value is None):
        return []
    hint = f"; {_hint(value, material_names())}" if isinstance(value, str) else ""
    others = "the name of one of the library" + (", or None" if optional else "")
    return [Fault(field, value, f"must be a Material, or {others}{hint}")]


@cache
def _library() -> Mapping[str, MaterialRecord]:
    text = files("softreach.arm").joinpath("materials.toml").read_text(encoding="utf-8")
    records: list[MaterialRecord] = []
    for name, row in tomllib.loads(text).items():
        numbers = {
            "young_modulus": row["young_modulus_pa"],
            "poisson_ratio": row["poisson_ratio"],
            "density": row.get("density_kg_m3"),
        }
        sources = MappingProxyType(row["sources"])
        material = Material(**numbers, name=name)
        records.append(MaterialRecord(material, row["modulus"], sources, row["note"]))
    records.sort(key=lambda record: record.material.young_modulus or 0.0)
    return MappingProxyType({record.material.name: record for record in records})


def _hint(name: object, names: tuple[str, ...]) -> str:
    spelled = str(name).strip().lower().replace(" ", "_").replace("-", "_")
    close = difflib.get_close_matches(spelled, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else LIBRARY_HINT


@dataclass(frozen=True, kw_only=True)
class Measured(Part):
    """Measured numbers of the sections of an arm, in place of what follows from its materials.

    Each is a number for all of the arm, or a function along it; None follows from the materials.

    Raises:
        InvalidDesign: A number out of its range.
    """

    axial_stiffness: float | AlongArm | None = number(
        "K0", "N", "axial stiffness", above=0.0, along=AlongArm, default=None
    )
    """K0 [N]."""
    bending_stiffness: float | tuple[float, float] | AlongArm | None = number(
        "K1",
        "N m²",
        "bending stiffness",
        above=0.0,
        along=AlongArm,
        pair="two about d1 and d2",
        default=None,
    )
    """K1 = K2 [N m²], or (K1, K2) about d1 and d2, as of a flat strip."""
    angle: float = number("α", "rad", "angle of the axis of K1 from d1", default=0.0)
    """α, angle of the axes of K1 and K2 about d3, from d1 and d2 [rad]."""
    torsion_stiffness: float | AlongArm | None = number(
        "K3", "N m²", "torsional stiffness", above=0.0, along=AlongArm, default=None
    )
    """K3 [N m²]."""
    mass_per_length: float | AlongArm | None = number(
        "μ", "kg/m", "mass per length", low=0.0, along=AlongArm, default=None
    )
    """μ, before activation [kg/m]."""

    @property
    def stiffnesses(self) -> tuple[float | AlongArm | None, ...]:
        """K0 [N], K1 and K3 [N m²], each None where it was not measured."""
        bending = self.bending_stiffness
        first = bending[0] if isinstance(bending, tuple) else bending
        return self.axial_stiffness, first, self.torsion_stiffness


@dataclass(frozen=True, kw_only=True)
class Ring(Part):
    """A layer between two radii; they keep their ratio to R2(Z).

    Raises:
        InvalidDesign: No ring is left between the ratios.
    """

    inner_ratio: float = number("R1/R2", "", "inner radius over R2", low=0.0, below=1.0)
    """R1/R2, inner radius of the ring over the outer radius of the arm [-]."""
    outer_ratio: float = number(
        "R/R2", "", "outer radius over R2", above=0.0, high=1.0, default=1.0
    )
    """Outer radius of the ring over the outer radius of the arm [-]."""
    material: Material = field(default_factory=Material)
    """Material of the ring, or the name of one of the library."""
    name: str = ""
    """Name in actuators, files and pictures."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "material", as_material(self.material))
        super().__post_init__()

    @property
    def radius_ratio(self) -> float:
        """ρ, inner over outer radius of the ring itself [-]."""
        return self.inner_ratio / self.outer_ratio

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        if not faults and self.inner_ratio >= self.outer_ratio:
            allowed = f"must be below outer_ratio = {self.outer_ratio:g}"
            faults = [Fault("inner_ratio", self.inner_ratio, allowed)]
        return faults + material_faults("material", self.material)


class Layer(NamedTuple):
    """One part of the section."""

    inner_ratio: float
    """Inner radius over R2 [-]."""
    outer_ratio: float
    """Outer radius over R2 [-]."""
    material: Material
    """Material of the layer."""


class Stiffness(NamedTuple):
    """Stiffness of sections, one value for each station.

    All are divided by Young's modulus where that was left out.
    """

    axial: Array
    """K0 [N]."""
    bending: Array
    """K1 = K2 [N m²]."""
    torsion: Array
    """K3 [N m²]."""


def turned(vectors: Array, angle: float) -> Array:
    """Components of vectors about the directors, (..., 3, n), after a turn about d3 [rad]."""
    if angle == 0.0:
        return vectors
    x, y, z = np.moveaxis(vectors, -2, 0)
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-2)


@dataclass(frozen=True, kw_only=True)
class Section(Part):
    """A core and rings around it, in proportion to R2(Z).

    Rings may overlap: each adds all of its stiffness. The core fills the arm from its bore to the
    innermost ring.

    Raises:
        InvalidDesign: No ring, none that reaches the surface of the arm, two of one name, a bore
            wider than the innermost ring, or different materials without Young's moduli.
    """

    rings: tuple[Ring, ...]
    """Layers that actuators live in, by index or name."""
    core: Material | None = None
    """Material inside, or the name of one of the library; None for that of the innermost ring."""
    bore_ratio: float = number(
        "R0/R2", "", "radius of the bore over R2", low=0.0, below=1.0, default=0.0
    )
    """Radius of the hole along the axis over R2 [-]; 0 for a solid core."""
    measured: Measured | None = None
    """Stiffnesses and mass per length that were measured; None for those of the materials."""

    def __post_init__(self) -> None:
        rings = tuple(self.rings) if isinstance(self.rings, tuple | list) else ()
        if not rings or not all(isinstance(ring, Ring) for ring in rings):
            raise InvalidDesign([Fault("section.rings", self.rings, "must hold one Ring or more")])
        object.__setattr__(self, "rings", rings)
        object.__setattr__(self, "core", as_material(self.core))
        faults = material_faults("section.core", self.core, optional=True)
        if not faults and not isinstance(self.measured, Measured | None):
            faults = [Fault("section.measured", self.measured, "must be Measured or None")]
        if faults:
            raise InvalidDesign(faults)
        super().__post_init__()

    def _faults(self) -> list[Fault]:
        faults = super()._faults() + list(name_faults([ring.name for ring in self.rings], "rings"))
        outer = [ring.outer_ratio for ring in self.rings]
        if (reach := max(outer)) != 1.0:
            allowed = "must be 1 for the outermost ring, which reaches the surface of the arm"
            faults.append(Fault(f"rings[{outer.index(reach)}].outer_ratio", reach, allowed))
        if not faults and self.bore_ratio > self.inner_ratio:
            allowed = f"must be at most the smallest inner_ratio of the rings, {self.inner_ratio:g}"
            faults.append(Fault("bore_ratio", self.bore_ratio, allowed))
        if faults or self.has_measured_stiffness:
            return faults or self.modulus_faults("where not all stiffnesses are measured")
        first, *others = (layer.material for layer in self.layers)
        same = all(first.same_matter(other) for other in others)
        return [] if same else self.modulus_faults("where materials differ")

    def ring(self, which: int | str) -> Ring:
        """A ring by its index or name.

        Raises:
            InvalidDesign: There is none.
        """
        return self.rings[self.ring_index(which)]

    def ring_index(self, which: int | str) -> int:
        """The index of a ring, from 0, by its index or name.

        Raises:
            InvalidDesign: There is none.
        """
        if isinstance(which, int) and 0 <= which < len(self.rings):
            return which
        names = [ring.name for ring in self.rings]
        if isinstance(which, str) and which in names:
            return names.index(which)
        known = ", ".join(f"{k} ({name})" if name else str(k) for k, name in enumerate(names))
        raise InvalidDesign([Fault("ring", which, f"must be one of the section's rings: {known}")])

    @property
    def inner_ratio(self) -> float:
        """Inner radius of the innermost ring over R2 [-]."""
        return min(ring.inner_ratio for ring in self.rings)

    @property
    def core_material(self) -> Material:
        """Material inside."""
        if self.core is not None:
            return self.core
        return min(self.rings, key=lambda ring: ring.inner_ratio).material

    @lazy
    def layers(self) -> tuple[Layer, ...]:
        """The core, if there is room for one, and the rings."""
        rings = [Layer(ring.inner_ratio, ring.outer_ratio, ring.material) for ring in self.rings]
        if self.inner_ratio <= self.bore_ratio:
            return tuple(rings)
        return (Layer(self.bore_ratio, self.inner_ratio, self.core_material), *rings)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Z/L inside (0, 1) where what was measured is not smooth [-]."""
        return () if self.measured is None else self.measured.breaks

    @property
    def has_measured_stiffness(self) -> bool:
        """A stiffness was measured, so that Young's modulus cancels no more."""
        return self.measured is not None and any(k is not None for k in self.measured.stiffnesses)

    def stiffness_at(self, profile: Profile, z: ArrayLike) -> Stiffness:
        """K0, K1 and K3 at stations Z [m] of an arm: what was measured, else by the materials."""
        stations = np.asarray(z, float)
        stiffness = self.stiffness(profile.radius(stations))
        if self.measured is None:
            return stiffness
        x = stations / profile.length
        pairs = zip(self.measured.stiffnesses, stiffness, strict=True)
        return Stiffness(*(own if k is None else values_along(k, x) for k, own in pairs))

    @property
    def bending_ratio(self) -> float:
        """K2/K1 [-]: 1 but for measured sections that are not round."""
        pair = None if self.measured is None else self.measured.bending_stiffness
        return pair[1] / pair[0] if isinstance(pair, tuple) else 1.0

    @property
    def bending_angle(self) -> float:
        """α, angle of the axes of K1 and K2 from d1 and d2 [rad]; 0 where K1 = K2."""
        return self.measured.angle if self.measured and self.bending_ratio != 1.0 else 0.0

    def resistance(self, stiffness: Stiffness) -> Array:
        """K1, K2 and K3 [N m²] about their axes by K1 and K3, one more axis of 3."""
        first, torsion = stiffness.bending, stiffness.torsion
        return np.stack([first, self.bending_ratio * first, torsion], axis=-1)

    def in_directors(self, values: Array) -> Array:
        """Tensors in the directors of values about the axes of K1 to K3, shape (..., 3, 3)."""
        angle = self.bending_angle
        half = np.swapaxes(turned(values[..., None] * np.eye(3), angle), -1, -2)
        return turned(half, angle)

    def mass_per_length_at(self, profile: Profile, z: ArrayLike) -> Array:
        """Mass per length [kg/m] at stations Z [m]: what was measured, else by the materials.

        Raises:
            InvalidDesign: Not measured, and a layer without a density.
        """
        if self.measured is not None and (mass := self.measured.mass_per_length) is not None:
            return values_along(mass, np.asarray(z, float) / profile.length)
        return self.mass_per_length(profile.radius(z))

    def gyration_at(self, profile: Profile, z: ArrayLike) -> Array:
        """Σ ρ I / Σ ρ A about a diameter [m²] at Z [m]; densities left out are those of water."""
        second, fourth = (self._sum(lambda each: each.density or 1000.0, n) for n in (2, 4))
        return 0.25 * fourth / second * profile.radius(z) ** 2

    def stiffness(self, radius: ArrayLike) -> Stiffness:
        """Stiffness that follows from the materials, theory (5).

        K0 = Σ πE(R2² - R1²), K1 = Σ (π/4)E(R2⁴ - R1⁴), K3 = Σ K1/(1 + ν).

        Args:
            radius: R2 [m].
        """
        outer, (axial, bending, torsion) = np.asarray(radius, float), self._relative_stiffness
        return Stiffness(axial * outer**2, bending * outer**4, torsion * outer**4)

    @lazy
    def _relative_stiffness(self) -> tuple[float, float, float]:
        """K0/R2² [Pa], K1/R2⁴ and K3/R2⁴ [Pa]."""
        shear = self._sum(lambda each: each.relative_modulus / (1 + each.poisson_ratio), 4)
        axial, bending = (self._sum(lambda each: each.relative_modulus, n) for n in (2, 4))
        return np.pi * axial, np.pi / 4 * bending, np.pi / 4 * shear

    def mass_per_length(self, radius: ArrayLike) -> Array:
        """Σ ρ π (R2² - R1²) [kg/m] at R2 [m], that of the materials: theory (49).

        Raises:
            InvalidDesign: A layer without a density.
        """
        if faults := list(_missing(self, "density", "kg/m³", "where weight counts")):
            raise InvalidDesign(faults)
        density = self._sum(lambda material: material.density or 0.0, 2)
        return np.pi * density * np.asarray(radius, float) ** 2

    def modulus_faults(self, why: str) -> list[Fault]:
        """A fault for each material without Young's modulus, unless all stiffnesses were measured.

        It "must be given in Pa", and `why` ends the sentence.
        """
        known = self.measured is not None and None not in self.measured.stiffnesses
        return [] if known else list(_missing(self, "young_modulus", "Pa", why))

    def load_faults(self) -> list[Fault]:
        """Faults that keep loads from acting on an arm."""
        return self.modulus_faults("where loads act")

    def density_faults(self, why: str) -> list[Fault]:
        """A fault for each material without a density, unless the mass per length was measured."""
        known = self.measured is not None and self.measured.mass_per_length is not None
        return [] if known else list(_missing(self, "density", "kg/m³", why))

    def _sum(self, factor: Callable[[Material], float], power: int) -> float:
        """Σ factor · (b^n - a^n) over the layers between the ratios a and b."""
        return sum(
            factor(layer.material) * (layer.outer_ratio**power - layer.inner_ratio**power)
            for layer in self._merged
        )

    @lazy
    def _merged(self) -> tuple[Layer, ...]:
        """The layers, those of one material that touch made one, so that no digit is lost."""
        merged: list[Layer] = []
        for layer in sorted(self.layers, key=lambda layer: layer.inner_ratio):
            last = merged[-1] if merged else None
            touches = last is not None and last.outer_ratio == layer.inner_ratio
            if last and touches and last.material.same_matter(layer.material):
                merged[-1] = last._replace(outer_ratio=layer.outer_ratio)
            else:
                merged.append(layer)
        return tuple(merged)


def _missing(section: Section, field: str, unit: str, why: str) -> Iterator[Fault]:
    allowed = f"must be given in {unit} {why}"
    if section.core is not None and getattr(section.core, field) is None:
        yield Fault(f"core.{field}", None, allowed)
    for k, ring in enumerate(section.rings):
        if getattr(ring.material, field) is None:
            yield Fault(f"rings[{k}].material.{field}", None, allowed)


_RESERVED = ("actuators", "core", "loads", "profile", "rings", "section")


def name_faults(names: list[Any], path: str) -> Iterator[Fault]:
    """Names in a sequence at a path that are given twice, or ambiguous in names of parameters."""
    reserved = f"must not be one of {', '.join(_RESERVED)}, by which paths name parts of the arm"
    for k, name in enumerate(names):
        place = f"{path}[{k}].name"
        if isinstance(name, str) and not is_path_name(name):
            allowed = "must be one line without dots and brackets, and without spaces around it"
            yield Fault(place, name, allowed)
        elif path == "actuators" and name in _RESERVED:
            yield Fault(place, name, reserved)
        elif path == "rings" and isinstance(name, str) and name.isdecimal():
            yield Fault(place, name, "must not be a number, by which paths count rings")
        if name and name in names[:k]:
            yield Fault(place, name, f"must differ from {path}[{names.index(name)}].name")
