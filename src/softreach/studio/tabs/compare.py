"""Comparison of the design with one that is kept: numbers, and the kept boundary in gray."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from softreach.arm.manipulator import Manipulator
from softreach.studio import markup
from softreach.studio.captions import told_error
from softreach.studio.fields import GRAY, Fields
from softreach.studio.found import Found
from softreach.studio.reach import Reach
from softreach.studio.shown_parameters import ShownParameter, named_parameters, slider_parameters
from softreach.studio.state import StudioState

_HINT = "Keep this design to see what a change of it costs and gains."
_EQUAL = 1e-9  # relative difference that is rounding
_MOST = 24  # rows of parameters; designs that differ in more are other arms altogether

Value = float | None
Candidate = tuple[Manipulator, Reach | None]


def compare(panel: Fields) -> None:
    """Keeps a design, and compares the design with it."""
    known = "design", "reference", "found.reach", "found.reference"
    panel.html(*known, content=_compared)
    keep = lambda state: state.replace(reference=state.design)
    panel.change("Keep this design", keep, "Draws its boundary in gray from now on")
    with panel.folder("kept design", "reference"):
        swap = lambda s: s.replace(design=s.reference or s.design, reference=s.design)
        panel.change("Swap", swap, "Exchanges the design and the kept design")
        forget = "Compares no more, and takes the gray boundary away"
        panel.change("Forget", lambda state: state.replace(reference=None), forget, **GRAY)


def _compared(state: StudioState, found: Found) -> str:
    now, kept = state.design, state.reference
    if kept is None:
        return markup.paragraph(_HINT)
    reaches = found.complete_reach(kept, "reference"), found.complete_reach(now)
    return comparison_html((kept, reaches[0]), (now, reaches[1]))


class Row(NamedTuple):
    """A quantity of the kept design and of the present one; None where it is not known."""

    title: str  # with its unit
    kept: Value
    now: Value
    errors: tuple[Value, Value] = (None, None)

    @property
    def change(self) -> Value:
        """From the kept design to the present one."""
        return None if self.kept is None or self.now is None else self.now - self.kept


def compared(kept: Candidate, now: Candidate) -> list[Row]:
    """What two designs reach, and the parameters with sliders, or else all, that differ."""
    rows = _differing(slider_parameters(kept[0]), slider_parameters(now[0]))
    rows = rows or _differing(named_parameters(kept[0]), named_parameters(now[0]))
    return [*_reach_rows(kept, now), *[*rows.values()][:_MOST]]


def comparison_html(kept: Candidate, now: Candidate) -> str:
    """A row for each quantity: kept, now, and the change."""
    rows = compared(kept, now)
    cells = [(row.title, *map(_digits, row[1:3], row.errors), _change_text(row)) for row in rows]
    return markup.table(["", "kept", "now", "change"], cells)


def _change_text(row: Row) -> str:
    before, now = row.errors
    if not row.change:
        return "–" if row.change is None else "="
    error = None if before is None or now is None else before + now
    text = _digits(row.change, error, "+")
    if error is None or not row.kept:
        return text
    return f"{text} ({_digits(100 * row.change / row.kept, 100 * error / row.kept, '+')} %)"


def _digits(value: Value, error: Value, sign: str = "") -> str:
    """A number to the first digit of its error; to five digits without one."""
    if value is None:
        return "–"
    usual = f"{sign}.5g"
    if error is not None and 0 < error < math.inf:
        usual = f"{sign}.{max(0, -math.floor(math.log10(error)))}f"
    return f"{value:{usual}}".replace("-", "\N{MINUS SIGN}")


def _reach_rows(kept: Candidate, now: Candidate) -> list[Row]:
    """Volume, area or length, whatever each has, in the unit of the present design, and UNR."""
    reaches, arm, rows = (kept[1], now[1]), now[0], list[Row]()
    sizes = [reach.size if reach else None for reach in reaches]
    for name, latest in {size.name: size for size in sizes if size}.items():
        same = [size if size and size.name == name else None for size in sizes]
        unit, power = arm.length_unit, latest.power
        scale, title = (unit.scale(power), unit.label(name, power)) if power else (1.0, name)
        before, after = (size and size.value / scale for size in same)
        first, second = (size and told_error(size, arm) / scale for size in same)
        rows.append(Row(title, before, after, (first, second)))
    shares = [_finite(100 * reach.unreachability) if reach else None for reach in reaches]
    if shares != [None, None]:
        before, after = (share and round(share, 2) for share in shares)
        rows.append(Row("UNR [%]", before, after))
    return rows


def _differing(kept: Sequence[ShownParameter], now: Sequence[ShownParameter]) -> dict[str, Row]:
    """Rows of the parameters whose values differ, by name."""
    before, after = ({each.name: each for each in shown} for shown in (kept, now))
    rows = {}
    for name in before | after:
        both = [_finite(each[name].shown) if name in each else None for each in (before, after)]
        known = [value for value in both if value is not None]
        if len(known) == 1 or (known and not math.isclose(*known, rel_tol=_EQUAL)):
            rows[name] = Row((after.get(name) or before[name]).label, both[0], both[1])
    return rows


def _finite(value: float) -> Value:
    return float(value) if math.isfinite(value) else None
