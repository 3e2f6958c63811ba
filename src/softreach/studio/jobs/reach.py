"""Jobs of a design in the scene: its reach, its arm, and what the camera should see of both."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipStatus
from softreach.studio.jobs.plots import REACH_JOBS
from softreach.studio.multiplicity import count_activations, uncounted
from softreach.studio.reach import Reach, shown_rows, stages
from softreach.studio.scene.camera import is_behind
from softreach.studio.scene.clouds import shown_color
from softreach.studio.scene.scene import shows_cloud
from softreach.studio.session import Job, Session
from softreach.studio.slopes import volume_slopes
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import OverBudget, StaleCheck
from softreach.support.errors import InvalidInput

Array = NDArray[np.float64]

_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_DRAGGED = 1 << 13  # points while the tip is dragged: the page draws all of them at each step


class ComputeReach(Job):
    """Cloud, volume and unreachability of the design, coarse and then fine."""

    depends_on = ("design",)  # how many points are shown, `DrawCloud` watches

    def run(self, check: StaleCheck) -> None:
        session, state = self.session, self.session.state
        if _is_complete(session.reach, state):
            _draw_cloud(session)
            session.follow(DifferentiateVolume)
            return
        session.refusal = ""
        try:
            level = state.appearance.level
            for reach in stages(state.design, level, session.quality, check, session.report):
                check()
                session.reach = reach
                _count_shown(session, check)
                _draw_cloud(session)
            session.follow(DifferentiateVolume)
        except InvalidInput as error:
            _withdraw(session, str(error))
        except OverBudget as error:
            _withdraw(session, f"Not computed: the cloud needs {error}.")
        except MemoryError:
            _withdraw(session, "Not computed: there is not enough free memory.")


class DifferentiateVolume(Job):
    """Slopes of the volume by the sliders, once known; dropped when one moves."""

    depends_on = ("design",)

    def run(self, check: StaleCheck) -> None:
        check()
        session, reach = self.session, self.session.reach
        if reach is None or not reach.fine or reach.arm != session.state.design:
            return
        if self._done is not reach.exact or session.slopes is None:
            slopes = volume_slopes(reach, session.quality, check)
            check()
            session.slopes, self._done = slopes, reach.exact
            session.show()

    _done: object = None
    """The set whose volume was differentiated last."""


class DrawCloud(Job):
    """Points, their colors, and the axes around them."""

    depends_on = (
        "appearance.level", "appearance.color", "appearance.slice",
        "appearance.cloud", "appearance.surface",
    )  # fmt: skip

    def run(self, check: StaleCheck) -> None:
        check()
        if _is_complete(self.session.reach, self.session.state):
            _count_shown(self.session, check)
            with self.session.working("coloring the points"):
                _draw_points(self.session)
        else:
            self.session.follow(ComputeReach)


class DrawSurface(Job):
    """The exact boundary."""

    depends_on = (
        "appearance.surface", "appearance.slice",
        "appearance.cloud", "appearance.color", "appearance.dark",
    )  # fmt: skip
    only_with = "appearance.surface"

    def run(self, check: StaleCheck) -> None:
        check()
        reach, look = self.session.reach, self.session.state.appearance
        if reach is None:
            return
        with self.session.working("computing the surface" if look.surface else ""):
            if look.surface and reach.has_surface and not look.cloud:
                _count(self.session, reach.boundary, check)
            key = self.session.scene.draw_surface(reach, look)
        if key is not None:
            self.session.key = key
        self.session.show()


def _is_complete(known: Reach | None, state: StudioState) -> bool:
    if known is None or not known.fine or known.arm != state.design:
        return False
    enough = max(known.samples, known.wanted) >= 1 << state.appearance.level
    return enough or known.cloud.attrs.get("sampler") != "sobol"


def _withdraw(session: Session, refusal: str) -> None:
    session.reach, session.key, session.refusal = None, None, refusal
    with session.drawing:
        session.scene.remove("/cloud", "/unstable", "/slice", "/surface")
    session.show()


def _draw_cloud(session: Session) -> None:
    _draw_points(session)
    session.refresh(DrawSurface, *REACH_JOBS)
    session.show()


def _count_shown(session: Session, check: StaleCheck) -> None:
    """Count the activations of the points that are shown, where their colors tell it."""
    reach, look = session.reach, session.state.appearance
    if reach is not None and shows_cloud(reach, look):
        _count(session, reach, check)


def _count(session: Session, reach: Reach, check: StaleCheck) -> None:
    look = session.state.appearance
    if not reach.fine or shown_color(reach.arm, look.color) != "multiplicity":
        return
    missing, done = uncounted(reach, shown_rows(reach, look.level)), 0

    def progress(more: int) -> None:
        nonlocal done
        done += more
        session.report(f"counting activations: {done:,} of {len(missing):,} points")

    with session.working("counting activations"):
        count_activations(reach, missing, check, progress)


def _draw_points(session: Session) -> None:
    reach, look = session.reach, session.state.appearance
    if reach is None:
        return
    with session.drawing, session.client.atomic():
        key = session.scene.draw_cloud(reach, look)
        if shows_cloud(reach, look) or not look.surface:  # else the surface has its own
            session.key = key
        draw_axes(session)


def draw_axes(session: Session) -> None:
    """The box around what is drawn; to be called by whoever holds `Session.drawing`."""
    if session.reach is not None:
        free = session.free if session.state.design.loads is not None else None
        session.scene.draw_axes(session.reach, free)


# The arm.


class DrawArm(Job):
    """The arm in its activation, and where its tip has been."""

    depends_on = "design", "activation", "appearance.arm"

    def run(self, check: StaleCheck) -> None:
        check()
        session, state = self.session, self.session.state
        if not state.appearance.arm:
            session.scene.remove("/arm")
        else:
            self._draw(state)
        session.follow(FollowCamera)
        session.show()

    def _draw(self, state: StudioState) -> None:
        session = self.session
        session.posture = None
        try:
            rod = solvable_rod(state.design)
        except InvalidInput:  # `ComputeReach` says so
            session.tip, session.posture = None, TipStatus.NO_EQUILIBRIUM
            session.scene.remove("/arm")
            return
        if session.held is not None:
            design, dragged = session.held
            if design == state.design and dragged.activation == state.activation:
                rod = dragged.rod  # in its posture
        with session.client.atomic():
            tip = session.scene.draw_arm(state.design, state.activation, rod=rod)
        session.tip = tip if np.isfinite(tip).all() else None
        if rod.supports_unstable:
            status = TipStatus(rod.status([state.activation])[0])
            lost = (
                session.tip is None and status <= TipStatus.UNSTABLE
            )  # its shape was not found again
            session.posture = TipStatus.UNDECIDED if lost else status


# The camera: the points that hide the arm from it, and the edges with numbers.


class FollowCamera(Job):
    """Cuts away the half of a cloud that hides the arm, and turns the axes to the camera."""

    depends_on = "appearance.half", "appearance.arm", "appearance.handle"

    def run(self, check: StaleCheck) -> None:
        time.sleep(_PAUSE)
        session = self.session
        if session.camera.keep_width():
            session.follow(FollowCamera)
        with session.drawing, session.client.atomic():
            state, camera = session.state, session.camera.actual()
            position = np.array(camera.position)
            ahead = (camera.look_at - position) * (1.0, 1.0, 0.0)
            base = np.array(state.design.base.position) / state.design.length
            most = _DRAGGED if session.is_dragged else None
            session.scene.clouds.look(ahead if state.appearance.half else None, base, most)
            session.scene.axes.turn(position, session.camera.focal)
            hides = session.shows_sample or self._hides_handle(position)
            session.scene.see_through_arm(hides)

    def _hides_handle(self, camera: Array) -> bool:
        """True if the arm is between the camera [L] and the handle on its own tip."""
        session = self.session
        tip, look = session.tip, session.state.appearance
        shown = look.handle and look.arm
        return shown and tip is not None and is_behind(tip, camera, *session.scene.spine)
