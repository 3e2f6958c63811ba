"""Export of the state, design, cloud, surface and pictures; and states that are loaded again."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

from softreach.studio.captions import scale_bar
from softreach.studio.fields import attempt, bind_button
from softreach.studio.files import (
    CLOUD_FORMATS,
    SURFACE_FORMATS,
    cloud_file,
    figure_file,
    state_from,
    surface_file,
)
from softreach.studio.page import picture_file, static_page
from softreach.studio.scene.camera import FINER
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import GuiApi, UploadedFile

    from softreach.studio.reach import Reach
    from softreach.studio.session import Session


_ABOUT = {
    "Save this work": "Everything that this tab shows, to be loaded again (JSON)",
    "Load": "A state (.json) or a design (.toml) that was saved",
    "data": "The design alone, which the command line reads too; all samples of the cloud, tips "
    "[m] and activations; or the exact boundary of the reachable set [m]",
    "Save data": "As a file of this type",
    "picture": "The scene as it is seen, with legend, design and a scale bar, which is right at "
    "the depth of the point that the camera turns about; three views and an oblique one of the "
    "points that are shown; or the scene in one file, to be turned without a studio",
    "Save picture": "As a file of this type",
}
_SECOND: Any = {"color": "gray"}
"""Looks of the buttons that are not the first of their group."""
_DESIGN = "design (.toml)"
_CLOUD, _SURFACE = "cloud ({})", "exact surface ({})"
_SEEN, _VIEWS, _PAGE = "as it is seen (.png)", "four views (.png)", "web page (.html)"


class ExportPanel:
    """Buttons that send a file to the browser, and one that takes a file back."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._writers = self._data_writers()
        self._painters = {
            _SEEN: self._save_picture, _VIEWS: self._save_figure, _PAGE: self._save_page
        }  # fmt: skip
        with tab:
            with gui.add_folder("this work"):
                self._button("Save this work", self._save_state)
                load = gui.add_upload_button("Load state or design", hint=_ABOUT["Load"], **_SECOND)
            with gui.add_folder("design and data"):
                self._data = gui.add_dropdown("data", tuple(self._writers), hint=_ABOUT["data"])
                self._button("Save data", lambda: self._writers[self._data.value]())
            with gui.add_folder("pictures"):
                self._kind = gui.add_dropdown(
                    "picture", tuple(self._painters), hint=_ABOUT["picture"]
                )
                self._button("Save picture", lambda: self._painters[self._kind.value]())
        load.on_upload(lambda _: attempt(session, lambda: self._restore(load.value)))

    def _data_writers(self) -> dict[str, Callable[[], None]]:
        clouds = {_CLOUD.format(each): partial(self._save_cloud, each) for each in CLOUD_FORMATS}
        surfaces = {
            _SURFACE.format(each): partial(self._save_surface, each) for each in SURFACE_FORMATS
        }
        return {_DESIGN: self._save_design, **clouds, **surfaces}

    def _save_state(self) -> None:
        self._send("softreach-studio.json", self._session.state_now().to_json().encode())

    def _save_design(self) -> None:
        self._send("design.toml", self._session.state.design.file_text.encode())

    def _save_cloud(self, suffix: str) -> None:
        self._write(f"cloud{suffix}", lambda: cloud_file(self._reach(), suffix))

    def _save_surface(self, suffix: str) -> None:
        self._write(f"surface{suffix}", lambda: surface_file(self._reach(), suffix))

    def _save_figure(self) -> None:
        self._write("reachability.png", lambda: figure_file(self._reach(), self._session.state))

    def _save_picture(self) -> None:
        session, reach = self._session, self._reach()
        camera, state = session.camera, session.state
        focal, picture = camera.pixels_per_length, session.picture()
        bar = scale_bar(focal, picture.shape[1] / FINER / 5, state.design.length)
        self._write("studio.png", lambda: picture_file(picture, state, reach, session.key, bar))

    def _save_page(self) -> None:
        session = self._session
        self._write(
            "reachability.html", lambda: static_page(session.state_now(), self._reach()).encode()
        )

    def _button(self, label: str, action: Callable[[], None], **looks: Any) -> None:
        button = self._session.client.gui.add_button(label, hint=_ABOUT[label], **looks)
        bind_button(button, self._session, action)

    def _restore(self, file: UploadedFile) -> None:
        self._session.restore(state_from(file.name, file.content, self._session.state))

    def _reach(self) -> Reach:
        reach = self._session.reach
        if reach is None or not reach.fine or reach.arm != self._session.state.design:
            raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
        return reach

    def _write(self, name: str, content: Callable[[], bytes]) -> None:
        """Send what takes a while to make, and say so meanwhile."""
        with self._session.working(f"writing {name}"):
            data = content()
        self._send(name, data)
        self._session.say(f"{name} is written: {_size(len(data))}.")

    def _send(self, name: str, content: bytes) -> None:
        self._session.client.send_file_download(name, content, save_immediately=True)


def _size(count: int) -> str:
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
