"""Every activation that reaches a place: drag the tip there, click a point, or type it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.kinematics import tip_positions
from softreach.studio.jobs.inverse import SolveInverse
from softreach.studio.panels.binding import attempt, bind, bind_button
from softreach.studio.panels.line import Line
from softreach.studio.panels.typed import VectorField
from softreach.studio.state import StudioState, rod_of

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.inverse import Solution
    from softreach.studio.session import Session

__all__ = ["InversePanel"]

_HINT = "Drag the tip, type a target, or let a click on the cloud set it."
_ABOUT_CLICKS = "off: a click in the scene changes nothing"
_HELD = 1e-4
"""Change of activation, in ranges, below which the arm holds a solution."""


class InversePanel:
    """The target, and the activations that reach it."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        """Add the widgets."""
        self._gui, self._session = gui, session
        self._revision = -1
        self._shown: Solution | None = None
        self._buttons: list[tuple[Any, Any]] = []
        with tab:
            self._text = Line(gui, _HINT)
            self._target = VectorField(
                gui, "target / L", (0.0, 0.0, 1.0), "Where the tip should go [L]"
            )
            self._clicks = gui.add_checkbox("clicks set the target", False, hint=_ABOUT_CLICKS)
            solve = gui.add_button("Solve", hint="Finds every activation that reaches the target")
            self._ghosts = gui.add_checkbox(
                "show all shapes",
                session.state.appearance.ghosts,
                hint="Draws the arm in every solution at once",
            )
            self._folder = gui.add_folder("activations that reach it", visible=False)
            clear = gui.add_button("Clear", hint="Takes target and solutions away")
        bind_button(solve, session, self._solve_typed)
        self._target.on_update(lambda _: attempt(session, self._solve_typed))
        bind_button(clear, session, lambda: session.update(lambda s: s.replace(target=None)))
        bind(self._ghosts, session, lambda s, on: s.showing(ghosts=on))

    def show(self, session: Session) -> None:
        """List the solutions, and mark the one that the arm holds."""
        if session.revision != self._revision:
            self._revision = session.revision
            self._ghosts.value = session.state.appearance.ghosts
        if session.answer is not self._shown:
            self._shown = session.answer
            self._list(session.answer)
        for activation, button in self._buttons:
            held = _is_held(activation, session.state)
            button.color = "green" if held else None

    def _list(self, answer: Solution | None) -> None:
        for _, button in self._buttons:
            button.remove()
        self._buttons, self._folder.visible = [], answer is not None and len(answer) > 0
        self._text.say(_HINT)
        if answer is not None:
            arm = self._session.state.design
            self._target.value = tuple((answer.target / arm.length).tolist())
            self._text.say(_answer_text(answer, arm))
            with self._folder:
                self._buttons = [(row, self._button(row)) for row in answer.activations]

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Aim at the point of the cloud under the cursor, if clicks are to do that.

        Returns:
            Whether they are, and there is one.
        """
        session = self._session
        if not self._clicks.value:
            return False
        sample = session.picked_sample(origin, direction)
        if sample is None or session.reach is None:
            return False
        aim, arm = session.job(SolveInverse).aim, session.reach.arm
        activation = session.reach.cloud.activation.values[sample]
        attempt(session, lambda: aim(_tip(arm, activation)))
        return True

    def _solve_typed(self) -> None:
        length = self._session.state.design.length
        self._session.job(SolveInverse).aim(length * np.asarray(self._target.value))

    def _button(self, activation: Any) -> Any:
        wanted = tuple(activation.tolist())
        button = self._gui.add_button(
            ", ".join(f"{value:.4g}" for value in wanted), hint="Moves the arm to this solution"
        )
        take = lambda: self._session.update(lambda s: s.replace(activation=wanted))  # noqa: E731
        bind_button(button, self._session, take)
        return button


def _is_held(activation: Any, state: StudioState) -> bool:
    scales = np.maximum(np.ptp(rod_of(state.design).box.bounds, axis=1), 1e-12)
    return bool((np.abs(activation - state.activation) <= _HELD * scales).all())


def _tip(arm: Manipulator, activation: Any) -> Any:
    """Where a sample really is [m]: its point is rounded, at the rim perhaps to out of reach."""
    return tip_positions(arm, [activation])[0]


def _answer_text(answer: Solution, arm: Manipulator) -> str:
    """Whether the target is reached, in words."""
    place = _place(answer.target / arm.length)
    if not len(answer):
        certain = "out of reach" if answer.status == 1 else "not reached, perhaps out of reach"
        near = _place(answer.nearest / arm.length)
        return f"{place} is {certain}. Nearest: {near}, {answer.gap / arm.length:.4g} L away."
    count = "1 activation reaches" if len(answer) == 1 else f"{len(answer)} activations reach"
    names = ", ".join(arm.bundle_names)
    return (
        f"{count} {place} to {answer.residuals.max() / arm.length:.1e} L. "
        f"Press one ({names}) to move the arm there; green is where it is."
    )


def _place(point: Any) -> str:
    return "({:.4f}, {:.4f}, {:.4f}) L".format(*point)
