"""How every kernel is compiled: once, cached on disk, without the interpreter lock.

`FAST` lets the compiler fuse multiply-add and reassociate, which rounds differently from the order
written here (a few units in the last place) and is the same for every block and thread. It assumes
finite numbers: callers check. The predicates of the triangulation must not use it.

A `kernel` never calls a `kernel`, only what is inlined: the process that compiles links a callee
compiled by itself, later ones load the copy optimized with its caller, and the two round apart.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event

__all__ = ["FAST", "inline", "kernel"]

_LOG = logging.getLogger(__name__)

FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a loop over samples."""
    return njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")(function)


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small function into its callers; a call left in a loop stops vectorisation."""
    return njit(forceinline=True, nogil=True, fastmath=FAST, error_model="numpy")(function)


class _Log(event.Listener):
    """Logs what is being compiled; a library prints nothing, the command line listens."""

    def on_start(self, event: event.Event) -> None:
        function: Any = getattr((event.data or {}).get("dispatcher"), "py_func", None)
        if getattr(function, "__module__", "").startswith("softreach"):
            _LOG.info("compiling %s.%s", function.__module__, function.__qualname__)

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _Log())
