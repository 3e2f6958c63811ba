"""Needs in the scene: places that are reached and missed, and regions, in units of L."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softreach.studio.scene.camera import add_label
from softreach.support import palette
from softreach.support.palette import eight_bit

if TYPE_CHECKING:
    from softreach.requirements import Check
    from softreach.studio.scene.scene import Scene

__all__ = ["COLORS", "draw_needs"]

COLORS = {
    "met": eight_bit(palette.MET),
    "missed": eight_bit(palette.MISSED),
    "undecided": (200, 130, 0),
}
"""Colors of verdicts; a ball is reached and a cross missed, for who cannot tell them apart."""
_BALL, _CROSS, _FINE, _BROAD = 0.034, 0.022, 0.004, 0.008  # [L]
_REGION = {"stay_inside": (70, 110, 170), "avoid": (135, 135, 140), "cover": (90, 150, 130)}
_MOST_LABELS = 20  # more would hide each other


def draw_needs(scene: Scene, check: Check | None) -> None:
    """Draw the places and regions of a design that was judged; None takes them away."""
    scene.remove("/needs")
    if check is None:
        return
    if len(check.places):
        _draw_places(scene, check)
    length, around = check.arm.length, np.array(scene.axes.corners)
    verdicts = {(f.kind, f.name): f.verdict for f in check.findings}
    needs = check.requirements
    named = [(keep.kind, keep.name, keep.region) for keep in needs.keeps]
    named += [("cover", t.name, t.region) for t in needs.targets if t.region is not None]
    for k, (kind, name, region) in enumerate(named):
        verdict = verdicts.get((kind, name), "met")
        lines = [line / length for line in region.wireframe(around * length)]
        pieces = np.concatenate([np.stack([line[:-1], line[1:]], axis=1) for line in lines])
        is_met = verdict == "met"
        color, width = (_REGION[kind], _FINE) if is_met else (COLORS[verdict], _BROAD)
        scene.lines(f"/needs/region {k}", pieces, color, width)


def _draw_places(scene: Scene, check: Check) -> None:
    length, rows = check.arm.length, np.arange(len(check.places))
    places, met = check.places / length, check.reached.all(axis=0)
    worst = check.gaps.argmax(axis=0)  # of the payloads
    gaps, nearest = check.gaps[worst, rows], check.nearest[worst, rows] / length
    scene.dots("/needs/reached", places[met], COLORS["met"], _BALL)
    missed = np.flatnonzero(~met)
    arms = _CROSS * np.array([[1, 0, 1], [1, 0, -1], [0, 1, 0]]) / np.sqrt([[2.0], [2.0], [1.0]])
    cross = places[missed][:, None, None] + np.stack([-arms, arms], axis=1)
    scene.lines("/needs/missed", cross.reshape(-1, 2, 3), COLORS["missed"], _BROAD)
    ways = np.stack([places, nearest], axis=1)[missed]
    scene.lines("/needs/gaps", ways, COLORS["missed"], _FINE)
    for k in missed[:_MOST_LABELS]:
        text = check.arm.length_unit.rounded(float(gaps[k]), digits=".3g")
        add_label(scene.api, f"/needs/label {k}", text, places[k] + [0.0, 0.0, 2.0 * _CROSS])
