"""Dexterity of the tip at each sample of a cloud, and the number of activations that reach it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.cloud.clouds import tip_map_of
from softreach.rod.tip_map import BLOCK
from softreach.schema import activation_units, cell_dataset, check_cloud, tip_cells
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["dexterity", "solution_measure"]

Signs = NDArray[np.int8]

_EVEN = ("uniform", "sobol")  # a grid has too many points on its faces


def dexterity(cloud: xr.Dataset) -> xr.Dataset:
    """Manipulability, condition number and orientation of the tip map at each sample.

    With J = ∂r/∂γ, of shape (3, m): manipulability is √det(J Jᵀ) [Yoshikawa1985], for three
    bundles |det J|, the volume that the tip sweeps per unit of activations; with fewer bundles
    √det(Jᵀ J), the area or length. It vanishes, and the condition number is infinite, on a fold.
    Under loads J is that of the equilibrium; of samples without a stable one all is NaN
    and the orientation 0.

    Args:
        cloud: A cloud; its design and tolerance are in its attributes. It is read in blocks.

    Returns:
        Dataset over `sample`: `manipulability`, `condition` [-] and, for three bundles,
        `orientation`, the sign of det J. The unit of manipulability is m³ over that of three
        inputs, as "m3/N3" for tendons (m² over two, m over one), and "m3" for strains; more than
        three inputs that differ in their units are "mixed".

    Raises:
        InvalidInput: The dataset is no cloud.
    """
    import xarray as xr

    check_cloud(cloud)
    tip_map, n = tip_map_of(cloud), cloud.sizes["sample"]
    if not tip_map.box.bundles:
        raise InvalidInput("bundles", 0, "1 or more: nothing moves the tip")
    measure, condition = np.empty(n), np.empty(n)
    sign = np.empty(n, np.int8)
    for rows in parallel.blocks(n, 8 * BLOCK):
        _, slope = tip_map.tips_and_slopes(cloud.activation[rows].values)
        results = slope, measure[rows], condition[rows], sign[rows]
        parts = parallel.blocks(len(slope), 4096)
        parallel.run(partial(_measure, *(each[part] for each in results)) for part in parts)
    unit = manipulability_unit(activation_units(cloud["activation"]))
    status = {"status": cloud.coords["status"]} if "status" in cloud.coords else {}
    result = xr.Dataset(coords=status, attrs=cloud.attrs)
    result["manipulability"] = ("sample", measure, {"units": unit, "long_name": "√det(J Jᵀ)"})
    about = {"units": "1", "long_name": "condition of J", "scale": "log"}
    result["condition"] = ("sample", condition, about)
    if tip_map.box.bundles == 3:
        result["orientation"] = ("sample", sign, {"units": "1", "long_name": "sign of det J"})
    return result


def solution_measure(cloud: xr.Dataset, *, cell: float | None = None) -> xr.Dataset:
    """Number of activations that reach each place, or the size of the family that they form.

    For three bundles it is the number of activations that reach a place; with four they form
    curves in the activation box, whose length this is; with five surfaces, whose area; and so on.
    No inverse problem is solved: by the coarea formula ([Federer1969], 3.2.12) the integral of that
    measure over a cell is ∫ √det(J Jᵀ) dγ over the activations that lead into it, here the mean
    over a cloud that fills the activation box evenly. Values are means over a cell; a cell that
    the border of the reachable set cuts has a mean over its empty part too. Activations without a
    stable equilibrium reach nothing.

    Args:
        cloud: A cloud of three bundles or more, sampled evenly: uniform or sobol.
        cell: Edge of the cells [m]; None for L/20.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `solution_measure`, 0 where no tip is, and
        `solution_measure_error`, its standard error for independent samples; those of a Sobol
        sequence are better. Both are numbers [-] for three bundles, and in the unit of m - 3 inputs
        for more.

    Raises:
        InvalidInput: The dataset is no cloud, of fewer bundles, of one that cannot be activated, or
            sampled unevenly; cells that are not positive or too many.
    """
    check_cloud(cloud)
    space, n = tip_map_of(cloud).box, cloud.sizes["sample"]
    if space.bundles < 3:
        raise InvalidInput("bundles", space.bundles, "3 or more: fewer fill no cell")
    if (sampler := cloud.attrs.get("sampler")) not in _EVEN:
        raise InvalidInput("sampler", sampler, f"one of {', '.join(_EVEN)}")
    if not (box := float(np.prod(space.widths))):
        raise InvalidInput("activation_bounds", space.bounds, "lower < upper for every bundle")
    grid = tip_cells(cloud, cell)
    # theory (43)
    weight = dexterity(cloud)["manipulability"].values
    total, squares = grid.sum(weight), grid.sum(weight * weight)
    scale, scatter = box / n / grid.volume, np.sqrt((squares - total**2 / n).clip(0.0))
    unit = _product(activation_units(cloud["activation"]), space.bundles - 3) or "1"
    name = {"units": unit, "long_name": "activations that reach a place: number, length, area, ..."}
    error = {"units": unit, "long_name": "standard error of solution_measure"}
    return cell_dataset(
        grid,
        solution_measure=(scale * total, name),
        solution_measure_error=(scale * scatter, error),
    ).assign_attrs(cloud.attrs)


def manipulability_unit(inputs: Sequence[str], length: str = "m") -> str:
    """Unit of √det(J Jᵀ), such as "m3/N3", from the units of the inputs and of lengths."""
    rank = min(len(inputs), 3)
    return "/".join(filter(None, (_power(length, rank), _product(inputs, rank))))


def _product(inputs: Sequence[str], count: int) -> str:
    """Unit of the product of so many inputs; empty for numbers."""
    kinds = dict.fromkeys(inputs)
    if not count or list(kinds) == ["1"]:
        return ""
    if len(kinds) == 1:
        return _power(inputs[0], count)
    if count < len(inputs):
        return "mixed"
    units = [_power(unit, inputs.count(unit)) for unit in kinds if unit != "1"]
    return units[0] if len(units) == 1 else f"({' '.join(units)})"


def _power(unit: str, count: int) -> str:
    return unit if count == 1 else f"{unit}{count}"


def _measure(slope: Array, measure: Array, condition: Array, sign: Signs) -> None:
    known = np.asarray(np.isfinite(slope).all(axis=(1, 2)))
    slope = np.where(known[:, None, None], slope, 0.0)
    sigma = np.linalg.svd(slope, compute_uv=False)
    sigma[~known] = np.nan
    measure[:] = sigma.prod(axis=1)  # theory (41)
    with np.errstate(divide="ignore", invalid="ignore"):  # no motion at all: 0/0 is NaN
        condition[:] = sigma[:, 0] / sigma[:, -1]
    if slope.shape[2] == 3:
        sign[:] = np.sign(np.linalg.det(slope))
