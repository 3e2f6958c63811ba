"""`softreach studio`: the design desk in the browser."""

import secrets
import warnings
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.atlas import grid_of
from softreach.cli.console import console
from softreach.cli.options import OUTPUT, Overwrite, Unit, Whole, design_from, is_stored, refuse
from softreach.support import progress
from softreach.support.errors import NotPossible, counted
from softreach.support.interruption import wait_for_signal

if TYPE_CHECKING:
    from softreach.studio import Start
    from softreach.studio.start import KeptWork

_HERE = "127.0.0.1"
_USE = "can use this studio and this machine's processor; what is sent is not encrypted"
_WITH_TOKEN = f"warning: everyone who has an address with its token {_USE}"
_WITHOUT_TOKEN = f"warning: everyone in the network, without a token, {_USE}"


def studio(
    source: str = "minimal_trunk",
    /,
    *,
    host: str = _HERE,
    port: Whole | None = None,
    fresh: bool = False,
    open_page: Annotated[bool, Parameter(name="--open", negative="--no-open")] = True,
    token: Annotated[bool | None, Parameter(negative="--no-token")] = None,
    static: Annotated[Path | None, Parameter(group=OUTPUT)] = None,
    vary: Annotated[list[str] | None, Parameter(group=OUTPUT)] = None,
    unit: Unit = None,
    overwrite: Overwrite = False,
) -> None:
    """Open the design desk in the browser.

    Move sliders, and see at once what the design can reach. Your work is saved,
    and restored at the next start.

    Example: softreach studio redundant_trunk --no-open

    Args:
        source: Design or its file (.toml), saved state (.json) or cloud (.zarr).
        host: Address to listen on; beyond this machine the page asks for a token.
        port: A free port by default.
        fresh: Ignore saved work.
        open_page: Open the page in the browser.
        token: Open the page only with a secret; the default if other machines can connect.
        static: Write a page with sliders into this folder, and exit.
        vary: A slider of that page: taper_deg=0:3:8. May be repeated.
    """
    if static is not None:
        local = {"host": None if host == _HERE else host, "port": port}
        refuse("with --static, which serves nothing", **local, fresh=fresh, token=token)
        _write_static(source, static, vary, unit, overwrite=overwrite)
        return
    refuse("without --static", vary=vary, unit=unit, overwrite=overwrite)
    from softreach.studio import Studio
    from softreach.studio.serve import is_local

    # viser's, of what is drawn for a page that was closed a moment ago
    warnings.filterwarnings("ignore", "Queued a .* on a closed connection", UserWarning)
    with_token = not is_local(host) if token is None else token
    start, work = begun(source, fresh=fresh)
    secret = secrets.token_urlsafe(18) if with_token else ""
    with Studio(start, host, port, secret, work=work) as running:
        console.line(f"{running.url}  (Ctrl-C ends it)")
        for url in running.urls_for_others:
            console.line(f"{url}  (for other machines)")
        console.flush()
        if not is_local(host):
            console.note(_WITH_TOKEN if with_token else _WITHOUT_TOKEN)
        if open_page:
            webbrowser.open(running.url)
        wait_for_signal()


def _write_static(
    source: str, folder: Path, vary: list[str] | None, unit: str | None, *, overwrite: bool
) -> None:
    from softreach.studio.static import write_static

    if not vary:
        raise NotPossible("give a slider of the page with --vary, such as --vary taper_deg=0:3:8")
    space = grid_of(design_from(source), vary)
    with progress.bar("computing designs", space.size) as step:
        how = {"title": Path(source).stem, "overwrite": overwrite, "progress": step}
        written = write_static(space, folder, unit=unit, **how)
    gaps = f", {counted(written.gaps, 'gap')}" if written.gaps else ""
    console.line(str(written.page))
    console.line(f"{counted(written.designs, 'design')}{gaps}, {written.size / 1e6:.1f} MB")


def begun(source: str, *, fresh: bool) -> "tuple[Start, KeptWork]":
    """What is shown first, and the work that is kept; a saved state is shown as it is."""
    from softreach.studio.start import start_on_cloud, start_on_design, start_on_state, work_on

    if source.lower().endswith(".json"):
        refuse("on a saved state, which is always shown as it is", fresh=fresh)
        start = start_on_state(source)
        return start, work_on(start.state.design, goes_on=False)
    start = start_on_cloud(source) if is_stored(source) else start_on_design(design_from(source))
    return start, work_on(start.state.design, goes_on=not fresh)
