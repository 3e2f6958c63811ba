"""Runs the tests of abuse and writes their numbers into docs/validation.md.

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
from benchmarks.table import VALIDATION, put_between_marks

__all__ = ["CaseRecord", "promise_of", "table"]

ROOT = Path(__file__).parent.parent
CASES = ROOT / "tests" / "abuse"


class CaseRecord:
    """A plugin of pytest that counts the cases of each file, and how many of them failed."""

    def __init__(self) -> None:
        """Nothing run yet."""
        self.cases: dict[str, int] = defaultdict(int)
        self.failed: dict[str, int] = defaultdict(int)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count a case when it has run, or failed before it could."""
        if report.when == "call" or report.failed:
            file = Path(report.location[0]).name
            self.cases[file] += 1
            self.failed[file] += report.failed


def promise_of(file: Path) -> str:
    """The first line of the file's docstring."""
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8")))
    assert text, f"{file.name} says nothing of what it promises"
    return text.splitlines()[0].rstrip(".")


def table(record: CaseRecord, folder: Path = CASES) -> str:
    """Promises and cases as a table of the documentation."""
    header = "| promise | cases | failed |\n|---|--:|--:|\n"
    rows = [
        f"| {promise_of(folder / file)} | {cases:,} | {record.failed[file]} |\n"
        for file, cases in sorted(record.cases.items())
    ]
    return header + "".join(rows)


def main() -> int:
    """Run the cases and write the page; returns the exit code of the tests."""
    record = CaseRecord()
    code = pytest.main(["-q", str(CASES), *sys.argv[1:]], plugins=[record])
    cases, failed = sum(record.cases.values()), sum(record.failed.values())
    if not cases:  # a typing error in the options must not empty the page
        return int(code)
    said = (
        f"{datetime.now(UTC).date()}, softreach {version('softreach')}, Python "
        f"{platform.python_version()}: {cases:,} cases, {failed} failed.\n\n"
    )
    put_between_marks(VALIDATION, "promises", said + table(record))
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
