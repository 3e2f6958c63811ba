"""Start of a tab: a design, a saved state, a stored cloud, or the work that was kept."""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from softreach.arm.manipulator import Manipulator
from softreach.studio.files import LARGEST
from softreach.studio.reach import Quality, Reach, reached
from softreach.studio.state import StudioState
from softreach.support.errors import SoftreachError
from softreach.support.files.atomic import replacing
from softreach.support.files.text import read_text


@dataclass(frozen=True, kw_only=True)
class Start:
    """State and knowledge that every new tab begins with."""

    state: StudioState
    quality: Quality
    reach: Reach | None = None


def start_on_design(arm: Manipulator, quality: Quality | None = None) -> Start:
    """Begin with a design."""
    return Start(state=StudioState(design=arm), quality=quality or Quality())


def start_on_state(path: str | PathLike[str], quality: Quality | None = None) -> Start:
    """Begin with a state that a tab was saved as.

    Raises:
        InvalidInput: There is no such file, or it is no state.
        InvalidDesign: A design in it cannot exist.
    """
    text = read_text("state file", path, LARGEST)
    return Start(state=StudioState.from_json(text), quality=quality or Quality())


def start_on_cloud(path: str | PathLike[str], quality: Quality | None = None) -> Start:
    """Begin with a cloud that `save_cloud` wrote.

    Raises:
        InvalidInput: There is no cloud at this path.
    """
    from softreach.cloud.clouds import open_cloud

    quality = quality or Quality()
    reach = reached(open_cloud(path), quality)
    return Start(state=StudioState(design=reach.arm), quality=quality, reach=reach)


# Folder of a user for the state of a program.


def user_folder() -> Path:
    """The folder for the state of softreach; `XDG_STATE_HOME` moves it on every system."""
    if chosen := os.environ.get("XDG_STATE_HOME"):
        return Path(chosen) / "softreach"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local") / "softreach"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "softreach"
    return Path.home() / ".local" / "state" / "softreach"


# Work on a design that stays when its tab is reloaded or the server ends.
#
# The server keeps it: in the user's own folder, a folder for each design that the studio is opened
# on. The file appears complete or not at all: of two tabs that write, the later state stays.


class KeptWork:
    """One folder; what in it cannot be read is left alone and named in `complaint`."""

    def __init__(self, folder: Path, *, goes_on: bool = True) -> None:
        """Read what there is.

        Args:
            folder: Made when first written to.
            goes_on: Whether to begin with the latest state.
        """
        self._folder, self._writing = folder, threading.Lock()
        self.complaint = ""
        """Reason why something could not be read or written; one line."""
        self.latest: StudioState | None = self._latest() if goes_on else None
        """The state that was kept last."""

    def keep(self, state: StudioState) -> None:
        """Keep the latest state."""
        self.latest = state
        self._write("latest.json", state.to_json())

    def _latest(self) -> StudioState | None:
        path = self._folder / "latest.json"
        try:
            return (
                StudioState.from_json(read_text("file", path, LARGEST)) if path.exists() else None
            )
        except (SoftreachError, OSError) as error:
            self._complain(path, error)
            return None

    def _write(self, name: str, text: str) -> None:
        """A disk that is full or read-only costs the memory of the work, not the work."""
        try:
            with (
                self._writing,
                replacing(self._folder / name, overwrite=True) as partial,
            ):
                partial.write_text(text, encoding="utf-8")
        except (SoftreachError, OSError) as error:
            self._complain(self._folder / name, error)

    def _complain(self, path: Path, error: Exception) -> None:
        self.complaint = f"Work is not kept: {path}: {' '.join(str(error).split())}"[:500]


def work_on(design: Manipulator, *, goes_on: bool = True) -> KeptWork:
    """Work that is kept of a design."""
    digest = hashlib.sha256(design.to_toml().encode()).hexdigest()[:16]
    return KeptWork(user_folder() / "studio" / digest, goes_on=goes_on)
