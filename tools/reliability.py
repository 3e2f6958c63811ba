"""Runs the tests of abuse and writes their number into docs/validation.md.

To run it: `python -m tools.reliability`, with options of pytest if need be.
"""

from __future__ import annotations

import platform
import sys
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import pytest
from benchmarks.table import VALIDATION, put_between_marks

CASES = Path(__file__).parent.parent / "tests" / "abuse"


class CaseCount:
    """A plugin of pytest that counts cases, and how many of them failed."""

    def __init__(self) -> None:
        """Nothing run yet."""
        self.cases = self.failed = 0

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count a case when it has run, or failed before it could."""
        if report.when == "call" or report.failed:
            self.cases += 1
            self.failed += report.failed


def main() -> int:
    """Run the cases and write the page; returns the exit code of the tests."""
    count = CaseCount()
    code = pytest.main(["-q", str(CASES), *sys.argv[1:]], plugins=[count])
    if count.cases:  # a typing error in the options must not empty the page
        said = (
            f"{datetime.now(UTC).date()}, softreach {version('softreach')}, Python "
            f"{platform.python_version()}: {count.cases:,} cases, {count.failed} failed."
        )
        put_between_marks(VALIDATION, "cases of abuse", said)
    return int(code)


if __name__ == "__main__":
    sys.exit(main())
