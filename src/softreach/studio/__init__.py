"""The design desk in the browser: move a slider, see at once what a design can reach."""

from softreach.studio.app import Studio
from softreach.studio.reach import Quality
from softreach.studio.start import Start
from softreach.studio.state import StudioState

__all__ = ["Quality", "Start", "Studio", "StudioState"]
