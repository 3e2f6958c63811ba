"""Figures in panels: a section of the reachable set, volumes over a parameter, bars of slopes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed, parameters
from softreach.geometry.surface import plane_cut, section_area
from softreach.picture.projection import View, plane_of
from softreach.plot.reach import plot_slice
from softreach.plot.style import inked
from softreach.studio import markup
from softreach.studio.reach import Quality, Reach, exact_set
from softreach.studio.shown_parameters import ShownParameter, slider_parameters
from softreach.studio.state import Slice, StudioState
from softreach.studio.widgets import unit_in
from softreach.studio.work import Budget, OverBudget, StaleCheck, all_cores, check_wanted
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, SoftreachError, no_warnings
from softreach.support.parallel import undivided
from softreach.support.quantity import quantity
from softreach.workspace.gradient import gradient_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_VIEWS: dict[str, View] = {"x": "side", "y": "front", "z": "top"}
_LINE, _HERE = "#2f6db5", "#d9731a"
_INK = "#7d848b"  # legible on white and on black
_WIDTH, _DPI = 4.3, 200  # [inch], about as wide as a panel; sharp with two pixels per point
_VALUES, _SECONDS = 9, 10.0  # of a parameter beside that of the design, and [s] for each volume
PART = 0.01  # part of the range of a slider over which the change of the volume is told
NO_BAR = markup.bar(0.0, "\N{NO-BREAK SPACE}", "not known yet", faded=True)  # room for a bar
_FINEST = 1e-3  # [%] of V: more digits tell nobody more


class Picture(NamedTuple):
    """Picture of a design."""

    arm: Manipulator
    image: NDArray[np.uint8]  # RGBA on a transparent ground, shape (rows, columns, 4)
    text: str  # its content in words


def _axes(height: float) -> Axes:
    from matplotlib.figure import Figure  # away from pyplot, which belongs to one thread

    return Figure(figsize=(_WIDTH, height), dpi=_DPI, layout="constrained").subplots()


def _pixels(ax: Axes) -> NDArray[np.uint8]:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figure = cast("Figure", ax.figure)
    ax.tick_params(which="both", colors=_INK)
    ax.spines[:].set_edgecolor(_INK)
    inked(figure, _INK)
    for paper in (figure.patch, ax.patch):
        paper.set_alpha(0.0)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.array(canvas.buffer_rgba())


def section_curves(reach: Reach, cut: Slice) -> list[Array]:
    """The boundary of a reachable set in the middle plane of a slice [L], curves (n, 3)."""
    if reach.exact is None or reach.exact.dimension < 2:
        raise InvalidInput("section", reach.refusal or "no volume", "a set with a surface to cut")
    plane, length = _plane(cut, reach.arm), reach.arm.length
    surface = reach.exact.surface()
    curves = plane_cut(surface, "xyz".index(plane.axis), plane.center * length)
    return [curve / length for curve in curves]


def section_picture(reach: Reach, cut: Slice) -> Picture:
    """Section and multiplicity by the plane of a slice; without one across y at the base."""
    from matplotlib.path import Path

    arm, plane = reach.arm, _plane(cut, reach.arm)
    view, at, unit = _VIEWS[plane.axis], plane.center * arm.length, arm.length_unit
    with all_cores:
        curves = section_curves(reach, cut)
        solid = reach.exact if curves else None
        grid = solid.grid if solid is not None and solid.dimension == 3 else None
    ax = _axes(4.6)
    if grid is not None:
        plot_slice(grid, ax=ax, view=view, at=at, unit=unit.name)
        (cells,) = ax.images
        cells.set_alpha((np.asarray(cells.get_array()) > 0).astype(float))
    names = plane_of(view) or "xz"
    across, up = map("xyz".index, names)
    lines = [unit.of(curve[:, [across, up]] * arm.length) for curve in curves]
    for line in lines:
        ax.plot(*line.T, color=_LINE, lw=1.4)
    if lines:
        inside = Path.make_compound_path(*map(Path, lines))
        for cells in ax.images:  # which reach beyond the boundary by up to half of one
            cells.set_clip_path(inside, ax.transData)
        points = np.concatenate(lines)
        room = 0.06 * np.ptp(points, axis=0).max()
        low, high = points.min(axis=0) - room, points.max(axis=0) + room
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    where = f"{plane.axis} = {unit.rounded(at, digits='.3g')}"
    ax.set(xlabel=unit.label(names[0]), ylabel=unit.label(names[1]), aspect="equal")
    ax.set_title(f"section {where}")
    return Picture(arm, _pixels(ax), f"{where}: {_described(curves, plane, arm)}")


def _plane(cut: Slice, arm: Manipulator) -> Slice:
    base = arm.base.position[1] / arm.length
    return Slice(axis="y", center=base) if cut.axis == "none" else cut


def _described(curves: list[Array], plane: Slice, arm: Manipulator) -> str:
    if not curves:
        return "nothing is reached"
    if not all(np.array_equal(curve[0], curve[-1]) for curve in curves):
        return f"{len(curves)} curves"
    area = section_area(curves, "xyz".index(plane.axis)) * arm.length**2
    parts = "one closed curve" if len(curves) == 1 else f"{len(curves)} closed curves"
    return f"{parts}, {arm.length_unit.rounded(area, 2)}"


def swept_parameter(state: StudioState) -> ShownParameter | None:
    """The parameter that is chosen, the first for an unknown one; None for none."""
    sliders = {slider.name: slider for slider in slider_parameters(state.design)}
    name = state.appearance.sweep
    return (sliders.get(name) or next(iter(sliders.values()), None)) if name else None


def sweep_pictures(arm: Manipulator, slider: ShownParameter, quality: Quality) -> Iterator[Picture]:
    """Volumes over the range of a slider, from the design's own value outwards, ever more."""
    unit, known, missing = arm.length_unit, dict[float, tuple[float, float]](), 0
    for value, volume in swept_volumes(arm, slider, quality):
        if volume is None:
            missing += 1
        else:
            known[value] = volume
        ax, text = _axes(3.0), ""
        if known:
            row = sorted(known)
            sizes, errors = unit.of(np.array([known[each] for each in row]), 3).T
            ax.errorbar(row, sizes, errors, fmt=".-", capsize=2.0, color=_LINE)
        if (here := known.get(slider.shown)) is not None:
            ax.plot(slider.shown, unit.of(here[0], 3), "o", color=_HERE, zorder=3)
            text = f"here V = {unit.text(here[0], 3, here[1])} at {slider.shown:g}"
        ax.set(xlabel=slider.label, ylabel=unit.label("V", 3), xlim=slider.limits)
        more = f" · {missing} values make no design or take too long" * bool(missing)
        yield Picture(arm, _pixels(ax), text + more)


