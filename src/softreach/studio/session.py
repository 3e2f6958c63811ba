"""Session of one browser tab: its state, what is known and drawn, and its jobs."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from contextlib import nullcontext
from dataclasses import fields, replace
from operator import is_
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.rays import picked_point
from softreach.rod.kinematics import tip_positions
from softreach.studio.found import Found, Known
from softreach.studio.jobs import Given, Job, News, what_follows
from softreach.studio.reach import cloud_points, shown_samples
from softreach.studio.scene.camera import UPRIGHT, VIEWS, TabCamera, framing
from softreach.studio.scene.scene import Scene, in_slice, shows_cloud
from softreach.studio.start import KeptWork, Start
from softreach.studio.state import Camera, History, StudioState, vector
from softreach.studio.work import Dropped, Latest, StaleCheck, rest, return_memory_soon
from softreach.support.arrays import Array
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import ClientHandle

    from softreach.kernels.compiler import CompilationWatch

Change = Callable[[StudioState], StudioState]
_LONGEST_NOTE = 1000  # characters: a file's own text may be in an error
_REST = 0.5  # [s] without changes, after which the state is kept


class Session:
    """State of a tab and what is known of it; jobs do what is heavy, on threads of their own."""

    def __init__(
        self,
        client: ClientHandle,
        start: Start,
        jobs: Iterable[Job] = (),
        *,
        work: KeptWork | None = None,
        compilation: CompilationWatch | None = None,
    ) -> None:
        """Begin where `work` ended, in which the state is kept, or at the start."""
        self.client, self.quality = client, start.quality
        self.camera, self.scene = TabCamera(client), Scene(client.scene)
        self.start, self.work = start, work
        self.lock = threading.RLock()  # held while the state changes, and while that is shown
        self.history = History()
        left = work and work.latest
        self.is_touched = left is not None  # true once there is anything to keep
        self.state = left or start.state
        self.found = Found()
        self.panels: list[Callable[[], None]] = []  # each shows again what has changed
        self.revision = 0  # number of changes that widgets have to follow, whatever they hold
        self.note, self.doing = "", ""  # for the reader, the second on the work that is being done
        self.canceled = False  # true if the reader stopped what was being computed of this state
        self._compilation = compilation
        self._shown: tuple[object, ...] = (object(),)
        kept = Job("keep", " ".join(field.name for field in fields(StudioState)), self._keep_soon)
        self._jobs = {job.name: job for job in (*jobs, *([kept] if work else []))}
        self._workers = {name: Latest(self.fail, self._rested) for name in self._jobs}

    def draw_rest(self) -> None:
        """Draw what needs no kernel, which may have to be compiled, and no library."""
        if self.found.reach is None:
            with self.client.atomic():
                self.scene.draw_rest(self.state)
            self.report("computing")

    def begin(self) -> None:
        """Do everything once."""
        self._follow_change(None)
        self.show()

    def update(self, change: Change, *, by_widget: bool = False, goes_on: bool = False) -> None:
        """Replace the state, unless the next is not valid, and start what follows from that.

        `goes_on` lets the change be part of the step before. Of a widget's, and of a job's, only
        those follow whose value changes: one that is dragged would jump back.
        """
        with self.lock:
            new = change(self.state)
            if by_widget and new == self.state:  # a page reports what was only drawn anew
                return
            history = self.history.after(self.state, new, goes_on=goes_on, now=time.monotonic())
            self.is_touched = self.is_touched or new != self.state
            self.revision += not by_widget
            self._become(new, history)

    def _become(self, state: StudioState, history: History, note: str = "") -> None:
        old = Known(self.state, self.found)
        self.state, self.history, self.note = state, history, note
        self.canceled = False
        self._follow_change(old)
        self.show()

    def step(self, *, back: bool) -> None:
        """Undo the latest step of the work, or do again what was undone last."""
        with self.lock:
            history, state = self.history.step(self.state, back=back)
            nothing = f"There is nothing to {'undo' if back else 'redo'}."
            self.revision += 1
            self._become(state, history, nothing if state is self.state else "")

    def reset(self) -> None:
        """Go back to what the studio was opened on; can be undone."""
        first = self.start.state
        self.update(lambda s: first.replace(appearance=s.appearance, camera=s.camera))

    def restore(self, saved: Change) -> None:
        """Take up a state that was saved, and its view."""
        self.update(saved)
        if (camera := self.state.camera) is not None:
            self.look_as(camera)

    def keep(self) -> None:
        """Write the state to where the next tab or server finds it."""
        if self.work is not None and self.is_touched:
            self.work.keep(self.state_now())

    def _keep_soon(self, given: Given) -> tuple[()]:
        rest(given.check, _REST if self.is_touched else 0.0)
        self.keep()
        return ()

    def end_step(self) -> None:
        """Make the next change a step of its own for who undoes it."""
        with self.lock:
            self.history = replace(self.history, kind="")

    def state_now(self) -> StudioState:
        """The state with the camera, as it is saved."""
        return self.state.replace(camera=self.camera.actual())

    def learn(self, found: News | None, *, quiet: bool = False) -> None:
        """Replace some fields of `Found`, or all, and start what follows; panels may hear later."""
        if not found:
            return
        with self.lock:
            old = Known(self.state, self.found)
            self.found = found(self.found) if callable(found) else replace(self.found, **found)
            self._follow_change(old)
        if not quiet:
            self.show()

    @property
    def compiling(self) -> str:
        """Words for what is being compiled; "" for nothing."""
        watch = self._compilation
        if watch is None or not watch.running:
            return ""
        done = f", {watch.done} kernels so far" if watch.done else ""
        return f"compiling, once on this machine{done} ..."

    def show(self) -> None:
        """Let all panels show what has changed, if anything has."""
        with self.lock:
            work = self.doing, self.busy, self.compiling, self.canceled
            now = self.panels, self.state, self.found, self.revision, self.note, *work
            before, self._shown = self._shown, now
            for show in self.panels if not all(map(is_, before, now)) else ():
                show()

    def say(self, note: str) -> None:
        """Show text to the reader."""
        self.note = note
        self.show()

    def report(self, doing: str) -> None:
        """Say what is being done; "" for nothing."""
        if doing != self.doing:
            self.doing = doing
            self.show()

    def fail(self, error: Exception) -> None:
        """Show an error; one that is not ours is a bug and goes to the log too."""
        ours = isinstance(error, SoftreachError | OSError)
        text = str(error) if ours else f"{type(error).__name__}: {error}"
        if isinstance(error, MemoryError):
            text = "There is not enough memory for that: close other tabs."
        elif not ours:
            trace = type(error), error, error.__traceback__, None
            threading.excepthook(threading.ExceptHookArgs(trace))
        self.say(text if len(text) <= _LONGEST_NOTE else f"{text[:_LONGEST_NOTE]} ...")

    def send(self, name: str, content: Callable[[], bytes]) -> None:
        """Have the browser save a file, which may take a while to make."""
        self.report(f"writing {name}")
        try:
            data = content()
        finally:
            self.report("")
            return_memory_soon()
        self.client.send_file_download(name, data, save_immediately=True)
        self.say(f"{name} is written: {len(data) / 1e6:.3g} MB.")

    def picked_place(self, origin: ArrayLike, direction: ArrayLike) -> Array | None:
        """Place of the tip [m] in the sample that a ray from the camera [L] meets, if any."""
        reach, look = self.found.reach, self.state.appearance
        if reach is None or not (look.cloud or look.surface) or reach.arm != self.state.design:
            return None
        points = cloud_points(reach, look.level)
        hidden = self.scene.hidden(points) & shows_cloud(reach, look)
        seen = np.flatnonzero(in_slice(points, look.slice) & ~hidden)
        hit = picked_point(points[seen], origin, direction)
        if hit is None:
            return None
        sample = int(shown_samples(reach, look.level)[seen[hit]])
        # computed anew, as a point is rounded, at the rim perhaps out of reach
        return tip_positions(reach.arm, [reach.cloud.activation.values[sample]])[0]

    def look_from(self, view: str) -> None:
        """See everything from one of `camera.VIEWS`."""
        self.camera.look_from(framing(*self.scene.axes.corners, VIEWS[view], self.camera.aspect))

    def look_as(self, camera: Camera) -> None:
        """Look from a camera that was saved; from its side, if that was in a window of a phone."""
        if (self.camera.aspect < UPRIGHT) != ((camera.aspect or 1.0) < UPRIGHT):
            toward = np.subtract(camera.position, camera.look_at)
            camera = framing(*self.scene.axes.corners, toward, self.camera.aspect)
        self.camera.look_from(camera)

    def aim(self, target: ArrayLike) -> None:
        """Find every activation that reaches a target [m], and take the nearest to the present."""
        self.learn({"takes_nearest": True})
        self.update(lambda state: state.replace(target=vector(np.asarray(target))))
        self.follow("inverse")  # also where the target is the one before

    @property
    def busy(self) -> bool:
        """True while any job has something to do."""
        return True in [worker.busy for worker in self._workers.values()]

    def cancel(self) -> None:
        """Stop all that is being computed; what is known already stays."""
        stopped = [worker.cancel() for worker in self._workers.values()]
        if any(stopped):
            self.canceled = True
            self.say("Canceled: what was complete by then is shown.")

    def stop(self, name: str) -> None:
        """Stop one job."""
        self._workers[name].cancel()

    def resume(self) -> None:
        """Compute what is missing since it was canceled, or failed."""
        self.canceled, self.note = False, ""
        self._follow_change(None)
        self.show()

    def follow(self, *names: str) -> None:
        """Do these jobs as soon as they are free, for the state there is by then."""
        for name in names:
            self._workers[name].submit(lambda check, job=self._jobs[name]: self._do(job, check))

    def _follow_change(self, old: Known | None) -> None:
        new = Known(self.state, self.found)
        self.follow(*(job.name for job in what_follows(self._jobs.values(), old, new)))

    def _do(self, job: Job, check: StaleCheck) -> None:
        """Compute and draw; where that fails, forget what was known, and remove what is drawn."""
        check()
        if job.doing:
            self.report(job.doing)
        try:
            for learned in job.compute(self._given(check)):
                check()
                self.learn(learned.found, quiet=True)
                if learned.change is not None:
                    self.update(learned.change, by_widget=True, goes_on=True)
                if learned.ends_step:
                    self.end_step()
                with self.client.atomic() if job.at_once else nullcontext():
                    drawn = job.draw(self._given(check))
                self.learn(drawn, quiet=True)
                self.show()
        except Dropped:
            raise
        except Exception:
            nothing, names = vars(Found()), (job.name, *job.makes.split())
            self.learn({name: nothing[name] for name in names if name in nothing})
            self.scene.remove(f"/{job.name}", *job.draws.split())
            raise
        finally:
            if job.doing:
                self.report("")

    def _given(self, check: StaleCheck) -> Given:
        page = self.client, self.scene, self.camera
        return Given(self.state, self.found, self.quality, check, self.report, *page)

    def settle(self, timeout: float = 60.0) -> bool:
        """Wait until all that follows from the state is done; return whether it is."""
        with self.lock:  # what changes it also starts what follows
            pass
        # Work of one kind may order work of another.
        return all(worker.join(timeout) for _ in range(3) for worker in self._workers.values())

    def close(self) -> None:
        """Drop all work: the tab is gone."""
        for worker in self._workers.values():
            worker.close()
        # viser may hold on to what belongs to a page for a while; clouds are large.
        self.found, self.panels = Found(), []
        return_memory_soon()

    def _rested(self) -> None:
        if not self.busy:  # nothing is said to be done
            self.doing = ""
            self.show()
            return_memory_soon()
