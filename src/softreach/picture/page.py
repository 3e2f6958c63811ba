"""A figure in space as one web page, which turns in a browser and asks nothing of a network.

Arrays are base64: places in 16 bits of the box along each axis, colors in 8 bits a channel.
"""

import base64
import html
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.picture.projection import VIEWS, View, view_angles
from softreach.support.arrays import Array
from softreach.support.palette import Color
from softreach.support.units import LengthUnit

_STEPS = 65535
_HEIGHT = 560  # pixels, in notebooks
_BUTTONS = "front", "side", "top", "oblique"


class Skin(NamedTuple):
    """A lit surface."""

    vertices: ArrayLike  # Shape (v, 3)
    faces: ArrayLike  # Shape (f, 3)
    color: Color


class Dots(NamedTuple):
    """Points."""

    points: ArrayLike  # Shape (n, 3)
    colors: ArrayLike = (64, 100, 150)  # RGB from 0 to 255, shape (n, 3) or (3,)


class PagePart(NamedTuple):
    """Something to show; parts of one name are switched on and off together."""

    name: str
    shape: Dots | Skin  # In the unit of the page
    opacity: float = 1.0
    through: bool = False  # True if it shows through what hides it
    surface: bool = False  # True if a slider changes its opacity
    size: float = 0.0  # Diameter of dots, in the unit of the page


PackedPart = dict[str, Any]  # a part as the script of a page reads it


class Swatches(NamedTuple):
    """Key of colors that stand for something each."""

    entries: Sequence[tuple[str, str]]  # Label and color, as CSS has it
    title: str = ""  # Meaning of the colors


class ColorScale(NamedTuple):
    """Key of colors that stand for numbers."""

    label: str
    colors: Sequence[str]  # In even steps, as CSS has them
    numbers: Sequence[str]  # Below the scale, in even steps from end to end


@dataclass(frozen=True)
class Figure3D:
    """A figure that turns in a browser; `save_figure` writes it as .html, notebooks show it."""

    html: str = field(repr=False)
    """The page, in one file."""
    note: str
    """Points and triangles that it shows, and of how many; empty for arms alone."""

    def _repr_html_(self) -> str:
        page = html.escape(self.html, quote=True)
        style = f"width:100%;height:{_HEIGHT}px;border:1px solid #ddd"
        return f'<iframe srcdoc="{page}" style="{style}" title="softreach"></iframe>'

    def __repr__(self) -> str:
        note = f"{self.note}, " if self.note else ""
        return f"Figure3D: {note}{len(self.html) / 1e6:.1f} MB"


def web_page(
    parts: Sequence[PagePart | PackedPart],
    box: Array,
    unit: LengthUnit,
    *,
    keys: Sequence[Swatches | ColorScale] = (),
    caption: str = "",
    note: str = "",
    view: View = "oblique",
    more: str = "",
    scripts: str = "",
) -> str:
    """The page as HTML: parts in a box, lower and upper corner in a unit, shape (2, 3).

    Keys explain the colors; the caption, and a note in small letters, stand below the figure.
    `more` is HTML at the end, whose scripts know the names of the page's own; `scripts` says where
    else scripts may come from, as a Content-Security-Policy has it.
    """
    content = {
        "box": box.tolist(),
        "unit": unit.name,
        "labels": [unit.label(x) for x in "xyz"],
        "views": [(name, *VIEWS[name]) for name in _BUTTONS],
        "start": view_angles(view),
        "keys": [key._asdict() for key in keys],
        "caption": caption,
        "note": note,
    }
    content["parts"] = [part if isinstance(part, dict) else packed(part, box) for part in parts]
    page = files("softreach.picture").joinpath("page.html").read_text(encoding="utf-8")
    title = html.escape(caption.partition("\n")[0] or "softreach")
    head, body = page.split("@DATA@")
    head = head.replace("@SCRIPTS@", scripts and f" {scripts}").replace("@TITLE@", title)
    return head + script_text(content) + body.replace("@MORE@", more)


def script_text(content: Any) -> str:
    """A value as JSON, no text of which can end the script that it stands in."""
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).replace("<", "\\u003c")


def packed(part: PagePart, box: Array) -> PackedPart:
    """A part with places in a box around it, shape (2, 3)."""
    shape, common = part.shape, {"name": part.name, "through": part.through, "box": box.tolist()}
    common |= {"opacity": 1.0 if part.surface else part.opacity, "surface": part.surface}
    if isinstance(shape, Dots):
        points = np.asarray(shape.points, float)
        colors = np.broadcast_to(np.asarray(shape.colors, np.uint8), points.shape)
        return common | {"xyz": _places(points, box), "rgb": _text(colors), "size": part.size}
    vertices = np.asarray(shape.vertices, float)
    wide = len(vertices) > _STEPS
    faces = _text(np.asarray(shape.faces, "<u4" if wide else "<u2"))
    common |= {"xyz": _places(vertices, box), "faces": faces, "wide": wide}
    return common | {"color": list(shape.color), "start": part.opacity}


def css_color(rgb: ArrayLike) -> str:
    """A color of channels from 0 to 1, as CSS has it."""
    red, green, blue = np.rint(255 * np.asarray(rgb, float)).astype(int)
    return f"#{red:02x}{green:02x}{blue:02x}"


def _places(points: Array, box: Array) -> str:
    shares = (points - box[0]) / (box[1] - box[0])
    return _text(np.rint(_STEPS * np.clip(shares, 0.0, 1.0)).astype("<u2"))


def _text(array: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode("ascii")
