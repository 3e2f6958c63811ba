"""Progress of long work: callbacks, a bar on a terminal, lines elsewhere."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from softreach.support.arguments import as_function

Progress = Callable[[int], None]  # Called with the number of items done since the last call
hidden = False  # No bars and no lines; `softreach --quiet` sets it
_PAUSE = 30.0  # [s] between lines


def silent(done: int) -> None:
    """Report nothing."""
    del done


def as_progress(progress: object) -> Progress:
    """The callback of a caller; one that reports nothing for None."""
    return silent if progress is None else as_function("progress", progress)


@contextmanager
def bar(label: str | Callable[[], str], total: int | None) -> Iterator[Progress]:
    """A bar with rate and time left on standard error; elsewhere a line every half minute.

    A label may be a function that says it anew each time; a total of None is known in the end.
    """
    if hidden:
        yield silent
        return
    said = (lambda: label) if isinstance(label, str) else label
    if not sys.stderr.isatty():
        yield _Lines(said, total)
        return
    from rich import console, progress

    times = progress.TaskProgressColumn(show_speed=True), progress.TimeRemainingColumn()
    columns = (progress.TextColumn("{task.description}"), progress.BarColumn(), *times)
    on_error = console.Console(stderr=True)
    with progress.Progress(*columns, console=on_error, transient=True) as display:
        task = display.add_task(said(), total=total)
        yield lambda done: display.update(task, advance=done, description=said())


class _Lines:
    def __init__(self, label: Callable[[], str], total: int | None) -> None:
        self._label, self._total, self._done = label, total, 0
        self._begun = self._told = time.monotonic()
        self._lock = threading.Lock()

    def __call__(self, done: int) -> None:
        with self._lock:
            self._done += done
            now = time.monotonic()
            if now - self._told < _PAUSE:
                return
            self._told = now
            of_total = "" if self._total is None else f": {self._done:,} of {self._total:,}"
            minutes, seconds = divmod(round(now - self._begun), 60)
            with suppress(OSError, ValueError):  # standard error is closed
                sys.stderr.write(f"{self._label()}{of_total}, {minutes}:{seconds:02} so far\n")
                sys.stderr.flush()
