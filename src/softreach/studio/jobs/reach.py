"""Jobs of the reach of a design: cloud, volume and surface, their colors, plots and slopes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softreach.studio.figures import section_picture, sweep_pictures, swept_parameter
from softreach.studio.job import Given, Job, Learned, Results
from softreach.studio.reach import Reach, count_activations, shown_samples, stages, uncounted
from softreach.studio.scene.colors import shown_color
from softreach.studio.scene.scene import shows_cloud
from softreach.studio.shown_parameters import slider_ends
from softreach.studio.slopes import volume_slopes
from softreach.studio.state import StudioState
from softreach.studio.work import OverBudget
from softreach.support.errors import InvalidInput


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
        given.scene.remove(*_CLOUD)
        return None
    key = given.scene.draw_cloud(reach, look)
    draw_axes(given)
    return {"key": key} if shows_cloud(reach, look) or not look.surface else None


def draw_axes(given: Given) -> None:
    """The box with numbers around what is drawn."""
    found, loaded = given.found, given.state.design.loads is not None
    if found.reach is not None:
        given.scene.draw_axes(found.reach, found.free if loaded else None)


_CLOUD = "/cloud", "/unstable"

COMPUTE_REACH = Job(
    "reach",
    ("design", "appearance.level"),
    _compute_reach,
    _draw_cloud,
    makes=("reach", "key", "slopes"),
    draws=_CLOUD,
    at_once=False,
)
"""Cloud, volume and unreachability, coarse and then fine; each stage is drawn before the next."""

DRAW_CLOUD = Job(
    "cloud",
    (
        "appearance.level", "appearance.color", "appearance.slice",
        "appearance.cloud", "appearance.surface",
    ),
    _color_cloud,
    _draw_cloud,
    draws=_CLOUD,
    at_once=False,
    doing="coloring the points",
)  # fmt: skip
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
    (
        "found.reach", "appearance.surface", "appearance.slice",
        "appearance.cloud", "appearance.color", "appearance.dark",
    ),
    _color_surface,
    _draw_surface,
    wanted=lambda state, _: state.appearance.surface,
    draws=("/surface",),
    at_once=False,
)  # fmt: skip
"""The exact boundary."""


def _count(reach: Reach, given: Given) -> None:
    """Count the activations of what is shown, where its colors say them."""
    look = given.state.appearance
    if not reach.fine or shown_color(reach.arm, look.color) != "multiplicity":
        return
    missing, done = uncounted(reach, shown_samples(reach, look.level)), 0

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


DIFFERENTIATE_VOLUME = Job("slopes", ("design", "found.reach"), _differentiate, makes=("slopes",))
"""Ends of the sliders, and slopes of the volume by them, once nobody drags."""


def _cut(given: Given) -> Results:
    reach = given.found.complete_reach(given.state.design)
    if reach is not None:
        given.report("cutting the reachable set")
        yield Learned({"section": section_picture(reach, given.state.appearance.slice)})


DRAW_SECTION = Job(
    "section",
    ("found.reach", "appearance.slice.axis", "appearance.slice.center"),
    _cut,
    wanted=lambda state, _: "section" in state.appearance.plots.shown,
    makes=("section",),
)
"""Picture of the section by the plane of the slice."""


def _sweep(given: Given) -> Results:
    parameter = swept_parameter(given.state)
    if parameter is not None:
        for picture in sweep_pictures(given.state.design, parameter, given.quality):
            yield Learned({"sweep": picture})


SWEEP_VOLUME = Job(
    "sweep",
    ("design", "appearance.plots.parameter"),
    _sweep,
    wanted=lambda state, _: "sweep" in state.appearance.plots.shown,
    makes=("sweep",),
)
"""Volumes of designs that differ in one parameter."""
