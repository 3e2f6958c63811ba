"""The `softreach` command and what its exit codes mean.

0 done, 1 a requirement is missed (`check`, `search`), 2 wrong input or nowhere to write, 141
standard output was closed, 128 + signal.
"""

from __future__ import annotations

import traceback
from contextlib import suppress
from typing import Annotated, Any, cast

from cyclopts import App, CycloptsError, Group, Parameter

import softreach
from softreach.cli.console import HelpConsole, console
from softreach.support.errors import NotPossible, NotWritten, SoftreachError, check_date
from softreach.support.plugins import importing

_MORE = Group("More", sort_key=-1)
_COMMANDS = (
    (Group("Design", sort_key=-6), ("design", "check", "search", "list", "studio")),
    (Group("Bench", sort_key=-5.5), ("plan-poses", "calibrate")),
    (Group("Reach", sort_key=-5), ("reach", "cloud", "volume", "payload", "gradient")),
    (Group("Places", sort_key=-4), ("solve", "track", "equilibria")),
    (Group("Output", sort_key=-3), ("show", "export", "import")),
    (Group("Families", sort_key=-2), ("atlas",)),
    (_MORE, ("demo", "example", "doctor", "paper", "warmup")),
)
_OBJECTS = {
    "import": "import_file",
    "list": "listing",
    "plan-poses": "plan_poses",
}  # where Python needs the name itself


def _shown_default(value: object) -> Any:
    """A default worth showing: not that nothing is given, and not that a flag is not set."""
    return None if value is None or value is False else str(value)


class _Flowing:
    """Lays out help whose lines docstrings break; loaded when it is needed, as Rich takes time."""

    def __call__(self, console: Any, options: Any, panel: Any) -> None:
        for entry in panel.entries:
            text = getattr(entry.description, "primary_renderable", None)
            if text is not None:
                text.plain = text.plain.replace("\n", " ")
        self.__getattr__("__call__")(console, options, panel)

    def __getattr__(self, name: str) -> Any:
        from cyclopts.help import DefaultFormatter

        return getattr(DefaultFormatter(), name)


app = App(
    name="softreach",
    help="""Where a soft slender robot can go: from a design to its cloud and volumes.

A DESIGN is a TOML file (lengths in m, angles in degrees) or the name of a
built-in design, such as minimal_trunk; softreach list designs has them all.
Start with

    softreach reach minimal_trunk
""",
    version=lambda: softreach.__version__,
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
    help_format="plaintext",
    help_formatter=_Flowing(),
    console=cast(Any, HelpConsole()),
    default_parameter=Parameter(negative=(), show_default=_shown_default),
)
_NAMES = {name for _, names in _COMMANDS for name in names}
for _group, _names in _COMMANDS:
    for _place, _name in enumerate(_names):
        _object = _OBJECTS.get(_name, _name)
        app.command(f"softreach.cli.{_object}:{_object}", name=_name, group=_group, sort_key=_place)
for _flag in ("--help", "--version"):
    app[_flag].group = _MORE
app.meta.suppress_keyboard_interrupt = False
app.register_install_completion_command(add_to_startup=False)
app["--install-completion"].group = _MORE

_ALWAYS = Group("Options of every command", sort_key=9)


@app.meta.default
def _start(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    quiet: Annotated[
        bool,
        Parameter(
            name=("--quiet", "-q"),
            group=_ALWAYS,
            show_default=False,
            help="Print results and errors only: no warnings, no progress.",
        ),
    ] = False,
    verbose: Annotated[
        bool,
        Parameter(
            name=("--verbose", "-v"),
            group=_ALWAYS,
            show_default=False,
            help="Print more: what is compiled, and where an error comes from.",
        ),
    ] = False,
    imports: Annotated[
        list[str] | None,
        Parameter(
            name="--import",
            group=_ALWAYS,
            help="Module, or .py file, with actuators, profiles or metrics of your own, which is "
            "run. May be repeated.",
        ),
    ] = None,
) -> int | None:
    if quiet and verbose:
        raise NotPossible("choose --quiet or --verbose")
    console.set(quiet=quiet, verbose=verbose)
    with importing(imports or ()):
        return app(words, result_action="return_value")


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code; wrong input costs one line, no traceback."""
    with console.listening():
        try:
            check_date()
            if not _NAMES & {*arguments}:
                _ = [app[name] for name in _NAMES]  # imports them: help lists their docstrings
            code = app.meta(arguments, result_action="return_value")
            console.flush()
        except BrokenPipeError:
            console.discard()
            return 141
        except (CycloptsError, SoftreachError, OSError, MemoryError) as error:
            with suppress(BrokenPipeError, NotWritten):
                console.flush()
            if console.verbose:
                console.error(traceback.format_exc().rstrip())
            console.error(f"error: {_message(error)}")
            return 2
    return code or 0


def _message(error: Exception) -> str:
    """The error in one line; of an option that cannot be read, in our words."""
    if isinstance(error, CycloptsError) and isinstance(error.__cause__, SoftreachError):
        error = error.__cause__
    if isinstance(error, MemoryError):
        return "there is not enough memory for this; ask for fewer samples or less accuracy"
    return str(error) or type(error).__name__
