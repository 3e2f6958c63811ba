"""Histograms of the activations of the samples that are shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.schema import activation_symbols
from softreach.studio.plots.plot import (
    Picture,
    PicturePlot,
    blank_figure,
    complete_reach,
    pixels,
)
from softreach.studio.reach import Reach, cloud_points, shown_samples
from softreach.studio.scene.clouds import in_slice
from softreach.studio.state import Slice, rod_of
from softreach.studio.work import StaleCheck
from softreach.support.palette import bundle_color

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.studio.session import Session

Array = NDArray[np.float64]

_BINS = 40


def shares(activation: Array, bounds: Array, bins: int = _BINS) -> Array:
    """The share of samples in even bins between the bounds of each bundle.

    Args:
        activation: Shape (sample, bundle).
        bounds: Shape (bundle, 2).
        bins: How many.

    Returns:
        Shape (bundle, bins); rows sum up to 1, or to 0 without samples.
    """
    rows = zip(activation.T, bounds, strict=True)
    counts = [np.histogram(values, bins, _ends(*limits))[0] for values, limits in rows]
    return np.array(counts) / max(len(activation), 1)


def histogram_picture(
    reach: Reach,
    level: int,
    cut: Slice,
    present: Sequence[float],
    solutions: Array | None = None,
    *,
    dark: bool = False,
) -> Picture:
    """Draw a histogram for each bundle, of the samples that the slice leaves.

    Args:
        reach: Of the design.
        level: Of the samples that are shown.
        cut: The slice.
        present: Activation of the arm, drawn as a line.
        solutions: Of the inverse problem, drawn as marks; shape (n, bundles).
        dark: Whether the page is.
    """
    kept = in_slice(cloud_points(reach, level), cut)
    activation = reach.cloud.activation.values[shown_samples(reach, level)][kept]
    figure = blank_figure(0.5 + 0.95 * reach.arm.inputs)
    axes = figure.subplots(reach.arm.inputs, 1, squeeze=False)[:, 0]
    bounds = np.array(rod_of(reach.arm).box.bounds)
    share = shares(activation, bounds)
    for k, ax in enumerate(axes):
        _draw(ax, share[k], bounds[k], bundle_color(k))
        ax.axvline(present[k], color="0.15", lw=1.5)
        if solutions is not None and len(solutions):
            height = np.full(len(solutions), 104 * max(share[k].max(initial=0), 1e-9))
            ax.plot(solutions[:, k], height, "v", color="0.15", ms=6, clip_on=False)
        ax.set_xlabel(_label(reach.arm, k), labelpad=1)
    figure.supylabel("share of the samples [%]", fontsize=10)
    return Picture(
        reach.arm, pixels(figure, dark=dark), _described(reach.arm, len(activation), cut, solutions)
    )


def _draw(ax: Axes, share: Array, limits: Array, color: tuple[float, float, float]) -> None:
    low, high = _ends(*limits)
    edges = np.linspace(low, high, len(share) + 1)
    ax.bar(edges[:-1], 100 * share, np.diff(edges), align="edge", color=color, alpha=0.75)
    ax.set_xlim(low, high)
    ax.spines[["top", "right"]].set_visible(False)
    ax.set_ylim(0, max(100 * share.max(initial=0) * 1.12, 1e-6))


def _ends(low: float, high: float) -> tuple[float, float]:
    """Bounds, with room between them for a fixed bundle."""
    room = 1e-6 * max(1.0, abs(low))
    return float(low), float(max(high, low + room))


def _label(arm: Manipulator, bundle: int) -> str:
    unit = arm.input_units[bundle]
    symbol = activation_symbols(arm.input_units)[bundle]
    # A name is shown as it is: matplotlib would set what is between dollars.
    name = arm.input_names[bundle].replace("$", r"\$")
    return f"{symbol} {name}" + (f" [{unit}]" if unit != "1" else "")


def _described(arm: Manipulator, samples: int, cut: Slice, solutions: Array | None) -> str:
    center = arm.length_unit.rounded(cut.center * arm.length, digits=".3g")
    where = "" if cut.axis == "none" else f" within the slice {cut.axis} = {center}"
    marks = " Triangles are solutions of the inverse problem." if solutions is not None else ""
    return f"{samples:,} samples{where}; the line is the present activation.{marks}"


class HistogramPlot(PicturePlot):
    """Picture of a histogram for each bundle."""

    name = "histogram"
    label = "activations"
    hint = "how often the samples that the slice leaves pull each bundle how much"
    depends_on = (
        "appearance.level", "appearance.slice", "appearance.dark", "activation", "target",
    )  # fmt: skip
    sources = frozenset({"reach", "answer"})

    @staticmethod
    def compute(session: Session, check: StaleCheck) -> Iterator[Picture]:
        """Draw them, once the cloud is complete."""
        del check
        state, reach = session.state, complete_reach(session)
        if reach is not None:
            look, answer = state.appearance, session.answer
            solutions = None if answer is None else answer.activations
            yield histogram_picture(
                reach, look.level, look.slice, state.activation, solutions, dark=look.dark
            )
