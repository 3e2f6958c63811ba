"""Where a program keeps what a person did with it, on this kind of machine."""

from __future__ import annotations

import os
import sys
from pathlib import Path

__all__ = ["user_folder"]


def user_folder() -> Path:
    """The folder for the state of softreach; `XDG_STATE_HOME` moves it on every system."""
    if chosen := os.environ.get("XDG_STATE_HOME"):
        return Path(chosen) / "softreach"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData/Local") / "softreach"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "softreach"
    return Path.home() / ".local" / "state" / "softreach"
