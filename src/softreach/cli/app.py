"""The `softreach` command and what its exit codes mean.

0 done, 2 wrong input or nowhere to write, 141 nobody reads the output any more, 128 + signal.
"""

from __future__ import annotations

import sys
import warnings
from contextlib import suppress
from importlib.metadata import version

from cyclopts import App, CycloptsError

from softreach.cli.first_run import compilation_announced
from softreach.cli.signals import INTERRUPTED
from softreach.cli.terminal import (
    discard_output,
    flush_output,
    readable_width,
    spelling_out,
)
from softreach.support.errors import NotWritten, SoftreachError, SoftreachWarning

__all__ = ["app", "run"]

app = App(
    name="softreach",
    help="""Where a soft slender robot can go: from a design to its cloud and volumes.

A DESIGN is a TOML file (lengths in m, angles in degrees) or the name of a
built-in design: minimal_trunk, redundant_trunk, lce_arm, filament,
elephant_trunk, three_tendon_robot, helical_tendon_robot, three_chamber_arm.
Start with

    softreach demo --out out
""",
    version=lambda: version("softreach"),
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
    help_format="plaintext",
)

# Commands are imported when run; their help stands here, so that `softreach --help` needs none of
# them.
_COMMANDS = {
    "demo": (
        "The paper's design, start to end: cloud, volumes, hull and picture.",
        "softreach demo --out out",
    ),
    "design": (
        "What follows from a design: angles, radii, ranges, warnings.",
        "softreach design minimal_trunk --taper-deg 3",
    ),
    "cloud": (
        "Compute a reachability cloud and store it.",
        "softreach cloud minimal_trunk --n 400000 --out trunk.zarr",
    ),
    "volume": (
        "Volume, convex volume and unreachability of a cloud.",
        "softreach volume trunk.zarr --alpha 0.05L --hull hull.ply",
    ),
    "reach": (
        "The exact reachable set: volume, multiplicity, folds, boundary.",
        "softreach reach minimal_trunk --surface reach.stl --figure reach.png",
    ),
    "equilibria": (
        "Every equilibrium of a loaded arm at given activations, stable or not.",
        "softreach equilibria arm.toml --activation=-1,0,-0.5 --figure equilibria.png",
    ),
    "payload": (
        "How much of its reach a payload costs, and the largest that keeps a share of it.",
        "softreach payload lce_arm --gravity up --share 0.8",
    ),
    "gradient": (
        "How the reachable volume changes with parameters of the design.",
        "softreach gradient lce_arm taper upper --set lower=-3 --set upper=-1",
    ),
    "solve": (
        "Every activation that puts the tip at a target.",
        "softreach solve minimal_trunk --target 0.2,0.1,0.6",
    ),
    "track": (
        "Activations that follow a path of tip positions.",
        "softreach track minimal_trunk path.csv --out activations.csv",
    ),
    "atlas": (
        "Clouds and volumes of whole families of designs.",
        "softreach atlas build a.zarr --vary revolution_deg=0:108:4 --vary taper_deg=0:3:4",
    ),
    "paper": (
        "The paper's figures and numbers, recomputed and set beside what it says.",
        "softreach paper --out paper --quick",
    ),
    "studio": (
        "The design desk in the browser: move sliders, see what the design can reach.",
        "softreach studio minimal_trunk --no-open",
    ),
    "show": (
        "Draw a cloud and its arm.",
        "softreach show trunk.zarr --activation=-1,0,-0.5 --out trunk.pdf",
    ),
    "export": (
        "Write a cloud or an arm for other programs.",
        "softreach export trunk.zarr trunk.parquet",
    ),
    "import": (
        "Read a design or a cloud of ActiveFilaments.jl.",
        "softreach import filament.jl filament.toml",
    ),
    "warmup": (
        "Compile all kernels now, so that no later command has to.",
        "softreach warmup --loads",
    ),
}
_KEYWORDS = {"import": "import_file"}  # commands that no Python function can be called
for _place, (_name, (_summary, _example)) in enumerate(_COMMANDS.items()):
    _function = _KEYWORDS.get(_name, _name)
    app.command(
        f"softreach.cli.{_function}:{_function}",
        name=_name,
        help=f"{_summary}\n\nExample: {_example}",
        sort_key=_place,
    )


def run(arguments: list[str]) -> int:
    """Run the command line and return its exit code; wrong input costs one line, no traceback."""
    with warnings.catch_warnings(), compilation_announced(), spelling_out(), readable_width():
        warnings.showwarning = _show_warning
        try:
            app(arguments, result_action="return_value")
            flush_output()
        except (BrokenPipeError, SystemExit) as error:
            if isinstance(error, SystemExit) and not isinstance(error.__context__, BrokenPipeError):
                raise  # by anyone but the printer of help
            discard_output()
            return 141
        except (CycloptsError, SoftreachError, OSError, MemoryError) as error:
            with suppress(BrokenPipeError, NotWritten):
                flush_output()
            return _failed(_message(error))
        except KeyboardInterrupt:
            sys.stderr.write(f"{INTERRUPTED}\n")
            return 130
    return 0


def _message(error: Exception) -> str:
    """What went wrong; of an option that cannot be read, in our words."""
    if isinstance(error, CycloptsError) and isinstance(error.__cause__, SoftreachError):
        error = error.__cause__
    if isinstance(error, MemoryError):
        return "there is not enough memory for this; ask for fewer samples or less accuracy"
    return str(error) or type(error).__name__


def _failed(message: str) -> int:
    with suppress(OSError, ValueError):  # nobody reads it
        sys.stderr.write(f"error: {message}\n")
    return 2


def _show_warning(message: Warning | str, category: type[Warning], *_: object) -> None:
    if issubclass(category, SoftreachWarning):
        with suppress(OSError, ValueError):
            sys.stderr.write(f"warning: {message}\n")
