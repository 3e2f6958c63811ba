"""Jobs of a tab as values, and those of what stands in its scene: reach, arm, other designs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.geometry.rays import is_behind
from softreach.rod.tip_map import TipStatus
from softreach.studio.figures import section_picture, sweep_pictures, swept_parameter, volume_slopes
from softreach.studio.found import Clearance, Found, Known, in_session, is_alike
from softreach.studio.reach import (
    Quality,
    Reach,
    clearance_map,
    count_activations,
    sample_clearances,
    shown_samples,
    stages,
)
from softreach.studio.scene.camera import TabCamera
from softreach.studio.scene.colors import shown_color
from softreach.studio.scene.scene import Scene, shows_cloud
from softreach.studio.serve import theme
from softreach.studio.shown_parameters import slider_ends
from softreach.studio.state import StudioState, solvable_rod
from softreach.studio.work import OverBudget, StaleCheck, rest
from softreach.support.errors import InvalidInput, SoftreachError
from softreach.support.parallel import undivided

if TYPE_CHECKING:
    from viser import ClientHandle

_SOON = 0.3  # [s] after a coarse set its fine one often comes, in whose place no surface is made
_PAUSE = 0.12  # [s] between two looks: a cloud is megabytes
_LEVEL = 16  # of the cloud of another design
DESIGN = "design design.display_unit"  # equal designs may be shown in other units
News = Mapping[str, Any] | Callable[[Found], Found]
"""Fields of `Found` and their new values, or the next `Found` from the one before."""
Results = Iterator["Learned"]


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

    found: News | None = None
    change: Callable[[StudioState], StudioState] | None = None  # of the state that comes of it
    ends_step: bool = False  # true if the next change is another step for who undoes it


@dataclass(frozen=True, eq=False)
class Job:
    """Work that follows from parts of the state and of what is known; it knows no session."""

    name: str
    depends_on: str = ""
    """Attributes that decide the result: "design appearance.arm found.reach", the last of what is
    known; without any the work is done when it is asked for."""
    compute: Callable[[Given], Iterable[Learned]] = lambda _: (Learned(),)
    """Results, each better than the one before."""
    draw: Callable[[Given], Mapping[str, Any] | None] = lambda _: None
    """Draws what is known after each result, and takes away what is not; returns what follows only
    from drawing, as fields of `Found`."""
    wanted: str = ""  # attribute that is false where it is of no use; it is done once more then
    makes: str = ""  # fields of `Found`, beside that of its name, that are forgotten where it fails
    draws: str = ""  # nodes of the scene, beside that of its name, that are taken away then
    at_once: bool = True
    """True if the page gets all of a drawing together; it would hear of nothing else meanwhile, so
    that what computes while it draws is sent piece by piece."""
    doing: str = ""  # what the reader is shown meanwhile

    def is_wanted(self, known: Known) -> bool:
        """True if its result is of use."""
        return not self.wanted or bool(attrgetter(in_session(self.wanted))(known))

    def is_stale(self, old: Known, new: Known) -> bool:
        """True if a change decides another result: of what is known, any other object."""
        was, wanted = (self.is_wanted(old), self.is_wanted(new)) if self.wanted else (True, True)
        if not (was and wanted):
            return was != wanted
        for path in self.depends_on.split():
            read = attrgetter(in_session(path))
            before, now = read(old), read(new)
            if before is not now and (path.startswith("found.") or before != now):
                return True
        return False


def what_follows(jobs: Iterable[Job], old: Known | None, new: Known) -> list[Job]:
    """The jobs whose results a change makes stale; if all is new, those that are of use."""
    if old is None:
        return [job for job in jobs if job.depends_on and job.is_wanted(new)]
    return [job for job in jobs if job.depends_on and job.is_stale(old, new)]


def _compute_reach(given: Given) -> Results:
    state, level = given.state, given.state.appearance.level
    known = given.found.reach
    if known is not None and known.fine and is_alike(known.arm, state.design):
        enough = max(known.samples, known.wanted) >= 1 << level
        if enough:
            same_unit = known.arm.length_unit == state.design.length_unit
            same = same_unit and known.arm == state.design
            yield Learned({} if same else {"reach": known.beside(state.design), "refusal": ""})
            return
    try:
        for reach in stages(state.design, level, given.quality, given.check, given.report):
            if shows_cloud(reach, state.appearance):
                _prepare_colors(given, reach)
            yield Learned({"reach": reach, "refusal": ""})
        return
    except InvalidInput as error:
        refusal = str(error)
    except OverBudget as error:
        refusal = f"Not computed: the cloud needs {error}."
    except MemoryError:
        refusal = "Not computed: there is not enough free memory."
    yield Learned({"reach": None, "key": None, "slopes": None, "refusal": refusal})


def _color_cloud(given: Given) -> Results:
    reach = given.found.reach
    if reach is not None and shows_cloud(reach, given.state.appearance):
        _prepare_colors(given, reach)
    yield Learned()


def _prepare_colors(given: Given, reach: Reach) -> None:
    """Compute what its colors say of what is shown, if that takes a while."""
    look = given.state.appearance
    color, rows = shown_color(reach.arm, look.color), shown_samples(reach, look.level)
    if color == "multiplicity" and reach.fine:
        count_activations(reach, rows, given.check, given.report)
    if reach.arm.surroundings and (color == "clearance" or look.free):
        sample_clearances(reach, rows, given.check, given.report)


def _draw_cloud(given: Given) -> Mapping[str, Any] | None:
    reach, look = given.found.reach, given.state.appearance
    key = given.scene.draw_cloud(reach, look)
    has_key = reach is not None and (shows_cloud(reach, look) or not look.surface)
    return {"key": key} if has_key else None


def _color_surface(given: Given) -> Results:
    reach, look = given.found.reach, given.state.appearance
    if reach is not None and look.surface and reach.has_surface:
        rest(given.check, 0.0 if reach.fine else _SOON)
        given.report("computing the surface")
        if look.cloud:
            reach.sheets  # noqa: B018  slow the first time
        else:
            _prepare_colors(given, reach.boundary)
    yield Learned()


def _draw_surface(given: Given) -> Mapping[str, Any] | None:
    key = given.scene.draw_surface(given.found.reach, given.state.appearance)
    return None if key is None else {"key": key}


def _differentiate(given: Given) -> Results:
    design, check = given.state.design, given.check
    if (reach := given.found.complete_reach(design)) is not None:
        before, ends = given.found.ends, slider_ends(design, given.found.ends, check)
        yield Learned({"ends": before if ends == before else ends})
        slopes = given.found.slopes
        if slopes is not None and is_alike(slopes.arm, design):
            yield Learned({"slopes": slopes._replace(arm=design)})
        else:
            yield Learned({"slopes": volume_slopes(reach, given.quality, check)})


def _cut(given: Given) -> Results:
    if (reach := given.found.complete_reach(given.state.design)) is not None:
        given.report("cutting the reachable set")
        yield Learned({"section": section_picture(reach, given.state.appearance.slice)})


def _sweep(given: Given) -> Results:
    if (parameter := swept_parameter(given.state)) is not None:
        for picture in sweep_pictures(given.state.design, parameter, given.quality):
            yield Learned({"sweep": picture})


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


def _compute_clearance(given: Given) -> Results:
    state = given.state
    if not state.design.surroundings:
        yield Learned({"clearance": None})
        return
    try:
        with undivided():  # the arm may be in a hand
            room = clearance_map(state.design)
            found = room.variables(room.of(np.array([state.activation])))
    except SoftreachError as error:
        yield Learned({"clearance": Clearance(refusal=str(error))})
        return
    (value,), number, (station,) = (found[name][1] for name in ("clearance", "obstacle", "station"))
    name = room.names[int(number[0])]
    yield Learned({"clearance": Clearance(float(value), name, float(station), int(number[0]))})


def _draw_surroundings(given: Given) -> None:
    near = given.found.clearance
    touched = near.number if near is not None and near.value < 0.0 else -1
    given.scene.draw_surroundings(given.state.design, touched)


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
    scene.look(ahead if look.half else None, base)
    scene.axes.turn(position, given.camera.focal)
    tip = found.tip if look.mouse == "tip" and look.arm else None
    hides = tip is not None and is_behind(tip, position, *scene.spine)
    scene.see_through_arm(found.sample is not None or hides)


def _compute_beside(given: Given, name: str) -> Results:
    """The reach of the design that is kept, or of the present one without its loads."""
    design, found = getattr(given.state, name), given.found
    present = found.complete_reach(design, name) or found.complete_reach(design)
    if design is None or present is not None:
        yield Learned({name: present})
        return
    level = min(_LEVEL, given.quality.coarse_level)
    quality = replace(given.quality, fine_level=level)  # of its cloud nothing but the set is shown
    for reach in stages(design, level, quality, given.check):
        yield Learned({name: reach})


def _draw_beside(given: Given, name: str) -> None:
    given.scene.draw_beside(f"/{name}", getattr(given.found, name), given.state.appearance.slice)


def _draw_axes(given: Given) -> None:
    if given.found.reach is not None:
        given.scene.draw_axes(given.found.reach, given.found.free)


def _draw_theme(given: Given) -> None:
    theme(given.client.gui, dark=given.state.appearance.dark)


def _beside(name: str) -> Job:
    compute, draw = partial(_compute_beside, name=name), partial(_draw_beside, name=name)
    return Job(name, f"{name} appearance.slice", compute, draw, wanted=name)


_CLOUD: Any = {"draw": _draw_cloud, "draws": "/cloud /unstable", "at_once": False}
_LOOKS = "appearance.surface appearance.slice appearance.cloud appearance.color appearance.free"
_OF_SURFACE = f"found.reach appearance.dark {_LOOKS}"
_IF_SHOWN: Any = {"wanted": "appearance.surface", "at_once": False}
_AROUND: Any = {"wanted": "design.surroundings", "draws": "/surroundings"}
_PLANE = "appearance.slice.axis appearance.slice.center"
_EYE = "appearance.half appearance.arm appearance.mouse found.tip found.sample"

SCENE_JOBS = (
    # Cloud, volume and unreachability, coarse and then fine; each stage is drawn before the next
    Job("reach", f"{DESIGN} appearance.level", _compute_reach, makes="key slopes", **_CLOUD),
    # Ends of the sliders, and slopes of the volume by them, once nobody drags
    Job("slopes", "design found.reach", _differentiate),
    Job("cloud", f"appearance.level {_LOOKS}", _color_cloud, doing="coloring points", **_CLOUD),
    # The exact boundary
    Job("surface", _OF_SURFACE, _color_surface, _draw_surface, **_IF_SHOWN),
    Job("section", f"found.reach {_PLANE}", _cut, wanted="appearance.section"),
    Job("sweep", f"{DESIGN} appearance.sweep", _sweep, wanted="appearance.sweep"),
    Job("arm", "design activation appearance.arm", draw=_draw_arm, makes="tip posture"),
    # The solids around the arm, and how near it is to them
    Job("clearance", "design activation", _compute_clearance, _draw_surroundings, **_AROUND),
    # The box with numbers, in a job of its own: of two that drew it, one might know an old unit
    Job("axes", "found.reach found.free", draw=_draw_axes),
    # Cuts away the half of a cloud that hides the arm, and turns the axes to the camera
    Job("camera", _EYE, _wait, _look),
    Job("theme", "appearance.dark", draw=_draw_theme),
    _beside("free"),
    _beside("reference"),
)
"""What follows in every tab from its design and its looks."""
