"""Draws docs/images/conventions.png, the picture of signs: `python -m tools.conventions`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import softreach as sr
from softreach.arm import (
    Actuator,
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    Section,
    Tendon,
)
from softreach.plot.arm import plot_arm
from softreach.plot.cross_section import plot_cross_section
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PICTURE = Path(__file__).parent.parent / "docs" / "images" / "conventions.png"
DPI = 140
_LENGTH, _RADIUS, _MODULUS = 1.0, 0.08, 1e5
_BOX = _LENGTH * np.array([[-0.42, -0.3, -0.06], [0.42, 0.3, 1.08]])
_INK = "0.15"
_OFFSET, _EXTENT = np.radians(58.0), np.radians(40.0)

FIBER = FiberArchitecture(name="fiber", revolution=0.0, extent=np.radians(100))
WINDING = FIBER.replace(revolution=np.radians(300), offset=np.radians(200), extent=np.radians(40))
TENDON = Tendon(name="tendon", distance_ratio=1.4, activation_bounds=(0.0, 30.0))
CHAMBER = Chamber(
    name="chamber", distance_ratio=0.5, radius_ratio=0.3, activation_bounds=(0.0, 5e4)
)
STRAIGHT = {
    "γ < 0: a fiber contracts\nand bends toward its side": (FIBER, -0.09),
    "τ > 0: a tendon pulls\nand bends toward its side": (TENDON, 14.0),
    "P > 0: a chamber lengthens\nand bends away from it": (CHAMBER, 2.4e4),
}
"""What is said of an actuator at θ0 = 0, the actuator, and its activation in the picture."""


def arm_with(*actuators: Actuator) -> Manipulator:
    """A thick arm of one material."""
    ring = Ring(inner_ratio=0.6, material=Material(young_modulus=_MODULUS))
    profile = LinearTaper(length=_LENGTH, outer_radius=_RADIUS * _LENGTH)
    return Manipulator(profile=profile, section=Section(rings=(ring,)), actuators=actuators)


def conventions_figure() -> Figure:
    """The section seen from the tip, a winding fiber, and what each kind of activation does."""
    with figure_style():
        figure, axes = pyplot().subplots(
            1,
            5,
            figsize=(9.6, 2.75),
            width_ratios=(1.14, 0.44, 0.84, 0.84, 0.84),
            layout="constrained",
        )
        _draw_section(axes[0])
        _draw_winding(axes[1])
        for ax, (words, (actuator, activation)) in zip(axes[2:], STRAIGHT.items(), strict=True):
            arm = arm_with(actuator)
            shape = sr.configuration(arm, [activation])
            plot_arm(arm, shape, ax=ax, view="front", box=_BOX)
            ax.set(ylabel="", yticklabels=[])
            ax.set_title(words)
    return figure


def _draw_section(ax: Axes) -> None:
    tendon = TENDON.replace(offset=np.radians(165))
    chamber = CHAMBER.replace(offset=np.radians(270), radius_ratio=0.25, distance_ratio=0.65)
    fiber = FIBER.replace(offset=_OFFSET, extent=_EXTENT)
    plot_cross_section(arm_with(fiber, tendon, chamber), ax=ax, half_width=0.136, legend=False)
    reach = 1.42 * _RADIUS
    for name, x, y in (("x, d₁", 1, 0), ("y, d₂", 0, 1)):
        _arrow(ax, (0, 0), (reach * x, reach * y))
        ax.text(reach * x + 0.004 * y, reach * y + 0.004 * x, name, ha="right", va="bottom")
    ax.plot(0, 0, "o", markersize=6, markerfacecolor="white", color=_INK, markeredgewidth=0.8)
    ax.plot(0, 0, "o", markersize=1.5, color=_INK)
    ax.text(-0.004, -0.004, "z, d₃", ha="right", va="top")
    _arc(ax, 0.34 * _RADIUS, 0.0, _OFFSET, "θ₀")
    _arc(ax, 1.1 * _RADIUS, _OFFSET - _EXTENT / 2, _OFFSET + _EXTENT / 2, "σ", both=True)
    _arc(ax, 1.22 * _RADIUS, np.radians(195), np.radians(250), "Ω > 0")
    for name, x, y in (("tendon", -1.3, 0.52), ("chamber", 0.32, -0.72), ("bundle", 0.95, 1.2)):
        ax.text(x * _RADIUS, y * _RADIUS, name, fontsize=7, color="0.3")
    ax.set_title("seen from the tip:\nangles count from d₁ toward d₂")


def _draw_winding(ax: Axes) -> None:
    plot_arm(arm_with(WINDING), ax=ax, view="front", box=_BOX * [[0.5, 1, 1], [0.5, 1, 1]])
    ax.set_title("Ω > 0, α > 0:\nright-handed")


def _arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    style = {"arrowstyle": "-|>", "color": _INK, "linewidth": 0.9, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xy=end, xytext=start, arrowprops=style)


def _arc(
    ax: Axes, radius: float, start: float, end: float, name: str, *, both: bool = False
) -> None:
    """An arc about the center with an arrow at its end, or at both."""
    angles = np.linspace(start, end, 60)
    x, y = radius * np.cos(angles), radius * np.sin(angles)
    ax.plot(x, y, color=_INK, linewidth=0.9)
    _arrow(ax, (x[-4], y[-4]), (x[-1], y[-1]))
    if both:
        _arrow(ax, (x[3], y[3]), (x[0], y[0]))
    middle = 0.5 * (start + end)
    away = radius + 0.17 * _RADIUS
    right, up = away * np.cos(middle), away * np.sin(middle)
    ax.text(right, up, name, ha="left" if right > 0 else "right", va="center")


if __name__ == "__main__":
    conventions_figure().savefig(PICTURE, dpi=DPI)
