"""The boundary of a solid reachable set as triangles."""

from __future__ import annotations

import numpy as np

from softreach.geometry.surface import Surface, compact_surface, level_set
from softreach.support.arrays import Array
from softreach.workspace.image import Image

_BAND = 2.5  # cells from the boundary beyond which the field is constant
_CLOSEST = 1e-3  # cells: a center on the boundary itself would make triangles without area


def boundary_surface(image: Image, field: Array, volume: float) -> Surface:
    """The closed surface around a volume where the field is constant, by marching cubes.

    The image of a grid is a little small where it is convex: a small offset, the same everywhere,
    gives the surface the extrapolated volume.

    Raises:
        MissingExtra: scikit-image is not installed.
    """
    surface = _level_set(image, field, 0.0)
    if surface.area == 0.0:
        return surface
    offset = (volume - surface.volume) / (surface.area * image.lattice.cell)
    return _level_set(image, field, float(np.clip(offset, -0.5, 0.5)))


def critical_surface(image: Image) -> Surface:
    """All critical triangles: the boundary of the image, and folds and walls inside it."""
    vertices, faces = compact_surface(image.vertices, image.triangles[:, :3])
    lattice = image.lattice
    placed = lattice.origin + vertices * (lattice.cell / image.unit)
    return Surface(vertices=placed, faces=faces)


def signed_field(image: Image) -> Array:
    """Distance of the cell centers to the boundary in cells, negative inside, up to 2.5.

    Along each axis the boundary is located to rounding between two centers. A plane that cuts the
    axes at distances a, b, c is 1/√(1/a² + 1/b² + 1/c²) away: linear interpolation between centers
    gives the crossings back, to second order in the cell on a curved boundary.

    Returns:
        Of the lattice's shape.
    """
    inverse_square = np.zeros(image.lattice.shape)
    for axis in range(3):
        along = np.full(image.lattice.shape, np.inf)  # beyond two cells from the boundary
        index, behind = image.boundary_crossings(axis)
        for step in (-1, 0, 1, 2):
            shifted = list(index)
            shifted[axis] = index[axis] + step
            np.minimum.at(along, tuple(shifted), np.abs(behind - step).clip(_CLOSEST))
        inverse_square += along**-2
    with np.errstate(divide="ignore"):
        distance = np.clip(inverse_square**-0.5, _CLOSEST, _BAND)
    return np.where(image.counts[0] > 0, -distance, distance)


def _level_set(image: Image, field: Array, level: float) -> Surface:
    if not (field < level).any():
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    (vertices, faces), lattice = level_set(field, level), image.lattice
    return Surface(vertices=lattice.origin + lattice.cell * vertices, faces=faces)
