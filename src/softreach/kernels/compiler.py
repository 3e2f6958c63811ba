"""How every kernel is compiled: without the interpreter lock, with loops cached on disk.

A `kernel` calls nothing but what is inlined: the process that compiles links a callee compiled by
itself, later ones load the copy optimized with its caller, and the two round apart. What is
`strict` rounds as written in every process and may call its like; it calls nothing else, and
nothing else calls it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from numba import njit
from numba.core import event

__all__ = ["FAST", "inline", "kernel", "pasted", "strict"]

_LOG = logging.getLogger(__name__)

FAST = {"contract", "reassoc", "nsz", "arcp", "nnan", "ninf"}
"""Freedoms of the compiler in `kernel` and `inline`.

It may fuse multiply-add and reassociate, which rounds differently from the order written (a few
units in the last place), the same for every block and thread. It assumes finite numbers: callers
check.
"""


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a loop over samples."""
    return njit(cache=True, nogil=True, fastmath=FAST, error_model="numpy")(function)


def inline(function: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a small function into its callers; a call left in a loop stops vectorization."""
    return njit(forceinline=True, nogil=True, fastmath=FAST, error_model="numpy")(function)


def pasted(function: Callable[..., Any]) -> Callable[..., Any]:
    """As `inline`, but before compilation: a large function is then not compiled by itself too."""
    return njit(inline="always", nogil=True, fastmath=FAST, error_model="numpy")(function)


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
    return njit(cache=True, nogil=True, fastmath=False, error_model="numpy")(source)


class _Log(event.Listener):
    """Logs what is being compiled; a library prints nothing, the command line listens."""

    def on_start(self, event: event.Event) -> None:
        function: Any = getattr((event.data or {}).get("dispatcher"), "py_func", None)
        if getattr(function, "__module__", "").startswith("softreach"):
            _LOG.info("compiling %s.%s", function.__module__, function.__qualname__)

    def on_end(self, event: event.Event) -> None:
        pass


event.register("numba:compile", _Log())
