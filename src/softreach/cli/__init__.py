"""The command line: parse, call, print; no logic of its own."""

from __future__ import annotations

import os
import sys

from softreach.cli.signals import end_on_signals

__all__ = ["main"]


def main() -> None:
    """Run the command line and exit; a signal ends it at any time."""
    end_on_signals()  # before anything large is imported
    from softreach.cli.app import run
    from softreach.cli.terminal import open_missing_streams

    open_missing_streams()
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files, whatever windows there are
    sys.exit(run(sys.argv[1:]))
