"""Sections 3 and 4: the atlas of designs, its volumes and curvatures (figures 2a to 3c), and α."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from softreach.arm.designs import minimal_trunk
from softreach.atlas import DesignSpace, build_atlas, open_atlas
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import volume_curve
from softreach.geometry.surface import volume_beyond
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, Verdict, judged
from softreach.plot import atlas_figures, plot_volume_curve
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.workspace import ReachableSet, reachable_set

_ASIDE = 0.3  # L; from there on a place lies far from the plane of symmetry
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
_RADII = (0.02, 0.03, 0.04, 0.05, 0.07, 0.1)
_CURVE = np.geomspace(0.008, 1.0, 120)


def sweep(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """Volumes, unreachability, widths and curvatures of every design of the atlas of section 3."""
    turns = np.radians(np.linspace(0, 108, settings.designs))
    tapers = np.radians(np.linspace(0, 3, settings.designs))
    space = DesignSpace.grid(minimal_trunk(), revolution=turns, taper=tapers)
    sizes: dict[str, Any] = {"alpha_over_length": settings.alpha, "accuracy": settings.accuracy}
    store = notes.folder.parent / _STORE
    atlas = build_atlas(space, store, settings.samples, settings.seed, **sizes)
    for name, figure in atlas_figures(atlas, settings.panels):
        if name in _CAPTIONS:
            label, words = _CAPTIONS[name]
            notes.draw(label, f"figure_{label}_{name}", words, figure)
    curvature = atlas["bending_quantile"].isel(revolution=-1, taper=[0, -1])
    return {
        "designs": int(atlas["volume"].notnull().sum()),
        "samples": settings.samples,
        "revolution_deg": np.degrees(turns).round(6).tolist(),
        "taper_deg": np.degrees(tapers).round(6).tolist(),
        "alpha": atlas["volume"].attrs["alpha_over_length"],
        **shapes(turns, tapers, settings.accuracy),
        "best_taper_deg": _best_tapers(turns[-1], tapers, settings.accuracy),
        "aside_from": _ASIDE,
        "quantiles": curvature["quantile"].values.tolist(),
        "curvature": curvature.transpose("taper", "station", "quantile").values.tolist(),
        **{name: atlas[name].transpose("revolution", "taper").values.tolist() for name in _SCALARS},
    }


def swept_atlas(figures: Path) -> xr.Dataset:
    """The atlas that the sweep left beside the folder of figures."""
    try:
        return open_atlas(figures.parent / _STORE)
    except InvalidInput as error:
        hint = f"remove {figures / 'sweep.json'} too"
        raise InvalidInput("atlas", error.value, error.allowed, hint) from None


def size(n: Numbers) -> Finding:
    words = f"{n.designs} clouds of {n.samples:,} points, and the volume of each"
    return judged(words, n.designs == 256 and n.samples == 400_000)


def widening(n: Numbers) -> Finding:
    aside, helicity, taper = n.aside, _share(n, "aside", 0), _share(n, "aside", 1)
    words = (
        f"the volume beyond {n.aside_from:g} L from that plane grows in {_rises(n, 'aside', 0)} "
        f"steps of Ω and {_rises(n, 'aside', 1)} of φ: without helicity from {aside[0, 0]:.3f} to "
        f"{aside[0, -1]:.3f} L³, at the largest Ω from {aside[-1, 0]:.3f} to "
        f"{aside[-1].max():.3f} at φ = {n.taper_deg[aside[-1].argmax()]:.2g}°, and then down to "
        f"{aside[-1, -1]:.3f} (each ± {np.max(n.aside_error):.1g})"
    )
    return judged(words, min(helicity, taper) > 0.95, helicity > 0.95)


def thickness(n: Numbers) -> Finding:
    thick = n.thickness
    words = (
        f"the mean thickness 2 V/A of the reachable set is {thick[0].min():.3f} to "
        f"{thick[0].max():.3f} L at Ω = {n.revolution_deg[0]:.3g}° and {thick[-1].min():.3f} to "
        f"{thick[-1].max():.3f} L at Ω = {n.revolution_deg[-1]:.4g}° (each ± "
        f"{np.max(n.thickness_error):.1g}); it grows in {_rises(n, 'thickness', 0)} steps of Ω"
    )
    return judged(words, _share(n, "thickness", 0) > 0.95, thick[0].max() < thick[-1].min())


def behind(n: Numbers) -> Finding:
    volume = n.behind
    words = (
        f"the volume behind the arm (y > 0) grows in {_rises(n, 'behind', 1)} steps of φ; at "
        f"the largest Ω from {volume[-1, 0]:.3f} to {volume[-1].max():.3f} L³ at φ = "
        f"{n.taper_deg[volume[-1].argmax()]:.2g}° and {volume[-1, -1]:.3f} at the largest, without "
        f"helicity from {volume[0, 0]:.3f} to {volume[0, -1]:.3f} (each ± "
        f"{np.max(n.behind_error):.1g})"
    )
    return judged(words, _share(n, "behind", 1) > 0.95, volume[-1, -1] > volume[-1, 0])


def hulls(n: Numbers) -> Finding:
    off = n.volume / n.exact_volume - 1
    words = f"α-shapes are {off.min():+.1%} to {off.max():+.1%} off the exact volume"
    return judged(words, np.abs(off).max() < 0.1, np.abs(np.median(off)) < 0.1)


def growth(n: Numbers) -> Finding:
    words = (
        f"the volume of the α-shapes grows in {_rises(n, 'volume', 0)} steps of Ω, the exact "
        f"one in {_rises(n, 'exact_volume', 0)}"
    )
    return judged(words, _share(n, "volume", 0) > 0.95, np.greater(n.volume[-1], n.volume[0]).all())


def maximum(n: Numbers) -> Finding:
    cloud, exact = n.volume, n.exact_volume
    at_two = np.interp(2.0, n.taper_deg, exact[-1])
    places = ", ".join(f"{taper:.2g}° for {ratio}" for ratio, taper in n.best_taper_deg.items())
    words = (
        f"α-shapes of radius {n.alpha:g} L: {cloud.max():.3f} at {_place_of_max(n, cloud)}; "
        f"exact: {exact.max():.5f} ± {np.max(n.exact_volume_error):.0e} at "
        f"{_place_of_max(n, exact)}, and {at_two:.5f} at the largest Ω and φ = 2°. The ratio "
        "R1/R2, misprinted in the paper, was read so as to fit the number, and the best φ at the "
        f"largest Ω depends on it, too: {places}. So neither confirms the reading"
    )
    best = n.taper_deg[exact.argmax() % len(n.taper_deg)]
    off, aside = abs(cloud.max() - 0.67), abs(best - 2)
    return judged(words, off <= 0.005 and aside < 0.05, off < 0.03 and aside < 0.5)


def optimum(n: Numbers) -> Finding:
    best, exact = (n.taper_deg[v.argmax(axis=1)] for v in (n.volume, n.exact_volume))
    words = (
        f"the best φ lies between {best.min():.3g}° and {best.max():.3g}°, depending on Ω; by "
        f"exact volumes between {exact.min():.3g}° and {exact.max():.3g}°"
    )
    return judged(words, best.max() - best.min() > 1.5 * (n.taper_deg[1] - n.taper_deg[0]))


def overtapered(n: Numbers) -> Finding:
    lost, exact = (1 - v[:, -1] / v.max(axis=1) for v in (n.volume, n.exact_volume))
    words = (
        f"φ = {n.taper_deg[-1]:g}° has {lost.min():.0%} to {lost.max():.0%} less volume "
        f"than the best φ (exact volumes: {exact.min():.0%} to {exact.max():.0%})"
    )
    return judged(words, lost.min() > 0)


def decline(n: Numbers) -> Finding:
    exact = n.exact_unreachability
    rise = max(0.0, *(np.diff(exact, axis=k).max() for k in (0, 1)))
    cloud, own = ("unreachability", "exact_unreachability")
    words = (
        f"UNR rises in {_rises(n, cloud, 0)} steps of Ω and {_rises(n, cloud, 1)} of φ; exactly in "
        f"{_rises(n, own, 0)} and {_rises(n, own, 1)}, by {rise:.4f} at most. It falls from "
        f"{exact[0, 0]:.3f} to {exact[-1, -1]:.3f} (exact)"
    )
    worst = max(_share(n, cloud, axis) for axis in (0, 1))
    return judged(words, worst == 0, worst < 0.05)


def curling(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 0.5)
    ratio = tapered / plain
    words = (
        f"median κL of the tapered design rises from {tapered[0]:.1f} at midlength to "
        f"{tapered[-1]:.1f} at the tip, {ratio[0]:.1f} and {ratio[-1]:.1f} times that of "
        "the untapered one"
    )
    return judged(words, ratio.min() > 1 and ratio[-1] == ratio.max(), ratio[-1] > 1)


def spread(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 0.95) - _curvatures(n, 0.05)
    ratio = tapered / plain
    words = (
        f"the middle 90 % of κL spans {ratio[0]:.1f} times as much at midlength and "
        f"{ratio[-1]:.1f} times at the tip"
    )
    return judged(words, ratio.min() > 1)


def cover(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 1.0)
    beyond = [q for q in n.quantiles if _curvatures(n, q)[1, -1] > plain[-1]]
    words = (
        f"at rest both have κ = 0; at the six stations the untapered design reaches κL of at most "
        f"{plain.min():.3g} to {plain.max():.3g}, the tapered one {tapered.min():.3g} to "
        f"{tapered.max():.3g}. At the tip the tapered one exceeds all of the other's in at least "
        f"{1 - min(beyond, default=1.0):.0%} of its configurations"
    )
    return judged(words, (tapered >= plain).all() and beyond)


def _steps(n: Numbers, name: str, axis: int) -> tuple[int, int, int]:
    """Steps along an axis that go up and down by more than the errors, and all."""
    values = getattr(n, name)
    error = getattr(n, f"{name}_error", 0.0 * values)
    if name == "exact_unreachability":  # as much from either of its volumes
        error = 2.0 * (1.0 - values) * n.exact_volume_error / n.exact_volume
    step, error = np.diff(values, axis=axis), np.swapaxes(error, 0, axis)
    bound = np.swapaxes(error[1:] + error[:-1], 0, axis)
    return int((step > bound).sum()), int((step < -bound).sum()), step.size


def _rises(n: Numbers, name: str, axis: int) -> str:
    """Number of steps along an axis that go up, and of those that errors leave open."""
    up, down, every = _steps(n, name, axis)
    return f"{up} of {every}" + f" ({every - up - down} within the errors)" * (up + down < every)


def _share(n: Numbers, name: str, axis: int) -> float:
    """The share of steps that go up, of those that exceed the errors."""
    up, down, _ = _steps(n, name, axis)
    return up / max(up + down, 1)


def _place_of_max(n: Numbers, values: Array) -> str:
    i, j = np.unravel_index(values.argmax(), values.shape)
    return f"Ω = {n.revolution_deg[i]:.4g}°, φ = {n.taper_deg[j]:.4g}°"


def _curvatures(n: Numbers, quantile: float) -> Array:
    """Without and with taper, at each station."""
    return n.curvature[..., n.quantiles.tolist().index(quantile)]


def _best_tapers(turn: float, tapers: Array, accuracy: float) -> dict[float, float]:
    """φ of the largest exact volume at a revolution, by R1/R2 [deg]."""

    def volume(ratio: float, taper: float) -> float:
        trunk = minimal_trunk(turn, taper, radius_ratio=ratio)
        return reachable_set(trunk, accuracy=accuracy).volume

    best = {ratio: max(tapers, key=partial(volume, ratio)) for ratio in _RATIOS}
    return {ratio: round(float(np.degrees(taper)), 6) for ratio, taper in best.items()}


def shapes(revolutions: Array, tapers: Array, accuracy: float) -> dict[str, list[list[float]]]:
    """Shapes of exact reachable sets over (revolution, taper) [rad], by name, with errors.

    Volumes farther than 0.3 L from the plane of symmetry (aside) and on the helical fibers' side,
    y > 0 (behind) [L³]; mean thickness 2 V / A [L].
    """
    accuracy = max(accuracy, _ACCURACY)
    pairs = np.array([[_shape(o, p, accuracy) for p in tapers] for o in revolutions])
    return {
        name + of: pairs[..., row, k].tolist()
        for k, name in enumerate(("aside", "behind", "thickness"))
        for row, of in enumerate(("", "_error"))
    }


def _shape(revolution: float, taper: float, accuracy: float) -> tuple[list[float], list[float]]:
    """Volumes and thickness of a set, and their errors.

    Errors of volumes are three times the change from half the accuracy. The area is that of the
    smooth boundary, as that of the raster still grows with its cells; its error is what the volume
    inside that boundary is off.
    """
    arm = minimal_trunk(revolution, taper)
    reached, coarse = (reachable_set(arm, accuracy=scale * accuracy) for scale in (1.0, 2.0))
    sheets, volumes = coarse.sheets(), _beyond(reached)
    thickness = 2 * reached.volume / sheets.area / arm.length
    errors = [3 * abs(a - b) for a, b in zip(volumes, _beyond(coarse), strict=True)]
    off = abs(sheets.volume / reached.volume - 1) * thickness
    return [*volumes, thickness], [*errors, off]


def _beyond(reached: ReachableSet) -> list[float]:
    """Volumes aside and behind [L³]."""
    surface, length = reached.surface(), reached.arm.length
    aside = (volume_beyond(surface, 0, side * _ASIDE * length, side) for side in (-1, 1))
    return [sum(aside) / length**3, volume_beyond(surface, 1, 0.0) / length**3]


def volume(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """V(α) of the paper's design for two sizes of clouds, and the exact volume."""
    arm = minimal_trunk()
    reached = reachable_set(arm, accuracy=settings.accuracy)
    sizes = (settings.samples // 16, settings.samples)
    clouds = {n: compute_cloud(arm, n, seed=settings.seed).tip for n in sizes}
    curves = {f"{n:,} tips": volume_curve(tips, _CURVE) for n, tips in clouds.items()}
    known: dict[str, Any] = {"exact": reached.volume, "convex": reached.convex_volume}
    words = (
        "Volume of the α-shape of the paper's design against its radius, which the paper does not "
        "state, beside the exact volume of the reachable set and of its convex hull."
    )
    ax = plot_volume_curve(curves, _CURVE, length=arm.length, **known)
    notes.draw("", "alpha_dependence", words, ax)
    return {
        **known,
        "exact_error": reached.volume_error,
        "radii": _RADII,
        "volumes": {str(n): volume_curve(t, np.array(_RADII)).tolist() for n, t in clouds.items()},
    }


def dependence(n: Numbers) -> Finding:
    size, volumes = list(n.volumes.items())[-1]
    values = ", ".join(f"{v:.3f} at {r:g} L" for r, v in zip(n.radii, volumes, strict=True))
    words = (
        f"{int(size):,} points give {values}; the exact volume is {n.exact:.4f} ± "
        f"{n.exact_error:.0e} L³"
    )
    return Finding(words, Verdict.OPEN)
