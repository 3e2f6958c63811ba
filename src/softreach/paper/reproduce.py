"""The whole paper, part by part, and its report; what is done stays done, so a rerun continues."""

from __future__ import annotations

import hashlib
import json
import os
import platform
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.resources import files
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

from softreach.paper.claims import CLAIMS, Verdict
from softreach.paper.notebook import FULL, QUICK, Notebook, Settings
from softreach.paper.sections.misprints import misprints
from softreach.paper.sections.model import model
from softreach.paper.sections.redundancy import redundancy
from softreach.paper.sections.sweep import sweep
from softreach.paper.sections.uniqueness import uniqueness
from softreach.paper.sections.volume import volume
from softreach.plot.style import pyplot
from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import MARK, check_place, writing
from softreach.support.files.formats import check_installed
from softreach.support.report import Report, Section

__all__ = ["PARTS", "reproduce_paper"]

PARTS: Mapping[str, Callable[[Settings, Notebook], None]] = {
    "model": model,
    "misprints": misprints,
    "redundancy": redundancy,
    "volume": volume,
    "sweep": sweep,
    "uniqueness": uniqueness,
}
"""Name -> what computes it, from the sizes and a notebook; short ones first."""

_PAPER = (
    "Kaczmarski, Moulton, Goriely, Kuhl: Minimal activation with maximal reach: Reachability "
    "clouds of bio-inspired slender manipulators, Extreme Mechanics Letters 71 (2024) 102207, "
    "arXiv 2403.18841"
)


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
    # What is missing is reported now, not after a quarter of an hour.
    check_installed(("matplotlib", "plot"), ("skimage", "surface"), ("jinja2", "report"))
    pyplot()
    settings = QUICK if quick else FULL
    folder = Path(out) / "quick" if quick else Path(out)
    path = folder / "report.html"
    check_place(path, overwrite=overwrite, name="out")
    key = {**asdict(settings), "softreach": version("softreach"), "source": _source()}
    _claim(folder / "figures", key, overwrite=overwrite)
    notebooks: dict[str, Notebook] = {}
    for number, name in enumerate(PARTS, 1):
        say(f"[{number}/{len(PARTS)}] {name}")
        notebooks[name] = _computed(name, settings, folder / "figures", key)
        say(f"      {notebooks[name].seconds:.1f} s")
    report_of(notebooks, settings, quick).save(path, overwrite=overwrite)
    return path


def _source() -> str:
    """A digest of the library's code: what other code computed is computed again."""
    root = files("softreach")
    assert isinstance(root, Path)
    texts = [path.read_bytes() for path in sorted(root.rglob("*.py"))]
    return hashlib.sha256(b"".join(texts)).hexdigest()


def _claim(pages: Path, key: Mapping[str, Any], *, overwrite: bool) -> None:
    """Write that the figures in a folder are ours: an interrupted call replaces its own."""
    begun = pages / "begun.json"
    with suppress(FileNotFoundError):
        found = [path for path in pages.iterdir() if not path.name.startswith(MARK)]
        if found and not begun.exists() and not overwrite:
            hint = "choose another folder, or pass --overwrite (in Python overwrite=True)"
            raise InvalidInput("out", f"{pages}", "a folder without other figures", hint)
    with writing(begun, overwrite=True) as file:
        file.write(json.dumps(dict(key), indent=1).encode())


def _computed(name: str, settings: Settings, pages: Path, key: Mapping[str, Any]) -> Notebook:
    """The notebook of a part: of an earlier run, or written now."""
    if (done := Notebook.opened(pages, name, key)) is not None:
        return done
    notes, start = Notebook(pages, name, key), perf_counter()
    PARTS[name](settings, notes)
    notes.close(perf_counter() - start)
    return notes


def report_of(notebooks: Mapping[str, Notebook], settings: Settings, quick: bool) -> Report:
    """What was found beside what the paper says.

    Args:
        notebooks: What each part found, by name.
        settings: The sizes it was computed with.
        quick: Whether these are small ones.
    """
    rows = list(_rows(notebooks, quick))
    counts = Counter(row[-1] for row in rows)
    machine = f"{os.cpu_count()} cores, {platform.system()} on {platform.machine()}"
    facts = [
        _PAPER,
        f"Every number and every verdict is computed by softreach {version('softreach')}; only the "
        "paper's statements, their sections and how each is checked were written by hand",
        f"Written on {datetime.now(UTC):%Y-%m-%d}",
    ]
    if quick:
        designs, samples = settings.designs, settings.samples
        facts.append(
            f"A quick run with small clouds: {designs} × {designs} designs of {samples:,} points. "
            "Its numbers are coarse; what only the full sizes test is marked so"
        )
    times = [(name, f"{notes.seconds:.1f} s") for name, notes in notebooks.items()]
    note = f"{machine}, Python {platform.python_version()}. A first run compiles, too."
    head = ("Section", "The paper says", "softreach finds", "How", "Verdict")
    return Report(
        title="Minimal activation with maximal reach, recomputed",
        verdict=", ".join(f"{counts[each]} {each}" for each in Verdict if counts[each]),
        state="undecided" if counts[Verdict.DIFFERS] else "met",
        facts=facts,
        sections=[
            Section(title="The paper says, softreach finds", head=head, rows=rows),
            Section(title="Figures", figures=lambda: _figures(notebooks)),
            Section(title="Run times", head=("Part", "Time"), rows=times, note=note),
        ],
    )


def _rows(notebooks: Mapping[str, Notebook], quick: bool) -> Iterator[tuple[str, ...]]:
    for claim in CLAIMS:
        text, verdict = claim.check(notebooks[claim.part].numbers)
        verdict = Verdict.UNTESTED if quick and claim.full else verdict
        yield claim.section, claim.says, text, claim.how, verdict


def _figures(notebooks: Mapping[str, Notebook]) -> Iterator[tuple[bytes, str]]:
    """PNG and caption: figures in the paper's order, our own after them."""
    pages = [(picture, notes) for notes in notebooks.values() for picture in notes.pictures]
    for picture, notes in sorted(pages, key=lambda page: page[0].label or "9"):
        title = f"Figure {picture.label}" if picture.label else "Beyond the paper"
        yield notes.png(picture).read_bytes(), f"{title}. {picture.caption}"
