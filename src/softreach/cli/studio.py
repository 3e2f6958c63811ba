"""`softreach studio`: the design desk in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.inputs import design_from
from softreach.cli.numbers import WHOLE
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.studio import Start

__all__ = ["studio"]


_LAST_PORT = 65535


def studio(
    source: Annotated[
        str,
        Parameter(help="Design or its file (.toml), saved state (.json), cloud or atlas (.zarr)."),
    ] = "minimal_trunk",
    *,
    host: Annotated[
        str, Parameter(help="Address to listen on; anyone who can reach it may use the page.")
    ] = "127.0.0.1",
    port: Annotated[int | None, WHOLE, Parameter(help="A free port by default.")] = None,
    open_page: Annotated[
        bool, Parameter(name="--open", help="Open the page in the browser.")
    ] = True,
) -> None:
    """Serve a page on this machine: move sliders and see what the design can reach.

    Example: softreach studio redundant_trunk --no-open
    """
    import sys
    import threading
    import webbrowser

    from softreach.studio import Studio

    if port is not None and not 0 <= port <= _LAST_PORT:
        raise InvalidInput("port", port, f"a whole number from 0 to {_LAST_PORT}")
    with Studio(_start(source), host, port) as running:
        sys.stdout.write(f"{running.url}  (Ctrl-C ends it)\n")
        sys.stdout.flush()
        if open_page:
            webbrowser.open(running.url)
        threading.Event().wait()


def _start(source: str) -> Start:
    from softreach.studio.source import start_on_design, start_on_state, start_on_store

    if source.rstrip("/").endswith(".zarr"):
        return start_on_store(source)
    if source.lower().endswith(".json"):
        return start_on_state(source)
    return start_on_design(design_from(source))
