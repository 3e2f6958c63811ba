"""Export of the state, design, cloud, surface, arm and pictures; and states loaded again."""

from __future__ import annotations

import tempfile
import textwrap
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.obstacles import Obstacle
from softreach.export import export_arm, export_cloud, export_mesh
from softreach.export.clouds import CLOUD_FILES
from softreach.export.surfaces import SURFACE_FILES
from softreach.geometry.meshes import MeshFile
from softreach.plot.coloring import draw_figure_key
from softreach.plot.style import inked
from softreach.rod.kinematics import configuration
from softreach.studio.captions import legend_text, reach_text
from softreach.studio.fields import GRAY, Change, Fields, file_text
from softreach.studio.markup import Swatch
from softreach.studio.reach import Reach, cloud_points, shown_samples
from softreach.studio.scene.camera import FINER
from softreach.studio.scene.colors import sample_values
from softreach.studio.scene.scene import in_slice
from softreach.studio.scene.solids import solid_surfaces
from softreach.studio.session import Session
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import StudioState, design_of_text
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

Write = Callable[[Session, Path], object]
"""Writes what a tab shows to a file, whose suffix chooses the format."""

_ABOUT = {
    "data": "Design, all samples, exact boundary, or arm as bent, in the unit of the page",
    "picture": "The scene as it is seen, with legend and design; or a web page that turns",
}
_PAPER_AND_INK = {False: ("white", "#222222"), True: ("#141414", "#dddddd")}
"""Of a light page and of a dark one."""
_DPI = 100.0
_KEY, _LINE, _EDGE = 62, 17, 14  # pixels: height of the key and of a line of text, margin
_CHARACTER = 6.4  # pixels


def export(panel: Fields) -> None:
    """Buttons that send a file to the browser, and one that takes a file back."""
    session = panel.session
    with panel.folder("this work"):
        about = "Everything that this tab shows, to be loaded again (JSON)"
        state = lambda: session.state_now().to_json().encode()
        keep = lambda: session.send("softreach-studio.json", state)
        panel.button("Save this work", keep, about)
        own = session.start.state.design.surroundings
        read = lambda file: session.restore(saved(file.name, file.content, own))
        hint = "A state (.json) or a design (.toml) that was saved"
        panel.upload("Load state or design", read, hint, **GRAY)
    for folder, kind in (("design and data", "data"), ("pictures", "picture")):
        with panel.folder(folder):
            menu = panel.gui.add_dropdown(kind, tuple(FILES[kind]), hint=_ABOUT[kind])

            def save(menu: Any = menu, kind: str = kind) -> None:
                name, write = FILES[kind][menu.value]
                session.send(name, lambda: content_of(session, name, write))

            panel.button(f"Save {kind}", save, "As a file of this type")


def saved(name: str, content: bytes, own: Sequence[Obstacle] = ()) -> Change:
    """The change to the state in a file, or to the design of a TOML; it may name `own` meshes."""
    text = file_text(name, content)
    if name.lower().endswith(".toml"):
        design = design_of_text(text, name)
        _check_meshes(design, own)
        return lambda state: state.replace(design=design)
    state = StudioState.from_json(text)
    for arm in filter(None, (state.design, state.reference)):
        _check_meshes(arm, own)
    return lambda _: state


def _check_meshes(arm: Manipulator, own: Sequence[Obstacle]) -> None:
    known = {each.region for each in own}
    for region in (each.region for each in arm.surroundings):
        if isinstance(region, MeshFile) and region not in known:
            allowed = "part of the text, as other files are not sent along"
            raise InvalidInput("mesh", region.path, allowed, "load it on the tab Parts")


def content_of(session: Session, name: str, write: Write) -> bytes:
    """Content that a writer puts into a file of this name."""
    with tempfile.TemporaryDirectory(prefix="softreach-") as folder:
        path = Path(folder) / name
        write(session, path)
        return path.read_bytes()


def _reach(session: Session) -> Reach:
    reach = session.found.complete_reach(session.state.design)
    if reach is None:
        raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
    return reach


