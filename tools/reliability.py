"""Runs the tests of abuse and writes their numbers into docs/reliability.md.

To run it: `python -m tools.reliability`, with options of pytest if need be.

A promise is the first line of a file of `tests/abuse`; its cases are the tests of that file.
"""

from __future__ import annotations

import ast
import platform
import sys
from collections import defaultdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import pytest

__all__ = ["CaseRecord", "promise_of", "table"]

ROOT = Path(__file__).parent.parent
CASES = ROOT / "tests" / "abuse"
PAGE = ROOT / "docs" / "reliability.md"
MARK = "<!-- numbers of the last run, written by `python -m tools.reliability` -->\n"


class CaseRecord:
    """A plugin of pytest that keeps how every case ended and how long it took [s], by file."""

    def __init__(self) -> None:
        """Nothing run yet."""
        self.seconds: dict[str, list[float]] = defaultdict(list)
        self.failed: dict[str, int] = defaultdict(int)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count a case when it has run, or failed before it could."""
        if report.when == "call" or report.failed:
            file = Path(report.location[0]).name
            self.seconds[file].append(report.duration)
            self.failed[file] += report.failed


def promise_of(file: Path) -> str:
    """The first line of the file's docstring."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    assert text, f"{file.name} says nothing of what it promises"
    return text.splitlines()[0].rstrip(".")


def table(record: CaseRecord, folder: Path = CASES) -> str:
    """Promises, cases and times as a table of the documentation."""
    header = "| promise | cases | failed | slowest [s] | tested in |\n|---|--:|--:|--:|---|\n"
    rows = [
        f"| {promise_of(folder / file)} | {len(seconds):,} | {record.failed[file]} "
        f"| {max(seconds):.1f} | `tests/abuse/{file}` |\n"
        for file, seconds in sorted(record.seconds.items())
    ]
    return header + "".join(rows)


def main() -> int:
    """Run the cases and write the page; returns the exit code of the tests."""
    record = CaseRecord()
    code = pytest.main(["-q", str(CASES), *sys.argv[1:]], plugins=[record])
    cases, failed = sum(map(len, record.seconds.values())), sum(record.failed.values())
    if not cases:  # a typing error in the options must not empty the page
        return int(code)
    said = (
        f"\n{datetime.now(UTC).date()}, softreach {version('softreach')}, Python "
        f"{platform.python_version()}: {cases:,} cases, {failed} failed.\n\n"
    )
    text = PAGE.read_text(encoding="utf-8")
    PAGE.write_text(text.partition(MARK)[0] + MARK + said + table(record), encoding="utf-8")
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
