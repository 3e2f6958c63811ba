"""How much of its reachable volume an arm keeps under a payload."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from softreach.plot.style import figure_style, small_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.payload import LargestPayload, PayloadCurve

__all__ = ["plot_payload_curve"]


def plot_payload_curve(
    curve: PayloadCurve,
    *,
    ax: Axes | None = None,
    largest: Sequence[LargestPayload] = (),
    label: str | None = None,
) -> Axes:
    """Draw the share of the reachable volume against the payload, with its errors.

    Args:
        curve: What `payload_curve` gives.
        ax: Axes to draw in; None for a new figure.
        largest: Payloads to mark, from `PayloadCurve.largest_payload`.
        label: What a legend calls the curve.

    Returns:
        The axes, payloads in kg.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    points = [(0.0, 1.0), *((one.payload, one.share) for one in largest)]
    points += zip(curve.payloads[1:], curve.shares[1:], strict=True)
    mass, share = zip(*sorted(points), strict=True)
    with figure_style(ax):
        ax = small_axes(3.4, 2.6) if ax is None else ax
        (line,) = ax.plot(mass, share, linewidth=1.2, label=label)
        style = {"fmt": "o", "markersize": 3, "color": line.get_color(), "linewidth": 0.8}
        ax.errorbar(curve.payloads, curve.shares, yerr=curve.share_errors, **style)
        for one in largest:
            ax.vlines(one.payload, 0.0, one.share, color="0.3", linewidth=0.8, linestyle=":")
            ax.hlines(one.share, 0.0, one.payload, color="0.3", linewidth=0.8, linestyle=":")
            ax.plot(one.payload, one.share, "o", markersize=4, mfc="white", color="0.3")
        ax.set(xlabel="payload [kg]", ylabel="share of the volume without payload")
        ax.set(xlim=(0.0, None), ylim=(0.0, None))
        if label is not None:
            ax.legend(loc="upper right")
    return ax
