"""The report: one HTML file with its figures inside, to be read offline or printed."""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any

from softreach.paper.claims import CLAIMS, Verdict
from softreach.paper.notebook import Notebook, Settings
from softreach.support.files.atomic import writing
from softreach.support.report import page_template, png_source

__all__ = ["write_report"]

_NARROW = 900  # pixels; two such figures stand side by side


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
