"""The whole paper, part by part: what is done stays done, so a rerun continues."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from importlib.resources import files
from os import PathLike
from pathlib import Path
from time import perf_counter
from typing import Any

from softreach.paper.notebook import FULL, QUICK, Notebook
from softreach.paper.report import write_report
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

__all__ = ["PARTS", "reproduce_paper"]

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
