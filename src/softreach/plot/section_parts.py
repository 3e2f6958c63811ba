"""Parts of a cross-section: bore, core and rings by material, and bundles in their colors."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.support.palette import BODY, Color, bundle_color, material_fill

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch, Wedge

    from softreach.arm.manipulator import Manipulator
    from softreach.arm.material import Material
    from softreach.arm.section import Section


_EDGE, _HATCH = "0.4", "0.55"
_STROKE_ANGLE = np.radians(8)  # between fibers that do not run along the bundle
_LIGHTNESS = (0.21, 0.72, 0.07)  # of red, green and blue
_LEAN = np.radians(14)  # of oblique strokes from the inner to the outer radius
_OVERLAP = 1e-6  # [rad] or [-], below which bundles only touch


def draw_layers(ax: Axes, section: Section, outer: float) -> None:
    """Draw what a section of outer radius `outer` is made of; what is empty is white.

    In a section of one material the core is paler than the rings; rings above others are clear.
    """
    from matplotlib.patches import Circle

    line = {"edgecolor": _EDGE, "linewidth": 0.6}
    ax.add_patch(Circle((0, 0), outer, facecolor="0.97", **line))
    several = len(section_materials(section)) > 1
    if several and section.inner_ratio > section.bore_ratio:
        _draw_material(ax, section, section.core_material, 0.0, outer * section.inner_ratio)
    _draw_voids(ax, section, outer)
    for k, ring in enumerate(section.rings):
        low, high = ring.inner_ratio, ring.outer_ratio
        over = any(
            low < other.outer_ratio and other.inner_ratio < high for other in section.rings[:k]
        )
        if several:
            alpha = 0.5 if over else 1.0
            _draw_material(ax, section, ring.material, outer * low, outer * high, alpha)
        else:
            ring_of_body = _annulus(outer * low, outer * high)
            ring_of_body.set(facecolor=BODY, edgecolor=_EDGE, linewidth=0.4)
            ax.add_patch(ring_of_body)


def section_materials(section: Section) -> tuple[tuple[str, Material], ...]:
    """The different materials of a section, rings first, each with the part it is found in."""
    rings = [
        (ring.name or ("ring" if len(section.rings) == 1 else f"ring {k + 1}"), ring.material)
        for k, ring in enumerate(section.rings)
    ]
    has_core = section.inner_ratio > section.bore_ratio
    materials: list[tuple[str, Material]] = []
    for part, material in [*rings, *([("core", section.core_material)] if has_core else [])]:
        if not any(material.same_matter(other) for _, other in materials):
            materials.append((part, material))
    return tuple(materials)


def material_style(section: Section, material: Material) -> dict[str, Any]:
    """Fill and hatch of a material of the section, as properties of a patch."""
    known = [material.same_matter(other) for _, other in section_materials(section)]
    color, hatch = material_fill(known.index(True))
    return {"facecolor": color, "hatch": hatch, "edgecolor": _HATCH, "linewidth": 0.0}


@dataclass(frozen=True, kw_only=True)
class PlacedBundle:
    """One bundle that acts in a section."""

    index: int
    shape: str
    course: str
    center: float
    """Polar angle of its middle [rad]."""
    extent: float
    """Angular extent [rad]."""
    inner_ratio: float
    """Inner radius over R2 [-]."""
    outer_ratio: float
    """Outer radius over R2 [-]."""

    @property
    def color(self) -> Color:
        """Its color in every picture."""
        return bundle_color(self.index)

    def overlaps(self, other: PlacedBundle) -> Iterator[PlacedBundle]:
        """The parts of this sector that another shares."""
        inner = max(self.inner_ratio, other.inner_ratio)
        outer = min(self.outer_ratio, other.outer_ratio)
        apart = (other.center - self.center + np.pi) % (2 * np.pi) - np.pi
        for turn in (apart - 2 * np.pi, apart, apart + 2 * np.pi):
            low = max(-self.extent / 2, turn - other.extent / 2)
            high = min(self.extent / 2, turn + other.extent / 2)
            if outer - inner > _OVERLAP and high - low > _OVERLAP:
                middle, extent = self.center + 0.5 * (low + high), high - low
                ratios = {"inner_ratio": inner, "outer_ratio": outer}
                yield replace(self, center=middle, extent=extent, **ratios)


def placed_bundles(arm: Manipulator, z: float, bundles: Collection[int]) -> list[PlacedBundle]:
    """Those of the bundles that act at Z [m]."""
    outline = arm.outline(z)
    return [
        PlacedBundle(
            index=k,
            shape=outline.shape[k],
            course=arm.bundle_courses[k],
            center=float(outline.center[0, k]),
            extent=float(outline.extent[k]),
            inner_ratio=float(outline.inner_ratio[0, k]),
            outer_ratio=float(outline.outer_ratio[0, k]),
        )
        for k in bundles
        if outline.acts[0, k]
    ]


def draw_bundles(ax: Axes, placed: Collection[PlacedBundle], outer: float) -> None:
    """Draw bundles in a section of outer radius `outer`: sectors, then lumens, then tendons."""
    sectors = [bundle for bundle in placed if bundle.shape == "sector"]
    for bundle in sectors:
        ax.add_patch(_sector(bundle, outer, color=bundle.color, linewidth=0))
    for k, bundle in enumerate(sectors):
        for above in sectors[k + 1 :]:
            for part in bundle.overlaps(above):
                stripes = _sector(
                    part, outer, facecolor="none", edgecolor=part.color, linewidth=0.0
                )
                stripes.set_hatch("//////")
                stripes.set_hatch_linewidth(1.2)
                ax.add_patch(stripes)
    for bundle in sectors:
        _draw_strokes(ax, bundle, outer)
    for bundle in (bundle for bundle in placed if bundle.shape == "lumen"):
        _draw_lumen(ax, bundle, outer)
    lines = [bundle for bundle in placed if bundle.shape == "line"]
    _draw_disks(ax, lines, outer)
    for bundle in lines:
        ax.plot(*_middle(bundle, outer), zorder=3, **tendon_style(bundle.color))


def tendon_style(color: Color) -> dict[str, Any]:
    """Properties of the dot of a tendon."""
    edge = {"markeredgecolor": "white", "markeredgewidth": 0.6}
    return {"marker": "o", "markersize": 5.5, "linestyle": "none", "color": color, **edge}


def lumen_style(color: Color) -> dict[str, Any]:
    """Properties of the patch of a lumen: pale within a rim."""
    pale = tuple(0.25 * part + 0.75 for part in color)
    return {"facecolor": pale, "edgecolor": color, "linewidth": 1.4}


def _draw_material(
    ax: Axes, section: Section, material: Material, low: float, high: float, alpha: float = 1.0
) -> None:
    style = material_style(section, material)
    fill = _annulus(low, high)
    fill.set(**{**style, "facecolor": (style["facecolor"], alpha)})
    fill.set_hatch_linewidth(0.4)
    edge = _annulus(low, high)
    edge.set(facecolor="none", edgecolor=_EDGE, linewidth=0.4)
    ax.add_patch(fill)
    ax.add_patch(edge)


def _draw_voids(ax: Axes, section: Section, outer: float) -> None:
    reached = section.bore_ratio
    voids = [(0.0, reached)] if reached > 0 else []
    reached = max(reached, section.inner_ratio)
    for ring in sorted(section.rings, key=lambda ring: ring.inner_ratio):
        if ring.inner_ratio > reached:
            voids.append((reached, ring.inner_ratio))
        reached = max(reached, ring.outer_ratio)
    for low, high in voids:
        void = _annulus(outer * low, outer * high)
        void.set(facecolor="white", edgecolor=_EDGE, linewidth=0.4)
        ax.add_patch(void)


def _annulus(low: float, high: float) -> Patch:
    from matplotlib.patches import Annulus, Circle

    return Annulus((0, 0), high, high - low) if low > 0 else Circle((0, 0), high)


def _sector(bundle: PlacedBundle, outer: float, **style: Any) -> Wedge:
    from matplotlib.patches import Wedge

    center, extent = np.degrees(bundle.center), np.degrees(bundle.extent)
    ends = center - extent / 2, center + extent / 2
    radius, width = outer * bundle.outer_ratio, outer * (bundle.outer_ratio - bundle.inner_ratio)
    return Wedge((0, 0), radius, *ends, width=width, **style)


def _draw_strokes(ax: Axes, bundle: PlacedBundle, outer: float) -> None:
    """Strokes of fibers that do not run along: outwards, or leaning the way they wind."""
    from matplotlib.collections import LineCollection

    lean = {"along": None, "radial": 0.0, "right-handed": _LEAN, "left-handed": -_LEAN}[
        bundle.course
    ]
    if lean is None:
        return
    half = 0.5 * (bundle.extent - abs(lean))
    if half <= 0:
        half, lean = 0.4 * bundle.extent, np.sign(lean) * min(abs(lean), 0.2 * bundle.extent)
    angles = bundle.center + np.linspace(-half, half, max(3, round(2 * half / _STROKE_ANGLE)))
    ends = [
        outer * ratio * np.column_stack([np.cos(at), np.sin(at)])
        for ratio, at in (
            (bundle.inner_ratio, angles - lean / 2),
            (bundle.outer_ratio, angles + lean / 2),
        )
    ]
    strokes = np.stack(ends, axis=1)
    ink = "white" if np.dot(bundle.color, _LIGHTNESS) < 0.55 else "0.3"
    ax.add_collection(LineCollection(list(strokes), colors=ink, linewidths=0.7))


def _draw_lumen(ax: Axes, bundle: PlacedBundle, outer: float) -> None:
    from matplotlib.patches import Circle

    radius = 0.5 * outer * (bundle.outer_ratio - bundle.inner_ratio)
    (x,), (y,) = _middle(bundle, outer)
    ax.add_patch(Circle((x, y), radius, **lumen_style(bundle.color)))


def _draw_disks(ax: Axes, lines: Collection[PlacedBundle], outer: float) -> None:
    from matplotlib.patches import Circle

    for ratio in sorted(
        {round(bundle.outer_ratio, 9) for bundle in lines if bundle.outer_ratio > 1}
    ):
        circle = Circle((0, 0), outer * ratio, facecolor="none", edgecolor="0.6", linewidth=0.6)
        circle.set_linestyle(":")
        ax.add_patch(circle)


def _middle(bundle: PlacedBundle, outer: float) -> tuple[list[float], list[float]]:
    radius = 0.5 * outer * (bundle.inner_ratio + bundle.outer_ratio)
    return [radius * np.cos(bundle.center)], [radius * np.sin(bundle.center)]
