"""The boundary of a folded set as smooth sheets: images of faces of the box and of det J = 0.

Both are meshed by themselves, faces parted where det J changes its sign. What has reach on both
sides is then cut away, along lines that bisection finds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from softreach.geometry.surface import Surface, compact_surface, level_set
from softreach.picture.zbuffer import vertex_normals
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Faces, Mask
from softreach.workspace.grid import box_slopes, cube_grid
from softreach.workspace.image import Image
from softreach.workspace.measure import face_triangles, grid_faces

_FACE_CELLS = 40
_FOLD_CELLS = 24
_SECANTS = 3
_HALVINGS = 7
_ASIDE = 0.02  # cells of the lattice beside a face where is looked for the reach
_ROUGH = 0.5  # of second differences: by so much the fold of a linear image is off
_NEAR = 3.0  # cells of the grid from a fold within which a face may be beneath it
_STEP = 1e-3  # of the cube, for differences along the kernel of J
_PASSES = 8  # of which the first two leave a twentieth of the turned faces


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Sheets(Surface):
    """A boundary for pictures: sheets that end where they meet, and the lines there."""

    lines: NDArray[np.int32]
    """Edges of the box, folds and crossings, as pairs of vertices, shape (n, 2)."""
    activation: Array | None
    """Activation that leads to each vertex [unit of each bundle], shape (v, bundles); None where it
    is not known."""

    @classmethod
    def of(cls, surface: Surface) -> Self:
        """A surface of which no more is known."""
        none = np.empty((0, 2), np.int32)
        return cls(vertices=surface.vertices, faces=surface.faces, lines=none, activation=None)


def unfolded(surface: Surface) -> Surface:
    """A closed surface whose slivers that look the other way are turned back, for pictures.

    A surface through a raster has some at every other cell: a thirtieth of a face large, which are
    seen as specks. Their vertices go half of the way to the middle of those beside them.
    """
    vertices, faces = surface.vertices.copy(), surface.faces
    ends, others = (faces[:, order].ravel() for order in ([0, 1, 2, 0, 1, 2], [1, 2, 0, 2, 0, 1]))
    count = np.bincount(ends, minlength=len(vertices)).clip(1)[:, None]
    for _ in range(_PASSES):
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        normals = vertex_normals(vertices, faces)[faces]
        ahead = np.einsum("fki,fi->fk", normals, np.cross(b - a, c - a))
        if not len(moved := np.unique(faces[(ahead < 0.0).any(axis=1)])):
            break
        sums = [np.bincount(ends, x[others], len(vertices)) for x in vertices.T]
        vertices[moved] += 0.5 * ((np.stack(sums, axis=1) / count)[moved] - vertices[moved])
    return replace(surface, vertices=vertices)


def outer_sheets(tip_map: TipMap, image: Image) -> Sheets:
    """The faces and folds that bound the image of three free bundles on one smooth branch."""
    beside = _Beside(tip_map, image)
    (on_faces, face_parts), (on_fold, fold_parts) = _parted_faces(tip_map), _fold(tip_map)
    cube = np.concatenate([on_faces, on_fold])
    faces = np.concatenate([face_parts, fold_parts + np.int32(len(on_faces))])
    is_fold = np.arange(len(cube)) >= len(on_faces)
    normals = vertex_normals(_tips(tip_map, cube), faces)

    def cut(pairs: NDArray[np.int32]) -> Array:
        share, step = np.full(len(pairs), 0.5), 0.25
        for _ in range(_HALVINGS):
            place, normal = (_between(values[pairs], share) for values in (cube, normals))
            outer = beside.are_outer(place, normal, is_fold[pairs[:, 0]])
            share, step = np.where(outer, share + step, share - step), step / 2
        return share

    faces, pairs, shares = clipped(faces, beside.are_outer(cube, normals, is_fold), cut)
    return _sheets(tip_map, np.concatenate([cube, _between(cube[pairs], shares)]), faces)


def box_sheets(tip_map: TipMap) -> Sheets:
    """The faces of the box, which bound the image of a map that is one to one."""
    cube = grid_faces(_FACE_CELLS)
    sheets = _sheets(tip_map, cube, face_triangles(cube, _FACE_CELLS))
    turned = sheets.volume < 0
    return replace(sheets, faces=sheets.faces[:, ::-1].copy()) if turned else sheets


def _sheets(tip_map: TipMap, cube: Array, faces: Faces) -> Sheets:
    cube, faces = compact_surface(cube, faces)
    activation = tip_map.box.from_free_cube(cube)
    if (driving := as_tip_map(tip_map).inputs.driving) is not None:
        activation = driving.with_dead_zones(activation)
    pairs = np.sort(np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    edges, count = np.unique(pairs, axis=0, return_counts=True)
    # Those that lie on edges of the box, or that have a triangle on one side only.
    a, b = np.moveaxis(cube[edges], 1, 0)
    level = (a == b) & ((a == 0.0) | (a == 1.0))
    lines = edges[(count == 1) | (level.sum(axis=1) >= 2)].astype(np.int32)
    return Sheets(vertices=_tips(tip_map, cube), faces=faces, lines=lines, activation=activation)


def clipped(
    faces: Faces, kept: Mask, cut: Callable[[NDArray[np.int32]], Array]
) -> tuple[Faces, NDArray[np.int32], Array]:
    """Triangles (f, 3) cut along the line between vertices that are kept and others.

    Of pairs of vertices (kept, not kept), shape (n, 2), `cut` gives the share of the way to the
    second where the line is, shape (n,). Pairs and shares are given with the triangles, whose
    vertices beyond those that were there are new, one for each pair.
    """
    count = kept[faces].sum(axis=1)
    one, two = faces[count == 1], faces[count == 2]
    (a, b, c), (p, q, r) = (
        np.take_along_axis(some, (alone.argmax(axis=1)[:, None] + np.arange(3)) % 3, axis=1).T
        for some, alone in ((one, kept[one]), (two, ~kept[two]))
    )
    pairs = np.hstack([(a, b), (a, c), (q, p), (r, p)]).T
    unique, number = np.unique(pairs, axis=0, return_inverse=True)
    shares = cut(unique.astype(np.int32)) if len(unique) else np.empty(0)
    new = number.ravel() + len(kept)
    ab, ac, qp, rp = np.split(new, np.cumsum([len(a), len(a), len(q)]))
    parts = np.hstack([faces[count == 3].T, (a, ab, ac), (q, r, rp), (q, rp, qp)]).T
    return np.ascontiguousarray(parts, np.int32), unique.astype(np.int32), shares


def _between(values: Array, share: Array) -> Array:
    """Of pairs of values, shape (n, 2, k), what lies a share of the way to the second."""
    return values[:, 0] + share[:, None] * (values[:, 1] - values[:, 0])


def _tips(tip_map: TipMap, cube: Array) -> Array:
    return tip_map.tips(tip_map.box.from_free_cube(cube))


def _dets(tip_map: TipMap, cube: Array) -> Array:
    return np.linalg.det(box_slopes(tip_map, cube)[1])


def _parted_faces(tip_map: TipMap) -> tuple[Array, Faces]:
    """The faces of the box with outward triangles, each wholly of one sign of det J."""
    cube = grid_faces(_FACE_CELLS)
    faces, dets = face_triangles(cube, _FACE_CELLS), _dets(tip_map, cube)
    cut = partial(_zeros, tip_map, cube, dets)
    positive, pairs, shares = clipped(faces, dets > 0, cut)
    negative, more, other = clipped(faces, dets <= 0, cut)
    # each part has its own copies: across the fold the surface does not go on
    first = np.concatenate([cube, _between(cube[pairs], shares)])
    second = np.concatenate([cube, _between(cube[more], other)])
    flipped = negative[:, ::-1] + np.int32(len(first))
    return compact_surface(
        np.concatenate([first, second]), np.concatenate([positive, flipped]).astype(np.int32)
    )


def _zeros(tip_map: TipMap, cube: Array, dets: Array, pairs: NDArray[np.int32]) -> Array:
    """Shares of the way between vertices where det J = 0, by regula falsi (Illinois)."""
    low, high = np.zeros(len(pairs)), np.ones(len(pairs))
    at_low, at_high = dets[pairs].T
    share = _zero(at_low, at_high)
    for _ in range(_SECANTS):
        value = _dets(tip_map, _between(cube[pairs], share))
        beyond = np.sign(value) == np.sign(at_high)
        low, high = np.where(beyond, low, share), np.where(beyond, share, high)
        at_low = np.where(beyond, at_low / 2, value)
        at_high = np.where(beyond, value, at_high / 2)
        share = low + (high - low) * _zero(at_low, at_high)
    return share


def _zero(at_low: Array, at_high: Array) -> Array:
    """Shares of the way at which what is linear between values is 0; the middle where both are."""
    change = at_low - at_high
    return np.divide(at_low, change, out=np.full_like(change, 0.5), where=change != 0.0)


def _fold(tip_map: TipMap) -> tuple[Array, Faces]:
    """The places where det J = 0, with triangles whose images look away from what is folded."""
    n, grid = _FOLD_CELLS, cube_grid(_FOLD_CELLS)
    dets = _dets(tip_map, grid)
    if dets.min() >= 0 or dets.max() <= 0:
        return np.empty((0, 3)), np.empty((0, 3), np.int32)
    field = dets.reshape((n + 1,) * 3)
    places, faces = level_set(field, 0.0)
    ends = np.stack([np.floor(places), np.ceil(places)], axis=1).astype(int)
    numbers = np.stack(
        [np.ravel_multi_index(tuple(end.T), field.shape) for end in ends.swapaxes(0, 1)], axis=1
    ).astype(np.int32)
    moved = numbers[:, 0] != numbers[:, 1]
    cube = places / n
    cube[moved] = _between(grid[numbers[moved]], _zeros(tip_map, grid, dets, numbers[moved]))
    left, _, right = np.linalg.svd(box_slopes(tip_map, cube)[1])
    tips, step, normals = _tips(tip_map, cube), 0.01 * right[:, 2], left[:, :, 2]
    # Second differences point to what is folded, also those of places a little beyond the box.
    second = _tips(tip_map, cube + step) + _tips(tip_map, cube - step) - 2.0 * tips
    inward = np.einsum("ni,ni->n", second, normals)[:, None] > 0
    normals = np.where(inward, -normals, normals)
    a, b, c = np.moveaxis(tips[faces], 1, 0)
    turned = np.einsum("fi,fki->f", np.cross(b - a, c - a), normals[faces]) < 0
    faces = np.where(turned[:, None], faces[:, ::-1], faces)
    return cube, faces.astype(np.int32)


class _Beside:
    def __init__(self, tip_map: TipMap, image: Image) -> None:
        self._rod, self._image = tip_map, image
        self._n = image.grid.n
        self._grid = image.places.reshape(*(self._n + 1,) * 3, 3)
        bend = np.zeros(self._grid.shape[:3])
        for axis in range(3):
            second = np.linalg.norm(np.diff(self._grid, 2, axis), axis=-1)
            bend += np.pad(second, [(int(k == axis),) * 2 for k in range(3)], mode="edge")
        self._rough = _ROUGH * maximum_filter(bend, 3)

    def are_outer(self, cube: Array, normals: Array, fold: Mask) -> Mask:
        """Mask of the places of sheets that have nothing before them."""
        mirrored, near = np.zeros(len(cube), bool), fold.copy()
        rest = np.flatnonzero(~fold)
        mirrored[rest], near[rest] = self._beneath_fold(cube[rest])
        node = np.rint(cube * self._n).astype(int).clip(0, self._n)
        away = np.where(near, self._rough[tuple(node.T)], 0.0)
        away = np.maximum(away, _ASIDE * self._image.lattice.cell)
        before = self._linear(cube) + away[:, None] * normals
        return ~mirrored & (self._image.counts_at(before) == 0)

    def _beneath_fold(self, cube: Array) -> tuple[Mask, Mask]:
        """Masks of places of faces that a second activation reaches across a fold; of those near.

        Along the kernel k of J, det J is linear near a fold: its zero is at t = -det/slope, and
        x + 2 t k has about the same tip as x.
        """
        slopes = box_slopes(self._rod, cube)[1]
        dets, (_, sizes, right) = np.linalg.det(slopes), np.linalg.svd(slopes)
        kernel = right[:, 2]
        some = np.flatnonzero(sizes[:, 2] < 0.3 * sizes[:, 1])
        at = cube[some]
        step = np.where(((at + _STEP * kernel[some]) <= 1.0).all(axis=1), _STEP, -_STEP)
        ahead = _dets(self._rod, at + step[:, None] * kernel[some])
        with np.errstate(divide="ignore", invalid="ignore"):
            way = -dets[some] / ((ahead - dets[some]) / step)
        twin = at + 2.0 * way[:, None] * kernel[some]
        close = np.abs(way) < _NEAR / self._n
        inside = ((twin > 0.0) & (twin < 1.0)).all(axis=1)
        beneath, near = np.zeros((2, len(cube)), bool)
        beneath[some], near[some] = close & inside, close
        return beneath, near

    def _linear(self, cube: Array) -> Array:
        """Images by the map that is linear on the tetrahedra of the grid."""
        place = np.floor(cube * self._n).clip(0, self._n - 1).astype(int)
        rest, rows = cube * self._n - place, np.arange(len(cube))
        before = out = self._grid[tuple(place.T)]
        for axis in np.argsort(-rest, axis=1, kind="stable").T:
            place[rows, axis] += 1
            after = self._grid[tuple(place.T)]
            out = out + rest[rows, axis][:, None] * (after - before)
            before = after
        return out
