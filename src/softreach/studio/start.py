"""Start of a tab: a design, that of a stored cloud, a saved state, or the work that was kept."""

from __future__ import annotations

import hashlib
import os
import sys
import threading
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from softreach.arm.manipulator import Manipulator
from softreach.studio.reach import Quality
from softreach.studio.state import LARGEST, StudioState
from softreach.support.errors import SoftreachError
from softreach.support.files.text import read_text, write_text

USUAL = Quality()
_STATE = {"win32": "~/AppData/Local", "darwin": "~/Library/Application Support"}
"""Folder of a user for what programs keep, by system."""


@dataclass(frozen=True, kw_only=True)
class Start:
    """State that every new tab begins with."""

    state: StudioState
    quality: Quality


def start_on_design(arm: Manipulator, quality: Quality = USUAL) -> Start:
    """Begin with a design."""
    return Start(state=StudioState(design=arm), quality=quality)


def start_on_state(path: str | PathLike[str], quality: Quality = USUAL) -> Start:
    """Begin with a state that a tab was saved as.

    Raises:
        InvalidInput: There is no such file, or it is no state.
        InvalidDesign: A design in it cannot exist.
    """
    text = read_text("state file", path, LARGEST)
    return Start(state=StudioState.from_json(text), quality=quality)


def start_on_cloud(path: str | PathLike[str], quality: Quality = USUAL) -> Start:
    """Begin with the design of a cloud that `save_cloud` wrote.

    Raises:
        InvalidInput: There is no cloud at this path.
    """
    from softreach.cloud.clouds import design_of, open_cloud

    return start_on_design(design_of(open_cloud(path)), quality)


class KeptWork:
    """The latest state of a tab in a file, which stays when its tab is reloaded or the server ends.

    A file that cannot be read is left alone and named in `complaint`. Of two tabs that write, the
    later state stays.
    """

    def __init__(self, folder: Path, *, goes_on: bool = True) -> None:
        """Read what there is in a folder, made when first written to, if work goes on with it."""
        self._path, self._writing = folder / "latest.json", threading.Lock()
        self.complaint = ""  # reason why something could not be read or written; one line
        self.latest: StudioState | None = None  # the state that was kept last
        try:
            if goes_on and self._path.exists():
                self.latest = StudioState.from_json(read_text("file", self._path, LARGEST))
        except (SoftreachError, OSError) as error:
            self._complain(error)

    def keep(self, state: StudioState) -> None:
        """Keep the latest state; a disk that is full or read-only costs the memory of the work."""
        self.latest = state
        try:
            with self._writing:
                write_text(self._path, state.to_json(), overwrite=True)
        except (SoftreachError, OSError) as error:
            self._complain(error)

    def _complain(self, error: Exception) -> None:
        self.complaint = f"Work is not kept: {self._path}: {' '.join(str(error).split())}"[:500]


def work_on(design: Manipulator, *, goes_on: bool = True) -> KeptWork:
    """Work that is kept of a design, in a folder of its own; `XDG_STATE_HOME` moves all of them."""
    digest = hashlib.sha256(design.to_toml().encode()).hexdigest()[:16]
    chosen = os.environ.get("XDG_STATE_HOME")
    if not chosen and sys.platform == "win32":
        chosen = os.environ.get("LOCALAPPDATA")
    home = Path(chosen or _STATE.get(sys.platform, "~/.local/state")).expanduser()
    return KeptWork(home / "softreach" / "studio" / digest, goes_on=goes_on)
