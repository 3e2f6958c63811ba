"""Picture of a cross-section: its layers by material, its bundles in their colors, their key."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.section import Material, Section
from softreach.plot.style import LENGTH, PLACE, Unit, some_bundles, styled_axes, unit_for
from softreach.support.arguments import as_flag, as_number
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes
from softreach.support.palette import BODY, bundle_color, material_fill
from softreach.support.units import METER, readable

_MOST = 12  # entries
_HANDLE, _LETTER = 0.5, 0.056  # inches
_SIZE = 2.0  # inches
_MARGIN = 1.08
_EDGE, _HATCH = "0.4", "0.55"
_STROKE_ANGLE = np.radians(8)  # between fibers that do not run along the bundle
_LIGHTNESS = (0.21, 0.72, 0.07)  # of red, green and blue
_LEAN = np.radians(14)  # of oblique strokes from the inner to the outer radius


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

    Fibers and muscles fill a sector of their ring; strokes show radial and oblique ones. Tendons
    are dots, dotted circles the disks that hold those outside of the arm; chambers are round. What
    does not act at Z is left out. A body with two measured bending stiffnesses, K1 and K2, that
    holds tendons at most is an ellipse whose widths are as √K2 to √K1, as those of a flat strip
    are; the wider one is 2 R2.

    Args:
        arm: The design, at rest.
        z: Station Z [m].
        ax: Axes to draw in; None for a new figure.
        bundles: Which to draw, by index; None for all.
        half_width: Of what is shown [m], for sections at one scale; None for this section alone.
        legend: Whether to name materials and bundles beside it; None where there are several
            materials, or bundles other than fibers.
        unit: As in `plot_arm`.

    Raises:
        InvalidInput: A station off the arm.
        MissingExtra: matplotlib is not installed.
    """
    arm, z = a_manipulator("arm", arm), as_number("z", z, PLACE)
    half_width = None if half_width is None else as_number("half_width", half_width, LENGTH)
    if legend is None:  # where colors alone leave open what is what
        courses = {actuator.fiber_direction for actuator in arm.actuators}
        plain = set(arm.outline(0.0).shape) == {"sector"} and courses == {"along"}
        legend = not plain or len(_materials(arm.section)) > 1
    legend = as_flag("legend", legend)
    if not 0 <= z <= arm.length:
        raise InvalidInput("z", z, f"within [0, {arm.length:g}] m")
    counted = unit_for(arm.length, unit)
    outer = float(counted.of(arm.profile.radius(z)))
    placed = _placed(arm, z, outer, some_bundles(arm, bundles))
    entries = [*_material_entries(arm.section), *_bundle_entries(arm, placed)] if legend else []
    labels = [label for _, label in entries[:_MOST]]
    if len(entries) > _MOST:
        labels[-1] += f" and {len(entries) - _MOST} more"
    room = _HANDLE + _LETTER * max(map(len, labels), default=0) if legend else 0.0
    half = _MARGIN * section_reach(arm, z) if half_width is None else half_width
    half = float(counted.of(half))
    with styled_axes(ax, _SIZE + room, _SIZE) as ax:
        known = len(ax.patches)
        _draw_layers(ax, arm.section, outer)
        _flatten(ax, ax.patches[known:], arm)
        _draw_bundles(ax, placed, outer)
        ax.set(aspect="equal", xlim=(-half, half), ylim=(-half, half))
        ax.set(xlabel=counted.label("x"), ylabel=counted.label("y"))
        ax.locator_params(nbins=3)
        if legend:
            place = {"loc": "center left", "bbox_to_anchor": (1.02, 0.5), "borderaxespad": 0.0}
            handles = [artist for artist, _ in entries[:_MOST]]
            ax.legend(handles, labels, frameon=False, fontsize=7, **place)
    return ax


def section_reach(arm: Manipulator, z: float) -> float:
    """Distance from the axis of the surface at Z, or of what lies farther outside [m]."""
    outline = arm.outline(z)
    widest = np.max(outline.held_ratio[outline.acts], initial=1.0)
    return float(arm.profile.radius(z)) * float(widest)


