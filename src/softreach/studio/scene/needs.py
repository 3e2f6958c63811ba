"""Needs in the scene: places that are reached and missed, and regions, in units of L."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.support import palette
from softreach.support.palette import eight_bit

if TYPE_CHECKING:
    from viser import SceneApi

    from softreach.requirements import Check

__all__ = ["COLORS", "draw_needs"]

Array = NDArray[np.float64]

REACHED, MISSED, UNDECIDED = eight_bit(palette.MET), eight_bit(palette.MISSED), (200, 130, 0)
"""Colors of places, RGB; a ball is reached and a cross missed, for who cannot tell them apart."""
COLORS = {"met": REACHED, "missed": MISSED, "undecided": UNDECIDED}
"""Colors of verdicts."""
_BALL, _CROSS, _FINE, _BROAD = 0.034, 0.022, 0.004, 0.008  # [L]
_REGION = {"stay_inside": (70, 110, 170), "avoid": (135, 135, 140), "cover": (90, 150, 130)}
_MOST_LABELS = 20  # more would hide each other
_PATH = "/needs"


def draw_needs(api: SceneApi, check: Check | None, around: Array) -> None:
    """Draw the places and regions of a design that was judged; None takes them away.

    Args:
        api: The scene of a client.
        check: The design against its needs.
        around: Lower and upper corner of what else is drawn [L], shape (2, 3).
    """
    if api.get_handle_by_name(_PATH) is not None:
        api.remove_by_name(_PATH)
    if check is None:
        return
    if len(check.places):
        _draw_places(api, check)
    length = check.arm.length
    verdicts = {(f.kind, f.name): f.verdict for f in check.findings}
    needs = check.requirements
    named = [(keep.kind, keep.name, keep.region) for keep in needs.keeps]
    named += [("cover", t.name, t.region) for t in needs.targets if t.region is not None]
    for k, (kind, name, region) in enumerate(named):
        verdict = verdicts.get((kind, name), "met")
        lines = [line / length for line in region.wireframe(around * length)]
        pieces = [np.stack([line[:-1], line[1:]], axis=1) for line in lines]
        color, width = _REGION[kind], _FINE
        if verdict != "met":
            color, width = COLORS[verdict], _BROAD
        _add_lines(api, f"{_PATH}/region {k}", np.concatenate(pieces), color, width)


def _draw_places(api: SceneApi, check: Check) -> None:
    length, rows = check.arm.length, np.arange(len(check.places))
    places, met = check.places / length, check.reached.all(axis=0)
    worst = check.gaps.argmax(axis=0)  # of the payloads
    gaps, nearest = check.gaps[worst, rows], check.nearest[worst, rows] / length
    unit = check.arm.length_unit
    if met.any():
        api.add_point_cloud(
            f"{_PATH}/reached",
            places[met].astype(np.float32),
            REACHED,
            point_size=_BALL,
            point_shape="circle",
            precision="float32",
        )
    missed = np.flatnonzero(~met)
    if not len(missed):
        return
    arms = _CROSS * np.array([[1, 0, 1], [1, 0, -1], [0, 1, 0]]) / np.sqrt([[2.0], [2.0], [1.0]])
    cross = places[missed][:, None, None] + np.stack([-arms, arms], axis=1)
    _add_lines(api, f"{_PATH}/missed", cross.reshape(-1, 2, 3), MISSED, _BROAD)
    _add_lines(api, f"{_PATH}/gaps", np.stack([places, nearest], axis=1)[missed], MISSED, _FINE)
    for k in missed[:_MOST_LABELS]:
        at, text = places[k] + [0.0, 0.0, 1.5 * _CROSS], f"{gaps[k] / unit.size:.3g} {unit.name}"
        api.add_label(
            f"{_PATH}/label {k}", text, position=at, font_screen_scale=0.8, anchor="bottom-center"
        )


def _add_lines(
    api: SceneApi, path: str, lines: Array, color: tuple[int, int, int], width: float
) -> None:
    api.add_line_segments(path, lines.astype(np.float32), color, thickness=width)
