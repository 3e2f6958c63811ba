"""An octree over the images of the activation cells, so that a target costs no search."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.activation_mesh import ActivationMesh, face_planes
from softreach.kernels.space_tree import SpaceTree, sort_into_children

__all__ = ["image_tree"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_LEAF = 24  # a node with no more tetrahedra is not divided
_MOST_LEVELS = 10
_MOST_ITEMS = 8_000_000
_OCTANTS = np.array([[o >> 2 & 1, o >> 1 & 1, o & 1] for o in range(8)])


def image_tree(mesh: ActivationMesh) -> SpaceTree:
    """Divide space until few tetrahedra remain in each place."""
    planes = np.empty((6 * len(mesh.corner), 4, 4))
    face_planes(mesh, 1e-9 * float(np.nanmax(mesh.tip) - np.nanmin(mesh.tip)), planes)
    boxes = np.repeat(_image_boxes(mesh), 6, axis=0)
    low = boxes[:, 0].min(axis=0)
    size = float((boxes[:, 1].max(axis=0) - low).max())
    growing = _Growing(planes, boxes, low, size)
    for _ in range(_MOST_LEVELS):
        if not growing.divide():
            break
    return growing.finished()


def _image_boxes(mesh: ActivationMesh) -> Array:
    images = mesh.tip[mesh.corner]
    error = mesh.interpolation_error[:, None]
    return np.stack([images.min(axis=1) - error, images.max(axis=1) + error], 1)


class _Growing:
    """The tree down to one depth, with the nodes of that depth still open."""

    def __init__(self, planes: Array, boxes: Array, low: Array, size: float) -> None:
        self.planes, self.boxes, self.low, self.size = planes, boxes, low, size
        self.edge = size
        self.corner = low[None]
        self.child: list[Index] = []
        self.first, self.count = np.zeros(1, np.int64), np.array([len(planes)])
        self.item = np.arange(len(planes), dtype=np.int32)
        self.nodes = 1
        self.done: list[tuple[Index, Index]] = []
        self.items: list[NDArray[np.int32]] = []
        self.listed = 0

    def divide(self) -> bool:
        """Divide every node of the last depth that holds many items; return whether any did."""
        many = self.count > self._largest_leaf()
        if not many.any():
            return False
        self._close(many)
        self.edge /= 2
        corner = self.corner[many][:, None] + self.edge * _OCTANTS
        first, count = self.first[many], self.count[many]
        counts = np.zeros((len(first), 8), np.int64)
        arguments = (self.planes, self.boxes, corner + self.edge / 2, self.edge / 2, first, count)
        sort_into_children(*arguments, self.item, counts, counts, np.empty(0, np.int32))
        starts = (np.cumsum(counts) - counts.ravel()).reshape(counts.shape)
        item = np.empty(int(counts.sum()), np.int32)
        sort_into_children(*arguments, self.item, np.empty_like(counts), starts, item)
        self.corner = corner.reshape(-1, 3)
        self.first, self.count, self.item = starts.ravel(), counts.ravel(), item
        return True

    def _largest_leaf(self) -> int:
        """Divide the fullest nodes, as many as leave room for the lists (four times as long)."""
        counts = np.sort(self.count)[::-1]
        affordable = self.listed + 3 * np.cumsum(counts) + counts.sum() <= _MOST_ITEMS
        first_left = int(np.argmin(affordable)) if not affordable.all() else len(counts)
        return max(_LEAF, int(counts[first_left]) if first_left < len(counts) else 0)

    def _close(self, open_nodes: NDArray[np.bool_]) -> None:
        """Number the children of open nodes; list the items of the others for good."""
        child = np.zeros(len(open_nodes), np.int64)
        child[open_nodes] = self.nodes + 8 * np.arange(int(open_nodes.sum()))
        self.nodes += 8 * int(open_nodes.sum())
        self.child.append(child)
        leaf = ~open_nodes
        count = np.where(leaf, self.count, 0)
        listed = (
            np.repeat(leaf, self.count) if len(self.count) > 1 else np.zeros(len(self.item), bool)
        )
        self.done.append((self.listed + np.cumsum(count) - count, count))
        self.items.append(self.item[listed])
        self.listed += int(count.sum())

    def finished(self) -> SpaceTree:
        """The tree with its last nodes as leaves."""
        self._close(np.zeros(len(self.count), bool))
        first, count = (np.concatenate(part) for part in zip(*self.done, strict=True))
        return SpaceTree(
            self.planes,
            self.low,
            self.size,
            np.concatenate(self.child),
            first,
            count,
            np.concatenate(self.items),
        )
