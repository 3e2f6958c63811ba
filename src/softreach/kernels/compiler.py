"""Compiler of every kernel: without the interpreter lock, with loops cached on disk.

A `kernel` calls nothing but what is inlined, so that all of its arithmetic is fused and rounded in
one place. What is `strict` rounds as written in every process and may call its like; it calls
nothing else, and nothing else calls it. Callees of both kinds are `parts` of the kernels that call
them, and compiled alone only when Python calls them.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from typing import Any

from numba import config, jit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher

from softreach.support.interruption import check_stopped

_LOG = logging.getLogger(__name__)
_COMPILING = "numba:compile"

not_kept: list[str] = []
"""Reasons for which what this process compiled is compiled again by the next."""

FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
"""Freedoms of the compiler in `kernel` and `inline`.

It may fuse multiply-add and reassociate, which rounds differently from the order written (a few
units in the last place), the same for every block and thread. It assumes finite numbers: callers
check.
"""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a loop over samples."""
    return _cached(_dispatcher(function, fastmath=FAST))


def lean_kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """As `kernel`, for one that makes no arrays: then Numba need not count who holds which."""
    return _cached(_dispatcher(function, fastmath=FAST, _nrt=False))


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small function into its callers; a call left in a loop stops vectorization."""
    return _dispatcher(function, part=True, forceinline=True, fastmath=FAST)


def pasted(function: Callable[..., Any]) -> Callable[..., Any]:
    """As `inline`, but before compilation: a large function is then not compiled by itself too."""
    return _dispatcher(function, inline="always", fastmath=FAST)


def cuda_kernel(function: Callable[..., Any]) -> Any:
    """Compile a loop over samples for a GPU, one of them a thread.

    Numba compiles each `inline` part that it calls once more, for that target and from the same
    source. With NUMBA_ENABLE_CUDASIM=1 and NUMBA_DISABLE_JIT=1 all of it runs in Python.
    """
    from numba import cuda

    setattr(config, "CUDA_LOW_OCCUPANCY_WARNINGS", 0)  # noqa: B010  (small blocks are right)
    return cuda.jit(function, fastmath=True)


def strict(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile with every operation rounded by itself, in the order written.

    Exact predicates rest on it: a compiler free to reassociate finds that the rounding error of a
    sum, b - ((a + b) - a), is zero; one that fuses multiply-add computes another error than that of
    the product; and the bounds that say when a sign is sure are proved for one order of roundings.
    So do keys that must grow with their coordinate.

    What is `inline` already is compiled once more from its source. `fastmath` is set, not left out:
    what is compiled on behalf of a caller inherits its flags.
    """
    source = getattr(function, "py_func", function)
    return _cached(_dispatcher(source, part=True, fastmath=False))


def _dispatcher(function: Callable[..., Any], *, part: bool = False, **options: Any) -> Any:
    """A function that is compiled when it is called, unless Numba is told not to compile."""
    if config.DISABLE_JIT:  # pyright: ignore[reportAttributeAccessIssue]
        return function
    options |= {"nogil": True, "error_model": "numpy"}
    made_by = _PART if part else _KERNEL
    return made_by(function, targetoptions=options | {"nopython": True})


def _means() -> tuple[Any, Any, Any]:
    """Makers of kernels and of parts, and what loads them; plain ones where Numba lacks names."""
    try:
        from softreach.kernels import parts

        if not (lacking := parts.missing()):
            return parts.KernelDispatcher, parts.PartedDispatcher, parts.loaded
    except ImportError as error:  # a class that Numba has renamed
        lacking = [str(error)]
    _LOG.info("kernels are compiled plainly, as Numba lacks %s", ", ".join(lacking))
    return _plain, _plain, FunctionCache.load_overload


def _plain(function: Callable[..., Any], targetoptions: dict[str, Any]) -> Any:
    """A function as Numba compiles it of its own accord."""
    return jit(**targetoptions)(function)


_KERNEL, _PART, _loaded = _means()


def _cached(function: Any) -> Any:
    """The compiled function with a cache on disk, if there is a place for one."""
    if isinstance(function, Dispatcher):  # not so where Numba is told not to compile
        try:
            function._cache = _Cache(function.py_func)  # pyright: ignore[reportAttributeAccessIssue]
        except RuntimeError as error:  # no folder can be written
            not_kept.append(str(error))
            _LOG.info("not cached: %s", error)
    return function


class _Cache(FunctionCache):
    """A cache whose faults cost a compilation, never the result.

    An index of an older version may name classes that have moved, and a process that is killed may
    leave anything: what cannot be read is discarded. Two processes that compile a function for
    different types at once may both call their code number one: what is for other types is, too.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            overload = _loaded(self, sig, target_context)
            if overload is not None and overload.signature.args != getattr(sig, "args", sig):
                raise TypeError(f"compiled for {overload.signature.args}")
            return overload
        except Exception as error:  # unpickling raises whatever it likes
            _LOG.info("cache of %r discarded: %s: %s", self, type(error).__name__, error)
            self._attempt(self.flush)
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        self._attempt(super().save_overload, sig, data)

    def _attempt(self, write: Callable[..., None], *arguments: Any) -> None:
        try:
            write(*arguments)
        except Exception as error:
            not_kept.append(str(error))
            _LOG.info("%r cannot be written: %s: %s", self, type(error).__name__, error)


class _Log(event.Listener):
    """Logs what is being compiled; a process that is asked to end begins no further compilation."""

    def on_start(self, event: event.Event) -> None:
        check_stopped()
        function: Any = getattr((event.data or {}).get("dispatcher"), "py_func", None)
        if getattr(function, "__module__", "").startswith("softreach"):
            _LOG.info("compiling %s.%s", function.__module__, function.__qualname__)

    def on_end(self, event: event.Event) -> None:
        pass


event.register(_COMPILING, _Log())


class CompilationWatch(event.Listener):
    """Calls back when compilation begins and when all of it has ended, on a compiling thread."""

    def __init__(self, changed: Callable[[], object]) -> None:
        self._changed, self._lock = changed, threading.Lock()
        self.running = 0  # compilations under way, one within another
        self.done = 0  # times that all of it has ended: of the kernels of a studio, each once
        event.register(_COMPILING, self)

    def close(self) -> None:
        """Watch no longer."""
        event.unregister(_COMPILING, self)

    def on_start(self, event: event.Event) -> None:
        self._count(1)

    def on_end(self, event: event.Event) -> None:
        self._count(-1)

    def _count(self, change: int) -> None:
        with self._lock:
            before, self.running = self.running, self.running + change
            is_turn = bool(before) != bool(self.running)
            self.done += not self.running
        if is_turn:
            self._changed()
