"""Jobs of a tab as values: what each depends on, how it is computed, how it is drawn."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.studio.found import Found
from softreach.studio.state import StudioState
from softreach.studio.work import StaleCheck

if TYPE_CHECKING:
    from viser import ClientHandle

    from softreach.studio.reach import Quality
    from softreach.studio.scene.camera import TabCamera
    from softreach.studio.scene.scene import Scene

__all__ = ["Job", "Learned", "Page", "Tools", "forgotten", "what_follows"]


class Page(NamedTuple):
    """Where jobs draw."""

    client: ClientHandle
    scene: Scene
    camera: TabCamera


class Tools(NamedTuple):
    """Means of a computation."""

    quality: Quality
    check: StaleCheck
    """Raises if the work is no longer wanted; called between stages."""
    report: Callable[[str], None]
    """Tells the reader what is being done."""
    page: Page


class Learned(NamedTuple):
    """One result of a job."""

    found: Mapping[str, Any] | Callable[[Found], Found] | None = None
    """Fields of `Found` and their new values, or the next `Found` from the one before."""
    change: Callable[[StudioState], StudioState] | None = None
    """Change of the state that comes of it, such as that of an arm that follows its tip."""
    ends_step: bool = False
    """True if the next change is another step for who undoes it."""


Results = Iterator[Learned]


def _nothing(state: StudioState, found: Found, tools: Tools) -> Results:
    del state, found, tools
    yield from ()


def _undrawn(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    del page, state, found
    return {}


def _always(state: StudioState) -> object:
    del state
    return True


@dataclass(frozen=True, eq=False)
class Job:
    """Work that follows from parts of the state and of what is known; it knows no session."""

    name: str
    depends_on: tuple[str, ...] = ()
    """Attributes that decide the result: "appearance.arm" of the state, "found.reach" of what is
    known; without any the work is done when it is asked for."""
    compute: Callable[[StudioState, Found, Tools], Results] = _nothing
    """Results, each better than the one before."""
    draw: Callable[[Page, StudioState, Found], Mapping[str, Any]] = _undrawn
    """Draws what is known after each result, and takes away what is not; returns what only drawing
    tells, as fields of `Found`."""
    wanted: Callable[[StudioState], object] = _always
    """False for states that have no use of it; it is done once more when that begins."""
    makes: tuple[str, ...] = ()
    """Fields of `Found` that are forgotten where the work fails."""
    draws: tuple[str, ...] = ()
    """Nodes of the scene that are taken away then."""
    at_once: bool = True
    """True if the page gets all of a drawing together; it would hear of nothing else meanwhile, so
    that what computes while it draws is sent piece by piece."""
    doing: str = ""
    """What the reader is told meanwhile."""

    def part_of(self, state: StudioState, found: Found) -> tuple[Any, ...] | None:
        """What decides the result; None where there is nothing to do."""
        if not self.wanted(state):
            return None
        return tuple(
            _Known(attrgetter(path.removeprefix("found."))(found))
            if path.startswith("found.")
            else attrgetter(path)(state)
            for path in self.depends_on
        )


class _Known:
    """A part of what is known: the same only if it is the same object."""

    def __init__(self, part: object) -> None:
        self._part = part

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Known) and self._part is other._part

    __hash__ = None  # pyright: ignore[reportAssignmentType]


def what_follows(
    jobs: Iterable[Job],
    old: tuple[StudioState, Found] | None,
    new: tuple[StudioState, Found],
) -> list[Job]:
    """The jobs whose results a change makes stale; all that depend on anything if all is new."""
    following = [job for job in jobs if job.depends_on]
    if old is None:
        return following
    return [job for job in following if job.part_of(*old) != job.part_of(*new)]


def forgotten(job: Job) -> dict[str, Any]:
    """Fields of `Found` after the job has failed."""
    nothing = Found()
    return {name: getattr(nothing, name) for name in job.makes}
