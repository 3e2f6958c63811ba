"""Threads over blocks of work, as kernels release the interpreter lock; Ctrl-C gets in between."""

import os
import threading
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from functools import cache, partial
from itertools import chain, islice
from typing import Any, TypeVar

from softreach.support.interruption import check_stopped

Result = TypeVar("Result")


class _Unwanted(BaseException):
    """The result is no longer wanted; a task must not take this for a failure of its own."""


class _Here(threading.local):
    undivided = False
    given_up: tuple[threading.Event, ...] = ()
    """Set once the pool of this thread, or one that it was started in, is given up."""

    def check_wanted(self) -> None:
        for event in self.given_up:
            if event.is_set():
                raise _Unwanted


_here = _Here()


def thread_count() -> int:
    """Number of threads used: ``SOFTREACH_NUM_THREADS``, or the cores this process may use."""
    setting = os.environ.get("SOFTREACH_NUM_THREADS", "")
    if setting.isdigit() and int(setting) > 0:
        return int(setting)
    has_affinity = hasattr(os, "sched_getaffinity")
    return len(os.sched_getaffinity(0)) if has_affinity else os.cpu_count() or 1


def threads_here() -> int:
    """Number of threads that work begun on this one may be spread over: 1 where `undivided`."""
    return 1 if _here.undivided else thread_count()


def blocks(total: int, size: int) -> list[slice]:
    """Consecutive slices of at most ``size`` that cover ``range(total)``."""
    starts = range(0, total, size)
    return list(map(slice, starts, (*starts[1:], total)))


def run(tasks: Iterable[Callable[[], object]]) -> None:
    """Call every task on the threads; at most twice as many are drawn ahead as are running.

    The first exception (Ctrl-C too) stops the drawing of further tasks, here and in what the tasks
    themselves run on threads, and is raised once the calls already begun have ended. A task that is
    alone is called on the calling thread, because starting threads takes longer than a small block
    of samples.
    """
    drawn = iter(tasks)
    first = list(islice(drawn, 2))
    if len(first) < 2 or _here.undivided:
        for task in chain(first, drawn):
            check_stopped()
            _here.check_wanted()
            task()
        return
    threads = thread_count()
    pending: set[Future[object]] = set()
    with _pool(threads) as submit:
        for task in chain(first, drawn):
            pending.add(submit(task))
            if len(pending) >= 2 * threads:
                pending = _drain(pending)
        while pending:
            pending = _drain(pending)


@contextmanager
def undivided() -> Iterator[None]:
    """Let `run` call its tasks on this thread, which is one of several with work of their own."""
    before, _here.undivided = _here.undivided, True
    try:
        yield
    finally:
        _here.undivided = before


def in_order(tasks: Iterable[Callable[[], Result]]) -> Iterator[Result]:
    """The results of tasks in their order; as many run at a time as there are threads."""
    threads = thread_count()
    if threads == 1:
        yield from (task() for task in tasks)
        return
    ahead: deque[Future[Result]] = deque()
    with _pool(threads) as submit:
        for task in tasks:
            ahead.append(submit(task))
            if len(ahead) > threads:
                yield ahead.popleft().result()
        while ahead:
            yield ahead.popleft().result()


@contextmanager
def meanwhile(task: Callable[[], Result]) -> Iterator[Callable[[], Result]]:
    """Call a task on another thread during the block, which gets a function that waits for it.

    Where only one thread is to be used, the task begins when its result is asked for.
    """
    if thread_count() == 1:
        yield cache(task)
        return
    with _pool(1) as submit:
        yield submit(task).result


Submit = Callable[[Callable[[], Result]], "Future[Result]"]


@contextmanager
def _pool(threads: int) -> Iterator[Submit[Any]]:
    """Threads for a block; if it raises, what has not begun never does."""
    given_up = threading.Event()
    events = (*_here.given_up, given_up)

    def called(task: Callable[[], Any]) -> Any:
        _here.given_up = events
        _here.check_wanted()
        return task()

    pool = ThreadPoolExecutor(threads)
    try:
        yield partial(pool.submit, called)
    except BaseException:
        given_up.set()
        raise
    finally:
        pool.shutdown(cancel_futures=given_up.is_set())


def _drain(pending: set[Future[object]]) -> set[Future[object]]:
    done, rest = wait(pending, return_when=FIRST_COMPLETED)
    for future in done:
        future.result()
    return rest
