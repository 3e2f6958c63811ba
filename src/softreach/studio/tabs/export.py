"""Export of the state, design, cloud, surface and pictures; and states that are loaded again."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING

from softreach.export.clouds import CLOUD_FILES
from softreach.export.surfaces import SURFACE_FILES
from softreach.studio.fields import GRAY, Fields
from softreach.studio.files import (
    cloud_file,
    figure_file,
    page_file,
    picture_file,
    state_from,
    surface_file,
)
from softreach.studio.session import Session
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from viser import UploadedFile

    from softreach.studio.reach import Reach

Content = Callable[["Reach"], bytes]

_DATA = (
    "The design alone, which the command line reads too; all samples of the cloud, tips [m] and "
    "activations; or the exact boundary of the reachable set [m]"
)
_PICTURE = (
    "The scene as it is seen, with legend and design; three views and an oblique one of the points "
    "that are shown; or the scene in one file, to be turned without a studio"
)


def export(panel: Fields) -> None:
    """Buttons that send a file to the browser, and one that takes a file back."""
    session = panel.session
    design = lambda: session.send("design.toml", session.state.design.file_text.encode())  # noqa: E731
    data = {
        "design (.toml)": design,
        **_files(session, "cloud", "cloud", CLOUD_FILES, cloud_file),
        **_files(session, "exact surface", "surface", SURFACE_FILES, surface_file),
    }
    pictures = {
        "as it is seen (.png)": partial(_write, session, "studio.png", partial(_seen, session)),
        "four views (.png)": partial(
            _write, session, "reachability.png", lambda reach: figure_file(reach, session.state)
        ),
        "web page (.html)": partial(
            _write, session, "reachability.html", lambda reach: page_file(reach, session.state)
        ),
    }
    with panel.folder("this work"):
        about = "Everything that this tab shows, to be loaded again (JSON)"
        panel.button("Save this work", lambda: _save_state(session), about)
        restore = lambda file: _restore(session, file)  # noqa: E731
        hint = "A state (.json) or a design (.toml) that was saved"
        panel.upload("Load state or design", restore, hint, **GRAY)
    for folder, kind, writers, about in (
        ("design and data", "data", data, _DATA),
        ("pictures", "picture", pictures, _PICTURE),
    ):
        with panel.folder(folder):
            menu = panel.gui.add_dropdown(kind, tuple(writers), hint=about)
            save = lambda menu=menu, writers=writers: writers[menu.value]()  # noqa: E731
            panel.button(f"Save {kind}", save, "As a file of this type")


def _files(
    session: Session,
    kind: str,
    stem: str,
    suffixes: Iterable[str],
    content: Callable[[Reach, str], bytes],
) -> dict[str, Callable[[], None]]:
    return {
        f"{kind} ({suffix})": partial(
            _write, session, stem + suffix, lambda reach, suffix=suffix: content(reach, suffix)
        )
        for suffix in suffixes
    }


def _save_state(session: Session) -> None:
    session.send("softreach-studio.json", session.state_now().to_json().encode())


def _restore(session: Session, file: UploadedFile) -> None:
    session.restore(state_from(file.name, file.content, session.state))


def _seen(session: Session, reach: Reach) -> bytes:
    return picture_file(session.camera.picture(), session.state, reach, session.found.key)


def _write(session: Session, name: str, content: Content) -> None:
    """Send what takes a while to make, and say so meanwhile."""
    reach = session.found.complete_reach(session.state.design)
    if reach is None:
        raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
    with session.working(f"writing {name}"):
        data = content(reach)
    session.send(name, data)
    size = f"{len(data) / 1e6:.1f} MB" if len(data) >= 1e5 else f"{len(data) / 1e3:.1f} kB"
    session.say(f"{name} is written: {size}.")
