"""The whole paper, part by part, and its report; what is done stays done, so a rerun continues."""

import hashlib
import json
import os
import platform
import tomllib
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softreach.paper.notebook import FULL, QUICK, Finding, Notebook, Numbers, Settings, Verdict
from softreach.paper.sections import model, redundancy, sweep
from softreach.plot.style import pyplot
from softreach.support.arguments import as_path
from softreach.support.errors import InvalidInput, check_installed
from softreach.support.files.atomic import MARK, check_place
from softreach.support.files.text import write_text
from softreach.support.report import Report, Section

SECTIONS: dict[str, Any] = {
    "model": model,
    "misprints": model,
    "redundancy": redundancy,
    "volume": sweep,
    "sweep": sweep,
    "uniqueness": redundancy,
}
"""Name of a part -> module whose function of that name computes its numbers; short ones first."""


class Claim(NamedTuple):
    """A statement of the paper and its check."""

    part: str  # The part of the report that computes the numbers
    judge: str  # Function of this part that judges them
    section: str  # Its section of the paper
    says: str  # The statement, in the paper's words or nearly so
    how: str  # How it is checked
    full: bool = False  # True if only the full sizes test it

    def check(self, numbers: Mapping[str, Any]) -> Finding:
        """Finding from the numbers of its part."""
        known = {k: np.asarray(x) if isinstance(x, list) else x for k, x in numbers.items()}
        return getattr(SECTIONS[self.part], self.judge)(Numbers(**known))


_CLAIMS = tomllib.loads(Path(__file__).with_name("claims.toml").read_text(encoding="utf-8"))
_EACH = ((name, section, row) for section, rows in _CLAIMS.items() for name, row in rows.items())
CLAIMS = tuple(Claim(*name.split("."), section=section, **row) for name, section, row in _EACH)
"""Every statement that is checked, in the paper's order."""


def reproduce_paper(
    out: str | PathLike[str],
    *,
    quick: bool = False,
    overwrite: bool = False,
    say: Callable[[str], object] = lambda line: None,
) -> Path:
    """Recompute every figure and number of the paper and set them beside what it says.

    Interrupted, it continues where it stopped when it is called again with the same arguments.

    Args:
        out: Folder for figures (PNG and PDF), numbers (JSON), the atlas and the report.
        quick: Small clouds, in under a minute, in a folder of their own inside `out`.
        overwrite: Whether an older report, or figures that are none of this, may be replaced.
        say: Called with a line about each part.

    Returns:
        The report: one HTML file that needs nothing beside it.

    Raises:
        MissingExtra: matplotlib, scikit-image or Jinja2 is not installed.
        InvalidInput: Something is where the report or its figures go.
        NotWritten: The folder cannot be written to.
    """
    check_installed("matplotlib", "skimage", "jinja2")  # now, not after a quarter of an hour
    pyplot()
    settings = QUICK if quick else FULL
    folder = Path(as_path("out", out)) / ("quick" if quick else "")
    path, pages = folder / "report.html", folder / "figures"
    check_place(path, overwrite=overwrite, name="out")
    code = b"".join(p.read_bytes() for p in sorted(Path(__file__).parents[1].rglob("*.py")))
    source = hashlib.sha256(code).hexdigest()  # what other code computed is computed again
    key = {**asdict(settings), "softreach": version("softreach"), "source": source}
    begun = pages / "begun.json"  # says that the figures are ours: a rerun replaces its own
    others = [path for path in pages.glob("*") if not path.name.startswith(MARK)]
    if others and not begun.exists() and not overwrite:
        hint = "choose another folder, or pass --overwrite (in Python overwrite=True)"
        raise InvalidInput("out", f"{pages}", "a folder without other figures", hint)
    write_text(begun, json.dumps(key, indent=1), overwrite=True)
    books: dict[str, Notebook] = {}
    for number, (name, section) in enumerate(SECTIONS.items(), 1):
        say(f"[{number}/{len(SECTIONS)}] {name}")
        found = Notebook.opened(pages, name, key)
        books[name] = found or Notebook(pages, name, key).fill(getattr(section, name), settings)
        say(f"      {books[name].seconds:.1f} s")
    _report(books, settings, quick).save(path, overwrite=overwrite)
    return path


def _report(books: Mapping[str, Notebook], settings: Settings, quick: bool) -> Report:
    rows = list[tuple[str, ...]]()
    for claim in CLAIMS:
        text, verdict = claim.check(books[claim.part].numbers)
        verdict = Verdict.UNTESTED if quick and claim.full else verdict
        rows.append((claim.section, claim.says, text, claim.how, verdict))
    counts = Counter(row[-1] for row in rows)
    paper = "Kaczmarski, Moulton, Goriely, Kuhl: Minimal activation with maximal reach, "
    paper += "Extreme Mechanics Letters 71 (2024) 102207, arXiv 2403.18841"
    by = f"softreach {version('softreach')} computed every number and every verdict; the paper's "
    by += "statements and how each is checked were written by hand"
    machine = f"{os.cpu_count()} cores, {platform.platform()}"
    seconds = sum(book.seconds for book in books.values())
    when = f"Computed in {seconds:.0f} s on {machine}, and written on {datetime.now(UTC):%Y-%m-%d}"
    facts = [paper, by, when]
    if quick:
        clouds = f"{settings.designs} × {settings.designs} clouds of {settings.samples:,} points"
        facts.append(f"A quick run with {clouds}: what needs more is not tested")
    head = ("Section", "The paper says", "softreach finds", "How", "Verdict")
    return Report(
        title="Minimal activation with maximal reach, recomputed",
        verdict=", ".join(f"{counts[each]} {each}" for each in Verdict if counts[each]),
        state="undecided" if counts[Verdict.DIFFERS] else "met",
        facts=facts,
        sections=[
            Section(title="The paper says, softreach finds", head=head, rows=rows),
            Section(title="Figures", figures=lambda: _figures(books)),
        ],
    )


def _figures(books: Mapping[str, Notebook]) -> Iterator[tuple[bytes, str]]:
    """PNG and caption: figures in the paper's order, our own after them."""
    pages = [(*page, book.folder) for book in books.values() for page in book.pictures]
    for label, name, caption, folder in sorted(pages, key=lambda page: page[0] or "9"):
        title = f"Figure {label}" if label else "Beyond the paper"
        yield (folder / f"{name}.png").read_bytes(), f"{title}. {caption}"
