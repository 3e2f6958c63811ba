"""The console: values as people and machines read them, on standard output.

Errors, warnings and progress are printed on standard error.
"""

import json
import logging
import math
import os
import re
import shutil
import sys
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from enum import Enum
from io import TextIOWrapper
from pathlib import Path
from typing import Any

import softreach as sr
from softreach.support import progress
from softreach.support.errors import NotWritten, SoftreachWarning
from softreach.support.lazy import Dataset
from softreach.support.quantity import columns
from softreach.support.units import METER, POWERS, LengthUnit, Rows, lines_of, shown, to_degrees

_READ_AS = {"m2": "m²", "m3": "m³", "1": ""}
_PLAIN = str.maketrans({"³": "3", "²": "2", "/": "_per_", " ": "_", "(": "", ")": ""})
_NARROWEST = 60  # columns; the tables of a help text lose words below, and lines that wrap do not
# characters that a terminal obeys: of names and paths that others gave
_COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]")


def _printable(text: object) -> str:
    return _COMMANDS.sub(lambda match: ascii(match[0])[1:-1], str(text))


class Console:
    """Prints for all commands."""

    quiet = False  # Results and errors only
    verbose = False  # Also what is compiled, and where an error comes from

    def set(self, *, quiet: bool = False, verbose: bool = False) -> None:
        """Set how much is printed."""
        self.quiet = progress.hidden = quiet
        self.verbose = verbose

    def line(self, text: object) -> None:
        """A result in words."""
        sys.stdout.write(f"{_printable(text)}\n")

    def json(self, value: Any) -> None:
        """A result for machines; null where there is no number."""
        self.line(json.dumps(plain(value), allow_nan=False))

    def rows(
        self,
        title: str,
        rows: Rows,
        as_json: bool,
        arm: "sr.Manipulator | None" = None,
        unit: LengthUnit = METER,
    ) -> None:
        """Named values in SI units below a title; in JSON, names with their units are the keys.

        People see the unit of the arm, or else `unit`, and machines values in its length L too.
        """
        if as_json:
            self.json(for_machines(rows, None if arm is None else arm.length))
            return
        self.line(title)
        unit = unit if arm is None else arm.length_unit
        for line in lines_of(rows, unit):
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
        """Write what was printed, so that a full disk is found before the end."""
        try:
            sys.stdout.flush()
        except BrokenPipeError:
            raise
        except OSError as error:
            self.discard()
            why = error.errno or 0, error.strerror or str(error)
            raise NotWritten("standard output", *why) from None

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
        from rich.console import Console as RichConsole

        class StrictConsole(RichConsole):
            def on_broken_pipe(self) -> None:
                raise BrokenPipeError

        width = max(_NARROWEST, shutil.get_terminal_size().columns)
        return getattr(StrictConsole(width=width), name)


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


def as_read(values: Any, unit: str) -> tuple[Any, str]:
    """Numbers and their unit as people read them: degrees for radians, m³ for m3."""
    if unit == "rad":
        return to_degrees(values), "deg"
    return plain(values), _READ_AS.get(unit, unit)


def rows_of(dataset: Dataset) -> Rows:
    """The numbers of a result, by the names and units that its dataset has."""
    rows: Rows = {}
    for name, column in dataset.variables.items():
        if column.dtype.kind in "fi":
            unit = str(column.attrs.get("units", "1"))
            rows[str(name).replace("_", " ")] = as_read(column.values, unit)
    return rows | ({"route": (dataset.attrs["route"], "")} if "route" in dataset.attrs else {})


def fields_of(values: Mapping[str, Any], *lengths: str) -> Rows:
    """The fields of a result as rows; those that are lengths [m] by name."""
    return {name: (value, "m" if name in lengths else "") for name, value in values.items()}


def for_machines(rows: Rows, length: float | None = None) -> dict[str, Any]:
    """The rows by names with their units; lengths, areas and volumes in SI units and in L."""
    from softreach.arm.parameters import written_name

    fields: dict[str, Any] = {}
    for name, (value, unit) in rows.items():
        values = {unit: value}
        if length is not None and (power := POWERS.get(unit)):
            relative = LengthUnit("L", length)
            values[relative.symbol(power)] = relative.of(plain(value), power)
        for own, number in values.items():
            key = written_name(name.translate(_PLAIN), own or "1").translate(_PLAIN)
            fields[key] = plain(number)
    return fields


def plain(value: Any) -> Any:
    """Arrays as lists, members of an enumeration by name, and None for what JSON does not have."""
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return plain(value.tolist()) if hasattr(value, "tolist") else value
