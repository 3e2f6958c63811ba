"""What a part of the report found: numbers and figures, on disk as soon as they are there."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from softreach.atomic import writing
from softreach.file_kinds import FileKind, text_with

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Notebook", "Picture"]


_NOTES = FileKind("what a part of the report found", text_with('"folder": null,\n "part": '))


@dataclass(frozen=True)
class Picture:
    """A figure of the report."""

    label: str
    """Which figure of the paper it recomputes, such as "2a"; empty for one of our own."""
    name: str
    """Of its files, without suffix."""
    caption: str


@dataclass
class Notebook:
    """Numbers and figures of one part; `close` makes them last, so that a rerun skips the part."""

    folder: Path
    part: str
    key: Mapping[str, Any]
    """What the results depend on; a notebook of another key is stale."""
    overwrite: bool = False
    """Whether files of other kinds may be replaced."""
    numbers: dict[str, Any] = field(default_factory=dict)
    pictures: list[Picture] = field(default_factory=list)
    seconds: float = 0.0

    def note(self, **numbers: Any) -> None:
        """Keep numbers by name: plain ones, texts, lists or dicts of them."""
        self.numbers |= numbers

    def draw(self, label: str, name: str, caption: str, figure: Figure | Axes) -> None:
        """Save a figure as PNG and PDF, and close it."""
        from softreach.plot.style import pyplot, save_figure

        for suffix in ("png", "pdf"):
            save_figure(figure, self.folder / f"{name}.{suffix}", overwrite=self.overwrite)
        pyplot().close(figure.get_figure(root=True))
        self.pictures.append(Picture(label, name, caption))

    def close(self, seconds: float) -> None:
        """Write what was found; the last act, so that a file means a finished part."""
        self.seconds = seconds
        content = asdict(self) | {"folder": None, "key": dict(self.key)}
        del content["overwrite"]
        with writing(self._file, _NOTES, overwrite=self.overwrite) as file:
            file.write(json.dumps(content, indent=1).encode())

    @classmethod
    def opened(cls, folder: Path, part: str, key: Mapping[str, Any]) -> Self | None:
        """The finished notebook of a part, or None if there is none of that key."""
        found = cls(folder, part, key)
        try:
            stored = json.loads(found._file.read_text(encoding="utf-8"))
            same = stored["key"] == json.loads(json.dumps(dict(key)))
            found.pictures = [Picture(**picture) for picture in stored["pictures"]]
            found.numbers, found.seconds = stored["numbers"], stored["seconds"]
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return found if same and all(found.png(p).is_file() for p in found.pictures) else None

    def png(self, picture: Picture) -> Path:
        """The file of a picture."""
        return self.folder / f"{picture.name}.png"

    @property
    def _file(self) -> Path:
        return self.folder / f"{self.part}.json"
