"""Reports: what was found, printed in lines or written as one page with its pictures inside."""

import base64
import io
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from os import PathLike
from typing import Any

from softreach.support.arguments import as_path
from softreach.support.errors import counted
from softreach.support.files.formats import FileFormat, Formats, format_of
from softreach.support.files.text import write_text
from softreach.support.quantity import columns

REPORT: Formats = {".html": FileFormat(("matplotlib", "jinja2"))}  # Formats of reports
_DPI = 160


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of a report: what is given, in this order."""

    title: str = ""
    head: Sequence[str] = ()  # Heading of the rows
    rows: Sequence[Sequence[str]] = ()
    note: str = ""
    points: Sequence[str] = ()
    figures: Callable[[], Iterable[tuple[Any, str]]] = tuple
    """Draws figures of matplotlib, or reads PNG files, each with its caption."""
    text: str = ""  # Shown as it is, such as a design file
    printed: int = 30
    """Rows among the lines, with the points; with 0 all of it is on the page alone."""


@dataclass(frozen=True, kw_only=True)
class Report:
    """What was found: `str` gives its lines, `save` writes its page."""

    title: str
    """Heading of the page."""
    verdict: str
    """The result in one sentence."""
    state: str
    """Kind of verdict, by which the page is colored: met, missed, undecided, noise and so on."""
    sections: Sequence[Section]
    """Parts of the page, each with a heading."""
    facts: Sequence[str] = ()
    """Remarks on the whole."""

    def __str__(self) -> str:
        lines = [self.verdict, *self.facts]
        for section in self.sections:
            if section.printed:
                rows = [section.head] * bool(section.head) + list(section.rows[: section.printed])
                lines += columns(rows) if section.rows else ()
                if (more := len(section.rows) - section.printed) > 0:
                    lines.append(f"... and {counted(more, 'more row')}")
                lines += section.points
        return "\n  ".join(lines)

    def save(self, path: str | PathLike[str], *, overwrite: bool = False) -> None:
        """Write one HTML file, to be read offline.

        Args:
            path: The .html file.
            overwrite: Whether it may replace a file.

        Raises:
            InvalidInput: Something is there, or another suffix.
            MissingExtra: matplotlib or Jinja2 is not installed.
        """
        format_of(as_path("path", path), REPORT)
        from jinja2 import Environment, StrictUndefined

        text = files("softreach.support").joinpath("report.html.jinja").read_text(encoding="utf-8")
        pages = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
        parts = [(part, [(_source(f), c) for f, c in part.figures()]) for part in self.sections]
        page = pages.from_string(text).render(report=self, parts=parts)
        write_text(path, page, overwrite=overwrite)


class Reported(ABC):
    """A result that shows itself by its report."""

    @abstractmethod
    def report(self) -> Report:
        """All of it, to be printed, or saved as an .html file."""

    def __repr__(self) -> str:
        return str(self.report())


def _source(figure: Any) -> str:
    if not isinstance(figure, bytes):
        from matplotlib import pyplot as plt

        image = io.BytesIO()
        figure.savefig(image, format="png", dpi=_DPI)
        plt.close(figure)
        figure = image.getvalue()
    return f"data:image/png;base64,{base64.b64encode(figure).decode('ascii')}"
