"""Jobs of requirements: the design against its needs, live, and a search for better designs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.optimization import Candidate, Search, search
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.objectives import goals
from softreach.optimization.problem import Problem
from softreach.requirements import Check, check
from softreach.requirements.checks import quick_check
from softreach.studio.needs import requirements_of
from softreach.studio.scene.board import Board
from softreach.studio.scene.camera import VIEWS, framing
from softreach.studio.scene.needs import draw_needs
from softreach.studio.search_picture import SearchPicture, search_picture
from softreach.studio.session import AskedJob, Job, Session
from softreach.studio.work import StaleCheck
from softreach.support.errors import InvalidInput, SoftreachError, no_warnings

_ACCURACY = 0.03  # of shares that are covered, and of distances between stations
_PAUSE = 0.4  # [s] without a change, before needs that are missed are looked at again
_LOOK = 0.05  # [s]
_BETWEEN = 0.5  # [s] between two pictures of a search, which take a core for some time
_FLAT = 0.7  # of the box around arm and board, which is wider than high
_POSES = ("reach", "cover", "stay_inside", "avoid")
"""Kinds of findings that other poses may change."""


class CheckNeeds(Job):
    """The design against its needs, by poses that are found in some milliseconds."""

    depends_on = "design", "needs"
    only_with = "needs"

    def run(self, check: StaleCheck) -> None:
        """Judge the design as it is by now, and draw that."""
        check()
        session, state = self.session, self.session.state
        made, refusal = None, ""
        if state.needs:
            try:
                with no_warnings():
                    made = quick_check(state.design, requirements_of(state.needs), _ACCURACY)
            except SoftreachError as error:
                refusal = str(error)
        check()
        session.check, session.check_refusal = made, refusal
        _draw(session)
        session.follow(ConfirmNeeds)


class ConfirmNeeds(Job):
    """Looks for every pose where quick ones miss something, once the design stays as it is."""

    def run(self, check: StaleCheck) -> None:
        """Judge the design again, and draw that."""
        session, quick = self.session, self.session.check
        if quick is None or all(f.met or f.kind not in _POSES for f in quick.findings):
            return
        begun = time.monotonic()
        while time.monotonic() - begun < _PAUSE:
            check()
            time.sleep(_LOOK)
        made = _checked(quick, check)
        check()
        if session.check is quick:  # else another design was judged meanwhile
            session.check = made
            _draw(session)


def _checked(quick: Check, wanted: StaleCheck) -> Check:
    with no_warnings():
        return check(quick.arm, quick.requirements, accuracy=_ACCURACY, progress=lambda _: wanted())


def _draw(session: Session) -> None:
    around = np.array(session.scene.axes.corners)
    with session.drawing, session.client.atomic():
        draw_needs(session.client.scene, session.check, around)
    session.show()


@dataclass(eq=False)
class SearchRun:
    """A search in a tab, and what it has come to."""

    problem: Problem
    designs: int
    """Number of designs that are to be looked at."""
    candidates: list[Candidate] = field(default_factory=list)
    """Designs that were judged on the way, in their order."""
    result: Search | None = None
    """Of a search that is complete."""
    picture: SearchPicture | None = None

    @property
    def looked_at(self) -> int:
        """Number of designs that were looked at."""
        if self.result is not None:
            return self.result.designs
        return sum(each.designs for each in self.candidates)

    @property
    def front(self) -> tuple[Candidate, ...]:
        """The best designs: of one objective one."""
        if self.result is not None:
            return self.result.front
        return tuple(self.problem.front(self.candidates))

    def arm(self, candidate: Candidate) -> Manipulator:
        """The design of a candidate.

        Raises:
            InvalidDesign: No such arm can exist.
        """
        return self.problem.parameters.arm(candidate.values)


class SearchDesigns(AskedJob):
    """Searches for designs that meet the needs best; says how far it is, and can be canceled."""

    free: Mapping[str, Any] = {}
    """Parameter -> range [SI], or text that ties it to another."""
    maximize: tuple[str, ...] = ()
    minimize: tuple[str, ...] = ()
    designs = 60

    def do(self, check: StaleCheck) -> None:
        """Search, and show what is known after every few designs."""
        session, state = self.session, self.session.state
        needs = requirements_of(state.needs)
        if not (state.needs or self.maximize or self.minimize):
            raise InvalidInput("objective", "none", "given where there are no needs")
        accuracy = session.quality.fine_accuracy
        problem = Problem(
            parameters=free_parameters(state.design, self.free),
            requirements=needs,
            goals=goals(self.maximize, self.minimize, needs),
            accuracy=accuracy,
            coarse=accuracy,
        )
        run = SearchRun(problem, self.designs)
        if session.search is None:
            self._look()
        session.search = run

        def follow(candidate: Candidate) -> None:
            check()
            run.candidates.append(candidate)
            session.report(f"searching, {run.looked_at} of {self.designs} designs")
            session.follow(DrawSearch)

        with session.working("searching"), no_warnings():
            result = search(
                state.design,
                self.free,
                needs,
                maximize=self.maximize,
                minimize=self.minimize,
                designs=self.designs,
                accuracy=accuracy,
                follow=follow,
            )
        check()
        run.result = result
        session.follow(DrawSearch)
        session.show()

    def _look(self) -> None:
        """See the arm and the board that is going to be beside it."""
        session, aspect = self.session, self.session.camera.aspect
        around = np.vstack([*session.scene.axes.corners, session.job(DrawSearch).board.corners])
        middle, half = 0.5 * (around.max(axis=0) + around.min(axis=0)), 0.5 * np.ptp(around, axis=0)
        half *= _FLAT if aspect > 1.0 else 1.0
        session.camera.look_from(framing(middle - half, middle + half, VIEWS["oblique"], aspect))


class DrawSearch(Job):
    """The picture of a search: in its tab, and on a board in the scene that is clicked."""

    depends_on = ("appearance.dark",)

    def __init__(self, session: Session) -> None:
        """Draw for a session."""
        super().__init__(session)
        # The map of an atlas is on the left.
        self.board = Board(session.scene, "/search", side=-1.0 if session.board is None else 1.0)

    def run(self, check: StaleCheck) -> None:
        """Draw what is known by now, or take it away."""
        session, run = self.session, self.session.search
        if run is None or not run.candidates:
            session.scene.remove("/search")
            return
        dark = session.state.appearance.dark
        run.picture = search_picture(
            run.problem, tuple(run.candidates), run.result, session.state.design, dark=dark
        )
        with session.drawing:
            self.board.draw(run.picture.image)
        session.show()
        if run.result is None:
            time.sleep(_BETWEEN)
