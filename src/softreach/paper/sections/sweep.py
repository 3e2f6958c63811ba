"""Sections 3 and 4: the atlas of designs, its volumes and curvatures (figures 2a to 3c), and α."""

from typing import Any

import numpy as np

from softreach.arm.designs import minimal_trunk
from softreach.atlas import DesignSpace, build_atlas
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import volume_curve
from softreach.geometry.surface import volume_beyond
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, judged
from softreach.plot import atlas_figures
from softreach.support.arrays import Array
from softreach.workspace import ReachableSet, reachable_set

_ASIDE = 0.3  # L; from there on a place lies far from the plane of symmetry
_ACCURACY = 1e-2  # finer is not needed for what is shown
_RATIOS = (0.7, 0.75, 0.8, 0.85)
_SCALARS = ("volume", "unreachability", "exact_volume", "exact_unreachability")
STORE = "atlas.zarr"  # The atlas of the sweep, beside the folder of figures
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
_RADII = np.array([0.02, 0.03, 0.04, 0.05, 0.07, 0.1])


def sweep(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """Volumes, unreachability, widths and curvatures of every design of the atlas of section 3."""
    turns = np.radians(np.linspace(0, 108, settings.designs))
    tapers = np.radians(np.linspace(0, 3, settings.designs))
    space = DesignSpace.grid(minimal_trunk(), revolution=turns, taper=tapers)
    sizes: dict[str, Any] = {"alpha_over_length": settings.alpha, "accuracy": settings.accuracy}
    store = notes.folder.parent / STORE
    atlas = build_atlas(space, store, settings.samples, settings.seed, **sizes)
    for name, figure in atlas_figures(atlas, settings.panels):
        if name in _CAPTIONS:
            label, words = _CAPTIONS[name]
            notes.draw(label, f"figure_{label}_{name}", words, figure)
    grid = atlas.transpose("revolution", "taper", ...)
    wound = turns[-1], tapers, settings.accuracy
    curvature = atlas["bending_quantile"].isel(revolution=-1, taper=[0, -1])
    found: dict[str, Any] = {
        "designs": int(atlas["volume"].notnull().sum()),
        "samples": settings.samples,
    }
    found["revolution_deg"] = np.degrees(turns).round(6)
    found["taper_deg"] = np.degrees(tapers).round(6)
    found |= {"alpha": atlas["volume"].attrs["alpha_over_length"]}
    found |= shapes(turns, tapers, settings.accuracy)
    found |= {"best_taper_deg": {ratio: _best_taper(ratio, *wound) for ratio in _RATIOS}}
    found |= {"quantiles": curvature["quantile"].values}
    found |= {"curvature": curvature.transpose("taper", "station", "quantile").values}
    return found | {name: grid[name].values for name in (*_SCALARS, "exact_volume_error")}


def size(n: Numbers) -> Finding:
    words = f"{n.designs} clouds of {n.samples:,} points, and the volume of each"
    return judged(words, n.designs == 256 and n.samples == 400_000)


def widening(n: Numbers) -> Finding:
    (turned, by_turn), (tapered, by_taper) = (_rises(n, "aside", axis) for axis in (0, 1))
    straight, wound = n.aside[0], n.aside[-1]
    words = f"the volume beyond {_ASIDE:g} L from that plane grows in {turned} steps of Ω and "
    words += f"{tapered} of φ: without helicity from {straight[0]:.3f} to {straight[-1]:.3f} L³, "
    words += f"at the largest Ω from {wound[0]:.3f} to {wound.max():.3f} at φ = "
    words += f"{n.taper_deg[wound.argmax()]:.2g}°, and then down to {wound[-1]:.3f} "
    words += f"(each ± {np.max(n.aside_error):.1g})"
    return judged(words, min(by_turn, by_taper) > 0.95, by_turn > 0.95)


def thickness(n: Numbers) -> Finding:
    (thin, *_, thick), turns = n.thickness, n.revolution_deg
    grows, share = _rises(n, "thickness", 0)
    words = f"the mean thickness 2 V/A of the reachable set is {thin.min():.3f} to "
    words += f"{thin.max():.3f} L at Ω = {turns[0]:.3g}° and {thick.min():.3f} to "
    words += f"{thick.max():.3f} L at Ω = {turns[-1]:.4g}° (each ± "
    words += f"{np.max(n.thickness_error):.1g}); it grows in {grows} steps of Ω"
    return judged(words, share > 0.95, thin.max() < thick.min())


def behind(n: Numbers) -> Finding:
    straight, wound, (grows, share) = n.behind[0], n.behind[-1], _rises(n, "behind", 1)
    words = f"the volume behind the arm (y > 0) grows in {grows} steps of φ; at the largest Ω from "
    words += f"{wound[0]:.3f} to {wound.max():.3f} L³ at φ = {n.taper_deg[wound.argmax()]:.2g}° "
    words += f"and {wound[-1]:.3f} at the largest, without helicity from {straight[0]:.3f} to "
    words += f"{straight[-1]:.3f} (each ± {np.max(n.behind_error):.1g})"
    return judged(words, share > 0.95, wound[-1] > wound[0])


def hulls(n: Numbers) -> Finding:
    off = n.volume / n.exact_volume - 1
    words = f"α-shapes are {off.min():+.1%} to {off.max():+.1%} off the exact volume"
    return judged(words, np.abs(off).max() < 0.1, np.abs(np.median(off)) < 0.1)


def growth(n: Numbers) -> Finding:
    (grows, share), (exact, _) = (_rises(n, name, 0) for name in ("volume", "exact_volume"))
    words = f"the volume of the α-shapes grows in {grows} steps of Ω, the exact one in {exact}"
    return judged(words, share > 0.95, np.greater(n.volume[-1], n.volume[0]).all())


def maximum(n: Numbers) -> Finding:
    cloud, exact = n.volume, n.exact_volume
    at_two = np.interp(2.0, n.taper_deg, exact[-1])
    places = ", ".join(f"{taper:.2g}° for {ratio}" for ratio, taper in n.best_taper_deg.items())
    words = f"α-shapes of radius {n.alpha:g} L: {cloud.max():.3f} at {_place_of_max(n, cloud)}; "
    words += f"exact: {exact.max():.5f} ± {np.max(n.exact_volume_error):.0e} at "
    words += f"{_place_of_max(n, exact)}, and {at_two:.5f} at the largest Ω and φ = 2°. The ratio "
    words += "R1/R2, misprinted in the paper, was read so as to fit the number, and the best φ at "
    words += f"the largest Ω depends on it, too: {places}. So neither confirms the reading"
    best = n.taper_deg[exact.argmax() % len(n.taper_deg)]
    off, aside = abs(cloud.max() - 0.67), abs(best - 2)
    return judged(words, off <= 0.005 and aside < 0.05, off < 0.03 and aside < 0.5)


def optimum(n: Numbers) -> Finding:
    best, exact = (n.taper_deg[v.argmax(axis=1)] for v in (n.volume, n.exact_volume))
    words = f"the best φ lies between {best.min():.3g}° and {best.max():.3g}°, depending on Ω; "
    words += f"by exact volumes between {exact.min():.3g}° and {exact.max():.3g}°"
    return judged(words, best.max() - best.min() > 1.5 * (n.taper_deg[1] - n.taper_deg[0]))


def overtapered(n: Numbers) -> Finding:
    lost, exact = (1 - v[:, -1] / v.max(axis=1) for v in (n.volume, n.exact_volume))
    words = f"φ = {n.taper_deg[-1]:g}° has {lost.min():.0%} to {lost.max():.0%} less volume than "
    words += f"the best φ (exact volumes: {exact.min():.0%} to {exact.max():.0%})"
    return judged(words, lost.min() > 0)


def decline(n: Numbers) -> Finding:
    exact, names = n.exact_unreachability, ("unreachability", "exact_unreachability")
    rise = max(0.0, *(np.diff(exact, axis=k).max() for k in (0, 1)))
    cloud, own = ([_rises(n, name, axis) for axis in (0, 1)] for name in names)
    words = f"UNR rises in {cloud[0][0]} steps of Ω and {cloud[1][0]} of φ; exactly in {own[0][0]} "
    words += f"and {own[1][0]}, by {rise:.4f} at most. It falls from {exact[0, 0]:.3f} to "
    words += f"{exact[-1, -1]:.3f} (exact)"
    worst = max(share for _, share in cloud)
    return judged(words, worst == 0, worst < 0.05)


def curling(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 0.5)
    ratio = tapered / plain
    words = f"median κL rises from {tapered[0]:.1f} at midlength to {tapered[-1]:.1f} at the tip "
    words += f"with taper, {ratio[0]:.1f} and {ratio[-1]:.1f} times that without"
    return judged(words, ratio.min() > 1 and ratio[-1] == ratio.max(), ratio[-1] > 1)


def spread(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 0.95) - _curvatures(n, 0.05)
    ratio = tapered / plain
    words = f"the middle 90 % of κL spans {ratio[0]:.1f} times as much at midlength and "
    return judged(f"{words}{ratio[-1]:.1f} times at the tip", ratio.min() > 1)


def cover(n: Numbers) -> Finding:
    plain, tapered = _curvatures(n, 1.0)
    beyond = [q for q in n.quantiles if _curvatures(n, q)[1, -1] > plain[-1]]
    words = "at rest both have κ = 0; at the six stations the untapered design reaches κL of at "
    words += f"most {plain.min():.3g} to {plain.max():.3g}, the tapered one {tapered.min():.3g} "
    words += f"to {tapered.max():.3g}. At the tip the tapered one exceeds all of the other's in at "
    words += f"least {1 - min(beyond, default=1.0):.0%} of its configurations"
    return judged(words, (tapered >= plain).all() and beyond)


def _rises(n: Numbers, name: str, axis: int) -> tuple[str, float]:
    """Steps along an axis that go up, in words, and their share of those that exceed the errors."""
    values = getattr(n, name)
    error = getattr(n, f"{name}_error", 0.0 * values)
    if name == "exact_unreachability":  # as much from either of its volumes
        error = 2.0 * (1.0 - values) * n.exact_volume_error / n.exact_volume
    step, error = np.diff(values, axis=axis), np.swapaxes(error, 0, axis)
    bound = np.swapaxes(error[1:] + error[:-1], 0, axis)
    up, down, every = int((step > bound).sum()), int((step < -bound).sum()), step.size
    within = f" ({every - up - down} within the errors)" * (up + down < every)
    return f"{up} of {every}{within}", up / max(up + down, 1)


def _place_of_max(n: Numbers, values: Array) -> str:
    i, j = np.unravel_index(values.argmax(), values.shape)
    return f"Ω = {n.revolution_deg[i]:.4g}°, φ = {n.taper_deg[j]:.4g}°"


def _curvatures(n: Numbers, quantile: float) -> Array:
    return n.curvature[..., n.quantiles.tolist().index(quantile)]


def _best_taper(ratio: float, turn: float, tapers: Array, accuracy: float) -> float:
    """φ of the largest exact volume at a revolution, of trunks of a ratio R1/R2 [deg]."""
    trunks = (minimal_trunk(turn, taper, radius_ratio=ratio) for taper in tapers)
    volumes = [reachable_set(trunk, accuracy=accuracy).volume for trunk in trunks]
    return round(float(np.degrees(tapers[np.argmax(volumes)])), 6)


def shapes(revolutions: Array, tapers: Array, accuracy: float) -> dict[str, Array]:
    """Shapes of exact reachable sets over (revolution, taper) [rad], by name, with errors.

    Volumes farther than 0.3 L from the plane of symmetry (aside) and on the helical fibers' side,
    y > 0 (behind) [L³]; mean thickness 2 V / A [L].
    """
    accuracy = max(accuracy, _ACCURACY)
    pairs = np.array([[_shape(o, p, accuracy) for p in tapers] for o in revolutions])
    names = ("aside", "behind", "thickness", "aside_error", "behind_error", "thickness_error")
    return dict(zip(names, np.moveaxis(pairs.reshape(*pairs.shape[:2], 6), -1, 0), strict=True))


def _shape(revolution: float, taper: float, accuracy: float) -> Array:
    """Volumes aside and behind [L³] and thickness of a set [L], and their errors, shape (2, 3).

    Errors of volumes are three times the change from half the accuracy. The area is that of the
    smooth boundary, as that of the raster still grows with its cells; its error is what the volume
    inside that boundary is off. The arm is 1 m long.
    """
    arm = minimal_trunk(revolution, taper)
    reached, coarse = (reachable_set(arm, accuracy=scale * accuracy) for scale in (1.0, 2.0))
    sheets, volumes, others = coarse.sheets(), _beyond(reached), _beyond(coarse)
    thickness = 2 * reached.volume / sheets.area
    off = abs(sheets.volume / reached.volume - 1) * thickness
    return np.array([[*volumes, thickness], [*3 * np.abs(volumes - others), off]])


def _beyond(reached: ReachableSet) -> Array:
    surface = reached.surface()
    aside = sum(volume_beyond(surface, 0, side * _ASIDE, side) for side in (-1, 1))
    return np.array([aside, volume_beyond(surface, 1, 0.0)])


def volume(settings: Settings, _: Notebook) -> dict[str, Any]:
    """V(α) of the paper's design, and the exact volume."""
    arm = minimal_trunk()
    reached = reachable_set(arm, accuracy=settings.accuracy)
    tips = compute_cloud(arm, settings.samples, seed=settings.seed).tip
    known = {"exact": reached.volume, "exact_error": reached.volume_error, "radii": _RADII}
    return known | {"samples": settings.samples, "volumes": volume_curve(tips, _RADII)}


def dependence(n: Numbers) -> Finding:
    values = ", ".join(f"{v:.3f} at {r:g} L" for r, v in zip(n.radii, n.volumes, strict=True))
    exact = f"the exact volume is {n.exact:.4f} ± {n.exact_error:.0e} L³"
    return Finding(f"{n.samples:,} points give {values}; {exact}")
