"""Jobs of a tab as values, and those of what stands in its scene: reach, arm, other designs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter, is_
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.tip_map import TipStatus
from softreach.studio.figures import section_picture, sweep_pictures, swept_parameter
from softreach.studio.found import Found
from softreach.studio.reach import Reach, count_activations, shown_rows, stages, uncounted
from softreach.studio.scene.camera import is_behind
from softreach.studio.scene.colors import shown_color
from softreach.studio.scene.scene import shows_cloud
from softreach.studio.serve import theme
from softreach.studio.shown_parameters import slider_ends
from softreach.studio.slopes import volume_slopes
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import OverBudget, StaleCheck
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import ClientHandle

    from softreach.studio.reach import Quality
    from softreach.studio.scene.camera import TabCamera
    from softreach.studio.scene.scene import Scene


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
    depends_on: str = ""
    """Attributes that decide the result: "design appearance.arm found.reach", the last of what is
    known; without any the work is done when it is asked for."""
    compute: Callable[[Given], Iterable[Learned]] = lambda _: ()
    """Results, each better than the one before."""
    draw: Callable[[Given], Mapping[str, Any] | None] = lambda _: None
    """Draws what is known after each result, and takes away what is not; returns what follows only
    from drawing, as fields of `Found`."""
    wanted: str = ""
    """Attribute that is false where it is of no use; it is done once more when that begins."""
    makes: str = ""
    """Fields of `Found` that are forgotten where the work fails."""
    draws: str = ""
    """Nodes of the scene that are taken away then."""
    at_once: bool = True
    """True if the page gets all of a drawing together; it would hear of nothing else meanwhile, so
    that what computes while it draws is sent piece by piece."""
    doing: str = ""
    """What the reader is shown meanwhile."""

    @cached_property
    def _getters(self) -> tuple[attrgetter[Any], attrgetter[Any]]:
        paths = self.depends_on.split()
        known = [path.removeprefix("found.") for path in paths if path.startswith("found.")]
        seen = [path for path in paths if not path.startswith("found.")]
        same = "__class__", "__class__"  # of two attributes and more there is a tuple
        return attrgetter(*same, *seen), attrgetter(*same, *known)

    def _is_wanted(self, state: StudioState, found: Found) -> bool:
        owner = found if self.wanted.startswith("found.") else state
        return not self.wanted or bool(attrgetter(self.wanted.removeprefix("found."))(owner))

    def is_stale(self, old: tuple[StudioState, Found], new: tuple[StudioState, Found]) -> bool:
        """True if a change decides another result: of what is known, any other object."""
        (before, known), (after, now) = old, new
        was, wanted = self._is_wanted(*old), self._is_wanted(*new)
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
    return {name: getattr(nothing, name) for name in job.makes.split()}


# The reach of the design


def _compute_reach(given: Given) -> Results:
    state, check = given.state, given.check
    if _is_complete(given.found.reach, state):
        return
    try:
        level = state.appearance.level
        for reach in stages(state.design, level, given.quality, check, given.report):
            if shows_cloud(reach, state.appearance):
                _count(reach, given)
            yield Learned({"reach": reach, "refusal": ""})
    except InvalidInput as error:
        yield _withdrawn(str(error))
    except OverBudget as error:
        yield _withdrawn(f"Not computed: the cloud needs {error}.")
    except MemoryError:
        yield _withdrawn("Not computed: there is not enough free memory.")


def _withdrawn(refusal: str) -> Learned:
    return Learned({"reach": None, "key": None, "slopes": None, "refusal": refusal})


def _is_complete(known: Reach | None, state: StudioState) -> bool:
    if known is None or not known.fine or known.arm != state.design:
        return False
    enough = max(known.samples, known.wanted) >= 1 << state.appearance.level
    return enough or known.cloud.attrs.get("sampler") != "sobol"


def _color_cloud(given: Given) -> Results:
    reach = given.found.reach
    if reach is not None and shows_cloud(reach, given.state.appearance):
        _count(reach, given)
    yield Learned()


def _draw_cloud(given: Given) -> Mapping[str, Any] | None:
    reach, look = given.found.reach, given.state.appearance
    if reach is None:
        given.scene.remove(*_CLOUD.split())
        return None
    key = given.scene.draw_cloud(reach, look)
    draw_axes(given)
    return {"key": key} if shows_cloud(reach, look) or not look.surface else None


def draw_axes(given: Given) -> None:
    """The box with numbers around what is drawn."""
    found, loaded = given.found, given.state.design.loads is not None
    if found.reach is not None:
        given.scene.draw_axes(found.reach, found.free if loaded else None)


_CLOUD = "/cloud /unstable"

COMPUTE_REACH = Job(
    "reach",
    "design appearance.level",
    _compute_reach,
    _draw_cloud,
    makes="reach key slopes",
    draws=_CLOUD,
    at_once=False,
)
"""Cloud, volume and unreachability, coarse and then fine; each stage is drawn before the next."""

DRAW_CLOUD = Job(
    "cloud",
    "appearance.level appearance.color appearance.slice appearance.cloud appearance.surface",
    _color_cloud,
    _draw_cloud,
    draws=_CLOUD,
    at_once=False,
    doing="coloring the points",
)
"""Points in their colors, and the axes around them."""


def _color_surface(given: Given) -> Results:
    reach, look = given.found.reach, given.state.appearance
    if reach is not None and look.surface and reach.has_surface:
        given.report("computing the surface")
        if look.cloud:
            reach.sheets  # noqa: B018  slow the first time
        else:
            _count(reach.boundary, given)
    yield Learned()


def _draw_surface(given: Given) -> Mapping[str, Any] | None:
    if given.found.reach is None:
        given.scene.remove("/surface")
        return None
    key = given.scene.draw_surface(given.found.reach, given.state.appearance)
    return None if key is None else {"key": key}


DRAW_SURFACE = Job(
    "surface",
    "found.reach appearance.surface appearance.slice appearance.cloud "
    "appearance.color appearance.dark",
    _color_surface,
    _draw_surface,
    wanted="appearance.surface",
    draws="/surface",
    at_once=False,
)
"""The exact boundary."""


def _count(reach: Reach, given: Given) -> None:
    """Count the activations of what is shown, where its colors say them."""
    look = given.state.appearance
    if not reach.fine or shown_color(reach.arm, look.color) != "multiplicity":
        return
    missing, done = uncounted(reach, shown_rows(reach, look.level)), 0

    def progress(more: int) -> None:
        nonlocal done
        done += more
        given.report(f"counting activations: {done:,} of {len(missing):,} points")

    count_activations(reach, missing, given.check, progress)


def _differentiate(given: Given) -> Results:
    design, check = given.state.design, given.check
    reach = given.found.complete_reach(design)
    if reach is not None:
        yield Learned({"ends": slider_ends(design, given.found.ends, check)})
        yield Learned({"slopes": volume_slopes(reach, given.quality, check)})


DIFFERENTIATE_VOLUME = Job("slopes", "design found.reach", _differentiate, makes="slopes")
"""Ends of the sliders, and slopes of the volume by them, once nobody drags."""


def _cut(given: Given) -> Results:
    reach = given.found.complete_reach(given.state.design)
    if reach is not None:
        given.report("cutting the reachable set")
        yield Learned({"section": section_picture(reach, given.state.appearance.slice)})


DRAW_SECTION = Job(
    "section",
    "found.reach appearance.slice.axis appearance.slice.center",
    _cut,
    wanted="appearance.section",
    makes="section",
)
"""Picture of the section by the plane of the slice."""


def _sweep(given: Given) -> Results:
    parameter = swept_parameter(given.state)
    if parameter is not None:
        for picture in sweep_pictures(given.state.design, parameter, given.quality):
            yield Learned({"sweep": picture})


SWEEP_VOLUME = Job(
    "sweep",
    "design appearance.swept",
    _sweep,
    wanted="appearance.sweep",
    makes="sweep",
)
"""Volumes of designs that differ in one parameter."""


# The arm, and what stands beside it


_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_DRAGGED = 1 << 13  # points while the tip is dragged: the page draws all of them at each step
_LEVEL = 16


def _draw_arm(given: Given) -> Mapping[str, Any]:
    state, scene, held = given.state, given.scene, given.found.held
    if not state.appearance.arm:
        scene.remove("/arm")
        return {}
    try:
        rod = solvable_rod(state.design)
    except InvalidInput:  # the status says so
        scene.remove("/arm")
        return {"tip": None, "posture": TipStatus.NO_EQUILIBRIUM}
    if held is not None and held[0] == state.design and held[1].activation == state.activation:
        rod = held[1].tip_map  # in its posture
    tip = scene.draw_arm(state.design, state.activation, rod=rod)
    known = {"tip": tip if np.isfinite(tip).all() else None, "pointing": scene.pointing}
    if not rod.supports_unstable:
        return known | {"posture": None}
    status = TipStatus(rod.status([state.activation])[0])
    lost = known["tip"] is None and status <= TipStatus.UNSTABLE  # its shape was not found again
    return known | {"posture": TipStatus.UNDECIDED if lost else status}


DRAW_ARM = Job(
    "arm", "design activation appearance.arm", draw=_draw_arm, makes="tip posture", draws="/arm"
)
"""The arm in its activation."""


def _wait(given: Given) -> Results:
    time.sleep(_PAUSE)
    while given.camera.keep_width():
        given.check()
        time.sleep(_PAUSE)
    yield Learned()


def _look(given: Given) -> None:
    state, found, scene, look = given.state, given.found, given.scene, given.state.appearance
    camera = given.camera.actual()
    position = np.array(camera.position)
    ahead = (camera.look_at - position) * (1.0, 1.0, 0.0)
    base = np.array(state.design.base.position) / state.design.length
    scene.look(ahead if look.half else None, base, _DRAGGED if found.is_dragged else None)
    scene.axes.turn(position, given.camera.focal)
    tip = found.tip if look.handle and look.arm else None
    hides = tip is not None and is_behind(tip, position, *scene.spine)
    scene.see_through_arm(found.sample is not None or hides)


FOLLOW_CAMERA = Job(
    "camera",
    "appearance.half appearance.arm appearance.handle found.tip found.sample found.is_dragged",
    _wait,
    _look,
)
"""Cuts away the half of a cloud that hides the arm, and turns the axes to the camera."""

SET_THEME = Job(
    "theme",
    "appearance.dark",
    draw=lambda given: theme(given.client.gui, dark=given.state.appearance.dark),
)
"""Turns the light of the page on or off."""


def _compute_free(given: Given) -> Results:
    free = None if given.state.design.loads is None else given.state.unloaded
    small = replace(given.quality, fine_level=given.quality.coarse_level)
    for reach in _reaches(free, given.found.free, given._replace(quality=small)):
        yield Learned({"free": reach})


def _draw_free(given: Given) -> None:
    given.scene.draw_beside("/free", given.found.free, given.state.appearance.slice)
    draw_axes(given)


DRAW_FREE = Job(
    "free",
    "unloaded appearance.slice",
    _compute_free,
    _draw_free,
    wanted="design.loads",
    makes="free",
    draws="/free",
)
"""The reach of a loaded arm without its loads, faint behind the loaded one."""


def _compute_reference(given: Given) -> Results:
    for reach in _reaches(given.state.reference, given.found.reference, given):
        yield Learned({"reference": reach})


DRAW_REFERENCE = Job(
    "reference",
    "reference appearance.slice",
    _compute_reference,
    lambda g: g.scene.draw_beside("/reference", g.found.reference, g.state.appearance.slice),
    wanted="reference",
    makes="reference",
    draws="/reference",
)
"""The boundary of the design that is kept."""


def _reaches(
    design: Manipulator | None, known: Reach | None, given: Given
) -> Iterator[Reach | None]:
    """The reach of another design, unless it is known; that of the present one, if they agree."""
    if design is None:
        yield None
    elif known is not None and known.fine and known.arm == design:
        return
    elif (now := given.found.complete_reach(design)) is not None:
        yield now
    else:
        level = min(_LEVEL, given.quality.coarse_level)
        yield from stages(design, level, given.quality, given.check)


SCENE_JOBS = (
    COMPUTE_REACH,
    DIFFERENTIATE_VOLUME,
    DRAW_CLOUD,
    DRAW_SURFACE,
    DRAW_SECTION,
    SWEEP_VOLUME,
    DRAW_ARM,
    FOLLOW_CAMERA,
    SET_THEME,
    DRAW_FREE,
    DRAW_REFERENCE,
)
"""What follows in every tab from its design and its looks."""
