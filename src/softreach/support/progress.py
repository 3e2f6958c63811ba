"""Progress of long work: callbacks, and a bar on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from softreach.support.arguments import as_function

__all__ = ["Progress", "as_progress", "bar", "hidden", "silent"]

hidden = False
"""No bars, even on a terminal; `softreach --quiet` sets it."""

Progress = Callable[[int], None]
"""Called with the number of items done since the last call."""


def silent(done: int) -> None:
    """Report nothing."""
    del done


def as_progress(progress: object) -> Progress:
    """The callback of a caller; one that reports nothing for None.

    Raises:
        InvalidInput: It cannot be called.
    """
    return silent if progress is None else as_function("progress", progress)


@contextmanager
def bar(label: str, total: int | None) -> Iterator[Progress]:
    """A progress bar with rate and time left on standard error, if that is a terminal.

    Args:
        label: What is going on.
        total: Number of items; None if it is known only in the end, for a bar that moves on.
    """
    if hidden or not sys.stderr.isatty():
        yield silent
        return
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        Progress,
        TaskProgressColumn,
        TextColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TaskProgressColumn(show_speed=True),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(label, total=total)
        yield lambda done: display.update(task, advance=done)
