"""A web page in one file: the scene as it is, to be turned and zoomed without a server."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.studio import markup
from softreach.studio.captions import legend_text, reach_text
from softreach.studio.colors import key_html
from softreach.studio.eye import lens
from softreach.studio.head import headed
from softreach.studio.reach import Reach
from softreach.studio.scene import Scene
from softreach.studio.server import start_server, stop_server
from softreach.studio.state import Camera, StudioState

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = ["static_page"]

_MOST = 17  # level: a page of some 2 MB
_BOX = (
    "position:fixed;left:0;bottom:0;z-index:9;max-width:100%;padding:0.6em 1em;"
    "background:rgba(255,255,255,0.9);font:14px sans-serif;color:#222"
)


def static_page(state: StudioState, reach: Reach, picture: NDArray[np.uint8] | None = None) -> str:
    """The page, with the numbers of the design and its file under the scene.

    Only a server's scene can be saved, so one is started for a moment, on loopback.

    Args:
        state: What to show.
        reach: Of its design.
        picture: RGB beside the numbers, such as the map of an atlas.
    """
    server = start_server()
    try:
        if state.camera is not None:
            _place(server, state.camera, orthographic=state.appearance.orthographic)
        key = _draw(Scene(server.scene), state, reach)
        page = headed(server.scene.as_html(dark_mode=state.appearance.dark))
    finally:
        stop_server(server)
    end = page.rindex("</body>")
    return page[:end] + _caption(state, reach, key + _image(picture)) + page[end:]


def _place(server: ViserServer, camera: Camera, *, orthographic: bool) -> None:
    found, place = lens(camera, orthographic=orthographic)
    first = server.initial_camera
    first.position, first.look_at = place.position, place.look_at
    first.fov, first.near, first.far = found.fov, found.near, found.far


def _draw(scene: Scene, state: StudioState, reach: Reach) -> str:
    look = state.showing(level=min(_MOST, state.appearance.level)).appearance
    scene.draw_axes(reach, look)
    if look.arm:
        scene.draw_arm(state.design, state.activation)
    scene.draw_surfaces(reach, look)
    return key_html(scene.draw_cloud(reach, look))


def _caption(state: StudioState, reach: Reach, key: str) -> str:
    numbers, file = markup.inline(*reach_text(reach)), markup.inline(state.design.to_toml())
    design = f"<details><summary>design</summary><pre>{file}</pre></details>"
    marks = markup.paragraph(*legend_text(reach, free=False))
    return f'<div style="{_BOX}">{numbers}{key}{marks}{design}</div>'


def _image(picture: NDArray[np.uint8] | None) -> str:
    """The picture inside the page itself."""
    if picture is None:
        return ""
    from matplotlib.image import imsave

    file = io.BytesIO()
    imsave(file, picture, format="png")
    data = base64.b64encode(file.getvalue()).decode()
    shown = f'<img alt="map" style="width:20em" src="data:image/png;base64,{data}">'
    return f"<details><summary>atlas</summary>{shown}</details>"
