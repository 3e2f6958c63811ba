"""End of a process in mid-work: at once, and nothing half-written stays.

A signal may come while a kernel runs, while Numba compiles, and with work on many threads, where an
exception would be late, lost or caught by others. So none is raised: a thread that waits for the
signal calls `end_process`, which lets what must be done as a whole come to its end, undoes what is
unfinished, says one line and leaves. Without such a thread, as in a notebook, these blocks do
nothing and Ctrl-C raises KeyboardInterrupt as ever.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

PATIENCE = 1.0
"""Longest wait of the end for what must be done as a whole [s]."""

Undo = Callable[[], object]

_changed = threading.Condition()
_unfinished: dict[object, Undo] = {}
_begun = 0  # blocks that must come to their end
_ending = False
_remarks: list[Callable[[], str]] = []
_own = threading.local()  # how many such blocks the thread is in


@contextmanager
def as_a_whole() -> Iterator[None]:
    """A short block that ends before the process does, or does not begin."""
    _own.depth = _depth() + 1  # before the lock is taken, so that a signal does not stop us with it
    if not _begin():
        _own.depth = 0
        stop_here()
    try:
        yield
    finally:
        _end()
        _own.depth -= 1
        if _ending:
            stop_here()


@contextmanager
def undoing(undo: Undo) -> Iterator[None]:
    """A block after which `undo` is called, and also if the process ends within it.

    Args:
        undo: Called once; where the process ends, several times.
    """
    key = object()
    with as_a_whole():
        _unfinished[key] = undo
    try:
        yield
    finally:
        with as_a_whole():
            undo()
            del _unfinished[key]


@contextmanager
def remarking(remark: Callable[[], str]) -> Iterator[None]:
    """A block at whose interruption more is said: in the last line of the process, or in a note.

    Args:
        remark: Called then; how far the work is.

    Raises:
        KeyboardInterrupt: What is raised in the block, with the remark as its note.
    """
    _remarks.append(remark)
    try:
        yield
    except KeyboardInterrupt as error:
        error.add_note(remark())
        raise
    finally:
        _remarks.remove(remark)


def stop_here(*_: object) -> None:
    """Do nothing more on this thread, as the process ends; a handler of signals.

    What must be done as a whole goes on, and stops once it is done.
    """
    global _ending
    _ending = True
    if not _depth():
        threading.Event().wait()


def end_process(code: int, said: str = "") -> NoReturn:
    """End this process from a thread that nothing waits for.

    Args:
        code: The exit code.
        said: A line for standard error; nobody else says anything from now on.
    """
    global _ending
    _ending = True
    try:
        with suppress(OSError):  # there may be no standard error, or no terminal behind it
            stderr = _silenced()
            _finish()
            if said:
                said = "; ".join([said, *(remark() for remark in _remarks[-1:])])
                os.write(stderr, f"{_cleared_line(stderr)}{said}\n".encode())
    finally:
        os._exit(code)


def _finish() -> None:
    """Wait for what must be done as a whole, then undo what is unfinished."""
    if _changed.acquire(timeout=PATIENCE):
        _changed.wait_for(lambda: not _begun, PATIENCE)
    for undo in 2 * list(_unfinished.values()):  # twice, as other threads may still be at work
        with suppress(Exception):
            undo()


def _depth() -> int:
    return getattr(_own, "depth", 0)


def _begin() -> bool:
    """Count a block that begins; False if it may not."""
    global _begun
    with _changed:
        if _ending and _depth() == 1:
            return False
        _begun += 1
        return True


def _end() -> None:
    global _begun
    with _changed:
        _begun -= 1
        _changed.notify_all()


def _silenced() -> int:
    """A copy of standard error; it and standard output themselves go nowhere from now on."""
    stderr, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    for stream in (1, 2):
        os.dup2(nowhere, stream)
    return stderr


def _cleared_line(stream: int) -> str:
    """Codes that remove a progress bar from a terminal and show its cursor again."""
    controlled = os.isatty(stream) and os.environ.get("TERM", "dumb") != "dumb"
    return "\r\x1b[2K\x1b[?25h" if controlled and sys.platform != "win32" else ""


def live_with_parent(lifeline: Connection) -> None:
    """Leave Ctrl-C to the parent and end when it has ended; a worker calls this first.

    It stands here and not beside what workers compute, to be imported before all else.

    Args:
        lifeline: A pipe of which only the parent has the other end, and into which it sends
            nothing.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_outlive, args=(lifeline,), daemon=True, name="lifeline").start()


def _outlive(lifeline: Connection) -> None:
    try:
        lifeline.recv_bytes()
    except (EOFError, OSError):
        end_process(1)
