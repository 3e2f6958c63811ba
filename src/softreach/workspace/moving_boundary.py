"""The boundary of a reachable set as triangles that move when the design changes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.parameters import Parameter
from softreach.support import parallel
from softreach.support.arrays import Array, Index
from softreach.workspace.boundary import boundary_samples
from softreach.workspace.flux import face_image, grid_faces
from softreach.workspace.solid import ReachableSolid
from softreach.workspace.tip_derivatives import TipDerivatives

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_CELLS = 40  # along each edge of the box, where its faces are the boundary
_BLOCK = 1 << 21  # numbers at once
_SLIVER = 1e-2  # of the mean area: the normal of what is smaller tells nothing


@dataclass(frozen=True, eq=False)
class MovingBoundary:
    """Triangles of the boundary, and what each sweeps when a parameter changes.

    With the velocity v = ∂r/∂p of the places of the activation box that lead to the boundary, a
    triangle of outward area vector A sweeps the volume v · A per unit of p: what is added or lost
    there, to first order, by itself.
    """

    places: Array
    """Centers of the triangles [m], shape (n, 3)."""
    area: Array
    """Their areas [m²], shape (n,)."""
    swept: Array
    """v · A [m³ per unit], shape (n, parameters)."""

    @classmethod
    def of(cls, solid: ReachableSolid, parameters: Sequence[Parameter]) -> MovingBoundary:
        """The boundary of a set, and its velocity by some parameters.

        Where the map is one to one, its triangles are images of triangles on the faces of the box;
        elsewhere they are found in the raster and move as the nearest place does at which a line
        of sight cuts the boundary.

        Raises:
            InvalidInput: A parameter counts something, has no value, or its change holds or frees a
                bundle.
            InvalidDesign: The design has no neighbors with other values of a parameter.
            MissingExtra: scikit-image is not installed.
        """
        tips = TipDerivatives(solid.tip_map, parameters)
        by_faces = solid.route == "flux"
        surface = face_image(solid.tip_map, _CELLS) if by_faces else solid.surface()
        centers = surface.vertices[surface.faces].mean(axis=1)
        if by_faces:
            velocity = tips.at(grid_faces(_CELLS))[surface.faces].mean(axis=1)
        else:
            from scipy.spatial import KDTree

            nodes = boundary_samples(solid.image)
            used, which = np.unique(KDTree(nodes.places).query(centers)[1], return_inverse=True)
            velocity = tips.at(nodes.cube[used])[which]
        a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
        area = 0.5 * np.cross(b - a, c - a)
        swept = np.nan_to_num(np.einsum("ni,nip->np", area, velocity))
        return cls(centers, np.linalg.norm(area, axis=1), swept)

    def lost(self, changes: Array) -> Array:
        """Volume of what is no longer reached after changes of the parameters [m³].

        Args:
            changes: Shape (draws, parameters).

        Returns:
            Shape (draws,).
        """
        out, swept = np.empty(len(changes)), self.swept.astype(np.float32)

        def task(block: slice) -> None:
            volumes = changes[block].astype(np.float32) @ swept.T
            out[block] = -np.minimum(volumes, 0.0, out=volumes).sum(axis=1, dtype=float)

        size = max(1, _BLOCK // max(1, len(self.area)))
        parallel.run(partial(task, block) for block in parallel.blocks(len(changes), size))
        return out

    def mean_lost(self, deviations: Array) -> float:
        """Its mean over independent normal changes of these deviations: ∮ σ_n dA / √(2π) [m³]."""
        across = np.linalg.norm(self.swept * deviations, axis=1).sum()
        return float(across / np.sqrt(2.0 * np.pi))

    @property
    def growth(self) -> Array:
        """Derivatives of the volume [m³ per unit], shape (parameters,)."""
        return self.swept.sum(axis=0)

    def speed_at(self, points: Array) -> Array:
        """Velocity of the nearest part of the boundary outwards [m per unit], (n, parameters)."""
        rows = self._wide[self._tree.query(points)[1]]
        return self.swept[rows] / self.area[rows, None]

    def distance(self, points: Array) -> Array:
        """Distance to the center of the nearest triangle [m], shape (n,)."""
        return np.asarray(self._tree.query(points)[0])

    @cached_property
    def _wide(self) -> Index:
        """Numbers of the triangles that are no slivers."""
        return np.flatnonzero(self.area > _SLIVER * self.area.mean())

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self.places[self._wide])
