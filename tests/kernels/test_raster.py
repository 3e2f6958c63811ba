"""Coverage of mapped boxes: every place counted as often as it is covered, to the last bit."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.kernels.box.simplices import (
    chains,
    corner_bits,
    corner_steps,
    kuhn_simplices,
    strides,
)
from softreach.kernels.image import contour, point_cover, raster

UNIT = 64.0


def grid(cells: tuple[int, ...]) -> np.ndarray:
    """Whole coordinates of the vertices, in C order."""
    return np.array(list(itertools.product(*(range(n + 1) for n in cells))), float)


Cells = tuple[int, int, int]


def critical(vertices: np.ndarray, cells: Cells, stretches: np.ndarray) -> np.ndarray:
    star = contour.stars(cells)
    out = np.empty((len(vertices) * len(star.triangles), 5), np.int64)
    whole = np.zeros(len(vertices), bool)
    arguments = (np.array(cells), whole, 0, len(vertices), star, out)
    used = contour.critical_triangles(vertices, stretches, *arguments)
    return out[:used]


def counts(vertices: np.ndarray, cells: Cells, size: int) -> tuple[np.ndarray, ...]:
    """Cover counts and degrees at the centers UNIT · (i, j, k), i, j, k < size."""
    stretches = contour.stretches(vertices, np.array(cells))
    triangles = critical(vertices, cells, stretches)
    out = raster.empty_crossings(raster.most_crossings(vertices, triangles, UNIT, 0, 1))
    used = raster.crossings(vertices, triangles, UNIT, 2, size, out)
    cover, degree = np.zeros((2, size * size, size), np.int32)
    raster.add_counts(raster.first_crossings(out, used), cover, degree)
    return cover.reshape((size,) * 3), degree.reshape((size,) * 3)


def tetrahedra(cells: tuple[int, ...]) -> np.ndarray:
    """All tetrahedra of the triangulation, vertex by vertex."""
    steps = corner_steps(cells)
    places, faces = grid(cells), chains(3, 3)
    fits = ((places[:, None] + corner_bits(3)[faces[:, -1]]) <= np.array(cells)).all(axis=2)
    base, which = np.nonzero(fits)
    return base[:, None] + steps[faces[which]]


def holders(vertices: np.ndarray, cells: Cells, point: np.ndarray) -> list[tuple[np.ndarray, int]]:
    """The tetrahedra that hold a point, by barycentric coordinates in exact integers.

    Returns:
        Vertices of each, and 1 if the map keeps its orientation, else -1.
    """
    found = []
    for tet in tetrahedra(cells):
        corners = [[int(x) for x in vertices[v]] for v in tet]
        p = [int(x) for x in point]
        whole = _volume(*corners)
        parts = [_volume(*[p if k == i else c for k, c in enumerate(corners)]) for i in range(4)]
        if whole != 0 and all(part * whole > 0 for part in parts):
            before = _volume(*([int(x) for x in grid(cells)[v]] for v in tet))
            found.append((tet, 1 if whole * before > 0 else -1))
    return found


def _volume(a, b, c, d) -> int:
    u, v, w = ([y - x for x, y in zip(a, q, strict=True)] for q in (b, c, d))
    return (
        u[0] * (v[1] * w[2] - v[2] * w[1])
        - u[1] * (v[0] * w[2] - v[2] * w[0])
        + u[2] * (v[0] * w[1] - v[1] * w[0])
    )


@pytest.mark.parametrize("m", [1, 2, 3])
def test_the_simplices_of_a_cube_fill_it(m):
    corners = corner_bits(m)[kuhn_simplices(m)]
    volumes = np.abs(np.linalg.det(np.diff(corners, axis=1).astype(float)))
    assert len(corners) == math.factorial(m)
    assert volumes == pytest.approx(1.0)


def test_every_tetrahedron_is_listed_once():
    cells = (2, 2, 2)
    faces = np.sort(tetrahedra(cells), axis=1)
    assert len(np.unique(faces, axis=0)) == len(faces)
    # each simplex of each cell is among them
    base = np.flatnonzero((grid(cells) < 2).all(axis=1))
    simplices = base[:, None, None] + corner_steps(cells)[kuhn_simplices(3)]
    wanted = np.sort(simplices.reshape(-1, 4), axis=1)
    assert {tuple(f) for f in faces} == {tuple(f) for f in wanted}


def test_strides_count_vertices_in_c_order():
    cells = (2, 3, 4)
    assert (grid(cells) @ strides(cells) == np.arange(3 * 4 * 5)).all()


@given(seed=st.integers(0, 2**32 - 1), ties=st.booleans())
def test_a_one_to_one_image_covers_every_center_once(seed, ties):
    rng = np.random.default_rng(seed)
    cells = (3, 2, 4)
    # Vertices on centers, edges and faces through centers: every tie there is.
    spacing = 2 * UNIT if ties else 117.0
    vertices = UNIT * 3 + spacing * grid(cells)
    inner = ((grid(cells) > 0) & (grid(cells) < cells)).all(axis=1)
    shake = rng.integers(-1, 2, (inner.sum(), 3)) * (UNIT / 2 if ties else 17.0)
    vertices[inner] += shake
    cover, degree = counts(vertices, cells, 16)
    low, high = 3, (3 * UNIT + spacing * np.array(cells)) / UNIT
    centers = np.stack(np.indices((16, 16, 16)), axis=-1)
    inside = ((centers >= low) & (centers < high)).all(axis=-1)
    assert (cover == inside).all()
    assert (degree == inside).all()


@given(seed=st.integers(0, 2**32 - 1))
def test_an_affine_image_has_the_volume_of_its_determinant(seed):
    rng = np.random.default_rng(seed)
    cells = (2, 2, 2)
    matrix = rng.integers(-150, 151, (3, 3)).astype(float)
    vertices = grid(cells) @ matrix
    vertices += rng.integers(0, 64, 3) + 64 - np.floor(vertices.min(axis=0))
    cover, degree = counts(vertices, cells, 40)
    det = np.linalg.det(matrix)
    assert cover.max(initial=0) <= 1
    assert (degree == np.sign(round(det)) * cover).all()
    assert cover.sum() * UNIT**3 == pytest.approx(8 * abs(det), abs=0.25 * 40**2 * UNIT**3)


def test_translates_average_to_the_exact_volume():
    cells, matrix = (2, 1, 1), np.array([[90.0, 30, -20], [-40, 110, 50], [20, -30, 130]])
    vertices = grid(cells) @ matrix
    vertices += 64 - np.floor(vertices.min(axis=0))
    shifts = itertools.product(range(0, 64, 8), repeat=3)
    total = sum(int(counts(vertices + np.array(s), cells, 12)[0].sum()) for s in shifts)
    exact = 2 * np.linalg.det(matrix) / 8**3  # multiples of 8 sample it as a finer grid does
    assert total == pytest.approx(exact, rel=0.005)


def test_a_map_that_folds_twice_covers_twice_and_thrice():
    cells = (9, 1, 1)
    # x runs to 9, back to 3 and on to 12 (in centers): 3 to 9 are reached three times
    x = np.interp(np.arange(10), [0, 3, 6, 9], [2, 9, 3, 12]) * UNIT + 1
    y, z = 1.5 * UNIT + 4 * UNIT * grid(cells)[:, 1], 1.5 * UNIT + 4 * UNIT * grid(cells)[:, 2]
    vertices = np.column_stack([np.floor(x)[grid(cells)[:, 0].astype(int)], y, z])
    cover, degree = counts(vertices, cells, 16)
    assert cover[:, 3, 3].tolist() == [0, 0, 0, 1] + [3] * 6 + [1] * 3 + [0] * 3
    assert (degree[:, 3, 3] == (cover[:, 3, 3] > 0)).all()
    flat = vertices.copy()
    flat[:, 0] = np.floor(np.interp(grid(cells)[:, 0], [0, 5, 9], [2, 10, 4]) * UNIT) + 1
    cover, degree = counts(flat, cells, 16)
    assert cover[:, 3, 3].tolist() == [0] * 3 + [1] * 2 + [2] * 6 + [0] * 5
    assert (degree[5:11, 3, 3] == 0).all()


@given(seed=st.integers(0, 2**32 - 1))
def test_any_map_covers_what_its_tetrahedra_hold_less_those_turned_against_the_stretches(seed):
    rng = np.random.default_rng(seed)
    first, second, third = (int(n) for n in rng.integers(1, 3, 3))
    cells = (first, second, third)
    vertices = rng.integers(64, 700, (int(np.prod(np.add(cells, 1))), 3)).astype(float)
    stretches = rng.integers(-1000, 1001, len(vertices)).astype(float)
    triangles = critical(vertices, cells, stretches)
    where = rng.integers(0, 768, (5, 3)).astype(float)  # seldom on a face
    members, starts = point_cover.bin_triangles(vertices, triangles, UNIT, (12, 12))
    found = np.empty(5, np.int64)
    point_cover.cover_at(vertices, triangles, UNIT, (12, 12), members, starts, where, found)
    for point, count in zip(where, found, strict=True):
        held = holders(vertices, cells, point)
        assert count == sum(k if stretches[tet].sum() > 0 else -k for tet, k in held)


@given(seed=st.integers(0, 2**32 - 1))
def test_points_and_centers_of_any_map_are_counted_alike(seed):
    rng = np.random.default_rng(seed)
    cells = (2, 2, 1)
    vertices = rng.integers(64, 700, (18, 3)).astype(float)
    cover, degree = counts(vertices, cells, 12)
    triangles = critical(vertices, cells, contour.stretches(vertices, np.array(cells)))
    at = rng.integers(0, 12, (9, 3))
    members, starts = point_cover.bin_triangles(vertices, triangles, UNIT, (12, 12))
    found = np.empty(9, np.int64)
    arguments = (members, starts, UNIT * at, found)
    point_cover.cover_at(vertices, triangles, UNIT, (12, 12), *arguments)
    assert (found == cover[tuple(at.T)]).all()
    off = UNIT * at + [1e-3, 1e-6, 0.0]  # as a center counts: never on a face
    held = [holders(1e6 * vertices, cells, np.rint(1e6 * p)) for p in off]
    assert degree[tuple(at.T)].tolist() == [sum(k for _, k in tets) for tets in held]


def test_stretches_are_the_determinant_of_a_quadratic_map():
    cells = (3, 1, 2)
    x, y, z = grid(cells).T
    vertices = np.column_stack([8 * x + 3 * x * x, 5 * y - x, 7 * z - 2 * z * z + y])
    expected = (8 + 6 * x) * 5 * (7 - 4 * z)
    assert contour.stretches(vertices, np.array(cells)) == pytest.approx(8 * expected)
