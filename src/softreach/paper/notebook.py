"""What sections of the report share: sizes of clouds, numbers and figures on disk, findings."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Any, NamedTuple, Self

import numpy as np

from softreach.plot.style import pyplot, save_figure
from softreach.support.files.text import write_text

Numbers = SimpleNamespace  # Numbers that a section computed, by name; lists of them are arrays


class Verdict(StrEnum):
    """Verdict on a statement."""

    AGREES = "agrees"
    NEARLY = "nearly"
    DIFFERS = "differs"
    MISPRINT = "misprint"
    OPEN = "open"
    UNTESTED = "not tested"


class Finding(NamedTuple):
    """Result of a check."""

    text: str
    verdict: Verdict = Verdict.OPEN


def judged(text: str, yes: object, near: object = False, no: Verdict = Verdict.DIFFERS) -> Finding:
    """A finding whose verdict follows from whether the statement agrees, or nearly does."""
    return Finding(text, Verdict.AGREES if yes else Verdict.NEARLY if near else no)


@dataclass(frozen=True)
class Settings:
    """Sizes of the paper's clouds and sweeps, or smaller ones."""

    designs: int  # Designs along each edge of the atlas
    samples: int  # Activations of each design of the atlas
    alpha: float  # Radius of the α-shapes, in L; the paper states none
    panels: int  # Designs along each edge of the sheets
    accuracy: float  # Relative error asked of exact volumes
    redundant_samples: int  # Activations of the clouds that are compared for redundancy
    queries: int  # Points at which D̄ is evaluated
    seed: int = 0  # Seed of every cloud


FULL = Settings(16, 400_000, 0.05, 7, 3e-3, 2_000_000, 10_000)  # As sections 3 and 5 state
QUICK = Settings(4, 10_000, 0.13, 2, 5e-2, 50_000, 1_000)  # Coarse numbers in under a minute


@dataclass
class Notebook:
    """Numbers and figures of one part; its file is written last, so that a rerun skips the part."""

    folder: Path  # Of the figures, within that of all results
    part: str
    key: Mapping[str, Any]  # All that the results depend on; a notebook of another key is stale
    numbers: dict[str, Any] = field(default_factory=dict)  # What JSON can hold
    pictures: list[tuple[str, str, str]] = field(default_factory=list)
    """Number of each figure in the paper, empty for our own; name without suffix; caption."""
    seconds: float = 0.0

    def draw(self, label: str, name: str, caption: str, figure: Any) -> None:
        """Save a figure, or axes in it, as PNG and PDF, and close it."""
        for suffix in ("png", "pdf"):
            save_figure(figure, self.folder / f"{name}.{suffix}", overwrite=True)
        pyplot().close(figure.get_figure(root=True))
        self.pictures.append((label, name, caption))

    def fill(self, compute: Callable[[Settings, "Notebook"], Any], settings: Settings) -> Self:
        """Compute the part, and write what was found."""
        start = perf_counter()
        self.numbers = json.loads(json.dumps(compute(settings, self), default=np.ndarray.tolist))
        self.seconds = perf_counter() - start
        content = {name: value for name, value in vars(self).items() if name != "folder"}
        write_text(self.folder / f"{self.part}.json", json.dumps(content, indent=1), overwrite=True)
        return self

    @classmethod
    def opened(cls, folder: Path, part: str, key: Mapping[str, Any]) -> Self | None:
        """The finished notebook of a part, or None if there is none of that key."""
        try:
            book = cls(folder, **json.loads((folder / f"{part}.json").read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return None
        whole = all((folder / f"{name}.png").is_file() for _, name, _ in book.pictures)
        return book if whole and book.key == key else None
