"""The command line: parse, call, print; no logic of its own."""

from __future__ import annotations

import sys

from softreach.cli.signals import end_on_signals

__all__ = ["main"]


def main() -> None:
    """Run the command line and exit; a signal ends it at any time."""
    end_on_signals()  # before anything large is imported
    from softreach.cli.app import run

    sys.exit(run(sys.argv[1:]))
