"""Table of a calibration: what was measured, what is predicted, and how far it is off."""

from __future__ import annotations

from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from softreach.support.arguments import as_flag, as_path
from softreach.support.files.atomic import writing
from softreach.support.files.formats import FileFormat, Formats, format_of
from softreach.support.units import LengthUnit, as_unit

if TYPE_CHECKING:
    import pandas as pd

    from softreach.calibration.calibration import Calibration

__all__ = ["TABLE", "residual_table", "write_table"]

TABLE: Formats = {".csv": FileFormat()}
"""Formats of such tables."""


def write_table(
    result: Calibration, path: str | PathLike[str], unit: str, *, overwrite: bool
) -> None:
    """Write `residual_table` as CSV."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, TABLE)
    table = residual_table(result, as_unit(unit, result.arm.length))
    with writing(path, overwrite=overwrite) as file:
        file.write(table.to_csv(index=False, float_format="%.9g", lineterminator="\n").encode())


def residual_table(result: Calibration, unit: LengthUnit) -> pd.DataFrame:
    """A row for each sample, in the order of the data, with units in the names of columns.

    Args:
        result: The calibration.
        unit: Of lengths.
    """
    import pandas as pd

    from softreach.arm.number import unit_suffix

    data, arm = result.data, result.arm
    columns: dict[str, object] = {
        "row": data.rows,
        "run": np.array(data.run_names)[data.runs],
        "held_out": result.held.astype(int),
    }
    for k, (name, own) in enumerate(zip(arm.input_names, arm.input_units, strict=True)):
        columns[f"{name}{unit_suffix(own)}"] = data.inputs[:, k]
    predicted = data.places + result.residuals
    distance = np.linalg.norm(result.residuals, axis=2)
    for m, marker in enumerate(data.marker_names):
        for words, places in (("", data.places), ("predicted_", predicted)):
            for axis in range(3):
                values = unit.of(places[:, m, axis])
                columns[f"{marker}_{words}{'xyz'[axis]}_{unit.name}"] = values
        columns[f"{marker}_error_{unit.name}"] = unit.of(distance[:, m])
    return pd.DataFrame(columns)
