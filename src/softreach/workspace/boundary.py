"""The boundary of a solid reachable set as triangles."""

from __future__ import annotations

import numpy as np

from softreach.geometry.surface import Surface, compact_surface
from softreach.support.arrays import Array
from softreach.support.errors import MissingExtra
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
        inverse_square += _axis_distances(image, axis) ** -2
    with np.errstate(divide="ignore"):
        distance = np.clip(inverse_square**-0.5, _CLOSEST, _BAND)
    return np.where(image.counts[0] > 0, -distance, distance)


def _axis_distances(image: Image, axis: int) -> Array:
    """Distance to the boundary along an axis, in cells; infinite beyond two of them."""
    distance = np.full(image.lattice.shape, np.inf)
    index, behind = image.boundary_crossings(axis)
    for step in (-1, 0, 1, 2):
        shifted = list(index)
        shifted[axis] = index[axis] + step
        away = np.abs(behind - step).clip(_CLOSEST)
        np.minimum.at(distance, tuple(shifted), away)
    return distance


def _level_set(image: Image, field: Array, level: float) -> Surface:
    """Surface where the field, in cells, has a value."""
    try:
        from skimage.measure import marching_cubes
    except ImportError as error:
        raise MissingExtra(("scikit-image", "surface")) from error
    if not (field < level).any():
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    vertices, faces, _, _ = marching_cubes(
        field, level, gradient_direction="descent", allow_degenerate=False
    )
    lattice = image.lattice
    return Surface(vertices=lattice.origin + lattice.cell * vertices.astype(float), faces=faces)