def swept_volumes(
    arm: Manipulator, slider: ShownParameter, quality: Quality
) -> Iterator[tuple[float, tuple[float, float] | None]]:
    """Values of a slider, nearest to its own first, and volumes with errors [m³], if known."""
    low, high = slider.limits
    even = np.linspace(low, high, _VALUES)
    steps = np.clip(low + np.round((even - low) / slider.step) * slider.step, low, high)
    values = {round(float(value), 9) for value in steps} | {slider.shown}
    for value in sorted(values, key=lambda value: abs(value - slider.shown)):
        check_wanted()
        volume = None
        with suppress(SoftreachError, OverBudget, MemoryError):
            design = changed(arm.replace(surroundings=()), {slider.name: value * slider.scale})
            volume = _volume(design, quality.coarse_accuracy, quality.tol)
        yield value, volume


@lru_cache(maxsize=512)
def _volume(design: Manipulator, accuracy: float, tol: float) -> tuple[float, float]:
    with all_cores:
        exact = exact_set(design, accuracy, tol, Budget(check_wanted, _SECONDS))
    return exact.volume, exact.volume_error


class Slope(NamedTuple):
    """∂V/∂p for one slider, and its error [m³ per unit of the slider]."""

    value: float
    error: float


class VolumeSlopes(NamedTuple):
    """Slopes of all sliders of a design."""

    arm: Manipulator
    volume: float  # [m³]
    slopes: Mapping[str, Slope]  # by names of parameters; none without a volume that is whole


def volume_slopes(reach: Reach, quality: Quality, check: StaleCheck) -> VolumeSlopes:
    """Slopes of a design whose set is known, for all sliders that move continuously."""
    arm, solid, known = reach.arm, reach.exact, parameters(reach.arm)
    slopes = dict[str, Slope]()
    if solid is None or solid.dimension < 3 or not solid.volume > 0:
        return VolumeSlopes(arm, reach.volume, slopes)
    sliders = slider_parameters(arm)
    scale = {each.name: each.scale for each in sliders if not known[each.name].whole}
    budget = Budget(check, quality.most_seconds)
    # what remains of a torn set are differences between neighbors, which take minutes
    groups = [] if solid.lost_share or solid.is_torn or not scale else [tuple(scale)]
    while groups:
        names = groups.pop()
        try:
            budget()
            with no_warnings(), undivided():  # other cores are for who moves a slider
                gradient = gradient_of(solid, names, quality.fine_accuracy, budget)
        except SoftreachError:  # of one of them, such as a bound at which a bundle is held
            groups += [(name,) for name in names if len(names) > 1]
        except (OverBudget, MemoryError):
            break
        else:
            for name, *row in zip(names, gradient.volume, gradient.volume_error, strict=True):
                slopes[name] = Slope(*(float(value) * scale[name] for value in row))
    return VolumeSlopes(arm, reach.volume, slopes)


class SlopeBar(NamedTuple):
    """Change of the volume over `PART` of the range of a slider."""

    share: float  # of the largest change of all sliders
    text: str
    meaning: str

    def html(self, *, old: bool) -> str:
        """The bar; that of a design before is faded."""
        before = "of the design before; " * old
        return markup.bar(self.share, self.text, before + self.meaning, faded=old)


def slope_bars(
    found: VolumeSlopes, sliders: Mapping[str, tuple[ShownParameter, float]]
) -> dict[str, SlopeBar]:
    """A bar for each slider, by its name."""
    part = {name: PART * ends for name, (_, ends) in sliders.items() if name in found.slopes}
    percent = {name: 100 * step / found.volume for name, step in part.items()}  # per ∂V/∂p
    changes = {name: per * found.slopes[name].value for name, per in percent.items()}
    most, unit = max(map(abs, changes.values()), default=0.0) or 1.0, found.arm.length_unit
    bars = {}
    for name, change in changes.items():
        slope, label = found.slopes[name], unit_in(sliders[name][0].label)
        text = quantity(change, "%", max(percent[name] * slope.error, _FINEST))
        text = f"+{text}" if change > 0 else text.replace("-", "\N{MINUS SIGN}")
        per = f"{unit.symbol(3)} per {label}" if label else unit.symbol(3)
        value, error = (number / unit.scale(3) for number in slope)
        meaning = (
            f"change of V by one hundredth of this slider, "
            f"{f'{part[name]:.3g} {label}'.rstrip()}; ∂V/∂({name}) = {quantity(value, per, error)}"
        )
        bars[name] = SlopeBar(change / most, text, meaning)
    return bars