def _materials(section: Section) -> dict[Material, tuple[str, Material]]:
    """The different materials of a section but for their names, rings first, with their part."""
    parts = [
        (ring.name or ("ring" if len(section.rings) == 1 else f"ring {k + 1}"), ring.material)
        for k, ring in enumerate(section.rings)
    ]
    if section.inner_ratio > section.bore_ratio:
        parts.append(("core", section.core_material))
    different: dict[Material, tuple[str, Material]] = {}
    for part, material in parts:
        different.setdefault(material.replace(name=""), (part, material))
    return different


def _material_style(number: int) -> dict[str, Any]:
    color, hatch = material_fill(number)
    return {"facecolor": color, "hatch": hatch, "edgecolor": _HATCH, "linewidth": 0.0}


def _material_entries(section: Section) -> Iterator[tuple[Any, str]]:
    from matplotlib.patches import Patch

    materials = [*_materials(section).values()]
    if len(materials) == 1 and materials[0][1].young_modulus is None:
        return
    for k, (part, material) in enumerate(materials):
        patch, label = Patch(**_material_style(k)), material.name or part
        patch.set_hatch_linewidth(0.4)
        if (modulus := material.young_modulus) is not None:
            label += f": E = {readable(float(f'{modulus:.3g}'), 'Pa', METER)}"
        yield patch, label


