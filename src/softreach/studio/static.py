"""Plain files that show a family of designs in a browser, without a studio that serves them.

The page is a figure that turns, with sliders. Each design is a script beside it, since a page that
is opened as a file may load scripts, but read nothing else.
"""

from __future__ import annotations

import json
from functools import partial
from importlib.resources import files
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softreach.arm.design_file import in_file_terms
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, written_name
from softreach.atlas.space import DesignSpace
from softreach.picture.page import packed, script_text, web_page
from softreach.plot.axes import bounding_box
from softreach.plot.coloring import ScalarKey
from softreach.plot.figure_3d import HELP, Detail, Scene, page_keys
from softreach.support import errors, parallel
from softreach.support.arguments import as_flag, as_path
from softreach.support.files.atomic import check_place, writing
from softreach.support.progress import Progress, silent
from softreach.support.quantity import quantity
from softreach.support.units import LengthUnit, as_unit, readable_unit
from softreach.workspace import reachable_set

Entry = dict[str, Any]
_MOST = 1000  # designs, which are some 150 MB
_DETAIL = Detail(triangles=13_000, sides=24, stations=41)
_FOLDER = "designs"
_HELP = f"{HELP} The address of this page names the design."
_NUMBERS = {
    3: {"volume": 3, "unreachability": 0, "convex_volume": 3},
    2: {"area": 2, "convex_volume": 3},
    1: {"curve_length": 1},
    0: {},
}
"""Dimension of a reachable set -> its numbers and their powers of a length."""


class StaticPage(NamedTuple):
    """Files that were written."""

    page: Path  # the one to open
    designs: int  # with a file each
    gaps: int  # combinations without a reachable set
    size: int  # of all files [bytes]


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

    The folder gets `index.html` and a folder of designs. Lengths are in a unit, by default that of
    the design file; `progress` is called with the number of designs done.
    """
    errors.check_installed("matplotlib", "skimage")
    place, overwrite = Path(as_path("folder", folder)), as_flag("overwrite", overwrite)
    if space.layout != "grid" or space.size > _MOST:
        raise errors.InvalidInput("designs", f"{space.size:,}", f"a grid of {_MOST:,} at most")
    index, base = place / "index.html", space.base
    check_place(index, overwrite=overwrite, name="static")
    name = base.length_unit.name if unit is None else as_unit(unit, base.length).name
    paths = [place / _FOLDER / f"{number}.js" for number in range(space.size)]
    tasks = (partial(_design, space, k, name, path, overwrite) for k, path in enumerate(paths))
    entries = list[Entry]()
    for entry in parallel.in_order(tasks):
        entries.append(entry)
        progress(1)
    page = _page(space, entries, paths, as_unit(name, base.length), title).encode()
    with writing(index, overwrite=overwrite) as file:
        file.write(page)
    written = [path for path, entry in zip(paths, entries, strict=True) if "gap" not in entry]
    size = len(page) + sum(path.stat().st_size for path in written)
    return StaticPage(index, len(written), len(entries) - len(written), size)


def _design(space: DesignSpace, number: int, unit: str, path: Path, overwrite: bool) -> Entry:
    """Numbers and box of a design whose file is written, or the reason why there is none."""
    try:
        arm = space.design(number)
        with parallel.undivided(), errors.no_warnings():
            content = _content(arm, as_unit(unit, arm.length))
    except (errors.MissingExtra, errors.NotWritten):
        raise
    except errors.SoftreachError as error:
        shown = in_file_terms(error, "") if isinstance(error, errors.InvalidDesign) else error
        return {"gap": "; ".join(str(shown).strip().splitlines())}
    with writing(path, overwrite=overwrite) as file:
        file.write(f'receive("{number}", {script_text(content)});\n'.encode())
    return {name: content[name] for name in ("numbers", "box")}


def _content(arm: Manipulator, unit: LengthUnit) -> Entry:
    reached, scene = reachable_set(arm), Scene(unit, detail=_DETAIL)
    scene.add([reached, arm])
    box = bounding_box(*scene.points())
    step = float(np.ptp(box, axis=0).max()) / 65535
    notes = [*scene.notes[:1], f"Places are rounded to {step:.1g} {unit.name}"]
    if reached.lost_share > 0.0:
        notes.append(f"No posture is held at {100 * reached.lost_share:.2g} % of activations")
    numbers = {}  # name -> value and error in SI units, and both as text
    for name, power in _NUMBERS[reached.dimension].items():
        value, error = (float(getattr(reached, f"{name}{part}")) for part in ("", "_error"))
        if np.isfinite(value):
            percent = quantity(100 * value, "%", 100 * error)
            text = unit.text(value, power, error) if power else percent
            numbers[name] = [value, error if np.isfinite(error) else None, text]
    shown = {"keys": [key._asdict() for key in scene.keys], "note": ". ".join([*notes, _HELP])}
    parts = [packed(part, box) for part in scene.parts]
    return shown | {"numbers": numbers, "box": box.tolist(), "parts": parts}


def _page(
    space: DesignSpace, entries: list[Entry], paths: list[Path], unit: LengthUnit, title: str
) -> str:
    """The page, with the design in the middle of those that there are."""
    known = [k for k, entry in enumerate(entries) if "gap" not in entry]
    if not known:
        raise errors.InvalidInput(
            "designs", entries[0]["gap"], "some that can exist and reach something"
        )
    first = known[len(known) // 2]
    boxes = np.array([entries[k]["box"] for k in known])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    content = json.loads(paths[first].read_text("utf-8").partition(", ")[2].removesuffix(");\n"))
    (scale,) = page_keys(ScalarKey("", 0.0, 1.0))
    base, varied = space.base, space.varied()
    sliders = [_slider(base, varied[name], values, unit) for name, values in space.parameters]
    designs = [
        entry if "gap" in entry else {"file": str(k), "numbers": entry["numbers"]}
        for k, entry in enumerate(entries)
    ]
    sheet = {"folder": _FOLDER, "parameters": sliders, "designs": designs, "first": first}
    sheet |= {"keys": content["keys"], "note": content["note"], "help": _HELP, "name": title}
    sheet["colors"] = scale._asdict()["colors"]
    more = files("softreach.studio").joinpath("static.html").read_text(encoding="utf-8")
    more, caption = more.replace("@SHEET@", script_text(sheet)), f"Reachable set of {title}"
    words = {"caption": title and caption, "note": content["note"]}
    page = web_page(content["parts"], box, unit, more=more, scripts="'self' file:", **words)
    return page.replace('content="softreach figure"', 'content="softreach static page"', 1)


def _slider(
    base: Manipulator, parameter: Parameter, values: tuple[float, ...], lengths: LengthUnit
) -> Entry:
    symbol, scale = readable_unit(parameter.unit, max(map(abs, values)), lengths)
    if parameter.unit == "m" and lengths.relative:  # of which arm, if it is the length that varies?
        symbol, scale = "m", 1.0
    label, hint = parameter.name.replace("_", " "), f"{parameter.symbol}: {parameter.meaning}"
    shown = [float(f"{value / scale:.10g}") for value in values]
    key = written_name(parameter.name, parameter.unit)
    return {"key": key, "label": label, "unit": symbol, "hint": hint, "values": shown}
