"""A tip map prepared for the inverse problem: what is computed once and serves all targets."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.inverse.cells import ImageLeaves, TornCells, activation_cells, image_tree
from softreach.inverse.proofs import CoarseCells
from softreach.inverse.seeds import Seeds, face_seeds, seeds
from softreach.kernels.branches.candidates import SpaceTree
from softreach.kernels.image.activation_mesh import ActivationMesh
from softreach.rod.rods import as_tip_map, coarsened, free_bundles, measured_bundles
from softreach.rod.tip_map import Frame, TipMap
from softreach.support.arguments import as_integer, as_one_of
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy
from softreach.workspace.postures import all_postures

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
    """With three free bundles: cells along each axis of the activation box."""

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