def _bundle_entries(arm: Manipulator, placed: "Collection[_Placed]") -> Iterator[tuple[Any, str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    for bundle in placed:
        k, is_line = bundle.index, bundle.shape == "line"
        handle = Line2D([], [], **bundle.style) if is_line else Patch(**bundle.style)
        course = "" if bundle.course == "along" else f", {bundle.course}"
        symbol, unit = arm.bundle_actuators[k].symbol, arm.bundle_units[k].replace("1", "-")
        yield handle, f"{arm.bundle_names[k]}{course}: {symbol} [{unit}]"


def _draw_layers(ax: Axes, section: Section, outer: float) -> None:
    """Layers: of one material the core is paler than the rings; rings above others are clear."""
    from matplotlib.patches import Circle

    materials = [*_materials(section)]

    def draw(low: float, high: float, material: Material | None, alpha: float = 1.0) -> None:
        color: Any = "white" if material is None else BODY
        if material is not None and len(materials) > 1:
            fill, color = _annulus(outer * low, outer * high, "none"), "none"
            style = _material_style(materials.index(material.replace(name="")))
            fill.set(**{**style, "facecolor": (style["facecolor"], alpha)})
            fill.set_hatch_linewidth(0.4)
            ax.add_patch(fill)
        ax.add_patch(_annulus(outer * low, outer * high, color))

    ax.add_patch(Circle((0, 0), outer, facecolor="0.97", edgecolor=_EDGE, linewidth=0.6))
    if len(materials) > 1 and section.inner_ratio > section.bore_ratio:
        draw(0.0, section.inner_ratio, section.core_material)
    if section.bore_ratio > 0:
        draw(0.0, section.bore_ratio, None)
    reached = max(section.bore_ratio, section.inner_ratio)
    for ring in sorted(section.rings, key=lambda ring: ring.inner_ratio):
        if ring.inner_ratio > reached:
            draw(reached, ring.inner_ratio, None)
        reached = max(reached, ring.outer_ratio)
    for k, ring in enumerate(section.rings):
        low, high = ring.inner_ratio, ring.outer_ratio
        over = any(low < r.outer_ratio and r.inner_ratio < high for r in section.rings[:k])
        draw(low, high, ring.material, 0.5 if over else 1.0)


def _flatten(ax: Axes, layers: Sequence[Any], arm: Manipulator) -> None:
    """Make ellipses of layers where two bending stiffnesses were measured."""
    from matplotlib.transforms import Affine2D

    if arm.half_axes != (1.0, 1.0):
        flat = Affine2D().scale(*arm.half_axes).rotate(arm.section.bending_angle)
        for layer in layers:
            layer.set_transform(flat + ax.transData)


def _annulus(low: float, high: float, fill: Any) -> Any:
    from matplotlib.patches import Annulus, Circle

    look = {"facecolor": fill, "edgecolor": _EDGE, "linewidth": 0.4}
    return Annulus((0, 0), high, high - low, **look) if low > 0 else Circle((0, 0), high, **look)


@dataclass(frozen=True)
class _Placed:
    index: int
    shape: str
    course: str
    center: float  # polar angle [rad]
    extent: float  # angular [rad]
    inner: float  # radius in the unit of the axes
    outer: float  # radius in the unit of the axes
    held: float  # radius of the disks that hold it

    @property
    def middle(self) -> tuple[float, float]:
        radius = 0.5 * (self.inner + self.outer)
        return radius * np.cos(self.center), radius * np.sin(self.center)

    @property
    def style(self) -> dict[str, Any]:
        color = bundle_color(self.index)
        if self.shape == "line":
            edge = {"markeredgecolor": "white", "markeredgewidth": 0.6}
            return {"marker": "o", "markersize": 5.5, "linestyle": "none", "color": color, **edge}
        if self.shape == "sector":
            return {"color": color}
        pale = tuple(0.25 * part + 0.75 for part in color)
        return {"facecolor": pale, "edgecolor": color, "linewidth": 1.4}

    def sector(self, **style: Any) -> Any:
        from matplotlib.patches import Wedge

        center, extent = np.degrees(self.center), np.degrees(self.extent)
        ends, width = (center - extent / 2, center + extent / 2), self.outer - self.inner
        return Wedge((0, 0), self.outer, *ends, width=width, **style)

    def strokes(self) -> Any:
        """Strokes of fibers that do not run along: outwards, or leaning the way they wind."""
        from matplotlib.collections import LineCollection

        lean = {"radial": 0.0, "right-handed": _LEAN, "left-handed": -_LEAN}[self.course]
        half = 0.5 * (self.extent - abs(lean))
        if half <= 0:
            half, lean = 0.4 * self.extent, np.sign(lean) * min(abs(lean), 0.2 * self.extent)
        angles = self.center + np.linspace(-half, half, max(3, round(2 * half / _STROKE_ANGLE)))
        ends = (self.inner, angles - lean / 2), (self.outer, angles + lean / 2)
        points = [r * np.column_stack([np.cos(at), np.sin(at)]) for r, at in ends]
        ink = "white" if np.dot(bundle_color(self.index), _LIGHTNESS) < 0.55 else "0.3"
        return LineCollection(list(np.stack(points, axis=1)), colors=ink, linewidths=0.7)


def _placed(arm: Manipulator, z: float, outer: float, bundles: Collection[int]) -> list[_Placed]:
    outline = arm.outline(z)
    ratios = outline.inner_ratio[0], outline.outer_ratio[0], outline.held_ratio[0]
    sizes = outline.center[0], outline.extent, *(outer * ratio for ratio in ratios)
    ways = [actuator.fiber_direction for actuator in arm.bundle_actuators]
    acting = [k for k in bundles if outline.acts[0, k]]
    each = ([float(size[k]) for size in sizes] for k in acting)
    return [_Placed(k, outline.shape[k], ways[k], *x) for k, x in zip(acting, each, strict=True)]


def _draw_bundles(ax: Axes, placed: Collection[_Placed], outer: float) -> None:
    from matplotlib.patches import Circle

    kinds = ("sector", "lumen", "line")
    sectors, lumens, lines = ([x for x in placed if x.shape == kind] for kind in kinds)
    for bundle in sectors:
        ax.add_patch(bundle.sector(linewidth=0, **bundle.style))
    for bundle in sectors:
        if bundle.course != "along":
            ax.add_collection(bundle.strokes())
    for bundle in lumens:
        ax.add_patch(Circle(bundle.middle, 0.5 * (bundle.outer - bundle.inner), **bundle.style))
    for radius in sorted({round(line.held / outer, 9) for line in lines if line.held > outer}):
        disk = {"facecolor": "none", "edgecolor": "0.6", "linewidth": 0.6, "linestyle": ":"}
        ax.add_patch(Circle((0, 0), outer * radius, **disk))
    for bundle in lines:
        x, y = bundle.middle
        ax.plot([x], [y], zorder=3, **bundle.style)
