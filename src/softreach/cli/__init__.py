"""The command line: parse, call, print; no logic of its own."""

import os
import sys

from softreach.support.interruption import run_stoppable


def main() -> None:
    """Run the command line and exit; a signal ends it at any time."""
    sys.exit(run_stoppable(_run))


def _run() -> int:
    from softreach.cli.app import run  # large

    for name in ("stdin", "stdout", "stderr"):  # else the next file opened would take its place
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files
    return run(sys.argv[1:])
