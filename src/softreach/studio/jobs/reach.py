"""Jobs of the reach of a design: cloud, volume and surface, their colors, and changes of volume."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from softreach.studio.found import Found
from softreach.studio.job import Job, Learned, Page, Results, Tools
from softreach.studio.reach import Reach, count_activations, shown_rows, stages, uncounted
from softreach.studio.scene.colors import shown_color
from softreach.studio.scene.scene import shows_cloud
from softreach.studio.slopes import volume_slopes
from softreach.studio.state import Appearance, StudioState
from softreach.studio.work import OverBudget
from softreach.support.errors import InvalidInput


def _compute_reach(state: StudioState, found: Found, tools: Tools) -> Results:
    if _is_complete(found.reach, state):
        return
    try:
        look = state.appearance
        for reach in stages(state.design, look.level, tools.quality, tools.check, tools.report):
            if shows_cloud(reach, look):
                _count(reach, look, tools)
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


def _color_cloud(state: StudioState, found: Found, tools: Tools) -> Results:
    reach, look = found.reach, state.appearance
    if reach is not None and shows_cloud(reach, look):
        _count(reach, look, tools)
    yield Learned()


def _draw_cloud(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    reach, look = found.reach, state.appearance
    if reach is None:
        page.scene.remove("/cloud", "/unstable")
        return {}
    key = page.scene.draw_cloud(reach, look)
    draw_axes(page, state, found)
    return {"key": key} if shows_cloud(reach, look) or not look.surface else {}


def draw_axes(page: Page, state: StudioState, found: Found) -> None:
    """The box with numbers around what is drawn."""
    if found.reach is not None:
        page.scene.draw_axes(found.reach, found.free if state.design.loads is not None else None)


COMPUTE_REACH = Job(
    "reach",
    ("design", "appearance.level"),
    _compute_reach,
    _draw_cloud,
    makes=("reach", "key", "slopes"),
    draws=("/cloud", "/unstable"),
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
    at_once=False,
    doing="coloring the points", draws=("/cloud", "/unstable"))  # fmt: skip
"""Points in their colors, and the axes around them."""


def _color_surface(state: StudioState, found: Found, tools: Tools) -> Results:
    reach, look = found.reach, state.appearance
    if reach is not None and look.surface and reach.has_surface:
        tools.report("computing the surface")
        if look.cloud:
            reach.sheets  # noqa: B018  slow the first time
        else:
            _count(reach.boundary, look, tools)
    yield Learned()


def _draw_surface(page: Page, state: StudioState, found: Found) -> Mapping[str, Any]:
    if found.reach is None:
        page.scene.remove("/surface")
        return {}
    key = page.scene.draw_surface(found.reach, state.appearance)
    return {} if key is None else {"key": key}


DRAW_SURFACE = Job(
    "surface",
    (
        "found.reach", "appearance.surface", "appearance.slice",
        "appearance.cloud", "appearance.color", "appearance.dark",
    ),
    _color_surface,
    _draw_surface,
    at_once=False,
    wanted=lambda state: state.appearance.surface, draws=("/surface",))  # fmt: skip
"""The exact boundary."""


def _count(reach: Reach, look: Appearance, tools: Tools) -> None:
    """Count the activations of what is shown, where its colors tell them."""
    if not reach.fine or shown_color(reach.arm, look.color) != "multiplicity":
        return
    missing, done = uncounted(reach, shown_rows(reach, look.level)), 0

    def progress(more: int) -> None:
        nonlocal done
        done += more
        tools.report(f"counting activations: {done:,} of {len(missing):,} points")

    count_activations(reach, missing, tools.check, progress)


def _differentiate(state: StudioState, found: Found, tools: Tools) -> Results:
    reach = found.complete_reach(state.design)
    if reach is not None:
        yield Learned({"slopes": volume_slopes(reach, tools.quality, tools.check)})


DIFFERENTIATE_VOLUME = Job("slopes", ("design", "found.reach"), _differentiate, makes=("slopes",))
"""Slopes of the volume by the sliders."""
