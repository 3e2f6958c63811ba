"""Jobs of the inverse problem: the activations that reach a target, and a tip that is dragged."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.drag import Drag, Dragged
from softreach.studio.scene.drag import TipDrag
from softreach.studio.session import Job
from softreach.studio.state import StudioState, Vector, solvable_rod, vector
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.inverse import Solution

_FAMILY = 6  # shapes offered where infinitely many reach the target
_DECIMALS = 5  # of the place where a drag rests [L]: a hundredth of a pixel, and can be read


class SolveInverse(Job):
    """The activations that reach the target, and their shapes."""

    depends_on = "design", "target"
    only_with = "target"

    take_nearest = False
    """True if the arm moves to the nearest of them, as after a click or a typed target."""

    def aim(self, target: NDArray[np.float64]) -> None:
        """Find every activation that reaches a target [m], and take the nearest to the present.

        Raises:
            SoftreachError: The target is no point.
        """
        self.take_nearest = True
        self.session.update(lambda state: state.replace(target=vector(target)))
        self.session.follow(SolveInverse)  # also where the target is the one before

    def run(self, check: StaleCheck) -> None:
        check()
        state = self.session.state
        self.session.answer = None
        if state.target is not None:
            self.session.answer = _solution(state, state.target)
        check()
        self._draw(state.design.length)
        self._move()
        self.session.show()

    def _draw(self, length: float) -> None:
        session, answer = self.session, self.session.answer
        session.scene.remove("/ghosts")
        if answer is None:
            session.scene.draw_target(None)
            return
        nearest = None if len(answer) else answer.nearest / length
        session.scene.draw_target(answer.target / length, nearest)
        shapes = answer.activations if len(answer) else answer.nearest_activation[None]
        session.scene.draw_ghosts(session.state.design, shapes)

    def _move(self) -> None:
        """Move the arm to the solution nearest to where it is, once after it was ordered."""
        take_nearest, self.take_nearest = self.take_nearest, False
        answer = self.session.answer
        if take_nearest and answer is not None and len(answer):
            change = np.linalg.norm(answer.activations - self.session.state.activation, axis=1)
            best = answer.activations[int(np.argmin(change))]
            self.session.update(
                lambda state: state.replace(activation=tuple(best.tolist())), goes_on=True
            )


def _solution(state: StudioState, target: Vector) -> Solution:
    from softreach.inverse import solve_inverse

    solvable_rod(state.design)
    near = state.activation if len(state.activation) > 3 else None
    return solve_inverse(state.design, [target], near=near, family=_FAMILY)[0]


class _Order(NamedTuple):
    place: NDArray[np.float64]
    """For the tip [L]."""
    rests: bool
    """True once the drag has ended there."""


class DragTip(Job):
    """The arm follows its dragged tip on its branch; where that rests, every branch is looked for.

    Of the places that a drag passes, only the latest is followed.
    """

    _order: _Order | None = None
    """The latest; None when nobody drags."""
    _drag: Drag | None = None

    def order(self, phase: str, wanted: NDArray[np.float64]) -> None:
        """Follow a drag of the tip; returns at once.

        Args:
            phase: "start", "update" or "end".
            wanted: Where the tip should be [L].
        """
        self._order = _Order(wanted, rests=phase == "end")
        self.session.is_dragged = phase != "end"
        self.session.follow(DragTip)

    def run(self, check: StaleCheck) -> None:
        check()
        session, state, order = self.session, self.session.state, self._order
        if order is None:
            return
        place, rests = order
        if rests:
            place = np.round(place, _DECIMALS)
        target = place * state.design.length
        dragged = self._drag_of(state).to(state.activation, target)
        if dragged is not None:
            session.held = state.design, dragged
            session.drag = None if rests else TipDrag(place, dragged)
            rest = vector(target) if rests else None
            session.update(lambda s: _moved(s, state, dragged, rest), goes_on=True)
        if rests:
            session.end_step()
            self._order = None if self._order is order else self._order

    def _drag_of(self, state: StudioState) -> Drag:
        solvable_rod(state.design)
        if self._drag is None or self._drag.arm != state.design:
            self._drag = Drag(state.design)
        return self._drag


def _moved(
    now: StudioState, then: StudioState, dragged: Dragged, target: Vector | None
) -> StudioState:
    if now.design != then.design:
        raise InvalidInput("design", "changed", "unchanged while its tip is dragged")
    return now.replace(activation=dragged.activation, target=target)
