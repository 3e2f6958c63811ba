"""Writes docs/gallery.md and its pictures from the named designs: `python -m tools.gallery`.

It takes five minutes. `python -m tools.gallery NAME ...` draws the pictures of these designs alone.
"""

from __future__ import annotations

import inspect
import re
import sys
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

import softreach as sr
from softreach import plot
from softreach.arm import designs
from softreach.support.quantity import quantity

DOCS = Path(__file__).parent.parent / "docs"
PAGE, PICTURES = DOCS / "gallery.md", DOCS / "images" / "gallery"

_INTRODUCTION = """\
# Gallery

<!-- Written by `python -m tools.gallery`. -->

Designs from the literature, each with its source. A name is a design on the
[command line](command-line.md), `softreach design lce_arm`; a function,
`sr.designs.lce_arm()`; and a [file](design-files.md), `softreach example lce_arm`.

```python
import softreach as sr

print(sr.designs.lce_arm())
```

```text
Manipulator: L = 0.09 m, R2 = 0.0045 to 0.0045 m
  bundles: left, right, longitudinal
```

Pictures, from the left: the arm at rest; the cloud of its tips from the front and from above, with
shapes of the arm at the strongest activation of a bundle or a group; the section at the base.
Volume and share of the convex hull out of reach are those of the
[exact reachable set](reachable-set.md) without loads, with their errors.

"""
_HEAD = """\
| design | L [m] | R2 [m] | bundles | volume | out of reach |
|---|---|---|---|---|---|
"""
_GROUPS = {
    "elephant_trunk": (
        ("dorsal longitudinal",),
        ("outer oblique right", "inner oblique right"),
        ("outer oblique right", "inner oblique left", "dorsal longitudinal right"),
    ),
}
_SHAPES = 3
_SAMPLES = 100_000
_MEMORY = 1e9  # bytes


class Row(NamedTuple):
    """What takes minutes to compute about a design, as the page has it."""

    volume: str
    out_of_reach: str


def measured(name: str) -> Row:
    """The exact numbers of a design; of many bundles to 1 %, within the same memory everywhere."""
    arm = getattr(designs, name)()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sr.errors.SoftreachWarning)  # the error is on the page
        if arm.bundles <= 3:
            found = sr.reachable_set(arm)
        else:
            found = sr.reachable_set(arm, accuracy=0.01, memory=_MEMORY)
    share, error = 100 * found.unreachability, 100 * found.unreachability_error
    return Row(quantity(found.volume, "m³", found.volume_error), quantity(share, "%", error))


def page(rows: dict[str, Row]) -> str:
    """The page with these numbers."""
    table = "".join(_table_row(name, row) for name, row in rows.items())
    return _INTRODUCTION + _HEAD + table + "".join(_section(name) for name in rows)


def rows_of(text: str) -> dict[str, Row]:
    """The numbers that a page holds."""
    lines = re.findall(r"^\| \[`(\w+)`\]\(.*\| (.+) \| (.+) \|$", text, re.MULTILINE)
    return {name: Row(volume, share) for name, volume, share in lines}


def draw(name: str) -> None:
    """Write the picture of a design."""
    from matplotlib import pyplot

    arm = getattr(designs, name)()
    cloud = sr.compute_cloud(arm, n=_SAMPLES)
    shapes = sr.configuration(arm, strongest(name, arm), stations=200)
    with pyplot.rc_context({"font.size": 7}):
        figure = pyplot.figure(figsize=(9.6, 2.6), layout="constrained")
        rest, front, top, section = figure.subplots(1, 4, width_ratios=(1.0, 1.8, 1.8, 1.6))
        plot.plot_arm(arm, ax=rest, view="oblique")
        for ax, view in ((front, "front"), (top, "top")):
            box = _box(arm, cloud, shapes)
            plot.plot_cloud(cloud, ax=ax, view=view, color="rgb", key=False, box=box)
            plot.plot_arm(arm, shapes, ax=ax, view=view, rest=False, box=box)
        plot.plot_cross_section(arm, ax=section, legend=True)
        PICTURES.mkdir(parents=True, exist_ok=True)
        figure.savefig(PICTURES / f"{name}.png", dpi=100, pil_kwargs={"optimize": True})
    pyplot.close(figure)


def strongest(name: str, arm: sr.Manipulator) -> np.ndarray:
    """Activations of some bundles or groups at their largest, shape (shape, bundle)."""
    groups = _GROUPS.get(name) or [(bundle,) for bundle in arm.bundle_names[:_SHAPES]]
    largest = arm.bounds[np.arange(arm.bundles), np.abs(arm.bounds).argmax(axis=1)]
    chosen = [[any(part in one for part in group) for one in arm.bundle_names] for group in groups]
    return np.array(chosen) * largest


def _box(arm: sr.Manipulator, cloud, shapes) -> np.ndarray:
    """What holds the cloud and the shapes, at least half as wide as the arm is long [m]."""
    points = np.concatenate([cloud.tip.values, shapes.position.values.reshape(-1, 3)])
    room = 0.03 * arm.length + float(arm.profile.radius(0.0))
    low, high = points.min(axis=0) - room, points.max(axis=0) + room
    missing = np.maximum(0.0, 0.5 * arm.length - (high - low)) / 2
    return np.array([low - missing, high + missing])


def _table_row(name: str, row: Row) -> str:
    arm = getattr(designs, name)()
    base, tip = arm.profile.radius([0.0, arm.length])
    radius = f"{base:g}" if base == tip else f"{base:.4g} to {tip:.4g}"
    cells = f"[`{name}`](#{name})", f"{arm.length:g}", radius, str(arm.bundles), *row
    return f"| {' | '.join(cells)} |\n"


def _section(name: str) -> str:
    summary, _, rest = (inspect.getdoc(getattr(designs, name)) or "").partition("\n\n")
    notes = rest.partition("\nArgs:")[0].partition("\nRaises:")[0].strip()
    picture = f"![{name}: section, arm at rest, cloud with shapes](images/gallery/{name}.png)"
    lines = ["", f"## {name}", "", *_linked(summary), "", picture, "", *_linked(notes), ""]
    return "\n".join(lines)


def _linked(text: str) -> Iterator[str]:
    """Lines with the keys of the literature as links."""
    for line in text.splitlines():
        yield re.sub(
            r"\[([A-Z]\w+)\]", lambda key: f"[{key[1]}](references.md#{key[1].lower()})", line
        )


def main(names: Sequence[str]) -> None:
    """Draw, and without names compute everything too."""
    for name in names or designs.__all__:
        draw(name)
    if not names:
        rows = {name: measured(name) for name in designs.__all__}
        PAGE.write_text(page(rows), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
