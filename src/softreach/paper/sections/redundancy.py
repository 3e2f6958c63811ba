"""Sections 5 and 6: redundancy (figures 4a to 4d), and places reached with several activations."""

from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import binary_erosion

from softreach import plot
from softreach.arm.designs import minimal_trunk, redundant_trunk
from softreach.atlas import open_atlas
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.dexterity import solution_measure
from softreach.cloud.redundancy import activation_distance, redundancy_summary, tip_density
from softreach.inverse import solve_inverse
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, judged
from softreach.paper.sections.sweep import STORE
from softreach.rod.kinematics import configuration
from softreach.support.arrays import Array
from softreach.workspace import ReachableSet, reachable_set

_RADIUS = 1 / 60  # L, figure 4d
_TARGETS = 2_000
_LABEL = "reached more than once / %"


def redundancy(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """Clouds, activation distances, density, and how many activations reach each place."""
    arms = {"minimal": minimal_trunk(), "redundant": redundant_trunk()}
    clouds, distances, numbers = {}, {}, dict[str, Any]()
    for name, arm in arms.items():
        start = perf_counter()
        clouds[name] = compute_cloud(arm, settings.redundant_samples, seed=settings.seed)
        numbers[f"{name}_seconds"] = perf_counter() - start
        distances[name] = activation_distance(clouds[name], _RADIUS, queries=settings.queries)
        numbers[name] = _found(clouds[name], distances[name])
    words = "The minimal and the redundant design, above their cross-sections at the base."
    panels = [plot.DesignPanel(name, arm) for name, arm in arms.items()]
    notes.draw("4a", "figure_4a_designs", words, plot.plot_designs(panels))
    words = "Clouds by |γ| of the last bundle (b), slabs through the base (c), and the mean "
    words += "activation-space distance (d); isolated points are light gray."
    notes.draw("4b-d", "figure_4bcd_redundancy", words, plot.plot_redundancy(clouds, distances))
    outline = arms["redundant"].outline(0.0)
    offsets, extent = (np.degrees(x).round(9) for x in (outline.center[0][2:], outline.extent[2]))
    numbers |= {"samples": settings.redundant_samples}
    return numbers | {"offsets_deg": offsets, "extent_deg": extent}


def cost(n: Numbers) -> Finding:
    seconds = max(n.minimal_seconds, n.redundant_seconds)
    words = f"{n.samples:,} points in {seconds:.2g} s on this machine"
    return judged(words, n.samples >= 2_000_000 and seconds < 600, seconds < 600)


def split(n: Numbers) -> Finding:
    words = "neither their places nor their extents are printed. We keep the extent of "
    words += "{:g}° for each and put them side by side, at {:g}° and {:g}°"
    return Finding(words.format(n.extent_deg, *n.offsets_deg))


def families(n: Numbers) -> Finding:
    three, (median, low, largest) = n.minimal["solutions"][0], n.redundant["solutions"]
    words = f"three fibers: {three:.2f} activations reach a place (median over inner cells); "
    words += f"four: curves of activations, {median:.2f} long in the median, "
    words += f"below {low:.2f} in a twentieth of the cells, {largest:.1f} at most"
    return judged(words, abs(three - 1) < 0.1 < low)


def uneven(n: Numbers) -> Finding:
    three, four = n.minimal["heterogeneity"], n.redundant["heterogeneity"]
    words = f"the density varies by {four:.0%} of its mean, against {three:.0%}, beyond chance"
    return judged(words, four > three)


def front(n: Numbers) -> Finding:
    (dense, sparse), (near, far) = n.redundant["densities"], n.redundant["distances"]
    words = f"{dense:.3g} points/m³ in front against {sparse:.3g} behind; median D̄ {near:.2f} "
    return judged(f"{words}against {far:.2f}", dense > sparse and near > far)


def small(n: Numbers) -> Finding:
    most = n.minimal["quantiles"]["0.95"]
    return judged(f"median {n.minimal['median']:.3f}, 95 % below {most:.3f}", most < 0.5)


def large(n: Numbers) -> Finding:
    data, most, other = n.redundant, n.redundant["quantiles"]["0.95"], n.minimal["redundant_volume"]
    words = f"median {data['median']:.3f}, 95 % below {most:.3f}; above {data['threshold']:g} in "
    words += f"{data['redundant_volume']:.0%} of the volume, against {other:.0%}"
    return judged(words, most > 0.5 > n.minimal["quantiles"]["0.95"])


def _found(cloud: xr.Dataset, distance: xr.DataArray) -> dict[str, Any]:
    summary, density = redundancy_summary(cloud, distance), tip_density(cloud)
    measure = solution_measure(cloud)["solution_measure"].values
    # the border cuts cells with an empty neighbor
    inner = measure[np.asarray(binary_erosion(measure > 0), bool)]
    filled, y = density["density"].where(density["density"] > 0), density.y
    depth = cloud.tip.values[distance["sample"].values, 1]
    names = ("median", "quantiles", "redundant_volume", "threshold")
    return {name: getattr(summary, name) for name in names} | {
        "heterogeneity": density.attrs["heterogeneity"],
        "densities": [float(filled.where(side).mean()) for side in (y < 0, y > 0)],
        "distances": [np.nanmedian(distance.values[side]) for side in (depth < 0, depth > 0)],
        "solutions": [np.median(inner), np.quantile(inner, 0.05), inner.max(initial=0.0)],
    }


def uniqueness(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """The share of the volume that several activations reach, and the clearest example."""
    atlas = open_atlas(notes.folder.parent / STORE)
    share = atlas["multiple_volume"] / atlas["exact_volume"]
    worst = share.isel(share.argmax(...))  # pyright: ignore[reportArgumentType]
    turn, taper = float(worst["revolution"]), float(worst["taper"])
    arms = minimal_trunk(), minimal_trunk(turn, taper)
    paper, clearest = (reachable_set(arm, accuracy=settings.accuracy) for arm in arms)
    tip, activations = _clearest_pair(clearest)
    mapped = atlas.assign({_LABEL: 100 * share.assign_attrs(units="1")})
    words = "Share of the reachable volume that several activations reach: where it is 0, three "
    words += "fibers are single-valued."
    notes.draw("", "uniqueness", words, plot.plot_metric_map(mapped, _LABEL))
    if len(activations):
        words = f"{len(activations)} activations of one three-fiber arm with the same tip."
        shown = arms[1], configuration(arms[1], activations)
        notes.draw("", "same_tip", words, plot.plot_arm(*shown, view="oblique", rest=False))
    # two fibers, and one: areas and lengths for L = 1 m
    fewer = [arms[0].replace(actuators=arms[0].actuators[:count]) for count in (2, 1)]
    surface, curve = (reachable_set(arm) for arm in fewer)
    found: Any = {
        "share": share.transpose("revolution", "taper").values,
        "worst": float(worst),
        "revolution_deg": np.degrees(turn),
        "taper_deg": np.degrees(taper),
        "paper_share": 1 - paper.multiplicity[1] / paper.volume,
        "tip": tip,
    }
    return found | {"activations": activations, "area": surface.area, "curve": curve.curve_length}


def unique(n: Numbers) -> Finding:
    example = "No place with two activations was found"
    if len(n.activations) > 1:
        *rows, tip = (", ".join(f"{x:.3f}" for x in row) for row in (*n.activations, n.tip))
        example = f"In the latter design γ = ({'); ('.join(rows)}) all reach ({tip}) m"
    words = f"{n.paper_share:.2%} of the volume is reached by more than one activation at Ω = 108°,"
    words += f" φ = 2°, up to {n.worst:.1%} at Ω = {n.revolution_deg:.4g}°, φ = {n.taper_deg:.3g}°;"
    words += f" less than 0.1 % in {(n.share < 1e-3).sum()} of {n.share.size} designs. {example}"
    return judged(words, len(n.activations) < 2, n.worst < 0.1)


def dimension(n: Numbers) -> Finding:
    words = f"two fibers sweep a surface of {n.area:.3f} L², one fiber a curve of {n.curve:.3f} L "
    words += "(of the minimal design, in the order of its fibers)"
    return judged(words, min(n.area, n.curve) > 1e-6)


def _clearest_pair(reached: ReachableSet) -> tuple[Array, Array]:
    """Tip and activations, of places that several activations reach, where these differ most."""
    places = np.argwhere(reached.grid["count"].values > 1)
    places = places[:: max(1, len(places) // _TARGETS)]
    tips = np.stack([reached.grid[x].values[k] for x, k in zip("xyz", places.T, strict=True)], 1)
    solutions = [s for s in solve_inverse(reached.arm, tips) if len(s) > 1]
    if not solutions:
        return np.zeros(3), np.empty((0, 3))
    best = max(solutions, key=lambda s: np.linalg.norm(s.activations[0] - s.activations[-1]))
    return best.target, best.activations
