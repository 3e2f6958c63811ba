"""The key of a cross-section: what its materials and bundles are called."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, NamedTuple

from softreach.plot.section_bundles import PlacedBundle, lumen_style, tendon_style
from softreach.plot.section_layers import material_style, section_materials

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator
    from softreach.arm.material import Material

__all__ = ["SectionKey", "needs_section_key", "section_key"]

_MOST = 12  # entries
_HANDLE, _LETTER = 0.5, 0.056  # inches
_UNITS = ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (0.0, "Pa"))


class SectionKey(NamedTuple):
    """What materials and bundles look like, and what they are called."""

    handles: list[Artist]
    labels: list[str]

    @property
    def width(self) -> float:
        """Room that it takes on paper, about [inch]."""
        return _HANDLE + _LETTER * max(map(len, self.labels), default=0)

    def draw(self, ax: Axes) -> None:
        """Place it to the right of the axes."""
        place = {"loc": "center left", "bbox_to_anchor": (1.02, 0.5), "borderaxespad": 0.0}
        ax.legend(self.handles, self.labels, frameon=False, fontsize=7, **place)


def needs_section_key(arm: Manipulator) -> bool:
    """Whether colors alone leave open what is what: several materials, or more than fibers."""
    shapes = set(arm.outline(0.0).shape)
    plain = shapes == {"sector"} and set(arm.bundle_courses) == {"along"}
    return not plain or len(section_materials(arm.section)) > 1


def section_key(arm: Manipulator, placed: Collection[PlacedBundle]) -> SectionKey:
    """Names of the materials, and of bundles with their activations."""
    entries = [*_materials(arm), *_bundles(arm, placed)]
    handles, labels = [list(column) for column in zip(*entries[:_MOST], strict=True)] or [[], []]
    if len(entries) > _MOST:
        labels[-1] += f" and {len(entries) - _MOST} more"
    return SectionKey(handles, labels)


def _materials(arm: Manipulator) -> Iterator[tuple[Artist, str]]:
    from matplotlib.patches import Patch

    materials = section_materials(arm.section)
    if len(materials) == 1 and materials[0][1].young_modulus is None:
        return
    for part, material in materials:
        patch = Patch(**material_style(arm.section, material))
        patch.set_hatch_linewidth(0.4)
        yield patch, _material_label(part, material)


def _bundles(arm: Manipulator, placed: Collection[PlacedBundle]) -> Iterator[tuple[Artist, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    symbols = [one.symbol for one in arm.actuators for _ in range(one.bundles)]
    for one in placed:
        if one.shape == "line":
            handle: Artist = Line2D([], [], **tendon_style(one.color))
        else:
            lumen = one.shape == "lumen"
            handle = Patch(**lumen_style(one.color)) if lumen else Patch(color=one.color)
        course = "" if one.course == "along" else f", {one.course}"
        unit = arm.bundle_units[one.index].replace("1", "-")
        name = arm.bundle_names[one.index]
        yield handle, f"{name}{course}: {symbols[one.index]} [{unit}]"


def _material_label(part: str, material: Material) -> str:
    name = material.name or part
    if material.young_modulus is None:
        return name
    size, unit = next(pair for pair in _UNITS if material.young_modulus >= pair[0])
    return f"{name}: E = {material.young_modulus / (size or 1.0):.3g} {unit}"
