"""Export of the state, design, cloud, surface and pictures; and states that are loaded again."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

from softreach.export.clouds import CLOUD_FILES
from softreach.export.surfaces import SURFACE_FILES
from softreach.studio.fields import attempt, bind_button
from softreach.studio.files import (
    cloud_file,
    figure_file,
    page_file,
    picture_file,
    state_from,
    surface_file,
)
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
    "picture": "The scene as it is seen, with legend and design; three views and an oblique one of "
    "the points that are shown; or the scene in one file, to be turned without a studio",
    "Save picture": "As a file of this type",
}
_SECOND: Any = {"color": "gray"}
"""Looks of the buttons that are not the first of their group."""


class ExportPanel:
    """Buttons that send a file to the browser, and one that takes a file back."""

    def __init__(self, gui: GuiApi, tab: Any, session: Session) -> None:
        self._session = session
        self._writers = {
            "design (.toml)": self._save_design,
            **self._files("cloud", "cloud", CLOUD_FILES, cloud_file),
            **self._files("exact surface", "surface", SURFACE_FILES, surface_file),
        }
        self._painters = {
            "as it is seen (.png)": partial(self._write, "studio.png", self._picture),
            "four views (.png)": partial(self._write, "reachability.png", self._figure),
            "web page (.html)": partial(self._write, "reachability.html", self._page),
        }
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

    def _files(
        self, kind: str, stem: str, suffixes: Iterable[str], content: Callable[[Reach, str], bytes]
    ) -> dict[str, Callable[[], None]]:
        return {
            f"{kind} ({suffix})": partial(
                self._write, stem + suffix, lambda reach, suffix=suffix: content(reach, suffix)
            )
            for suffix in suffixes
        }

    def _save_state(self) -> None:
        self._send("softreach-studio.json", self._session.state_now().to_json().encode())

    def _save_design(self) -> None:
        self._send("design.toml", self._session.state.design.file_text.encode())

    def _picture(self, reach: Reach) -> bytes:
        session = self._session
        return picture_file(session.picture(), session.state, reach, session.found.key)

    def _figure(self, reach: Reach) -> bytes:
        return figure_file(reach, self._session.state)

    def _page(self, reach: Reach) -> bytes:
        return page_file(reach, self._session.state)

    def _button(self, label: str, action: Callable[[], None], **looks: Any) -> None:
        button = self._session.client.gui.add_button(label, hint=_ABOUT[label], **looks)
        bind_button(button, self._session, action)

    def _restore(self, file: UploadedFile) -> None:
        self._session.restore(state_from(file.name, file.content, self._session.state))

    def _reach(self) -> Reach:
        reach = self._session.found.reach
        if reach is None or not reach.fine or reach.arm != self._session.state.design:
            raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
        return reach

    def _write(self, name: str, content: Callable[[Reach], bytes]) -> None:
        """Send what takes a while to make, and say so meanwhile."""
        reach = self._reach()
        with self._session.working(f"writing {name}"):
            data = content(reach)
        self._send(name, data)
        size = f"{len(data) / 1e6:.1f} MB" if len(data) >= 1e5 else f"{len(data) / 1e3:.1f} kB"
        self._session.say(f"{name} is written: {size}.")

    def _send(self, name: str, content: bytes) -> None:
        self._session.client.send_file_download(name, content, save_immediately=True)
