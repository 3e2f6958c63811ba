"""Jobs of the inverse problem: the activations that reach a target, and a tip that is dragged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.inverse.drag import Drag, Dragged
from softreach.studio.found import Found, Lag
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.state import StudioState, Vector, solvable_rod, vector
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.inverse import Solution

_FAMILY = 6  # shapes offered where infinitely many reach the target
_DECIMALS = 5  # of the place where a drag rests [L]: a hundredth of a pixel, and can be read


def _solve(state: StudioState, found: Found, tools: Tools) -> Results:
    del tools
    if state.target is None:
        yield Learned({"answer": None})
        return
    answer, change = _solution(state, state.target), None
    if found.takes_nearest and len(answer):
        distance = np.linalg.norm(answer.activations - state.activation, axis=1)
        best = tuple(answer.activations[int(np.argmin(distance))].tolist())
        change = lambda now: now.replace(activation=best)  # noqa: E731
    yield Learned({"answer": answer, "takes_nearest": False}, change)


def _solution(state: StudioState, target: Vector) -> Solution:
    from softreach.inverse import solve_inverse

    solvable_rod(state.design)
    near = state.activation if len(state.activation) > 3 else None
    return solve_inverse(state.design, [target], near=near, family=_FAMILY, from_rest=True)[0]


def _draw_answer(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    answer, length = found.answer, state.design.length
    page.scene.remove("/ghosts")
    if answer is None:
        page.scene.draw_target(None)
        return {}
    nearest = None if len(answer) else answer.nearest / length
    page.scene.draw_target(answer.target / length, nearest)
    shapes = answer.activations if len(answer) else answer.nearest_activation[None]
    page.scene.draw_ghosts(state.design, shapes)
    return {}


SOLVE_INVERSE = Job(
    "inverse",
    ("design", "target"),
    _solve,
    _draw_answer,
    wanted=lambda state: state.target is not None,
    makes=("answer", "takes_nearest"),
    draws=("/ghosts", "/target", "/gap"),
)
"""The activations that reach the target, and their shapes."""


def _follow_tip(state: StudioState, found: Found, tools: Tools) -> Results:
    """Follow the latest place that a drag passes; where it rests, that is the target."""
    del tools
    pull = found.pull
    if pull is None:
        return
    solvable_rod(state.design)
    drag = found.drag
    if drag is None or drag.arm != state.design:
        drag = Drag(state.design)
    place = np.round(pull.place, _DECIMALS) if pull.rests else pull.place
    dragged = drag.to(state.activation, place * state.design.length)
    known: dict[str, Any] = {"drag": drag}
    if dragged is None:
        yield Learned(known)
    else:
        known |= {"held": (state.design, dragged), "lag": Lag(place, dragged)}
        target = vector(place * state.design.length) if pull.rests else None
        yield Learned(known, lambda now: _moved(now, state, dragged, target))
    if pull.rests:
        rested = lambda now: now.without(pull)  # noqa: E731
        yield Learned(rested, ends_step=True)


def _moved(
    now: StudioState, then: StudioState, dragged: Dragged, target: Vector | None
) -> StudioState:
    if now.design != then.design:
        raise InvalidInput("design", "changed", "unchanged while its tip is dragged")
    return now.replace(activation=dragged.activation, target=target)


DRAG_TIP = Job("drag", ("found.pull",), _follow_tip, makes=("pull", "lag"))
"""The arm follows its dragged tip on its branch; where that rests, every branch is looked for."""
