"""The `softreach` command and what its exit codes mean.

0 done, 1 a requirement is missed and 3 one is undecided (`check`, `search`), 2 wrong input or
nowhere to write, 141 standard output was closed, 128 + signal.
"""

import traceback
from contextlib import suppress
from typing import Annotated, Any, cast

import cyclopts
from cyclopts import App, CycloptsError, Group, MissingArgumentError, Parameter

import softreach as sr
from softreach.cli.console import HelpConsole, console
from softreach.support.errors import NotPossible, NotWritten, SoftreachError
from softreach.support.plugins import importing

_GROUPS = (
    ("Start", "demo:demo demo:example"),
    ("Design", "convert:design search:check search:search studio:studio"),
    (
        "Reach",
        "reach:reach reach:cloud reach:volume reach:payload reach:gradient "
        "reach:show convert:export convert:import",
    ),
    ("Places", "places:solve places:track places:plan places:equilibria"),
    ("Families", "atlas:atlas"),
    ("Bench", "bench:plan-poses bench:calibrate"),
    ("Reference", "demo:list"),
    ("About", "demo:paper demo:doctor demo:warmup"),
)
"""Titles of the help and of the documentation; commands behind the modules that they are in."""
MODULES = {x.split(":")[1]: x.split(":")[0] for _, words in _GROUPS for x in words.split()}
_FUNCTIONS = {"import": "import_file", "list": "listing"}  # where Python needs the name itself


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


_OPTION = Parameter(negative=(), show_default=lambda x: None if x is None or x is False else str(x))
app = App(
    name="softreach",
    help="""Where a soft slender robot can go: from a design to its cloud and volumes.

A DESIGN is a TOML file (lengths in m, angles in degrees) or the name of a
built-in design, such as minimal_trunk; softreach list designs has them all.
Start with

    softreach reach minimal_trunk
""",
    version=lambda: sr.__version__,
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
    help_format="plaintext",
    help_formatter=_Flowing(),
    console=cast(Any, HelpConsole()),
    default_parameter=_OPTION,
)
_groups = [Group(_title, sort_key=_rank - 9) for _rank, (_title, _) in enumerate(_GROUPS)]
for _group, (_, _words) in zip(_groups, _GROUPS, strict=True):
    for _place, _word in enumerate(_words.split()):
        _module, _name = _word.split(":")
        _where = f"softreach.cli.{_module}:{_FUNCTIONS.get(_name, _name.replace('-', '_'))}"
        app.command(_where, name=_name, group=_group, sort_key=_place)
app.meta.suppress_keyboard_interrupt = False
app.register_install_completion_command(add_to_startup=False)
for _flag in ("--help", "--version", "--install-completion"):
    app[_flag].group = _groups[-1]


def _always(help: str, *names: str) -> Parameter:
    group = Group("Options of every command", sort_key=9)
    return Parameter(name=names, group=group, show_default=False, help=help)


_QUIET = _always("Print results and errors only: no warnings, no progress.", "--quiet", "-q")
_VERBOSE = _always("Print more: what is compiled, and where errors come from.", "--verbose", "-v")
_MODULES = "Module, or .py file, with actuators, profiles or metrics of your own, which is run. "
_IMPORT = _always(f"{_MODULES}May be repeated.", "--import")


@app.meta.default
def _start(
    *words: Annotated[str, Parameter(show=False, allow_leading_hyphen=True)],
    quiet: Annotated[bool, _QUIET] = False,
    verbose: Annotated[bool, _VERBOSE] = False,
    imports: Annotated[list[str] | None, _IMPORT] = None,
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
            if not MODULES.keys() & {*arguments}:
                _ = [app[name] for name in MODULES]  # imports them: help lists their docstrings
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
    if isinstance(error, CycloptsError) and isinstance(error.__cause__, SoftreachError):
        error = error.__cause__
    if isinstance(error, MissingArgumentError | cyclopts.UnusedCliTokensError):
        command = " ".join(error.command_chain or ["softreach"])
        if isinstance(error, cyclopts.UnusedCliTokensError):
            return f"{command} takes no {', '.join(error.unused_tokens or ())}"
        if error.keyword is None:
            return f"{command} needs {error.argument.name if error.argument else 'more words'}"
        dash = f"if it begins with a dash: {error.keyword}=VALUE"
        return f"{command} {error.keyword} needs a value; {dash}"
    if isinstance(error, MemoryError):
        return "there is not enough memory for this; ask for fewer samples or less accuracy"
    return str(error) or type(error).__name__
