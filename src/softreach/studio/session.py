"""Session of one browser tab: its state, what is known and drawn, and its jobs."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from operator import attrgetter
from typing import TYPE_CHECKING, ClassVar, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.rod.kinematics import tip_positions
from softreach.rod.tip_map import TipStatus
from softreach.studio.plots.plot import Figures
from softreach.studio.reach import Reach, cloud_points, shown_rows
from softreach.studio.scene.camera import VIEWS, TabCamera, framing, picked_point
from softreach.studio.scene.clouds import in_slice
from softreach.studio.scene.scene import Scene, shows_cloud
from softreach.studio.start import KeptWork, Start
from softreach.studio.state import Camera, History, StudioState
from softreach.studio.work import Latest, StaleCheck, return_memory_soon
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import ClientHandle

    from softreach.arm.manipulator import Manipulator
    from softreach.inverse import Solution
    from softreach.inverse.drag import Dragged
    from softreach.plot.coloring import BundleKey, ScalarKey
    from softreach.requirements import Check
    from softreach.studio.jobs.calibration import Bench
    from softreach.studio.scene.drag import TipDrag
    from softreach.studio.slopes import VolumeSlopes

__all__ = ["AskedJob", "Job", "Panel", "Session", "what_follows"]

Array = NDArray[np.float64]
_Kind = TypeVar("_Kind", bound="Job")

_CLICK = 0.01  # [rad] between the ray of a click and a point that it hits
_LINE = 1.0  # pixels of the page that edges are thick in a picture
_LONGEST_NOTE = 1000  # characters: a file's own text may be in an error


class Panel(Protocol):
    """Widgets of one concept; they call `Session.update` and are notified of changes."""

    def show(self, session: Session) -> None:
        """Bring the widgets in line with the session; called from any thread, one at a time."""
        ...


class Job(ABC):
    """Work that follows from some part of the state; a session has one of each kind."""

    depends_on: ClassVar[tuple[str, ...]] = ()
    """Attributes of the state that decide the result, such as "appearance.arm"."""
    only_with: ClassVar[str] = ""
    """Attribute of the state without which there is nothing to do; "" for none."""
    shown_plot: ClassVar[str] = ""
    """Plot without which there is nothing to do either."""

    def __init__(self, session: Session) -> None:
        self.session = session

    @classmethod
    def has_use(cls, session: Session) -> bool:
        """True for sessions that have this kind of work at all."""
        del session
        return True

    @classmethod
    def part_of(cls, state: StudioState) -> object:
        """The part of a state that decides the result; None where there is nothing to do."""
        if not cls.depends_on or (cls.only_with and not attrgetter(cls.only_with)(state)):
            return None
        if cls.shown_plot and cls.shown_plot not in state.appearance.plots.shown:
            return None
        return attrgetter(*cls.depends_on)(state)

    @abstractmethod
    def run(self, check: StaleCheck) -> None:
        """Do the work for the state of the session as it is now, on a thread of its own.

        Args:
            check: To be called between stages; raises if the work is no longer wanted.
        """


class AskedJob(Job):
    """Work that no state asks for, but a person who presses a button."""

    wanted = False
    """True if somebody pressed it since the work was last done."""

    def ask(self) -> None:
        """Do the work as soon as possible."""
        self.wanted = True
        self.session.follow(type(self))

    def run(self, check: StaleCheck) -> None:
        wanted, self.wanted = self.wanted, False
        if wanted:
            self.do(check)

    @abstractmethod
    def do(self, check: StaleCheck) -> None:
        """Do the work; as `run`."""


def what_follows(
    kinds: Iterable[type[Job]], old: StudioState | None, new: StudioState
) -> frozenset[type[Job]]:
    """The jobs whose results a change makes stale; all of them if there was nothing before."""
    if old is None:
        return frozenset(kinds)
    return frozenset(kind for kind in kinds if kind.part_of(old) != kind.part_of(new))


class Session:
    """State of a tab and what is known of it; jobs do what is heavy, on threads of their own."""

    def __init__(
        self,
        client: ClientHandle,
        start: Start,
        jobs: Iterable[type[Job]] = (),
        *,
        work: KeptWork | None = None,
    ) -> None:
        """Begin a session; `panels` are added by the app before the first `update`.

        Args:
            client: The tab.
            start: What it begins with.
            jobs: Kinds of work that follow from its state.
            work: Where its state is kept, if anywhere.
        """
        self.client, self.quality = client, start.quality
        self.camera, self.scene = TabCamera(client), Scene(client.scene)
        self.start, self.work = start, work
        self.history = History()
        self.is_touched = False
        """True once there is anything to keep."""
        self.state: StudioState = start.state
        self.panels: list[Panel] = []
        self.note = ""
        """Text for the reader."""
        self.revision = 0
        """Number of changes that widgets have to follow."""
        self.reach: Reach | None = start.reach
        """Reach of the design, or of the design before it until that is known."""
        self.slopes: VolumeSlopes | None = None
        """Change of its volume by each slider, or of the design before until that is known."""
        self.refusal = ""
        """Reason why nothing can be computed of the design."""
        self.canceled = False
        """True if the reader stopped what was being computed of this state."""
        self.doing = ""
        """Work that is being done, for the reader."""
        self.compiling = False
        """True while kernels are being compiled, for whichever tab."""
        self.compiled = 0
        """Number of kernels compiled since the studio was started."""
        self.free: Reach | None = None
        """Reach of a loaded design without its loads."""
        self.reference: Reach | None = None
        """Reach of the design that is kept."""
        self.key: BundleKey | ScalarKey | None = None
        """To the colors of the cloud."""
        self.tip: Array | None = None
        """Place of the tip [L]; None before it is known, and without equilibrium."""
        self.posture: TipStatus | None = None
        """Equilibrium of a loaded arm in its activation; None for an arm without loads."""
        self.answer: Solution | None = None
        """Of the inverse problem."""
        self.drag: TipDrag | None = None
        """Of the tip; None when nobody drags."""
        self.held: tuple[Manipulator, Dragged] | None = None
        """An arm, and how the last drag left it."""
        self.is_dragged = False
        """True while a drag of the tip is under way."""
        self.bench: Bench | None = None
        """Measured poses, and what was fitted to them."""
        self.check: Check | None = None
        """The design against its needs, or the design before it until that is known."""
        self.check_refusal = ""
        """Reason why it cannot be judged."""
        self.figures = Figures()
        """Results of the plots beside the scene."""
        self.drawing = threading.RLock()
        """Held while nodes that several jobs draw are taken away and drawn again."""
        self._changing, self._showing = threading.RLock(), threading.RLock()
        self._jobs = {kind: kind(self) for kind in jobs if kind.has_use(self)}
        self._workers = {kind: Latest(self.fail, self._rested) for kind in self._jobs}

    def begin(self) -> None:
        """Do everything once; first what needs no kernel, which may have to be compiled."""
        if self.reach is None:
            with self.drawing, self.client.atomic():
                self.scene.draw_rest(self.state)
            self.report("computing")
        self._follow_change(None)
        self.show()

    def update(
        self,
        change: Callable[[StudioState], StudioState],
        *,
        by_widget: bool = False,
        goes_on: bool = False,
    ) -> None:
        """Replace the state, and start what follows from that.

        Args:
            change: From the present state to the next.
            by_widget: Whether the widgets show the change already. They are left alone then: one
                that is being dragged would jump back to where it was a moment ago.
            goes_on: Whether the change may be part of the step before, for who undoes it; what
                widgets do may be.

        Raises:
            SoftreachError: The change makes no valid state; nothing happens then.
        """
        with self._changing:
            old, self.state, self.note = self.state, change(self.state), ""
            self.history = self.history.after(old, self.state, goes_on=goes_on or by_widget)
            self.is_touched = self.is_touched or old != self.state
            self.revision += not by_widget
            self.canceled = False
            self._follow_change(old)
        self.show()

    def restore(self, state: StudioState) -> None:
        """Take up a state that was saved, and its view."""
        self.update(lambda _: state)
        if state.camera is not None:
            self.look_as(state.camera)

    def picked_place(self, origin: ArrayLike, direction: ArrayLike) -> Array | None:
        """Place of the tip [m] in the sample under the cursor, of those that can be seen.

        It is computed anew: a point is rounded, at the rim perhaps to out of reach.

        Args:
            origin: Of the ray through the pixel: where the camera is [L].
            direction: Of the ray, any length.

        Returns:
            Shape (3,); None beside all samples.
        """
        reach, look = self.reach, self.state.appearance
        shown = look.cloud or look.surface
        if reach is None or not shown or reach.arm != self.state.design:
            return None
        points = cloud_points(reach, look.level)
        hidden = self.scene.clouds.hidden(points) & shows_cloud(reach, look)
        seen = np.flatnonzero(in_slice(points, look.slice) & ~hidden)
        hit = picked_point(points[seen], origin, direction, _CLICK)
        if hit is None:
            return None
        sample = int(shown_rows(reach, look.level)[seen[hit]])
        return tip_positions(reach.arm, [reach.cloud.activation.values[sample]])[0]

    def look_from(self, view: str) -> None:
        """See everything from one of `camera.VIEWS`."""
        self.camera.look_from(framing(*self.scene.axes.corners, VIEWS[view], self.camera.aspect))

    def look_as(self, camera: Camera) -> None:
        """Look from a camera that was saved; from its side, if that was in a window of a phone."""
        if not self.camera.fits(camera):
            toward = np.subtract(camera.position, camera.look_at)
            camera = framing(*self.scene.axes.corners, toward, self.camera.aspect)
        self.camera.look_from(camera)

    def picture(self) -> NDArray[np.uint8]:
        """Picture of the tab, RGBA, with `camera.FINER` pixels for each of the page a side.

        Raises:
            InvalidInput: As `TabCamera.picture`.
        """
        if self.reach is None:
            return self.camera.picture()
        thickness = _LINE / self.camera.pixels_per_length
        with self.drawing:
            self.scene.draw_thick_lines(self.reach, self.state.appearance, thickness)
            try:
                return self.camera.picture()
            finally:
                self.scene.remove("/thick-lines")

    def step(self, *, back: bool) -> None:
        """Undo the latest step of the work, or do again what was undone last."""
        with self._changing:
            old = self.state
            walk = self.history.back if back else self.history.forth
            self.history, self.state = walk(old)
            stays = self.state is old
            self.note = f"There is nothing to {'undo' if back else 'redo'}." if stays else ""
            self.revision += 1
            self._follow_change(old)
        self.show()

    def reset(self) -> None:
        """Go back to what the studio was opened on; can be undone."""
        first = self.start.state
        self.update(lambda s: first.replace(appearance=s.appearance, camera=s.camera))

    def take_up(self, state: StudioState) -> None:
        """Go on where a tab left off, before anything is shown."""
        self.state, self.is_touched = state, True
        if state.design != self.start.state.design:
            self.reach = None
        if state.camera is not None:
            self.look_as(state.camera)

    def keep(self) -> None:
        """Write the state to where the next tab or server finds it."""
        if self.work is not None and self.is_touched:
            self.work.keep(self.state_now())

    def end_step(self) -> None:
        """Make the next change a step of its own for who undoes it."""
        with self._changing:
            self.history = self.history.at_rest()

    def state_now(self) -> StudioState:
        """The state with the camera, as it is saved."""
        return self.state.replace(camera=self.camera.actual())

    def say(self, note: str) -> None:
        """Show text to the reader."""
        self.note = note
        self.show()

    def show(self) -> None:
        """Notify all panels."""
        with self._showing:
            for panel in self.panels:
                panel.show(self)

    @property
    def busy(self) -> bool:
        """True while any job has something to do."""
        return any(worker.busy for worker in self._workers.values())

    def cancel(self) -> None:
        """Stop all that is being computed; what is known already stays."""
        stopped = [worker.cancel() for worker in self._workers.values()]
        if any(stopped):
            self.canceled = True
            self.say("Canceled: what was complete by then is shown.")

    def resume(self) -> None:
        """Compute what is missing since it was canceled, or failed."""
        self.canceled, self.note = False, ""
        self._follow_change(None)
        self.show()

    def report(self, doing: str) -> None:
        """Tell the reader what is being done; "" for nothing."""
        if doing != self.doing:
            self.doing = doing
            self.show()

    @contextmanager
    def working(self, doing: str) -> Iterator[None]:
        """Tell the reader what is being done inside the block."""
        self.report(doing)
        try:
            yield
        finally:
            self.report("")
            return_memory_soon()

    def follow(self, *kinds: type[Job]) -> None:
        """Do these jobs as soon as they are free, for the state there is by then."""
        for kind in kinds:
            self._workers[kind].submit(self._jobs[kind].run)

    def refresh(self, *kinds: type[Job]) -> None:
        """Do these jobs again, as far as the state asks for them."""
        self.follow(*(kind for kind in kinds if kind.part_of(self.state) is not None))

    def _follow_change(self, old: StudioState | None) -> None:
        self.follow(*what_follows(self._jobs, old, self.state))

    @property
    def shows_sample(self) -> bool:
        """True while the arm is at a measured pose."""
        return self.bench is not None and self.bench.distances is not None

    def job(self, kind: type[_Kind]) -> _Kind:
        """The job of a kind."""
        job = self._jobs[kind]
        assert isinstance(job, kind)
        return job

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all that follows from the state is done; return whether it is."""
        with self._changing:  # what changes it also asks for what follows
            pass
        # Work of one kind may order work of another.
        return all(worker.join(timeout) for _ in range(2) for worker in self._workers.values())

    def close(self) -> None:
        """Drop all work: the tab is gone."""
        for worker in self._workers.values():
            worker.close()
        # viser may hold on to what belongs to a page for a while; clouds are large.
        self.reach = self.free = self.reference = self.answer = None
        self.panels, self.figures, self.bench = [], Figures(), None
        self.check = self.slopes = None
        return_memory_soon()

    def _rested(self) -> None:
        """A job has nothing left to do; if that is true of all, the reader is told."""
        if not self.busy:
            self.doing = ""
            self.show()
            return_memory_soon()

    def fail(self, error: Exception) -> None:
        """Show an error; one that is not ours is a bug and goes to the log too."""
        if isinstance(error, SoftreachError | OSError):
            self.say(_shortened(str(error)))
        elif isinstance(error, MemoryError):
            self.say("There is not enough memory for that: close other tabs.")
        else:
            self.say(_shortened(f"{type(error).__name__}: {error}"))
            threading.excepthook(
                threading.ExceptHookArgs((type(error), error, error.__traceback__, None))
            )


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_NOTE else f"{text[:_LONGEST_NOTE]} ..."
