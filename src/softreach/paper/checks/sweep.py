"""The atlas: its volumes, unreachability, shapes and curvatures."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.paper.verdict import Finding, Numbers, judged

__all__ = [
    "behind",
    "cover",
    "curling",
    "decline",
    "growth",
    "hulls",
    "maximum",
    "optimum",
    "size",
    "spread",
    "thickness",
    "widening",
]

Array = NDArray[np.float64]


class _Sweep:
    """The atlas's numbers over (revolution, taper), and where they rise."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers = numbers
        self.revolution = numbers["revolution_deg"]
        self.taper = numbers["taper_deg"]

    def __getitem__(self, name: str) -> Array:
        return np.array(self.numbers[name], float)

    def place(self, flat: int | np.intp) -> str:
        """A design by its number."""
        i, j = divmod(int(flat), len(self.taper))
        return f"Ω = {self.revolution[i]:.4g}°, φ = {self.taper[j]:.4g}°"


def _rises(values: Array, axis: int) -> str:
    """How many steps along an axis go up."""
    step = np.diff(values, axis=axis)
    return f"{int((step > 0).sum())} of {step.size}"


def size(n: Numbers) -> Finding:
    """How many designs and points."""
    words = f"{n['designs']} clouds of {n['samples']:,} points"
    return judged(words, n["designs"] == 256 and n["samples"] == 400_000)


def widening(n: Numbers) -> Finding:
    """Distance from the plane of symmetry."""
    spread = _Sweep(n)["spread"]
    words = (
        f"the mean distance from that plane is {spread[0, 0]:.3f} L without either, "
        f"{spread[-1, 0]:.3f} L with the largest Ω alone, {spread[0, -1]:.3f} L with the largest "
        f"φ alone, but {spread[-1, -1]:.3f} L with both; it grows in {_rises(spread, 0)} steps of "
        f"Ω and {_rises(spread, 1)} of φ"
    )
    always = all((np.diff(spread, axis=axis) > 0).all() for axis in (0, 1))
    return judged(words, always, spread[0, 0] < min(spread[-1, 0], spread[0, -1]))


def thickness(n: Numbers) -> Finding:
    """How flat the clouds without helicity are."""
    sweep = _Sweep(n)
    share = sweep["exact_volume"] / sweep["exact_volume"].max()
    words = (
        f"at Ω = {sweep.revolution[0]:.3g}° designs fill {share[0].min():.0%} to "
        f"{share[0].max():.0%} of the largest volume, at Ω = {sweep.revolution[-1]:.4g}° "
        f"{share[-1].min():.0%} to {share[-1].max():.0%}"
    )
    thicker = bool(share[0].max() < share[-1].min())
    return judged(words, thicker and share[0].max() < 0.1, thicker)


def behind(n: Numbers) -> Finding:
    """Share of the volume on the helical side."""
    behind = _Sweep(n)["behind"]
    words = (
        f"the share of the volume behind the arm (y > 0) grows with φ from {behind[-1, 0]:.0%} to "
        f"{behind[-1, -1]:.0%} at the largest Ω; without helicity it goes from {behind[0, 0]:.0%} "
        f"to {behind[0, -1]:.0%}"
    )
    rises = behind[:, -1] > behind[:, 0]
    return judged(words, bool(rises.all()), bool(rises[-1]))


def hulls(n: Numbers) -> Finding:
    """α-shapes against exact volumes."""
    sweep = _Sweep(n)
    off = sweep["volume"] / sweep["exact_volume"] - 1
    words = f"α-shapes are {off.min():+.1%} to {off.max():+.1%} off the exact volume"
    return judged(words, bool(np.abs(off).max() < 0.1), bool(np.abs(np.median(off)) < 0.1))


def growth(n: Numbers) -> Finding:
    """Volume over Ω."""
    sweep = _Sweep(n)
    exact, cloud = sweep["exact_volume"], sweep["volume"]
    words = (
        f"the exact volume grows in {_rises(exact, 0)} steps of Ω, that of the α-shapes in "
        f"{_rises(cloud, 0)}"
    )
    return judged(words, bool((np.diff(exact, axis=0) > 0).all()))


