"""The layers of a cross-section: bore, core and rings, by material."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from softreach.palette import BODY, material_fill

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import Patch

    from softreach.arm.material import Material
    from softreach.arm.section import Section

__all__ = ["draw_layers", "material_style", "section_materials"]

_EDGE, _HATCH = "0.4", "0.55"


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
        over = any(low < one.outer_ratio and one.inner_ratio < high for one in section.rings[:k])
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
        (one.name or ("ring" if len(section.rings) == 1 else f"ring {k + 1}"), one.material)
        for k, one in enumerate(section.rings)
    ]
    has_core = section.inner_ratio > section.bore_ratio
    found: list[tuple[str, Material]] = []
    for part, material in [*rings, *([("core", section.core_material)] if has_core else [])]:
        if not any(material.same_matter(other) for _, other in found):
            found.append((part, material))
    return tuple(found)


def material_style(section: Section, material: Material) -> dict[str, Any]:
    """Fill and hatch of a material of the section, as properties of a patch."""
    known = [material.same_matter(other) for _, other in section_materials(section)]
    color, hatch = material_fill(known.index(True))
    return {"facecolor": color, "hatch": hatch, "edgecolor": _HATCH, "linewidth": 0.0}


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
    """The bore, and gaps between rings."""
    reached = section.bore_ratio
    voids = [(0.0, reached)] if reached > 0 else []
    reached = max(reached, section.inner_ratio)
    for ring in sorted(section.rings, key=lambda one: one.inner_ratio):
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
