"""`softreach studio`: the design desk in the browser."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from softreach.cli.inputs import design_from

__all__ = ["studio"]


def studio(
    source: Annotated[
        str, Parameter(help="Design file (.toml), built-in design, cloud or atlas (.zarr).")
    ] = "minimal_trunk",
    *,
    host: Annotated[
        str, Parameter(help="Address to listen on; anyone who can reach it may use the page.")
    ] = "127.0.0.1",
    port: Annotated[int | None, Parameter(help="A free port by default.")] = None,
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
    from softreach.studio.source import start_on_design, start_on_store

    stored = source.rstrip("/").endswith(".zarr")
    start = start_on_store(source) if stored else start_on_design(design_from(source))
    with Studio(start, host, port) as running:
        sys.stdout.write(f"{running.url}  (Ctrl-C ends it)\n")
        sys.stdout.flush()
        if open_page:
            webbrowser.open(running.url)
        threading.Event().wait()
