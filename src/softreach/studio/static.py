"""Plain files that show a family of designs in a browser, without a studio that serves them.

The page is a figure that turns, with sliders. Each design is a script beside it, since a page that
is opened as a file may load scripts, but read nothing else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import suppress
from functools import partial
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softreach.arm.design_file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter
from softreach.arm.written import written_name
from softreach.atlas.space import DesignSpace
from softreach.geometry.surface import Surface
from softreach.picture.page import packed, script_text, web_page
from softreach.picture.thumbnail import Skin
from softreach.plot.axes import bounding_box
from softreach.plot.coloring import COLORMAP
from softreach.plot.figure_3d import Detail, Scene
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import (
    InvalidDesign,
    InvalidInput,
    MissingExtra,
    NotWritten,
    SoftreachError,
    no_warnings,
)
from softreach.support.files.atomic import check_place, writing
from softreach.support.files.formats import check_installed
from softreach.support.progress import Progress, silent
from softreach.support.quantity import quantity
from softreach.support.units import LengthUnit, as_unit, handy_unit, readable_unit
from softreach.support.versions import versions
from softreach.workspace import ReachableSet, ReachableSolid, ReachableSurface, reachable_set

__all__ = ["StaticPage", "write_static"]

_MOST = 1000  # designs, which are some 150 MB
_DETAIL = Detail(triangles=13_000, sides=24, stations=41)
_LOOKED_AT = 20_000  # corners of a computed surface whose distance to the drawn one is measured
_MARK = "// softreach design of a static page"
_FOLDER = "designs"

_NUMBERS = {
    3: {"volume": 3, "unreachability": 0, "convex_volume": 3},
    2: {"area": 2, "convex_volume": 3},
    1: {"curve_length": 1},
    0: {},
}
"""Dimension of a reachable set -> its numbers and their powers of a length."""


class StaticPage(NamedTuple):
    """Files that were written."""

    page: Path
    """The one to open."""
    designs: int
    """Designs with a file each."""
    computed: int
    """Designs that no older file held."""
    gaps: int
    """Combinations without a reachable set."""
    size: int
    """Of all files [bytes]."""


def write_static(
    space: DesignSpace,
    folder: str | PathLike[str],
    *,
    unit: str | None = None,
    title: str = "",
    overwrite: bool = False,
    progress: Progress = silent,
) -> StaticPage:
    """Write a page with sliders that shows the reachable set of each design of a grid.

    Designs whose files are there are not computed again: an interrupted call goes on, and a finer
    grid takes what a coarser one has.

    Args:
        space: A grid of at most 1,000 designs.
        folder: Where `index.html` and a folder of designs go.
        unit: Of lengths: "m", "cm", "mm" or "L"; that of the design file if left out.
        title: Of the page.
        overwrite: Whether a page that is there may be replaced.
        progress: Called with the number of designs done.

    Raises:
        InvalidInput: No grid, too many designs, no design that reaches anything, or other files
            in the way.
        NotWritten: Nothing can be written there.
        MissingExtra: matplotlib or scikit-image is not installed.
    """
    check_installed(("matplotlib", "plot"), ("skimage", "surface"))
    place, overwrite = Path(as_path("folder", folder)), as_flag("overwrite", overwrite)
    if space.layout != "grid" or space.size > _MOST:
        raise InvalidInput("designs", f"{space.size:,}", f"a grid of {_MOST:,} at most")
    index = place / "index.html"
    check_place(index, overwrite=overwrite, name="static")
    base = space.base
    shown = base.display_unit if unit is None else unit
    name = as_unit(handy_unit(base.length) if shown is None else shown, base.length).name
    tasks = (partial(_design, space, number, name, place / _FOLDER) for number in range(space.size))
    entries: list[_Entry] = []
    for entry in parallel.in_order(tasks):
        entries.append(entry)
        progress(1)
    page = _page(space, entries, name, title)
    with writing(index, overwrite=overwrite) as file:
        file.write(page.encode())
    kept = {entry.file for entry in entries if entry.file is not None}
    _remove_older(place / _FOLDER, kept)
    size = len(page.encode()) + sum(path.stat().st_size for path in kept)
    computed = sum(entry.computed for entry in entries)
    gaps = sum("gap" in entry.content for entry in entries)
    return StaticPage(index, len(entries) - gaps, computed, gaps, size)


class _Entry(NamedTuple):
    content: dict[str, Any]
    """Its numbers and its box, or the reason for the gap."""
    file: Path | None
    computed: bool


def _design(space: DesignSpace, number: int, unit: str, folder: Path) -> _Entry:
    try:
        arm = space.design(number)
    except InvalidDesign as error:
        return _Entry(_gap(in_file_terms(error, "")), None, False)
    made_of = [arm.to_toml(), unit, list(_DETAIL), versions()["softreach_version"]]
    key = _digest(json.dumps(made_of))
    path = folder / f"{key}.js"
    if (content := _read(path, key)) is not None:
        return _Entry(_brief(content), path, False)
    with parallel.undivided(), no_warnings():
        content = _content(arm, as_unit(unit, arm.length))
    body = f"receive({json.dumps(key)}, {script_text(content)});\n"
    with writing(path, overwrite=True) as file:
        file.write(f"{_MARK} {key} {_digest(body)}\n{body}".encode())
    return _Entry(_brief(content), path, True)


def _gap(error: SoftreachError) -> dict[str, Any]:
    return {"gap": "; ".join(str(error).strip().splitlines())}


def _brief(content: dict[str, Any]) -> dict[str, Any]:
    """Numbers and words of every design on the page, without what it draws."""
    return {name: content[name] for name in ("gap", "numbers", "box") if name in content}


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _read(path: Path, key: str) -> dict[str, Any] | None:
    """The content of a design's file; None if there is none, or another or a damaged one."""
    try:
        head, _, body = path.read_text("utf-8").partition("\n")
    except (OSError, UnicodeDecodeError):
        return None
    if head != f"{_MARK} {key} {_digest(body)}":
        return None
    return json.loads(body.partition(", ")[2].removesuffix(");\n"))


