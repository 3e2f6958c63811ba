"""Run every benchmark and write the tables that users read into the documentation.

What a part prints after `table.FOR_DEVELOPERS` is for the terminal alone.
"""

from __future__ import annotations

import importlib
import io
import platform
import sys
from contextlib import redirect_stdout
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from benchmarks.table import FOR_DEVELOPERS
from softreach.support import parallel

PAGE = Path(__file__).parent.parent / "docs" / "benchmarks.md"
PARTS = (
    "waits",
    "kernels",
    "geometry",
    "workspace",
    "loads",
    "search",
    "inverse",
    "clearance",
    "atlas",
    "studio",
)
OTHERS = "calibration", "cold", "arms", "redundancy", "pictures", "earlier"
"""Parts that are printed; calibration writes its table into the page of validation."""

HEADER = """# Benchmarks

Written by `make bench`; do not edit. {date}, softreach {softreach}, Python {python}, NumPy {numpy},
Numba {numba}, {threads} threads on {machine}. Other work shared the machine: compare rows of one
table, and trust CPU time before wall time. `python -m benchmarks PART` also prints tables for
developers. [Validation](validation.md) has errors, [Clouds](clouds.md#on-a-gpu) the GPU.

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
    for name in sys.argv[1:] or PARTS + OTHERS:
        captured = io.StringIO()
        with redirect_stdout(captured):
            importlib.import_module(f"benchmarks.bench_{name}").main()
        print(captured.getvalue(), flush=True)
        sections[name] = captured.getvalue().partition(FOR_DEVELOPERS)[0].strip() + "\n\n"
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
