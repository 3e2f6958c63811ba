"""Run every benchmark and write its tables into the documentation."""

from __future__ import annotations

import importlib
import io
import platform
import sys
from contextlib import redirect_stdout
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from softreach import parallel

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
PARTS = ("kernels", "geometry", "workspace", "inverse", "redundancy", "atlas", "studio")

HEADER = """# Benchmarks

Written by `make bench`; do not edit. {date}, softreach {softreach}, Python {python}, NumPy {numpy},
Numba {numba}, {threads} threads on {machine}. The machine was shared with other work: compare
within a table, where all rows come from one run, and trust CPU time before wall time.

"""


def main() -> None:
    """Run the parts named on the command line, or all, and write the page."""
    text = HEADER.format(
        date=datetime.now(UTC).date(),
        python=platform.python_version(),
        threads=parallel.thread_count(),
        machine=platform.machine(),
        **{name: version(name) for name in ("softreach", "numpy", "numba")},
    )
    for name in sys.argv[1:] or PARTS:
        captured = io.StringIO()
        with redirect_stdout(captured):
            importlib.import_module(f"benchmarks.bench_{name}").main()
        print(captured.getvalue(), flush=True)
        text += captured.getvalue() + "\n"
        PAGE.write_text(text, encoding="utf-8")
    print(f"written to {PAGE}")


if __name__ == "__main__":
    main()
