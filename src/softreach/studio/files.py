"""Files that a tab can be saved as: bytes under a name."""

from __future__ import annotations

import io
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.export import export_cloud, export_mesh
from softreach.plot.coloring import draw_figure_key
from softreach.rod.kinematics import configuration
from softreach.studio.captions import legend_text, reach_text
from softreach.studio.reach import Reach, cloud_points, shown_samples
from softreach.studio.scene.camera import FINER
from softreach.studio.scene.colors import sample_values
from softreach.studio.scene.surfaces import in_slice
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import Appearance, StudioState, design_of_text
from softreach.support.errors import InvalidInput
from softreach.support.files.text import text_of
from softreach.workspace import Surface

if TYPE_CHECKING:
    import xarray as xr

    from softreach.plot.coloring import BundleKey, ScalarKey

Array = NDArray[np.float64]

LARGEST = 2_000_000  # bytes of a file that a person opens


def state_from(name: str, content: bytes, state: StudioState) -> StudioState:
    """The state in a file that was saved, or the present one with the design of a TOML file.

    Raises:
        InvalidInput: Neither of them.
        InvalidDesign: The design in it cannot exist.
    """
    text = text_of("file", name, content, LARGEST)
    if name.lower().endswith(".toml"):
        return state.replace(design=design_of_text(text, name))
    return StudioState.from_json(text)


def cloud_file(reach: Reach, suffix: str) -> bytes:
    """All samples."""
    return _written(f"cloud{suffix}", lambda path: export_cloud(reach.cloud, path))


def surface_file(reach: Reach, suffix: str) -> bytes:
    """The exact boundary of the reachable set [m].

    Raises:
        InvalidInput: A curve or a point has none.
    """
    return _written(f"surface{suffix}", lambda path: export_mesh(_surface(reach), path))


def figure_file(reach: Reach, state: StudioState) -> bytes:
    """Three views and an oblique one of the points that are shown, in their colors, as PNG."""
    from softreach import plot
    from softreach.plot.style import pyplot

    look, shape = state.appearance, configuration(state.design, np.asarray(state.activation))
    cloud, color = _shown(reach, look)

    def write(path: Path) -> None:
        figure = plot.plot_views(cloud, state.design, shape, color=color)
        plot.save_figure(figure, path)
        pyplot().close(figure)

    return _written("figure.png", write)


def page_file(reach: Reach, state: StudioState) -> bytes:
    """A web page to be turned: the boundary or the points that are shown, and the arm as it is."""
    from softreach import plot

    look, shape = state.appearance, configuration(state.design, np.asarray(state.activation))
    cloud, color = _shown(reach, look)
    what = reach.exact if reach.has_surface and look.surface and not look.cloud else cloud
    unit, text = state.design.length_unit.name, ". ".join(_caption(state, reach))
    return plot.plot_3d([what, shape], color=color, unit=unit, caption=text).html.encode()


def _shown(reach: Reach, look: Appearance) -> tuple[xr.Dataset, str | int | xr.DataArray]:
    known = [name for name in ("tip", "activation", "status") if name in reach.cloud]
    cloud = reach.cloud[known].isel(sample=shown_samples(reach, look.level))
    color = sample_values(reach, look.level, look.color)
    kept = in_slice(cloud_points(reach, look.level), look.slice)
    if not isinstance(color, str | int):
        color = color.isel(sample=kept)
    return cloud.isel(sample=kept), color


def _surface(reach: Reach) -> Surface:
    if reach.refusal:
        raise InvalidInput("surface", "unknown", "that of an exact set", reach.refusal)
    if reach.exact is None or reach.exact.dimension < 2:
        raise InvalidInput("design", "too few free bundles", "one whose tip reaches a surface")
    return reach.exact.surface()


def _written(name: str, write: Callable[[Path], object]) -> bytes:
    """Content that the library's own writers put into a file of this name."""
    with tempfile.TemporaryDirectory(prefix="softreach-") as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()


# What a tab shows as a picture that explains itself: key over the scene, numbers and design below.

_PAPER_AND_INK = {False: ("white", "#222222"), True: ("#141414", "#dddddd")}
"""Of a light page and of a dark one."""
_DPI = 100.0
_KEY, _LINE, _EDGE = 62, 17, 14  # pixels: height of the key and of a line of text, margin
_CHARACTER = 6.4  # pixels


def picture_file(
    scene: NDArray[np.uint8], state: StudioState, reach: Reach, key: BundleKey | ScalarKey | None
) -> bytes:
    """The picture as PNG.

    Args:
        scene: What the canvas shows, RGBA on a transparent ground, finer than the page.
        state: What it shows.
        reach: Of its design.
        key: To its colors.
    """
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    height, width = (size / FINER for size in scene.shape[:2])
    room = max(20, int((width - 2 * _EDGE) / _CHARACTER))
    lines = [line for text in _caption(state, reach) for line in textwrap.wrap(text, room)]
    above, below = _KEY if key is not None else 0, 2 * _EDGE + _LINE * len(lines)
    total, (paper, ink) = above + height + below, _PAPER_AND_INK[state.appearance.dark]
    size = width / _DPI, total / _DPI
    figure = Figure(figsize=size, dpi=_DPI * FINER, facecolor=paper)
    figure.figimage(scene, 0, below * FINER)
    draw_figure_key(figure, key, above / total)
    spacing, corner = _LINE / 8.5 * 72 / _DPI / 1.2, (_EDGE / width, _EDGE / total)
    figure.text(*corner, "\n".join(lines), fontsize=8.5, va="bottom", linespacing=spacing)
    for text in figure.findobj(Text):
        text.set_color(ink)
    for legend in figure.legends:
        legend.set_frame_on(False)
    file = io.BytesIO()
    figure.savefig(file, format="png", facecolor=paper)
    return file.getvalue()


def design_text(state: StudioState) -> str:
    """The parameters of a design, as its sliders name them, and how hard each bundle pulls."""
    values = ", ".join(f"{c.label} {c.shown:g}" for c in slider_parameters(state.design))
    pulls = ", ".join(f"{value:.3g}" for value in state.activation)
    return f"{values}; L = {state.design.length:g} m. Activation ({pulls})."


def _caption(state: StudioState, reach: Reach) -> list[str]:
    numbers = "".join(part for part in reach_text(reach) if isinstance(part, str))
    marks = "".join(part for part in legend_text(reach, free=False) if isinstance(part, str))
    return [numbers, *([marks.strip()] if marks else []), design_text(state)]
