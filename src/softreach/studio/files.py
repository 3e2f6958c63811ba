"""Files that a tab can be saved as: bytes under a name."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.export import export_cloud, export_mesh
from softreach.rod.kinematics import configuration
from softreach.studio.reach import Reach, cloud_points, shown_samples
from softreach.studio.scene.clouds import in_slice, sample_values
from softreach.studio.state import Appearance, StudioState, design_of_text
from softreach.support.errors import InvalidInput
from softreach.support.files.text import text_of
from softreach.workspace import ReachableSolid, ReachableSurface, Surface

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "cloud_file",
    "figure_file",
    "state_from",
    "surface_file",
]

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
    if not isinstance(reach.exact, ReachableSolid | ReachableSurface):
        raise InvalidInput("design", "too few free bundles", "one whose tip reaches a surface")
    return reach.exact.surface()


def _written(name: str, write: Callable[[Path], object]) -> bytes:
    """Content that the library's own writers put into a file of this name."""
    with tempfile.TemporaryDirectory(prefix="softreach-") as folder:
        path = Path(folder) / name
        write(path)
        return path.read_bytes()
