"""Text of a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softreach.calibration.calibration import Calibration

__all__ = ["summary_text"]

_SHOWN = {"m": ("mm", 1e3), "rad": ("°", 57.29577951308232), "1": ("", 1.0)}


def summary_text(result: Calibration) -> str:
    """Numbers with their errors, errors of the fit and of its rivals, and the verdict."""
    length, held = result.arm.length, result.held.any()
    count = len(result.data) - int(result.held.sum())
    lines = [
        f"Calibration of {len(result.names)} numbers on {count:,} samples of "
        f"{', '.join(result.data.marker_names)}, {result.seconds:.1f} s"
    ]
    lines += [f"  {line}" for line in _numbers(result)]
    lines.append(f"  fitted samples: {result.train.text(length)}")
    if held:
        lines.append(f"  held out:       {result.held_out.text(length)}")
    if len(result.data.marker_names) > 1:
        each = (f"{name} {1e3 * m.rms:.3g}" for name, m in result.by_marker.items())
        lines.append(f"  each marker, mm rms: {', '.join(each)}")
    lines.append(f"  as designed, base fitted: {result.before.text(length)}")
    for rival in result.rivals:
        errors = rival.held_out if held else rival.train
        lines.append(f"  {rival.name}, {rival.numbers} numbers: {errors.text(length)}")
    for one, other, share in result.correlated[:3]:
        lines.append(f"  hardly told apart: {one} and {other} (correlation {share:+.3f})")
    if len(far := result.outliers):
        rows = ", ".join(map(str, far[:10])) + (", ..." if len(far) > 10 else "")
        lines.append(f"  far off: rows {rows}")
    lines.append(f"  {result.verdict.sentence}")
    return "\n".join(lines)


def _numbers(result: Calibration) -> list[str]:
    sigma, free = result.uncertainty.sigma, result.fit.free.numbers
    width = max(len(number.name) for number in free)
    lines = []
    for k, number in enumerate(free):
        unit, factor = _SHOWN.get(number.unit, (number.unit, 1.0))
        value = f"{factor * result.fit.values[k]:.5g} ± {factor * sigma[k]:.2g} {unit}".rstrip()
        end = ", at its bound" if result.fit.at_bound[k] else ""
        lines.append(f"{number.name:<{width}}  {value}{end} (was {factor * number.start:.5g})")
    return lines
