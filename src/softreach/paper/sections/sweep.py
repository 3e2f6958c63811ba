"""Sections 3 and 4: the atlas of designs, its volumes and its curvatures (figures 2a to 3c)."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import xarray as xr

from softreach.arm.designs import minimal_trunk
from softreach.atlas import DesignSpace, build_atlas, open_atlas
from softreach.geometry.surface import volume_beyond
from softreach.paper.atlas_figures import atlas_figures
from softreach.paper.claims import Finding, Numbers, judged
from softreach.paper.notebook import Notebook, Settings
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.workspace import ReachableSolid, reachable_set

ASIDE = 0.3
"""Distance at which a place begins to lie far from the plane of symmetry [L]."""

_ACCURACY = 1e-2  # finer is not needed for what is shown
_RATIOS = (0.7, 0.75, 0.8, 0.85)
_STORE = "atlas.zarr"
_SCALARS = (
    *("volume", "unreachability", "convex_volume", "exact_volume", "exact_volume_error"),
    *("exact_unreachability", "multiple_volume", "fold_volume"),
)
_CAPTIONS = {
    "clouds": ("2a", "Reachability clouds, colored by the activations of the three bundles."),
    "corners": ("2b", "The corners of the atlas from two opposing sides, the arm drawn in front."),
    "hulls": ("3a", "Concave hulls (α-shapes) of the clouds."),
    "map_volume": ("3b", "Volume of the concave hulls."),
    "map_exact_volume": ("3b", "Exact volume of the reachable sets, for comparison."),
    "map_unreachability": ("3b", "Unreachability of the clouds: 1 - concave / convex volume."),
    "map_exact_unreachability": ("3b", "Exact unreachability, for comparison."),
    "curvature": ("3c", "Curvature at six stations of the distal half, without and with taper."),
}


_SHAPE = ("aside", "behind", "thickness")
"""Volumes farther than `ASIDE` from the plane of symmetry and on the helical fibers' side, y > 0
[L³]; mean thickness 2 V / A [L]."""


def shapes(revolutions: Array, tapers: Array, accuracy: float) -> dict[str, list[list[float]]]:
    """The shapes of exact reachable sets over (revolution, taper) [rad], by name, with errors."""
    accuracy = max(accuracy, _ACCURACY)
    pairs = np.array([[_shape(o, p, accuracy) for p in tapers] for o in revolutions])
    return {
        name + of: pairs[..., row, k].tolist()
        for k, name in enumerate(_SHAPE)
        for row, of in enumerate(("", "_error"))
    }


def swept_atlas(figures: Path) -> xr.Dataset:
    """The atlas that the sweep left beside the folder of figures.

    Raises:
        InvalidInput: It was removed.
    """
    try:
        return open_atlas(figures.parent / _STORE)
    except InvalidInput as error:
        hint = f"remove {figures / 'sweep.json'} too"
        raise InvalidInput("atlas", error.value, error.allowed, hint) from None


def sweep(settings: Settings, notes: Notebook) -> None:
    """Volumes, unreachability, widths and curvatures of every design."""
    atlas = _swept(settings, notes.folder.parent / _STORE)
    curvature = atlas["bending_quantile"].isel(revolution=-1, taper=[0, -1])
    notes.note(
        designs=int(atlas["volume"].notnull().sum()),
        samples=settings.samples,
        revolution_deg=np.degrees(atlas["revolution"].values).round(6).tolist(),
        taper_deg=np.degrees(atlas["taper"].values).round(6).tolist(),
        alpha=atlas["volume"].attrs["alpha_over_length"],
        **shapes(atlas["revolution"].values, atlas["taper"].values, settings.accuracy),
        best_taper_deg=_best_tapers(atlas, settings.accuracy),
        aside_from=ASIDE,
        quantiles=curvature["quantile"].values.tolist(),
        curvature=curvature.transpose("taper", "station", "quantile").values.tolist(),
        **{name: atlas[name].transpose("revolution", "taper").values.tolist() for name in _SCALARS},
    )
    for name, figure in atlas_figures(atlas, settings.panels):
        if name in _CAPTIONS:
            label, words = _CAPTIONS[name]
            notes.draw(label, f"figure_{label}_{name}", words, figure)


def size(n: Numbers) -> Finding:
    words = f"{n['designs']} clouds of {n['samples']:,} points, and the volume of each"
    return judged(words, n["designs"] == 256 and n["samples"] == 400_000)


def widening(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    aside = sweep["aside"]
    best = sweep.taper[int(aside[-1].argmax())]
    words = (
        f"the volume beyond {n['aside_from']:g} L from that plane grows in "
        f"{sweep.rises('aside', 0)} steps of Ω and {sweep.rises('aside', 1)} of φ: without "
        f"helicity from {aside[0, 0]:.3f} to {aside[0, -1]:.3f} L³, at the largest Ω from "
        f"{aside[-1, 0]:.3f} to {aside[-1].max():.3f} at φ = {best:.2g}°, and then down to "
        f"{aside[-1, -1]:.3f} (each ± {sweep['aside_error'].max():.1g})"
    )
    helicity, taper = sweep.share("aside", 0), sweep.share("aside", 1)
    return judged(words, min(helicity, taper) > 0.95, helicity > 0.95)


def thickness(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    thick = sweep["thickness"]
    words = (
        f"the mean thickness 2 V/A of the reachable set is {thick[0].min():.3f} to "
        f"{thick[0].max():.3f} L at Ω = {sweep.revolution[0]:.3g}° and {thick[-1].min():.3f} to "
        f"{thick[-1].max():.3f} L at Ω = {sweep.revolution[-1]:.4g}° (each ± "
        f"{sweep['thickness_error'].max():.1g}); it grows in {sweep.rises('thickness', 0)} steps "
        "of Ω"
    )
    share = sweep.share("thickness", 0)
    return judged(words, share > 0.95, bool(thick[0].max() < thick[-1].min()))


def behind(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    volume = sweep["behind"]
    best = sweep.taper[int(volume[-1].argmax())]
    words = (
        f"the volume behind the arm (y > 0) grows in {sweep.rises('behind', 1)} steps of φ; at "
        f"the largest Ω from {volume[-1, 0]:.3f} to {volume[-1].max():.3f} L³ at φ = {best:.2g}° "
        f"and {volume[-1, -1]:.3f} at the largest, without helicity from {volume[0, 0]:.3f} to "
        f"{volume[0, -1]:.3f} (each ± {sweep['behind_error'].max():.1g})"
    )
    return judged(words, sweep.share("behind", 1) > 0.95, volume[-1, -1] > volume[-1, 0])


def hulls(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    off = sweep["volume"] / sweep["exact_volume"] - 1
    words = f"α-shapes are {off.min():+.1%} to {off.max():+.1%} off the exact volume"
    return judged(words, bool(np.abs(off).max() < 0.1), bool(np.abs(np.median(off)) < 0.1))


def growth(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    cloud = sweep["volume"]
    words = (
        f"the volume of the α-shapes grows in {sweep.rises('volume', 0)} steps of Ω, the exact "
        f"one in {sweep.rises('exact_volume', 0)}"
    )
    return judged(words, sweep.share("volume", 0) > 0.95, bool((cloud[-1] > cloud[0]).all()))


def maximum(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    cloud, exact = sweep["volume"], sweep["exact_volume"]
    at_two = np.interp(2.0, sweep.taper, exact[-1])
    places = ", ".join(f"{taper:.2g}° for {ratio}" for ratio, taper in n["best_taper_deg"].items())
    words = (
        f"α-shapes of radius {n['alpha']:g} L: {cloud.max():.3f} at {sweep.place(cloud.argmax())}; "
        f"exact: {exact.max():.5f} ± {sweep['exact_volume_error'].max():.0e} at "
        f"{sweep.place(exact.argmax())}, and {at_two:.5f} at the largest Ω and φ = 2°. The ratio "
        "R1/R2, misprinted in the paper, was read so as to fit the number, and the best φ at the "
        f"largest Ω depends on it, too: {places}. So neither confirms the reading"
    )
    best = sweep.taper[int(exact.argmax()) % len(sweep.taper)]
    off, aside = abs(cloud.max() - 0.67), abs(best - 2)
    return judged(words, off <= 0.005 and aside < 0.05, off < 0.03 and aside < 0.5)


def optimum(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    best = np.array(sweep.taper)[sweep["volume"].argmax(axis=1)]
    exact = np.array(sweep.taper)[sweep["exact_volume"].argmax(axis=1)]
    words = (
        f"the best φ lies between {best.min():.3g}° and {best.max():.3g}°, depending on Ω; by "
        f"exact volumes between {exact.min():.3g}° and {exact.max():.3g}°"
    )
    return judged(words, best.max() - best.min() > 1.5 * (sweep.taper[1] - sweep.taper[0]))


def overtapered(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    lost = [1 - sweep[name][:, -1] / sweep[name].max(axis=1) for name in ("volume", "exact_volume")]
    words = (
        f"φ = {sweep.taper[-1]:g}° has {lost[0].min():.0%} to {lost[0].max():.0%} less volume "
        f"than the best φ (exact volumes: {lost[1].min():.0%} to {lost[1].max():.0%})"
    )
    return judged(words, lost[0].min() > 0)


def decline(n: Numbers) -> Finding:
    sweep = _Sweep(n)
    exact = sweep["exact_unreachability"]
    rise = max(0.0, *(float(np.diff(exact, axis=k).max()) for k in (0, 1)))
    words = (
        f"UNR rises in {sweep.rises('unreachability', 0)} steps of Ω and "
        f"{sweep.rises('unreachability', 1)} of φ; exactly in "
        f"{sweep.rises('exact_unreachability', 0)} and {sweep.rises('exact_unreachability', 1)}, "
        f"by {rise:.4f} at most. It falls from {exact[0, 0]:.3f} to {exact[-1, -1]:.3f} (exact)"
    )
    worst = max(sweep.share("unreachability", axis) for axis in (0, 1))
    return judged(words, worst == 0, worst < 0.05)


def curling(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    ratio = tapered[:, at[0.5]] / plain[:, at[0.5]]
    words = (
        f"median κL of the tapered design rises from {tapered[0, at[0.5]]:.1f} at midlength to "
        f"{tapered[-1, at[0.5]]:.1f} at the tip, {ratio[0]:.1f} and {ratio[-1]:.1f} times that of "
        "the untapered one"
    )
    return judged(words, bool(ratio.min() > 1 and ratio[-1] == ratio.max()), bool(ratio[-1] > 1))


def spread(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    plain_range, tapered_range = (c[:, at[0.95]] - c[:, at[0.05]] for c in (plain, tapered))
    ratio = tapered_range / plain_range
    words = (
        f"the middle 90 % of κL spans {ratio[0]:.1f} times as much at midlength and "
        f"{ratio[-1]:.1f} times at the tip"
    )
    return judged(words, bool(ratio.min() > 1))


def cover(n: Numbers) -> Finding:
    plain, tapered, at = _curvatures(n)
    most_plain, most = plain[:, at[1.0]], tapered[:, at[1.0]]
    beyond = [q for q in at if tapered[-1, at[q]] > most_plain[-1]]
    words = (
        f"at rest both have κ = 0; at the six stations the untapered design reaches κL of at most "
        f"{most_plain.min():.3g} to {most_plain.max():.3g}, the tapered one {most.min():.3g} to "
        f"{most.max():.3g}. At the tip the tapered one exceeds all of the other's in at least "
        f"{1 - min(beyond, default=1.0):.0%} of its configurations"
    )
    return judged(words, bool((most >= most_plain).all() and beyond))


def _shape(revolution: float, taper: float, accuracy: float) -> tuple[list[float], list[float]]:
    """`_SHAPE` of a set, and its errors.

    Errors of volumes are three times the change from half the accuracy. The area is that of the
    smooth boundary, as that of the raster still grows with its cells; its error is what the volume
    inside that boundary is off.
    """
    arm = minimal_trunk(revolution, taper)
    reached, coarse = (reachable_set(arm, accuracy=scale * accuracy) for scale in (1.0, 2.0))
    assert isinstance(reached, ReachableSolid)
    assert isinstance(coarse, ReachableSolid)
    sheets, volumes = coarse.sheets(), _beyond(reached)
    thickness = 2 * reached.volume / sheets.area / arm.length
    errors = [3 * abs(a - b) for a, b in zip(volumes, _beyond(coarse), strict=True)]
    off = abs(sheets.volume / reached.volume - 1) * thickness
    return [*volumes, thickness], [*errors, off]


def _beyond(reached: ReachableSolid) -> list[float]:
    """Volumes aside and behind [L³]."""
    surface, length = reached.surface(), reached.arm.length
    aside = (volume_beyond(surface, 0, side * ASIDE * length, side) for side in (-1, 1))
    return [sum(aside) / length**3, volume_beyond(surface, 1, 0.0) / length**3]


def _best_tapers(atlas: xr.Dataset, accuracy: float) -> dict[str, float]:
    """φ of the largest exact volume at the largest revolution, by R1/R2 [deg]."""
    turn, tapers = float(atlas["revolution"][-1]), atlas["taper"].values

    def volume(ratio: float, taper: float) -> float:
        trunk = minimal_trunk(turn, taper, radius_ratio=ratio)
        return reachable_set(trunk, accuracy=accuracy).volume

    best = {ratio: max(tapers, key=partial(volume, ratio)) for ratio in _RATIOS}
    return {str(ratio): round(float(np.degrees(taper)), 6) for ratio, taper in best.items()}


def _swept(settings: Settings, store: Path) -> xr.Dataset:
    """The atlas of section 3, computed or continued: revolution from 0 to 108°, taper to 3°."""
    turns = np.radians(np.linspace(0, 108, settings.designs))
    tapers = np.radians(np.linspace(0, 3, settings.designs))
    space = DesignSpace.grid(minimal_trunk(), revolution=turns, taper=tapers)
    return build_atlas(
        space,
        store,
        settings.samples,
        settings.seed,
        alpha_over_length=settings.alpha,
        accuracy=settings.accuracy,
    )


class _Sweep:
    """The atlas's numbers over (revolution, taper), and where they rise."""

    def __init__(self, numbers: Numbers) -> None:
        self.numbers = numbers
        self.revolution = numbers["revolution_deg"]
        self.taper = numbers["taper_deg"]

    def __getitem__(self, name: str) -> Array:
        return np.array(self.numbers[name], float)

    def steps(self, name: str, axis: int) -> tuple[int, int, int]:
        """Steps along an axis that go up and down by more than the errors, and all."""
        stated = self.numbers.get(f"{name}_error")
        error = 0.0 * self[name] if stated is None else np.array(stated, float)
        if name == "exact_unreachability":  # as much from either of its volumes
            error = 2.0 * (1.0 - self[name]) * self["exact_volume_error"] / self["exact_volume"]
        step, error = np.diff(self[name], axis=axis), np.swapaxes(error, 0, axis)
        bound = np.swapaxes(error[1:] + error[:-1], 0, axis)
        return int((step > bound).sum()), int((step < -bound).sum()), step.size

    def rises(self, name: str, axis: int) -> str:
        """Number of steps along an axis that go up, and of those that errors leave open."""
        up, down, every = self.steps(name, axis)
        open_ = f" ({every - up - down} within the errors)" if up + down < every else ""
        return f"{up} of {every}{open_}"

    def share(self, name: str, axis: int) -> float:
        """The share of steps that go up, of those that exceed the errors."""
        up, down, _ = self.steps(name, axis)
        return up / max(up + down, 1)

    def place(self, flat: int | np.intp) -> str:
        i, j = divmod(int(flat), len(self.taper))
        return f"Ω = {self.revolution[i]:.4g}°, φ = {self.taper[j]:.4g}°"


def _curvatures(n: Numbers) -> tuple[Array, Array, dict[float, int]]:
    plain, tapered = np.array(n["curvature"])
    return plain, tapered, {q: k for k, q in enumerate(n["quantiles"])}
