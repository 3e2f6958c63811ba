"""A web page in one file: the scene as it is, to be turned and zoomed without a server."""

from __future__ import annotations

import io
import textwrap
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.studio import markup
from softreach.studio.captions import ScaleBar, legend_text, reach_text
from softreach.studio.reach import Reach
from softreach.studio.scene.camera import FINER
from softreach.studio.scene.clouds import key_html
from softreach.studio.scene.scene import Scene
from softreach.studio.serve.server import start_server, stop_server
from softreach.studio.serve.viser_fixes import headed
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import StudioState

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from viser import ViserServer

    from softreach.plot.coloring import BundleKey, ScalarKey

# The scene has what the caption under it leaves.
_LAYOUT = (
    "<style>body{display:flex;flex-direction:column;height:100dvh;margin:0}"
    "#root{flex:1 1 0;min-height:0}</style>"
)
_BOX = "flex:none;max-height:40%;overflow:auto;padding:0.6em 1em;font:14px sans-serif"
_INK = {False: ("white", "#222"), True: ("#141414", "#ddd")}
"""Paper and letters of a light page and of a dark one."""


def static_page(state: StudioState, reach: Reach) -> str:
    """The page, with the numbers of the design and its file under the scene.

    Only a server's scene can be saved, so one is started for a moment, on loopback. What hides the
    arm is cut away as it is for the camera of the state; that of the page is followed by nobody.

    Args:
        state: What to show.
        reach: Of its design.
    """
    server = start_server()
    try:
        scene = Scene(server.scene)
        key = _draw(scene, state, reach)
        if state.camera is not None:
            _look(server, scene, state)
        page = headed(server.scene.as_html(dark_mode=state.appearance.dark))
    finally:
        stop_server(server)
    end = page.rindex("</body>")
    caption = _html_caption(state, reach, key)
    return page[:end] + _LAYOUT + caption + page[end:]


def _look(server: ViserServer, scene: Scene, state: StudioState) -> None:
    assert state.camera is not None
    first = server.initial_camera
    first.position, first.look_at = state.camera.position, state.camera.look_at
    viewpoint = scene.viewpoint(state.camera, state)
    scene.clouds.look(viewpoint, state.appearance.cut)
    scene.axes.turn(viewpoint.position)


def _draw(scene: Scene, state: StudioState, reach: Reach) -> str:
    look = state.appearance
    scene.draw_axes(reach)
    if look.arm:
        scene.draw_arm(state.design, state.activation)
    of_surface = scene.draw_surface(reach, look)
    return key_html(scene.draw_cloud(reach, look) or of_surface)


def _html_caption(state: StudioState, reach: Reach, key: str) -> str:
    numbers, file = markup.inline(*reach_text(reach)), markup.inline(state.design.file_text)
    design = f"<details><summary>design</summary><pre>{file}</pre></details>"
    marks = markup.paragraph(*legend_text(reach, free=False))
    paper, ink = _INK[state.appearance.dark]
    colors = f"background:{paper};color:{ink}"
    return f'<div data-softreach style="{_BOX};{colors}">{numbers}{key}{marks}{design}</div>'


# What a tab shows as a picture that explains itself: key, numbers and design under the scene.


_DPI = 100.0
_KEY, _LINE, _EDGE = 46, 17, 14  # pixels: height of the key and of a line of text, margin
_CHARACTER = 6.4  # pixels


def picture_file(
    scene: NDArray[np.uint8],
    state: StudioState,
    reach: Reach,
    key: BundleKey | ScalarKey | None,
    bar: ScaleBar,
) -> bytes:
    """The picture as PNG.

    Args:
        scene: What the canvas shows, RGBA on a transparent ground, finer than the page.
        state: What it shows.
        reach: Of its design.
        key: To its colors.
        bar: In the lower left of the scene, in pixels of the page.
    """
    from matplotlib.figure import Figure

    height, width = (size / FINER for size in scene.shape[:2])
    room = max(20, int((int(width) - 2 * _EDGE) / _CHARACTER))
    lines = [line for text in _caption(state, reach) for line in textwrap.wrap(text, room)]
    below = 2 * _EDGE + _LINE * len(lines) + (_KEY if key is not None else 0)
    total, dpi = height + below, _DPI * FINER
    paper, ink = _INK[state.appearance.dark]
    figure = Figure(figsize=(width / _DPI, total / _DPI), dpi=dpi, facecolor=paper)
    figure.figimage(scene, 0, below * FINER)
    _draw_bar(figure, bar, (_EDGE / width, (below + _EDGE) / total), (width, total), ink)
    if key is not None:
        _draw_key(figure, key, (1 - (height + 0.35 * _KEY) / total, _KEY / total), ink)
    for k, line in enumerate(reversed(lines)):
        at = (_EDGE + k * _LINE) / total
        figure.text(_EDGE / width, at, line, fontsize=8.5, color=ink, va="bottom")
    file = io.BytesIO()
    figure.savefig(file, format="png", dpi=dpi, facecolor=paper)
    return file.getvalue()


def _draw_bar(
    figure: Figure, bar: ScaleBar, at: tuple[float, float], size: tuple[float, float], ink: str
) -> None:
    from matplotlib.lines import Line2D

    (left, low), (width, height) = at, size
    right, tick = left + bar.pixels / width, 4 / height
    for x, y in (
        ((left, right), (low, low)),
        ((left, left), (low - tick, low + tick)),
        ((right, right), (low - tick, low + tick)),
    ):
        figure.add_artist(Line2D(x, y, color=ink, linewidth=1.2, solid_capstyle="butt"))
    middle, above = (left + right) / 2, low + 6 / height
    figure.text(middle, above, bar.text, fontsize=8.5, color=ink, ha="center", va="bottom")


def design_text(state: StudioState) -> str:
    """The parameters of a design, as its sliders name them, and how hard each bundle pulls."""
    values = ", ".join(f"{c.label} {c.shown:g}" for c in slider_parameters(state.design))
    pulls = ", ".join(f"{value:.3g}" for value in state.activation)
    return f"{values}; L = {state.design.length:g} m. Activation ({pulls})."


def _caption(state: StudioState, reach: Reach) -> list[str]:
    numbers = "".join(part for part in reach_text(reach) if isinstance(part, str))
    marks = "".join(part for part in legend_text(reach, free=False) if isinstance(part, str))
    return [numbers, *([marks.strip()] if marks else []), design_text(state)]


def _draw_key(
    figure: Figure, key: BundleKey | ScalarKey, place: tuple[float, float], ink: str
) -> None:
    from softreach.plot.coloring import BundleKey, color_map, draw_entries

    top, height = place
    if isinstance(key, BundleKey):
        look = {"ncols": len(key.labels), "fontsize": 8.5, "frameon": False, "labelcolor": ink}
        entries = zip(key.labels, key.colors / 255, strict=True)
        draw_entries(figure, entries, loc="center", bbox_to_anchor=(0.5, top), **look)
        return
    bar = figure.add_axes((0.25, top, 0.5, 0.22 * height))
    figure.colorbar(color_map(key), cax=bar, orientation="horizontal", extend=key.extend)
    bar.tick_params(labelsize=8, colors=ink)
    bar.set_title(key.label, fontsize=8.5, color=ink, pad=3)
