"""The whole paper, part by part, and its report; what is done stays done, so a rerun continues."""

from __future__ import annotations

import hashlib
import json
import os
import platform
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
from softreach.support.report import page_template, png_source

__all__ = ["PARTS", "reproduce_paper"]

_NARROW = 900  # pixels; two such figures stand side by side

PARTS: Mapping[str, Callable[..., None]] = {
    "model": model,
    "misprints": misprints,
    "redundancy": redundancy,
    "volume": volume,
    "sweep": sweep,
    "uniqueness": uniqueness,
}
"""Name -> what computes it, from the settings, the folder and a notebook; short ones first."""


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
    check_installed(("matplotlib", "plot"), ("skimage", "surface"), ("jinja2", "paper"))
    pyplot()
    settings = QUICK if quick else FULL
    folder = Path(out) / "quick" if quick else Path(out)
    report = folder / "report.html"
    check_place(report, overwrite=overwrite, name="out")
    key = {**asdict(settings), "softreach": version("softreach"), "source": _source()}
    _claim(folder / "figures", key, overwrite=overwrite)
    notebooks: dict[str, Notebook] = {}
    for number, (name, part) in enumerate(PARTS.items(), 1):
        say(f"[{number}/{len(PARTS)}] {name}")
        notebooks[name] = _computed(name, part, settings, folder, key)
        say(f"      {notebooks[name].seconds:.1f} s")
    return write_report(report, notebooks, settings, quick, overwrite=overwrite)


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


def _computed(
    name: str, part: Callable[..., None], settings: Any, folder: Path, key: Mapping[str, Any]
) -> Notebook:
    """The notebook of a part: of an earlier run, or written now."""
    pages = folder / "figures"
    if (done := Notebook.opened(pages, name, key)) is not None:
        return done
    notes, start = Notebook(pages, name, key), perf_counter()
    part(settings, folder, notes)
    notes.close(perf_counter() - start)
    return notes


def write_report(
    path: Path,
    notebooks: Mapping[str, Notebook],
    settings: Settings,
    quick: bool,
    *,
    overwrite: bool = False,
) -> Path:
    """Write what was found beside what the paper says.

    Args:
        path: The HTML file.
        notebooks: What each part found, by name.
        settings: The sizes it was computed with.
        quick: Whether these are small ones.
        overwrite: Whether it may replace a file.

    Returns:
        The file.

    Raises:
        MissingExtra: Jinja2 is not installed.
    """
    rows = list(_rows(notebooks, quick))
    system = f"{platform.system()} on {platform.machine()}"
    page = page_template("softreach.paper", "report.html.jinja").render(
        rows=rows,
        counts={verdict: sum(row["verdict"] == verdict for row in rows) for verdict in Verdict},
        figures=sorted(_figures(notebooks), key=lambda figure: figure["order"]),
        parts=[(name, notebook.seconds) for name, notebook in notebooks.items()],
        settings=settings,
        quick=quick,
        machine=f"{os.cpu_count()} cores, {system}, Python {platform.python_version()}",
        version=version("softreach"),
        date=f"{datetime.now(UTC):%Y-%m-%d}",
    )
    with writing(path, overwrite=overwrite) as file:
        file.write(page.encode())
    return path


def _rows(notebooks: Mapping[str, Notebook], quick: bool) -> Iterator[dict[str, Any]]:
    for claim in CLAIMS:
        finding = claim.check(notebooks[claim.part].numbers)
        yield {
            "section": claim.section,
            "says": claim.says,
            "found": finding.text,
            "how": claim.how,
            "verdict": Verdict.UNTESTED if quick and claim.full else finding.verdict,
        }


def _figures(notebooks: Mapping[str, Notebook]) -> Iterator[dict[str, Any]]:
    """Figures in the paper's order, our own after them."""
    for notebook in notebooks.values():
        for picture in notebook.pictures:
            image = notebook.png(picture).read_bytes()
            yield {
                "wide": int.from_bytes(image[16:20]) > _NARROW,  # its width, in a PNG header
                "title": f"Figure {picture.label}" if picture.label else "Beyond the paper",
                "caption": picture.caption,
                "source": png_source(image),
                "order": picture.label or "9",
            }
