"""Inverse problem: every activation that reaches a place, and the ball that drags the tip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.studio.captions import place_text
from softreach.studio.fields import Fields, attempt, attribute, bind_button
from softreach.studio.scene.drag import DragBall
from softreach.studio.state import MOUSE, StudioState, rod_of
from softreach.studio.widgets import Line, TextKind, TypedField, show_where, vector_kind

if TYPE_CHECKING:
    from viser import GuiApi

    from softreach.inverse import Solution
    from softreach.studio.session import Session
    from softreach.support.units import LengthUnit

_DRAG_HINT = (
    "Drag the ball on the tip, or along x, y or z by an arrow: the arm follows on its branch of "
    "solutions."
)
_HINT = "Every activation that reaches a place: drag the tip there, type it, or click."
_ABOUT_MOUSE = (
    "Use of the mouse in the scene, which it turns besides; a click is on a reached place"
)
_NEAR = 1e-4
"""Change of activation, in ranges, below which the arm is in a solution."""


class DragPanel:
    """Use of the mouse in the scene, and the ball on the tip that it may drag."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        eye = lambda: np.array(session.camera.actual().position)  # noqa: E731
        self._ball = DragBall(session.client.scene, session.drag_to, eye)
        self._fields = Fields(session, dragged=False)
        with tab:
            self._fields.dropdown("mouse", MOUSE, attribute("appearance.mouse"), _ABOUT_MOUSE)
            self._text = Line(gui, _DRAG_HINT)

    def show(self, session: Session) -> None:
        """Keep the ball on the tip."""
        self._fields.show(session)
        state, lag, arm = session.state, session.found.lag, session.state.design
        look = state.appearance
        grasped = look.handle and look.arm and rod_of(arm).box.dimension > 0
        grasped = grasped and not session.found.sample is not None  # a marker may be on the tip
        radius = float(arm.profile.radius(arm.length)) / arm.length
        tip, clear = session.found.tip if grasped else None, state.path is not None
        self._ball.move(tip, radius, dark=look.dark, clear=clear)
        if lag is None:
            self._text.say(*([_DRAG_HINT] if look.handle else []))
            self._ball.show_lag(None, None)
            return
        short = lag.dragged.gap
        gap = arm.length_unit.rounded(short, digits=".3g") if short else ""
        self._text.say(f"This branch ends {gap} short of the pointer." if gap else _DRAG_HINT)
        self._ball.show_lag(lag.wanted, lag.dragged.tip / arm.length, gap)


class InversePanel:
    """The target, and the activations that reach it."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._gui, self._session, self._fields = gui, session, Fields(session)
        self._answer: Solution | None = None
        self._buttons: list[tuple[Any, Any]] = []
        with tab, gui.add_folder("reach a place"):
            self._text = Line(gui, _HINT)
            arm = session.state.design
            self._unit = arm.length_unit
            tip = self._unit.of(arm.base.to_world([0.0, 0.0, arm.length]))
            label, kind = self._target_kind()
            hint = "Where the tip should go"
            self._target = TypedField(gui, label, tuple(tip.tolist()), hint, kind)
            self._folder = gui.add_folder("activations that reach it", visible=False)
            self._clear = self._fields.button(
                "Clear the target",
                lambda state: state.replace(target=None),
                "Takes target and solutions away",
                color="gray",
                visible=False,
            )
        self._target.on_update(lambda _: attempt(session, self._solve_typed))

    def show(self, session: Session) -> None:
        """List the solutions, and mark the one that the arm is in."""
        self._fields.show(session)
        show_where(session.state.target is not None, self._clear)
        self._follow_unit(session.state.design.length_unit)
        if session.found.answer is not self._answer:
            self._answer = session.found.answer
            self._list(session.found.answer)
        for activation, button in self._buttons:
            is_here, text = _is_near(activation, session.state), _listed(activation)
            button.color = "green" if is_here else None
            button.label = f"\N{CHECK MARK} {text}" if is_here else text

    def _target_kind(self) -> tuple[str, TextKind]:
        length = lambda: self._session.state.design.length  # noqa: E731
        return self._unit.label("target"), vector_kind(self._unit.name, length)

    def _follow_unit(self, unit: LengthUnit) -> None:
        if unit != self._unit:
            place = unit.of(self._unit.size * np.array(self._target.value))
            self._unit = unit
            self._target.rename(*self._target_kind(), tuple(place.tolist()))

    def _list(self, answer: Solution | None) -> None:
        for _, button in self._buttons:
            button.remove()
        self._buttons, self._folder.visible = [], answer is not None and len(answer) > 0
        self._text.say(_HINT)
        if answer is not None:
            arm = self._session.state.design
            self._target.value = tuple(self._unit.of(answer.target).tolist())
            self._text.say(_answer_text(answer, arm))
            with self._folder:
                self._buttons = [(row, self._button(row)) for row in answer.activations]

    def click(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Aim at the place under the cursor, if the mouse sets the target, or take the shape there.

        Returns:
            True if the click was for this panel.
        """
        session = self._session
        if session.state.appearance.mouse != "target":
            return self._take_ghost(origin, direction)
        place = session.picked_place(origin, direction)
        if place is not None:
            attempt(session, lambda: session.aim(place))
        return True

    def _take_ghost(self, origin: Sequence[float], direction: Sequence[float]) -> bool:
        """Move the arm to the shape under the cursor, as the button of that solution does."""
        answer = self._session.found.answer
        ghost = self._session.scene.ghost_under(np.asarray(origin), np.asarray(direction))
        if answer is None or ghost is None or ghost >= len(answer):
            return False
        attempt(self._session, lambda: self._take(answer.activations[ghost]))
        return True

    def _take(self, activation: Any) -> None:
        target = tuple(activation.tolist())
        self._session.update(lambda state: state.replace(activation=target))

    def _solve_typed(self) -> None:
        self._session.aim(self._unit.size * np.asarray(self._target.value))

    def _button(self, activation: Any) -> Any:
        button = self._gui.add_button(_listed(activation), hint="Moves the arm to this solution")
        bind_button(button, self._session, lambda: self._take(activation))
        return button


def _listed(activation: Any) -> str:
    return ", ".join(f"{value:.4g}" for value in activation)


def _is_near(activation: Any, state: StudioState) -> bool:
    scales = np.maximum(np.ptp(rod_of(state.design).box.bounds, axis=1), 1e-12)
    return bool((np.abs(activation - state.activation) <= _NEAR * scales).all())


def _answer_text(answer: Solution, arm: Manipulator) -> str:
    place, unit = place_text(answer.target / arm.length, arm), arm.length_unit
    if not len(answer):
        certain = "out of reach" if answer.status == 1 else "not reached, perhaps out of reach"
        near = place_text(answer.nearest / arm.length, arm)
        gap = unit.rounded(answer.gap, digits=".3g")
        return f"{place} is {certain}. Nearest: {near}, {gap} away."
    count = "1 activation reaches" if len(answer) == 1 else f"{len(answer)} activations reach"
    names = ", ".join(arm.input_names)
    return (
        f"{count} {place} to {unit.rounded(answer.residuals.max(), digits='.1e')}. "
        f"Press one ({names}) to move the arm there, or click its shape; the one with a check mark "
        "is where it is."
    )
