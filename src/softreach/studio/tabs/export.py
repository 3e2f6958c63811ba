"""Export of the state, design, cloud, surface and pictures; and states that are loaded again."""

from __future__ import annotations

import io
import tempfile
import textwrap
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.export import export_cloud, export_mesh
from softreach.export.clouds import CLOUD_FILES
from softreach.export.surfaces import SURFACE_FILES
from softreach.plot.coloring import draw_figure_key
from softreach.rod.kinematics import configuration
from softreach.studio.captions import legend_text, reach_text
from softreach.studio.fields import GRAY, Fields
from softreach.studio.reach import Reach, cloud_points, shown_samples
from softreach.studio.scene.camera import FINER
from softreach.studio.scene.colors import sample_values
from softreach.studio.scene.surfaces import in_slice
from softreach.studio.session import Session
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import LARGEST, Appearance, StudioState, design_of_text
from softreach.support.errors import InvalidInput
from softreach.support.files.text import text_of

if TYPE_CHECKING:
    import xarray as xr

    from softreach.plot.coloring import BundleKey, ScalarKey

File = tuple[str, Callable[[Session], bytes]]
"""Name and content."""

_DATA: Mapping[str, File] = {
    "design (.toml)": ("design.toml", lambda s: s.state.design.file_text.encode()),
    **{
        f"cloud ({kind})": (f"cloud{kind}", lambda s, kind=kind: cloud_file(_reach(s), kind))
        for kind in CLOUD_FILES
    },
    **{
        f"exact surface ({kind})": (
            f"surface{kind}", lambda s, kind=kind: surface_file(_reach(s), kind)
        )
        for kind in SURFACE_FILES
    },
}  # fmt: skip
_ABOUT_DATA = (
    "The design alone, which the command line reads too; all samples of the cloud, tips [m] and "
    "activations; or the exact boundary of the reachable set [m]"
)
_PICTURES: Mapping[str, File] = {
    "as it is seen (.png)": (
        "studio.png",
        lambda s: picture_file(s.camera.picture(), s.state, _reach(s), s.found.key),
    ),
    "four views (.png)": ("reachability.png", lambda s: figure_file(_reach(s), s.state)),
    "web page (.html)": ("reachability.html", lambda s: page_file(_reach(s), s.state)),
}
_ABOUT_PICTURES = (
    "The scene as it is seen, with legend and design; three views and an oblique one of the points "
    "that are shown; or the scene in one file, to be turned without a studio"
)


def export(panel: Fields) -> None:
    """Buttons that send a file to the browser, and one that takes a file back."""
    session = panel.session
    with panel.folder("this work"):
        about = "Everything that this tab shows, to be loaded again (JSON)"
        state = lambda: session.state_now().to_json().encode()
        keep = lambda: session.send("softreach-studio.json", state)
        panel.button("Save this work", keep, about)
        read = lambda file: session.restore(state_from(file.name, file.content, session.state))
        hint = "A state (.json) or a design (.toml) that was saved"
        panel.upload("Load state or design", read, hint, **GRAY)
    for folder, kind, files, about in (
        ("design and data", "data", _DATA, _ABOUT_DATA),
        ("pictures", "picture", _PICTURES, _ABOUT_PICTURES),
    ):
        with panel.folder(folder):
            menu = panel.gui.add_dropdown(kind, tuple(files), hint=about)

            def save(menu: Any = menu, files: Mapping[str, File] = files) -> None:
                name, content = files[menu.value]
                session.send(name, lambda: content(session))

            panel.button(f"Save {kind}", save, "As a file of this type")


def _reach(session: Session) -> Reach:
    reach = session.found.complete_reach(session.state.design)
    if reach is None:
        raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
    return reach


# What is in the files


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
    if reach.refusal:
        raise InvalidInput("surface", "unknown", "that of an exact set", reach.refusal)
    if reach.exact is None or reach.exact.dimension < 2:
        raise InvalidInput("design", "too few free bundles", "one whose tip reaches a surface")
    surface = reach.exact.surface()
    return _written(f"surface{suffix}", lambda path: export_mesh(surface, path))


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
    draw_figure_key(figure, key, above / _DPI)
    spacing, corner = _LINE / 8.5 * 72 / _DPI / 1.2, (_EDGE / width, _EDGE / total)
    figure.text(*corner, "\n".join(lines), fontsize=8.5, va="bottom", linespacing=spacing)
    for text in figure.findobj(Text):
        text.set_color(ink)
    for legend in figure.legends:
        legend.set_frame_on(False)
    file = io.BytesIO()
    figure.savefig(file, format="png", facecolor=paper)
    return file.getvalue()


def _caption(state: StudioState, reach: Reach) -> list[str]:
    """Numbers and marks of a reach, parameters of its design, and how hard each bundle pulls."""
    numbers = "".join(part for part in reach_text(reach) if isinstance(part, str))
    marks = "".join(part for part in legend_text(reach, free=False) if isinstance(part, str))
    values = ", ".join(f"{c.label} {c.shown:g}" for c in slider_parameters(state.design))
    pulls = ", ".join(f"{value:.3g}" for value in state.activation)
    design = f"{values}; L = {state.design.length:g} m. Activation ({pulls})."
    return [numbers, *([marks.strip()] if marks else []), design]
