"""Reports: HTML pages in one file with their pictures inside, to be read offline."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from os import PathLike
from typing import Any

from softreach.support.errors import MissingExtra
from softreach.support.files.atomic import writing
from softreach.support.files.formats import FileFormat, Formats, check_installed

__all__ = [
    "REPORT",
    "Section",
    "check_libraries",
    "figure_source",
    "page_template",
    "png_source",
    "write_page",
]

REPORT: Formats = {".html": FileFormat(("jinja2",), "paper")}
"""Formats of reports."""

_DPI = 160


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report: what is given, in this order."""

    title: str = ""
    head: Sequence[str] = ()
    """Heading of the rows."""
    rows: Sequence[Sequence[str]] = ()
    note: str = ""
    points: Sequence[str] = ()
    pictures: Sequence[tuple[str, str, str]] = ()
    """Source, text in its place, and caption of each."""
    text: str = ""
    """Shown as it is, such as a design file."""


def check_libraries() -> None:
    """Say which libraries of a report with pictures are missing.

    Raises:
        MissingExtra: matplotlib or Jinja2 is not installed.
    """
    check_installed(("matplotlib", "plot"), ("jinja2", "paper"))


def write_page(
    path: str | PathLike[str], sections: Sequence[Section], *, overwrite: bool, **head: str
) -> None:
    """Write a report.

    Args:
        path: The .html file.
        sections: Its parts.
        overwrite: Whether it may replace a file.
        **head: `page`, `title`, `verdict`, its `state`, by which it is colored, and `facts`.

    Raises:
        MissingExtra: Jinja2 is not installed.
    """
    template = page_template("softreach.support", "report.html.jinja")
    with writing(path, overwrite=overwrite) as file:
        file.write(template.render(head, sections=sections).encode())


def page_template(package: str, name: str) -> Any:
    """A page to be filled, everything in it escaped.

    Args:
        package: Package that it lies in.
        name: Name of the file.

    Raises:
        MissingExtra: Jinja2 is not installed.
    """
    try:
        from jinja2 import Environment, StrictUndefined
    except ModuleNotFoundError as error:
        raise MissingExtra(("jinja2", "paper")) from error
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    return environment.from_string(files(package).joinpath(name).read_text(encoding="utf-8"))


def png_source(image: bytes) -> str:
    """Source of a PNG picture inside a page."""
    return f"data:image/png;base64,{base64.b64encode(image).decode('ascii')}"


def figure_source(figure: Any) -> str:
    """Source of a figure of matplotlib inside a page; the figure is closed."""
    from matplotlib import pyplot as plt

    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=_DPI)
    plt.close(figure)
    return png_source(image.getvalue())
