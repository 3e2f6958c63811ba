"""Samples by the billion, counted in cells of space as they are drawn; none is kept."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.geometry.hull import convex_hull
from softreach.geometry.lattice import CellGrid
from softreach.kernels.counting import PARTS, SECTORS, tally
from softreach.rod.bending import some_corners
from softreach.rod.cuda import CudaRod, check_device_memory
from softreach.rod.inputs import activation_measures
from softreach.rod.rods import ArmMap, all_inputs, as_tip_map
from softreach.rod.tip_map import Device, Frame, TipMap
from softreach.sampling import check_sampler, counted_points, cube_blocks, sample_cube
from softreach.schema import EDGES, cell_dataset, provenance
from softreach.support import parallel
from softreach.support.arguments import as_number
from softreach.support.arrays import Array
from softreach.support.errors import NotPossible
from softreach.support.interruption import check_stopped
from softreach.support.progress import Progress, bar

if TYPE_CHECKING:
    import xarray as xr

_PILOT = 1 << 16  # samples by which the grid is laid
_MARGIN = 0.02  # of L, of the grid around them
_ON_CPU, _ON_GPU = 1 << 18, 1 << 30  # samples at a time; their numbers within are of 32 bits
_CELL = 1 / 60  # of L


def reached_cells(
    arm: Manipulator | TipMap,
    n: int,
    *,
    cell: float | None = None,
    seed: int = 0,
    tol: float = 1e-6,
    frame: Frame = "world",
    point: str | None = None,
    device: Device = "cpu",
    progress: Progress | None = None,
) -> xr.Dataset:
    """Count the tips of many samples in cells of space; memory does not grow with `n`.

    Samples are those of the sampler `counter`, the same on every device; on a GPU nothing but the
    counts leaves it.

    Args:
        arm: The design, or its tip map.
        n: Number of samples.
        cell: Edge of the cells [m]; None for L/60.
        seed: Seed of the samples.
        tol: Largest tip error, in L.
        frame: As `compute_cloud` has it.
        point: As `compute_cloud` has it.
        device: "cpu", or "cuda" for a GPU: of arms without loads, whose activations follow from
            their inputs linearly.
        progress: Called with the number of samples done since its last call; None for a bar.

    Returns:
        Dataset over the centers x, y, z [m] of cells: `count`; `density` [1/m³], the share of the
        samples per volume; `activation_distance`, the root of the mean square distance between
        two samples in a cell, in the measure of `sr.activation_distance`, NaN where there are fewer
        than two. `extreme_tip` (extreme, axis) [m] are the corners of the convex hull of the tips
        that are farthest from the middle, one in each of 262,144 sectors of directions. Attributes:
        `volume` [m³] of the cells reached, too large by about half a cell all along the border;
        `convex_volume` [m³] of that hull; `samples_outside` the grid, which is laid around the
        first 65,536 samples, or without a stable posture; `device`.

    Raises:
        InvalidInput: An argument out of range, or too many cells.
        MissingExtra: `softreach[cuda]` is not installed.
        NotPossible: There is no GPU, no driver for it, too little of its memory, or the arm is none
            that it can take.
    """
    tip_map = all_inputs(as_tip_map(arm, tol, frame=frame, point=point, device=device))
    n, seed = check_sampler("counter", n, tip_map.box.bundles, seed)
    edge = _CELL * tip_map.length if cell is None else as_number("cell", cell, EDGES)
    grid = _grid(tip_map, seed, edge)
    tallies = _Tallies(tip_map, grid)
    add = _on_cpu if tip_map.device == "cpu" else _on_gpu
    with bar("counting tips", n) as shown:
        add(tallies, n, seed, progress or shown)
    return tallies.dataset(n, seed)


class _Tallies:
    """What is counted, in the layout of the kernels; see `kernels.counting.tally`."""

    def __init__(self, tip_map: ArmMap, grid: CellGrid) -> None:
        self.tip_map, self.grid = tip_map, grid
        box, cells = tip_map.box, int(np.prod(grid.shape))
        self.measured = box.widths / activation_measures(tip_map.arm)
        self.scale = max(float((self.measured**2).sum()), 1e-300)  # of squares
        self.weights = self.measured**2 / self.scale
        middle = (grid.first + 0.5 * np.array(grid.shape)) * grid.edge
        self.farthest = float(np.linalg.norm(0.5 * np.array(grid.shape)) + 2.0) * grid.edge
        self.place = np.array([*grid.first, grid.edge, *middle, self.farthest], float)
        self.shape = np.array(grid.shape)
        self.counts = np.zeros(cells, np.int64)
        self.sums = np.zeros((cells, box.bundles + 1), np.int64)
        self.best = np.zeros(SECTORS**2, np.uint64)  # distance over the farthest, in 32 bits
        self.extreme = np.zeros(SECTORS**2, np.int64)  # the sample there

    def keep(self, ranks: NDArray[Any], first: int) -> None:
        """Keep the farthest sample of each sector, from the ranks of a block."""
        far, number = ranks >> np.uint64(32), (ranks & np.uint64(0xFFFFFFFF)).astype(np.int64)
        better = far > self.best
        self.best[better], self.extreme[better] = far[better], first + number[better]

    def dataset(self, n: int, seed: int) -> xr.Dataset:
        """The result of n samples."""
        grid, count = self.grid, self.counts
        several = np.where(count > 1, count, np.nan)
        sums = (self.sums + 0.5 * count[:, None]) / PARTS  # of what was cut, half is missing
        mean = sums[:, :-1] / several[:, None]
        spread = sums[:, -1] / several * self.scale - ((mean * self.measured) ** 2).sum(axis=1)
        distance = np.sqrt(2.0 * (spread * several / (several - 1.0)).clip(0.0))
        numbers = np.unique(self.extreme[self.best > 0])
        cube = counted_points(numbers, self.tip_map.box.bundles, seed)
        tips = self.tip_map.tips(self.tip_map.box.from_cube(cube))
        hull = convex_hull(tips)
        variables = {
            "count": (count, {"long_name": "samples", "units": "1"}),
            "density": (count / (n * grid.volume), {"long_name": "density", "units": "m-3"}),
            "activation_distance": (distance, {"long_name": "RMS activation distance"}),
        }
        shaped = {name: (v.reshape(grid.shape), about) for name, (v, about) in variables.items()}
        made = {"n": n, "seed": seed, "sampler": "counter", "tol": self.tip_map.tol}
        return (
            cell_dataset(grid, **shaped)
            .assign(extreme_tip=(("extreme", "axis"), hull.vertices, {"units": "m"}))
            .assign_attrs(
                **provenance(self.tip_map.arm, self.tip_map.frame),
                **made,
                device=self.tip_map.device,
                volume=float((count > 0).sum()) * grid.volume,
                convex_volume=hull.volume,
                samples_outside=n - int(count.sum()),
            )
        )


def _grid(tip_map: ArmMap, seed: int, edge: float) -> CellGrid:
    """Cells around the first samples and the corners of the box, with a margin."""
    box = tip_map.box
    gamma = box.from_cube(sample_cube("counter", _PILOT, box.bundles, seed))
    tips = tip_map.tips(np.concatenate([gamma, some_corners(tip_map)]))
    tips = tips[~np.isnan(tips).any(axis=1)]
    margin = _MARGIN * tip_map.length
    return CellGrid.around(np.concatenate([tips - margin, tips + margin]), edge)


def _on_cpu(t: _Tallies, n: int, seed: int, progress: Progress) -> None:
    box, dim = t.tip_map.box, t.tip_map.box.bundles
    cubes = cube_blocks("counter", n, dim, seed, _ON_CPU)
    for rows, cube in zip(parallel.blocks(n, _ON_CPU), cubes, strict=True):
        tips = t.tip_map.tips(box.from_cube(cube))
        placed = np.flatnonzero(~np.isnan(tips[:, 0]))
        ranks = np.zeros_like(t.best)
        given = (tips[placed], cube[placed], placed, t.weights, t.place, t.shape)
        tally(*given, t.counts, t.sums, ranks)
        t.keep(ranks, rows.start)
        progress(rows.stop - rows.start)


def _on_gpu(t: _Tallies, n: int, seed: int, progress: Progress) -> None:
    from numba import cuda

    from softreach.kernels.rod import cuda as kernels

    check_device_memory(t.counts.nbytes + t.sums.nbytes)
    rod = t.tip_map.rod
    assert isinstance(rod, CudaRod)
    pose = np.concatenate([t.tip_map.pose.rotation.T, [t.tip_map.pose.position]])
    given = (_table_of_cube(t.tip_map, rod.packed), rod.offset, pose)
    table, start, pose = map(cuda.to_device, given)
    about = [cuda.to_device(values) for values in (t.weights, t.place, t.shape)]
    counts, sums = cuda.to_device(t.counts), cuda.to_device(t.sums)
    kernel = kernels.cells(t.tip_map.box.bundles)
    for rows in parallel.blocks(n, _ON_GPU):
        check_stopped()
        count, ranks = rows.stop - rows.start, cuda.to_device(np.zeros_like(t.best))
        at = np.uint64(seed), np.uint64(rows.start), count
        kernel[-(-count // kernels.THREADS), kernels.THREADS](
            table, start, pose, *at, *about, counts, sums, ranks
        )
        t.keep(ranks.copy_to_host(), rows.start)
        progress(count)
    counts.copy_to_host(t.counts)
    sums.copy_to_host(t.sums)


def _table_of_cube(tip_map: ArmMap, packed: Array) -> Array:
    """The packed table of the rod in coordinates of the cube, of which γ is an affine function."""
    driving = tip_map.inputs.driving
    if driving is not None and not driving.is_affine:
        raise NotPossible(
            "device = cuda: the activations of this arm do not follow from its inputs linearly "
            '(a dead zone, a slack tendon or one given by its length); use device = "cpu"'
        )
    dim = tip_map.box.bundles
    ends = tip_map.box.from_cube(np.concatenate([np.zeros((1, dim)), np.eye(dim)]))
    gamma = tip_map.inputs.activations(ends)
    columns, rest = packed[..., :-1] @ (gamma[1:] - gamma[0]).T, packed[..., :-1] @ gamma[0]
    return np.concatenate([columns, (packed[..., -1] + rest)[..., None]], axis=-1)
