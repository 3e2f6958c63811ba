"""`softreach studio`: the design desk in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.inputs import design_from

if TYPE_CHECKING:
    from softreach.studio import Start
    from softreach.studio.kept_work import KeptWork

__all__ = ["studio"]


def studio(
    source: Annotated[
        str,
        Parameter(help="Design or its file (.toml), saved state (.json), cloud or atlas (.zarr)."),
    ] = "minimal_trunk",
    *,
    host: Annotated[
        str, Parameter(help="Address to listen on; anyone who can reach it may use the page.")
    ] = "127.0.0.1",
    port: Annotated[int | None, Parameter(help="A free port by default.")] = None,
    fresh: Annotated[
        bool,
        Parameter(help="Begin with the source itself, not where the last work on it ended."),
    ] = False,
    open_page: Annotated[
        bool, Parameter(name="--open", help="Open the page in the browser.")
    ] = True,
) -> None:
    """Serve a page on this machine: move sliders and see what the design can reach.

    The work on a design and its snapshots are kept in a folder of your own, and found again.

    Example: softreach studio redundant_trunk --no-open
    """
    import sys
    import threading
    import webbrowser

    from softreach.studio import Studio

    start = _start(source)
    with Studio(start, host, port, work=_work(start, source, fresh=fresh)) as running:
        sys.stdout.write(f"{running.url}  (Ctrl-C ends it)\n")
        sys.stdout.flush()
        if open_page:
            webbrowser.open(running.url)
        threading.Event().wait()


def _work(start: Start, source: str, *, fresh: bool) -> KeptWork:
    """What is kept of the work; a state or a cloud that is opened is shown as it is in its file."""
    from softreach.studio.kept_work import work_on

    as_it_is = source.lower().endswith(".json") or start.reach is not None
    return work_on(start.state.design, goes_on=not fresh and not as_it_is)


def _start(source: str) -> Start:
    from softreach.studio.source import start_on_design, start_on_state, start_on_store

    if source.rstrip("/").endswith(".zarr"):
        return start_on_store(source)
    if source.lower().endswith(".json"):
        return start_on_state(source)
    return start_on_design(design_from(source))
