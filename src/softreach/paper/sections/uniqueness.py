"""Sections 5 and 6: places that three fibers reach with several activations."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.inverse import solve_inverse
from softreach.paper.notebook import Finding, Notebook, Numbers, Settings, judged
from softreach.paper.sections.sweep import swept_atlas
from softreach.plot import plot_arm, plot_metric_map
from softreach.rod.kinematics import configuration
from softreach.support.arrays import Array
from softreach.workspace import ReachableSet, reachable_set

_TARGETS = 2_000
_LABEL = "reached more than once / %"


def computed(settings: Settings, notes: Notebook) -> dict[str, Any]:
    """The share of the volume that several activations reach, and the clearest example."""
    atlas = swept_atlas(notes.folder)
    share = atlas["multiple_volume"] / atlas["exact_volume"]
    worst = share.isel(share.argmax(...))  # pyright: ignore[reportArgumentType]
    turn, taper = float(worst["revolution"]), float(worst["taper"])
    arms = minimal_trunk(), minimal_trunk(turn, taper)
    paper, clearest = (reachable_set(arm, accuracy=settings.accuracy) for arm in arms)
    tip, activations = _clearest_pair(clearest)
    mapped = atlas.assign({_LABEL: 100 * share.assign_attrs(units="1")})
    _draw(mapped, arms[1], activations, notes)
    # two fibers, and one: areas and lengths for L = 1 m
    fewer = [arms[0].replace(actuators=arms[0].actuators[:count]) for count in (2, 1)]
    surface, curve = (reachable_set(arm) for arm in fewer)
    return {
        "share": share.transpose("revolution", "taper").values.tolist(),
        "worst": float(worst),
        "revolution_deg": np.degrees(turn),
        "taper_deg": np.degrees(taper),
        "paper_share": 1 - paper.multiplicity[1] / paper.volume,
        "tip": tip.tolist(),
        "activations": activations.tolist(),
        "area": surface.area,
        "curve": curve.curve_length,
    }


def unique(n: Numbers) -> Finding:
    example = "No place with two activations was found"
    if len(n.activations) > 1:
        rows = [", ".join(f"{g:.3f}" for g in row) for row in n.activations]
        tip = ", ".join(f"{x:.3f}" for x in n.tip)
        example = f"In the latter design γ = ({'); ('.join(rows)}) all reach ({tip}) m"
    words = (
        f"{n.paper_share:.2%} of the volume is reached by more than one activation at Ω = 108°, "
        f"φ = 2°, up to {n.worst:.1%} at Ω = {n.revolution_deg:.4g}°, "
        f"φ = {n.taper_deg:.3g}°; less than 0.1 % in {int((n.share < 1e-3).sum())} of "
        f"{n.share.size} designs. {example}"
    )
    return judged(words, len(n.activations) < 2, n.worst < 0.1)


def dimension(n: Numbers) -> Finding:
    words = (
        f"two fibers sweep a surface of {n.area:.3f} L², one fiber a curve of "
        f"{n.curve:.3f} L (of the minimal design, in the order of its fibers)"
    )
    return judged(words, min(n.area, n.curve) > 1e-6)


def _clearest_pair(reached: ReachableSet) -> tuple[Array, Array]:
    """Tip and activations, of places that several activations reach, where these differ most."""
    places = np.argwhere(reached.grid["count"].values > 1)
    places = places[:: max(1, len(places) // _TARGETS)]
    axes = [reached.grid[axis].values for axis in "xyz"]
    tips = np.stack([axes[k][places[:, k]] for k in range(3)], axis=1)
    solutions = [s for s in solve_inverse(reached.arm, tips) if len(s) > 1]
    if not solutions:
        return np.zeros(3), np.empty((0, 3))
    best = max(solutions, key=lambda s: np.linalg.norm(s.activations[0] - s.activations[-1]))
    return best.target, best.activations


def _draw(atlas: xr.Dataset, arm: Manipulator, activations: Array, notes: Notebook) -> None:
    words = (
        "Share of the reachable volume that more than one activation reaches, over revolution and "
        "taper: where it is 0, three fibers are single-valued."
    )
    notes.draw("", "uniqueness", words, plot_metric_map(atlas, _LABEL))
    if len(activations):
        words = f"{len(activations)} activations of one three-fiber arm with the same tip."
        shapes = configuration(arm, activations)
        ax = plot_arm(arm, shapes, view="oblique", rest=False)
        notes.draw("", "same_tip", words, ax)
