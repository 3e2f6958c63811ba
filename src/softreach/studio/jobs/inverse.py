"""Finds and draws every activation that reaches the target."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from softreach.studio.jobs.job import Job
from softreach.studio.jobs.plots import plots_from
from softreach.studio.rod import solvable_rod
from softreach.studio.state import StudioState, Vector
from softreach.studio.worker import StaleCheck

if TYPE_CHECKING:
    from softreach.inverse import Solution

__all__ = ["SolveInverse"]

_FAMILY = 6  # shapes offered where infinitely many reach the target


class SolveInverse(Job):
    """The activations that reach the target, and their shapes."""

    take_nearest = False
    """Whether the arm moves to the nearest of them, as after a click or a typed target."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The design, the target, and whether all shapes are shown."""
        return state.design, state.target, state.appearance.ghosts

    def run(self, check: StaleCheck) -> None:
        """Solve, draw, and move the arm if it was asked to."""
        check()
        state = self.session.state
        self.session.answer = None
        if state.target is not None:
            self.session.answer = _solution(state, state.target)
        check()
        self._draw(state.design.length)
        self._move()
        self.session.follow(*plots_from("answer"))
        self.session.show()

    def _draw(self, length: float) -> None:
        session, answer = self.session, self.session.answer
        session.scene.remove("/ghosts")
        if answer is None:
            session.scene.draw_target(None)
            return
        out_of_reach = None if len(answer) else answer.nearest / length
        session.scene.draw_target(answer.target / length, out_of_reach)
        if session.state.appearance.ghosts:
            shapes = answer.activations if len(answer) else answer.nearest_activation[None]
            session.scene.draw_ghosts(session.state.design, shapes)

    def _move(self) -> None:
        """Move the arm to the solution nearest to where it is, once after it was asked for."""
        wanted, self.take_nearest = self.take_nearest, False
        answer = self.session.answer
        if wanted and answer is not None and len(answer):
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
