"""Section 5: the minimal and the redundant design (figures 4a to 4d)."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.dexterity import solution_measure
from softreach.cloud.redundancy import activation_distance, redundancy_summary, tip_density
from softreach.paper.claims import Finding, Numbers, Verdict, judged
from softreach.paper.notebook import Notebook, Settings
from softreach.plot import DesignPanel, plot_designs, plot_distance_histograms, plot_redundancy

_RADIUS = 1 / 60  # L, figure 4d


def redundancy(settings: Settings, notes: Notebook) -> None:
    """Clouds, activation distances, density, and how many activations reach each place."""
    arms = {"minimal": designs.minimal_trunk(), "redundant": designs.redundant_trunk()}
    clouds = {name: _cloud(name, arm, settings, notes) for name, arm in arms.items()}
    distances = {
        name: activation_distance(cloud, _RADIUS, queries=settings.queries)
        for name, cloud in clouds.items()
    }
    notes.note(
        samples=settings.redundant_samples,
        queries=settings.queries,
        radius=_RADIUS,
        offsets_deg=np.degrees(arms["redundant"].outline(0.0).center[0][2:]).round(9).tolist(),
        extent_deg=float(np.degrees(arms["redundant"].outline(0.0).extent[2]).round(9)),
        **{name: _found(clouds[name], distances[name]) for name in arms},
    )
    _draw(arms, clouds, distances, notes)


def cost(n: Numbers) -> Finding:
    seconds = max(n["minimal_seconds"], n["redundant_seconds"])
    words = f"{n['samples']:,} points in {seconds:.2g} s on this machine"
    return judged(words, n["samples"] >= 2_000_000 and seconds < 600, seconds < 600)


def split(n: Numbers) -> Finding:
    first, second = n["offsets_deg"]
    words = (
        "neither their places nor their extents are printed. We keep the extent of "
        f"{n['extent_deg']:g}° for each and put them side by side, at {first:g}° and {second:g}°"
    )
    return Finding(words, Verdict.OPEN)


def families(n: Numbers) -> Finding:
    three, four = n["minimal"], n["redundant"]
    words = (
        f"three fibers: {three['solution_median']:.2f} activations reach a place (median over "
        f"inner cells); four: curves of activations, {four['solution_median']:.2f} long in the "
        f"median, below {four['solution_low']:.2f} in a twentieth of the cells, "
        f"{four['solution_largest']:.1f} at most"
    )
    return judged(words, abs(three["solution_median"] - 1) < 0.1 < four["solution_low"])


def uneven(n: Numbers) -> Finding:
    three, four = n["minimal"]["heterogeneity"], n["redundant"]["heterogeneity"]
    words = f"the density varies by {four:.0%} of its mean, against {three:.0%}, beyond chance"
    return judged(words, four > three)


def front(n: Numbers) -> Finding:
    data = n["redundant"]
    words = (
        f"{data['density_front']:.3g} points/m³ in front against {data['density_behind']:.3g} "
        f"behind; median D̄ {data['distance_front']:.2f} against {data['distance_behind']:.2f}"
    )
    dense = data["density_front"] > data["density_behind"]
    return judged(words, dense and data["distance_front"] > data["distance_behind"])


def small(n: Numbers) -> Finding:
    data = n["minimal"]
    words = f"median {data['median']:.3f}, 95 % below {data['quantiles']['0.95']:.3f}"
    return judged(words, data["quantiles"]["0.95"] < 0.5)


def large(n: Numbers) -> Finding:
    data = n["redundant"]
    words = (
        f"median {data['median']:.3f}, 95 % below {data['quantiles']['0.95']:.3f}; above "
        f"{data['threshold']:g} in {data['redundant_volume']:.0%} of the volume, against "
        f"{n['minimal']['redundant_volume']:.0%}"
    )
    return judged(words, data["quantiles"]["0.95"] > 0.5 > n["minimal"]["quantiles"]["0.95"])


def _cloud(name: str, arm: Manipulator, settings: Settings, notes: Notebook) -> xr.Dataset:
    start = perf_counter()
    cloud = compute_cloud(arm, settings.redundant_samples, seed=settings.seed)
    notes.note(**{f"{name}_seconds": perf_counter() - start})
    return cloud


def _found(cloud: xr.Dataset, distance: xr.DataArray) -> dict[str, Any]:
    from scipy.ndimage import binary_erosion

    summary = redundancy_summary(cloud, distance)
    density, measure = tip_density(cloud), solution_measure(cloud)
    filled = density["density"].where(density["density"] > 0)
    values: np.ndarray = measure["solution_measure"].values
    size = values[
        np.asarray(binary_erosion(values > 0), bool)
    ]  # the border cuts cells with an empty neighbor
    front = distance.values[cloud.tip.values[distance["sample"].values, 1] < 0]
    behind = distance.values[cloud.tip.values[distance["sample"].values, 1] > 0]
    return {
        "median": summary.median,
        "quantiles": {str(k): v for k, v in summary.quantiles.items()},
        "isolated": summary.isolated,
        "redundant_volume": summary.redundant_volume,
        "threshold": summary.threshold,
        "heterogeneity": float(density.attrs["heterogeneity"]),
        "density_front": float(filled.where(filled.y < 0).mean()),
        "density_behind": float(filled.where(filled.y > 0).mean()),
        "distance_front": float(np.nanmedian(front)),
        "distance_behind": float(np.nanmedian(behind)),
        "solution_median": float(np.median(size)),
        "solution_low": float(np.quantile(size, 0.05)),
        "solution_largest": float(size.max(initial=0.0)),
    }


def _draw(
    arms: dict[str, Manipulator],
    clouds: dict[str, xr.Dataset],
    distances: dict[str, xr.DataArray],
    notes: Notebook,
) -> None:
    panels = [DesignPanel(name, arm) for name, arm in arms.items()]
    words = "The minimal and the redundant design, above their cross-sections at the base."
    notes.draw("4a", "figure_4a_designs", words, plot_designs(panels))
    words = (
        "Clouds colored by |γ| of the last longitudinal bundle (b), slices through the origin in "
        "the frontal and the right-facing plane (c), and the mean activation-space distance (d); "
        "isolated points are light gray."
    )
    notes.draw("4b-d", "figure_4bcd_redundancy", words, plot_redundancy(clouds, distances))
    words = "Distribution of the mean activation-space distance in both clouds."
    notes.draw("", "distances", words, plot_distance_histograms(distances))
