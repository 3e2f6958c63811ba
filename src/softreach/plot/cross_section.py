"""Picture of a cross-section: its layers, its bundles, and the key of both."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.plot.lengths import Unit, unit_for
from softreach.plot.section_parts import (
    PlacedBundle,
    draw_bundles,
    draw_layers,
    lumen_style,
    material_style,
    placed_bundles,
    section_materials,
    tendon_style,
)
from softreach.plot.style import LENGTH, PLACE, as_axes, figure_style, small_axes, some_bundles
from softreach.support.arguments import as_flag, as_number
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

    from softreach.arm.material import Material


_MOST = 12  # entries
_HANDLE, _LETTER = 0.5, 0.056  # inches
_UNITS = ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"), (0.0, "Pa"))
_SIZE = 2.0  # inches
_MARGIN = 1.08


class SectionKey(NamedTuple):
    """Key of a cross-section: looks and names of its materials and bundles."""

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
    """True if colors alone leave open what is what: several materials, or more than fibers."""
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


def plot_cross_section(
    arm: Manipulator,
    z: float = 0.0,
    *,
    ax: Axes | None = None,
    bundles: Collection[int] | None = None,
    half_width: float | None = None,
    legend: bool | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the cross-section at Z, seen from the tip (figure 1c): layers, and the bundles that act.

    Fibers and muscles fill a sector of their ring; strokes show radial and oblique ones. Where
    sectors overlap, the lower shows in stripes. Tendons are dots, dotted circles the disks that
    hold those outside of the arm; chambers are round. What does not act at Z is left out.

    Args:
        arm: The design, at rest.
        z: Station Z [m].
        ax: Axes to draw in; None for a new figure.
        bundles: Which to draw, by index; None for all.
        half_width: Of what is shown [m], to draw several sections at one scale; None for this
            section.
        legend: Whether to name materials and bundles beside it; None where there are several
            materials, or bundles other than fibers.
        unit: As in `plot_arm`.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: A station off the arm.
        MissingExtra: matplotlib is not installed.
    """
    arm, z, ax = a_manipulator("arm", arm), as_number("z", z, PLACE), as_axes(ax)
    half_width = None if half_width is None else as_number("half_width", half_width, LENGTH)
    legend = needs_section_key(arm) if legend is None else as_flag("legend", legend)
    if not 0 <= z <= arm.length:
        raise InvalidInput("z", z, f"within [0, {arm.length:g}] m")
    counted = unit_for(arm.length, unit)
    outer = float(counted.of(arm.profile.radius(z)))
    placed = placed_bundles(
        arm, z, range(arm.bundles) if bundles is None else some_bundles("bundles", bundles, arm)
    )
    with figure_style(ax):
        key = section_key(arm, placed) if legend else None
        ax = small_axes(_SIZE + (key.width if key else 0.0), _SIZE) if ax is None else ax
        draw_layers(ax, arm.section, outer)
        draw_bundles(ax, placed, outer)
        half = _MARGIN * section_reach(arm, z) if half_width is None else half_width
        half = float(counted.of(half))
        ax.set(aspect="equal", xlim=(-half, half), ylim=(-half, half))
        ax.set(xlabel=counted.label("x"), ylabel=counted.label("y"))
        ax.locator_params(nbins=3)
        if key:
            key.draw(ax)
    return ax


def section_reach(arm: Manipulator, z: float) -> float:
    """Distance from the axis of the surface at Z, or of what lies farther outside [m]."""
    outline = arm.outline(z)
    widest = np.max(outline.outer_ratio[outline.acts], initial=1.0)
    return float(arm.profile.radius(z)) * float(widest)


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

    symbols = [actuator.symbol for actuator in arm.bundle_actuators]
    for bundle in placed:
        if bundle.shape == "line":
            handle: Artist = Line2D([], [], **tendon_style(bundle.color))
        else:
            lumen = bundle.shape == "lumen"
            handle = Patch(**lumen_style(bundle.color)) if lumen else Patch(color=bundle.color)
        course = "" if bundle.course == "along" else f", {bundle.course}"
        unit = arm.bundle_units[bundle.index].replace("1", "-")
        name = arm.bundle_names[bundle.index]
        yield handle, f"{name}{course}: {symbols[bundle.index]} [{unit}]"


def _material_label(part: str, material: Material) -> str:
    name = material.name or part
    if material.young_modulus is None:
        return name
    size, unit = next(pair for pair in _UNITS if material.young_modulus >= pair[0])
    return f"{name}: E = {material.young_modulus / (size or 1.0):.3g} {unit}"