def maximum(n: Numbers) -> Finding:
    """The largest volume and its place."""
    sweep = _Sweep(n)
    cloud, exact = sweep["volume"], sweep["exact_volume"]
    words = (
        f"α-shapes of radius {n['alpha']:g} L: {cloud.max():.3f} at {sweep.place(cloud.argmax())}; "
        f"exact: {exact.max():.3f} at {sweep.place(exact.argmax())}. The α-shape depends on a "
        "radius that the paper does not state and reads low"
    )
    best = sweep.taper[int(cloud.argmax()) % len(sweep.taper)]
    return judged(words, abs(cloud.max() - 0.67) < 0.01 and abs(best - 2) < 0.3, best > 1)


def optimum(n: Numbers) -> Finding:
    """The best φ for each Ω."""
    sweep = _Sweep(n)
    best = np.array(sweep.taper)[sweep["exact_volume"].argmax(axis=1)]
    words = f"the best φ lies between {best.min():.3g}° and {best.max():.3g}°, depending on Ω"
    return judged(words, best.max() > best.min())


def decline(n: Numbers) -> Finding:
    """UNR over Ω and φ."""
    unr = _Sweep(n)["exact_unreachability"]
    steps = [np.diff(unr, axis=k) for k in (0, 1)]
    worst = max(float(step.max()) for step in steps)
    words = (
        f"exact UNR rises in {_rises(unr, 0)} steps of Ω and {_rises(unr, 1)} of φ, by "
        f"{max(worst, 0):.4f} at most; from {unr[0, 0]:.3f} to {unr[-1, -1]:.3f}"
    )
    return judged(words, worst <= 0, worst < 0.01)


def _curvatures(n: Numbers) -> tuple[Array, Array, dict[float, int]]:
    plain, tapered = np.array(n["curvature"])
    return plain, tapered, {q: k for k, q in enumerate(n["quantiles"])}


def curling(n: Numbers) -> Finding:
    """Curvature toward the tip."""
    plain, tapered, at = _curvatures(n)
    middle = tapered[:, at[0.5]]
    words = (
        f"median κL of the tapered design rises from {middle[0]:.1f} to {middle[-1]:.1f} along the "
        f"distal half; of the untapered one from {plain[0, at[0.5]]:.1f} to "
        f"{plain[-1, at[0.5]]:.1f}"
    )
    return judged(words, bool((np.diff(middle) > 0).all()))


def spread(n: Numbers) -> Finding:
    """Range of curvature."""
    plain, tapered, at = _curvatures(n)
    plain_range, tapered_range = (c[:, at[0.95]] - c[:, at[0.05]] for c in (plain, tapered))
    ratio = tapered_range / plain_range
    words = (
        f"the middle 90 % of κL spans {ratio[0]:.1f} times as much at midlength and "
        f"{ratio[-1]:.1f} times at the tip"
    )
    return judged(words, bool(ratio.min() > 1))


def cover(n: Numbers) -> Finding:
    """Whose curvatures hold the other's."""
    plain, tapered, at = _curvatures(n)
    low, high = tapered[-1, at[0.0]], tapered[-1, at[1.0]]
    covered = low <= plain[-1, at[0.05]] and plain[-1, at[0.95]] <= high
    beyond = [q for q in at if tapered[-1, at[q]] > plain[-1, at[1.0]]]
    words = (
        f"at the tip the tapered design spans κL from {low:.2g} to {high:.3g}, the untapered one "
        f"from {plain[-1, at[0.0]]:.2g} to {plain[-1, at[1.0]]:.3g}; the tapered one exceeds all "
        f"of that in at least {1 - min(beyond, default=1.0):.0%} of its configurations"
    )
    return judged(words, bool(covered and beyond))