def _write_cloud(session: Session, path: Path) -> None:
    export_cloud(_reach(session).cloud, path, unit=session.state.design.length_unit)


def _write_surface(session: Session, path: Path) -> None:
    reach, unit = _reach(session), session.state.design.length_unit
    if reach.refusal:
        raise InvalidInput("surface", "unknown", "that of an exact set", reach.refusal)
    if reach.exact is None or reach.exact.dimension < 2:
        raise InvalidInput("design", "too few free bundles", "one whose tip reaches a surface")
    export_mesh(reach.exact.surface(), path, unit=unit)


def _write_arm(session: Session, path: Path) -> None:
    arm = session.state.design
    shape = configuration(arm, session.state.activation)
    if not np.isfinite(shape.position.values).all():
        raise InvalidInput("activation", session.state.activation, "one with an equilibrium")
    export_arm(arm, shape, path, unit=arm.length_unit)


def _write_page(session: Session, path: Path) -> None:
    """A web page to be turned: the boundary or the points that are shown, and the arm as it is."""
    from softreach import plot

    reach, state, (cloud, color) = _reach(session), session.state, _shown(session)
    is_surface = reach.has_surface and state.appearance.surface and not state.appearance.cloud
    shown = [reach.exact if is_surface else cloud, configuration(state.design, state.activation)]
    shown += solid_surfaces(state.design)
    unit, caption = state.design.length_unit.name, ". ".join(_caption(state, reach))
    page = plot.plot_3d(shown, color=color, unit=unit, caption=caption)
    path.write_text(page.html, encoding="utf-8")


def _shown(session: Session) -> tuple[xr.Dataset, str | int | xr.DataArray]:
    reach, look = _reach(session), session.state.appearance
    known = [name for name in ("tip", "activation", "status") if name in reach.cloud]
    cloud = reach.cloud[known].isel(sample=shown_samples(reach, look.level))
    color = sample_values(reach, look.level, look.color)
    kept = in_slice(cloud_points(reach, look.level), look.slice)
    color = color if isinstance(color, str | int) else color.isel(sample=kept)
    return cloud.isel(sample=kept), color


def _write_picture(session: Session, path: Path) -> None:
    """The scene as it is seen, with its key above, numbers and design below."""
    from matplotlib.figure import Figure

    state, reach, key = session.state, _reach(session), session.found.key
    scene = session.camera.picture()
    seen = np.flatnonzero(scene[..., 3].any(axis=1))  # rows that are not empty
    if len(seen):
        scene = scene[max(0, seen[0] - FINER * _EDGE) : seen[-1] + FINER * _EDGE]
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
    inked(figure, ink)
    figure.savefig(path, facecolor=paper)


def _caption(state: StudioState, reach: Reach) -> list[str]:
    """Numbers and marks of a reach, its design, and how hard each bundle pulls."""
    numbers, marks = (
        "".join(part for part in parts if not isinstance(part, Swatch)).strip()
        for parts in (reach_text(reach), legend_text(reach, free=False))
    )
    values = ", ".join(f"{c.label} {c.shown:g}" for c in slider_parameters(state.design))
    pulls = ", ".join(f"{value:.3g}" for value in state.activation)
    design = f"{values}; L = {state.design.length:g} m. Activation ({pulls})."
    return [*filter(None, (numbers, marks, design))]


_WRITERS: Mapping[str, tuple[Mapping[str, object], Write]] = {
    "design": ({".toml": None}, lambda session, path: session.state.design.save(path)),
    "cloud": (CLOUD_FILES, _write_cloud),
    "exact surface": (SURFACE_FILES, _write_surface),
    "arm": (SURFACE_FILES, _write_arm),
}
FILES: Mapping[str, Mapping[str, tuple[str, Write]]] = {
    "data": {
        f"{what} ({suffix})": (f"{what.split()[-1]}{suffix}", write)
        for what, (formats, write) in _WRITERS.items()
        for suffix in formats
    },
    "picture": {
        "as it is seen (.png)": ("studio.png", _write_picture),
        "web page (.html)": ("reachability.html", _write_page),
    },
}
"""What can be saved, by kind and by what the menu calls it: name of the file and its writer."""
