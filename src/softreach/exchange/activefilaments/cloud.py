"""Clouds of ActiveFilaments.jl: NAME.csv and NAME_gamma.csv, without headers, a row a sample."""

from io import BufferedWriter
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np

from softreach import schema
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.cloud.clouds import design_of
from softreach.exchange.activefilaments.filament import filament_of
from softreach.rod.kinematics import tip_positions
from softreach.support.arguments import as_flag, as_path
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, counted, warn
from softreach.support.files.atomic import check_place, writing
from softreach.support.files.columns import MOST, numbers_of, read_table
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.text import read_bytes
from softreach.support.lazy import Dataset

_SAME = 1e-5  # of L; their fixed 100 steps of order five err by less
_BLOCK = 1 << 16
_ENDING = "_gamma"


def gamma_path(path: str | PathLike[str]) -> Path:
    """NAME_gamma.csv beside NAME.csv."""
    tips = Path(as_path("path", path))
    return tips.with_name(f"{tips.stem}{_ENDING}{tips.suffix}")


def read_cloud(arm: Manipulator, path: str | PathLike[str], *, tol: float = 1e-6) -> Dataset:
    """Read a cloud of ActiveFilaments.jl, and compare its tips with those that softreach computes.

    Columns of NAME_gamma.csv are the sectors of the filament that `design_script` writes for the
    arm: ring by ring, in a ring sector by sector. Where several families of fibers share a ring,
    its activations are those of the arm times their number.

    Args:
        arm: The design that the cloud was computed for.
        path: NAME.csv, with tips [m]; NAME_gamma.csv lies beside it.
        tol: Largest tip error of the tips that the file's are compared with, in L.

    Returns:
        A cloud as of `compute_cloud`, with the tips of the file; its attributes hold
        `largest_tip_difference` [m].

    Raises:
        InvalidInput: A file that is no table of finite numbers or has other columns or rows than
            the design and the other file, or a design that ActiveFilaments.jl cannot have.

    Warns:
        SoftreachWarning: Tips differ by more than 1e-5 L, or activations leave the bounds.
    """
    arm, path = a_manipulator("arm", arm), as_path("path", path)
    filament = filament_of(arm)
    activations = fspath(gamma_path(path))
    tip = _table(path, 3, "x, y, z")
    sectors = ", ".join(ring.name or "no fibers" for ring in filament.rings)
    columns = _table(activations, len(filament.columns[0]), f"the sectors of {sectors}")
    if len(tip) != len(columns):
        rows = counted(len(columns), "row")
        raise InvalidInput(activations, rows, f"{len(tip)} rows, as in {path}")
    activation = filament.from_columns(columns)
    difference = float(np.linalg.norm(tip - tip_positions(arm, activation, tol), axis=1).max())
    low, high = arm.bounds.T
    if (activation < low).any() or (activation > high).any():
        warn("activations leave the bounds of the design: widen these to cover its reachable set")
    if difference > _SAME * arm.length:
        hint = "compare its numbers, and the order and scale of its sectors, with the filament"
        off = f"tips differ by up to {difference / arm.length:.2g} L from those of this design"
        warn(f"{off}: {hint}")
    drawn: Any = {"seed": 0, "sampler": "ActiveFilaments.jl", "tol": tol}
    cloud = schema.cloud_dataset(arm, activation, tip, **drawn)
    del cloud.attrs["seed"]
    cloud.attrs["largest_tip_difference"] = difference
    return cloud


def write_cloud(cloud: Dataset, path: str | PathLike[str], *, overwrite: bool = False) -> None:
    """Write tips to NAME.csv and activations to NAME_gamma.csv, as ActiveFilaments.jl does.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, bundle) [-].
        path: NAME.csv; each file is replaced only when the new one is complete.
        overwrite: Whether they may replace files.

    Raises:
        InvalidInput: No cloud, one of an arm that ActiveFilaments.jl cannot have, or something else
            is there.
        NotWritten: It cannot be written.
    """
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    filament = filament_of(design_of(schema.check_cloud(cloud)))
    check_place(path, overwrite=overwrite)
    with writing(gamma_path(path), overwrite=overwrite) as file:
        _write(file, filament.to_columns(cloud["activation"].values))
    with writing(path, overwrite=overwrite) as file:
        _write(file, cloud["tip"].values)


def _write(file: BufferedWriter, values: Array) -> None:
    for first in range(0, len(values), _BLOCK):
        rows = values[first : first + _BLOCK].tolist()
        file.write("".join(",".join(map(repr, row)) + "\n" for row in rows).encode("ascii"))


CLOUD_PAIR: Formats = {".csv": FileFormat()}  # Format of `write_cloud`


def _table(path: str, columns: int, meaning: str) -> Array:
    table = read_table(read_bytes("file", path, MOST), path)
    if table.shape[1] != columns:
        size = counted(table.shape[1], "column")
        raise InvalidInput(path, size, f"{columns}: {meaning}")
    return np.stack([numbers_of(table, name) for name in table.columns], axis=1)
