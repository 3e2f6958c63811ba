"""A tip map prepared for the inverse problem: what is computed once and serves all targets.

Of three bundles the activation box in cells, and an octree over their images; of more, seeds near a
target, where searches begin.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.proofs import CoarseCells
from softreach.kernels.box.sequential_projection import MOST_IN_BINS, choose_apart, choose_in_bins
from softreach.kernels.branches.candidates import SpaceTree, sort_into_children
from softreach.kernels.image.activation_mesh import (
    ActivationMesh,
    face_planes,
    interpolation_errors,
)
from softreach.rod.rods import as_tip_map, coarsened, free_bundles, measured_bundles
from softreach.rod.tip_map import Frame, TipMap, no_equilibrium
from softreach.sampling import sample_cube
from softreach.support import parallel
from softreach.support.arguments import as_integer, as_one_of
from softreach.support.arrays import Array, Index, rows
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy
from softreach.workspace.grid import all_postures, cell_corners, cube_grid

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_CELLS = 32
_FEW = 500  # targets; to divide space for more takes less time than not to
_COARSE = 1e-3  # tolerance of the map that searches begin with
_NODES = 16  # cells along each axis of the grid on which sheets of postures are found


class Sheet(NamedTuple):
    """Postures to which activations do not lead straight from rest."""

    whole: TipMap  # the tip map of all bundles that goes on from the nearest of them
    tip_map: TipMap  # that of the free bundles
    starts: TornCells  # of searches


@dataclass(frozen=True)
class PreparedMap:
    """A tip map with cells, tree and seeds, each computed when first needed.

    Changes of activation are compared throughout, so that it counts them in their measures.
    """

    whole: TipMap
    """The tip map of all bundles, whose activations are in its `measures`."""
    cells: int = _CELLS
    """Cells along each axis of the activation box, with three free bundles."""

    @lazy
    def tip_map(self) -> TipMap:
        """The tip map of the free bundles; held ones are no variables of any search."""
        return free_bundles(self.whole)

    @lazy
    def coarse_map(self) -> TipMap:
        """The same in fewer steps, to move and compare searches; under loads the exact map."""
        return self.tip_map if self.tip_map.supports_unstable else coarsened(self.tip_map, _COARSE)

    @lazy
    def proves(self) -> bool:
        """True if what a cell of activations reaches is bounded; of loaded arms it is not."""
        return bool(np.isfinite(self.whole.farthest()))

    @property
    def dimension(self) -> int:
        """Number of free bundles."""
        return self.whole.box.dimension

    @lazy
    def _cut(self) -> tuple[ActivationMesh, TornCells]:
        return activation_cells(self.tip_map, self.cells)

    @lazy
    def sheets(self) -> list[Sheet]:
        """Sheets of other postures than those from rest, of a loaded arm of three free bundles.

        They are known at the nodes of a grid: one that is narrower than its cells may be missing.
        """
        every = all_postures(self.whole, _NODES) if self.dimension == 3 else None
        sheets, widths = list[Sheet](), self.tip_map.box.widths / _NODES
        for whole, gamma in [] if every is None else every.sheets:
            tip_map = free_bundles(whole)
            starts = TornCells.of_sheet(tip_map, gamma[:, self.whole.box.free], widths)
            sheets.append(Sheet(whole, tip_map, starts))
        return sheets

    def prepare_branches(self, count: int) -> None:
        """Compute what searches for so many targets need, once for all threads."""
        self._searched[0] += count
        if len(self.mesh.corner) and self._searched[0] > _FEW:
            _ = self.tree

    @property
    def mesh(self) -> ActivationMesh:
        """The cells of the activation box of three free bundles."""
        return self._cut[0]

    @property
    def torn_cells(self) -> TornCells:
        """Starts of searches for roots in cells without an image."""
        return self._cut[1]

    @lazy
    def tree(self) -> SpaceTree:
        """The tetrahedra of the cells whose images may cover a place."""
        return image_tree(self.mesh)

    @lazy
    def leaves(self) -> ImageLeaves:
        """Substitute for that tree until many targets are asked for."""
        return ImageLeaves(self.mesh)

    @lazy
    def _searched(self) -> list[int]:
        """Number of targets for which branches were searched."""
        return [0]

    @lazy
    def seeds(self) -> Seeds:
        """Starts of searches for a minimum."""
        return seeds(self.tip_map, self.coarse_map)

    @lazy
    def coarse_cells(self) -> CoarseCells:
        """Cells with which proofs that a target is out of reach begin."""
        return CoarseCells(self.tip_map)

    @lazy
    def face_seeds(self) -> Seeds:
        """Starts of searches for places on the boundary of the reachable set."""
        return face_seeds(self.tip_map, self.coarse_map)


def prepared_map(
    arm: Manipulator | TipMap | PreparedMap,
    tol: float = 1e-6,
    *,
    cells: int = _CELLS,
    frame: Frame = "world",
    point: str | None = None,
) -> PreparedMap:
    """Prepare an arm for `solve_inverse`; the last four are remembered.

    Args:
        arm: The design, or its tip map; what is prepared already is returned as it is.
        tol: Largest tip error, in L.
        cells: With three free bundles: cells along each axis of the activation box.
        frame: In which targets are told: that of the "world" or of the "base".
        point: Name of the marker that counts as the tip, such as that of a tool; by default that
            of the design. Of a tip map its own counts.

    Raises:
        InvalidInput: Numbers out of range, or an arm that was prepared in another frame.
    """
    cells = as_integer("cells", cells, 2, 256)
    if isinstance(arm, PreparedMap):
        if as_one_of("frame", frame, ("world", "base")) == "base" != arm.whole.frame:
            hint = "prepare the arm with this frame"
            raise InvalidInput("frame", frame, f"{arm.whole.frame}, that of what is prepared", hint)
        return arm
    return _of_map(measured_bundles(as_tip_map(arm, tol, frame=frame, point=point)), cells)


@lru_cache(maxsize=4)
def _of_map(tip_map: TipMap, cells: int) -> PreparedMap:
    return PreparedMap(tip_map, cells)


def forget_prepared() -> None:
    """Free the maps that are remembered, of some 0.1 GB each."""
    _of_map.cache_clear()


_REACH = 1.5  # widths of a cell within which a root is looked for
_MOST, _MOST_OF_SHEET = 16, 4  # searches for one target
_AT_ONCE = 1 << 20  # pairs of a target and a vertex
_TORN = 0.05  # interpolation error in L beyond which corners are taken to be on different branches
_LEAF = 24  # a node with no more tetrahedra is not divided
_MOST_LEVELS = 10
_MOST_ITEMS = 8_000_000
Items = NDArray[np.int32]
_OCTANTS = np.array([[o >> 2 & 1, o >> 1 & 1, o & 1] for o in range(8)])


def activation_cells(tip_map: TipMap, cells: int) -> tuple[ActivationMesh, TornCells]:
    """Cells of the box of three free bundles, as many along each axis; those without tips apart."""
    gamma = tip_map.box.from_cube(cube_grid(cells))
    vertices, corner = _Vertices(gamma, *tip_map.tips_and_slopes(gamma)), cell_corners(cells, 3)
    mesh = _mesh(tip_map, vertices, corner)
    torn = np.zeros(len(corner), bool)
    if tip_map.supports_unstable:
        torn = np.isnan(vertices.tip[corner, 0]).any(axis=1)
        torn |= mesh.interpolation_error > _TORN * tip_map.length
    if torn.any():
        mesh = _mesh(tip_map, vertices, corner[~torn])
    vertex = np.unique(corner[torn])
    known = rows(vertices, vertex[np.isfinite(vertices.tip[vertex, 0])])
    return mesh, TornCells.at(known, tip_map.box.widths / cells)


class _Vertices(NamedTuple):
    gamma: Array
    tip: Array
    slope: Array


def image_tree(mesh: ActivationMesh) -> SpaceTree:
    """Divide space, one depth after the other, until few tetrahedra remain in each place."""
    planes, boxes = np.empty((6 * len(mesh.corner), 4, 4)), _image_boxes(mesh)
    face_planes(mesh, _rounding(mesh), planes)
    low, size = _root(boxes)
    corner, edge, nodes, listed = low[None], size, 1, 0
    first, count = np.zeros(1, np.int64), np.array([len(planes)])
    item, parts = np.arange(len(planes), dtype=np.int32), list[tuple[Index, Index, Index, Items]]()
    for depth in range(_MOST_LEVELS + 1):
        # The fullest nodes, as many as leave room for the lists, which are four times as long.
        counts = np.sort(count)[::-1]
        affordable = listed + 3 * np.cumsum(counts) + counts.sum() <= _MOST_ITEMS
        largest = 0 if affordable.all() else int(counts[np.argmin(affordable)])
        many = (count > max(_LEAF, largest)) & (depth < _MOST_LEVELS)
        child, kept = np.zeros(len(many), np.int64), np.where(many, 0, count)
        child[many] = nodes + 8 * np.arange(np.count_nonzero(many))
        nodes += 8 * np.count_nonzero(many)
        parts.append((child, listed + np.cumsum(kept) - kept, kept, item[np.repeat(~many, count)]))
        listed += int(kept.sum())
        if not many.any():
            break
        edge /= 2
        places = corner[many], edge, first[many], count[many], item
        first, count, item = _divided(planes, boxes, *places)
        corner = (corner[many][:, None] + edge * _OCTANTS).reshape(-1, 3)
    return SpaceTree(planes, boxes, low, size, *map(np.concatenate, zip(*parts, strict=True)))


def _divided(
    planes: Array, boxes: Array, corner: Array, edge: float, first: Index, count: Index, item: Items
) -> tuple[Index, Index, Items]:
    """Where lists of the eight children of each node begin, their lengths, and all lists."""
    counts, meets = np.zeros((len(first), 8), np.int64), np.empty(len(item), np.uint8)
    arguments = planes, boxes, corner, edge, first, count, item, meets
    sort_into_children(*arguments, counts, counts, np.empty(0, np.int32))
    starts = (np.cumsum(counts) - counts.ravel()).reshape(counts.shape)
    items = np.empty(int(counts.sum()) + 1, np.int32)
    sort_into_children(*arguments, np.empty_like(counts), starts, items)
    return starts.ravel(), counts.ravel(), items[:-1]


class ImageLeaves:
    """Trees that are not divided: for few targets, of no more than what may cover them."""

    def __init__(self, mesh: ActivationMesh) -> None:
        self._mesh, self._boxes, self._rounding = mesh, _image_boxes(mesh), _rounding(mesh)
        self._low, self._high = np.ascontiguousarray(np.moveaxis(self._boxes, 0, 2))
        self._root = _root(self._boxes)

    def around(self, targets: Array) -> SpaceTree:
        """The tetrahedra of cells in whose boxes some targets (t, 3) lie; planes of no others."""
        mesh, near = self._mesh, np.zeros(len(self._boxes), bool)
        for place in targets[:, :, None]:
            near |= ((self._low <= place) & (place <= self._high)).all(axis=0)
        cells = np.flatnonzero(near)
        of_cells = ActivationMesh(*mesh[:3], *(values[cells] for values in mesh[3:]))
        some, planes = np.empty((len(cells), 6, 4, 4)), np.empty((len(near), 6, 4, 4))
        face_planes(of_cells, self._rounding, some.reshape(-1, 4, 4))
        planes[cells] = some
        item = (6 * cells[:, None] + np.arange(6)).astype(np.int32).ravel()
        node, planes = np.zeros(1, np.int64), planes.reshape(-1, 4, 4)
        return SpaceTree(planes, self._boxes, *self._root, node, node, node + len(item), item)


class TornCells(NamedTuple):
    """Vertices with tips of cells without an image: a corner has no tip or is on another branch.

    They begin searches for the targets that their linearization sees within about a cell.
    """

    gamma: Array  # activations [-], (n, 3)
    tip: Array  # their tips [m], (n, 3)
    inverse: Array  # inverses of ∂r/∂γ there, in widths of a cell [1/m], (n, 3, 3)
    most: int = _MOST  # searches for one target

    @classmethod
    def at(cls, vertices: _Vertices, widths: Array) -> TornCells:
        """Vertices of cells of these widths, shape (3,)."""
        inverse = np.empty_like(vertices.slope)
        if len(inverse):
            inverse[:] = np.linalg.pinv(vertices.slope * widths)
        return cls(vertices.gamma, vertices.tip, inverse)

    @classmethod
    def of_sheet(cls, tip_map: TipMap, gamma: Array, widths: Array) -> TornCells:
        """Places (n, 3) on a sheet in cells of these widths; its steep edges are seen from afar."""
        vertices = _Vertices(gamma, *tip_map.tips_and_slopes(gamma))
        known = rows(vertices, np.isfinite(vertices.tip[:, 0]))
        return cls.at(known, 2.0 * widths)._replace(most=_MOST_OF_SHEET)

    def starts(self, targets: Array) -> tuple[Index, Array]:
        """Number of the target and activation of each start, sorted by target."""
        owners, starts = [np.empty(0, np.int64)], [np.empty((0, 3))]
        size = max(1, _AT_ONCE // max(len(self.tip), 1))
        for first in range(0, len(targets) if len(self.tip) else 0, size):
            away = targets[first : first + size, None] - self.tip
            step = np.abs(np.einsum("nij,tnj->tni", self.inverse, away)).max(axis=2)
            count = min(self.most, step.shape[1])
            vertex = np.argpartition(step, count - 1, axis=1)[:, :count]
            near = np.take_along_axis(step, vertex, axis=1) <= _REACH
            owners.append(np.nonzero(near)[0] + first)
            starts.append(self.gamma[vertex[near]])
        return np.concatenate(owners), np.concatenate(starts)


def _mesh(tip_map: TipMap, vertices: _Vertices, corner: Index) -> ActivationMesh:
    error, remainder = np.empty(len(corner)), np.empty(len(corner))
    interpolation_errors(*vertices, corner, error, remainder)
    error += 1e-9 * tip_map.length  # rounding must not put a target between two tetrahedra
    first, *others = (vertices.slope[corner[:, k]] for k in (0, 7, 1, 2, 4))
    change = np.sum([np.sqrt(((each - first) ** 2).sum((1, 2))) for each in others], axis=0)
    return ActivationMesh(*vertices, corner, error, remainder, change)


def _image_boxes(mesh: ActivationMesh) -> Array:
    images = mesh.tip[mesh.corner]
    error = mesh.interpolation_error[:, None]
    return np.stack([images.min(axis=1) - error, images.max(axis=1) + error], 1)


def _root(boxes: Array) -> tuple[Array, float]:
    """Lowest corner and edge of a cube round all boxes [m]."""
    low = boxes[:, 0].min(axis=0)
    return low, float((boxes[:, 1].max(axis=0) - low).max())


def _rounding(mesh: ActivationMesh) -> float:
    """Distance beyond its faces at which a tetrahedron may still cover a place [m]."""
    return 1e-9 * float(np.nanmax(mesh.tip) - np.nanmin(mesh.tip))


_MOST_SEEDS = 150_000  # seeds on a grid of the box
_DIMENSIONS = 6  # from which on a grid is too coarse to be worth more than a low-discrepancy set
_SOBOL = 1 << 17
_FACE_DIMENSION = 2  # of faces whose images bound the reachable set
_MOST_ON_FACES = 60_000
_SEED = 0
_CANDIDATES = 24
_STARTS = 3
_IN_BIN, _BINS = 4, 512  # seeds in a bin, roughly, and the most bins along an axis
_BLOCK = 256
_DAMPING = 1e-5  # of a Gram matrix, part of its trace
_APART = 0.15  # of the ranges: two starts lead to different minima

_Grid = tuple[Array, float, tuple[int, int, int]]


class Seeds:
    """Activations with known tips."""

    def __init__(self, gamma: Array, tip: Array, coarse: TipMap) -> None:
        """Keep activations (n, m) and their tips (n, 3) [m], and a map by which seeds are moved."""
        self.gamma, self.tip, self.scales, self._coarse = gamma, tip, coarse.box.scales, coarse

    @lazy
    def tree(self) -> KDTree:
        """The tips."""
        from scipy.spatial import KDTree

        return KDTree(self.tip)

    @lazy
    def _bins(self) -> tuple[np.ndarray, Index, _Grid]:
        """Seeds bin by bin of their tips, the first row of each bin, and the bins."""
        corner, extent = self.tip.min(axis=0), np.ptp(self.tip, axis=0)
        extent = np.maximum(extent, 1e-3 * extent.max() + 1e-300)
        width = float(np.cbrt(extent.prod() * _IN_BIN / len(self.tip)))
        width = max(width, float(extent.max()) / _BINS)
        nx, ny, nz = (int(n) for n in extent // width + 1)
        place = (self.tip - corner) / width
        bins, count = _bins_of(place, (nx, ny, nz)), nx * ny * nz
        first = np.zeros(count + 1, np.int64)
        first[1:] = np.bincount(bins, minlength=count).cumsum()
        order = bins.argsort(kind="stable")
        gamma, place = self.gamma[order], place[order]
        slope = self._coarse.tips_and_slopes(gamma)[1] * (self.scales / width)
        gram = np.einsum("nij,nkj->nik", slope, slope)
        size = np.trace(gram, axis1=1, axis2=2)[:, None, None]
        # Slack tendons move no tip, so that nothing is moved to a target there.
        inverse = np.linalg.inv(gram + np.where(size == 0.0, 1.0, _DAMPING * size) * np.eye(3))
        half = inverse[:, *np.tril_indices(3)]
        columns = np.concatenate([gamma, place, slope.reshape(len(gamma), -1), half], axis=1)
        return columns.astype(np.float32), first, (corner, width, (nx, ny, nz))

    def near(
        self, targets: Array, near: Array, count: int, most: int, least_distance: float
    ) -> tuple[Index, Array]:
        """Numbers of targets (t, 3) [m], and seeds with tips nearby, closest to activations (t, m).

        Chosen twice: after each is moved to where its linearized tip meets the target, and as they
        are. At least `count` are looked at; of either kind a target gets `most` that lie apart.
        """
        seeds, first, (corner, width, shape) = self._bins
        places, m = (targets - corner) / width, near.shape[1]
        # Targets that follow each other look at the same seeds.
        order = _bins_of(places, shape).argsort(kind="stable")
        places, near = places[order], near[order]
        starts = np.empty((len(targets), 2, most, m))
        limits = self._coarse.box
        box = limits.low.copy(), limits.high.copy(), limits.scales.copy()

        def task(block: slice) -> None:
            keys = np.empty((2, MOST_IN_BINS))
            # Longer than a power of two, as columns would share places in the cache.
            ends = np.empty((2, m, MOST_IN_BINS + 8))
            numbers = (keys, keys.view(np.int64)), np.empty(MOST_IN_BINS)
            room = np.empty(MOST_IN_BINS, np.int64), ends, *numbers
            wanted = near[block], box, count, least_distance, room
            choose_in_bins(seeds, first, shape, places[block], *wanted, starts[block])

        parallel.run(partial(task, block) for block in parallel.blocks(len(targets), _BLOCK))
        starts[order] = starts.copy()
        owner, kind, slot = np.nonzero(~np.isnan(starts[..., 0]))
        return owner, starts[owner, kind, slot]

    def nearest(self, targets: Array, count: int = _CANDIDATES) -> Array:
        """Activations whose tips are nearest to each target, nearest first, (t, count, m)."""
        count = min(count, len(self.tip))
        rows = np.asarray(self.tree.query(targets, k=count)[1], np.int64)
        return self.gamma[rows.reshape(-1, count)]

    def starts(
        self, candidates: Array, most: int = _STARTS, least_distance: float = _APART
    ) -> tuple[Index, Array]:
        """Numbers of targets and a few candidates (t, k, m) of each, best first, that lie apart."""
        chosen = np.zeros(candidates.shape[:2], bool)
        choose_apart(candidates, self.scales, most, least_distance, chosen)
        return np.nonzero(chosen)[0], candidates[chosen]


def _bins_of(places: Array, shape: tuple[int, int, int]) -> Index:
    """Number of the bin of each place (n, 3) in widths, or of the bin nearest to it."""
    bins = np.clip(places, 0.0, np.array(shape) - 1.0).astype(np.int64)
    return bins @ np.array([shape[1] * shape[2], shape[2], 1])


def seeds(tip_map: TipMap, coarse: TipMap) -> Seeds:
    """Seeds on a grid over the box, or a low-discrepancy set where a grid is too coarse."""
    box, m = tip_map.box, tip_map.box.dimension
    if m == 0:
        gamma = np.empty((1, 0))
    elif m <= _DIMENSIONS:
        gamma = box.from_cube(np.array(sample_cube("grid", int(_MOST_SEEDS ** (1 / m)) ** m, m)))
    else:
        gamma = box.from_cube(np.array(sample_cube("sobol", _SOBOL, m)))
    samples = _with_tips(tip_map, gamma, coarse)
    if not len(samples.gamma):
        raise no_equilibrium(len(gamma))
    return samples


def face_seeds(tip_map: TipMap, coarse: TipMap) -> Seeds:
    """Seeds at corners of the box, on edges, and on faces with two free bundles."""
    box, m = tip_map.box, tip_map.box.dimension
    rng, count = np.random.default_rng(_SEED), _MOST_ON_FACES
    corner = rng.integers(0, 2, (count, m)).astype(float)
    dimension = rng.integers(0, min(m, _FACE_DIMENSION) + 1, count)
    free = rng.random((count, m)).argsort(axis=1).argsort(axis=1) < dimension[:, None]
    gamma = box.from_cube(np.where(free, rng.random((count, m)), corner))
    return _with_tips(tip_map, gamma, coarse)


def _with_tips(tip_map: TipMap, gamma: Array, coarse: TipMap) -> Seeds:
    tip = tip_map.tips(gamma)
    known = np.isfinite(tip[:, 0])
    return Seeds(gamma[known], tip[known], coarse)
