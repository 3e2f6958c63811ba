"""What follows from where the eye is: the points that hide the arm, and the edges with numbers."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from softreach.studio.jobs.job import Job
from softreach.studio.sight import Sight, is_behind
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

__all__ = ["FollowEye"]

Array = NDArray[np.float64]

_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_TARGET = 0.02  # [L]
_DRAGGED = 1 << 13  # points while the tip is dragged: the page draws all of them at each step


class FollowEye(Job):
    """Cuts away what is in front of the arm and the target, and turns the axes to the eye."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """What is cut and what is to be seen; arm and eye report when they have moved."""
        look = state.appearance
        return look.cut, look.arm, look.handle, look.orthographic, state.target

    def run(self, check: StaleCheck) -> None:
        """Look from where the eye is by now."""
        time.sleep(_PAUSE)
        session = self.session
        session.eye.project(orthographic=session.state.appearance.orthographic)
        if session.eye.keep_width():
            session.look_again()
        with session.drawing, session.client.atomic():
            sight = self._sight()
            most = _DRAGGED if session.is_dragged else None
            session.scene.clouds.look(sight, session.state.appearance.cut, most)
            session.scene.axes.turn(sight.eye, session.eye.focal)
            session.scene.see_through_arm(self._hides_handle(sight.eye))

    def _hides_handle(self, eye: Array) -> bool:
        """Whether the arm is between the eye [L] and the handle on its own tip."""
        session = self.session
        tip, look = session.tip, session.state.appearance
        shown = look.handle and look.arm
        return shown and tip is not None and is_behind(tip, eye, *session.scene.spine)

    def _sight(self) -> Sight:
        session, state = self.session, self.session.state
        camera = session.eye.place()
        centers, radii = session.scene.spine if state.appearance.arm else _NOTHING
        if state.target is not None:
            target = np.asarray(state.target) / state.design.length
            centers, radii = np.vstack([centers, target]), np.append(radii, _TARGET)
        return Sight(
            eye=np.asarray(camera.position),
            look_at=np.asarray(camera.look_at),
            centers=centers,
            radii=radii,
        )


_NOTHING = np.empty((0, 3)), np.empty(0)
