"""Injectivity of three bundles, one activation for each place: a test that is close to a proof.

A map of a box is one to one if a polynomial of its values grows with the activations (`recovery`),
or else if det J keeps its sign in the box and no two points of the boundary meet. All is bounded on
cells, from samples with a margin for what may lie between them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy
from softreach.support.progress import Progress
from softreach.workspace.flux import box_slopes, cross_products, grid_faces, signed_volume
from softreach.workspace.grid import (
    cube_grid,
    grid_stretches,
    grid_tips,
    least_in_cells,
    second_differences,
)
from softreach.workspace.image import Image, Lattice, image_of
from softreach.workspace.measure import Estimate, extrapolated_hull
from softreach.workspace.recovery import recovers
from softreach.workspace.solid import ReachableSolid

_LIMIT = 0.8  # of 1, for slopes between the samples
_POWERS = 6
_WORST = 100  # vertices of the boundary that are looked at first
_UNKNOWN, _NO, _YES = -1, 0, 1
_FIRST = 4  # patches along each side of a face to begin with
_HALVINGS = 6
_MOST_PAIRS = 200_000
_FACE_MARGIN = 1.25  # on differences of slopes, for those between the vertices
_CELLS = (4, 8, 16)  # along each axis; the first finds nearly every fold, for next to nothing
_RECOVERED = 8  # of which polynomials are tried first


def is_injective(rod: TipMap) -> bool:
    """True if the map of a box of three free bundles is found to be one to one.

    False means that it is not or that this is not clear. Arms that may lose their stability are not
    judged: what is stable between samples is not known. Nor are maps with kinks.
    """
    if rod.supports_unstable or not rod.is_smooth or rod.box.dimension != 3:
        return False
    for cells in _CELLS:
        tips, slopes = box_slopes(rod, cube_grid(cells))
        slopes = slopes.reshape(*(cells + 1,) * 3, 3, 3)
        stretch = np.linalg.det(slopes)
        if not stretch.min() * stretch.max() > 0.0:
            return False
        if cells == _RECOVERED and recovers(tips, slopes):
            return True
        least = least_in_cells(np.abs(stretch), second_differences(stretch))
        if cells == _CELLS[0] or not least.min() > 0.0:  # det J may have a zero within a cell
            continue
        meet = faces_meet(rod, slopes)
        if meet is not None:
            return not meet
    return False


def solid_by_flux(
    rod: TipMap, cells: int, lattice_for: Callable[[Array], Lattice], progress: Progress
) -> ReachableSolid:
    """The solid of a tip map that is one to one.

    Its convex hull is measured, and it is rasterized, when a question needs it.

    Args:
        rod: The tip map.
        cells: Of the activation grid along each axis, even: for the convex hull and the raster.
        lattice_for: The lattice to rasterize on, for the tips that it must hold.
        progress: Called with the number of grid vertices done since its last call.
    """
    flux, faces = signed_volume(rod), MappedFaces(rod, cells)
    progress(6 * cells**2 + 2)
    volume = abs(flux.value)

    def image() -> Image:
        tips, lattice = grid_tips(rod, cells), lattice_for(faces.tips)
        stretches = grid_stretches(rod, tips, cells, np.zeros((cells,) * 3, bool))
        return image_of(tips, stretches, (cells, cells, cells), lattice)

    return ReachableSolid(
        tip_map=rod,
        cells=cells,
        volume=volume,
        volume_error=flux.error,
        multiplicity={1: volume},
        multiplicity_error=0.0,
        fold_volume=0.0,
        fold_volume_error=0.0,
        route="flux",
        measure_hull=faces.convex_volume,
        rasterize=image,
    )


@dataclass(frozen=True, eq=False)
class MappedFaces:
    """Vertices of a grid of n³ cells on the faces of the box, mapped when they are first needed."""

    rod: TipMap
    cells: int

    @lazy
    def tips(self) -> Array:
        """Their tips [m], shape (6 n² + 2, 3)."""
        return self.rod.tips(self.rod.box.from_free_cube(grid_faces(self.cells)))

    def convex_volume(self) -> Estimate:
        """Volume of the convex hull [m³]."""
        even = (np.rint(grid_faces(self.cells) * self.cells) % 2 == 0).all(axis=1)
        return extrapolated_hull(self.tips, self.tips[even])


def faces_meet(rod: TipMap, slopes: Array) -> bool | None:
    """True if images of different points of the boundary of the box of three bundles may meet.

    Pairs of patches of the six faces are halved until each is settled: by a plane between both
    images, or because a window of the box that holds both patches is mapped one to one.

    Args:
        rod: The tip map.
        slopes: ∂r/∂x at a grid of the unit cube [m], shape (n + 1, n + 1, n + 1, 3, 3).

    Returns:
        None if the grid is too coarse to tell.
    """
    windows, bend = RegularWindows(slopes), _largest_bend(slopes)
    if windows.any_hopeless():
        return None
    side = _FIRST
    first, second = np.triu_indices(6 * side * side)
    for _ in range(_HALVINGS):
        which, a, b = _each_once(first, second, 6 * side * side)
        patches = _patches(rod, which, side)
        left = ~_parted(patches, a, b, bend)
        first, second, a, b = first[left], second[left], a[left], b[left]
        low, high = patches.center - patches.half, patches.center + patches.half
        both = np.minimum(low[a], low[b]), np.maximum(high[a], high[b])
        regular, hopeless = windows.hold(*both)
        if hopeless.any():
            return None
        first, second = _halved(first[~regular], second[~regular], side)
        side *= 2
        if not len(first):
            return False
        if len(first) > _MOST_PAIRS:
            return True
    return True


class RegularWindows:
    """Cubes of 2 w cells around vertices of a grid in which the map is one to one; w = 1, 2, 4, ...

    Theory (82): with J0 = U Σ Vᵀ in the middle, E is the largest |Σ⁻¹Uᵀ (J - J0) V| in the window,
    entry by entry. If its spectral radius is below 1 every matrix within these bounds is regular,
    that of the mean value theorem too, which takes the difference of two activations to that of
    their tips [Neumaier1990].

    Args:
        slopes: ∂r/∂x at the grid of the unit cube, shape (n + 1, n + 1, n + 1, 3, 3).
    """

    def __init__(self, slopes: Array) -> None:
        self._cells = len(slopes) - 1
        self._slopes = slopes.reshape(-1, 3, 3)
        self._columns = _columns(self._slopes)
        self._sizes = 2 ** np.arange(int(np.log2(self._cells)))
        self._known = np.full((len(self._sizes), len(self._slopes)), _UNKNOWN, np.int8)
        corners = 2 * np.indices((2, 2, 2)).reshape(3, -1).T - 1
        self._offsets = np.concatenate([corners, np.eye(3, dtype=int), -np.eye(3, dtype=int)])

    def any_hopeless(self) -> bool:
        """True if the map is not known to be one to one even in small windows at the boundary.

        Looked at are those where the map is flattest.
        """
        n = self._cells
        vertex = np.indices((n + 1,) * 3).reshape(3, -1)
        outer = np.flatnonzero(((vertex == 0) | (vertex == n)).any(axis=0))
        stretch = np.abs(np.linalg.det(self._slopes[outer]))
        worst = outer[np.argpartition(stretch, min(_WORST, len(outer) - 1))[:_WORST]]
        return not self._are_regular(np.zeros(len(worst), np.int64), worst).all()

    def hold(self, low: Array, high: Array) -> tuple[Mask, Mask]:
        """Masks of the boxes that such windows hold, and of those whose smallest is irregular.

        Args:
            low: Lowest corners of the boxes in the unit cube, shape (n, 3).
            high: Highest corners.

        Returns:
            Two arrays of shape (n,).
        """
        n = self._cells
        center = np.rint(0.5 * n * (low + high)).astype(np.int64)
        reach = np.maximum(n * high - center, center - n * low).max(axis=1)
        size = np.searchsorted(self._sizes, reach - 1e-9)
        fits = size < len(self._sizes)
        vertex = (center[:, 0] * (n + 1) + center[:, 1]) * (n + 1) + center[:, 2]
        regular = np.zeros(len(low), bool)
        regular[fits] = self._are_regular(size[fits], vertex[fits])
        return regular, fits & ~regular & (size == 0)

    def _are_regular(self, size: Index, vertex: Index) -> Mask:
        queries = np.zeros(self._known.shape, bool)
        queries[size, vertex] = True
        number, at = np.nonzero(queries & (self._known == _UNKNOWN))
        self._known[number, at] = np.where(self._judge(self._sizes[number], at), _YES, _NO)
        return self._known[size, vertex] == _YES

    def _judge(self, width: Index, vertex: Index) -> Mask:
        n = self._cells
        center = np.stack(np.unravel_index(vertex, (n + 1,) * 3))
        left, stretch, right = np.linalg.svd(self._slopes[vertex])
        back = _columns(np.swapaxes(left, 1, 2) / stretch[:, :, None])
        turn, middle = _columns(np.swapaxes(right, 1, 2)), self._columns[:, :, vertex]
        largest = np.zeros((3, 3, len(vertex)))
        for offset in self._offsets:
            other = np.clip(center + offset[:, None] * width, 0, n)
            at = (other[0] * (n + 1) + other[1]) * (n + 1) + other[2]
            change = _product(back, self._columns[:, :, at] - middle)
            np.maximum(largest, np.abs(_product(change, turn)), out=largest)
        return _spectral_bound(largest) < _LIMIT


def _columns(matrices: Array) -> Array:
    """Matrices (n, 3, 3) as (3, 3, n): short sums along the last axis cost the most."""
    return np.moveaxis(matrices, 0, 2).copy()


def _product(a: Array, b: Array) -> Array:
    """Products of matrices, all (3, 3, n)."""
    return np.stack([_times(a, column) for column in np.swapaxes(b, 0, 1)], axis=1)


def _spectral_bound(matrices: Array) -> Array:
    """An upper bound of the spectral radius of matrices (3, 3, n) >= 0 (Collatz)."""
    vector = np.ones((3, matrices.shape[2]))
    for _ in range(_POWERS):
        vector = _times(matrices, vector)
        vector = vector / vector.max(axis=0, initial=1e-300) + 1e-6
    return (_times(matrices, vector) / vector).max(axis=0)


def _times(matrices: Array, vectors: Array) -> Array:
    """Products of matrices (3, 3, n) and vectors (3, n)."""
    return matrices[:, 0] * vectors[0] + matrices[:, 1] * vectors[1] + matrices[:, 2] * vectors[2]


class _Patches(NamedTuple):
    """Squares on the faces of the unit cube, seen from their centers."""

    center: Array
    """Shape (n, 3)."""
    half: Array
    """Half widths along the three axes, one of them 0, shape (n, 3)."""
    tips: Array
    """Images of the centers [m], shape (n, 3)."""
    slopes: Array
    """∂r/∂x there [m], shape (n, 3, 3)."""


def _each_once(first: Index, second: Index, size: int) -> tuple[Index, Index, Index]:
    """Numbers below `size` that occur in pairs, and where among them the pairs are found."""
    used = np.zeros(size, bool)
    used[first] = used[second] = True
    place = np.cumsum(used) - 1
    return np.flatnonzero(used), place[first], place[second]


def _largest_bend(slopes: Array) -> Array:
    """The largest |∂²r/∂xj∂xk| on the grid [m], shape (3, 3)."""
    n = len(slopes) - 1
    bends = [np.linalg.norm(np.diff(slopes, axis=k), axis=-2).max(axis=(0, 1, 2)) for k in range(3)]
    return _FACE_MARGIN * n * np.array(bends)


def _patches(rod: TipMap, which: Index, side: int) -> _Patches:
    """Patches by number: face, row and column."""
    face, row, column = which // side**2, which // side % side, which % side
    axis, at, rows = face // 2, (face % 2).astype(float), np.arange(len(which))
    center, half = np.empty((len(which), 3)), np.full((len(which), 3), 0.5 / side)
    center[rows, axis], half[rows, axis] = at, 0.0
    center[rows, (axis + 1) % 3] = (row + 0.5) / side
    center[rows, (axis + 2) % 3] = (column + 0.5) / side
    return _Patches(center, half, *box_slopes(rod, center))


def _parted(patches: _Patches, a: Index, b: Index, bend: Array) -> Mask:
    """Mask of the pairs of patches whose images a plane parts, shape (pairs,).

    Tried are planes along either of them, and across the line between their centers.
    """
    sides = patches.slopes * patches.half[:, None, :]  # of parallelograms, halved
    bulge = 0.5 * np.einsum("ij,jk,ik->i", patches.half, bend, patches.half)
    radius = np.linalg.norm(sides, axis=1).sum(axis=1) + bulge
    between = patches.tips[b] - patches.tips[a]
    mask = _lengths(between) > radius[a] + radius[b]
    rows, axis = np.arange(len(patches.half)), np.argmin(patches.half, axis=1)
    normal = cross_products(*(patches.slopes[rows, :, (axis + k) % 3] for k in (1, 2)))
    # Along its own plane a patch reaches no farther than by its bend.
    for direction, of, tilted in ((between, None, (a, b)), (normal, a, (b,)), (normal, b, (a,))):
        left = np.flatnonzero(~mask)
        unit = direction[left if of is None else of[left]]
        unit /= _lengths(unit).clip(1e-300)[:, None]
        reach = bulge[a[left]] + bulge[b[left]]
        for each in tilted:
            reach += sum(
                abs(_products(unit, side[each[left]])) for side in np.moveaxis(sides, 2, 0)
            )
        mask[left] = np.abs(_products(unit, between[left])) > reach
    return mask


def _products(a: Array, b: Array) -> Array:
    """Scalar products of rows (n, 3), without a sum over so short an axis, which takes longer."""
    return a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2]


def _lengths(vectors: Array) -> Array:
    return np.sqrt(_products(vectors, vectors))


def _halved(first: Index, second: Index, side: int) -> tuple[Index, Index]:
    """All pairs of the quarters of two patches, each once."""
    a, b = (_quarters(each, side) for each in (first, second))
    pairs = np.stack(np.broadcast_arrays(a[:, :, None], b[:, None, :]), axis=-1).reshape(-1, 2)
    pairs = pairs[pairs[:, 0] <= pairs[:, 1]] if len(pairs) else pairs
    return pairs[:, 0], pairs[:, 1]


def _quarters(which: Index, side: int) -> Index:
    face, row, column = which // side**2, which // side % side, which % side
    rows = 2 * row[:, None] + np.array([0, 0, 1, 1])
    columns = 2 * column[:, None] + np.array([0, 1, 0, 1])
    return (face[:, None] * 2 * side + rows) * 2 * side + columns
