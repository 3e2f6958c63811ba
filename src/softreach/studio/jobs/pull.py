"""Moves the arm after the ball on its tip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.studio.jobs.job import Job
from softreach.studio.pull import Pull, Pulled
from softreach.studio.rod import solvable_rod
from softreach.studio.state import StudioState, vector
from softreach.studio.worker import StaleCheck
from softreach.support.errors import InvalidInput

__all__ = ["PullOrder", "PullTip", "TipPull"]

_DECIMALS = 5  # of the place where a drag rests [L]: a hundredth of a pixel, and can be read


class PullOrder(NamedTuple):
    """What a drag asks for."""

    wanted: NDArray[np.float64]
    """Where the tip should go [L]."""
    rests: bool
    """Whether the drag has ended there."""


class TipPull(NamedTuple):
    """Where a person pulls the tip, and what came of it."""

    wanted: NDArray[np.float64]
    """[L], shape (3,)."""
    pulled: Pulled


class PullTip(Job):
    """The arm follows on its branch; where the drag rests, every branch is asked for.

    Of the places that a drag passes, only the latest is followed.
    """

    order: PullOrder | None = None
    """The latest; None when nobody drags."""
    _pull: Pull | None = None

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """Nothing: a person pulls."""
        del state

    def run(self, check: StaleCheck) -> None:
        """Pull the tip to where it is wanted by now."""
        check()
        session, state = self.session, self.session.state
        order = self.order
        if order is None:
            return
        wanted, rests = order
        if rests:
            wanted = np.round(wanted, _DECIMALS)
        target = wanted * state.design.length
        pulled = self._pull_of(state).to(state.activation, target)
        if pulled is not None:
            session.tip_pull = None if rests else TipPull(wanted, pulled)
            rest = vector(target) if rests else None
            session.update(lambda s: _moved(s, state, pulled, rest), goes_on=True)
        if rests:
            session.end_step()
            self.order = None if self.order is order else self.order

    def _pull_of(self, state: StudioState) -> Pull:
        solvable_rod(state.design)
        if self._pull is None or self._pull.arm != state.design:
            self._pull = Pull(state.design)
        return self._pull


def _moved(
    now: StudioState, then: StudioState, pulled: Pulled, target: tuple[float, float, float] | None
) -> StudioState:
    if now.design != then.design:
        raise InvalidInput("design", "changed", "unchanged while its tip is dragged")
    return now.replace(activation=pulled.activation, target=target)
