"""Dexterity of the tip at each sample of a cloud, and the number of activations that reach it."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.cloud.clouds import tip_map_of
from softreach.rod.tip_map import BLOCK
from softreach.schema import activation_units, cell_dataset, check_cloud, tip_cells
from softreach.support import parallel
from softreach.support.arguments import as_integer, as_number
from softreach.support.arrays import Array, Index, as_directions, as_points
from softreach.support.errors import InvalidInput, Range

if TYPE_CHECKING:
    import xarray as xr

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


def capability_map(
    cloud: xr.Dataset, *, cell: float | None = None, directions: int | ArrayLike = 100
) -> xr.Dataset:
    """Which directions the tip has in each cell of space: a capability map [Zacharias2007].

    The directions d3 of the samples' tips are counted by the nearest of some directions that
    share the sphere evenly. A direction without a sample may still be possible: more samples find
    more of them, and `inverse.directions_at` all at one place.

    Args:
        cloud: A cloud; its activations are read in blocks.
        cell: Edge of the cells [m]; None for L/20.
        directions: How many directions, or the directions themselves, shape (k, 3).

    Returns:
        Dataset over the centers x, y, z [m] of cells and over `direction`: `samples`, the number of
        them with a direction nearest to that one, and `capability`, the share of the directions
        that a cell has [-]. The coordinate `toward` (direction, axis) holds unit vectors.

    Raises:
        InvalidInput: The dataset is no cloud; cells that are not positive or too many; no such
            directions, or more than 10,000.
    """
    grid, toward = tip_cells(cloud, cell), _toward(directions)
    k, placed = len(toward), np.flatnonzero(grid.cells < np.prod(grid.shape))
    counts = np.zeros(int(np.prod(grid.shape)) * k, np.int32)
    for part in parallel.blocks(len(placed), 4 * BLOCK):
        rows = placed[part]
        nearest = (_directions(cloud, rows) @ toward.T).argmax(axis=1)
        np.add.at(counts, grid.cells[rows] * k + nearest, 1)
    samples = counts.reshape(*grid.shape, k)
    about = {"units": "1", "long_name": "share of the directions that the tip has"}
    share = (samples > 0).mean(axis=-1)
    result = cell_dataset(grid, capability=(share, about)).assign_attrs(cloud.attrs)
    return result.assign(samples=(("x", "y", "z", "direction"), samples)).assign_coords(
        toward=(("direction", "axis"), toward)
    )


def sight(cloud: xr.Dataset, place: ArrayLike, *, radius: float = 0.0) -> xr.DataArray:
    """By how much the tip of each sample points past a ball: what a camera there can see.

    Args:
        cloud: A cloud.
        place: Center of the ball [m], shape (3,).
        radius: Of the ball [m].

    Returns:
        Angles [rad] over `sample` from the direction d3 of the tip to the ball, 0 where d3 points
        at it. `cloud.tip[sight(cloud, place) <= half_view]` are the places from which a camera at
        the tip with half the angle of view `half_view` sees the middle of it.

    Raises:
        InvalidInput: The dataset is no cloud; no such place or radius.
    """
    check_cloud(cloud)
    center = as_points("place", place)[0]
    size = as_number("radius", radius, Range(0.0, unit="m"))
    angles = np.empty(cloud.sizes["sample"])
    for rows in parallel.blocks(len(angles), 4 * BLOCK):
        away = center - cloud.tip[rows].values
        distance = np.linalg.norm(away, axis=1)
        along = np.einsum("ni,ni->n", away, _directions(cloud, rows))
        off = np.arccos(np.clip(along / np.maximum(distance, 1e-300), -1.0, 1.0))
        half = np.arcsin(np.minimum(1.0, size / np.maximum(distance, 1e-300)))
        angles[rows] = np.where(distance <= size, 0.0, (off - half).clip(0.0))
    about = {"units": "rad", "long_name": "angle from the tip's direction to the ball"}
    return cloud.tip[:, 0].copy(data=angles).drop_vars("axis").rename("sight").assign_attrs(about)


def _toward(directions: int | ArrayLike) -> Array:
    """Directions given, or as many of equal shares of the sphere along a spiral."""
    if np.ndim(directions):
        return as_directions("directions", np.atleast_2d(np.asarray(directions, float)))
    count = as_integer("directions", directions, 1, 10_000)
    height = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    turn, around = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count), np.sqrt(1.0 - height**2)
    return np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)


def _directions(cloud: xr.Dataset, rows: Index | slice) -> Array:
    """Directions d3 of the tips of some samples, (n, 3)."""
    return tip_map_of(cloud).tip_directions(cloud.activation[rows].values)


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
