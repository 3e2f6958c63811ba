"""The console: results on standard output; errors, warnings and progress on standard error."""

from __future__ import annotations

import json
import logging
import os
import re
import shutil
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from io import TextIOWrapper
from typing import TYPE_CHECKING, Any

import softreach as sr
from softreach.cli.values import Rows, for_machines, for_people, plain, shown
from softreach.support import progress
from softreach.support.errors import NotWritten, SoftreachWarning
from softreach.support.quantity import columns
from softreach.support.units import METER, LengthUnit

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console as RichConsole

_NARROWEST = 60  # columns; the tables of a help text lose words below, and lines that wrap do not


_COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
"""Characters that a terminal obeys: of names and paths that others gave."""


def _printable(text: object) -> str:
    return _COMMANDS.sub(lambda match: ascii(match[0])[1:-1], str(text))


class Console:
    """Prints for all commands.

    Attributes:
        quiet: Results and errors only.
        verbose: Also what is compiled, and where an error comes from.
    """

    quiet = False
    verbose = False

    def set(self, *, quiet: bool = False, verbose: bool = False) -> None:
        """Set how much is printed."""
        self.quiet = progress.hidden = quiet
        self.verbose = verbose

    def line(self, text: object) -> None:
        """A result in words."""
        sys.stdout.write(f"{_printable(text)}\n")

    def json(self, value: Any, indent: int | None = None) -> None:
        """A result for machines; null where there is no number."""
        self.line(json.dumps(plain(value), indent=indent, allow_nan=False))

    def rows(
        self, title: str, rows: Rows, as_json: bool, arm: sr.Manipulator | None = None
    ) -> None:
        """Named values with their units, one below the other.

        Args:
            title: Heading for people.
            rows: Name -> (value, unit) in SI units; JSON keys are the names with their units.
            as_json: Print JSON.
            arm: The design whose unit people see, and whose length is the unit L for machines.
        """
        if as_json:
            self.json(for_machines(rows, None if arm is None else arm.length))
            return
        self.line(title)
        unit = METER if arm is None else arm.length_unit
        for line in columns([*for_people(rows, unit)]):
            self.line(f"  {line}")

    def table(self, records: Sequence[Mapping[str, Any]], as_json: bool) -> None:
        """Records with the same keys, one to a line below a heading."""
        if as_json:
            self.json(records)
            return
        for line in columns([[*records[0]], *([*map(shown, one.values())] for one in records)]):
            self.line(line)

    def note(self, text: str) -> None:
        """A remark beside the results."""
        if not self.quiet:
            self.error(text)

    def written(self, path: Path, unit: LengthUnit) -> None:
        """Unit in which a table or a mesh was written."""
        self.note(f"{path}: lengths in {unit.name}")

    def error(self, text: str) -> None:
        """A line on standard error."""
        with suppress(OSError, ValueError):  # it was closed
            sys.stderr.write(f"{_printable(text)}\n")

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Print warnings and compilations during a block, with letters that can be printed."""
        compilations, log = _Compilations(), logging.getLogger("softreach")
        level = log.level
        log.addHandler(compilations)
        log.setLevel(logging.INFO)
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):
                stream.reconfigure(errors="backslashreplace")
        try:
            with warnings.catch_warnings():
                warnings.showwarning = _show_warning
                yield
        finally:
            self.set()
            log.removeHandler(compilations)
            log.setLevel(level)

    def flush(self) -> None:
        """Write what was printed, so that a full disk is found before the end.

        Raises:
            NotWritten: It cannot be written.
            BrokenPipeError: Whoever read it has gone.
        """
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            self.discard()
            reason = error.strerror or str(error)
            raise NotWritten("standard output", error.errno or 0, reason) from None

    def discard(self) -> None:
        """Drop output that cannot be written; Python would print an error."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, sys.stdout.fileno())
            os.close(nowhere)


console = Console()


class HelpConsole:
    """The console that help is laid out on, made when it is needed as Rich takes its time."""

    def __getattr__(self, name: str) -> Any:
        return getattr(_rich_console(), name)


def _rich_console() -> RichConsole:
    from rich.console import Console as RichConsole

    class StrictConsole(RichConsole):
        def on_broken_pipe(self) -> None:
            raise BrokenPipeError

    return StrictConsole(width=max(_NARROWEST, shutil.get_terminal_size().columns))


class _Compilations(logging.Handler):
    """Prints that kernels are compiled, as a first run may seem to hang."""

    told = False

    def emit(self, record: logging.LogRecord) -> None:
        if console.verbose:
            console.note(f"softreach: {record.getMessage()}")
        elif not self.told:
            self.told = True
            console.note("softreach: compiling kernels (first run only, then cached on disk)")


def _show_warning(message: Warning | str, category: type[Warning], *_: object) -> None:
    if issubclass(category, SoftreachWarning):
        console.note(f"warning: {message}")
