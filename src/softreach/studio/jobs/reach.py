"""Computes what a design can reach, and draws its cloud and its surfaces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.studio.budget import OverBudget
from softreach.studio.colors import shown_color
from softreach.studio.jobs.job import Job
from softreach.studio.jobs.plots import plots_from
from softreach.studio.multiplicity import count_activations, uncounted
from softreach.studio.reach import Reach, shown_rows
from softreach.studio.stages import stages
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.studio.session import Session

__all__ = ["ComputeReach", "DrawCloud", "DrawSurfaces", "draw_axes"]


class ComputeReach(Job):
    """Cloud, volume and unreachability of the design, coarse and then fine."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """The design alone; how many points are shown, `DrawCloud` watches."""
        return state.design

    def run(self, check: StaleCheck) -> None:
        """Compute what is not known yet, and draw each stage; or say why it cannot be."""
        session, state = self.session, self.session.state
        if _is_complete(session.reach, state):
            _draw_cloud(session)
            return
        session.refusal = ""
        try:
            self._compute(state, check)
        except InvalidInput as error:
            _withdraw(session, str(error))
        except OverBudget as error:
            _withdraw(session, f"Not computed: the cloud needs {error}.")
        except MemoryError:
            _withdraw(session, "Not computed: there is not enough free memory.")

    def _compute(self, state: StudioState, check: StaleCheck) -> None:
        session, level = self.session, state.appearance.level
        for reach in stages(state.design, level, session.quality, check, session.report):
            check()
            session.reach = reach
            _count_shown(session, check)
            _draw_cloud(session)


class DrawCloud(Job):
    """Points, their colors, and the axes around them."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """How points look and which of them are shown."""
        look = state.appearance
        return look.level, look.color, look.point_size, look.slice, look.cloud, look.axes, look.lit

    def run(self, check: StaleCheck) -> None:
        """Draw what is known; ask for more where it is not enough."""
        check()
        if _is_complete(self.session.reach, self.session.state):
            _count_shown(self.session, check)
            with self.session.working("coloring the points"):
                _draw_points(self.session)
        else:
            self.session.follow(ComputeReach)


class DrawSurfaces(Job):
    """The exact boundary and the α-shape."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """Which surfaces are shown, and the slice through them."""
        look = state.appearance
        return look.surface, look.alpha_shape, look.slice

    def run(self, check: StaleCheck) -> None:
        """Draw them, which computes them the first time."""
        check()
        if self.session.reach is not None:
            self._draw(self.session.reach)
            self.session.show()

    def _draw(self, reach: Reach) -> None:
        session, look = self.session, self.session.state.appearance
        if not (look.surface or look.alpha_shape):
            session.scene.draw_surfaces(reach, look)
            return
        with session.working("computing surfaces"):
            session.scene.draw_surfaces(reach, look)


def _is_complete(known: Reach | None, state: StudioState) -> bool:
    """Whether what was computed, or read from a file, is all there is to know."""
    if known is None or not known.fine or known.arm != state.design:
        return False
    enough = max(known.samples, known.wanted) >= 1 << state.appearance.level
    return enough or known.cloud.attrs.get("sampler") != "sobol"


def _withdraw(session: Session, refusal: str) -> None:
    """Take away what belongs to the design before, and say what is wrong with this one."""
    session.reach, session.key, session.refusal = None, None, refusal
    with session.drawing:
        session.scene.remove("/cloud", "/unstable", "/slice", "/surface", "/alpha-shape")
    session.show()


def _draw_cloud(session: Session) -> None:
    _draw_points(session)
    session.follow(DrawSurfaces, *plots_from("reach"))
    session.show()


def _count_shown(session: Session, check: StaleCheck) -> None:
    """Count the activations of the points that are shown, where their colors tell it."""
    reach, look = session.reach, session.state.appearance
    if reach is None or not reach.fine or not look.cloud:
        return
    if shown_color(reach.arm, look.color) != "multiplicity":
        return
    missing, done = uncounted(reach, shown_rows(reach, look.level)), 0

    def progress(more: int) -> None:
        nonlocal done
        done += more
        session.report(f"counting activations: {done:,} of {len(missing):,} points")

    with session.working("counting activations"):
        count_activations(reach, missing, check, progress)


def _draw_points(session: Session) -> None:
    """Draw the cloud and its axes, and keep the key to its colors."""
    reach, look = session.reach, session.state.appearance
    if reach is None:
        return
    with session.drawing, session.client.atomic():
        session.key = session.scene.draw_cloud(reach, look)
        draw_axes(session)


def draw_axes(session: Session) -> None:
    """The box around what is drawn; to be called by whoever holds `Session.drawing`."""
    if session.reach is not None:
        free = session.free if session.state.design.loads is not None else None
        session.scene.draw_axes(session.reach, session.state.appearance, free)
