"""The boundary of a solid reachable set: as triangles, and as nodes of a rule of integration.

Lines of sight through cell centers along an axis cut the boundary at places that each stand for a
square of a cell, seen along the axis. Together those along all three axes are nodes for what flows
through the boundary, theory (98), and need no normals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter

from softreach.geometry.surface import Surface, enclosed_volume, level_set
from softreach.picture.shading import vertex_normals
from softreach.support.arrays import Array, Index
from softreach.workspace.cells import ReachedCells
from softreach.workspace.image import Image, Lattice

_AWAY, _EVENED, _FAR = 1.0, 0.7, 3.0  # cells: a level set, widths of a filter, and no farther
_CLASSES = 4  # every other line along both directions


def boundary_surface(image: Image, volume: float) -> Surface:
    """The closed surface around a volume where the field is constant, by marching cubes.

    The image of a grid is a little small where it is convex: a small offset, the same everywhere,
    gives the surface the extrapolated volume.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    surface = _level_set(image, 0.0)
    if surface.area == 0.0:
        return surface
    offset = (volume - surface.volume) / (surface.area * image.lattice.cell)
    return _level_set(image, float(np.clip(offset, -0.5, 0.5)))


def _level_set(image: Image, level: float) -> Surface:
    field, lattice = image.signed_field, image.lattice
    if not (field < level).any():
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    vertices, faces = level_set(field, level)
    return Surface(vertices=lattice.origin + lattice.cell * vertices, faces=faces)


def wrapped_surface(image: Image, volume: float) -> Surface:
    """A closed surface around a volume without teeth and holes, however thin and rough parts are.

    It is the level set one cell away from the image, evened out, each of whose vertices is then
    moved back along its normal, all as far, until the stated volume is enclosed. Gaps below two
    cells are filled.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    lattice = image.lattice
    vertices, faces = level_set(gaussian_filter(_distances(image), _EVENED), _AWAY)
    places = lattice.origin + lattice.cell * vertices
    back = _AWAY * lattice.cell * vertex_normals(places, faces)
    far, near = (enclosed_volume(places - part * back, faces) for part in (0.0, 1.0))
    part = float(np.clip((far - volume) / (far - near), 0.5, 1.5))
    return Surface(vertices=places - part * back, faces=faces)


def _distances(image: Image) -> Array:
    """From cell centers to an image, 0 inside, in cells up to three."""
    covered, surface = image.counts[0] > 0, image.critical_surface
    near = covered & ~np.asarray(binary_erosion(covered), bool)
    near[tuple(np.rint(image.lattice.coordinates(surface.vertices)).astype(int).T)] = True
    near = np.asarray(binary_dilation(near, np.ones((3, 3, 3)), iterations=2), bool) & ~covered
    centers = image.lattice.origin + image.lattice.cell * np.argwhere(near)
    distances = np.where(covered, 0.0, _FAR)
    distances[near] = np.minimum(surface.distance(centers) / image.lattice.cell, _FAR)
    return distances


@dataclass(frozen=True, eq=False)
class BoundarySamples:
    """Nodes on the boundary, with the activations that lead there."""

    cube: Array
    """In the unit cube of the free bundles, shape (n, dimension)."""
    places: Array
    """Places [m], shape (n, 3)."""
    area: Array
    """Outward area vectors [m²], shape (n, 3)."""
    group: Index
    """Number of the set of lines that each is on: an axis, and every other line, shape (n,)."""

    def derivative(self, slopes: Array, weights: Array | None = None) -> Array:
        """Derivatives of the volume, swept by the boundary, theory (98), shape (parameters,).

        By ∂r/∂p at the nodes, shape (n, 3, parameters). Weights (n,) that are 1 in a region and 0
        elsewhere give the derivative of the volume of the part of the set in that region.
        """
        area = self.area if weights is None else self.area * weights[:, None]
        return np.einsum("ni,nip->p", area, slopes)

    def noise(self, slopes: Array) -> Array:
        """Two standard deviations of `derivative` from where the lines lie, shape (parameters,).

        Every other line along both directions tells how much.
        """
        groups = np.zeros((3 * _CLASSES, slopes.shape[2]))
        np.add.at(groups, self.group, np.einsum("ni,nip->np", self.area, slopes))
        of_axes = groups.reshape(3, _CLASSES, -1)
        off = _CLASSES * of_axes - of_axes.sum(axis=1, keepdims=True)
        return np.sqrt((off**2).mean(axis=1).sum(axis=0))


def boundary_samples(image: Image | ReachedCells, sense: int = 0) -> BoundarySamples:
    """Nodes on all of the boundary of an image; the vertices of what is wrapped.

    With the orientation that the larger part of a map of three bundles keeps, 1 or -1, nodes are
    those where the image is not one to one, the boundary less what of it the degree tells, for the
    derivative of ∫ ([x is reached] - sense · d) dx, theory (34).
    """
    if isinstance(image, ReachedCells):
        return _of_cells(image)
    lattice, cuts = image.lattice, list[tuple[Array, Index, Array, Index]]()
    for axis, spans in enumerate(image.spans):
        jumps = np.diff((spans.cover > 0).astype(np.int64), prepend=0)
        jumps -= sense * np.diff(spans.degree, prepend=0)
        which = np.flatnonzero(jumps)
        i, j = np.divmod(spans.column[which], lattice.shape[(axis + 2) % 3])
        at = np.roll(np.stack([spans.start[which], i, j], axis=1), axis, axis=1)
        cube = image.cube_places(spans, axis, which)
        cuts.append((cube, np.full(len(which), axis), at, -jumps[which]))
    return _on_lines(lattice, *(np.concatenate(parts) for parts in zip(*cuts, strict=True)))


def _of_cells(cells: ReachedCells) -> BoundarySamples:
    tip_map, wrap = cells.grid.tip_map, cells.wrap
    if not cells.is_thick:
        group = np.arange(len(wrap.vertices)) % (3 * _CLASSES)
        return BoundarySamples(wrap.cube, wrap.vertices, wrap.corner_areas, group)
    crossings, _ = cells.swept
    cube = tip_map.box.to_cube(crossings.beyond)[:, tip_map.box.free].clip(0.0, 1.0)
    at = crossings.coordinates(np.arange(len(cube)), crossings.place)
    return _on_lines(cells.lattice, cube, crossings.axis, at, crossings.sense)


def _on_lines(
    lattice: Lattice, cube: Array, axis: Index, at: Array, sense: Index
) -> BoundarySamples:
    """Nodes at coordinates (n, 3) in cells, where lines along an axis leave the set or enter it."""
    every = np.arange(len(at))
    i, j = (at[every, (axis + k) % 3].astype(np.int64) for k in (1, 2))
    area = np.zeros((len(every), 3))
    area[every, axis] = lattice.cell**2 * sense
    group = _CLASSES * axis + 2 * (i % 2) + j % 2
    return BoundarySamples(cube, lattice.origin + lattice.cell * at, area, group)
