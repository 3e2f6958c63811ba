"""Jobs of a tab as values: what each depends on, how it is computed, how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter, is_
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.studio.found import Found
from softreach.studio.state import StudioState
from softreach.studio.work import StaleCheck

if TYPE_CHECKING:
    from viser import ClientHandle

    from softreach.studio.reach import Quality
    from softreach.studio.scene.camera import TabCamera
    from softreach.studio.scene.scene import Scene

__all__ = ["Given", "Job", "Learned", "forgotten", "what_follows"]


class Given(NamedTuple):
    """What a job has to work with."""

    state: StudioState
    found: Found
    quality: Quality
    check: StaleCheck  # raises if the work is no longer wanted; called between stages
    report: Callable[[str], None]  # shows the reader what is being done
    client: ClientHandle
    scene: Scene
    camera: TabCamera


class Learned(NamedTuple):
    """One result of a job."""

    found: Mapping[str, Any] | Callable[[Found], Found] | None = None
    """Fields of `Found` and their new values, or the next `Found` from the one before."""
    change: Callable[[StudioState], StudioState] | None = None
    """Change of the state that comes of it, such as that of an arm that follows its tip."""
    ends_step: bool = False  # true if the next change is another step for who undoes it


Results = Iterator[Learned]


@dataclass(frozen=True, eq=False)
class Job:
    """Work that follows from parts of the state and of what is known; it knows no session."""

    name: str
    depends_on: tuple[str, ...] = ()
    """Attributes that decide the result: "appearance.arm" of the state, "found.reach" of what is
    known; without any the work is done when it is asked for."""
    compute: Callable[[Given], Iterable[Learned]] = lambda _: ()
    """Results, each better than the one before."""
    draw: Callable[[Given], Mapping[str, Any] | None] = lambda _: None
    """Draws what is known after each result, and takes away what is not; returns what follows only
    from drawing, as fields of `Found`."""
    wanted: Callable[[StudioState, Found], object] = lambda *_: True
    """False where there is no use of it; it is done once more when that begins."""
    makes: tuple[str, ...] = ()
    """Fields of `Found` that are forgotten where the work fails."""
    draws: tuple[str, ...] = ()
    """Nodes of the scene that are taken away then."""
    at_once: bool = True
    """True if the page gets all of a drawing together; it would hear of nothing else meanwhile, so
    that what computes while it draws is sent piece by piece."""
    doing: str = ""
    """What the reader is shown meanwhile."""

    @cached_property
    def _getters(self) -> tuple[attrgetter[Any], attrgetter[Any]]:
        known = [path.removeprefix("found.") for path in self.depends_on if "found." in path]
        seen = [path for path in self.depends_on if "found." not in path]
        same = "__class__", "__class__"  # of two attributes and more there is a tuple
        return attrgetter(*same, *seen), attrgetter(*same, *known)

    def is_stale(self, old: tuple[StudioState, Found], new: tuple[StudioState, Found]) -> bool:
        """True if a change decides another result: of what is known, any other object."""
        (before, known), (after, now) = old, new
        was, wanted = bool(self.wanted(before, known)), bool(self.wanted(after, now))
        if not (was and wanted):
            return was != wanted
        of_state, of_found = self._getters
        if not all(map(is_, of_found(known), of_found(now))):
            return True
        return before is not after and of_state(before) != of_state(after)


def what_follows(
    jobs: Iterable[Job],
    old: tuple[StudioState, Found] | None,
    new: tuple[StudioState, Found],
) -> list[Job]:
    """The jobs whose results a change makes stale; all that depend on anything if all is new."""
    following = [job for job in jobs if job.depends_on]
    return following if old is None else [job for job in following if job.is_stale(old, new)]


def forgotten(job: Job) -> dict[str, Any]:
    """Fields of `Found` after the job has failed."""
    nothing = Found()
    return {name: getattr(nothing, name) for name in job.makes}
