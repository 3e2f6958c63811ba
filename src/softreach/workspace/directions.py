"""From how many sides the tip can come to a place: the spread of its tangent d3 there."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap, TipStatus
from softreach.sampling import cube_blocks, sample_cube
from softreach.schema import provenance
from softreach.support import parallel
from softreach.support.arguments import POSITIVE, as_number
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput
from softreach.workspace.image import Lattice

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["direction_spread"]


_BLOCK = 1 << 15
_PER_CELL = 64  # samples in a cell of the bounding box, on average
_STEPS = 32  # the cone is then too wide by some percent at most
_TRIED = 4096  # activations of a loaded arm that must all come to rest


def direction_spread(
    arm: Manipulator | TipMap,
    *,
    n: int = 1 << 19,
    cell: float | None = None,
    seed: int = 0,
    tol: float = 1e-6,
) -> xr.Dataset:
    """The solid angle of the smallest cone that holds the tip directions d3 in each cell.

    From a cloud of activations (Sobol). For three bundles hardly more than one direction leads to
    each place, and what is seen is how much it varies within a cell; the fourth opens the cone. The
    axis is that of the smallest ball around the directions (Bădoiu and Clarkson, 2003).

    What limits it: the cone around the samples is found to some percent, never too narrow; but few
    samples hardly meet the extreme directions, so that a cell with less than some dozens has too
    narrow a cone. No error is stated, as none can be had from the samples alone: compare with twice
    as many.

    Volumes follow: ``spread.attrs["cell"] ** 3 * (spread.solid_angle > 0.1).sum()``.

    Args:
        arm: The design, or its tip map.
        n: Number of samples, a power of two.
        cell: Edge of a cell [m]; by default 64 samples would fall in each of the bounding box.
        seed: Seed of the sampler.
        tol: Largest tip error, in L.

    Returns:
        Dataset over cell centers x, y, z [m]: `solid_angle` [sr], 0 for one sample and NaN for
        none, at most 4π; `samples`, their number.

    Raises:
        InvalidInput: An argument out of range.
    """
    cell = None if cell is None else as_number("cell", cell, POSITIVE._replace(unit="m"))
    rod = _all_stable(tip_map(arm, tol))
    tips, directions = _tips_and_directions(rod, sample_cube("sobol", n, rod.box.bundles, seed))
    if cell is None:
        cell = float(np.cbrt(np.prod(np.ptp(tips, axis=0).clip(1e-3 * rod.length)) * _PER_CELL / n))
    lattice = Lattice.around(tips, cell)
    i, j, k = np.rint(lattice.coordinates(tips)).astype(int).T
    place = (i * lattice.shape[1] + j) * lattice.shape[2] + k
    order = np.argsort(place, kind="stable")
    cells, starts = np.unique(place[order], return_index=True)
    angle, samples = np.full(lattice.shape, np.nan), np.zeros(lattice.shape, np.int64)
    angle.flat[cells] = _cones(directions[order], starts)
    samples.flat[cells] = np.diff(starts, append=n)
    drawn = {"n": n, "sampler": "sobol", "seed": seed, "tol": rod.tol}
    return _dataset(lattice, angle, samples).assign_attrs(
        {**provenance(rod.arm, rod.frame), **drawn}
    )


def _all_stable(rod: TipMap) -> TipMap:
    """The map itself, if all of a sample of its activations have a stable equilibrium.

    Raises:
        InvalidInput: Some have none.
    """
    if rod.supports_unstable:
        lost, tried = _lost(rod)
        if lost:
            fault = f"{lost} of {tried} activations tried have no stable equilibrium"
            allowed = "such that every activation has one"
            hint = "lighten the load or narrow the bounds; a cloud says which samples have one"
            raise InvalidInput("loads", fault, allowed, hint)
    return rod


@lru_cache(maxsize=64)
def _lost(rod: TipMap) -> tuple[int, int]:
    """Number of activations without a stable equilibrium, and of those tried."""
    (cube,) = cube_blocks("sobol", _TRIED, rod.box.bundles, 0, _TRIED)
    corners = rod.box.corners() if rod.box.bundles <= 10 else np.empty((0, rod.box.bundles))
    gamma = np.concatenate([rod.box.from_cube(cube), corners])
    gamma = gamma if rod.box.bundles else gamma[:1]
    return int((rod.status(gamma) != TipStatus.STABLE).sum()), len(gamma)


def _tips_and_directions(rod: TipMap, cube: Array) -> tuple[Array, Array]:
    gamma = rod.box.from_cube(cube)
    tips, directions = np.empty((2, len(gamma), 3))
    for block in parallel.blocks(len(gamma), _BLOCK):
        position, directors = rod.frames(gamma[block], [rod.length])
        tips[block], directions[block] = position[:, 0], directors[:, 0, 2]
    return tips, directions


def _cones(directions: Array, starts: Index) -> Array:
    """Solid angle [sr] of a small cone around each run of unit vectors, shape (runs,)."""
    sizes = np.diff(starts, append=len(directions))
    axis = np.add.reduceat(directions, starts) / sizes[:, None]
    widest = np.full(len(starts), -1.0)  # cosine of the half-angle
    for step in range(2, _STEPS + 2):
        toward = np.einsum("ij,ij->i", directions, np.repeat(_unit(axis), sizes, axis=0))
        widest = np.maximum(widest, np.minimum.reduceat(toward, starts))
        # Move a little toward the direction that lies farthest off.
        off = ((directions - np.repeat(axis, sizes, axis=0)) ** 2).sum(axis=1)
        farthest = np.lexsort((off, np.repeat(np.arange(len(starts)), sizes)))[starts + sizes - 1]
        axis += (directions[farthest] - axis) / step
    return 2.0 * np.pi * (1.0 - np.minimum(widest, 1.0))


def _unit(vectors: Array) -> Array:
    """The vectors' directions; none for directions that cancel."""
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True).clip(1e-300)


def _dataset(lattice: Lattice, angle: Array, samples: Index) -> xr.Dataset:
    import xarray as xr

    dims = ("x", "y", "z")
    return xr.Dataset(
        {
            "solid_angle": (
                dims,
                angle,
                {"units": "sr", "long_name": "smallest cone of tip directions"},
            ),
            "samples": (dims, samples, {"units": "1", "long_name": "samples in the cell"}),
        },
        lattice.centers(),
        {"cell": lattice.cell},
    )
