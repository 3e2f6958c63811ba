"""Export of the state, design, cloud, surface and pictures; and states that are loaded again."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
    from softreach.studio.reach import Reach

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
_STATE: File = ("softreach-studio.json", lambda s: s.state_now().to_json().encode())


def export(panel: Fields) -> None:
    """Buttons that send a file to the browser, and one that takes a file back."""
    session = panel.session
    with panel.folder("this work"):
        about = "Everything that this tab shows, to be loaded again (JSON)"
        panel.button("Save this work", lambda: _send(session, *_STATE), about)
        read = lambda file: session.restore(state_from(file.name, file.content, session.state))
        hint = "A state (.json) or a design (.toml) that was saved"
        panel.upload("Load state or design", read, hint, **GRAY)
    for folder, kind, files, about in (
        ("design and data", "data", _DATA, _ABOUT_DATA),
        ("pictures", "picture", _PICTURES, _ABOUT_PICTURES),
    ):
        with panel.folder(folder):
            menu = panel.gui.add_dropdown(kind, tuple(files), hint=about)
            save = lambda menu=menu, files=files: _send(session, *files[menu.value])
            panel.button(f"Save {kind}", save, "As a file of this type")


def _reach(session: Session) -> Reach:
    reach = session.found.complete_reach(session.state.design)
    if reach is None:
        raise InvalidInput("cloud", "still being computed", "complete", "try again soon")
    return reach


def _send(session: Session, name: str, content: Callable[[Session], bytes]) -> None:
    """Send what may take a while to make, and say so meanwhile."""
    with session.working(f"writing {name}"):
        data = content(session)
    session.send(name, data)
    size = f"{len(data) / 1e6:.1f} MB" if len(data) >= 1e5 else f"{len(data) / 1e3:.1f} kB"
    session.say(f"{name} is written: {size}.")
