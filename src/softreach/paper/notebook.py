"""What a part of the report found, on disk as soon as it is done, and the sizes of its clouds."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

from softreach.plot.style import pyplot, save_figure
from softreach.support.files.atomic import writing


@dataclass(frozen=True)
class Picture:
    """A figure of the report."""

    label: str
    """Number of the figure in the paper, such as "2a"; empty for one of our own."""
    name: str
    """Of its files, without suffix."""
    caption: str


@dataclass
class Notebook:
    """Numbers and figures of one part; `close` makes them last, so that a rerun skips the part."""

    folder: Path
    """Of the figures, within that of all results."""
    part: str
    key: Mapping[str, Any]
    """Everything that the results depend on; a notebook of another key is stale."""
    numbers: dict[str, Any] = field(default_factory=dict)
    """Plain ones, texts, lists or dicts of them."""
    pictures: list[Picture] = field(default_factory=list)
    seconds: float = 0.0

    def note(self, **numbers: Any) -> None:
        """Keep numbers by name."""
        self.numbers |= numbers

    def draw(self, label: str, name: str, caption: str, figure: Any) -> None:
        """Save a figure, or axes in it, as PNG and PDF, and close it."""
        for suffix in ("png", "pdf"):
            save_figure(figure, self.folder / f"{name}.{suffix}", overwrite=True)
        pyplot().close(figure.get_figure(root=True))
        self.pictures.append(Picture(label, name, caption))

    def close(self, seconds: float) -> None:
        """Write what was found; the last act, so that a file means a finished part."""
        self.seconds = seconds
        content = asdict(self) | {"folder": None, "key": dict(self.key)}
        with writing(self._file, overwrite=True) as file:
            file.write(json.dumps(content, indent=1).encode())

    @classmethod
    def opened(cls, folder: Path, part: str, key: Mapping[str, Any]) -> Self | None:
        """The finished notebook of a part, or None if there is none of that key."""
        book = cls(folder, part, key)
        try:
            stored = json.loads(book._file.read_text(encoding="utf-8"))
            same = stored["key"] == json.loads(json.dumps(dict(key)))
            book.pictures = [Picture(**picture) for picture in stored["pictures"]]
            book.numbers, book.seconds = stored["numbers"], stored["seconds"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return book if same and all(book.png(p).is_file() for p in book.pictures) else None

    def png(self, picture: Picture) -> Path:
        """The file of a picture."""
        return self.folder / f"{picture.name}.png"

    @property
    def _file(self) -> Path:
        return self.folder / f"{self.part}.json"


@dataclass(frozen=True)
class Settings:
    """Sizes of the paper's clouds and sweeps, or smaller ones."""

    designs: int
    """Designs along each edge of the atlas."""
    samples: int
    """Activations of each design of the atlas."""
    alpha: float
    """Radius of the α-shapes, in L; the paper states none."""
    panels: int
    """Designs along each edge of the sheets."""
    accuracy: float
    """Relative error asked of exact volumes."""
    redundant_samples: int
    """Activations of the clouds that are compared for redundancy."""
    queries: int
    """Points at which D̄ is evaluated."""
    seed: int = 0
    """Seed of every cloud."""


FULL = Settings(16, 400_000, 0.05, 7, 3e-3, 2_000_000, 10_000)
"""The sizes that the paper states (sections 3 and 5)."""

QUICK = Settings(4, 10_000, 0.13, 2, 5e-2, 50_000, 1_000)
"""Coarse numbers in under a minute."""