def _remove_older(folder: Path, kept: set[Path]) -> None:
    for path in folder.glob("*.js"):
        with suppress(OSError, UnicodeDecodeError):
            if path not in kept and path.read_text("utf-8").startswith(_MARK):
                path.unlink()


def _content(arm: Manipulator, unit: LengthUnit) -> dict[str, Any]:
    try:
        reached = reachable_set(arm)
        numbers = _numbers(reached, unit)
        scene = Scene(unit, detail=_DETAIL)
        scene.add([reached, arm])
    except (MissingExtra, NotWritten):
        raise
    except SoftreachError as error:
        return _gap(error)
    box = bounding_box(*scene.points())
    return {
        "numbers": numbers,
        "box": box.tolist(),
        "keys": [key._asdict() for key in scene.keys],
        "note": ". ".join([*scene.notes[:1], *_errors(reached, scene, box)]),
        "parts": [packed(part, box) for part in scene.parts],
    }


def _numbers(reached: ReachableSet, unit: LengthUnit) -> dict[str, Any]:
    """Name -> value and error in SI units, and both as text."""
    numbers = {}
    for name, power in _NUMBERS[reached.dimension].items():
        value, error = (float(getattr(reached, f"{name}{part}")) for part in ("", "_error"))
        if not np.isfinite(value):
            continue
        text = unit.text(value, power, error) if power else quantity(100 * value, "%", 100 * error)
        numbers[name] = [value, error if np.isfinite(error) else None, text]
    return numbers


def _errors(reached: ReachableSet, scene: Scene, box: np.ndarray) -> Iterator[str]:
    unit, step = scene.unit, float(np.ptp(box, axis=0).max()) / 65535
    if isinstance(reached, ReachableSolid | ReachableSurface):
        computed = reached.sheets() if isinstance(reached, ReachableSolid) else reached.surface()
        skin = next(part.shape for part in scene.parts if part.surface)
        assert isinstance(skin, Skin)
        vertices, faces = np.asarray(skin.vertices, float), np.asarray(skin.faces)
        drawn = Surface(vertices=vertices * unit.size, faces=faces)
        every = max(1, len(computed.vertices) // _LOOKED_AT)
        distance = unit.of(drawn.distance(computed.vertices[::every]))
        far = float(np.quantile(distance, 0.99)) + step
        within = f"within {far:.2g} {unit.name} of the drawn one"
        yield f"99 % of the corners of the computed surface lie {within}"
    yield f"Places are rounded to {step:.1g} {unit.name}"
    if reached.lost_share > 0.0:
        share = 100.0 * reached.lost_share
        yield f"No posture is held at {share:.2g} % of activations"


def _page(space: DesignSpace, entries: list[_Entry], unit: str, title: str) -> str:
    """The page, with the design in it that is nearest to the base."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    known = [k for k, entry in enumerate(entries) if "gap" not in entry.content]
    if not known:
        allowed = "some that can exist and reach something"
        raise InvalidInput("designs", entries[0].content["gap"], allowed)
    first = min(known, key=_distances(space).__getitem__)
    boxes = np.array([entries[k].content["box"] for k in known])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    path, base = entries[first].file, space.base
    content = None if path is None else _read(path, path.stem)
    assert content is not None
    designs = [
        {"gap": entry.content["gap"]}
        if "gap" in entry.content
        else {"file": entry.file.stem if entry.file else "", "numbers": entry.content["numbers"]}
        for entry in entries
    ]
    lengths, varied = as_unit(unit, base.length), space.varied()
    sheet = {
        "folder": _FOLDER,
        "parameters": [
            _slider(base, varied[name], values, lengths) for name, values in space.parameters
        ],
        "designs": designs,
        "first": first,
        "keys": content["keys"],
        "note": content["note"],
        "colors": [to_hex(color) for color in colormaps[COLORMAP](np.linspace(0.0, 1.0, 33))],
        "name": title,
    }
    more = files("softreach.studio").joinpath("static.html").read_text(encoding="utf-8")
    return web_page(
        content["parts"],
        box,
        lengths,
        caption=title and f"Reachable set of {title}",
        note=content["note"],
        more=more.replace("@SHEET@", script_text(sheet)),
        scripts="'self' file:",
    ).replace('content="softreach figure"', 'content="softreach static page"', 1)


def _distances(space: DesignSpace) -> np.ndarray:
    """Distance of each design to the base, in ranges of the parameters; of unknown ones to half."""
    axes, varied = [], space.varied()
    for name, values in space.parameters:
        low, high = min(values), max(values)
        own = varied[name].value(space.base)
        middle = own if np.isfinite(own) else (low + high) / 2
        axes.append(np.abs(np.array(values) - middle) / (high - low or 1.0))
    return np.sum(np.meshgrid(*axes, indexing="ij"), axis=0).ravel()


def _slider(
    base: Manipulator, parameter: Parameter, values: tuple[float, ...], lengths: LengthUnit
) -> Mapping[str, Any]:
    symbol, scale = readable_unit(parameter.unit, max(map(abs, values)), lengths)
    if parameter.unit == "m" and lengths.relative:  # of which arm, if it is the length that varies?
        symbol, scale = "m", 1.0
    return {
        "key": written_name(parameter.name, parameter.unit),
        "label": parameter.name.replace("_", " "),
        "unit": symbol,
        "hint": f"{parameter.symbol}: {parameter.meaning}",
        "values": [float(f"{value / scale:.10g}") for value in values],
    }
