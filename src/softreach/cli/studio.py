"""`softreach studio`: the design desk in the browser."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.inputs import design_from
from softreach.cli.numbers import WHOLE

if TYPE_CHECKING:
    from softreach.studio import Start
    from softreach.studio.start import KeptWork

__all__ = ["studio"]


def studio(
    source: Annotated[
        str,
        Parameter(help="Design or its file (.toml), saved state (.json), cloud or atlas (.zarr)."),
    ] = "minimal_trunk",
    *,
    host: Annotated[
        str, Parameter(help="Address to listen on; beyond this machine the page asks for a token.")
    ] = "127.0.0.1",
    port: Annotated[int | None, WHOLE, Parameter(help="A free port by default.")] = None,
    fresh: Annotated[
        bool,
        Parameter(help="Begin with the source itself, not where the last work on it ended."),
    ] = False,
    open_page: Annotated[
        bool, Parameter(name="--open", help="Open the page in the browser.")
    ] = True,
    token: Annotated[
        bool | None,
        Parameter(help="Ask pages for a secret; by default where other machines can connect."),
    ] = None,
) -> None:
    """Serve a page on this machine: move sliders and see what the design can reach.

    The work on a design and its snapshots are kept in a folder of your own, and found again.

    Example: softreach studio redundant_trunk --no-open
    """
    import sys
    import threading
    import warnings
    import webbrowser

    from softreach.studio import Studio
    from softreach.studio.serve.access import check_port, is_local, new_token

    # viser's, of what is drawn for a page that was closed a moment ago
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    check_port(port or 0)
    asked = not is_local(host) if token is None else token
    start = _start(source)
    secret, work = new_token() if asked else "", _work(start, source, fresh=fresh)
    with Studio(start, host, port, secret, work=work) as running:
        sys.stdout.write(f"{running.url}  (Ctrl-C ends it)\n")
        for url in running.urls_for_others:
            sys.stdout.write(f"{url}  (for other machines)\n")
        sys.stdout.flush()
        if not is_local(host):
            sys.stderr.write(_warning(asked=asked))
        if open_page:
            webbrowser.open(running.url)
        threading.Event().wait()


def _warning(*, asked: bool) -> str:
    """What everybody can do who reaches a studio that is not for this machine alone."""
    who = "who has an address with its token" if asked else "in the network, as no token is asked,"
    return (
        f"warning: everyone {who} can use this studio and this machine's processor; "
        "what is sent is not encrypted\n"
    )


def _work(start: Start, source: str, *, fresh: bool) -> KeptWork:
    """What is kept of the work; a state or a cloud that is opened is shown as it is in its file."""
    from softreach.studio.start import work_on

    as_it_is = source.lower().endswith(".json") or start.reach is not None
    return work_on(start.state.design, goes_on=not fresh and not as_it_is)


def _start(source: str) -> Start:
    from softreach.studio.start import start_on_design, start_on_state, start_on_store

    if source.rstrip("/").endswith(".zarr"):
        return start_on_store(source)
    if source.lower().endswith(".json"):
        return start_on_state(source)
    return start_on_design(design_from(source))
