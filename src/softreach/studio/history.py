"""What was designed and posed before, and what was undone: values, so that going back is exact.

How things look is no part of it: whoever goes back to an earlier design keeps the view.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

from softreach.studio.state import StudioState

__all__ = ["History"]

_LONGEST = 200  # steps back
_PAUSE = 1.5  # [s] without changes of the same kind, after which the next is another step
_SETTINGS = ("design", "reference", "side_by_side")
_POSE = ("activation", "target")


@dataclass(frozen=True, kw_only=True)
class History:
    """States to go back and forth to; a change makes a new history."""

    past: tuple[StudioState, ...] = ()
    """The latest last."""
    future: tuple[StudioState, ...] = ()
    """The next last."""
    kind: str = ""
    """Of the latest change; "" after a step back or forth."""
    at: float = field(default=0.0, compare=False)
    """When that was [s]."""

    def after(
        self,
        old: StudioState,
        new: StudioState,
        *,
        goes_on: bool,
        clock: Callable[[], float] = time.monotonic,
    ) -> History:
        """The history after a change.

        Args:
            old: Before the change.
            new: After it. If only the view differs, the history stays.
            goes_on: Whether it may be part of the step before, as while a slider is dragged: it is
                if that was of the same kind, and a moment ago.
            clock: The time [s].
        """
        kind = _kind(old, new)
        if not kind:
            return self
        now = clock()
        same = goes_on and kind == self.kind and now - self.at < _PAUSE
        past = self.past if same else (*self.past, old)[-_LONGEST:]
        return History(past=past, kind=kind, at=now)

    def at_rest(self) -> History:
        """The same, of which the latest step is over: the next change is another."""
        return replace(self, kind="")

    def back(self, present: StudioState) -> tuple[History, StudioState]:
        """The state before the latest step, seen as now; the present one if there was none."""
        if not self.past:
            return self, present
        *past, last = self.past
        future = (*self.future, present)
        return History(past=tuple(past), future=future), _seen_as(present, last)

    def forth(self, present: StudioState) -> tuple[History, StudioState]:
        """The state that was undone last, seen as now; the present one if there is none."""
        if not self.future:
            return self, present
        *future, following = self.future
        past = (*self.past, present)
        return History(past=past, future=tuple(future)), _seen_as(present, following)


def _seen_as(view: StudioState, state: StudioState) -> StudioState:
    return replace(state, appearance=view.appearance, camera=view.camera)


def _kind(old: StudioState, new: StudioState) -> str:
    """What differs; "" if nothing but the view does."""
    settings = [name for name in _SETTINGS if getattr(old, name) != getattr(new, name)]
    if settings:  # activations may have been moved into other bounds
        return " ".join(settings)
    return "pose" if any(getattr(old, name) != getattr(new, name) for name in _POSE) else ""
