"""Writes the table of materials in docs/design-files.md: `python -m tools.materials`."""

from __future__ import annotations

from pathlib import Path

from softreach.arm.section import MaterialRecord, material_names, material_record

PAGE = Path(__file__).parent.parent / "docs" / "design-files.md"
BEGIN, END = "<!-- table: python -m tools.materials -->\n", "<!-- end of the table -->\n"
_HEAD = "| name | E | what E is | ν [-] | ρ [kg/m³] | sources |\n|---|---|---|---|---|---|\n"
_UNITS = ((1e9, "GPa"), (1e6, "MPa"), (1e3, "kPa"))


def table() -> str:
    """The library as a table of Markdown, one material a row."""
    return _HEAD + "".join(_row(material_record(name)) for name in material_names())


def page_with_table(text: str) -> str:
    """The page with the table between its marks renewed."""
    before, rest = text.split(BEGIN)
    return before + BEGIN + "\n" + table() + "\n" + END + rest.split(END)[1]


def _row(record: MaterialRecord) -> str:
    material = record.material
    sources = dict.fromkeys(record.sources.values())
    density = "not given" if material.density is None else f"{material.density:g}"
    cells = (
        f"`{material.name}`",
        _pressure(material.young_modulus or 0.0),
        record.modulus,
        f"{material.poisson_ratio:g}",
        density,
        ", ".join(f"[{key}](references.md#{key.lower()})" for key in sources),
    )
    return "| " + " | ".join(cells) + " |\n"


def _pressure(value: float) -> str:
    scale, unit = next(pair for pair in _UNITS if value >= pair[0])
    return f"{value / scale:.4g} {unit}"


if __name__ == "__main__":
    PAGE.write_text(page_with_table(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
