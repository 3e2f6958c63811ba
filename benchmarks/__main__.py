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

from softreach.support import parallel

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
PARTS = (
    "waits",
    "cold",
    "kernels",
    "arms",
    "geometry",
    "workspace",
    "loads",
    "calibration",
    "search",
    "inverse",
    "redundancy",
    "atlas",
    "studio",
    "pictures",
    "earlier",
)

HEADER = """# Benchmarks

Written by `make bench`; do not edit. {date}, softreach {softreach}, Python {python}, NumPy {numpy},
Numba {numba}, {threads} threads on {machine}. The machine was shared with other work: compare
within a table, where all rows come from one run, and trust CPU time before wall time.

"""


MARK = "<!-- {} -->\n"


def main() -> None:
    """Run the parts named on the command line, or all; other parts of the page stay."""
    header = HEADER.format(
        date=datetime.now(UTC).date(),
        python=platform.python_version(),
        threads=parallel.thread_count(),
        machine=platform.machine(),
        **{name: version(name) for name in ("softreach", "numpy", "numba")},
    )
    sections = _sections()
    for name in sys.argv[1:] or PARTS:
        captured = io.StringIO()
        with redirect_stdout(captured):
            importlib.import_module(f"benchmarks.bench_{name}").main()
        print(captured.getvalue(), flush=True)
        sections[name] = captured.getvalue().strip() + "\n\n"
        known = [part for part in PARTS if part in sections]
        body = "".join(MARK.format(part) + sections[part] for part in known)
        PAGE.write_text(header + body, encoding="utf-8")
    print(f"written to {PAGE}")


def _sections() -> dict[str, str]:
    """What the page holds of each part."""
    text = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    starts = {part: text.find(MARK.format(part)) for part in PARTS}
    found = sorted((at, part) for part, at in starts.items() if at >= 0)
    ends = [at for at, _ in found[1:]] + [len(text)]
    return {
        part: text[at + len(MARK.format(part)) : end]
        for (at, part), end in zip(found, ends, strict=True)
    }


if __name__ == "__main__":
    main()
