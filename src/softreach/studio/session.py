"""One browser tab: its state, its scene, and the work that follows from every change."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.errors import SoftreachError
from softreach.studio.jobs import Latest, StaleCheck
from softreach.studio.map_board import MapBoard
from softreach.studio.reach import Reach, cloud_points, stages
from softreach.studio.scene import Scene
from softreach.studio.source import Start
from softreach.studio.state import Camera, StudioState, Work, vector, what_follows

if TYPE_CHECKING:
    import xarray as xr
    from viser import ClientHandle

    from softreach.inverse import Solution

__all__ = ["Panel", "Session"]

Array = NDArray[np.float64]

_LONGEST_TRAIL = 2000
_STEP_BACK = 1.4  # times the distance, for two clouds side by side
_FAMILY = 6  # shapes offered where infinitely many reach the target


class Panel(Protocol):
    """Widgets of one concept; they call `Session.update` and are told of every change."""

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the session; called from any thread, one at a time."""
        ...


class Session:
    """Holds the state of a tab; everything heavy happens on its workers."""

    def __init__(self, client: ClientHandle, start: Start) -> None:
        """Begin a session; `panels` are added by the app before the first `update`."""
        self.client, self.quality, self.atlas = client, start.quality, start.atlas
        self.state, self.reach = start.state, start.reach
        self.scene = Scene(client.scene)
        self.panels: list[Panel] = []
        self.key: Any = None
        self.tip: Array | None = None
        self.trail: list[Array] = []
        self.answer: Solution | None = None
        self.note = ""
        self.reference: Reach | None = None
        self.board = _board(self.scene, self.atlas)
        self.revision = 0
        """Number of changes that widgets have to follow."""
        self._aiming, self._trail_of = False, start.state.design
        self._changing, self._drawing, self._showing = (threading.RLock() for _ in range(3))
        self._workers = {work: Latest(self._failed) for work in Work}

    def begin(self) -> None:
        """Do everything once."""
        self._follow(what_follows(None, self.state))
        self.show()

    def update(
        self, change: Callable[[StudioState], StudioState], *, by_widget: bool = False
    ) -> None:
        """Replace the state, and start what follows from that.

        Args:
            change: From the present state to the next.
            by_widget: Whether the widgets show the change already. They are left alone then: one
                that is being dragged would be thrown back to where it was a moment ago.

        Raises:
            SoftreachError: The change makes no valid state; nothing happens then.
        """
        with self._changing:
            old, self.state, self.note = self.state, change(self.state), ""
            new = self.state
            self.revision += not by_widget
        self._follow(what_follows(old, new))
        self.show()

    def aim(self, target: Array) -> None:
        """Ask for every activation that reaches a target [m], and take the nearest to the present.

        Raises:
            SoftreachError: The target is no point.
        """
        self._aiming = True
        with self._changing:
            self.state = self.state.replace(target=vector(target))
        self._follow(frozenset({Work.INVERSE}))
        self.show()

    def restore(self, state: StudioState) -> None:
        """Take up a state that was saved, and its view."""
        self.update(lambda _: state)
        if state.camera is not None:
            self.look_from(state.camera)

    def state_now(self) -> StudioState:
        """The state with the camera, as it is saved."""
        return self.state.replace(camera=self.camera_now())

    def camera_now(self) -> Camera:
        """Where this tab's eye is."""
        camera = self.client.camera
        return Camera(position=vector(camera.position), look_at=vector(camera.look_at))

    def look_from(self, camera: Camera) -> None:
        """Move this tab's eye."""
        with self.client.atomic():
            self.client.camera.position = camera.position
            self.client.camera.look_at = camera.look_at

    def step_aside(self, beside: bool) -> None:
        """Move this tab's eye back, so that two clouds side by side fit; or forth again."""
        if self.reach is None:
            return
        shift = _shift(self.reach)
        now, way = self.camera_now(), 1 if beside else -1
        look_at = np.asarray(now.look_at) + way * shift / 2
        eye = (np.asarray(now.position) - now.look_at) * _STEP_BACK**way + look_at
        self.look_from(Camera(position=vector(eye), look_at=vector(look_at)))

    def say(self, note: str) -> None:
        """Show text to the reader."""
        self.note = note
        self.show()

    def show(self) -> None:
        """Tell all panels."""
        with self._showing:
            for panel in self.panels:
                panel.show(self)

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all that was asked for is done, and whether it is."""
        # Work of one kind may order work of another.
        return all(worker.join(timeout) for _ in range(2) for worker in self._workers.values())

    def close(self) -> None:
        """Drop all work: the tab is gone."""
        for worker in self._workers.values():
            worker.close()

    def _follow(self, works: frozenset[Work]) -> None:
        for work in works:
            self._workers[work].submit(getattr(self, f"_do_{work.name.lower()}"))

    def _failed(self, error: Exception) -> None:
        """Trouble of a worker is shown; what is not ours is a bug and goes to the log too."""
        self.say(f"**{type(error).__name__}**: {error}")
        if not isinstance(error, SoftreachError):
            threading.excepthook(
                threading.ExceptHookArgs((type(error), error, error.__traceback__, None))
            )

    def _do_reach(self, check: StaleCheck) -> None:
        arm, level = self.state.design, self.state.appearance.level
        if self._has_reach(level):
            self._draw_reach()
            return
        for reach in stages(arm, level, self.quality, check):
            check()
            self.reach = reach
            self._draw_reach()

    def _has_reach(self, level: int) -> bool:
        """Whether what was computed, or read from a file, is all there is to know."""
        known = self.reach
        if known is None or not known.fine or known.arm != self.state.design:
            return False
        return known.samples >= 1 << level or known.cloud.attrs.get("sampler") != "sobol"

    def _draw_reach(self) -> None:
        self._draw_cloud()
        self._follow(frozenset({Work.SURFACES}))
        self.show()

    def _do_cloud(self, check: StaleCheck) -> None:
        check()
        if self._has_reach(self.state.appearance.level):
            self._draw_cloud()
            self.show()
        else:
            self._follow(frozenset({Work.REACH}))

    def _draw_cloud(self) -> None:
        reach, look = self.reach, self.state.appearance
        if reach is None:
            return
        with self._drawing, self.client.atomic():
            self.key = self.scene.draw_cloud(reach, look)
            self.scene.draw_axes(reach, look)

    def _do_surfaces(self, check: StaleCheck) -> None:
        check()
        if self.reach is not None:
            self.scene.draw_surfaces(self.reach, self.state.appearance)
            self.show()

    def _do_arm(self, check: StaleCheck) -> None:
        check()
        state = self.state
        if not state.appearance.arm:
            self.scene.remove("/arm")
        else:
            with self.client.atomic():
                self.tip = self.scene.draw_arm(state.design, state.activation)
            self.trail = [*self.trail[-_LONGEST_TRAIL:], self.tip]
        self._draw_trail()
        self._draw_reference_arm()
        self.show()

    def _draw_trail(self) -> None:
        if self._trail_of != self.state.design:  # another arm's tip was never there
            self._trail_of, self.trail = self.state.design, self.trail[-1:]
        if not self.state.appearance.trail:
            self.trail = self.trail[-1:]
        self.scene.draw_trail(np.array(self.trail))

    def _do_inverse(self, check: StaleCheck) -> None:
        from softreach.inverse import solve_inverse

        check()
        state, length = self.state, self.state.design.length
        self.answer = None
        if state.target is not None:
            near = state.activation if state.design.bundles > 3 else None
            self.answer = solve_inverse(state.design, [state.target], near=near, family=_FAMILY)[0]
        check()
        self._draw_answer(length)
        self._take_nearest()
        self.show()

    def _draw_answer(self, length: float) -> None:
        answer, look = self.answer, self.state.appearance
        self.scene.remove("/ghosts")
        if answer is None:
            self.scene.draw_target(None)
            return
        out_of_reach = None if len(answer) else answer.nearest / length
        self.scene.draw_target(answer.target / length, out_of_reach)
        if look.ghosts:
            shapes = answer.activations if len(answer) else answer.nearest_activation[None]
            self.scene.draw_ghosts(self.state.design, shapes)

    def _take_nearest(self) -> None:
        """Move the arm to the solution nearest to where it is, after a click or a typed target."""
        aiming, self._aiming = self._aiming, False
        if aiming and self.answer is not None and len(self.answer):
            change = np.linalg.norm(self.answer.activations - self.state.activation, axis=1)
            best = self.answer.activations[int(np.argmin(change))]
            self.update(lambda state: state.replace(activation=tuple(best.tolist())))

    def _do_reference(self, check: StaleCheck) -> None:
        reference, look = self.state.reference, self.state.appearance
        if reference is None:
            self.reference = None
            self.scene.remove("/reference")
        elif self.reference is None or self.reference.arm != reference:
            self.reference = self._reach_of(reference, check)
        if self.reference is not None:
            beside = self.state.side_by_side
            shift = _shift(self.reference) if beside else np.zeros(3)
            with self._drawing, self.client.atomic():
                self.scene.draw_reference(self.reference, look, shift)
            self._draw_reference_arm()
        self.show()

    def _reach_of(self, reference: Manipulator, check: StaleCheck) -> Reach:
        """What is known already, if it is fine."""
        known = self.reach
        if known is not None and known.fine and known.arm == reference:
            return known
        *_, fine = stages(reference, 16, self.quality, check)
        return fine

    def _draw_reference_arm(self) -> None:
        """The arm beside this one pulls as this one does."""
        with self._drawing:
            state, reference = self.state, self.reference
            if reference is not None and state.side_by_side and state.appearance.arm:
                same = state.replace(design=reference.arm).activation
                self.scene.draw_reference_arm(reference.arm, same, _shift(reference))
            else:
                self.scene.remove("/reference/arm")

    def _do_map(self, check: StaleCheck) -> None:
        check()
        if self.board is not None:
            self.board.draw(self.state.appearance.map, self.state.design)


def _board(scene: Scene, atlas: xr.Dataset | None) -> MapBoard | None:
    """A board, if there is an atlas that a map can be drawn of."""
    if atlas is None or len(atlas["status"].dims) < 2:
        return None
    return MapBoard(scene, atlas)


def _shift(reach: Reach) -> Array:
    """How far a cloud stands beside another [L]."""
    return np.array([1.3 * float(np.ptp(cloud_points(reach, 14)[:, 0])), 0.0, 0.0])
