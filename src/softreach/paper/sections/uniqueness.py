"""Sections 5 and 6: places that three fibers reach with several activations."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import xarray as xr

from softreach.arm.designs import minimal_trunk
from softreach.arm.manipulator import Manipulator
from softreach.inverse import solve_inverse
from softreach.paper.claims import Finding, Numbers, judged
from softreach.paper.notebook import Notebook, Settings
from softreach.paper.sections.sweep import swept_atlas
from softreach.plot import plot_arm, plot_metric_map
from softreach.rod.kinematics import configuration
from softreach.support.arrays import Array
from softreach.workspace import ReachableCurve, ReachableSolid, ReachableSurface, reachable_set

_TARGETS = 2_000
_LABEL = "reached more than once / %"


class Pair(NamedTuple):
    """Activations that share a tip."""

    tip: Array
    activations: Array


def uniqueness(settings: Settings, notes: Notebook) -> None:
    """The share of the volume that several activations reach, and the clearest example."""
    atlas = swept_atlas(notes.folder)
    share = atlas["multiple_volume"] / atlas["exact_volume"]
    worst = share.isel(share.argmax(...))  # pyright: ignore[reportArgumentType]
    turn, taper = float(worst["revolution"]), float(worst["taper"])
    arm = minimal_trunk(turn, taper)
    paper, clearest = (
        reachable_set(trunk, accuracy=settings.accuracy) for trunk in (minimal_trunk(), arm)
    )
    assert isinstance(paper, ReachableSolid)
    assert isinstance(clearest, ReachableSolid)
    pair = _clearest_pair(clearest)
    notes.note(
        share=share.transpose("revolution", "taper").values.tolist(),
        worst=float(worst),
        revolution_deg=float(np.degrees(turn)),
        taper_deg=float(np.degrees(taper)),
        paper_share=1 - paper.multiplicity[1] / paper.volume,
        tip=pair.tip.tolist(),
        activations=pair.activations.tolist(),
        **_fewer_fibers(),
    )
    _draw(atlas.assign({_LABEL: 100 * share.assign_attrs(units="1")}), arm, pair, notes)


def unique(n: Numbers) -> Finding:
    share = np.array(n["share"], float)
    words = (
        f"{n['paper_share']:.2%} of the volume is reached by more than one activation at Ω = 108°, "
        f"φ = 2°, up to {n['worst']:.1%} at Ω = {n['revolution_deg']:.4g}°, "
        f"φ = {n['taper_deg']:.3g}°; less than 0.1 % in {int((share < 1e-3).sum())} of "
        f"{share.size} designs. {_example(n)}"
    )
    alone = len(n["activations"]) < 2
    return judged(words, alone, n["worst"] < 0.1)


def dimension(n: Numbers) -> Finding:
    words = (
        f"two fibers sweep a surface of {n['area']:.3f} L², one fiber a curve of "
        f"{n['curve']:.3f} L (of the minimal design, in the order of its fibers)"
    )
    return judged(words, min(n["area"], n["curve"]) > 1e-6)


def _clearest_pair(reached: ReachableSolid) -> Pair:
    """Of places in the middle of what several activations reach, where these differ most."""
    grid = reached.grid
    count = grid["count"].values
    places = np.argwhere(count > 1)
    every = max(1, len(places) // _TARGETS)
    axes = [grid[axis].values for axis in "xyz"]
    tips = np.stack([axes[k][places[::every, k]] for k in range(3)], axis=1)
    solutions = [s for s in solve_inverse(reached.arm, tips) if len(s) > 1]
    if not solutions:
        return Pair(np.zeros(3), np.empty((0, 3)))
    best = max(solutions, key=lambda s: np.linalg.norm(s.activations[0] - s.activations[-1]))
    return Pair(best.target, best.activations)


def _fewer_fibers() -> dict[str, float]:
    """Area of what two fibers reach and length of what one does, for L = 1 m."""
    arm = minimal_trunk()
    surface, curve = (
        reachable_set(arm.replace(actuators=arm.actuators[:count])) for count in (2, 1)
    )
    assert isinstance(surface, ReachableSurface)
    assert isinstance(curve, ReachableCurve)
    return {"area": surface.area, "curve": curve.curve_length}


def _draw(atlas: xr.Dataset, arm: Manipulator, pair: Pair, notes: Notebook) -> None:
    ax = plot_metric_map(atlas, _LABEL)
    words = (
        "Share of the reachable volume that more than one activation reaches, over revolution and "
        "taper: where it is 0, three fibers are single-valued."
    )
    notes.draw("", "uniqueness", words, ax)
    if not len(pair.activations):
        return
    shapes = configuration(arm, pair.activations)
    ax = plot_arm(arm, shapes, view="oblique", rest=False)
    words = f"{len(pair.activations)} activations of one three-fiber arm with the same tip."
    notes.draw("", "same_tip", words, ax)


def _example(n: Numbers) -> str:
    if len(n["activations"]) < 2:
        return "No place with two activations was found"
    rows = [", ".join(f"{g:.3f}" for g in row) for row in n["activations"]]
    tip = ", ".join(f"{x:.3f}" for x in n["tip"])
    return f"In the latter design γ = ({'); ('.join(rows)}) all reach ({tip}) m"
